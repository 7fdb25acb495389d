//! Tests of the output from outside, in one program: each is linked whole.

mod compressed;
mod small;
