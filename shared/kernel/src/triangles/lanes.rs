//! Eight numbers that are computed with together: one register's part after the other, in plain loops, as in `occluder/wide.rs`.

use pulp::{Simd, WithSimd};

/// Number of lanes. No register that is used has more: AVX-512 would compute with half of its lanes empty.
pub(super) const LANES: usize = 8;

/// Runs `work` with AVX2 or NEON, where the processor has them, else lane by lane. It should be `#[inline(always)]`, and so
/// should everything that it calls with vectors.
#[inline(always)]
pub fn with_lanes<W: WithSimd>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        return Simd::vectorize(avx2, work);
    }
    #[cfg(target_arch = "aarch64")]
    if let Some(neon) = pulp::aarch64::Neon::try_new() {
        return Simd::vectorize(neon, work);
    }
    work.with_simd(pulp::Scalar)
}

/// Eight f32 in memory.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Lanes(pub(super) [f32; LANES]);

impl Lanes {
    /// Loads a register's part of them.
    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, part: usize) -> S::f32s {
        const { assert!(S::F32_LANES <= LANES) };
        S::as_simd_f32s(&self.0).0[part]
    }

    /// Stores it.
    #[inline(always)]
    pub(super) fn store<S: Simd>(&mut self, part: usize, numbers: S::f32s) {
        S::as_mut_simd_f32s(&mut self.0).0[part] = numbers;
    }
}

/// A bit for each lane of a register: the first lane is the lowest.
#[inline(always)]
pub(super) fn bits<S: Simd>(simd: S, mask: S::m32s) -> u8 {
    // AVX has an instruction for this that the compiler does not find in loops or sums: rays take a third longer without it.
    // The type is known to the compiler, and nothing is asked at run time.
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = (&simd as &dyn std::any::Any).downcast_ref::<pulp::x86::V3>() {
        return avx2.avx._mm256_movemask_ps(pulp::bytemuck::cast(mask)) as u8;
    }
    let weights = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];
    let chosen = simd.select_f32s(mask, S::as_simd_f32s(&weights).0[0], simd.splat_f32s(0.0));
    simd.reduce_sum_f32s(chosen) as u8
}
