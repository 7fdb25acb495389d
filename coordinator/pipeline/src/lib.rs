//! The run from a scene file to a lit file, and the options that it takes.
//!
//! In: a scene (file or bytes), settings, workers and an observer. Out: the lit file, kept light and report on disk, and a
//! [`Summary`](summary::Summary). The command line and the service both go this way; they supply paths, observers and limits. It
//! must not know clients, jobs or terminals. Begin reading at [`run()`](run::run), then [`relight`].
//!
//! | module | what lives there |
//! |---|---|
//! | [`run`] | a bake, from file to file |
//! | [`relight`] | a relight, from file to file |
//! | [`lightmap_run`], [`probes_run`] | the lightmap of a bake, and its probes |
//! | [`options`] | options of the API, checked and turned into settings |
//! | [`memory`], [`prediction`] | memory of processes, and of a scene before it is read |
//! | [`summary`] | metrics of a run, and the extras of a lit file |

mod files_beside;
pub mod lightmap_run;
pub mod memory;
pub mod options;
pub mod prediction;
pub mod probes_run;
pub mod relight;
pub mod run;
pub mod summary;
