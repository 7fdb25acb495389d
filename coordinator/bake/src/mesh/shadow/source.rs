use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::occluder::Occluder;
use kernel::row::Spot;
use scene::{LightKind, Scene};

/// A light without area.
pub struct Source {
    place: Place,
    spot: Option<Spot>,
    /// Radiant intensity per squared frame unit; irradiance across a directional light.
    strength: DVec3,
}

enum Place {
    At(DVec3),
    /// Unit vector along which the light travels.
    Far(DVec3),
}

/// The lights of a scene that cast sharp shadows.
pub fn sources(scene: &Scene) -> Vec<Source> {
    let square = scene.frame.scale * scene.frame.scale;
    let shining = scene.lights.iter().filter(|light| light.intensity.max_element() > 0.0);
    let source = |light: &scene::Light| match light.kind {
        LightKind::Point { position } => {
            Some(Source { place: Place::At(position), spot: None, strength: light.intensity / square })
        }
        LightKind::Spot(spot) => {
            let strength = light.intensity / square;
            Some(Source { place: Place::At(spot.position), spot: Some(spot), strength })
        }
        LightKind::Directional { along } => {
            Some(Source { place: Place::Far(along), spot: None, strength: light.intensity })
        }
        LightKind::Area(_) => None,
    };
    shining.filter_map(source).collect()
}

impl Source {
    /// Vector from a point to the light, or of length 1 towards one that is far.
    pub fn towards(&self, point: DVec3) -> DVec3 {
        match self.place {
            Place::At(position) => position - point,
            Place::Far(along) => -along,
        }
    }

    /// Height of the light over a plane; infinite for one that is far and not below.
    pub fn height_over(&self, origin: DVec3, normal: DVec3) -> f64 {
        match self.place {
            Place::At(position) => normal.dot(position - origin),
            Place::Far(along) => normal.dot(along) * f64::NEG_INFINITY,
        }
    }

    /// The shadow of a point at this height over a plane with this normal, which lies below the light.
    pub fn shadow_of(&self, point: DVec3, height: f64, normal: DVec3) -> DVec3 {
        let towards = self.towards(point);
        point - towards * (height / normal.dot(towards))
    }

    /// The part of the length of a shadow that does not depend on how its receiver leans: that of an edge on a plane across the
    /// light, no nearer than the edge and no farther than `farthest` from the light.
    pub fn longest_shadow(&self, [from, to]: [DVec3; 2], farthest: impl Fn(DVec3) -> f64) -> f64 {
        match self.place {
            Place::At(position) => {
                let (a, b) = (from - position, to - position);
                let across = a.cross(b).length();
                let sine = across / (a.length() * b.length());
                if sine.is_finite() { sine * farthest(position).max(a.length()).max(b.length()) } else { 0.0 }
            }
            Place::Far(along) => (to - from).cross(along).length(),
        }
    }

    /// What the light gives a surface with this normal that it sees.
    pub fn irradiance(&self, point: DVec3, normal: DVec3) -> DVec3 {
        let towards = self.towards(point);
        let square = towards.length_squared();
        let cosine = normal.dot(towards) / square.sqrt();
        let attenuation =
            self.spot.map_or(1.0, |spot| spot.attenuation(-spot.direction.dot(towards) / square.sqrt()));
        let factor = attenuation * cosine / square;
        if factor > 0.0 && factor.is_finite() { self.strength * factor } else { DVec3::ZERO }
    }

    /// Whether something stands between the light and a point of a plane.
    pub fn is_hidden(&self, occluder: &Occluder, point: DVec3, plane: PlaneId) -> bool {
        match self.place {
            Place::At(position) => occluder.blocks(point, position, [plane; 2]),
            Place::Far(along) => occluder.blocks_from_far(point, along, plane),
        }
    }
}
