//! Golden rows: digests of encoded rows of small scenes, so that no change of the kernel's bits goes unnoticed.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::{Digest, Receiver, ScenePolygons};
use kernel::row::{CHANNELS, Hemisphere, Precision, ROW_VERSION, Row, Shape, Shooter, Spot, encode_row};
use kernel::visibility::ReceiverGroups;
use worker::engine::{Scene, compute_hemisphere, compute_row};

use crate::room::{block, polygon, wall_receivers};

/// [`ROW_VERSION`] of the digests below.
const VERSION: u32 = 14;

/// First 6 bytes of the BLAKE3 digest of each kind of rows, encoded.
const DIGESTS: &[(&str, &str)] = &[
    ("no occluder", "9c188f2334ca"),
    ("no occluder, all digits", "a92068d512d3"),
    ("no occluder, point rule", "f467a12bcad0"),
    ("few occluders, computed", "4dee08d1911d"),
    ("few occluders, sampled", "211492680b4e"),
    ("many occluders, computed", "9e2b2c0a050b"),
    ("many occluders, sampled", "5c8e2a0d635c"),
    ("transparent occluders", "af35443a2928"),
    ("shooter of many polygons", "d12ed5beca72"),
    ("shooter of many polygons that count as one", "23614c7983ab"),
    ("shooter of many polygons near receivers", "4c2637568fba"),
    ("shooter of many polygons, transparent occluders", "ea51b08e1aa0"),
    ("shooter of weighted polygons", "eb2fcc3b5596"),
    ("shooter of coloured polygons", "4b1d4cf61851"),
    ("sky", "b14c099ac108"),
    ("sky, transparent occluders", "401f76110040"),
    ("lights without an area", "62ff3ebc5dd4"),
    ("lights without an area, transparent occluders", "9f806b3c9838"),
    ("hemispheres", "71f8905eaf8c"),
    ("hemispheres, transparent occluders", "d938c8316b7a"),
    ("rounded factors", "21be5da80ea2"),
];

/// Side of the room.
const SIDE: f64 = 4.0;

/// Receivers along an edge of a wall.
const ALONG: usize = 7;

/// Cosine and sine of the blocks' turn: exact, whatever the platform.
const TURN: [f64; 2] = [0.96, 0.28];

/// Factors keep all digits of f32.
const EXACT: Precision = Precision { factor_rounding: 0.0, ..Precision::DEFAULT };

/// A horizontal square that faces down, about this centre, turned by 37 degrees without the platform's sine.
fn square(plane: u32, centre: DVec3, half: f64) -> ConvexPolygon {
    let (u, v) = (DVec3::new(0.8, 0.0, 0.6) * half, DVec3::new(-0.6, 0.0, 0.8) * half);
    polygon(plane, [centre - u - v, centre + u - v, centre + u + v, centre - u + v])
}

fn blocks() -> Vec<ConvexPolygon> {
    let low = block(20, DVec3::new(1.3, 0.0, 2.6), DVec3::new(0.6, 0.5, 0.6), TURN);
    low.into_iter().chain(block(30, DVec3::new(2.8, 0.0, 1.2), DVec3::new(0.5, 1.2, 0.5), TURN)).collect()
}

/// Small squares on a grid below the lamp, which hide parts of it from everywhere.
fn squares() -> Vec<ConvexPolygon> {
    let place = |i: u32| DVec3::new(f64::from(i % 9), f64::from(i * 5 % 7) * 0.1, f64::from(i / 9));
    (0..81).map(|i| square(100 + i, DVec3::new(1.0, 2.0, 1.0) + place(i) * 0.25, 0.09)).collect()
}

/// Receivers on the walls and the floor, and some in the air that face all ways; walls have the planes 0 to 4.
fn receivers() -> Vec<Receiver> {
    let in_air = (0..40_u32).map(|i| {
        let [x, y, z] = [i * 7 % 11, i * 5 % 13, i * 3 % 17].map(f64::from);
        Receiver {
            position: DVec3::new(x / 11.0, y / 26.0, z / 17.0) * SIDE,
            normal: (DVec3::new(y, z, x) - DVec3::splat(5.3)).normalize(),
            plane: PlaneId(1000 + i),
        }
    });
    wall_receivers(SIDE, ALONG).chain(in_air).collect()
}

fn lamp() -> Shape {
    Shape::Polygons(vec![square(10, DVec3::new(2.0, 3.9, 2.0), 0.7)])
}

/// A lamp that is a point for most receivers, at a coarse tolerance.
fn small_lamp() -> Shape {
    Shape::Polygons(vec![square(10, DVec3::new(2.0, 3.9, 2.0), 0.05)])
}

/// A ceiling of 64 tiles: rays choose among them.
fn ceiling() -> Shape {
    let tile = |i: u32| {
        let place = DVec3::new(f64::from(i % 8) + 0.5, 0.0, f64::from(i / 8) + 0.5);
        square(10, DVec3::Y * SIDE + place * 0.5, 0.17)
    };
    Shape::Polygons((0..64).map(tile).collect())
}

/// A small panel of 64 tiles that share corners: as one, or a few, for receivers far below.
fn panel() -> Shape {
    let tile = |i: u32| {
        let corner = |[x, z]: [u32; 2]| {
            DVec3::new(1.9 + 0.02 * f64::from(i % 8 + x), 3.9, 1.9 + 0.02 * f64::from(i / 8 + z))
        };
        polygon(10, [[0, 0], [1, 0], [1, 1], [0, 1]].map(corner))
    };
    Shape::Polygons((0..64).map(tile).collect())
}

/// The same, its tiles of different exitance.
fn weighted_ceiling(weight: impl Fn(usize) -> f64) -> Shape {
    let Shape::Polygons(tiles) = ceiling() else { unreachable!("a ceiling has tiles") };
    Shape::of_one_colour(tiles.into_iter().enumerate().map(|(index, tile)| (tile, weight(index))))
}

/// The same, its tiles of different colours: a shape for each channel.
fn coloured_ceiling() -> [Shape; CHANNELS] {
    let Shape::Polygons(tiles) = ceiling() else { unreachable!("a ceiling has tiles") };
    let weights = |index: usize| [index % 5, index * 3 % 7, index / 40].map(|step| step as f64 / 7.0);
    Shape::of_colours(tiles.into_iter().enumerate().map(|(index, tile)| (tile, weights(index))).collect())
}

/// Shades of large squares between the receivers in the air: near many of them.
fn shades() -> Shape {
    let shade = |i: u32| {
        let place = DVec3::new(f64::from(i % 3), 0.2 * f64::from(i * 5 % 9), f64::from(i / 3 % 3));
        square(500 + i, DVec3::new(0.8, 0.4, 0.8) + place * DVec3::new(1.2, 1.0, 1.2), 0.6)
    };
    Shape::Polygons((0..36).map(shade).collect())
}

fn lights() -> Vec<Shape> {
    let position = DVec3::new(1.9, 3.7, 2.2);
    let direction = DVec3::new(0.36, -0.8, 0.48);
    vec![
        Shape::Point(position),
        Shape::PlanarPoint(position),
        Shape::Spot(Spot { position, direction, inner_cosine: 0.9, outer_cosine: 0.4 }),
        Shape::Directional(direction),
    ]
}

fn opaque(polygons: Vec<ConvexPolygon>) -> ScenePolygons {
    ScenePolygons { polygons, opacities: vec![] }
}

/// The blocks, and over them some squares that let a part of the light through.
fn transparent() -> ScenePolygons {
    let mut polygons = blocks();
    let mut opacities = vec![1.0; polygons.len()];
    for (i, opacity) in (0..).zip([0.25, 0.5, 0.75]) {
        polygons.push(square(50 + i, DVec3::new(1.4, 2.8 + 0.2 * f64::from(i), 2.1), 0.8));
        opacities.push(opacity);
    }
    ScenePolygons { polygons, opacities }
}

/// Encodes the rows of some shooters over all receivers.
fn rows(scene: ScenePolygons, shapes: Vec<Shape>, precision: &Precision) -> Vec<u8> {
    let (scene, groups) = (Scene::from(scene), ReceiverGroups::new(receivers()));
    let row = |(key, shape)| compute_row(&scene, &groups, 5, &Shooter { key, shape }, precision).0;
    (1..).zip(shapes).flat_map(|shape| encode_row(&Row::new(&row(shape)))).collect()
}

/// Encodes the rows of some receivers over all polygons.
fn hemispheres(scene: ScenePolygons) -> Vec<u8> {
    let scene = Scene::from(scene);
    let row =
        |(key, receiver)| compute_hemisphere(&scene, &Hemisphere { receiver, rays: 256 }, key, &EXACT).0;
    (1..).zip(receivers()).step_by(9).flat_map(|receiver| encode_row(&row(receiver))).collect()
}

#[test]
fn rows_have_the_bits_of_their_version() {
    let few = || opaque(blocks());
    let many = || opaque(squares());
    let computed = Precision { exact_occluders: 1000, ..EXACT };
    let sampled = Precision { exact_occluders: 0, ..EXACT };
    let full_digits = Precision { form_factor_error: 1e-8, ..EXACT };
    let points = Precision { form_factor_error: 1e-2, ..EXACT };
    let seen = || {
        let ScenePolygons { mut polygons, mut opacities } = transparent();
        polygons.push(square(10, DVec3::new(2.0, 3.9, 2.0), 0.7));
        opacities.push(1.0);
        ScenePolygons { polygons, opacities }
    };
    let kinds: Vec<(&str, Vec<u8>)> = vec![
        ("no occluder", rows(opaque(vec![]), vec![lamp()], &EXACT)),
        ("no occluder, all digits", rows(opaque(vec![]), vec![lamp()], &full_digits)),
        ("no occluder, point rule", rows(opaque(vec![]), vec![small_lamp()], &points)),
        ("few occluders, computed", rows(few(), vec![lamp()], &EXACT)),
        ("few occluders, sampled", rows(few(), vec![lamp()], &sampled)),
        ("many occluders, computed", rows(many(), vec![lamp()], &computed)),
        ("many occluders, sampled", rows(many(), vec![lamp()], &sampled)),
        ("transparent occluders", rows(transparent(), vec![lamp()], &EXACT)),
        ("shooter of many polygons", rows(few(), vec![ceiling()], &EXACT)),
        ("shooter of many polygons that count as one", rows(few(), vec![panel()], &EXACT)),
        ("shooter of many polygons near receivers", rows(few(), vec![shades()], &EXACT)),
        ("shooter of many polygons, transparent occluders", rows(transparent(), vec![ceiling()], &EXACT)),
        ("shooter of weighted polygons", rows(few(), vec![weighted_ceiling(|i| i as f64 / 63.0)], &EXACT)),
        ("shooter of coloured polygons", rows(few(), coloured_ceiling().to_vec(), &EXACT)),
        ("sky", rows(few(), vec![Shape::Sky(128)], &EXACT)),
        ("sky, transparent occluders", rows(transparent(), vec![Shape::Sky(128)], &EXACT)),
        ("lights without an area", rows(many(), lights(), &EXACT)),
        ("lights without an area, transparent occluders", rows(transparent(), lights(), &EXACT)),
        ("hemispheres", hemispheres(opaque(squares()))),
        ("hemispheres, transparent occluders", hemispheres(seen())),
        ("rounded factors", rows(few(), vec![lamp()], &Precision { factor_rounding: 1e-3, ..EXACT })),
    ];
    let digests: Vec<(&str, String)> =
        kinds.iter().map(|(name, bytes)| (*name, Digest::of(bytes).to_string())).collect();
    let golden: Vec<(&str, String)> =
        DIGESTS.iter().map(|(name, digest)| (*name, (*digest).into())).collect();
    assert!(
        ROW_VERSION == VERSION && digests == golden,
        "rows have other bits than those of version {VERSION}: bump ROW_VERSION in kernel::row, and let this test \
         have it and these digests:\n{digests:#?}\ninstead of\n{golden:#?}",
    );
    assert!(kinds.iter().all(|(name, bytes)| bytes.len() > 100 && !name.is_empty()), "rows hold factors");
}

/// With one weight for all, a shooter is what it is without; and rows are linear in the weights where nothing stands between.
#[test]
fn weights_are_factors_of_polygons() {
    let row = |scene: ScenePolygons, shape: Shape| {
        let groups = ReceiverGroups::new(receivers());
        compute_row(&Scene::from(scene), &groups, 5, &Shooter { key: 1, shape }, &EXACT).0
    };
    let few = || opaque(blocks());
    assert_eq!(row(few(), weighted_ceiling(|_| 1.0)), row(few(), ceiling()));
    let none = || opaque(vec![]);
    let all = row(none(), ceiling());
    let rising = row(none(), weighted_ceiling(|i| i as f64 / 63.0));
    let falling = row(none(), weighted_ceiling(|i| 1.0 - i as f64 / 63.0));
    assert!(rising != falling && all.iter().any(|factor| *factor > 0.1));
    for ((all, rising), falling) in all.iter().zip(rising).zip(falling) {
        assert!((all - rising - falling).abs() <= 1e-6, "{all}, not {rising} + {falling}");
    }
}

/// Where nothing stands between, a channel has the factors of its weights alone; elsewhere it has its part of what arrives.
#[test]
fn channels_have_the_rows_of_their_own_weights() {
    let row = |scene: ScenePolygons, shape: Shape| {
        let groups = ReceiverGroups::new(receivers());
        compute_row(&Scene::from(scene), &groups, 5, &Shooter { key: 7, shape }, &EXACT).0
    };
    for channel in coloured_ceiling() {
        let own = channel.weighted_polygons().map(|(tile, weight)| (tile.clone(), weight));
        let alone = Shape::of_one_colour(own.collect::<Vec<_>>());
        let none = || opaque(vec![]);
        for (found, wanted) in row(none(), channel.clone()).iter().zip(row(none(), alone.clone())) {
            assert!((found - wanted).abs() <= 1e-6, "{found}, not {wanted}");
        }
        let (found, wanted) = (row(opaque(blocks()), channel), row(opaque(blocks()), alone));
        let [found, wanted] =
            [found, wanted].map(|row| row.iter().map(|factor| f64::from(*factor)).sum::<f64>());
        assert!(found > 1.0 && (found / wanted - 1.0).abs() <= 0.02, "{found}, not {wanted}");
    }
}
