use glam::DVec3;

use super::basis::{combination, completed, heights, inverse, orthogonal_part, power_of_two_below, reduce};
use super::lattice::Lattice;
use super::orthogonalization::Orthogonalization;
use crate::InputError;

/// Thinnest box, as a fraction of its longest cell vector. In a thinner one, `f64` could not distinguish images.
const MIN_THICKNESS: f64 = 1.0 / (1 << 24) as f64;
/// Maximum steps to wrap a vector. Each step leaves about 2⁻⁵⁰ of its length.
const MAX_WRAP_STEPS: usize = 4;
/// Scales cells in which multiples of cell vectors overflow. Multiples in a reduced basis are smaller than its inverse.
const DOWN: f64 = 1.0 / (1_u128 << 64) as f64;
/// Factor by which sums of multiples of vectors stay below the largest number: above 3·√3·√3, for three components,
/// vectors and the longest vector.
const OVERFLOW_MARGIN: f64 = 16.0;
/// Maximum multiples of cell vectors, in all, that were added to a vector whose images are not compared. Rounding then
/// stays below 2⁻¹³ of [`MIN_NEAR_PART`].
const MAX_NEAR_MULTIPLES: f64 = (1 << 16) as f64;
/// Least length of each basis vector's orthogonal part in cells for which images of short vectors are not compared.
const MIN_NEAR_PART: f64 = 1.0 / (1 << 20) as f64;

/// The cell of a space with a cell vector that is not along an axis. Images are at integer multiples of *basis*
/// vectors, which are reduced (Lenstra, Lenstra and Lovász).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriclinicCell {
    vectors: [Option<[f64; 3]>; 3],
    rank: usize,
    /// Scales lengths to the unit of the basis: a power of two, so that no product overflows.
    unit: f64,
    /// Reduced vectors, then unit vectors orthogonal to all before.
    basis: [DVec3; 3],
    /// Multiple of each cell vector in each basis vector.
    multiples: [[f64; 3]; 3],
    /// Part of each basis vector that is orthogonal to its predecessors, over its squared length.
    steps: [DVec3; 3],
    inverse: [DVec3; 3],
    /// Squared length below which a wrapped vector is the minimum image.
    near_squared: f64,
    /// Maximum multiples of a basis vector for which `near_squared` holds.
    near_count: f64,
    fits_f32: bool,
}

impl TriclinicCell {
    pub(crate) fn new(vectors: [Option<[f64; 3]>; 3]) -> Result<Self, InputError> {
        let refused = || InputError::CellVectors { vectors: Box::new(vectors) };
        let largest = vectors.iter().flatten().flatten().fold(0.0_f64, |most, number| most.max(number.abs()));
        if !(largest.is_finite() && largest > 0.0) {
            return Err(refused());
        }
        let unit = power_of_two_below(largest.recip().min(f64::MAX));
        let (mut basis, mut multiples) = ([DVec3::ZERO; 3], [[0.0; 3]; 3]);
        let mut rank = 0;
        for (k, vector) in vectors.iter().enumerate() {
            let Some(vector) = vector else { continue };
            basis[rank] = DVec3::from(*vector) * unit;
            multiples[rank][k] = 1.0;
            rank += 1;
        }
        let longest = basis.iter().fold(0.0, |longest, vector| vector.length().max(longest));
        let heights = heights(&inverse(&completed(basis, rank)));
        if !(longest.is_finite() && heights[..rank].iter().all(|&height| height >= MIN_THICKNESS * longest)) {
            return Err(refused());
        }
        reduce(&mut basis[..rank], &mut multiples);
        let basis = completed(basis, rank);
        let orthogonal = [0, 1, 2].map(|k| orthogonal_part(&basis, k));
        let steps = orthogonal.map(|vector| vector / vector.length_squared());
        let inverse = inverse(&basis);
        let (near_squared, near_count) = near(&orthogonal[..rank], &multiples);
        let mut cell = Self {
            vectors,
            rank,
            unit,
            basis,
            multiples,
            steps,
            inverse,
            near_squared,
            near_count,
            fits_f32: false,
        };
        cell.fits_f32 = cell.orthogonal_space(Orthogonalization::SCALE).is_normal();
        Ok(cell)
    }

    pub(crate) fn vectors(&self) -> [Option<[f64; 3]>; 3] {
        self.vectors
    }

    /// Returns the map to the orthogonal space at this scale.
    pub fn orthogonal_space(&self, scale: f64) -> Orthogonalization {
        Orthogonalization::from_basis(self.rank, self.unit, self.inverse, scale)
    }

    pub(crate) fn scaled(self, scale: f64) -> Self {
        let vectors = self.vectors.map(|vector| vector.map(|vector| vector.map(|number| number * scale)));
        Self { vectors, unit: self.unit / scale, ..self }
    }

    pub(crate) fn fits_f32(&self) -> bool {
        self.fits_f32
    }

    pub(crate) fn lattice(&self) -> Lattice {
        let mut basis = self.basis;
        for (vector, multiples) in basis.iter_mut().zip(&self.multiples).take(self.rank) {
            // Recomputed without the rounding of the reduction.
            *vector = DVec3::from(shifted([0.0; 3], *multiples, &self.vectors)) * self.unit;
        }
        Lattice::from_parts(self.rank, self.unit, basis, self.multiples)
    }

    /// Returns the length of the longest cell vector.
    pub fn longest(&self) -> f64 {
        let length = |vector: &[f64; 3]| (DVec3::from(*vector) * self.unit).length();
        self.vectors.iter().flatten().map(length).fold(0.0, f64::max) / self.unit
    }

    /// Returns the number of cell vectors.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Returns the largest component of a vector whose minimum image does not overflow. In cells longer than 1, the
    /// image itself may; the exact test then scales the vector and the cell.
    pub fn max_component(&self) -> f64 {
        let lowest = heights(&self.inverse)[..self.rank].iter().copied().fold(f64::INFINITY, f64::min);
        // A vector of length `l` takes at most `l` over the height of each basis vector. Each takes up to the sum of
        // its multiples of cell vectors, no longer than √3 units.
        let vectors = self.multiples.iter().flatten().map(|count| count.abs()).sum::<f64>();
        f64::MAX / (OVERFLOW_MARGIN * vectors) * lowest / self.unit
    }

    /// Returns the multiples of the cell vectors that lead to a vector's minimum image, and that image.
    ///
    /// # Correctness
    /// 1. Let `rₖ` be the length of the part of the `k`-th basis vector that is orthogonal to its predecessors. Some
    ///    image has at most `½rₖ` along each part, so the minimum image is at most `ρ = ½√(r₁² + r₂² + r₃²)` long.
    /// 2. In a reduced basis `rₖ² ≥ 0.74 rₖ₋₁²`, hence `ρ < 1.1 r₃`.
    /// 3. The wrapped vector has at most half of each basis vector. Hence only −1, 0 and 1 times the third vector can
    ///    lead to the minimum image.
    /// 4. The same holds for the second vector in each of these three planes. Along the first, rounding finds the
    ///    image.
    /// 5. No lattice vector is shorter than the smallest `rₖ`. If a vector is shorter than a quarter of it, all its
    ///    other images are at least three times as long. The same holds for a wrapped vector if few lattice vectors
    ///    were added, which bounds the rounding.
    pub(crate) fn minimum_image(&self, vector: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        if self.is_near(vector) { self.image(vector, [0.0; 3]) } else { self.image_of_distant(vector) }
    }

    /// Returns the vector of [`minimum_image`](Self::minimum_image), up to the signs of zeros.
    #[inline]
    pub(crate) fn minimum_image_vector(&self, vector: [f64; 3]) -> [f64; 3] {
        if self.is_near(vector) { vector } else { self.image_of_distant(vector).1 }
    }

    #[inline]
    fn is_near(&self, vector: [f64; 3]) -> bool {
        (DVec3::from(vector) * self.unit).length_squared() < self.near_squared
    }

    fn image_of_distant(&self, vector: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        if let Some(image) = self.finite_image(vector) {
            return image;
        }
        let image = self.scaled(DOWN).finite_image(vector.map(|number| number * DOWN));
        image.map_or(([0.0; 3], [f64::NAN; 3]), |(shift, image)| (shift, image.map(|number| number / DOWN)))
    }

    /// Returns `None` if a multiple of a cell vector overflows.
    fn finite_image(&self, vector: [f64; 3]) -> Option<([f64; 3], [f64; 3])> {
        let (apart, counts) = self.wrapped(vector);
        if apart.length_squared() < self.near_squared
            && counts.iter().all(|count| count.abs() <= self.near_count)
        {
            let image = self.image(vector, counts);
            return image.1.iter().all(|number| number.is_finite()).then_some(image);
        }
        self.shortest_image(vector, apart, counts)
    }

    /// Returns the vector with at most about half of each basis vector, and the multiples of basis vectors added to it.
    fn wrapped(&self, vector: [f64; 3]) -> (DVec3, [f64; 3]) {
        let scaled = DVec3::from(vector) * self.unit;
        let mut counts = [0.0; 3];
        let mut apart = scaled;
        for _ in 0..MAX_WRAP_STEPS {
            let more_counts =
                [0, 1, 2].map(|k| if k < self.rank { -self.inverse[k].dot(apart).round() } else { 0.0 });
            if more_counts == [0.0; 3] {
                break;
            }
            (0..3).for_each(|k| counts[k] += more_counts[k]);
            apart = scaled + combination(&self.basis, counts);
        }
        (apart, counts)
    }

    fn shortest_image(
        &self,
        vector: [f64; 3],
        apart: DVec3,
        counts: [f64; 3],
    ) -> Option<([f64; 3], [f64; 3])> {
        let mut best: Option<(f64, [f64; 3], [f64; 3])> = None;
        for image in self.images(apart, counts) {
            let (shift, image) = self.image(vector, image);
            // An image that overflows might be the shortest.
            if !image.iter().all(|number| number.is_finite()) {
                return None;
            }
            let [x, y, z] = image.map(|number| number * self.unit);
            let squared = x * x + y * y + z * z;
            if best.is_none_or(|(least, ..)| squared < least) {
                best = Some((squared, shift, image));
            }
        }
        Some(best.map_or(([0.0; 3], vector), |(_, shift, image)| (shift, image)))
    }

    fn images(&self, apart: DVec3, counts: [f64; 3]) -> impl Iterator<Item = [f64; 3]> {
        let Self { basis: [_, second, third], steps, rank, .. } = *self;
        let (planes, lines) = (rank > 2, rank > 1);
        image_offsets(planes).flat_map(move |plane| {
            let in_plane = apart + third * *plane;
            let middle = if lines { -steps[1].dot(in_plane).round() } else { 0.0 };
            image_offsets(lines).map(move |line| {
                let along_second = middle + line;
                let on_line = in_plane + second * along_second;
                let along_first = -steps[0].dot(on_line).round();
                [counts[0] + along_first, counts[1] + along_second, counts[2] + plane]
            })
        })
    }

    /// Returns the multiples `S` of the cell vectors, and `vector + (S₁e₁ + S₂e₂ + S₃e₃)`.
    fn image(&self, vector: [f64; 3], counts: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let mut shift = [0.0; 3];
        for (count, multiples) in counts.iter().zip(&self.multiples) {
            (0..3).for_each(|k| shift[k] += count * multiples[k]);
        }
        (shift, shifted(vector, shift, &self.vectors))
    }
}

/// Returns `vector + (S₁e₁ + S₂e₂ + S₃e₃)`, component by component from left to right, never fused: part of the exact
/// test.
pub(crate) fn shifted(vector: [f64; 3], shift: [f64; 3], vectors: &[Option<[f64; 3]>; 3]) -> [f64; 3] {
    let mut image = vector;
    for axis in 0..3 {
        let mut sum: Option<f64> = None;
        for (vector, count) in vectors.iter().zip(shift) {
            if let Some(vector) = vector {
                let term = count * vector[axis];
                sum = Some(sum.map_or(term, |sum| sum + term));
            }
        }
        // An unbounded space keeps the sign of zero.
        image[axis] = sum.map_or(vector[axis], |sum| vector[axis] + sum);
    }
    image
}

fn near(orthogonal: &[DVec3], multiples: &[[f64; 3]; 3]) -> (f64, f64) {
    let shortest = orthogonal.iter().map(|vector| vector.length()).fold(f64::INFINITY, f64::min);
    let most = multiples.iter().flatten().map(|count| count.abs()).sum::<f64>();
    if shortest < MIN_NEAR_PART { (0.0, 0.0) } else { ((0.25 * shortest).powi(2), MAX_NEAR_MULTIPLES / most) }
}

fn image_offsets(is_periodic: bool) -> std::slice::Iter<'static, f64> {
    if is_periodic { [-1.0, 0.0, 1.0].iter() } else { [0.0].iter() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::random::random_fractions;

    #[test]
    fn near_vectors_have_the_image_that_a_comparison_gives() {
        let mut fractions = random_fractions(3);
        let mut random = || 2.0 * fractions() - 1.0;
        let mut near = [0; 2];
        for case in 0..20_000 {
            let thin = 10_f64.powi(-(case % 7));
            let tilt = [0.5, 1.0, 30.0, 1000.0][case as usize / 7 % 4];
            let vectors = [
                Some([1.0, 0.0, 0.0]),
                (case % 5 != 0).then(|| [tilt * random(), thin, 0.0]),
                (case % 3 != 0).then(|| [tilt * random(), tilt * random(), 0.7]),
            ];
            let unit = [1.0, 1e-300, 1e150][case as usize / 140 % 3];
            let vectors =
                vectors.map(|vector| vector.map(|vector: [f64; 3]| vector.map(|number| unit * number)));
            let Ok(cell) = TriclinicCell::new(vectors) else { continue };
            let size = [1.0, 0.1, 1e-4, 100.0, 1e5][case as usize / 28 % 5];
            let far = [50.0, 50.0, 1e5, 1e14][case as usize / 420 % 4];
            let offset = [0, 1, 2].map(|_| (far * random()).round());
            let vector = shifted([(); 3].map(|()| unit * size * random()), offset, &cell.vectors);
            let (apart, counts) = cell.wrapped(vector);
            let compared = cell.shortest_image(vector, apart, counts);
            let compared = compared.expect("no multiple overflows");
            assert_eq!(cell.minimum_image(vector), compared, "{vectors:?}, {vector:?}");
            assert_eq!(cell.minimum_image_vector(vector), compared.1, "{vectors:?}, {vector:?}");
            near[usize::from(apart.length_squared() < cell.near_squared)] += 1;
        }
        assert!(near.iter().all(|&count| count > 2000), "{near:?}");
    }

    #[test]
    fn multiples_of_cell_vectors_that_overflow_hide_no_image() {
        let cell_vectors = [[2.325e307, 0.0, 0.0], [0.0, 1.075e307, 0.0], [2.325e307, 5.375e306, 1.5e306]];
        let vector = [2e306, 0.0, -1.2e307];
        let cell = TriclinicCell::new(cell_vectors.map(Some)).expect("a cell");
        let scale = 0.5_f64.powi(100);
        let small = TriclinicCell::new(cell_vectors.map(|vector| Some(vector.map(|number| number * scale))));
        let (shift, image) = small.expect("a cell").minimum_image(vector.map(|number| number * scale));
        assert_eq!(cell.minimum_image(vector), (shift, image.map(|number| number / scale)));
        assert_eq!(shift.map(f64::abs), [8.0, 4.0, 8.0]);
        let space = crate::Space::triclinic(cell_vectors.map(Some)).expect("a cell");
        assert_eq!(space.image(vector, shift), cell.minimum_image(vector).1);
    }
}
