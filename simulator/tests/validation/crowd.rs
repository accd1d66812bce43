//! Spheres that do not overlap.

use crate::Row;

pub(crate) fn hard_spheres() -> Vec<Row> {
    Vec::new()
}
