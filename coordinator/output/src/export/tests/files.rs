//! Files: formats, what is refused, and that nothing is left half-written.

use serde_json::json;

use super::*;
use ::document::Folder;
use fixtures::square;

fn names(directory: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(directory).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_gltf_has_its_buffer_beside_it() {
    let (scene, lit) = square();
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("lit room #1.gltf");
    check_writable(&path).unwrap();
    assert_eq!(names(&directory), [""; 0], "the check leaves nothing behind");
    export(&scene, &lit, &settings(), &path).unwrap();

    assert_eq!(names(&directory), ["lit room #1.bin", "lit room #1.gltf"]);
    let gltf = fixtures::opened(&path);
    let buffer = gltf.buffers().next().unwrap();
    assert!(matches!(buffer.source(), gltf::buffer::Source::Uri("lit%20room%20%231.bin")));
    let length = fs::metadata(path.with_extension("bin")).unwrap().len();
    assert_eq!(buffer.length() as u64, length);
}

#[test]
fn an_output_that_cannot_be_written_is_told_before_and_after_the_bake() {
    let (scene, lit) = square();
    let directory = TempDir::new().unwrap();
    fs::create_dir(directory.path().join("folder.glb")).unwrap();
    fs::write(directory.path().join("file"), "text").unwrap();
    for (name, expected) in [
        ("missing/lit.glb", "does not exist"),
        ("file/lit.glb", "does not exist"),
        ("folder.glb", "is a directory"),
        ("lit.obj", "must end in .glb, .gltf or .ply"),
        ("lit", "must end in .glb, .gltf or .ply"),
    ] {
        let path = directory.path().join(name);
        let early = check_writable(&path).unwrap_err().to_string();
        let late = export(&scene, &lit, &settings(), &path).unwrap_err().to_string();
        assert!(early.contains(expected), "{early}");
        assert_eq!(early, late);
    }
    assert_eq!(names(&directory), ["file", "folder.glb"]);
}

#[test]
fn a_failed_export_leaves_the_old_file_as_it_was() {
    let (scene, mut lit) = square();
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("lit.glb");
    fs::write(&path, "old").unwrap();
    lit.vertices[0].irradiance.x = f64::NAN;
    export(&scene, &lit, &settings(), &path).unwrap_err();
    check_writable(&path).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"old");

    lit.vertices[0].irradiance.x = 0.0;
    export(&scene, &lit, &settings(), &path).unwrap();
    fixtures::opened(&path);
    assert_eq!(names(&directory), ["lit.glb"]);
}

#[test]
fn images_beside_the_input_are_in_the_output_byte_for_byte() {
    let (mut scene, lit) = square();
    let (input, elsewhere) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let png = [b"\x89PNG\r\n\x1a\n".as_slice(), &[7; 301]].concat();
    fs::create_dir(input.path().join("maps")).unwrap();
    fs::write(input.path().join("maps/oak 1.png"), &png).unwrap();
    fs::write(input.path().join("notes.txt"), "no image").unwrap();
    scene.source.folder = Some(Folder::of(&input.path().join("scene.gltf"), false));
    let image = |uri: &str| gltf::json::deserialize::from_value(json!({ "uri": uri })).unwrap();
    let uris = ["maps/oak%201.png", "gone.png", "notes.txt", "../up.png", "data:image/png;base64,AA=="];
    scene.source.root.images = uris.map(image).to_vec();

    for (output, embedded) in [
        (elsewhere.path().join("lit.glb"), true),
        (elsewhere.path().join("lit.gltf"), true),
        (input.path().join("lit.glb"), true),
        (input.path().join("lit.gltf"), false),
    ] {
        let exported = export(&scene, &lit, &settings(), &output).unwrap();
        let gltf = fixtures::opened(&output);
        let mut images = gltf.images().map(|image| image.source());
        match images.next().unwrap() {
            gltf::image::Source::View { view, mime_type } => {
                let bytes =
                    gltf.blob.clone().unwrap_or_else(|| fs::read(output.with_extension("bin")).unwrap());
                assert_eq!(&bytes[view.offset()..][..view.length()], png);
                assert!(embedded && mime_type == "image/png");
            }
            gltf::image::Source::Uri { uri, .. } => assert!(!embedded && uri == uris[0]),
        }
        for (image, uri) in images.by_ref().take(3).zip(&uris[1..]) {
            assert!(matches!(image, gltf::image::Source::Uri { uri: found, .. } if found == *uri));
        }
        let is_binary = output.extension().unwrap() == "glb";
        match images.next().unwrap() {
            gltf::image::Source::View { view, mime_type } => {
                let byte = gltf.blob.as_ref().unwrap()[view.offset()];
                assert!(is_binary && (mime_type, view.length(), byte) == ("image/png", 1, 0));
            }
            gltf::image::Source::Uri { uri, .. } => assert!(!is_binary && uri == uris[4]),
        }
        let warned = uris[1..4].iter().filter(|uri| exported.warnings.iter().any(|text| text.contains(*uri)));
        assert_eq!((warned.count(), exported.warnings.len()), if embedded { (3, 3) } else { (0, 0) });
    }
}

#[test]
fn exposures_that_show_nothing_are_refused() {
    let (scene, lit) = square();
    let directory = TempDir::new().unwrap();
    for exposure in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let settings = ExportSettings { exposure: Some(exposure), ..settings() };
        let error = export(&scene, &lit, &settings, &directory.path().join("lit.glb")).unwrap_err();
        assert!(matches!(error, ExportError::Exposure(_)), "{error}");
    }
}
