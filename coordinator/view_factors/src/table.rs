//! View factors as CSV.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Write};

use rayon::prelude::*;

use super::{ExchangePair, OPEN, ViewFactors};

/// Rows that are put into words together.
const CHUNK: usize = 256;

/// Below this, numbers are written with an exponent.
const LEAST_PLAIN: f64 = 1e-4;

impl ViewFactors {
    /// Writes `from,to,form_factor,standard_error`: each row's factors above 0 in the order of the surfaces, and what is open.
    /// Factors have all their digits. A standard error of 0 means: known up to rounding.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write_factors(&self, out: &mut (dyn Write + Send)) -> io::Result<()> {
        out.write_all(b"from,to,form_factor,standard_error\n")?;
        let lists = self.pairs_of_rows();
        let names: Vec<Cow<str>> = self.rows.iter().map(|row| quoted(&row.name)).collect();
        // Some at a time, so that the text does not fill the memory.
        for group in (0..self.rows.len()).collect::<Vec<_>>().chunks(CHUNK * rayon::current_num_threads()) {
            let texts: Vec<String> = group
                .par_chunks(CHUNK)
                .map(|rows| rows.iter().map(|row| self.row_text(*row, lists.of(*row), &names)).collect())
                .collect();
            for text in texts {
                out.write_all(text.as_bytes())?;
            }
        }
        Ok(())
    }

    /// Writes `surface,area,x,y,z,open,standard_error,correction`: area and centre of gravity of each surface, and the figures
    /// of its row.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write_areas(&self, out: &mut (dyn Write + Send)) -> io::Result<()> {
        writeln!(out, "surface,area,x,y,z,open,standard_error,correction")?;
        for row in &self.rows {
            let [x, y, z] = row.centre.to_array().map(number);
            let (area, open) = (number(row.area), number(row.open));
            let (error, correction) = (short(row.standard_error), short(row.correction));
            writeln!(out, "{},{area},{x},{y},{z},{open},{error},{correction}", quoted(&row.name))?;
        }
        Ok(())
    }

    fn row_text(&self, index: usize, pairs: &[u32], names: &[Cow<str>]) -> String {
        let row = &self.rows[index];
        let mut text = String::with_capacity(64 * (pairs.len() + 1));
        let mut line = |name: &str, factor: f64, error: f64| {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{},{name},{},{}", names[index], number(factor), short(error));
        };
        for pair in pairs {
            let pair = &self.pairs[*pair as usize];
            if pair.area > 0.0 {
                let other = if pair.from as usize == index { pair.to } else { pair.from };
                line(&names[other as usize], pair.area / row.area, pair.variance.sqrt() / row.area);
            }
        }
        if row.open > 0.0 {
            line(OPEN, row.open, row.standard_error);
        }
        text
    }

    fn pairs_of_rows(&self) -> Lists {
        let ends = |pair: &ExchangePair| {
            let (from, to) = (pair.from as usize, pair.to as usize);
            std::iter::once(from).chain((from != to).then_some(to))
        };
        let mut starts = vec![0_usize; self.rows.len() + 1];
        for end in self.pairs.iter().flat_map(ends) {
            starts[end + 1] += 1;
        }
        for row in 0..self.rows.len() {
            starts[row + 1] += starts[row];
        }
        let mut next = starts.clone();
        let mut indices = vec![0; starts[self.rows.len()]];
        // First those in which a row is the larger end, so that its list goes by the other surface.
        let mut put = |row: u32, index: usize| {
            indices[next[row as usize]] = index as u32;
            next[row as usize] += 1;
        };
        for (index, pair) in self.pairs.iter().enumerate() {
            if pair.from != pair.to {
                put(pair.to, index);
            }
        }
        for (index, pair) in self.pairs.iter().enumerate() {
            put(pair.from, index);
        }
        Lists { starts, indices }
    }
}

/// A list of pairs for each row.
struct Lists {
    starts: Vec<usize>,
    indices: Vec<u32>,
}

impl Lists {
    fn of(&self, row: usize) -> &[u32] {
        &self.indices[self.starts[row]..self.starts[row + 1]]
    }
}

/// All digits.
fn number(value: f64) -> String {
    if value == 0.0 || value.abs() >= LEAST_PLAIN { value.to_string() } else { format!("{value:e}") }
}

/// Three digits.
fn short(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.2e}") }
}

/// A field as RFC 4180 has it: in quotes if it needs them.
fn quoted(field: &str) -> Cow<'_, str> {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\"")).into()
    } else {
        field.into()
    }
}
