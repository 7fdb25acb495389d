//! What is wrong with options.

use glam::DVec3;
use protocol::api;

use super::kind::{Kind, Value, is_short};

/// Most violations that are told: an error must fit into the head of an answer.
pub(super) const MOST_VIOLATIONS: usize = 20;

/// A field of a request that is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// The field, as `bake.error`.
    pub field: String,
    /// What it should be.
    pub should: String,
}

impl Violation {
    /// A field that is wrong.
    pub fn new(field: impl Into<String>, should: impl Into<String>) -> Self {
        Self { field: field.into(), should: should.into() }
    }
}

/// Options that are wrong, each with what it should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", sentences(.0))]
pub struct InvalidOptions(pub Vec<Violation>);

fn sentences(violations: &[Violation]) -> String {
    let sentence = |violation: &Violation| format!("{} {}", violation.field, violation.should);
    violations.iter().map(sentence).collect::<Vec<_>>().join("; ")
}

/// Fields that are wrong, as they are found.
#[derive(Debug, Default)]
pub struct Violations(Vec<Violation>);

impl Violations {
    /// Nothing, or all that is wrong.
    ///
    /// # Errors
    /// When something is wrong.
    pub fn check(self) -> Result<(), InvalidOptions> {
        if self.0.is_empty() { Ok(()) } else { Err(InvalidOptions(self.0)) }
    }

    /// Notes that a field is not as it should be.
    pub fn demand(&mut self, holds: bool, field: &str, should: impl Into<String>) {
        let violation = (!holds).then(|| Violation::new(field, should));
        self.0.extend(violation.filter(|new| self.0.len() < MOST_VIOLATIONS && !self.0.contains(new)));
    }

    /// Notes that a text is too long.
    pub fn short(&mut self, text: &str, field: &str) {
        self.demand(is_short(text), field, Kind::Text.should());
    }

    /// A colour, if there is one; notes where it cannot be.
    pub(super) fn colour(&mut self, colour: Option<api::Colour>, field: &str) -> Option<DVec3> {
        let colour = colour.map(|colour| DVec3::new(colour.r, colour.g, colour.b));
        let holds = colour.is_none_or(|colour| Kind::Colour.allows(&Value::Colour(colour)));
        self.demand(holds, field, Kind::Colour.should());
        colour
    }
}
