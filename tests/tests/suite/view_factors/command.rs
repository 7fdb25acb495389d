//! The command `form-factors`.

use std::collections::HashMap;
use std::fs;

use serde_json::Value;
use tests::builder::{Material, SceneBuilder, pack};
use tests::scene_command::SceneCommand;
use tests::shapes;

fn bench_of(glb: &[u8]) -> SceneCommand {
    SceneCommand::new("form-factors", glb)
}

/// A room with a box in it, one wall of which is missing.
fn open_room() -> SceneBuilder {
    let mut walls = shapes::unit_room();
    walls.pop();
    let low = glam::DVec3::new(0.25, 0.25, 0.25);
    SceneBuilder::new().part("walls", &walls, Material::grey(0.5)).part(
        "box, \"the\" one",
        &shapes::box_facing_out(low, low * 2.0),
        Material::grey(0.5),
    )
}

/// Fields of a line, of which some are in quotes.
fn fields(line: &str) -> Vec<String> {
    let (mut fields, mut quoted) = (vec![String::new()], false);
    let mut rest = line.chars().peekable();
    while let Some(letter) = rest.next() {
        match letter {
            '"' if quoted && rest.peek() == Some(&'"') => {
                rest.next();
                fields.last_mut().unwrap().push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(String::new()),
            _ => fields.last_mut().unwrap().push(letter),
        }
    }
    fields
}

#[test]
fn files_hold_reciprocal_factors_and_rows_that_sum_to_one() {
    let bench = bench_of(&open_room().glb());
    let (output, areas, report) = (bench.path("f.csv"), bench.path("areas.csv"), bench.path("report.json"));
    let named = ["--areas", areas.to_str().unwrap(), "--report", report.to_str().unwrap(), "--facets"];
    let answer = bench.command(&output, &named).output().unwrap();
    let table = String::from_utf8(answer.stdout).unwrap();
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    for word in ["surfaces", "exact", "estimated", "hidden", "largest correction", "11 polygons"] {
        assert!(table.contains(word), "{word} is missing in {table}");
    }

    let text = fs::read_to_string(&areas).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("surface,area,x,y,z,open,standard_error,correction"));
    let rows: Vec<Vec<String>> = lines.map(fields).collect();
    let number = |text: &String| text.parse::<f64>().unwrap();
    let area: HashMap<&str, f64> = rows.iter().map(|row| (row[0].as_str(), number(&row[1]))).collect();
    assert_eq!(area.len(), 11);
    assert_eq!(area["walls/0"], 1.0);
    assert_eq!(area["box, \"the\" one/5"], 0.0625);
    assert_eq!(rows[0][2..5].iter().map(number).collect::<Vec<_>>(), [0.0, 0.5, 0.5]);

    let text = fs::read_to_string(&output).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("from,to,form_factor,standard_error"));
    let mut factors: HashMap<(String, String), f64> = HashMap::new();
    let mut sums: HashMap<String, f64> = HashMap::new();
    for line in lines.map(fields) {
        let (factor, error) = (number(&line[2]), number(&line[3]));
        assert!(factor > 0.0 && factor <= 1.0 && (0.0..0.1).contains(&error), "{line:?}");
        *sums.entry(line[0].clone()).or_default() += factor;
        assert!(factors.insert((line[0].clone(), line[1].clone()), factor).is_none(), "{line:?} twice");
    }
    assert_eq!(sums.len(), 11);
    assert!(sums.values().all(|sum| (sum - 1.0).abs() < 1e-12), "{sums:?}");
    for ((from, to), factor) in &factors {
        if to != "(open)" {
            let back = factors[&(to.clone(), from.clone())] * area[to.as_str()];
            assert!((factor * area[from.as_str()] / back - 1.0).abs() < 1e-12, "{from} {to}");
        }
    }
    for row in &rows {
        let open = factors.get(&(row[0].clone(), "(open)".to_owned())).copied().unwrap_or(0.0);
        assert_eq!(open, number(&row[5]));
    }
    let report: Value = serde_json::from_str(&fs::read_to_string(&report).unwrap()).unwrap();
    assert_eq!(report["surfaces"], 11);
    assert_eq!(report["pairs"]["all"], 55);
    let written = factors.keys().filter(|(_, to)| to != "(open)").count();
    assert_eq!(report["factors"], written);
    assert!(report["largest_correction"].is_number());
}

#[test]
fn threads_write_the_same_file() {
    let bench = bench_of(&open_room().glb());
    for (name, threads) in [("one.csv", "1"), ("three.csv", "3")] {
        bench.command(&bench.path(name), &["--threads", threads]).assert().success();
    }
    assert_eq!(fs::read(bench.path("one.csv")).unwrap(), fs::read(bench.path("three.csv")).unwrap());
}

#[test]
fn names_are_asked_for() {
    let (mut document, binary) = open_room().document();
    for list in ["nodes", "meshes"] {
        for thing in document[list].as_array_mut().unwrap() {
            thing.as_object_mut().unwrap().remove("name");
        }
    }
    let bench = bench_of(&pack(&document, &binary));
    bench.assert_refused(
        &bench.path("f.csv"),
        &[],
        &["scene.glb", "no surface has a name", "name the nodes"],
    );
    document["nodes"][0]["name"] = "(open)".into();
    let bench = bench_of(&pack(&document, &binary));
    bench.assert_refused(&bench.path("f.csv"), &[], &["called (open)", "another name"]);
    document["nodes"][0]["name"] = "walls".into();
    document["meshes"][1]["name"] = "walls".into();
    let bench = bench_of(&pack(&document, &binary));
    bench.command(&bench.path("f.csv"), &[]).assert().success();
    let text = fs::read_to_string(bench.path("f.csv")).unwrap();
    assert!(text.contains("walls (node 0),walls (node 1),"), "{text}");
}

#[test]
fn wrong_files_are_refused_before_anything_is_computed() {
    let bench = bench_of(&open_room().glb());
    let scene = bench.scene.clone();
    bench.assert_refused(&scene, &[], &["scene.glb", "choose another output"]);
    bench.assert_refused(&bench.path("no/f.csv"), &[], &["does not exist", "create it"]);
    bench.assert_refused(bench.folder.path(), &[], &["is a directory"]);
    let output = bench.path("f.csv");
    let same = ["--areas", output.to_str().unwrap()];
    bench.assert_refused(&output, &same, &["is the output itself", "choose another list of areas"]);
    bench.assert_refused(&output, &["--report", "/nowhere/r.json"], &["/nowhere", "does not exist"]);
    bench.assert_refused(&output, &["--points", "0"], &["--points"]);
    fs::write(&scene, b"no scene").unwrap();
    bench.assert_refused(&output, &[], &["scene.glb"]);
    fs::remove_file(&scene).unwrap();
    let answer = bench.command(&output, &[]).output().unwrap();
    let said = String::from_utf8(answer.stderr).unwrap();
    assert!(!answer.status.success() && said.contains("scene.glb") && !said.contains("panicked"), "{said}");
}
