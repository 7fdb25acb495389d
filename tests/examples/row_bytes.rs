//! What rows weigh on the wire, and what rounding costs: `cargo measure row_bytes -- ARGUMENTS...`, each
//! the name of one of the three scenes or a number of rooms.

use std::error::Error;
use std::time::Duration;

use bake::{BakeError, BakeSettings, RowService, Unobserved, bake};
use cluster::{Cluster, FinishedJob, Handle, JobId, Workers};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{Precision, Rounding, Row, RowRequest, encode_row};
use tests::baking::imported;
use tests::building::building;
use tests::data;

/// Edge of the shooting patches of a building, in metres.
const EDGE: f64 = 0.6;

fn main() -> Result<(), Box<dyn Error>> {
    println!("scene         rows  receivers  visible  bytes/row  /factor  all digits  mean error  largest");
    for name in std::env::args().skip(1) {
        let (glb, settings) = match name.parse() {
            Ok(rooms) => {
                let building = building(rooms);
                let settings = BakeSettings {
                    shooter_edge: EDGE / building.extent,
                    mesh_error: 0.2,
                    validation_samples: 0,
                    ..BakeSettings::default()
                };
                (building.scene.glb(), settings)
            }
            Err(_) => (std::fs::read(data(&format!("scenes/{name}.glb")))?, BakeSettings::for_error(0.02)),
        };
        // Rows are rounded here, where both can be seen.
        let settings = BakeSettings { factor_rounding: 0.0, ..settings };
        let scene = imported(&glb);
        let cluster = Cluster::start(&Workers::Embedded { threads: 2 }.into())?;
        let mut service = Weighing { handle: cluster.handle(0), sums: Sums::default() };
        bake(&scene, &settings, &mut service, &mut Unobserved)?;
        let Sums { rows, receivers, factors, bytes, bytes_exact, error, largest_error } = service.sums;
        let per = |what: u64, of: u64| what as f64 / of as f64;
        println!(
            "{name:<10} {rows:>7} {:>10.0} {:>6.1} % {:>10.0} {:>8.3} {:>11.3} {:>11.1e} {largest_error:>8.1e}",
            per(receivers, rows),
            100.0 * per(factors, receivers),
            per(bytes, rows),
            per(bytes, factors),
            per(bytes_exact, factors),
            error / rows as f64,
        );
    }
    Ok(())
}

/// Of all rows of a bake.
#[derive(Default)]
struct Sums {
    rows: u64,
    receivers: u64,
    /// Factors that are not 0.
    factors: u64,
    /// On the wire, rounded.
    bytes: u64,
    /// On the wire, with all digits.
    bytes_exact: u64,
    /// What all factors of a row are off by when they are rounded, over its sum; summed over the rows.
    error: f64,
    largest_error: f64,
}

/// Workers whose rows are weighed as they come.
struct Weighing {
    handle: Handle,
    sums: Sums,
}

impl RowService for Weighing {
    fn publish(&mut self, replica: EncodedReplica) {
        self.handle.publish(replica);
    }

    fn release(&mut self, digest: Digest) {
        self.handle.release(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.handle.submit(requests);
    }

    fn withdraw(&mut self) {
        self.handle.withdraw();
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        let finished = RowService::next(&mut self.handle, patience)?;
        for row in finished.iter().flat_map(|finished| &finished.rows) {
            self.sums.add(row);
        }
        Ok(finished)
    }
}

impl Sums {
    fn add(&mut self, row: &Row) {
        let rounding = Rounding::new(Precision::DEFAULT.factor_rounding);
        let (mut off, mut sum) = (0.0, 0.0);
        let rounded: Vec<(usize, f32)> = row
            .iter()
            .map(|(receiver, factor)| {
                let draw =
                    (self.rows as u32 ^ (receiver as u32).wrapping_mul(0x01_0001)).wrapping_mul(0x9e37_79b9);
                let rounded = rounding.apply(f64::from(factor), draw);
                sum += f64::from(factor);
                off += (f64::from(rounded) - f64::from(factor)).abs();
                (receiver, rounded)
            })
            .collect();
        let error = if sum > 0.0 { off / sum } else { 0.0 };
        self.rows += 1;
        self.receivers += row.receivers() as u64;
        self.factors += row.count() as u64;
        self.bytes += encode_row(&Row::of_some(row.receivers(), &rounded)).len() as u64;
        self.bytes_exact += encode_row(row).len() as u64;
        self.error += error;
        self.largest_error = self.largest_error.max(error);
    }
}
