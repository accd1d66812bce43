//! Triclinic cells: the minimum image in a tilted periodic box, and the orthogonal space in which its pairs are
//! searched.

use glam::{DVec3, Vec3};

use super::lattice::Lattice;
use crate::{InputError, Space, Sphere};

/// Thinnest box, as a fraction of its longest cell vector. In a thinner one, `f64` could not distinguish images.
const MIN_THICKNESS: f64 = 1.0 / (1 << 24) as f64;
/// Most steps of the lattice reduction. Valid boxes need some hundreds.
const MAX_REDUCTION_STEPS: usize = 1 << 16;
/// Most steps to wrap a vector. Each step leaves about 2⁻⁵⁰ of its length.
const MAX_WRAP_STEPS: usize = 4;
/// Gain that a swap of the reduction requires, so that rounding cannot make it cycle (Lovász's δ).
const LLL_DELTA: f64 = 0.99;
/// Factor by which sums of multiples of vectors stay below the largest number: above 3·√3·√3, for three components,
/// vectors and the longest vector.
const OVERFLOW_MARGIN: f64 = 16.0;
/// Growth of an orthogonalized sphere, as a fraction of its coordinates: four times the rounding to `f32`, on three
/// axes.
const ROUNDING: f64 = 1.0 / (1 << 21) as f64;
/// Fraction of a sphere's distance from the origin that counts in the length scale of its rounding. [`ROUNDING`] times
/// this fraction, 2⁻⁴¹, exceeds the rounding of coordinates in `f64`.
const FAR: f64 = 1.0 / (1 << 20) as f64;
/// Growth of orthogonalized radii: above the error of a GPU, 5 ulp of the squared cutoff.
const REACH_MARGIN: f64 = 1.0 + 1.0 / (1 << 20) as f64;

/// The cell of a space with a cell vector that is not along an axis. Images are at integer multiples of *basis*
/// vectors, which are reduced (Lenstra, Lenstra and Lovász): nearly as short and orthogonal as the images allow, at any
/// tilt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriclinicCell {
    vectors: [Option<[f64; 3]>; 3],
    rank: usize,
    /// A power of two that scales lengths to the unit of the basis, so that no product overflows.
    unit: f64,
    /// Reduced vectors, followed by unit vectors that are orthogonal to all before.
    basis: [DVec3; 3],
    /// Multiple of each cell vector in each basis vector.
    multiples: [[f64; 3]; 3],
    /// Part of each basis vector that is orthogonal to its predecessors, divided by its squared length.
    steps: [DVec3; 3],
    /// Rows of the inverse of the basis: they give the fractions of a vector.
    inverse: [DVec3; 3],
    /// `true` if orthogonalized coordinates at [`Orthogonalization::SCALE`] suit `f32` spheres. Stored, because every
    /// call reads it.
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
        for (k, edge) in vectors.iter().enumerate() {
            let Some(edge) = edge else { continue };
            basis[rank] = DVec3::from(*edge) * unit;
            multiples[rank][k] = 1.0;
            rank += 1;
        }
        let longest = basis.iter().fold(0.0, |longest, edge| edge.length().max(longest));
        let heights = heights(&inverse(&completed(basis, rank)));
        if !(longest.is_finite() && heights[..rank].iter().all(|&height| height >= MIN_THICKNESS * longest)) {
            return Err(refused());
        }
        reduce(&mut basis[..rank], &mut multiples);
        let basis = completed(basis, rank);
        let orthogonal = [0, 1, 2].map(|k| orthogonal_part(&basis, k));
        let steps = orthogonal.map(|part| part / part.length_squared());
        let inverse = inverse(&basis);
        let mut cell = Self { vectors, rank, unit, basis, multiples, steps, inverse, fits_f32: false };
        cell.fits_f32 = cell.orthogonal_space(Orthogonalization::SCALE).is_normal();
        Ok(cell)
    }

    pub(crate) fn vectors(&self) -> [Option<[f64; 3]>; 3] {
        self.vectors
    }

    /// Returns the map to the orthogonal space at this scale.
    pub fn orthogonal_space(&self, scale: f64) -> Orthogonalization {
        let heights = heights(&self.inverse);
        // The factor is also a power of two, so that nothing is rounded twice.
        let factor = scale / self.unit;
        let lengths = [0, 1, 2].map(|k| match k < self.rank {
            true => f64::from(((heights[k] * factor) as f32).max(f32::MIN_POSITIVE)),
            false => heights[k] * factor,
        });
        let rows = [0, 1, 2].map(|k| self.inverse[k] * lengths[k]);
        let stretch = norm_bound(rows) * self.unit;
        Orthogonalization { rank: self.rank, unit: self.unit, inverse: self.inverse, lengths, stretch }
    }

    /// Returns the same cell in a unit of length that is `1 / scale` times the present one.
    pub(crate) fn scaled(self, scale: f64) -> Self {
        let vectors = self.vectors.map(|edge| edge.map(|edge| edge.map(|number| number * scale)));
        Self { vectors, unit: self.unit / scale, ..self }
    }

    pub(crate) fn fits_f32(&self) -> bool {
        self.fits_f32
    }

    pub(crate) fn lattice(&self) -> Lattice {
        let mut basis = self.basis;
        for (vector, multiples) in basis.iter_mut().zip(&self.multiples).take(self.rank) {
            // Recomputed, without the rounding of the reduction.
            *vector = DVec3::from(shifted([0.0; 3], *multiples, &self.vectors)) * self.unit;
        }
        Lattice::from_parts(self.rank, self.unit, basis, self.multiples)
    }

    /// Returns the length of the longest cell vector.
    pub fn longest(&self) -> f64 {
        let length = |edge: &[f64; 3]| (DVec3::from(*edge) * self.unit).length();
        self.vectors.iter().flatten().map(length).fold(0.0, f64::max) / self.unit
    }

    /// Returns the number of cell vectors.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Returns the largest component of a vector for which the search of its minimum image does not overflow. In cells
    /// longer than 1, only the image itself may; the exact test then scales the vector and the cell.
    pub fn max_component(&self) -> f64 {
        let lowest = heights(&self.inverse)[..self.rank].iter().copied().fold(f64::INFINITY, f64::min);
        // A vector of length `l` takes at most `l` divided by the height of each basis vector, and up to the sum of
        // their multiples of each cell vector, no longer than √3 units.
        let vectors = self.multiples.iter().flatten().map(|count| count.abs()).sum::<f64>();
        f64::MAX / (OVERFLOW_MARGIN * vectors) * lowest / self.unit
    }

    /// Returns the multiples of the cell vectors that, added to a vector, give its minimum image, and that image.
    ///
    /// # Correctness
    /// 1. Let `rₖ` be the length of the part of the `k`-th basis vector that is orthogonal to its predecessors. The
    ///    minimum image is at most `ρ = ½√(r₁² + r₂² + r₃²)` long, since some image has at most `½rₖ` along each part.
    /// 2. In a reduced basis `rₖ² ≥ 0.74 rₖ₋₁²`, hence `ρ < 1.1 r₃`.
    /// 3. The wrapped vector has at most half of each basis vector. Hence only −1, 0 and 1 times the third vector can
    ///    lead from it to the minimum image.
    /// 4. The same holds for the second vector in each of these three planes. Along the first one, rounding finds the
    ///    image.
    pub(crate) fn minimum_image(&self, vector: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let scaled = DVec3::from(vector) * self.unit;
        let mut counts = [0.0; 3];
        let mut apart = scaled;
        // For distant images, the first step leaves more than half of a vector.
        for _ in 0..MAX_WRAP_STEPS {
            let parts =
                [0, 1, 2].map(|k| if k < self.rank { -self.inverse[k].dot(apart).round() } else { 0.0 });
            if parts == [0.0; 3] {
                break;
            }
            (0..3).for_each(|k| counts[k] += parts[k]);
            apart = scaled + combination(&self.basis, counts);
        }
        let mut best: Option<(f64, [f64; 3], [f64; 3])> = None;
        for image in self.images(apart, counts) {
            let (shift, image) = self.image(vector, image);
            let [x, y, z] = image.map(|number| number * self.unit);
            let squared = x * x + y * y + z * z;
            if best.is_none_or(|(least, ..)| squared < least) {
                best = Some((squared, shift, image));
            }
        }
        best.map_or(([0.0; 3], vector), |(_, shift, image)| (shift, image))
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

    /// Returns the image of a vector at these multiples of the basis vectors: the multiples `S` of the cell vectors,
    /// and `vector + (S₁e₁ + S₂e₂ + S₃e₃)`.
    fn image(&self, vector: [f64; 3], counts: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let mut shift = [0.0; 3];
        for (count, multiples) in counts.iter().zip(&self.multiples) {
            (0..3).for_each(|edge| shift[edge] += count * multiples[edge]);
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
        for (edge, count) in vectors.iter().zip(shift) {
            if let Some(edge) = edge {
                let term = count * edge[axis];
                sum = Some(sum.map_or(term, |sum| sum + term));
            }
        }
        // An unbounded space keeps the sign of zero.
        image[axis] = sum.map_or(vector[axis], |sum| vector[axis] + sum);
    }
    image
}

pub(crate) fn combination(basis: &[DVec3; 3], counts: [f64; 3]) -> DVec3 {
    basis[0] * counts[0] + basis[1] * counts[1] + basis[2] * counts[2]
}

pub(crate) fn power_of_two_below(number: f64) -> f64 {
    const FRACTION: u64 = (1 << 52) - 1;
    if number < f64::MIN_POSITIVE {
        return f64::MIN_POSITIVE;
    }
    f64::from_bits(number.to_bits() & !FRACTION)
}

/// The map from a triclinic cell to orthogonalized coordinates, the distances from the planes that pairs of basis
/// vectors span. The space of these coordinates is periodic along the axes, and distances grow at most by the factor
/// `stretch`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orthogonalization {
    rank: usize,
    unit: f64,
    inverse: [DVec3; 3],
    /// Length of each axis, an `f32` number; for an unbounded axis, its scale.
    lengths: [f64; 3],
    /// Upper bound of the factor by which a distance grows.
    stretch: f64,
}

impl Orthogonalization {
    /// Scale of orthogonalized coordinates of `f32` spheres. Distances grow by up to √3, and none may exceed `f32`.
    pub const SCALE: f64 = 0.25;

    /// Returns the space of these coordinates.
    pub fn space(&self) -> Space {
        let length = |k: usize| (k < self.rank).then_some(self.lengths[k] as f32);
        Space::of_lengths([0, 1, 2].map(length))
    }

    /// Returns `true` if the lengths are `f32` numbers of full precision, as `f32` spheres need.
    fn is_normal(&self) -> bool {
        let is_normal = |length: &f64| (*length as f32).is_normal() && *length > f64::from(f32::MIN_POSITIVE);
        self.lengths[..self.rank].iter().all(is_normal)
    }

    /// Orthogonalizes a valid sphere and wraps it to the image nearest to the origin. Spheres whose minimum images
    /// touch also touch in these coordinates, because radii grow by `stretch`, and by more than rounding. This growth
    /// hardly depends on the position, so a moving sphere keeps its radius. Radii are at most `limit`, with which a
    /// sphere must touch all others.
    pub fn sphere(&self, center: [f64; 3], radius: f64, limit: f64) -> Sphere {
        let center = DVec3::from(center) * self.unit;
        let mut orthogonal = Vec3::ZERO;
        // The length scale of all rounding: the box, or more if the sphere is far away.
        let mut scale = 0.0_f64;
        for k in 0..3 {
            let length = self.lengths[k];
            let part = self.inverse[k].dot(center);
            let from_origin = length * self.inverse[k].abs().dot(center.abs());
            if k < self.rank {
                let half = 0.5 * length as f32;
                orthogonal[k] = ((length * (part - part.round())) as f32).clamp(-half, half);
                scale = scale.max(length);
            } else {
                orthogonal[k] = (length * part) as f32;
            }
            scale = scale.max(if k < self.rank { FAR * from_origin } else { from_origin });
        }
        if !(scale.is_finite() && orthogonal.is_finite()) {
            return Sphere { center: Vec3::ZERO, radius: limit as f32 };
        }
        let base = self.lengths[..self.rank].iter().fold(0.0, |longest, &length| length.max(longest));
        let mut rounding = base;
        while rounding < scale {
            rounding *= 16.0;
        }
        let radius = (self.stretch * radius + ROUNDING * rounding) * REACH_MARGIN;
        Sphere { center: orthogonal, radius: (radius.min(limit) as f32).next_up() }
    }
}

fn image_offsets(is_periodic: bool) -> std::slice::Iter<'static, f64> {
    if is_periodic { [-1.0, 0.0, 1.0].iter() } else { [0.0].iter() }
}

fn orthogonal_part(basis: &[DVec3], k: usize) -> DVec3 {
    let mut rest = basis[k];
    for before in 0..k {
        let orthogonal = orthogonal_part(basis, before);
        rest -= orthogonal * (rest.dot(orthogonal) / orthogonal.length_squared());
    }
    rest
}

/// Reduces the basis without changing the images. `multiples` contains the multiple of each cell vector in each basis
/// vector.
fn reduce(basis: &mut [DVec3], multiples: &mut [[f64; 3]; 3]) {
    let mut k = 1;
    for _ in 0..MAX_REDUCTION_STEPS {
        if k >= basis.len() {
            return;
        }
        for before in (0..k).rev() {
            let orthogonal = orthogonal_part(basis, before);
            let count = (basis[k].dot(orthogonal) / orthogonal.length_squared()).round();
            basis[k] -= basis[before] * count;
            let taken = multiples[before];
            (0..3).for_each(|edge| multiples[k][edge] -= count * taken[edge]);
        }
        let before = orthogonal_part(basis, k - 1);
        let along = basis[k].dot(before) / before.length_squared();
        if orthogonal_part(basis, k).length_squared() >= (LLL_DELTA - along * along) * before.length_squared()
        {
            k += 1;
        } else {
            basis.swap(k, k - 1);
            multiples.swap(k, k - 1);
            k = (k - 1).max(1);
        }
    }
}

/// Completes the first `rank` vectors with orthogonal unit vectors.
fn completed(mut basis: [DVec3; 3], rank: usize) -> [DVec3; 3] {
    match rank {
        1 => (basis[1], basis[2]) = basis[0].normalize().any_orthonormal_pair(),
        2 => basis[2] = basis[0].normalize().cross(basis[1].normalize()).normalize(),
        _ => {}
    }
    basis
}

pub(crate) fn inverse([a, b, c]: &[DVec3; 3]) -> [DVec3; 3] {
    let volume = a.dot(b.cross(*c));
    [b.cross(*c) / volume, c.cross(*a) / volume, a.cross(*b) / volume]
}

pub(crate) fn heights(inverse: &[DVec3; 3]) -> [f64; 3] {
    inverse.map(|row| row.length().recip())
}

/// Returns an upper bound of the largest singular value of a matrix with these rows, the factor by which it lengthens a
/// vector. The trace of the `p`-th power of a symmetric `n` × `n` matrix lies between the `p`-th power of its largest
/// eigenvalue and `n` times as much.
fn norm_bound(rows: [DVec3; 3]) -> f64 {
    const DOUBLINGS: i32 = 10;
    let mut products = glam::DMat3::from_cols(rows[0], rows[1], rows[2]);
    products = products.transpose() * products;
    let trace = |matrix: &glam::DMat3| matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
    let mut logarithm = 0.0_f64;
    for doubling in 0..=DOUBLINGS {
        // Divided by its trace, so that no power overflows.
        let size = trace(&products);
        logarithm += size.ln() / f64::from(1 << doubling);
        products *= size.recip();
        products = products * products;
    }
    (0.5 * logarithm).exp() * REACH_MARGIN
}
