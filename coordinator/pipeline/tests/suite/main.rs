//! Tests of whole runs, in one program: each is linked whole.

mod files;
mod observed;
