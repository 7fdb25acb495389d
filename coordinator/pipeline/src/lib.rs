//! The one run from a scene file to a lit file, and the options that it takes.
//!
//! In: a scene file and [`options`]. Out: a lit file, and a report of figures. The command line, the service and relighting all go
//! this way. It must not know clients, jobs or terminals. Begin reading at [`options`], then [`summary`].

pub mod options;
pub mod summary;
