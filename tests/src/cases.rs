//! The cases of `references/form_factors.json`: view factors and radiosities with values from 60-digit arithmetic.

use glam::DVec3;
use serde_json::Value;

/// One case.
pub struct Case(Value);

/// All cases, in the order of the file.
///
/// # Panics
/// When the file cannot be read: the tests cannot go on without it.
#[must_use]
pub fn all() -> Vec<Case> {
    let text = std::fs::read_to_string(crate::data("references/form_factors.json"))
        .expect("the file is in this crate");
    let file: Value = serde_json::from_str(&text).expect("the file is JSON");
    file["cases"].as_array().expect("cases is a list").iter().cloned().map(Case).collect()
}

/// The case with this id.
///
/// # Panics
/// When there is none.
#[must_use]
pub fn case(id: &str) -> Case {
    all().into_iter().find(|case| case.id() == id).unwrap_or_else(|| panic!("no case {id}"))
}

impl Case {
    /// Short name, such as `A01`.
    #[must_use]
    pub fn id(&self) -> &str {
        self.0["id"].as_str().unwrap_or_default()
    }

    /// Which kind of case it is.
    #[must_use]
    pub fn group(&self) -> &str {
        self.0["group"].as_str().unwrap_or_default()
    }

    /// The expected values, one or several.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        numbers(&self.0["value_f64"])
    }

    /// A part of the geometry.
    #[must_use]
    pub fn geometry(&self, name: &str) -> &Value {
        &self.0["geometry"][name]
    }

    /// A point of the geometry.
    #[must_use]
    pub fn point(&self, name: &str) -> DVec3 {
        point(self.geometry(name))
    }

    /// A list of numbers of the geometry.
    #[must_use]
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        numbers(self.geometry(name))
    }

    /// A polygon of the geometry.
    #[must_use]
    pub fn polygon(&self, name: &str) -> Vec<DVec3> {
        polygon(self.geometry(name))
    }
}

/// Reads a polygon.
///
/// # Panics
/// When the value is not a list of points.
#[must_use]
pub fn polygon(value: &Value) -> Vec<DVec3> {
    value.as_array().expect("a list of points").iter().map(point).collect()
}

/// Reads a point.
///
/// # Panics
/// When the value is not a list of three numbers.
#[must_use]
pub fn point(value: &Value) -> DVec3 {
    DVec3::new(number(&value[0]), number(&value[1]), number(&value[2]))
}

/// Reads a list of numbers, or one.
///
/// # Panics
/// When the value is neither.
#[must_use]
pub fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().map(number).collect(),
        single => vec![number(single)],
    }
}

/// Reads a number; those that f64 does not hold exactly stand as strings.
fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .or_else(|| value.as_str()?.parse().ok())
        .unwrap_or_else(|| panic!("{value} is not a number"))
}
