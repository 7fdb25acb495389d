//! Wide vectors, chosen at run time.

/// Runs `work` compiled for the widest vectors that the processor has: AVX-512, AVX2 or NEON, else as the crate is compiled.
///
/// `work` should be an `#[inline(always)]` closure, and so should be every function that it calls with loops to be made wide:
/// what is not inlined keeps the vectors of the compilation. Wider vectors change no bit of a result: the compiler neither
/// fuses a product with a sum nor reorders sums of floating-point numbers, and a loop over lanes without sums across them is
/// the same arithmetic for each lane at every width. Square root and division are rounded exactly on every processor.
///
/// ```
/// let mut squares = [1.5; 32];
/// kernel::simd::widest(
///     #[inline(always)]
///     || squares.iter_mut().for_each(|number| *number *= *number),
/// );
/// assert_eq!(squares, [2.25; 32]);
/// ```
#[inline]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
