//! Cameras of a file and of the user.

use glam::{DAffine3, DVec3};
use gltf::camera::Projection as FileProjection;
use kernel::picture::{Camera, Projection};

use scene::Frame;
use scene::LitDocument;

/// A camera of a file, placed by a node.
#[derive(Debug, Clone, PartialEq)]
pub struct FileCamera {
    /// Names of its node and of itself.
    pub names: Vec<String>,
    /// From the camera's coordinates, in which it looks along -z, to the world.
    world: DAffine3,
    lens: Lens,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Lens {
    Perspective { height_angle: f64, aspect: Option<f64>, near: f64 },
    Orthographic { half: [f64; 2], near: f64 },
}

/// A user's choice of camera.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraChoice {
    /// The first of the file, or an automatic view.
    Any,
    /// A camera of the file, by its name, its node's name, or its index in the order of the nodes.
    OfFile(String),
    /// A camera given by its position and target.
    LookAt(LookAt),
}

/// A perspective camera given by its position and target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookAt {
    /// Position, in the file's coordinates.
    pub eye: DVec3,
    /// Point in the middle of the picture.
    pub target: DVec3,
    /// Direction that is up in the picture.
    pub up: DVec3,
    /// Angle from the bottom to the top of the picture, in radians.
    pub height_angle: f64,
}

/// Why a camera cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// No camera has that name.
    #[error("the file has no camera {name:?}: {}", if known.is_empty() {
        "it has none at all; use --eye and --target".to_owned()
    } else {
        format!("it has {}", known.join(", "))
    })]
    Unknown {
        /// Requested name or index.
        name: String,
        /// Cameras of the file.
        known: Vec<String>,
    },
    /// A camera with a degenerate transform or lens.
    #[error("{0} sees nothing: {1}")]
    Blind(String, &'static str),
}

/// The cameras of a document.
pub(super) fn read_cameras(document: &LitDocument) -> Vec<FileCamera> {
    let read = |&(node, world): &(usize, DAffine3)| {
        let node = document.document.nodes().nth(node)?;
        let camera = node.camera()?;
        let names = [node.name(), camera.name()].into_iter().flatten().map(str::to_owned).collect();
        let lens = match camera.projection() {
            FileProjection::Perspective(lens) => Lens::Perspective {
                height_angle: lens.yfov().into(),
                aspect: lens.aspect_ratio().map(f64::from),
                near: lens.znear().into(),
            },
            FileProjection::Orthographic(lens) => Lens::Orthographic {
                half: [lens.xmag().abs().into(), lens.ymag().abs().into()],
                near: lens.znear().into(),
            },
        };
        Some(FileCamera { names, world, lens })
    };
    document.cameras.iter().filter_map(read).collect()
}

impl FileCamera {
    /// Width over height, if the camera states it.
    #[must_use]
    pub fn aspect(&self) -> Option<f64> {
        let aspect = match self.lens {
            Lens::Perspective { aspect, .. } => aspect?,
            Lens::Orthographic { half: [width, height], .. } => width / height,
        };
        (1e-3..1e3).contains(&aspect).then_some(aspect)
    }

    /// The camera for a picture of this aspect (width over height), in a frame. The angle or extent from bottom to top stays as it
    /// is. The node's scale does not count, as glTF says.
    ///
    /// # Errors
    /// When its transform or its lens makes no sense.
    pub fn camera(&self, frame: &Frame, aspect: f64) -> Result<Camera, CameraError> {
        let blind = |why| CameraError::Blind(format!("camera {}", self.label()), why);
        let eye = self.world.translation;
        let (up, back) = (self.world.matrix3.y_axis, self.world.matrix3.z_axis);
        let basis = Basis::new(-back, up).ok_or_else(|| blind("its node has a scale of zero"))?;
        let (projection, near) = match self.lens {
            Lens::Perspective { height_angle, near, .. } => (
                perspective(height_angle, aspect)
                    .ok_or_else(|| blind("its angle is not below 180 degrees"))?,
                near,
            ),
            Lens::Orthographic { half: [_, height], near } => {
                let height = height / frame.scale;
                if !(1e-9..1e9).contains(&height) {
                    return Err(blind("its ymag is zero, or far too large"));
                }
                (Projection::Parallel { half: [height * aspect, height] }, near)
            }
        };
        Ok(basis.camera(frame.to_frame(eye), projection, near.max(0.0) / frame.scale))
    }

    /// Its name in messages.
    #[must_use]
    pub fn label(&self) -> String {
        self.names.first().map_or_else(|| "without a name".to_owned(), |name| format!("{name:?}"))
    }
}

impl LookAt {
    /// The camera for a picture of this aspect, in a frame.
    ///
    /// # Errors
    /// When eye and target are one, the view is along `up`, or the angle makes no sense.
    pub fn camera(&self, frame: &Frame, aspect: f64) -> Result<Camera, CameraError> {
        let blind = |why| CameraError::Blind("the camera".to_owned(), why);
        let basis = Basis::new(self.target - self.eye, self.up)
            .ok_or_else(|| blind("--target must not be --eye, nor lie straight --up from it"))?;
        let projection = perspective(self.height_angle, aspect)
            .ok_or_else(|| blind("--fov must lie between 0 and 180 degrees"))?;
        Ok(basis.camera(frame.to_frame(self.eye), projection, 0.0))
    }
}

/// The camera of a file with this name or number.
///
/// # Errors
/// When there is none.
fn find<'a>(cameras: &'a [FileCamera], name: &str) -> Result<&'a FileCamera, CameraError> {
    let named = cameras.iter().find(|camera| camera.names.iter().any(|own| own == name));
    let numbered = || name.parse::<usize>().ok().and_then(|number| cameras.get(number));
    named.or_else(numbered).ok_or_else(|| CameraError::Unknown {
        name: name.to_owned(),
        known: cameras.iter().enumerate().map(|(i, camera)| format!("{i}: {}", camera.label())).collect(),
    })
}

impl CameraChoice {
    /// The chosen one of a file's cameras; `None` if the choice is none of them.
    ///
    /// # Errors
    /// When no camera has the name.
    pub fn of_file<'a>(&self, cameras: &'a [FileCamera]) -> Result<Option<&'a FileCamera>, CameraError> {
        match self {
            Self::Any => Ok(cameras.first()),
            Self::OfFile(name) => find(cameras, name).map(Some),
            Self::LookAt(_) => Ok(None),
        }
    }
}

/// Half the width and height of a picture at distance 1.
fn perspective(height_angle: f64, aspect: f64) -> Option<Projection> {
    let height = (height_angle / 2.0).tan();
    let is_sensible =
        height_angle > 0.0 && height_angle < std::f64::consts::PI && (1e-9..1e9).contains(&height);
    is_sensible.then_some(Projection::Perspective { half: [height * aspect, height] })
}

/// Axes of a camera.
pub(super) struct Basis {
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl Basis {
    /// Axes of a camera that looks forward, with `up` above; `None` where these do not span a plane.
    pub(super) fn new(forward: DVec3, up: DVec3) -> Option<Self> {
        let forward = forward.try_normalize()?;
        let right = forward.cross(up.try_normalize()?).try_normalize()?;
        // Once more: right of nearly parallel vectors is not quite perpendicular.
        let right = (right - forward * right.dot(forward)).try_normalize()?;
        Some(Self { right, up: right.cross(forward).normalize(), forward })
    }

    pub(super) fn camera(&self, eye: DVec3, projection: Projection, near: f64) -> Camera {
        Camera { eye, right: self.right, up: self.up, forward: self.forward, projection, near }
    }
}
