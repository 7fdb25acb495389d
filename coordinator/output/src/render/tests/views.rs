use super::*;

/// A large dark square with a small white one on it, whose middle is at (1, 0.5, 0), and cameras.
fn with_cameras() -> LitFile {
    let mut builder = Builder::new();
    let irradiance = builder.corners([[PI as f32; 3]; 4]);
    let lit = [("_IRRADIANCE", irradiance)];
    builder.square(json!({ "scale": [8, 8, 1] }), unlit([0.25, 0.25, 0.25, 1.0]), &lit);
    let small = json!({ "translation": [1, 0.5, 0.001], "scale": [0.0626, 0.0626, 1] });
    builder.square(small, unlit([1.0; 4]), &lit);
    // 4 high at a distance of 4, and 8 wide.
    let angle = 2.0 * 0.5_f64.atan();
    builder.camera(
        "near",
        [0.0, 0.0, 4.0],
        json!({ "type": "perspective", "perspective": { "yfov": angle, "aspectRatio": 2, "znear": 0.1 } }),
    );
    builder.camera(
        "flat",
        [0.0, 0.0, 90.0],
        json!({ "type": "orthographic", "orthographic": { "xmag": 4, "ymag": 2, "znear": 0.1, "zfar": 99 } }),
    );
    builder.read()
}

#[test]
fn a_known_point_lands_on_a_known_pixel() {
    let file = with_cameras();
    let look_at = LookAt {
        eye: DVec3::new(0.0, 0.0, 4.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        height_angle: 2.0 * 0.5_f64.atan(),
    };
    let named = |name: &str| {
        let choice = CameraChoice::OfFile(name.to_owned());
        let camera = choice.of_file(&file.cameras).unwrap().unwrap();
        assert_eq!(camera.aspect(), Some(2.0));
        camera.camera(&file.frame, 2.0).unwrap()
    };
    assert_eq!(CameraChoice::Any.of_file(&file.cameras).unwrap().unwrap().names, ["near"]);
    let cameras = [named("near"), named("0"), named("flat"), look_at.camera(&file.frame, 2.0).unwrap()];
    for camera in cameras {
        // 16 pixels to a unit; the small square is 2 pixels wide.
        let picture = take(&file, camera, [128, 64], DVec3::ZERO);
        let white: Vec<[u32; 2]> = (0..128)
            .flat_map(|x| (0..64).map(move |y| [x, y]))
            .filter(|[x, y]| at(&picture, *x, *y).x > 0.5)
            .collect();
        assert_eq!(white, [[79, 23], [79, 24], [80, 23], [80, 24]], "{camera:?}");
    }
    let unknown = CameraChoice::OfFile("far".into()).of_file(&file.cameras).unwrap_err();
    assert!(unknown.to_string().contains("it has 0: \"near\", 1: \"flat\""), "{unknown}");
    let blind = LookAt { target: look_at.eye, ..look_at };
    assert!(blind.camera(&file.frame, 1.0).is_err());
    let along = LookAt { up: DVec3::Z, ..look_at };
    assert!(along.camera(&file.frame, 1.0).is_err());
}

#[test]
fn a_picture_does_not_depend_on_its_tiles() {
    let file = with_cameras();
    let camera = file.cameras[0].camera(&file.frame, 1.5).unwrap();
    let scene = encode_picture(&file.scene);
    let settings = TileSettings { camera, size: [201, 134], samples: 7, background: DVec3::ONE };
    let picture = render_tiles(&mut Local::default(), scene.clone(), &settings, &mut |_, _| ()).unwrap();
    assert_eq!(picture.rays, 201 * 134 * 7);
    let mut whole = Local::default();
    whole.publish(scene.clone());
    let request = TileRequest {
        picture: scene.digest,
        camera,
        size: settings.size,
        corner: [0, 0],
        extent: settings.size,
        samples: 7,
        background: DVec3::ONE,
    };
    whole.submit(vec![(JobId(0), request)]);
    assert!(whole.next().unwrap().pixels == picture.pixels);
    let none = TileSettings { size: [0, 9], ..settings };
    assert!(render_tiles(&mut Local::default(), scene, &none, &mut |_, _| ()).is_err());
}

#[test]
fn a_view_is_chosen_that_sees_the_scene() {
    // A square seen from its front only.
    let mut builder = Builder::new();
    let irradiance = builder.corners([[1.0; 3]; 4]);
    builder.square(json!({}), unlit([1.0; 4]), &[("_IRRADIANCE", irradiance)]);
    let file = builder.read();
    for aspect in [0.5, 1.0, 2.0] {
        let camera = choose_view(&file.scene, aspect);
        assert!(camera.eye.z > 0.0, "{camera:?}");
        for corner in CORNERS {
            let corner = file.frame.to_frame(DVec3::from_array(corner.map(f64::from)));
            let place = camera.place(corner).unwrap();
            assert!(place.iter().all(|at| (0.0..=1.0).contains(at)), "{aspect} {place:?}");
        }
    }
}
