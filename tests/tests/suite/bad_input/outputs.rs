//! Output files: never written over what is read, and kept where nobody hears of it.

use std::fs::{self, OpenOptions};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::json;
use tests::programs::binary;

use super::{Bench, good_scene};

/// A device that is always full, where the system has one.
const FULL: &str = "/dev/full";

#[test]
fn the_scene_by_another_spelling_or_link_is_no_output() {
    let bench = Bench::good();
    let before = fs::read(&bench.input).unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let link = elsewhere.path().join("link.glb");
    symlink(&bench.input, &link).unwrap();
    let hard = elsewhere.path().join("hard.glb");
    fs::hard_link(&bench.input, &hard).unwrap();
    let folder = elsewhere.path().join("folder");
    symlink(bench.folder.path(), &folder).unwrap();
    let through_parent = folder.join("..").join(bench.folder.path().file_name().unwrap()).join("good.glb");
    for same in [link, hard, folder.join("good.glb"), bench.folder.path().join("./good.glb"), through_parent]
    {
        bench.assert_refused(&same, &[], &["is the scene itself", "choose another output"]);
        let name = same.display().to_string();
        for option in ["--report", "--keep-light", "--checkpoint"] {
            bench.assert_refused(
                &bench.output(),
                &[option, &name],
                &["is the scene itself", "choose another"],
            );
        }
    }
    assert_eq!(fs::read(&bench.input).unwrap(), before);
}

#[test]
fn two_outputs_are_two_files() {
    let bench = Bench::good();
    let elsewhere = tempfile::tempdir().unwrap();
    let folder = elsewhere.path().join("folder");
    symlink(bench.folder.path(), &folder).unwrap();
    let report = folder.join("lit.glb").display().to_string();
    bench.assert_refused(&bench.output(), &["--report", &report], &["report", "is the output itself"]);
}

/// The points of probes, and what connections to workers need.
#[test]
fn no_file_that_is_read_beside_the_scene_is_written_over() {
    let bench = Bench::good();
    let elsewhere = tempfile::tempdir().unwrap();
    let kept = elsewhere.path().join("kept").display().to_string();
    let of_workers = ["--workers", "127.0.0.1:1", "--worker-grace", "0", "--fallback", "embedded"];
    for (option, content, more, words) in [
        ("--probe-points", "0.5 0.5 0.5\n", &[][..], "is the file of probe points itself"),
        ("--token-file", "a-token-of-some-length", &of_workers[..], "is the file of the token itself"),
    ] {
        fs::write(&kept, content).unwrap();
        for written in ["--report", "--keep-light", "--checkpoint"] {
            let arguments = [&[option, &kept, written, &kept][..], more].concat();
            bench.assert_refused(&bench.output(), &arguments, &[words]);
            assert_eq!(fs::read_to_string(&kept).unwrap(), content);
        }
    }
}

/// The scene's own corners are more than these.
#[test]
fn a_file_of_more_vertices_than_it_may_have_says_so() {
    let bench = Bench::good();
    let answer = bench.run(&bench.output(), &["--max-vertices", "3"]);
    assert!(answer.success);
    answer.assert_said(&["over its bound of 3 (--max-vertices)"]);
    let answer = bench.run(&bench.output(), &[]);
    assert!(!answer.stderr.contains("over its bound"), "{}", answer.stderr);
}

#[test]
fn a_buffer_of_the_scene_is_no_output() {
    let (mut document, binary) = good_scene().document();
    document["buffers"][0]["uri"] = json!("the%20room.bin");
    let bench = Bench::new("apart.gltf", document.to_string().as_bytes());
    let buffer = bench.folder.path().join("the room.bin");
    fs::write(&buffer, &binary).unwrap();
    let report = buffer.display().to_string();
    for (output, arguments) in [("lit.glb", vec!["--report", &report]), ("the room.gltf", vec![])] {
        let answer = bench.run(&bench.folder.path().join(output), &arguments);
        assert!(!answer.success);
        answer.assert_said(&["is the buffer or image of the scene itself", "choose another"]);
        assert_eq!(fs::read(&buffer).unwrap(), binary);
    }
}

/// Every command that reads a glTF keeps off the files beside it.
#[test]
fn no_command_writes_over_what_is_beside_its_scene() {
    let (mut document, bytes) = good_scene().document();
    document["buffers"][0]["uri"] = json!("room.bin");
    let bench = Bench::new("apart.gltf", document.to_string().as_bytes());
    let at = |name: &str| bench.folder.path().join(name).display().to_string();
    let (buffer, link) = (at("room.bin"), at("link.bin"));
    fs::write(&buffer, &bytes).unwrap();
    symlink("room.bin", &link).unwrap();
    let (scene, lit, reference) = (bench.input.display().to_string(), at("lit.gltf"), at("reference.csv"));
    let run = |arguments: &[&str]| {
        let run = Command::new(binary("coordinator")).args(arguments).output().unwrap();
        (run.status.success(), String::from_utf8(run.stderr).unwrap())
    };
    for prepared in [
        &["solve", &scene, "-o", &lit][..],
        &["reference", &scene, "-o", &reference, "--points", "10", "--paths", "4"],
    ] {
        assert!(run(prepared).0, "{prepared:?}");
    }
    let lit_buffer = at("lit.bin");
    let picture = at("picture.png");
    symlink("lit.bin", &picture).unwrap();
    for refused in [
        &["form-factors", &scene, "-o", &buffer][..],
        &["form-factors", &scene, "-o", &at("factors.csv"), "--areas", &link],
        &["form-factors", &scene, "-o", &at("factors.csv"), "--report", &buffer],
        &["reference", &scene, "-o", &link],
        &["compare", &lit, "--reference", &reference, "--scene", &scene, "--points", &buffer],
        &["compare", &lit, "--reference", &reference, "--scene", &scene, "--points", &lit_buffer],
        &["render", &lit, "-o", &picture],
        &["solve", &scene, "-o", &at("other.glb"), "--report", &link],
    ] {
        let (success, said) = run(refused);
        assert!(
            !success && said.contains("is the buffer or image of the scene itself"),
            "{refused:?}: {said}"
        );
    }
    assert_eq!(fs::read(&buffer).unwrap(), bytes);
}

/// A link that is an output stays one, and what it leads to is replaced.
#[test]
fn links_are_written_through() {
    let bench = Bench::good();
    let elsewhere = tempfile::tempdir().unwrap();
    let (link, target) = (bench.folder.path().join("link.glb"), elsewhere.path().join("lit.glb"));
    fs::write(&target, "old").unwrap();
    symlink(&target, &link).unwrap();
    assert!(bench.run(&link, &[]).success);
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert!(fs::read(&target).unwrap().starts_with(b"glTF"));
    fs::remove_file(&target).unwrap();
    let refused = bench.run(&link, &[]);
    assert!(!refused.success);
    refused.assert_said(&["leads nowhere"]);
}

#[test]
fn only_regular_files_are_replaced() {
    let bench = Bench::good();
    if !Path::new(FULL).exists() {
        return;
    }
    for option in ["--report", "--keep-light", "--checkpoint"] {
        bench.assert_refused(&bench.output(), &[option, FULL], &[FULL, "no regular file"]);
    }
    assert!(!Path::new(FULL).is_file());
}

/// A device that takes nothing: printing fails, the lit file is there.
#[test]
fn a_full_standard_output_or_error_loses_no_result() {
    let bench = Bench::good();
    let full = || OpenOptions::new().write(true).open(FULL);
    let Ok(device) = full() else { return };
    let solve = |output: &Path| {
        let mut command = Command::new(binary("coordinator"));
        command.arg("solve").arg(&bench.input).arg("-o").arg(output);
        command
    };
    let told = solve(&bench.output()).stdout(device).stderr(Stdio::piped()).output().unwrap();
    let said = String::from_utf8(told.stderr).unwrap();
    assert_eq!(told.status.code(), Some(1), "{said}");
    assert!(said.contains("error: standard output cannot be written"), "{said}");
    let silent = bench.folder.path().join("silent.glb");
    let told = solve(&silent).stdout(Stdio::null()).stderr(full().unwrap()).status().unwrap();
    assert!(told.success());
    let [one, other] = [bench.output(), silent].map(|path| fs::read(path).unwrap());
    assert!(!one.is_empty() && one == other);
}

/// As with `| head -1`, whose end may come before the first line.
#[test]
fn a_reader_that_has_gone_away_is_no_error() {
    let bench = Bench::good();
    let mut command = Command::new(binary("coordinator"));
    command.arg("solve").arg(&bench.input).arg("-o").arg(bench.output());
    let mut run = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(run.stdout.take());
    let ended = run.wait_with_output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(bench.output().exists());
}
