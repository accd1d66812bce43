//! Spaces that repeat along edges which are not the axes: how far apart nearest images are, and the space with
//! orthogonal edges in which the pairs of such a space are looked for.

use glam::{DVec3, Vec3};

use crate::{InputError, Space, Sphere};

/// How much thinner than its longest edge a box may be: less, and `f64` would no longer tell its images apart.
const THINNEST: f64 = 1.0 / (1 << 24) as f64;
/// Swaps and steps of the reduction at most. Boxes that are no thinner than allowed take some hundreds.
const TURNS: usize = 1 << 16;
/// What a swap of the reduction has to gain, so that rounding cannot make it go round for ever.
const GAIN: f64 = 0.99;
/// The part of its coordinates by which a straightened sphere grows: four times what rounding them to `f32` takes, on
/// three axes.
const ROUNDING: f64 = 1.0 / (1 << 21) as f64;
/// From how many lengths away on the roundings of `f64` count as well: there they come to as much as those of `f32`.
const FAR: f64 = 1.0 / (1 << 20) as f64;
/// What the reach of straightened spheres has to spare: more than the 5 ulp of its square that a GPU may be wrong by.
const SPARE: f64 = 1.0 + 1.0 / (1 << 20) as f64;

/// The edges of a space that are not all along axes.
///
/// All images of a sphere are at whole numbers of *basis* vectors from it. The basis is reduced (Lenstra, Lenstra and
/// Lovász), so that its vectors are about as short, and as orthogonal, as those images allow, however far the edges
/// lean. *Straight* coordinates are the distances from the planes that two of the vectors span: in them space repeats
/// along the axes, and two spheres are nowhere farther apart than [`stretch`](Self::straighten) times their distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shear {
    edges: [Option<Vec3>; 3],
    /// How many edges there are.
    rank: usize,
    /// As many vectors, and behind them such of length 1 that are orthogonal to all before.
    basis: [DVec3; 3],
    /// What is orthogonal in each vector to those before it, divided by its squared length.
    steps: [DVec3; 3],
    /// The fractions of the basis that a vector has: rows of the inverse.
    inverse: [DVec3; 3],
    /// How long each straight axis is; for one that does not repeat, its scale.
    straight: [f32; 3],
    /// How much longer than in space a straight distance may be.
    stretch: f64,
}

impl Shear {
    /// The scale of straight coordinates, which are up to √3 times as far apart: so that none exceeds what `f32` holds.
    pub const SCALE: f32 = 0.25;

    /// The shear of these edges.
    ///
    /// # Errors
    /// [`InputError::Edges`] for edges that are not finite, or span a box far thinner than it is long.
    pub(crate) fn new(edges: [Option<Vec3>; 3]) -> Result<Self, InputError> {
        let refused = || InputError::Edges { edges: edges.map(|edge| edge.map(|edge| edge.to_array())) };
        let mut basis = [DVec3::ZERO; 3];
        let mut rank = 0;
        for edge in edges.iter().flatten() {
            basis[rank] = edge.as_dvec3();
            rank += 1;
        }
        let longest = basis.iter().fold(0.0, |longest, edge| edge.length().max(longest));
        let heights = heights(&inverse(&completed(basis, rank)));
        if !(longest.is_finite() && heights[..rank].iter().all(|&height| height >= THINNEST * longest)) {
            return Err(refused());
        }
        reduce(&mut basis[..rank]);
        let basis = completed(basis, rank);
        let inverse = inverse(&basis);
        let heights = self::heights(&inverse);
        let straight = heights.map(|height| height as f32 * Self::SCALE);
        if !straight.iter().all(|length| length.is_normal()) {
            return Err(refused());
        }
        let across = [0, 1, 2].map(|k| across(&basis, k));
        let steps = across.map(|across| across / across.length_squared());
        let rows = [0, 1, 2].map(|k| inverse[k] * f64::from(straight[k]));
        Ok(Self { edges, rank, basis, steps, inverse, straight, stretch: stretch(rows) })
    }

    /// The edges as they were given.
    pub(crate) fn edges(&self) -> [Option<Vec3>; 3] {
        self.edges
    }

    /// The space of straight coordinates.
    pub fn straight(&self) -> Space {
        let length = |k: usize| (k < self.rank).then_some(self.straight[k]);
        Space::of_lengths([0, 1, 2].map(length))
    }

    /// The vector less whole numbers of the basis, so that it has at most half of each.
    fn folded(&self, vector: DVec3) -> DVec3 {
        let turn = |(row, along): (&DVec3, &DVec3)| *along * row.dot(vector).round();
        // Summed before they are taken away: a vector next to an image of the origin would lose its last bits between the turns.
        vector - self.inverse.iter().zip(&self.basis[..self.rank]).map(turn).sum::<DVec3>()
    }

    /// The image of a point near the origin, rounded to `f32`.
    pub(crate) fn wrap(&self, point: Vec3) -> Vec3 {
        self.folded(point.as_dvec3()).as_vec3()
    }

    /// The squared distance of the nearest images of two points, in `f64`. The same for both orders of the points, to the
    /// last bit.
    ///
    /// Why nine images are enough: a vector that has at most half of each basis vector is at most
    /// `ρ = ½√(r₁² + r₂² + r₃²)` from one that stands for the nearest image, where `rₖ` is the part of the `k`-th basis
    /// vector that is orthogonal to those before it. In a reduced basis `rₖ² ≥ 0.74 rₖ₋₁²`, hence `ρ < 1.1 r₃`, and only
    /// −1, 0 and 1 times the third vector can lead there from at most half of it. In each of these three planes the
    /// same holds of the second vector, and along the first one the nearest image is found by rounding.
    pub fn distance_squared(&self, a: Vec3, b: Vec3) -> f64 {
        let apart = self.folded(a.as_dvec3() - b.as_dvec3());
        let [first, second, third] = self.basis;
        let (planes, lines) = (self.rank > 2, self.rank > 1);
        let mut nearest = f64::INFINITY;
        for plane in tries(planes) {
            let in_plane = apart + third * plane;
            let middle = if lines { -self.steps[1].dot(in_plane).round() } else { 0.0 };
            for line in tries(lines) {
                let on_line = in_plane + second * (middle + line);
                let image = on_line - first * self.steps[0].dot(on_line).round();
                nearest = image.length_squared().min(nearest);
            }
        }
        nearest
    }

    /// A sphere in straight coordinates, as its image nearest to the origin. Any two spheres whose nearest images touch,
    /// by [`distance_squared`](Self::distance_squared), touch there too: radii grow by the stretch, and by more than
    /// coordinates lose to rounding. By how much hardly depends on where the sphere is, so that one that moves keeps its
    /// radius. A sphere that is not valid gives one that is not.
    pub fn straighten(&self, sphere: Sphere) -> Sphere {
        if !sphere.is_valid() {
            return Sphere { center: Vec3::NAN, radius: sphere.radius };
        }
        let center = sphere.center.as_dvec3();
        let mut straight = Vec3::ZERO;
        // The length scale of all roundings: that of the box, or where the sphere is far away, more.
        let mut scale = 0.0_f64;
        for k in 0..3 {
            let length = f64::from(self.straight[k]);
            let part = self.inverse[k].dot(center);
            let from_origin = length * self.inverse[k].abs().dot(center.abs());
            if k < self.rank {
                let half = 0.5 * self.straight[k];
                straight[k] = ((length * (part - part.round())) as f32).clamp(-half, half);
                scale = scale.max(length);
            } else {
                straight[k] = (length * part) as f32;
            }
            scale = scale.max(if k < self.rank { FAR * from_origin } else { from_origin });
        }
        let base = self.straight[..self.rank].iter().fold(0.0, |longest, &length| length.max(longest));
        let mut rounding = f64::from(base);
        while rounding < scale {
            rounding *= 16.0;
        }
        let radius = (self.stretch * f64::from(sphere.radius) + ROUNDING * rounding) * SPARE;
        Sphere { center: straight, radius: (radius as f32).next_up() }
    }
}

/// What to try of a basis vector.
fn tries(is_there: bool) -> std::slice::Iter<'static, f64> {
    if is_there { [-1.0, 0.0, 1.0].iter() } else { [0.0].iter() }
}

/// The part of a vector that is orthogonal to those before it.
fn across(basis: &[DVec3], k: usize) -> DVec3 {
    let mut rest = basis[k];
    for before in 0..k {
        let orthogonal = across(basis, before);
        rest -= orthogonal * (rest.dot(orthogonal) / orthogonal.length_squared());
    }
    rest
}

/// Replaces vectors by shorter ones that lead to the same images.
fn reduce(basis: &mut [DVec3]) {
    let mut k = 1;
    for _ in 0..TURNS {
        if k >= basis.len() {
            return;
        }
        for before in (0..k).rev() {
            let orthogonal = across(basis, before);
            basis[k] -= basis[before] * (basis[k].dot(orthogonal) / orthogonal.length_squared()).round();
        }
        let before = across(basis, k - 1);
        let along = basis[k].dot(before) / before.length_squared();
        if across(basis, k).length_squared() >= (GAIN - along * along) * before.length_squared() {
            k += 1;
        } else {
            basis.swap(k, k - 1);
            k = (k - 1).max(1);
        }
    }
}

/// The same with vectors of length 1, orthogonal to the first `rank` and to each other, in place of those behind.
fn completed(mut basis: [DVec3; 3], rank: usize) -> [DVec3; 3] {
    match rank {
        1 => (basis[1], basis[2]) = basis[0].normalize().any_orthonormal_pair(),
        2 => basis[2] = basis[0].normalize().cross(basis[1].normalize()).normalize(),
        _ => {}
    }
    basis
}

/// The rows of the inverse of the matrix that has these columns.
fn inverse([a, b, c]: &[DVec3; 3]) -> [DVec3; 3] {
    let volume = a.dot(b.cross(*c));
    [b.cross(*c) / volume, c.cross(*a) / volume, a.cross(*b) / volume]
}

/// How far apart the planes are that two of the vectors span and their images.
fn heights(inverse: &[DVec3; 3]) -> [f64; 3] {
    inverse.map(|row| row.length().recip())
}

/// No vector becomes longer by more than this factor when it is multiplied with a matrix of these rows: the largest
/// singular value, rounded up. With `n` of them, the `p`-th power of a symmetric matrix has a trace between the `p`-th
/// power of its largest eigenvalue and `n` times as much.
fn stretch(rows: [DVec3; 3]) -> f64 {
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
    (0.5 * logarithm).exp() * SPARE
}
