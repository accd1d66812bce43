use glam::DVec3;

use super::basis::{combination, heights, inverse, power_of_two_below};
use crate::Space;

/// The reduced basis of a periodic space. Lengths are scaled by a power of two, so no product overflows.
#[derive(Clone, Copy, Debug)]
pub struct Lattice {
    rank: usize,
    unit: f64,
    basis: [DVec3; 3],
    inverse: [DVec3; 3],
    heights: [f64; 3],
    /// Multiple of each cell vector in each basis vector.
    multiples: [[f64; 3]; 3],
}

/// A point, wrapped into a [`Lattice`]'s box.
#[derive(Clone, Copy, Debug, Default)]
pub struct WrappedPoint {
    /// Point in the unit of the lattice.
    pub point: [f64; 3],
    /// Multiple of each basis vector that was subtracted.
    pub counts: [f64; 3],
    /// Remaining fraction of each basis vector, from 0 to 1 up to rounding.
    pub fractions: [f64; 3],
}

impl Lattice {
    /// Creates the lattice of a space; `None` if the space is not periodic.
    pub fn new(space: &Space) -> Option<Self> {
        if let Some(cell) = space.triclinic_cell() {
            return Some(cell.lattice());
        }
        let lengths = space.lengths();
        let longest = lengths.into_iter().flatten().reduce(f64::max)?;
        let unit = power_of_two_below(longest.recip().min(f64::MAX));
        let (mut basis, mut multiples) = ([DVec3::ZERO; 3], [[0.0; 3]; 3]);
        let axes = (0..3).filter(|&axis| lengths[axis].is_some());
        let rest = (0..3).filter(|&axis| lengths[axis].is_none());
        for (k, axis) in axes.chain(rest).enumerate() {
            basis[k] = DVec3::AXES[axis] * lengths[axis].map_or(1.0, |length| length * unit);
            multiples[k][axis] = f64::from(u8::from(lengths[axis].is_some()));
        }
        // Products of extreme lengths would overflow or underflow.
        let heights = basis.map(|vector| vector.max_element());
        let inverse = [0, 1, 2].map(|k| basis[k] / heights[k] / heights[k]);
        Some(Self { rank: lengths.iter().flatten().count(), unit, basis, inverse, heights, multiples })
    }

    pub(crate) fn from_parts(rank: usize, unit: f64, basis: [DVec3; 3], multiples: [[f64; 3]; 3]) -> Self {
        let inverse = inverse(&basis);
        Self { rank, unit, basis, inverse, heights: heights(&inverse), multiples }
    }

    /// Returns the number of periodic vectors.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Returns the factor from the unit of the spheres to the unit of the lattice.
    pub fn unit(&self) -> f64 {
        self.unit
    }

    /// Returns the distances between neighboring images of the planes that pairs of basis vectors span, in the unit of
    /// the lattice. Images of a point are at least the smallest of the first [`rank`](Self::rank) heights apart.
    pub fn heights(&self) -> [f64; 3] {
        self.heights
    }

    /// Wraps a point along periodic vectors.
    pub fn wrap(&self, point: [f64; 3]) -> WrappedPoint {
        let mut folded = DVec3::from(point) * self.unit;
        let mut counts = [0.0; 3];
        // For distant points, one step is not enough.
        for _ in 0..4 {
            let more_counts =
                [0, 1, 2].map(|k| if k < self.rank { self.inverse[k].dot(folded).floor() } else { 0.0 });
            if more_counts == [0.0; 3] {
                break;
            }
            (0..3).for_each(|k| counts[k] += more_counts[k]);
            folded = DVec3::from(point) * self.unit - combination(&self.basis, counts);
        }
        let fractions = self.inverse.map(|row| row.dot(folded));
        WrappedPoint { point: folded.to_array(), counts, fractions }
    }

    /// Returns the image of a wrapped point at these multiples of the basis vectors.
    pub fn image(&self, folded: &WrappedPoint, steps: [f64; 3]) -> [f64; 3] {
        (DVec3::from(folded.point) + combination(&self.basis, steps)).to_array()
    }

    /// Converts multiples of the basis vectors into multiples of the cell vectors.
    pub fn shift(&self, counts: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|column| (0..3).map(|k| counts[k] * self.multiples[k][column]).sum())
    }

    /// Returns an upper bound of the rounding error of [`wrap`](Self::wrap), [`image`](Self::image) and
    /// [`Space::image`] for coordinates up to `extent` and up to `counts` basis vectors, in the unit of the lattice.
    pub fn rounding(&self, extent: f64, counts: [f64; 3]) -> f64 {
        const PART: f64 = 1.0 / (1_u64 << 47) as f64;
        // No cell vector is longer than 2 in this unit.
        let multiples_sum =
            |k: usize| 2.0 * self.multiples[k].iter().map(|multiples| multiples.abs()).sum::<f64>();
        PART * (extent + (0..self.rank).map(|k| (counts[k] + 1.0) * multiples_sum(k)).sum::<f64>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_of_orthogonal_spaces_are_lengths() {
        for lengths in
            [[Some(1.0), Some(1e-162), Some(1e-162)], [Some(1e-300), None, Some(1e200)], [Some(7.0); 3]]
        {
            let lattice = Lattice::new(&Space::periodic(lengths).expect("lengths")).expect("it repeats");
            let heights = lattice.heights();
            for (height, length) in heights.into_iter().zip(lengths.into_iter().flatten()) {
                assert_eq!(height, length * lattice.unit(), "{lengths:?}: {heights:?}");
            }
        }
    }

    #[test]
    fn folds_are_undone_by_their_shifts() {
        let cell_vectors = [Some([4.0, 0.0, 0.0]), Some([11.5, 5.0, 0.0]), Some([0.3, -7.1, 6.0])];
        let spaces = [
            Space::triclinic(cell_vectors),
            Space::triclinic([cell_vectors[0], None, cell_vectors[2]]),
            Space::periodic([None, Some(0.7), Some(2e9)]),
            Space::periodic([Some(3e-300), None, None]),
        ];
        for space in spaces.map(|space| space.expect("a space")) {
            let lattice = Lattice::new(&space).expect("it repeats");
            let rank = space.cell_vectors().iter().flatten().count();
            assert_eq!(lattice.rank(), rank);
            for point in [[0.0; 3], [1.5, -2.25, 3.0], [-41.0, 1e4, 77.0]] {
                let point = point.map(|number| number / lattice.unit());
                let folded = lattice.wrap(point);
                for fraction in &folded.fractions[..rank] {
                    assert!((-1e-6..1.0 + 1e-6).contains(fraction), "{space:?}: {folded:?}");
                }
                let back = space.image(point, lattice.shift(folded.counts.map(|count| -count)));
                let extent = 1e4_f64.max(lattice.unit());
                let bound = lattice.rounding(extent, folded.counts.map(f64::abs));
                for (number, expected) in back.into_iter().zip(folded.point) {
                    let error = (number * lattice.unit() - expected).abs();
                    assert!(error <= bound, "{space:?}: {error:e}");
                }
            }
        }
        assert!(Lattice::new(&Space::UNBOUNDED).is_none());
    }
}
