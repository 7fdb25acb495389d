//! Warnings that a person can read, however large the file is.

use std::collections::{HashMap, HashSet};

/// Places that a warning names.
const NAMED: usize = 3;

/// Warnings of one sort that are told.
const FIRST: usize = 8;

/// Joins warnings that say the same of more places than a warning names: `PLACE: TEXT` of each becomes one that names the first.
/// The others stay as they are, in their order.
#[must_use]
pub fn joined(warnings: Vec<String>) -> Vec<String> {
    let mut places: HashMap<&str, Vec<&str>> = HashMap::new();
    for (place, text) in warnings.iter().filter_map(|warning| warning.split_once(": ")) {
        places.entry(text).or_default().push(place);
    }
    places.retain(|_, places| places.len() > NAMED);
    let mut told = HashSet::new();
    let mut joined = vec![];
    for warning in &warnings {
        let of_many = warning.split_once(": ").and_then(|(_, text)| places.get_key_value(text));
        match of_many {
            None => joined.push(warning.clone()),
            Some((text, places)) if told.insert(text) => {
                let more = places.len() - NAMED;
                joined.push(format!("{} and {more} more: {text}", places[..NAMED].join(", ")));
            }
            Some(_) => {}
        }
    }
    joined
}

/// The first of some warnings, and how many `others` there are where these are several.
#[must_use]
pub fn first(mut warnings: Vec<String>, others: &str) -> Vec<String> {
    let more = warnings.len().saturating_sub(FIRST);
    if more > 1 {
        warnings.truncate(FIRST);
        warnings.push(format!("{more} more {others}"));
    }
    warnings
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
        // Even if their names are the same.
        assert_eq!(joined(vec!["a: b".to_owned(); 4]), ["a, a, a and 1 more: b"]);
    }

    #[test]
    fn only_the_first_of_one_sort_are_told() {
        let dropped =
            |count: usize| (0..count).map(|node| format!("node {node}: dropped")).collect::<Vec<_>>();
        assert_eq!(first(dropped(9), "nodes"), dropped(9));
        let told = first(dropped(11), "nodes");
        assert_eq!((&told[..8], &told[8..]), (&dropped(8)[..], &["3 more nodes".to_owned()][..]));
    }
}
