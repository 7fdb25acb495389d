//! Eight numbers that are computed with together.

use std::ops::{Add, Mul, Sub};

/// Number of lanes.
pub(super) const LANES: usize = 8;

/// Eight f32 in memory.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Lanes(pub(super) [f32; LANES]);

/// A way to compute with eight f32: what a processor has, or lane by lane.
pub(super) trait Wide: Copy {
    /// Holds the eight.
    type Register: Copy;

    fn load(self, lanes: &Lanes) -> Self::Register;
    fn splat(self, value: f32) -> Self::Register;
    fn add(self, a: Self::Register, b: Self::Register) -> Self::Register;
    fn sub(self, a: Self::Register, b: Self::Register) -> Self::Register;
    fn mul(self, a: Self::Register, b: Self::Register) -> Self::Register;
    fn min(self, a: Self::Register, b: Self::Register) -> Self::Register;
    fn max(self, a: Self::Register, b: Self::Register) -> Self::Register;
    fn abs(self, a: Self::Register) -> Self::Register;

    /// a - b c, rounded once or twice.
    fn minus_product(self, a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register;

    /// The lanes in which the first is at most the second: the first lane is the lowest bit.
    fn at_most(self, a: Self::Register, b: Self::Register) -> u8;
}

/// Eight f32 to compute with.
#[derive(Clone, Copy)]
pub(super) struct Eight<W: Wide> {
    wide: W,
    register: W::Register,
}

impl<W: Wide> Eight<W> {
    #[inline(always)]
    pub(super) fn load(wide: W, lanes: &Lanes) -> Self {
        Self { wide, register: wide.load(lanes) }
    }

    #[inline(always)]
    pub(super) fn splat(wide: W, value: f32) -> Self {
        Self { wide, register: wide.splat(value) }
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        Self { register: self.wide.abs(self.register), ..self }
    }

    /// This less a product: rounded once where the processor can, else twice.
    #[inline(always)]
    pub(super) fn minus_product(self, a: Self, b: Self) -> Self {
        Self { register: self.wide.minus_product(self.register, a.register, b.register), ..self }
    }

    /// The lesser in each lane.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self { register: self.wide.min(self.register, other.register), ..self }
    }

    /// The greater in each lane.
    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self { register: self.wide.max(self.register, other.register), ..self }
    }

    /// See [`Wide::at_most`].
    #[inline(always)]
    pub(super) fn at_most(self, other: Self) -> u8 {
        self.wide.at_most(self.register, other.register)
    }
}

macro_rules! operators {
    ($($operator:ident $function:ident),*) => {
        $(impl<W: Wide> $operator for Eight<W> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self { register: self.wide.$function(self.register, other.register), ..self }
            }
        })*
    };
}

operators!(Add add, Sub sub, Mul mul);

/// Lane by lane, on any processor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Portable;

impl Portable {
    #[inline(always)]
    fn each(self, a: Lanes, b: Lanes, operation: impl Fn(f32, f32) -> f32) -> Lanes {
        let mut result = a;
        for lane in 0..LANES {
            result.0[lane] = operation(a.0[lane], b.0[lane]);
        }
        result
    }
}

impl Wide for Portable {
    type Register = Lanes;

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Lanes {
        *lanes
    }

    #[inline(always)]
    fn splat(self, value: f32) -> Lanes {
        Lanes([value; LANES])
    }

    #[inline(always)]
    fn add(self, a: Lanes, b: Lanes) -> Lanes {
        self.each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, a: Lanes, b: Lanes) -> Lanes {
        self.each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, a: Lanes, b: Lanes) -> Lanes {
        self.each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn min(self, a: Lanes, b: Lanes) -> Lanes {
        self.each(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, a: Lanes, b: Lanes) -> Lanes {
        self.each(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn abs(self, a: Lanes) -> Lanes {
        self.each(a, a, |a, _| a.abs())
    }

    #[inline(always)]
    fn minus_product(self, a: Lanes, b: Lanes, c: Lanes) -> Lanes {
        self.sub(a, self.mul(b, c))
    }

    #[inline(always)]
    fn at_most(self, a: Lanes, b: Lanes) -> u8 {
        (0..LANES).fold(0, |mask, lane| mask | u8::from(a.0[lane] <= b.0[lane]) << lane)
    }
}

/// AVX2 and what came with it.
#[cfg(target_arch = "x86_64")]
pub(super) use pulp::x86::V3 as Avx2;

#[cfg(target_arch = "x86_64")]
impl Wide for Avx2 {
    type Register = std::arch::x86_64::__m256;

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Self::Register {
        pulp::cast(lanes.0)
    }

    #[inline(always)]
    fn splat(self, value: f32) -> Self::Register {
        self.avx._mm256_set1_ps(value)
    }

    #[inline(always)]
    fn add(self, a: Self::Register, b: Self::Register) -> Self::Register {
        self.avx._mm256_add_ps(a, b)
    }

    #[inline(always)]
    fn sub(self, a: Self::Register, b: Self::Register) -> Self::Register {
        self.avx._mm256_sub_ps(a, b)
    }

    #[inline(always)]
    fn mul(self, a: Self::Register, b: Self::Register) -> Self::Register {
        self.avx._mm256_mul_ps(a, b)
    }

    #[inline(always)]
    fn min(self, a: Self::Register, b: Self::Register) -> Self::Register {
        self.avx._mm256_min_ps(a, b)
    }

    #[inline(always)]
    fn max(self, a: Self::Register, b: Self::Register) -> Self::Register {
        self.avx._mm256_max_ps(a, b)
    }

    #[inline(always)]
    fn abs(self, a: Self::Register) -> Self::Register {
        self.avx._mm256_andnot_ps(self.splat(-0.0), a)
    }

    #[inline(always)]
    fn minus_product(self, a: Self::Register, b: Self::Register, c: Self::Register) -> Self::Register {
        self.fma._mm256_fnmadd_ps(b, c, a)
    }

    #[inline(always)]
    fn at_most(self, a: Self::Register, b: Self::Register) -> u8 {
        let less = self.avx._mm256_cmp_ps::<{ std::arch::x86_64::_CMP_LE_OQ }>(a, b);
        self.avx._mm256_movemask_ps(less) as u8
    }
}
