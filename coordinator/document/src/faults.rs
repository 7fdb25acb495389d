//! What the `gltf` crate finds, in our words.

use gltf::binary;
use gltf::json::validation::Error as Fault;

use super::error::ImportProblem;

impl From<gltf::Error> for ImportProblem {
    fn from(error: gltf::Error) -> Self {
        match error {
            gltf::Error::Binary(error) => of_container(&error),
            gltf::Error::Deserialize(error) if error.is_eof() => {
                ImportProblem::Truncated { detail: format!("the JSON ends early, {error}") }
            }
            gltf::Error::Deserialize(error) => ImportProblem::Malformed { detail: error.to_string() },
            gltf::Error::Io(error) => ImportProblem::Unreadable(error),
            gltf::Error::Validation(faults) => match faults.first() {
                Some((path, Fault::IndexOutOfBounds)) => {
                    ImportProblem::DanglingIndex { path: path.to_string() }
                }
                Some((path, Fault::Missing)) => {
                    ImportProblem::Malformed { detail: format!("{path} is missing") }
                }
                Some((path, Fault::Oversize)) => {
                    ImportProblem::Malformed { detail: format!("{path} is too large") }
                }
                Some((path, _)) => {
                    ImportProblem::Malformed { detail: format!("{path} has an invalid value") }
                }
                None => ImportProblem::Malformed { detail: "validation failed".to_owned() },
            },
        }
    }
}

fn of_container(error: &binary::Error) -> ImportProblem {
    let truncated = |detail: String| ImportProblem::Truncated { detail };
    match error {
        binary::Error::Version(version) => ImportProblem::Version { version: version.to_string() },
        binary::Error::Magic(_) => ImportProblem::NotGltf,
        binary::Error::Length { length, length_read } => {
            truncated(format!("{length_read} of {length} bytes follow the GLB header"))
        }
        binary::Error::ChunkLength { length, length_read, .. } => {
            truncated(format!("a GLB chunk has {length_read} of {length} bytes"))
        }
        binary::Error::Io(_) => truncated("a GLB chunk header is cut off".to_owned()),
        binary::Error::ChunkType(_) | binary::Error::UnknownChunkType(_) => ImportProblem::Malformed {
            detail: "its GLB chunks are not JSON and BIN, in this order".to_owned(),
        },
    }
}
