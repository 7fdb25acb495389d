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

/// What stands before a test.
const MARKS: [&str; 2] = ["#[test]", "#[tokio::test"];

fn has_test(text: &str) -> bool {
    MARKS.iter().any(|mark| text.contains(mark))
}

/// Whether a source has a test of this name: between its mark and its name stand attributes only.
fn has_test_called(text: &str, name: &str) -> bool {
    text.match_indices(&format!("fn {name}()")).any(|(at, _)| {
        let before = text[..at].lines().rev();
        let attributes = before.skip_while(|line| matches!(line.trim(), "" | "async"));
        attributes.take_while(|line| line.trim_start().starts_with('#')).any(has_test)
    })
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
        let of_module = files.iter().zip(&texts).filter(|(file, _)| is_module(file));
        texts.iter().any(|text| has_test_called(text, name))
            || of_module.into_iter().any(|(_, text)| has_test(text))
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
