//! How a picture's scene travels.

use prost::Message;

use super::scene::{Alpha, Encoding, Image, Part, PictureScene, Texture, Wrap};
use crate::messages::{
    PictureAlpha, PictureEncoding, PictureImage, PicturePart, PictureReplica, PictureTexture, PictureWrap,
    ReplicaKind,
};
use crate::replica::{EncodedReplica, ReplicaError, points_inside};

/// Encodes a picture's scene.
#[must_use]
pub fn encode_picture(scene: &PictureScene) -> EncodedReplica {
    let image = |image: &Image| PictureImage {
        width: image.width,
        height: image.height,
        pixels: image.pixels.clone(),
        encoding: match image.encoding {
            Encoding::Srgb => PictureEncoding::Srgb.into(),
            Encoding::Rgbm => PictureEncoding::Rgbm.into(),
        },
    };
    let message = PictureReplica {
        parts: scene.parts.iter().map(encode_part).collect(),
        images: scene.images.iter().map(image).collect(),
        rounding: scene.rounding,
    };
    EncodedReplica::new(ReplicaKind::Picture, &message)
}

fn encode_part(part: &Part) -> PicturePart {
    let (alpha, cutoff) = match part.alpha {
        Alpha::Opaque => (PictureAlpha::Opaque, 0.0),
        Alpha::Mask(cutoff) => (PictureAlpha::Mask, cutoff),
        Alpha::Blend => (PictureAlpha::Blend, 0.0),
    };
    PicturePart {
        positions: part.positions.as_flattened().to_vec(),
        triangles: part.triangles.as_flattened().to_vec(),
        irradiance: part.irradiance.as_flattened().to_vec(),
        irradiance_coordinates: part.irradiance_coordinates.as_flattened().to_vec(),
        irradiance_texture: part.irradiance_texture.map(encode_texture),
        colours: part.colours.as_flattened().to_vec(),
        base_coordinates: part.base_coordinates.as_flattened().to_vec(),
        emission_coordinates: part.emission_coordinates.as_flattened().to_vec(),
        base: part.base.to_vec(),
        base_texture: part.base_texture.map(encode_texture),
        emission: part.emission.to_vec(),
        emission_texture: part.emission_texture.map(encode_texture),
        alpha: alpha.into(),
        cutoff,
        double_sided: part.double_sided,
    }
}

fn encode_texture(texture: Texture) -> PictureTexture {
    let wrap = |wrap| match wrap {
        Wrap::Repeat => PictureWrap::Repeat,
        Wrap::Mirror => PictureWrap::Mirror,
        Wrap::Clamp => PictureWrap::Clamp,
    };
    let [wrap_u, wrap_v] = texture.wrap.map(|side| wrap(side).into());
    PictureTexture { image: texture.image, wrap_u, wrap_v, nearest: texture.nearest }
}

/// Decodes a picture's scene and checks it: every index points at something, every list is as long as it should be, every number
/// is finite, and where it is a colour not negative.
///
/// # Errors
/// When the bytes are not a picture replica, or it fails a check.
pub fn decode_picture(bytes: &[u8]) -> Result<PictureScene, ReplicaError> {
    let message = PictureReplica::decode(bytes)?;
    let images = message.images.into_iter().map(decode_image).collect::<Result<Vec<_>, _>>()?;
    let parts = message
        .parts
        .into_iter()
        .map(|part| decode_part(part, images.len()))
        .collect::<Result<Vec<_>, _>>()?;
    let triangles = parts.iter().map(|part| part.triangles.len()).sum::<usize>();
    if u32::try_from(triangles).is_err() {
        return Err(ReplicaError::Inconsistent("a picture has fewer than 2^32 triangles"));
    }
    if !(0.0..=1.0).contains(&message.rounding) {
        return Err(ReplicaError::Inconsistent("the rounding of a picture lies between 0 and 1"));
    }
    Ok(PictureScene { parts, images, rounding: message.rounding })
}

fn decode_image(image: PictureImage) -> Result<Image, ReplicaError> {
    let encoding = match PictureEncoding::try_from(image.encoding) {
        Ok(PictureEncoding::Srgb) => Encoding::Srgb,
        Ok(PictureEncoding::Rgbm) => Encoding::Rgbm,
        Err(_) => return Err(ReplicaError::Inconsistent("the pixels of an image have no known meaning")),
    };
    let PictureImage { width, height, pixels, .. } = image;
    let bytes = u64::from(width).checked_mul(u64::from(height)).and_then(|count| count.checked_mul(4));
    if width == 0 || height == 0 || bytes != Some(pixels.len() as u64) {
        return Err(ReplicaError::Inconsistent(
            "an image has four bytes for each pixel, and a pixel or more",
        ));
    }
    Ok(Image { width, height, encoding, pixels })
}

fn decode_part(part: PicturePart, images: usize) -> Result<Part, ReplicaError> {
    let positions: Vec<[f64; 3]> =
        points_inside(&part.positions)?.into_iter().map(|point| point.to_array()).collect();
    let vertices = positions.len();
    let triangles = groups::<3, u32>(&part.triangles)?;
    if triangles.as_flattened().iter().any(|vertex| *vertex as usize >= vertices) {
        return Err(ReplicaError::Inconsistent("a triangle names a vertex that does not exist"));
    }
    let alpha = match part.alpha() {
        PictureAlpha::Opaque => Alpha::Opaque,
        PictureAlpha::Mask => Alpha::Mask(colour(&[part.cutoff])?[0]),
        PictureAlpha::Blend => Alpha::Blend,
    };
    let decoded = Part {
        triangles,
        irradiance: per_vertex(colour(&part.irradiance)?, vertices)?,
        irradiance_coordinates: per_vertex(finite(&part.irradiance_coordinates)?, vertices)?,
        irradiance_texture: part
            .irradiance_texture
            .map(|texture| decode_texture(texture, images))
            .transpose()?,
        colours: per_vertex(colour(&part.colours)?, vertices)?,
        base_coordinates: per_vertex(finite(&part.base_coordinates)?, vertices)?,
        emission_coordinates: per_vertex(finite(&part.emission_coordinates)?, vertices)?,
        base: one(colour(&part.base)?)?,
        base_texture: part.base_texture.map(|texture| decode_texture(texture, images)).transpose()?,
        emission: one(colour(&part.emission)?)?,
        emission_texture: part.emission_texture.map(|texture| decode_texture(texture, images)).transpose()?,
        alpha,
        double_sided: part.double_sided,
        positions,
    };
    let is_placed = |texture: &Option<Texture>, coordinates: &Vec<[f32; 2]>| {
        texture.is_none() || coordinates.len() == vertices
    };
    if !is_placed(&decoded.irradiance_texture, &decoded.irradiance_coordinates)
        || !is_placed(&decoded.base_texture, &decoded.base_coordinates)
        || !is_placed(&decoded.emission_texture, &decoded.emission_coordinates)
    {
        return Err(ReplicaError::Inconsistent("a texture needs coordinates at every vertex"));
    }
    Ok(decoded)
}

fn decode_texture(texture: PictureTexture, images: usize) -> Result<Texture, ReplicaError> {
    if texture.image as usize >= images {
        return Err(ReplicaError::Inconsistent("a texture names an image that does not exist"));
    }
    let wrap = |wrap| match wrap {
        PictureWrap::Repeat => Wrap::Repeat,
        PictureWrap::Mirror => Wrap::Mirror,
        PictureWrap::Clamp => Wrap::Clamp,
    };
    let wrap = [wrap(texture.wrap_u()), wrap(texture.wrap_v())];
    Ok(Texture { image: texture.image, wrap, nearest: texture.nearest })
}

/// The values in groups of `N`.
fn groups<const N: usize, T: Copy>(values: &[T]) -> Result<Vec<[T; N]>, ReplicaError> {
    match values.as_chunks::<N>() {
        (groups, []) => Ok(groups.to_vec()),
        _ => Err(ReplicaError::Inconsistent("a list of a picture ends in the middle of a value")),
    }
}

/// One group for each vertex, or none at all.
fn per_vertex<const N: usize>(values: &[f32], vertices: usize) -> Result<Vec<[f32; N]>, ReplicaError> {
    let groups = groups(values)?;
    if groups.is_empty() || groups.len() == vertices {
        return Ok(groups);
    }
    Err(ReplicaError::Inconsistent("a list of a picture is as long as there are vertices, or empty"))
}

fn one<const N: usize>(values: &[f32]) -> Result<[f32; N], ReplicaError> {
    values
        .try_into()
        .map_err(|_| ReplicaError::Inconsistent("a colour of a picture has too few or many parts"))
}

fn finite(values: &[f32]) -> Result<&[f32], ReplicaError> {
    if values.iter().all(|value| value.is_finite()) { Ok(values) } else { Err(ReplicaError::NotFinite) }
}

fn colour(values: &[f32]) -> Result<&[f32], ReplicaError> {
    if finite(values)?.iter().all(|value| *value >= 0.0) {
        Ok(values)
    } else {
        Err(ReplicaError::Inconsistent("a colour of a picture is negative"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> PictureScene {
        let texture = Texture { image: 0, wrap: [Wrap::Clamp, Wrap::Mirror], nearest: true };
        let part = Part {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2]],
            irradiance: vec![[1.0, 2.0, 3.0]; 3],
            irradiance_coordinates: vec![[0.5, 0.125]; 3],
            irradiance_texture: Some(Texture { image: 1, ..texture }),
            colours: vec![[0.5; 4]; 3],
            base_coordinates: vec![[0.25, 0.75]; 3],
            emission_coordinates: vec![[-1.0, 2.0]; 3],
            base: [0.1, 0.2, 0.3, 0.4],
            base_texture: Some(texture),
            emission: [7.0, 8.0, 9.0],
            emission_texture: Some(Texture { wrap: [Wrap::Repeat; 2], nearest: false, ..texture }),
            alpha: Alpha::Mask(0.5),
            double_sided: true,
        };
        let image = Image { width: 2, height: 1, encoding: Encoding::Srgb, pixels: vec![7; 8].into() };
        let light = Image { encoding: Encoding::Rgbm, ..image.clone() };
        PictureScene { parts: vec![part], images: vec![image, light], rounding: 1e-3 }
    }

    fn refused(change: impl Fn(&mut PictureScene)) -> bool {
        let mut changed = scene();
        change(&mut changed);
        decode_picture(&encode_picture(&changed).bytes).is_err()
    }

    #[test]
    fn a_scene_comes_back_as_it_went() {
        assert_eq!(decode_picture(&encode_picture(&scene()).bytes).unwrap(), scene());
        let empty = PictureScene::default();
        assert_eq!(decode_picture(&encode_picture(&empty).bytes).unwrap(), empty);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(!refused(|_| ()));
        assert!(refused(|scene| scene.parts[0].triangles[0][2] = 3));
        assert!(refused(|scene| scene.parts[0].positions[0][1] = f64::NAN));
        assert!(refused(|scene| scene.parts[0].positions[0][1] = 1e200));
        assert!(refused(|scene| scene.parts[0].irradiance.truncate(2)));
        assert!(refused(|scene| scene.parts[0].irradiance[0][0] = -1.0));
        assert!(refused(|scene| scene.parts[0].colours[0][0] = f32::INFINITY));
        assert!(refused(|scene| scene.parts[0].base_coordinates.clear()));
        assert!(refused(|scene| scene.parts[0].irradiance_coordinates.clear()));
        assert!(refused(|scene| scene.parts[0].irradiance_coordinates[2][1] = f32::NAN));
        assert!(refused(|scene| scene.images.truncate(1)));
        assert!(refused(|scene| scene.parts[0].emission_coordinates[1][0] = f32::NAN));
        assert!(refused(|scene| scene.images.clear()));
        assert!(refused(|scene| scene.images[0].height = 2));
        assert!(refused(|scene| scene.images[0].width = 0));
        assert!(refused(|scene| scene.rounding = f64::NAN));
        assert!(refused(|scene| scene.rounding = 2.0));
        assert!(decode_picture(&[0xff; 9]).is_err());
    }
}
