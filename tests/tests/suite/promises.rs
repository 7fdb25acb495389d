//! Each promise of docs/security.md is shown by a test that exists.

use std::fs;
use std::path::{Path, PathBuf};

/// All sources below a folder.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|end| end == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn promises_name_tests_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = vec![];
    for folder in ["coordinator", "shared", "worker", "tests/tests"] {
        sources(&root.join(folder), &mut files);
    }
    let texts: Vec<String> = files.iter().map(|file| fs::read_to_string(file).unwrap()).collect();
    let is_test = |name: &str| {
        let is_module = |file: &PathBuf| {
            file.file_stem().is_some_and(|stem| stem == name)
                || file.parent().and_then(Path::file_name).is_some_and(|folder| folder == name)
        };
        texts.iter().any(|text| text.contains(&format!("fn {name}()"))) || files.iter().any(is_module)
    };
    let page = fs::read_to_string(root.join("docs/security.md")).unwrap();
    let rows = page
        .lines()
        .skip_while(|line| !line.starts_with("| promise |"))
        .take_while(|line| line.starts_with('|'));
    let mut count = 0;
    for row in rows.skip(2) {
        let shown = row.split('|').nth(3).unwrap();
        let names: Vec<&str> = shown.split('`').skip(1).step_by(2).collect();
        assert!(!names.is_empty(), "no test shows: {row}");
        for name in names {
            let last = name.rsplit("::").next().unwrap();
            assert!(is_test(last), "there is no test {name}: {row}");
            count += 1;
        }
    }
    assert!(count > 20, "{count} tests");
}
