//! Files that are what they should be, and others.

use proptest::prelude::*;
use prost::Message;

use super::RelightError;
use super::file::{Body, MAGIC, Part, sealed};
use super::kept::KeptLight;
use kernel::row::release;

fn part() -> Part {
    Part {
        names: vec!["lamp".into()],
        as_baked: vec![1.0; 3],
        direct: vec![0.5; 6],
        irradiance: vec![0.75; 6],
        gathered: vec![0.25; 3],
        noise: 0.01,
        ..Part::default()
    }
}

fn body() -> Body {
    Body {
        scene: vec![7; 32],
        sky: vec![0.0; 3],
        edge: 0.25,
        max_level: 12,
        max_vertices: 1000,
        divided: vec![3, 1],
        vertices: 2,
        parts: vec![part()],
        patches: vec![4],
        points: vec![0.5; 7],
        reflectance: 0.5,
        error: vec![0.01; 5],
        ..Body::default()
    }
}

fn read(body: &Body) -> Result<KeptLight, RelightError> {
    KeptLight::from_bytes(&sealed(&body.encode_to_vec()))
}

#[test]
fn figures_that_cannot_be_are_refused() {
    assert_eq!(read(&body()).unwrap().body(), body());
    let of_part = |part: Part| Body { parts: vec![part], ..body() };
    for wrong in [
        Body { scene: vec![7; 31], ..body() },
        Body { sky: vec![-1.0, 0.0, 0.0], ..body() },
        Body { edge: 0.0, ..body() },
        Body { edge: f64::NAN, ..body() },
        Body { max_level: 31, ..body() },
        Body { vertices: 3, ..body() },
        Body { patches: vec![4, 4], ..body() },
        Body { points: vec![f64::INFINITY; 7], ..body() },
        Body { reflectance: 1.0, ..body() },
        Body { error: vec![0.01; 4], ..body() },
        of_part(Part { as_baked: vec![1.0; 2], ..part() }),
        of_part(Part { direct: vec![f32::NAN; 6], ..part() }),
        of_part(Part { irradiance: vec![0.5; 7], ..part() }),
        of_part(Part { gathered: vec![], ..part() }),
        of_part(Part { noise: -1.0, ..part() }),
    ] {
        assert!(matches!(read(&wrong), Err(RelightError::Damaged(_))), "{wrong:?}");
    }
}

#[test]
fn another_release_is_named() {
    let bytes = [MAGIC, b"0.0.1 protocol 1\n"].concat();
    let error = KeptLight::from_bytes(&bytes).unwrap_err().to_string();
    assert!(error.contains("0.0.1 protocol 1") && error.contains(&release()), "{error}");
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400), is_sealed in any::<bool>()) {
        let bytes = if is_sealed { sealed(&bytes) } else { bytes };
        let _ = KeptLight::from_bytes(&bytes);
    }
}
