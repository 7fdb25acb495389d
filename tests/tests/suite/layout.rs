//! Which crates and modules may know which.
//!
//! Manifests and sources are read as text. Comments, strings and what is compiled for tests only do not count.

mod sources;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};

/// Arrows from each name to those that it uses.
type Graph = BTreeMap<String, BTreeSet<String>>;

/// Above the kernel, everything that a bake is computed with is free of these.
const NETWORK: [&str; 4] = ["hyper", "rustls", "tokio", "tonic"];

/// What a crate must not depend on, directly or through another crate of the workspace. Tests may.
const MUST_NOT_KNOW: [(&str, &[&str]); 12] = [
    (
        "kernel",
        &["protocol", "worker", "document", "scene", "bake", "cluster", "output", "verify", "service"],
    ),
    ("protocol", &["worker", "document", "scene", "bake", "cluster", "output", "verify", "service"]),
    ("worker", &["document", "scene", "bake", "cluster", "output", "verify", "service"]),
    (
        "document",
        &["kernel", "protocol", "worker", "scene", "bake", "cluster", "output", "verify", "service"],
    ),
    (
        "files",
        &[
            "kernel", "protocol", "worker", "document", "scene", "bake", "cluster", "output", "verify",
            "service",
        ],
    ),
    ("scene", &["protocol", "worker", "bake", "cluster", "output", "verify", "service"]),
    ("bake", &["files", "protocol", "worker", "cluster", "output", "verify", "service"]),
    ("lightmap", &["protocol", "worker", "bake", "cluster", "output", "verify", "service"]),
    ("probes", &["files", "protocol", "worker", "bake", "cluster", "output", "verify", "service"]),
    ("view_factors", &["protocol", "worker", "cluster", "output", "verify", "service"]),
    ("output", &["protocol", "worker", "cluster", "verify", "service"]),
    ("verify", &["protocol", "worker", "scene", "bake", "cluster", "output", "service"]),
];

/// Crates that must not know [`NETWORK`] either.
const PURE: [&str; 10] = [
    "kernel",
    "document",
    "files",
    "scene",
    "lightmap",
    "probes",
    "bake",
    "view_factors",
    "output",
    "verify",
];

/// The folder of each crate of the workspace.
fn crates() -> BTreeMap<String, PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let folders = |parent: &str| {
        fs::read_dir(root.join(parent)).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>()
    };
    let mut all = [folders("coordinator"), folders("shared"), vec![root.join("worker")]].concat();
    all.retain(|folder| folder.join("Cargo.toml").is_file());
    let named = |folder: PathBuf| (name_in(&read(&folder.join("Cargo.toml"))), folder);
    all.into_iter().map(named).collect()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn name_in(manifest: &str) -> String {
    let line = manifest.lines().find_map(|line| line.strip_prefix("name = ")).unwrap();
    line.trim_matches('"').to_owned()
}

/// The names below `[dependencies]`.
fn dependencies_in(manifest: &str) -> BTreeSet<String> {
    let lines = manifest.lines().skip_while(|line| *line != "[dependencies]").skip(1);
    let lines = lines.take_while(|line| !line.starts_with('['));
    let name = |line: &str| line.split(['.', '=', ' ']).next().unwrap_or_default().to_owned();
    lines.map(name).filter(|name| !name.is_empty() && !name.starts_with('#')).collect()
}

/// Everything that can be reached from `start`.
fn reached(graph: &Graph, start: &str) -> BTreeSet<String> {
    let (mut found, mut open) = (BTreeSet::new(), vec![start.to_owned()]);
    while let Some(next) = open.pop() {
        let new = graph.get(&next).into_iter().flatten().filter(|name| found.insert((*name).clone()));
        open.extend(new.cloned());
    }
    found
}

/// The nodes of a shortest cycle through the first node that has one; that node again at the end.
fn cycle(graph: &Graph) -> Option<Vec<String>> {
    graph.keys().find_map(|start| {
        let (mut seen, mut open) = (BTreeSet::new(), VecDeque::from([vec![start.clone()]]));
        while let Some(path) = open.pop_front() {
            for next in graph.get(path.last()?).into_iter().flatten() {
                let longer = [&path[..], std::slice::from_ref(next)].concat();
                if next == start {
                    return Some(longer);
                }
                if seen.insert(next) {
                    open.push_back(longer);
                }
            }
        }
        None
    })
}

fn graph(arrows: &[(&str, &str)]) -> Graph {
    let mut graph: Graph = BTreeMap::new();
    for (from, to) in arrows {
        graph.entry((*from).to_owned()).or_default().insert((*to).to_owned());
    }
    graph
}

#[test]
fn cycles_are_found() {
    assert_eq!(cycle(&graph(&[("a", "b"), ("a", "c"), ("b", "c")])), None);
    let arrows = [("a", "b"), ("b", "c"), ("b", "e"), ("c", "a1"), ("a1", "c"), ("c", "d"), ("d", "b")];
    assert_eq!(cycle(&graph(&arrows)).unwrap().join(" "), "a1 c a1");
    assert_eq!(cycle(&graph(&arrows[..4])), None);
    assert_eq!(cycle(&graph(&[("a", "a")])).unwrap().join(" "), "a a");
}

/// No two modules of a folder depend on each other, however long the way round.
#[test]
fn no_module_depends_on_itself() {
    let mut wrong = Vec::new();
    for (name, folder) in crates() {
        for (level, graph) in sources::levels(&sources::modules(&folder.join("src"))) {
            let place = if level.is_empty() { name.clone() } else { format!("{name}::{level}") };
            if let Some(cycle) = cycle(&graph) {
                wrong.push(format!("{place}: {}", cycle.join(" -> ")));
            }
        }
    }
    assert!(wrong.is_empty(), "modules depend on themselves; move what they share:\n{}", wrong.join("\n"));
}

#[test]
fn crates_know_only_what_they_may() {
    let manifest = |folder: PathBuf| dependencies_in(&read(&folder.join("Cargo.toml")));
    let graph: BTreeMap<_, _> = crates().into_iter().map(|(name, folder)| (name, manifest(folder))).collect();
    assert_eq!(cycle(&graph), None);
    let network = PURE.iter().map(|name| (*name, &NETWORK[..]));
    for (name, forbidden) in MUST_NOT_KNOW.into_iter().chain(network) {
        assert!(graph.contains_key(name), "there is no crate {name}");
        let known = reached(&graph, name);
        let wrong: Vec<_> = forbidden.iter().filter(|other| known.contains(**other)).collect();
        assert!(wrong.is_empty(), "{name} depends on {wrong:?}");
    }
}

/// The sources of a folder and of those below it.
fn sources_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let below = |path: PathBuf| if path.is_dir() { sources_in(&path) } else { vec![path] };
    entries
        .flat_map(below)
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"))
        .collect()
}

/// Whether a comment of documentation has an example that is to be compiled.
fn has_example(source: &str) -> bool {
    let comments = source.lines().filter_map(|line| line.trim().get(..3).zip(line.trim().get(3..)));
    let text = comments.filter(|(mark, _)| ["///", "//!"].contains(mark)).map(|(_, text)| text.trim());
    let mut fences = text.filter_map(|text| text.strip_prefix("```"));
    // Every other one ends what the one before begins.
    std::iter::from_fn(|| {
        let begins = fences.next()?;
        fences.next();
        Some(begins)
    })
    .any(|language| language != "text")
}

/// To look for examples takes seconds a crate. So those without do not look, and those with must.
#[test]
fn examples_in_documentation_are_compiled() {
    assert!(has_example("/// ```\n/// f();\n/// ```") && !has_example("//! ```text\n//! a\n//! ```\nf();"));
    for (name, folder) in crates() {
        if folder.join("src/lib.rs").is_file() {
            let has_examples =
                sources_in(&folder.join("src")).iter().any(|source| has_example(&read(source)));
            let looks = !read(&folder.join("Cargo.toml")).contains("\ndoctest = false\n");
            assert_eq!(looks, has_examples, "`doctest = false` in the manifest of {name}: yes or no?");
        }
    }
}
