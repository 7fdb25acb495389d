//! Which modules of a crate use which, read out of its sources.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Graph, read};

/// A module: its path in the crate, and its source as tokens.
type Modules = BTreeMap<Vec<String>, Vec<String>>;

/// The modules of a crate, but for those of tests.
pub fn modules(source: &Path) -> Modules {
    let mut modules = Modules::new();
    let roots = ["lib.rs", "main.rs"].map(|name| source.join(name));
    let roots = roots.iter().filter(|root| root.is_file());
    roots.for_each(|root| collect(root, source, &[], &mut modules));
    modules
}

/// Adds the module in `file`, and those that it declares; their files are in `folder`.
fn collect(file: &Path, folder: &Path, path: &[String], modules: &mut Modules) {
    let tokens = without_tests(tokens(&read(file)));
    for declared in tokens.windows(3).filter(|window| window[0] == "mod" && window[2] == ";") {
        let (name, path) = (&declared[1], [path, &declared[1..2]].concat());
        let below = folder.join(name);
        let beside = folder.join(format!("{name}.rs"));
        let file = if beside.is_file() { beside } else { below.join("mod.rs") };
        collect(&file, &below, &path, modules);
    }
    modules.entry(path.to_vec()).or_default().extend(tokens);
}

/// Identifiers, `::` and single other characters, without comments, strings and lifetimes.
fn tokens(source: &str) -> Vec<String> {
    let text: Vec<char> = source.chars().collect();
    let at = |place: usize| text.get(place).copied().unwrap_or('\0');
    let (mut found, mut place) = (Vec::new(), 0);
    while place < text.len() {
        let start = place;
        let hashes = text[place + 1..].iter().take_while(|&&character| character == '#').count();
        match (text[place], at(place + 1)) {
            ('/', '/') => place += text[place..].iter().take_while(|&&c| c != '\n').count(),
            ('r', '"' | '#') if at(place + 1 + hashes) == '"' => {
                let end: String = std::iter::once('"').chain((0..hashes).map(|_| '#')).collect();
                place += 2 + hashes;
                while !text[place..].iter().zip(end.chars()).all(|(&found, end)| found == end) {
                    place += 1;
                }
                place += end.len();
            }
            ('"', _) => {
                place += 1;
                while at(place) != '"' {
                    place += if at(place) == '\\' { 2 } else { 1 };
                }
                place += 1;
            }
            ('\'', '\\') => {
                place += 3;
                while at(place) != '\'' {
                    place += 1;
                }
                place += 1;
            }
            ('\'', _) => place += if at(place + 2) == '\'' { 3 } else { 1 },
            (':', ':') => {
                found.push("::".to_owned());
                place += 2;
            }
            (first, _) if first.is_alphanumeric() || first == '_' => {
                place += text[start..].iter().take_while(|c| c.is_alphanumeric() || **c == '_').count();
                found.push(text[start..place].iter().collect());
            }
            (other, _) => {
                found.extend((!other.is_whitespace()).then(|| other.to_string()));
                place += 1;
            }
        }
    }
    found
}

/// Leaves out each item after `#[cfg(test)]`: to its semicolon or the end of its braces.
fn without_tests(tokens: Vec<String>) -> Vec<String> {
    const MARK: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let (mut kept, mut place) = (Vec::new(), 0);
    while place < tokens.len() {
        if !tokens[place..].iter().map(String::as_str).take(MARK.len()).eq(MARK) {
            kept.push(tokens[place].clone());
            place += 1;
            continue;
        }
        let mut depth = 0;
        loop {
            depth += i32::from(tokens[place] == "{") - i32::from(tokens[place] == "}");
            let ends = depth == 0 && (tokens[place] == ";" || tokens[place] == "}");
            place += 1;
            if ends {
                break;
            }
        }
    }
    kept
}

/// The paths in a module that begin with `crate` or `super`, as paths from the crate's root; and of its `use` declarations,
/// each name that they bring in with its path.
fn paths(module: &[String], tokens: &[String]) -> (Vec<Vec<String>>, BTreeMap<String, Vec<String>>) {
    let (mut all, mut names) = (Vec::new(), BTreeMap::new());
    for (place, token) in tokens.iter().enumerate() {
        let before = place.checked_sub(1).map_or("", |before| tokens[before].as_str());
        let is_use = before == "use";
        let starts = is_use || (["crate", "super"].contains(&token.as_str()) && before != "::");
        if starts && tokens.get(place + 1).is_some_and(|next| next == "::" || is_use) {
            let mut found = Vec::new();
            tree(&tokens[place..], &mut Vec::new(), &mut found);
            for (path, alias) in found {
                let path = from_root(module, &path);
                if is_use {
                    names.insert(alias, path.clone());
                }
                all.push(path);
            }
        }
    }
    (all, names)
}

/// Adds the paths of a `use` tree, or of a path in an expression, with the name by which each is known; returns the number of
/// its tokens.
fn tree(tokens: &[String], prefix: &mut Vec<String>, found: &mut Vec<(Vec<String>, String)>) -> usize {
    let depth = prefix.len();
    let mut place = 0;
    let mut alias = None;
    loop {
        match tokens[place].as_str() {
            "{" => {
                place += 1;
                while tokens[place] != "}" {
                    place += tree(&tokens[place..], prefix, found);
                    place += usize::from(tokens[place] == ",");
                }
                prefix.truncate(depth);
                return place + 1;
            }
            "*" => {}
            name => prefix.push(name.to_owned()),
        }
        place += 1;
        match tokens.get(place).map(String::as_str) {
            Some("::") if tokens[place + 1] != "<" => place += 1,
            Some("as") => {
                alias = Some(tokens[place + 1].clone());
                place += 2;
                break;
            }
            _ => break,
        }
    }
    if prefix.len() > 1 && prefix.last().is_some_and(|last| last == "self") {
        prefix.pop();
    }
    found.push((prefix.clone(), alias.or_else(|| prefix.last().cloned()).unwrap_or_default()));
    prefix.truncate(depth);
    place
}

/// A path of a module as one from the crate's root. What begins with neither `crate`, `self` nor `super` is below the module.
fn from_root(module: &[String], path: &[String]) -> Vec<String> {
    let mut root = module.to_vec();
    for (index, name) in path.iter().enumerate() {
        match name.as_str() {
            "crate" => root.clear(),
            "self" => {}
            "super" => drop(root.pop()),
            _ => return [&root, &path[index..]].concat(),
        }
    }
    root
}

/// The module that a path leads to: re-exported names are followed to where they stand.
fn target(
    path: &[String],
    modules: &Modules,
    names: &BTreeMap<Vec<String>, BTreeMap<String, Vec<String>>>,
) -> Vec<String> {
    let mut path = path.to_vec();
    for _ in 0..8 {
        let depth = (0..=path.len()).rev().find(|&depth| modules.contains_key(&path[..depth])).unwrap();
        let Some(name) = path.get(depth) else { break };
        match names[&path[..depth]].get(name) {
            Some(behind) if *behind != path => path = [behind, &path[depth + 1..]].concat(),
            _ => {
                path.truncate(depth);
                break;
            }
        }
    }
    path.truncate((0..=path.len()).rev().find(|&depth| modules.contains_key(&path[..depth])).unwrap());
    path
}

/// For each module with others below it, which of those use which.
pub fn levels(modules: &Modules) -> BTreeMap<String, Graph> {
    let read: BTreeMap<_, _> =
        modules.iter().map(|(module, tokens)| (module.clone(), paths(module, tokens))).collect();
    let names = read.iter().map(|(module, (_, names))| (module.clone(), names.clone())).collect();
    let mut levels: BTreeMap<String, Graph> = BTreeMap::new();
    for (module, (paths, _)) in &read {
        for path in paths {
            let used = target(path, modules, &names);
            let shared = module.iter().zip(&used).take_while(|(a, b)| a == b).count();
            if let (Some(user), Some(used)) = (module.get(shared), used.get(shared)) {
                let level = levels.entry(module[..shared].join("::")).or_default();
                level.entry(user.clone()).or_default().insert(used.clone());
            }
        }
    }
    levels
}

#[test]
fn uses_are_read() {
    let module = |path: &[&str]| path.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let source = |text: &str| without_tests(tokens(text));
    let modules = Modules::from([
        (module(&[]), source("mod a; mod b; pub use b::{self, Shape as Form}; // use crate::a;")),
        (module(&["a"]), source("fn f() { let _ = (crate::Form, \"crate::c::x\", 'x'); }")),
        (
            module(&["b"]),
            source("mod c; mod d; pub(crate) fn g<'a>(x: &'a u8) {} #[cfg(test)] mod t { use crate::a; }"),
        ),
        (module(&["b", "c"]), source("use super::{super::a::{Size, self}, d::e as f};")),
        (module(&["b", "d"]), source("use super::c;")),
    ]);
    let found = levels(&modules);
    assert_eq!(found[""], super::graph(&[("a", "b"), ("b", "a")]));
    assert_eq!(found["b"], super::graph(&[("c", "d"), ("d", "c")]));
}
