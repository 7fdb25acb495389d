//! Means of images over polygons.
//!
//! | file | what it does |
//! |---|---|
//! | `composed` | images of one mapping as one: colour, metal, alpha |
//! | `area` | the mean over a polygon |

mod area;
mod composed;

pub(crate) use area::{AreaMeans, Raster};
pub(crate) use composed::{Composed, Dimming, Opacity};
