//! Bakes by real processes while things go wrong: the same bytes come out, or an error that names who is at fault.
//!
//! | module | what goes wrong |
//! |---|---|
//! | `workers` | workers are killed, stopped, restarted, slowed down, join late, leave |
//! | `network` | the network is cut, and healed |
//! | `lies` | workers answer garbage, twice, late, or in another version |
//! | `killer` | a job kills every worker |
//! | `checkpoint` | the coordinator is killed, or its disk is full |
//! | `fake` | a worker that does as a test tells it |

mod checkpoint;
mod fake;
mod killer;
mod lies;
mod network;
mod workers;

use std::sync::OnceLock;

use tests::programs::{Solved, Solving};

/// A bake of cornell that things go wrong with.
struct Cornell {
    knobs: [&'static str; 2],
    /// What an undisturbed bake in one process gives.
    expected: OnceLock<Vec<u8>>,
}

impl Cornell {
    const fn new(knobs: [&'static str; 2]) -> Self {
        Self { knobs, expected: OnceLock::new() }
    }

    /// Starts to bake.
    fn bake(&self, arguments: &[&str]) -> Solving {
        Solving::start(&tests::data("scenes/cornell.glb"), &[&self.knobs, arguments].concat())
    }

    /// Starts to bake by these workers.
    fn bake_by(&self, addresses: &[&str], arguments: &[&str]) -> Solving {
        self.bake(&[&["--workers", &addresses.join(",")], arguments].concat())
    }

    fn expected(&self) -> &[u8] {
        let undisturbed = || self.bake(&["--threads", "2"]).finish().lit;
        self.expected.get_or_init(|| undisturbed().expect("an undisturbed bake ends well"))
    }

    /// Checks that the bake ended well, with the bytes of an undisturbed one.
    #[track_caller]
    fn assert_undisturbed(&self, solved: &Solved) {
        assert!(solved.success, "{}", solved.said);
        assert!(solved.lit.as_deref() == Some(self.expected()), "the lit file differs; {}", solved.said);
    }
}

/// Long enough that things can go wrong in its middle: a second of two threads or more.
static LONG: Cornell = Cornell::new(["--error", "0.016"]);

/// Long enough for what takes seconds: a silent worker is noticed, a slow one does some jobs, one that comes late is dialled.
static LONGER: Cornell = Cornell::new(["--error", "0.012"]);

/// Waits until a bake is under way: workers have the scene, its first vertices and those of some refinements, with most of them to come.
fn wait_until_under_way(solving: &mut Solving) {
    solving.wait_for_replicas(6);
}

/// Starts a long bake by these workers.
fn bake_by(addresses: &[&str], arguments: &[&str]) -> Solving {
    LONG.bake_by(addresses, arguments)
}

/// Checks that a long bake ended as an undisturbed one.
#[track_caller]
fn assert_undisturbed(solved: &Solved) {
    LONG.assert_undisturbed(solved);
}

/// The report's entry of the worker at this address.
#[track_caller]
fn worker<'a>(solved: &'a Solved, address: &str) -> &'a serde_json::Value {
    let workers = solved.report["workers"].as_array().expect("reports list workers");
    let at = |worker: &&serde_json::Value| worker["address"] == address;
    workers.iter().find(at).unwrap_or_else(|| panic!("no worker at {address} in {workers:?}"))
}
