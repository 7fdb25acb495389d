//! Files: written whole or not at all, locked by one process, read only where they are regular.
//!
//! It must not know what is in them. Begin reading at [`write()`].

mod locked;
mod regular;
mod written;

pub use locked::LockedFile;
pub use regular::{is_irregular, open_regular, read_regular};
pub use written::{AtomicWriteFile, FileError, check, check_distinct, open, replace, write, write_with};
