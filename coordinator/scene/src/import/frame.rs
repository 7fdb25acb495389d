//! The frame: the scene centred and scaled by a power of two.

use kernel::geometry::Bounds;
use rayon::prelude::*;

use crate::frame::Frame;
use document::ImportProblem;

/// Largest extent of the scene in the frame lies between this and twice this.
const LEAST_EXTENT_EXPONENT: i32 = 10;

/// The frame of all that lies in these boxes, in the file's units.
pub(super) fn fit(boxes: impl ParallelIterator<Item = Bounds>) -> Result<Frame, ImportProblem> {
    let Bounds { low, high } = boxes.reduce(|| Bounds::EMPTY, Bounds::union);
    let extent = (high - low).max_element();
    // Beyond these, scale or sizes in the frame would leave the range of normal numbers.
    if !(1e-100..1e100).contains(&extent) {
        return Err(ImportProblem::Extent { extent: extent.max(0.0) });
    }
    // The exponent as IEEE 754 stores it: a logarithm may be rounded up to the next integer.
    let exponent = ((extent.to_bits() >> 52) & 0x7ff) as i32 - 1023;
    let scale = 2f64.powi(exponent - LEAST_EXTENT_EXPONENT);
    Ok(Frame { centre: low + (high - low) * 0.5, scale })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn fit_points(points: &[DVec3]) -> Result<Frame, ImportProblem> {
        fit(points.par_iter().map(|&point| Bounds::around([point])))
    }

    fn extent_in_frame(extent: f64) -> f64 {
        let corners = [DVec3::splat(3.0), DVec3::new(3.0 + extent, 3.0, 3.0)];
        let frame = fit_points(&corners).unwrap();
        frame.to_frame(corners[1]).x - frame.to_frame(corners[0]).x
    }

    #[test]
    fn largest_extent_lies_between_1024_and_2048() {
        for extent in [1e-4, 0.99, 1.0, 1.5, 2.0, 5.5, 1023.9, 1024.0, 1e6] {
            let framed = extent_in_frame(extent);
            assert!((1024.0..2048.0).contains(&framed), "{extent}: {framed}");
        }
    }

    #[test]
    fn frame_is_centred_and_inverts() {
        let corners = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 5.0, 4.0)];
        let frame = fit_points(&corners).unwrap();
        assert_eq!(frame.to_frame(corners[0]), -frame.to_frame(corners[1]));
        assert_eq!(frame.to_world(frame.to_frame(corners[0])), corners[0]);
    }

    #[test]
    fn scale_is_a_power_of_two_and_scaling_by_one_gives_the_same_frame_positions() {
        let corners = [DVec3::new(0.1, 0.2, 0.3), DVec3::new(2.7, 5.9, 4.1)];
        let frame = fit_points(&corners).unwrap();
        let scaled = fit_points(&corners.map(|corner| corner * 64.0)).unwrap();
        assert_eq!(frame.scale.log2().fract(), 0.0);
        assert_eq!(frame.to_frame(corners[1]), scaled.to_frame(corners[1] * 64.0));
    }

    #[test]
    fn no_extent_is_an_error() {
        let fault = fit_points(&[DVec3::ONE, DVec3::ONE]).unwrap_err();
        assert!(matches!(fault, ImportProblem::Extent { extent: 0.0 }));
        assert!(fit_points(&[]).is_err());
    }
}
