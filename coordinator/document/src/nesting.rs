//! How deep the JSON of a file is nested: objects that nobody looks at, such as extras, are written as they were read, and what is
//! nested too deep cannot be.

use super::error::ImportProblem;

/// Most objects and lists within one another. Those of glTF itself are ten.
const DEEPEST: usize = 100;

/// Checks that nothing is nested deeper than it can be written again.
pub(crate) fn check(json: &[u8]) -> Result<(), ImportProblem> {
    let mut place = Place::default();
    let (mut depth, mut at) = (0usize, 0);
    while let Some(&byte) = json.get(at) {
        match byte {
            b'"' => {
                let end = end_of_string(json, at + 1);
                if depth == 1 {
                    place.enter(&json[at + 1..end.min(json.len())]);
                }
                at = end;
            }
            b'{' | b'[' => {
                depth += 1;
                if depth > DEEPEST {
                    return Err(ImportProblem::NestedTooDeep { place: place.words(), limit: DEEPEST });
                }
            }
            b'}' | b']' => depth = depth.saturating_sub(1),
            b',' if depth == 2 => place.index += 1,
            _ => {}
        }
        at += 1;
    }
    Ok(())
}

/// Where the closing quotation mark of a string is.
fn end_of_string(json: &[u8], mut at: usize) -> usize {
    while let Some(&byte) = json.get(at) {
        match byte {
            b'"' => return at,
            b'\\' => at += 2,
            _ => at += 1,
        }
    }
    json.len()
}

/// The member of the document, and the element of its list.
#[derive(Default)]
struct Place {
    member: String,
    index: usize,
}

impl Place {
    /// Longest name that a message repeats.
    const LONGEST: usize = 40;

    /// Called with each string at the top: names of members, and values, which no list or object follows.
    fn enter(&mut self, name: &[u8]) {
        self.member = String::from_utf8_lossy(&name[..name.len().min(Self::LONGEST)]).into_owned();
        self.index = 0;
    }

    fn words(&self) -> String {
        match self.member.as_str() {
            "" => "the document".to_owned(),
            "asset" | "extras" | "extensions" => self.member.clone(),
            list => format!("{list}[{}]", self.index),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_of_what_is_too_deep_is_named() {
        let nested = |depth: usize| format!("{}{}", "[".repeat(depth), "]".repeat(depth));
        let file = |depth| {
            format!(
                r#"{{ "asset": {{ "version": "2.0" }}, "nodes": [{{ "name": "[[\"{{" }}, {{ "extras": {} }}] }}"#,
                nested(depth)
            )
        };
        check(file(DEEPEST - 3).as_bytes()).unwrap();
        for depth in [DEEPEST - 2, 1_000_000] {
            let problem = check(file(depth).as_bytes()).unwrap_err();
            assert!(
                matches!(&problem, ImportProblem::NestedTooDeep { place, .. } if place == "nodes[1]"),
                "{problem}"
            );
        }
        for torn in ["\"", "\"\\", "{\"a", "]]]", "{\"a\\"] {
            check(torn.as_bytes()).unwrap();
        }
    }
}
