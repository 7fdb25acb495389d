//! The angle over its sine, as a polynomial: what the contour sum needs of an edge instead of an arc tangent.

/// A polynomial p with theta / sin theta = 1 + w p(w) and w = 2 (1 - cos theta), for theta from 0 to a right angle, where w is
/// at most 2.
///
/// With the 1 exact, the error of an edge falls with its angle, so that it does not grow where the terms of the contour sum
/// cancel, over polygons that are small from afar. The function is analytic for w < 4, so the error of the best polynomial
/// falls 5.8 times with each degree.
pub(super) trait AngleOverSine {
    /// Largest error of p, its rounding in f64 included.
    const ERROR: f64;

    /// p(w).
    fn beyond_one(w: f64) -> f64;
}

/// The best polynomial of degree 9.
pub(super) struct Quick;

/// The best polynomial of degree 18: exact up to rounding.
pub(super) struct Full;

impl AngleOverSine for Quick {
    const ERROR: f64 = 3.6e-9;

    #[inline(always)]
    fn beyond_one(w: f64) -> f64 {
        polynomial(&QUICK, w)
    }
}

impl AngleOverSine for Full {
    const ERROR: f64 = 6e-16;

    #[inline(always)]
    fn beyond_one(w: f64) -> f64 {
        polynomial(&FULL, w)
    }
}

/// Even and odd powers apart by Horner's rule: two short chains instead of a long one. Product and sum are each rounded: fused
/// where the processor has it, the bits would be the processor's.
#[inline(always)]
fn polynomial<const N: usize>(coefficients: &[f64; N], w: f64) -> f64 {
    let square = w * w;
    let mut sums = [0.0; 2];
    sums[(N - 1) % 2] = coefficients[N - 1];
    sums[(N - 2) % 2] = coefficients[N - 2];
    for i in 2..N {
        let power = N - 1 - i;
        sums[power % 2] = sums[power % 2] * square + coefficients[power];
    }
    sums[0] + sums[1] * w
}

// Found by Remez' exchange in 50 digits; the constant terms are near 1/6 and 1/30, of the Taylor series.
const QUICK: [f64; 10] = [
    0.166_666_663_113_540_3,
    0.033_333_668_891_971_67,
    0.007_137_635_638_140_069,
    0.001_618_681_603_616_308_5,
    0.000_265_742_773_058_939_74,
    0.000_246_286_745_469_609_9,
    -0.000_147_180_425_495_679_1,
    0.000_105_931_355_834_450_94,
    -3.340_127_333_642_883e-5,
    5.551_099_610_344_788e-6,
];

const FULL: [f64; 19] = [
    0.166_666_666_666_667_02,
    0.033_333_333_333_213_463,
    0.007_142_857_149_832_528,
    0.001_587_301_426_384_830_4,
    0.000_360_752_319_612_045_37,
    8.323_556_249_727_944e-5,
    1.949_635_268_842_371_8e-5,
    4.325_408_529_610_41e-6,
    1.693_916_903_728_161_2e-6,
    -8.755_136_900_710_142e-7,
    1.647_054_930_952_516_6e-6,
    -1.672_798_846_532_547e-6,
    1.371_917_803_121_957_3e-6,
    -8.390_373_512_285_102e-7,
    3.844_239_901_423_753_5e-7,
    -1.271_518_497_478_329_3e-7,
    2.890_416_992_302_847e-8,
    -4.047_543_969_794_612e-9,
    2.682_036_117_921_386_7e-10,
];
