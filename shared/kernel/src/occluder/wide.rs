//! Vectors of the machine's width.
//!
//! What closures and iterators hold is not compiled for the wide vectors of the machine: hence the plain loops here and where
//! these functions are used.

use glam::DVec3;
use pulp::Simd;

use crate::geometry::lanes::{LANES, Mask, Vectors};

/// One vector for each lane of a register.
pub type Wide<S> = [<S as Simd>::f64s; 3];

/// Loads a register's part of some vectors.
#[inline(always)]
pub fn load<S: Simd>(vectors: &Vectors, part: usize) -> Wide<S> {
    [
        S::as_simd_f64s(&vectors.x).0[part],
        S::as_simd_f64s(&vectors.y).0[part],
        S::as_simd_f64s(&vectors.z).0[part],
    ]
}

/// Stores it.
#[inline(always)]
pub fn store<S: Simd>(vectors: &mut Vectors, part: usize, wide: Wide<S>) {
    let [x, y, z] = wide;
    S::as_mut_simd_f64s(&mut vectors.x).0[part] = x;
    S::as_mut_simd_f64s(&mut vectors.y).0[part] = y;
    S::as_mut_simd_f64s(&mut vectors.z).0[part] = z;
}

/// The same vector in all lanes.
#[inline(always)]
pub fn splat<S: Simd>(simd: S, vector: DVec3) -> Wide<S> {
    [simd.splat_f64s(vector.x), simd.splat_f64s(vector.y), simd.splat_f64s(vector.z)]
}

/// The difference of vectors.
#[inline(always)]
pub fn minus<S: Simd>(simd: S, a: Wide<S>, b: Wide<S>) -> Wide<S> {
    [simd.sub_f64s(a[0], b[0]), simd.sub_f64s(a[1], b[1]), simd.sub_f64s(a[2], b[2])]
}

/// The scalar product. Products and sums are rounded one by one: fused they would be other bits on machines that cannot.
#[inline(always)]
pub fn dot<S: Simd>(simd: S, a: Wide<S>, b: Wide<S>) -> S::f64s {
    let sum = simd.add_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]));
    simd.add_f64s(sum, simd.mul_f64s(a[2], b[2]))
}

/// The vector product.
#[inline(always)]
pub fn cross<S: Simd>(simd: S, a: Wide<S>, b: Wide<S>) -> Wide<S> {
    [
        simd.sub_f64s(simd.mul_f64s(a[1], b[2]), simd.mul_f64s(a[2], b[1])),
        simd.sub_f64s(simd.mul_f64s(a[2], b[0]), simd.mul_f64s(a[0], b[2])),
        simd.sub_f64s(simd.mul_f64s(a[0], b[1]), simd.mul_f64s(a[1], b[0])),
    ]
}

/// True where the mask is empty.
#[inline(always)]
pub fn none<S: Simd>(simd: S, mask: S::m64s) -> bool {
    simd.first_true_m64s(mask) == S::F64_LANES
}

/// A bit for each lane of a register.
#[inline(always)]
pub fn bits<S: Simd>(simd: S, mask: S::m64s) -> Mask {
    let mut flags = [0.0; LANES];
    S::as_mut_simd_f64s(&mut flags).0[0] = simd.select_f64s(mask, simd.splat_f64s(1.0), simd.splat_f64s(0.0));
    let mut bits = 0;
    for (i, flag) in flags.iter().enumerate() {
        bits |= Mask::from(*flag != 0.0) << i;
    }
    bits
}
