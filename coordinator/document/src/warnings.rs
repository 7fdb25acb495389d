//! Warnings that a person can read, however large the file is.

/// Places that a warning names.
const NAMED: usize = 3;

/// Joins warnings that say the same of more places than a warning names: `PLACE: TEXT` of each becomes one that names the first.
/// The others stay as they are, in their order.
#[must_use]
pub fn joined(warnings: Vec<String>) -> Vec<String> {
    let places_of = |text: &str| -> Vec<&str> {
        let parts = warnings.iter().filter_map(|warning| warning.split_once(": "));
        parts.filter(|(_, own)| *own == text).map(|(place, _)| place).collect()
    };
    let mut told = std::collections::HashMap::new();
    for (_, text) in warnings.iter().filter_map(|warning| warning.split_once(": ")) {
        *told.entry(text).or_insert(0usize) += 1;
    }
    told.retain(|_, count| *count > NAMED);
    let mut joined = vec![];
    for warning in &warnings {
        let text = warning.split_once(": ").map(|(_, text)| text);
        match text.filter(|text| told.contains_key(text)) {
            None => joined.push(warning.clone()),
            Some(text) if told[text] > 0 => {
                let places = places_of(text);
                let more = places.len() - NAMED;
                joined.push(format!("{} and {more} more: {text}", places[..NAMED].join(", ")));
                told.insert(text, 0);
            }
            Some(_) => {}
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_of_many_places_is_said_once() {
        let few = ["node 1: lines left out", "node 2: lines left out", "node 3: lines left out", "no light"];
        let few = few.map(str::to_owned).to_vec();
        assert_eq!(joined(few.clone()), few);
        let lines = (1..=5).map(|node| format!("node {node}: lines left out"));
        let mut many: Vec<String> = lines.collect();
        many.insert(1, "no light".to_owned());
        many.push("material 1: black".to_owned());
        let expected = ["node 1, node 2, node 3 and 2 more: lines left out", "no light", "material 1: black"];
        assert_eq!(joined(many), expected);
    }
}
