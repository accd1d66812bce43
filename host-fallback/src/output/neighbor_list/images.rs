//! Images of spheres within the cutoff, for spaces with a period below two cutoffs.
//!
//! # Correctness
//!
//! 1. The first set is folded into the box.
//! 2. Consider an image of the second set whose fraction, along some basis vector, is farther from all fractions of the
//!    first set than the cutoff divided by the box's height. It touches no sphere of the first set. All other images
//!    are created.
//! 3. A search in unbounded space finds all images that touch. Radii include the rounding of folds, images and the
//!    decision ([`Lattice::rounding`]), so no pair is lost.
//! 4. The decision uses the given numbers.

use lazygrid_kernels::{Error, InputError, Lattice, MAX_SPHERES, Query, Spheres, WrappedPoint};

use super::ContactTest;
use crate::memory::{try_extend, try_push, try_resize};

/// Relative growth of cutoffs, for rounding in proportion to them.
const GROWTH: f64 = 1.0 + 1.0 / (1_u64 << 40) as f64;
/// Minimum images suffice if two cutoffs are below this fraction of the distance between images.
const MAX_CUTOFF_FRACTION: f64 = 1.0 - 1.0 / (1 << 20) as f64;
/// Number of images between two reads of the stop flag.
const STOP_STEPS: usize = 1 << 16;
const IMAGES: &str = "images of spheres";

/// Folded spheres and their images.
#[derive(Debug, Default)]
pub struct PeriodicImages {
    first: Vec<[f64; 4]>,
    images: Vec<[f64; 4]>,
    spheres: Vec<u32>,
    /// Cell vectors subtracted from each sphere of the first set.
    folds: Vec<[f64; 3]>,
    shifts: Vec<[f64; 3]>,
    folded: Vec<WrappedPoint>,
    half_cutoffs: Vec<f64>,
    steps: Vec<([f64; 3], [f64; 3])>,
}

fn largest_cutoff(contact: &ContactTest<'_>) -> f64 {
    let ContactTest { query, table, .. } = contact;
    let largest = |set: Spheres<'_>| (0..set.len()).map(|k| set.get_f64(k)[3]).fold(0.0, f64::max);
    let touching = largest(query.first()) + largest(query.second().unwrap_or(query.first()));
    let Some(table) = table else { return touching };
    (0..table.species()).fold(0.0, |most, species| {
        let radius = table.species_radius(species);
        most.max(2.0 * radius.largest_half).max(if radius.effective.touches { touching } else { 0.0 })
    })
}

impl PeriodicImages {
    /// Returns `true` if a sphere may have several images of another within the cutoff.
    pub fn are_needed(contact: &ContactTest<'_>) -> bool {
        let Some(lattice) = Lattice::new(contact.space) else { return false };
        let nearest = lattice.heights().into_iter().take(lattice.rank()).fold(f64::INFINITY, f64::min);
        let is_short = 2.0 * largest_cutoff(contact) * lattice.unit() < MAX_CUTOFF_FRACTION * nearest;
        !is_short
    }

    /// Folds valid spheres and creates their images.
    ///
    /// # Errors
    /// [`InputError::Images`] for more images than 32-bit indices; [`Error::OutOfMemory`]; [`Error::Cancelled`].
    pub fn build(&mut self, contact: &ContactTest<'_>) -> Result<(), Error> {
        let Some(lattice) = Lattice::new(contact.space) else { return Ok(()) };
        let query = contact.query;
        let second = query.second().unwrap_or(query.first());
        let largest = largest_cutoff(contact);
        let spread = self.fold_all(&lattice, contact)?;
        let growth = spread.rounding(&lattice, largest * lattice.unit());
        self.half_cutoffs.clear();
        // The sum of halves for two spheres covers their cutoff.
        for set in [query.first(), second] {
            let half_cutoffs =
                (0..set.len()).map(|k| half_cutoff(contact, set, k) * lattice.unit() * GROWTH + growth);
            try_extend(&mut self.half_cutoffs, half_cutoffs, "half cutoffs of spheres")?;
        }
        let most = self.half_cutoffs[..query.first().len()].iter().copied().fold(0.0, f64::max);
        self.first.clear();
        let rows = self.folded[..query.first().len()].iter().zip(&self.half_cutoffs);
        try_extend(&mut self.first, rows.map(|(folded, &half)| row(folded.point, half)), "folded spheres")?;
        let ranges = |k: usize, images: &Self| {
            let (folded, cutoff) = (images.folded[k], images.half_cutoffs[k] + most);
            spread.steps(&lattice, &folded, cutoff)
        };
        let offset = query.first().len();
        let counted = |k: usize| {
            ranges(offset + k, self).iter().map(|[from, to]| steps_between(*from, *to)).product::<f64>()
        };
        let mut count = 0.0;
        for k in 0..second.len() {
            contact.check_stop()?;
            count += counted(k);
        }
        let is_possible = count + query.first().len() as f64 <= MAX_SPHERES as f64;
        if !is_possible {
            let images = if count.is_nan() { f64::INFINITY } else { count };
            return Err(InputError::Images { images, cutoff: largest }.into());
        }
        self.reserve(count as usize)?;
        for k in 0..second.len() {
            let ranges = ranges(offset + k, self);
            self.add(contact, &lattice, k, ranges)?;
        }
        Ok(())
    }

    /// Returns the query for pairs of a sphere and an image.
    pub fn query(&self) -> Query<'_> {
        Query::new((&self.first, &self.images))
    }

    /// Returns an image's sphere, and the cell vectors from `i` to the image.
    pub(super) fn shift(&self, i: u32, image: u32) -> (u32, [f64; 3]) {
        let (fold, shift) = (self.folds[i as usize], self.shifts[image as usize]);
        (self.spheres[image as usize], [0, 1, 2].map(|k| shift[k] + fold[k]))
    }

    fn fold_all(&mut self, lattice: &Lattice, contact: &ContactTest<'_>) -> Result<FoldedExtent, Error> {
        let query = contact.query;
        let second = query.second().unwrap_or(query.first());
        let mut spread = FoldedExtent::default();
        self.folded.clear();
        self.folds.clear();
        for (is_first, set) in [(true, query.first()), (false, second)] {
            for k in 0..set.len() {
                contact.check_stop()?;
                let [x, y, z, _] = set.get_f64(k);
                let folded = lattice.wrap([x, y, z]);
                spread.add(&folded, [x, y, z].map(|number| (number * lattice.unit()).abs()), is_first);
                try_push(&mut self.folded, folded, "folded spheres")?;
                if is_first {
                    try_push(&mut self.folds, lattice.shift(folded.counts), "folded spheres")?;
                }
            }
        }
        Ok(spread)
    }

    fn reserve(&mut self, count: usize) -> Result<(), Error> {
        try_resize(&mut self.images, count, IMAGES)?;
        try_resize(&mut self.spheres, count, IMAGES)?;
        try_resize(&mut self.shifts, count, IMAGES)?;
        self.images.clear();
        self.spheres.clear();
        self.shifts.clear();
        Ok(())
    }

    fn add(
        &mut self,
        contact: &ContactTest<'_>,
        lattice: &Lattice,
        k: usize,
        ranges: [[f64; 2]; 3],
    ) -> Result<(), Error> {
        let at = contact.query.first().len() + k;
        let (folded, half_cutoff) = (self.folded[at], self.half_cutoffs[at]);
        let along = |axis: usize| {
            let [from, to] = ranges[axis];
            (0..steps_between(from, to) as u64).map(move |step| from + step as f64)
        };
        contact.check_stop()?;
        self.steps.clear();
        for a in along(0) {
            for b in along(1) {
                for c in along(2) {
                    if self.steps.len().is_multiple_of(STOP_STEPS) {
                        contact.check_stop()?;
                    }
                    let steps = [a, b, c];
                    let counts = [0, 1, 2].map(|axis| steps[axis] - folded.counts[axis]);
                    try_push(&mut self.steps, (steps, lattice.shift(counts)), IMAGES)?;
                }
            }
        }
        self.steps.sort_unstable_by(|(_, a), (_, b)| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        for (at, &(steps, shift)) in self.steps.iter().enumerate() {
            if at.is_multiple_of(STOP_STEPS) {
                contact.check_stop()?;
            }
            try_push(&mut self.images, row(lattice.image(&folded, steps), half_cutoff), IMAGES)?;
            try_push(&mut self.spheres, k as u32, IMAGES)?;
            try_push(&mut self.shifts, shift, IMAGES)?;
        }
        Ok(())
    }
}

#[derive(Debug)]
struct FoldedExtent {
    extent: f64,
    counts: [f64; 3],
    fractions: [[f64; 2]; 3],
}

impl Default for FoldedExtent {
    fn default() -> Self {
        Self { extent: 0.0, counts: [0.0; 3], fractions: [[f64::INFINITY, f64::NEG_INFINITY]; 3] }
    }
}

impl FoldedExtent {
    fn add(&mut self, folded: &WrappedPoint, point: [f64; 3], is_first: bool) {
        self.extent = point.into_iter().fold(self.extent, f64::max);
        for axis in 0..3 {
            self.counts[axis] = self.counts[axis].max(folded.counts[axis].abs());
            if is_first {
                let [from, to] = self.fractions[axis];
                let fraction = folded.fractions[axis];
                self.fractions[axis] = [from.min(fraction), to.max(fraction)];
            }
        }
    }

    fn rounding(&self, lattice: &Lattice, cutoff: f64) -> f64 {
        let heights = lattice.heights();
        let counts = [0, 1, 2].map(|axis| 2.0 * self.counts[axis] + cutoff / heights[axis] + 2.0);
        lattice.rounding(2.0 * self.extent + cutoff, counts)
    }

    fn steps(&self, lattice: &Lattice, folded: &WrappedPoint, cutoff: f64) -> [[f64; 2]; 3] {
        let heights = lattice.heights();
        [0, 1, 2].map(|axis| {
            if axis >= lattice.rank() {
                return [0.0; 2];
            }
            let ([from, to], margin) = (self.fractions[axis], cutoff / heights[axis]);
            let fraction = folded.fractions[axis];
            [(from - margin - fraction).ceil(), (to + margin - fraction).floor()]
        })
    }
}

fn half_cutoff(contact: &ContactTest<'_>, set: Spheres<'_>, k: usize) -> f64 {
    let radius = set.get_f64(k)[3];
    match (contact.table, set.species()) {
        (Some(table), Some(species)) => table.species_radius(species[k]).for_radius(radius),
        _ => radius,
    }
}

/// Returns NaN if a height of the box underflows.
fn steps_between(from: f64, to: f64) -> f64 {
    let steps = to - from + 1.0;
    if steps < 0.0 { 0.0 } else { steps }
}

fn row([x, y, z]: [f64; 3], radius: f64) -> [f64; 4] {
    [x, y, z, radius]
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use lazygrid_kernels::Space;

    use super::*;

    #[test]
    fn images_in_extreme_boxes_are_needed_and_refused() {
        for length in [1e-162, 1e-300, 5e-324] {
            let space = Space::periodic([Some(1.0), Some(length), Some(length)]).expect("lengths");
            let rows = [[0.0_f64, 0.0, 0.0, 0.1], [0.5, 0.0, 0.0, 0.1]];
            let query = Query::new(&rows);
            let contact = ContactTest { query: &query, space: &space, table: None, stop: None };
            assert!(PeriodicImages::are_needed(&contact), "{length:e}");
            let built = PeriodicImages::default().build(&contact);
            assert!(matches!(built, Err(Error::Input(InputError::Images { .. }))), "{length:e}: {built:?}");
        }
        let space = Space::periodic([Some(1e-162), Some(1.0), None]).expect("lengths");
        let rows = [[0.0_f64, 0.0, 0.0, 1e-164]; 2];
        let query = Query::new(&rows);
        let contact = ContactTest { query: &query, space: &space, table: None, stop: None };
        assert!(!PeriodicImages::are_needed(&contact));
    }

    #[test]
    fn stop_flag_ends_the_creation_of_images() {
        let (space, rows) =
            (Space::periodic([Some(1.0); 3]).expect("lengths"), [[0.0_f64, 0.0, 0.0, 1.0]; 2]);
        let query = Query::new(&rows);
        for (is_stopped, expected) in [(false, Ok(())), (true, Err(Error::Cancelled))] {
            let stop = AtomicBool::new(is_stopped);
            let contact = ContactTest { query: &query, space: &space, table: None, stop: Some(&stop) };
            assert_eq!(PeriodicImages::default().build(&contact), expected);
        }
    }
}
