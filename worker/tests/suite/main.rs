//! Tests of the worker from outside, in one program: each is linked whole.

mod binary;
mod golden_rows;
#[cfg(unix)]
mod process;
mod room;
mod session;
mod transparent;
