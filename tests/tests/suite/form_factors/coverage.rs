//! No case of `form_factors.json` is left out.

use tests::{cases, data};

/// Who checks what: a module of this program and the cases that it names.
const CHECKED: [(&str, &[&str]); 8] = [
    (
        "form_factors/points",
        &[
            "A01", "A02", "A03", "A04", "A06", "A07", "A08", "A09", "A11", "A13", "B01", "B02", "B04", "B05",
            "B07", "B09", "B10", "B11", "B13", "B14", "B15", "B20", "B21", "B23", "B24", "B25", "D18",
        ],
    ),
    (
        "form_factors/polygons",
        &[
            "C01", "C02", "C03", "C04", "C05", "C06", "C08", "C09", "C10", "C12", "C14", "C15", "C20", "C22",
            "C23", "D00", "D22",
        ],
    ),
    ("occlusion", &["C30", "C32"]),
    ("furnace", &["D01", "D02", "D03", "D04"]),
    ("systems", &["D05", "D06", "D07", "D10", "D11", "D13", "D21"]),
    ("spheres", &["D14", "D17"]),
    ("enclosures", &["D20"]),
    ("point_lights", &["D15", "D16"]),
];

/// A new case needs a test and a place in the list; a case that was taken away must leave it.
#[test]
fn every_case_of_the_file_is_checked_by_a_module() {
    let mut listed: Vec<&str> = CHECKED.iter().flat_map(|(_, ids)| ids.iter().copied()).collect();
    listed.sort_unstable();
    let all = cases::all();
    let mut given: Vec<&str> = all.iter().map(cases::Case::id).collect();
    given.sort_unstable();
    assert_eq!(listed, given);
}

/// A module must name the cases that it is listed with, as tests do when they ask for them.
#[test]
fn every_module_names_its_cases() {
    for (module, ids) in CHECKED {
        let source = std::fs::read_to_string(data(&format!("tests/suite/{module}.rs"))).unwrap();
        for id in ids {
            assert!(source.contains(&format!("\"{id}\"")), "{module} does not name {id}");
        }
    }
}
