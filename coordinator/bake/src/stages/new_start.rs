//! Where a bake is better started anew.

use crate::rows::Rows;
use crate::settings::BakeSettings;

/// Settings to start with, and the rows that there were, which are to be ended.
pub struct NewStart {
    /// What there was.
    pub rows: Rows,
    /// Settings to start with.
    pub settings: BakeSettings,
}
