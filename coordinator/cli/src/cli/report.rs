use std::time::Duration;

use ::console::Term;
use cluster::WorkerSummary;
use comfy_table::{ContentArrangement, Table, presets};
use output::export::Unshared;
use pipeline::summary::{Summary, TimeDivision, WorkerMetrics, busy_share};

use super::console;
use super::progress::short;

/// Metrics as tables, for people.
pub trait Tables {
    /// Prints the tables.
    ///
    /// # Errors
    /// When standard output cannot be written.
    fn print(&self) -> anyhow::Result<()>;
}

impl Tables for Summary {
    fn print(&self) -> anyhow::Result<()> {
        let bake = &self.bake;
        let mut table = new_table();
        let mut row = |name: &str, value: String| {
            table.add_row([name.to_owned(), value]);
        };
        let steps: Vec<String> =
            bake.seconds.iter().map(|(name, seconds)| format!("{name} {seconds:.2}")).collect();
        row("time", format!("{:.2} s ({})", self.seconds, steps.join(", ")));
        row("  divided", divided(&self.time));
        row("vertices", format!("{} ({} shooting)", bake.vertices, bake.shooting_vertices));
        row("triangles", self.exported.triangles.to_string());
        if let Some(Unshared { meshes, nodes, vertices }) = self.exported.unshared {
            row(
                "instances",
                format!(
                    "{vertices} vertices for {nodes} nodes of {meshes} meshes; a lightmap would share them"
                ),
            );
        }
        if let Some(map) = &self.lightmap {
            let [width, height] = map.size;
            row(
                "lightmap",
                format!(
                    "{} x {width} x {height}, {} charts{}; texels of {:.4}, {} covered, {} of them hidden",
                    map.pages,
                    map.charts,
                    if map.uses_second_set { " of the second set" } else { "" },
                    map.texel_size,
                    map.texels,
                    map.hidden_texels
                ),
            );
        }
        if let Some(probes) = &self.probes {
            let grid = probes.grid.map_or_else(String::new, |grid| {
                let [x, y, z] = grid.size;
                format!(" ({x} x {y} x {z}, {} apart)", grid.spacing)
            });
            row("probes", format!("{}{grid}, {} inside of walls", probes.probes, probes.inside));
        }
        let model = &bake.model;
        row(
            "lights",
            format!(
                "{}; {}",
                counts(&[
                    (model.area_lights, "area", true),
                    (model.point_lights, "point", true),
                    (model.spot_lights, "spot", false),
                    (model.directional_lights, "directional", false),
                    (model.sky, "sky", false),
                ]),
                if model.channels == 1 { "all grey: one channel of light" } else { "three channels" }
            ),
        );
        let part = |pairs: u64| 100.0 * pairs as f64 / model.pairs.max(1) as f64;
        row(
            "pairs",
            format!(
                "{}: {:.1} % turned away (no form factor), {:.1} % nothing between (no visibility), {:.1} % something between (computed), {:.1} % sampled",
                short(model.pairs as f64),
                part(model.pairs_turned_away),
                part(model.pairs_unoccluded),
                part(model.pairs_computed),
                part(model.pairs_sampled)
            ),
        );
        row(
            "rows",
            format!(
                "{} ({} form factors); {} kept, {} made again",
                bake.rows,
                short(bake.factors as f64),
                format_args!("{}B", short(bake.row_bytes as f64)),
                bake.rows_again
            ),
        );
        row(
            "rays",
            format!("{} ({} pairs sampled)", short(bake.rays as f64), short(bake.model.pairs_sampled as f64)),
        );
        let balance = &bake.balance;
        let percent = |flux: &[f64; 3]| {
            let emitted: f64 = balance.emitted.iter().sum();
            // Adding zero turns -0 into 0.
            (1e6 * flux.iter().sum::<f64>() / emitted).round() / 1e4 + 0.0
        };
        let fluxes = [&balance.absorbed, &balance.unshot, &balance.escaped, &balance.imbalance].map(percent);
        row(
            "energy balance",
            format!(
                "absorbed {:.2} %, unshot {:.4} %, escaped {:.2} %, imbalance {:.2} %",
                fluxes[0], fluxes[1], fluxes[2], fluxes[3]
            ),
        );
        row("unshot bound", format!("{:.1e} of the reflected flux", bake.unshot_bound));
        let error = &bake.error;
        row(
            "error, estimated",
            format!(
                "{:.2} %: mesh {:.2} % (receivers {:.2} %, shooters {:.2} %), visibility {:.2} %, form factors {:.0e}, unshot {:.0e}",
                100.0 * error.total,
                100.0 * error.mesh,
                100.0 * error.receivers,
                100.0 * error.shooters,
                100.0 * error.visibility,
                error.form_factors,
                error.unshot
            ),
        );
        let sums = &bake.row_sums;
        row("row sums", format!("mean {:.4}, {:.4} to {:.4}", sums.mean, sums.least, sums.largest));
        let classes = ["<.5", ".5", ".9", ".99", ".999", ">1.001"].iter().zip(&sums.histogram);
        let classes: Vec<String> =
            classes.map(|(name, part)| format!("{name}: {:.1} %", part * 100.0)).collect();
        row("  of the area", classes.join("  "));
        if let Some(bytes) = self.peak_memory_bytes {
            row("peak memory", format!("{}B", short(bytes as f64)));
        }
        if let Some(checkpoint) = &self.checkpoint {
            let mut text =
                format!("{} rows from it, {} added", checkpoint.rows_read, checkpoint.rows_written);
            match &checkpoint.stopped {
                Some(why) => text += &format!(", {} not: {why}", checkpoint.rows_dropped),
                None if checkpoint.rows_dropped > 0 => {
                    text += &format!(", {} not: the disk did not keep up", checkpoint.rows_dropped);
                }
                None => {}
            }
            row("checkpoint", text);
        }
        row("exposure", format!("{:.4e} per {}", self.exported.exposure, self.unit));
        for (name, kinds) in [("modelled", &self.account.modelled), ("ignored", &self.account.ignored)] {
            if !kinds.is_empty() {
                row(name, kinds.join(", "));
            }
        }
        if self.degenerate_triangles > 0 {
            row("dropped", format!("{} triangles without area", self.degenerate_triangles));
        }
        console::print(&table)?;
        if let WorkerMetrics::Exclusive(workers, _) = &self.workers
            && workers.len() > 1
        {
            console::print(worker_table(workers))?;
        }
        Ok(())
    }
}

fn worker_table(workers: &[WorkerSummary]) -> Table {
    let mut table = new_table();
    table.set_header(["worker", "threads", "jobs", "late", "rows", "rays", "busy", "received", "sent"]);
    for worker in workers {
        let part = &worker.part;
        let mut name = part.name.clone();
        if worker.connections > 1 {
            name += &format!(" (connected {} times)", worker.connections);
        }
        if let Some(why) = &worker.lost {
            name += &format!(" (lost: {why})");
        }
        table.add_row([
            name,
            part.threads.to_string(),
            part.jobs.to_string(),
            worker.late.to_string(),
            part.rows.to_string(),
            short(part.rays as f64),
            format!("{:.0} % of {:.2} s", 100.0 * busy_share(worker), seconds(worker.connected)),
            format!(
                "{}B ({:.0} a row)",
                short(part.bytes_received as f64),
                part.bytes_received as f64 / part.rows.max(1) as f64
            ),
            format!("{}B", short(worker.bytes_sent as f64)),
        ]);
    }
    table
}

/// How the time divides, in seconds and parts of it.
fn divided(TimeDivision { parts, own }: &TimeDivision) -> String {
    let all = parts.total().max(f64::MIN_POSITIVE);
    let part = |name: &str, seconds: f64| format!("{name} {seconds:.2} ({:.0} %)", 100.0 * seconds / all);
    let steps: Vec<String> = own.iter().map(|(step, seconds)| format!("{step} {seconds:.2}")).collect();
    let mut text = vec![part("rows", parts.rows)];
    if parts.other_rows >= 0.005 * all {
        text.push(part("rows of others or twice", parts.other_rows));
    }
    text.push(part("waiting for rows", parts.waiting));
    text.push(part("network", parts.network));
    text.push(format!("{}: {}", part("coordinator", parts.own), steps.join(", ")));
    text.join(", ")
}

/// Kinds with how many there are of each; `true`: also where there is none.
fn counts(kinds: &[(usize, &str, bool)]) -> String {
    let shown = kinds.iter().filter(|(count, _, always)| *always || *count > 0);
    shown.map(|(count, name, _)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
}

fn seconds(duration: Duration) -> f64 {
    duration.as_secs_f64()
}

/// An empty table, no wider than the terminal.
pub fn new_table() -> Table {
    let mut table = Table::new();
    table.load_preset(presets::UTF8_BORDERS_ONLY);
    if let Some((_, columns)) = Term::stdout().size_checked() {
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(columns);
    }
    table
}
