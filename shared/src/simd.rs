//! The widest vector instructions of the machine.

/// Runs `operation` compiled for the widest vector instructions that this machine has. What is inlined into it may use
/// them. Only the width differs: every number is computed by the same exactly rounded operations in the same order, so that the
/// bits are the same on every machine of a cluster.
#[inline(always)]
pub fn widest<R>(operation: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(operation)
}
