use glam::DVec3;

use crate::messages::PictureCamera;
use crate::replica::points;

/// How far axes may be from unit vectors that are perpendicular to each other: some thousand roundings.
const SKEW: f64 = 1e-9;

/// Where a picture is taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The eye, or the middle of the plane that parallel rays start from.
    pub eye: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to its top.
    pub up: DVec3,
    /// Unit vector away from the camera.
    pub forward: DVec3,
    /// How rays leave.
    pub projection: Projection,
    /// What is nearer, along `forward`, is not seen.
    pub near: f64,
}

/// How rays leave a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// From the eye.
    Perspective {
        /// Half the width and height of the picture at distance 1: tangents of half the angles of view.
        half: [f64; 2],
    },
    /// Side by side.
    Parallel {
        /// Half the width and height of what is seen.
        half: [f64; 2],
    },
}

/// A ray of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Unit vector along it.
    pub direction: DVec3,
    /// Distance from which on it sees.
    pub start: f64,
}

impl Camera {
    /// The ray through a place in the picture: `x` from 0 at its left border to 1 at its right, `y` from 0 at its top to 1.
    #[must_use]
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        let offset = |[width, height]: [f64; 2]| {
            self.right * ((2.0 * x - 1.0) * width) + self.up * ((1.0 - 2.0 * y) * height)
        };
        match self.projection {
            Projection::Perspective { half } => {
                let along = self.forward + offset(half);
                let length = along.length();
                Ray { origin: self.eye, direction: along / length, start: self.near * length }
            }
            Projection::Parallel { half } => {
                Ray { origin: self.eye + offset(half), direction: self.forward, start: self.near }
            }
        }
    }

    /// The place in the picture at which a point is seen: the inverse of [`Self::ray`]. `None` where it is behind the eye.
    #[must_use]
    pub fn place(&self, point: DVec3) -> Option<[f64; 2]> {
        let from_eye = point - self.eye;
        let depth = from_eye.dot(self.forward);
        let (half, scale) = match self.projection {
            Projection::Perspective { half } => (half, depth),
            Projection::Parallel { half } => (half, 1.0),
        };
        let x = from_eye.dot(self.right) / (scale * half[0]);
        let y = from_eye.dot(self.up) / (scale * half[1]);
        (depth > 0.0).then_some([0.5 + 0.5 * x, 0.5 - 0.5 * y])
    }

    /// The camera as it travels.
    #[must_use]
    pub(super) fn to_message(self) -> PictureCamera {
        let ([half_width, half_height], parallel) = match self.projection {
            Projection::Perspective { half } => (half, false),
            Projection::Parallel { half } => (half, true),
        };
        let list = |vector: DVec3| vector.to_array().to_vec();
        PictureCamera {
            eye: list(self.eye),
            right: list(self.right),
            up: list(self.up),
            forward: list(self.forward),
            half_width,
            half_height,
            parallel,
            near: self.near,
        }
    }

    /// Reads a camera and checks it.
    ///
    /// # Errors
    /// The fault of an invalid camera.
    pub(super) fn from_message(message: &PictureCamera) -> Result<Self, &'static str> {
        let vector = |values: &[f64]| match points(values).as_deref() {
            Ok([vector]) => Ok(*vector),
            _ => Err("a place or an axis has three finite numbers"),
        };
        let [eye, right, up, forward] =
            [&message.eye, &message.right, &message.up, &message.forward].map(|values| vector(values));
        let (eye, right, up, forward) = (eye?, right?, up?, forward?);
        let lengths = [right, up, forward].map(|axis| axis.length() - 1.0);
        let angles = [right.dot(up), up.dot(forward), forward.dot(right)];
        // A NaN is not below.
        if !lengths.iter().chain(&angles).all(|error| error.abs() < SKEW) {
            return Err("its axes are unit vectors, perpendicular to each other");
        }
        let half = [message.half_width, message.half_height];
        if !half.iter().all(|half| (1e-12..=1e12).contains(half)) {
            return Err("what it sees has a width and a height");
        }
        if eye.abs().max_element() > 1e15 || !(0.0..=1e15).contains(&message.near) {
            return Err("it is too far away, or its near plane is");
        }
        let projection =
            if message.parallel { Projection::Parallel { half } } else { Projection::Perspective { half } };
        Ok(Self { eye, right, up, forward, projection, near: message.near })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(projection: Projection) -> Camera {
        Camera {
            eye: DVec3::new(1.0, 2.0, 3.0),
            right: DVec3::X,
            up: DVec3::Y,
            forward: DVec3::NEG_Z,
            projection,
            near: 0.5,
        }
    }

    #[test]
    fn a_known_point_is_seen_at_a_known_place() {
        // 10 in front, 2 to the right and 1 up; the picture is 8 wide and 4 high there.
        let point = DVec3::new(3.0, 3.0, -7.0);
        let perspective = camera(Projection::Perspective { half: [0.4, 0.2] });
        assert_eq!(perspective.place(point), Some([0.75, 0.25]));
        let parallel = camera(Projection::Parallel { half: [4.0, 2.0] });
        assert_eq!(parallel.place(point), Some([0.75, 0.25]));
        assert_eq!(perspective.place(DVec3::new(1.0, 2.0, 4.0)), None);
        for camera in [perspective, parallel] {
            let ray = camera.ray(0.75, 0.25);
            let nearest = ray.origin + ray.direction * (point - ray.origin).dot(ray.direction);
            assert!(nearest.distance(point) < 1e-14);
            // The near plane is perpendicular to the view.
            let start = ray.origin + ray.direction * ray.start;
            assert!(((start - camera.eye).dot(camera.forward) - 0.5).abs() < 1e-15);
        }
    }

    #[test]
    fn a_camera_that_makes_no_sense_is_refused() {
        let good = camera(Projection::Perspective { half: [0.4, 0.2] });
        assert_eq!(Camera::from_message(&good.to_message()).unwrap(), good);
        let refused = |change: fn(&mut PictureCamera)| {
            let mut message = good.to_message();
            change(&mut message);
            Camera::from_message(&message).is_err()
        };
        assert!(refused(|camera| camera.eye.truncate(2)));
        assert!(refused(|camera| camera.up[1] = 2.0));
        assert!(refused(|camera| camera.up = vec![1.0, 0.0, 0.0]));
        assert!(refused(|camera| camera.forward[0] = f64::NAN));
        assert!(refused(|camera| camera.half_width = 0.0));
        assert!(refused(|camera| camera.half_height = f64::INFINITY));
        assert!(refused(|camera| camera.near = -1.0));
        assert!(refused(|camera| camera.eye[0] = 1e300));
    }
}
