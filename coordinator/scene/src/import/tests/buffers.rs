//! Buffers inside the file, in data URIs, and in files beside it.

use std::fs;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::{STANDARD, STANDARD_NO_PAD};
use glam::DVec3;
use serde_json::json;

use crate::import::test_document::{self, TestDocument};
use crate::import::{ImportOptions, ImportProblem, import, import_slice};
use document::ReadOptions;

/// A folder with `scenes/scene.gltf`, which has its buffer at `uri`, and the buffer in three places.
fn folder_with(uri: &str) -> tempfile::TempDir {
    let document = TestDocument::square();
    let folder = tempfile::tempdir().unwrap();
    let scenes = folder.path().join("scenes");
    fs::create_dir_all(scenes.join("data")).unwrap();
    fs::write(scenes.join("scene.gltf"), document.json(Some(uri))).unwrap();
    for name in ["outside.bin", "scenes/a b.bin", "scenes/data/buffer.bin"] {
        fs::write(folder.path().join(name), &document.bin).unwrap();
    }
    folder
}

fn import_from(folder: &Path) -> Result<(), ImportProblem> {
    import_within(folder, false)
}

fn import_within(folder: &Path, outside_files: bool) -> Result<(), ImportProblem> {
    let options = test_document::limited(ReadOptions { outside_files, ..ReadOptions::default() });
    import(&folder.join("scenes/scene.gltf"), &options).map(drop).map_err(|error| *error.problem)
}

#[test]
fn files_beside_the_gltf_are_read() {
    for uri in ["a%20b.bin", "a b.bin", "data/buffer.bin", "./data/buffer.bin"] {
        let folder = folder_with(uri);
        import_from(folder.path()).unwrap();
    }
}

#[test]
fn nothing_outside_the_folder_is_read() {
    let folder = folder_with("");
    let absolute = folder.path().join("outside.bin");
    let uris = [
        "../outside.bin",
        "data/../../outside.bin",
        "%2e%2e/outside.bin",
        "..%2foutside.bin",
        "..\\outside.bin",
        absolute.to_str().unwrap(),
        "file:///etc/hostname",
        "http://localhost/outside.bin",
        "C:\\outside.bin",
        "%ff.bin",
    ];
    for uri in uris {
        let folder = folder_with(uri);
        let problem = import_from(folder.path()).unwrap_err();
        assert!(matches!(problem, ImportProblem::RefusedUri { buffer: 0, .. }), "{uri}: {problem}");
    }
}

/// Links are resolved before it is asked where a file lies.
#[cfg(unix)]
#[test]
fn links_lead_out_of_the_folder_only_where_that_is_allowed() {
    use std::os::unix::fs::symlink;
    let folder = folder_with("link.bin");
    let link = folder.path().join("scenes/link.bin");
    let outside = folder.path().join("outside.bin");
    symlink("data/buffer.bin", &link).unwrap();
    import_from(folder.path()).unwrap();
    for target in [Path::new("../outside.bin"), &outside] {
        fs::remove_file(&link).unwrap();
        symlink(target, &link).unwrap();
        let problem = import_from(folder.path()).unwrap_err();
        assert!(matches!(problem, ImportProblem::RefusedUri { .. }), "{problem}");
        assert!(problem.to_string().contains("--outside-files"), "{problem}");
        import_within(folder.path(), true).unwrap();
    }
    // Through a folder that is a link.
    let folder = folder_with("elsewhere/outside.bin");
    symlink(folder.path(), folder.path().join("scenes/elsewhere")).unwrap();
    assert!(matches!(import_from(folder.path()).unwrap_err(), ImportProblem::RefusedUri { .. }));
    import_within(folder.path(), true).unwrap();
    // The scene itself may lie behind a link: its folder is that of the name that was given.
    let folder = folder_with("data/buffer.bin");
    symlink(folder.path().join("scenes"), folder.path().join("shelf")).unwrap();
    import(&folder.path().join("shelf/scene.gltf"), &ImportOptions::default()).unwrap();
}

#[test]
fn files_elsewhere_are_read_where_that_is_allowed() {
    let other = folder_with("");
    let absolute = other.path().join("outside.bin");
    for (uri, is_read) in [
        ("../outside.bin", true),
        (absolute.to_str().unwrap(), true),
        ("file:///etc/hostname", false),
        ("..\\outside.bin", false),
    ] {
        let folder = folder_with(uri);
        assert_eq!(import_within(folder.path(), true).is_ok(), is_read, "{uri}");
    }
}

/// None of these has an end: they would be read for ever.
#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    let folder = folder_with("pipe.bin");
    let pipe = folder.path().join("scenes/pipe.bin");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let device = folder_with("/dev/zero");
    let directory = folder_with("data");
    for folder in [folder, device, directory] {
        let problem = import_within(folder.path(), true).unwrap_err();
        assert!(matches!(problem, ImportProblem::RefusedUri { .. }), "{problem}");
        assert!(problem.to_string().contains("no regular file"), "{problem}");
    }
}

#[test]
fn missing_file_is_named() {
    let folder = folder_with("lost.bin");
    let problem = import_from(folder.path()).unwrap_err();
    assert!(matches!(problem, ImportProblem::ExternalFile { .. }));
    assert!(problem.to_string().contains("lost.bin"), "{problem}");
}

#[test]
fn memory_may_not_refer_to_files() {
    let bytes = TestDocument::square().json(Some("data/buffer.bin"));
    let error = import_slice(&bytes, &ImportOptions::default()).unwrap_err();
    assert!(matches!(*error.problem, ImportProblem::RefusedUri { .. }));
}

#[test]
fn data_uris_are_read_padded_or_not() {
    let document = TestDocument::square();
    for encoded in [STANDARD.encode(&document.bin), STANDARD_NO_PAD.encode(&document.bin)] {
        let uri = format!("data:application/octet-stream;base64,{encoded}");
        let scene = import_slice(&document.json(Some(&uri)), &ImportOptions::default()).unwrap();
        assert_eq!(scene.source.buffers[0], document.bin);
    }
}

#[test]
fn damaged_data_uris_are_refused_without_repeating_them() {
    for uri in ["data:text/plain,hello", &format!("data:;base64,{}", "?".repeat(5000))] {
        let bytes = TestDocument::square().json(Some(uri));
        let problem = *import_slice(&bytes, &ImportOptions::default()).unwrap_err().problem;
        assert!(matches!(problem, ImportProblem::RefusedUri { .. }), "{problem}");
        assert!(problem.to_string().len() < 300);
    }
}

#[test]
fn buffers_without_enough_bytes() {
    let mut document = TestDocument::square();
    let held = document.bin.len();
    document.root["buffers"] = json!([{ "byteLength": held + 100 }]);
    let problem = document.problem();
    assert!(matches!(problem, ImportProblem::BufferTooShort { buffer: 0, .. }), "{problem}");

    document.root["buffers"] = json!([{ "byteLength": held }, { "byteLength": 4 }]);
    assert!(matches!(document.problem(), ImportProblem::BufferMissing { buffer: 1 }));

    let json = TestDocument::square().json(None);
    let problem = *import_slice(&json, &ImportOptions::default()).unwrap_err().problem;
    assert!(matches!(problem, ImportProblem::BufferMissing { buffer: 0 }));
}

#[test]
fn limit_counts_the_file_and_what_is_beside_it() {
    let folder = folder_with("data/buffer.bin");
    let path = folder.path().join("scenes/scene.gltf");
    let buffer = fs::metadata(folder.path().join("outside.bin")).unwrap().len();
    let all = fs::metadata(&path).unwrap().len() + buffer;
    let limited = |max_bytes| {
        import(&path, &test_document::limited(ReadOptions { max_bytes, ..ReadOptions::default() }))
    };
    assert!(limited(all).is_ok());
    for limit in [0, all - buffer - 1, all - 1] {
        let problem = *limited(limit).unwrap_err().problem;
        assert!(matches!(problem, ImportProblem::TooLarge { .. }), "{limit}: {problem}");
    }
    let glb = TestDocument::square().glb();
    let options =
        test_document::limited(ReadOptions { max_bytes: glb.len() as u64 - 1, ..ReadOptions::default() });
    assert!(matches!(*import_slice(&glb, &options).unwrap_err().problem, ImportProblem::TooLarge { .. }));
}

#[test]
fn accessors_without_data_are_zeros() {
    let with = |count: u64| {
        let mut document = TestDocument::square();
        let colours = json!({ "type": "VEC3", "componentType": 5126, "count": count });
        let colours = document.push("accessors", colours);
        // Compressors leave some that nothing uses.
        document.push("accessors", json!({ "type": "VEC2", "componentType": 5126, "count": count }));
        document.root["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colours.into();
        import_slice(&document.glb(), &test_document::limited(ReadOptions::default()))
            .map_err(|error| *error.problem)
    };
    let scene = with(4).unwrap();
    assert_eq!(
        scene.surfaces[0].mean_reflectance(0, &[scene.surfaces[0].facets[0].corners[0].position]),
        DVec3::ZERO
    );
    assert!(
        matches!(with(1 << 40), Err(ImportProblem::Undecodable { place, .. }) if place.starts_with("accessor"))
    );
}
