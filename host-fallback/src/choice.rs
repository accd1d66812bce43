//! Which detector runs: a pure function of the input's survey, with its reason.

use lazygrid_kernels::Algorithm;

use crate::Survey;

/// Below this many spheres all pairs are tested: building any structure costs more.
pub const NAIVE_BELOW: usize = 192;

/// The algorithm for spheres of this survey where `asked` leaves it open, and why.
pub fn choose(asked: Algorithm, survey: &Survey) -> (Algorithm, String) {
    if asked != Algorithm::Auto {
        return (asked, format!("{asked}: asked for"));
    }
    let n = survey.spheres;
    if n < NAIVE_BELOW {
        let reason = format!("naive: {n} spheres are fewer than {NAIVE_BELOW}");
        return (Algorithm::Naive, reason);
    }
    let classes = survey.occupied().count();
    let plural = if classes == 1 { "" } else { "s" };
    (Algorithm::CellList, format!("cell-list: {n} spheres in {classes} size class{plural}", plural = if plural.is_empty() { "" } else { "es" }))
}
