//! The form of the page, as JSON: the options that have a label.

use protocol::api::{BakeOptions, OutputOptions, SceneOptions, SubmitSceneHeader};
use serde_json::{Value as Json, json};

use super::schema::{Kind, Knob, Options};

/// The options that the page offers: path of the field, label, help, kind, range or choices, unit and default.
#[must_use]
pub fn form() -> Json {
    let fields = [
        fields::<BakeOptions>(),
        fields::<SceneOptions>(),
        fields::<OutputOptions>(),
        fields::<SubmitSceneHeader>(),
    ];
    Json::Array(fields.into_iter().flatten().collect())
}

fn fields<M: Options>() -> Vec<Json> {
    M::KNOBS.iter().filter(|knob| !knob.label.is_empty()).map(field).collect()
}

fn field<M: Options>(knob: &Knob<M>) -> Json {
    let (kind, range, choices) = match &knob.kind {
        Kind::Number(range) => ("number", json!([range.start(), range.end()]), Json::Null),
        Kind::Fraction(range) => ("fraction", json!([range.start(), range.end()]), Json::Null),
        Kind::Whole(range) => ("whole", json!([*range.start() as f64, *range.end() as f64]), Json::Null),
        Kind::Flag => ("flag", Json::Null, Json::Null),
        Kind::Text => ("text", Json::Null, Json::Null),
        Kind::Colour => ("colour", Json::Null, Json::Null),
        Kind::Choice(choices) => {
            let choices =
                choices.iter().map(|choice| json!({ "value": choice.number, "label": choice.help }));
            ("choice", Json::Null, choices.collect())
        }
    };
    json!({
        "path": knob.path, "label": knob.label, "help": knob.help, "unit": knob.unit, "default": knob.default_text(),
        "kind": kind, "range": range, "choices": choices,
    })
}

#[cfg(test)]
mod tests {
    use super::super::schema::Value;
    use super::*;

    fn paths<M: Options>() -> Vec<&'static str> {
        M::KNOBS.iter().map(|knob| knob.path).collect()
    }

    #[test]
    fn the_page_has_the_main_options() {
        let form = form();
        let fields: Vec<_> =
            form.as_array().unwrap().iter().map(|field| field["path"].as_str().unwrap()).collect();
        assert_eq!(
            fields,
            ["bake.quality", "bake.error", "bake.max_vertices", "scene.light_unit", "priority"]
        );
        assert_eq!(form[2]["default"], "200000, or twice those of the scene where that is more");
    }

    #[test]
    fn each_option_has_help_and_takes_its_default() {
        fn check<M: Options>() {
            for knob in M::KNOBS {
                assert!(!knob.help.is_empty(), "{}", knob.path);
                if let Some(value) = knob.default_value() {
                    assert!(knob.kind.allows(&value), "{}", knob.path);
                    if !matches!(value, Value::Text(_)) {
                        assert_eq!(knob.kind.parse(&knob.kind.show(&value)), Ok(value), "{}", knob.path);
                    }
                }
            }
        }
        check::<BakeOptions>();
        check::<SceneOptions>();
        check::<OutputOptions>();
        check::<SubmitSceneHeader>();
    }

    #[test]
    fn every_field_of_a_bake_is_an_option() {
        let debug = format!("{:?}", BakeOptions::default());
        let fields = debug.matches(": ").count();
        assert_eq!(paths::<BakeOptions>().len(), fields, "{debug}");
    }
}
