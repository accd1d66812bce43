use super::triclinic::shifted;
use crate::Space;

/// The vector from a point to the minimum image of another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ImageVector {
    /// Multiples `S` of the cell vectors.
    pub shift: [i32; 3],
    /// `(to − from) + (S₁e₁ + S₂e₂ + S₃e₃)`, in the length unit of the spheres.
    pub vector: [f64; 3],
}

impl ImageVector {
    /// Returns the length of the vector, without overflow or underflow.
    #[inline]
    pub fn length(&self) -> f64 {
        let root = |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt();
        let [x, y, z] = self.vector;
        if PLAIN_SQUARES.contains(&(x * x + y * y + z * z)) {
            return root(self.vector);
        }
        match largest(self.vector, 0.0) {
            0.0 => 0.0,
            size if size < *PLAIN.start() => root(self.vector.map(|number| number * UP)) / UP,
            size if size > *PLAIN.end() => root(self.vector.map(|number| number * DOWN)) / DOWN,
            _ => root(self.vector),
        }
    }
}

/// Lengths whose squares and their rounding errors are normal numbers.
const PLAIN: std::ops::RangeInclusive<f64> = 3.2e-145..=3.1e144;
const PLAIN_SQUARES: std::ops::RangeInclusive<f64> = 1.1e-289..=9.6e288;
/// Powers of two that scale other lengths into this range.
const DOWN: f64 = f64::from_bits((1023 - 600) << 52);
const UP: f64 = f64::from_bits((1023 + 600) << 52);

impl Space {
    /// Returns the vector from a point to the minimum image of another, by the expression of the exact contact test.
    /// Shifts are limited to `i32`, which does not affect the vector. The vector is not finite if a difference or a
    /// multiple of a cell vector overflows.
    ///
    /// ```
    /// # use lazygrid_kernels::Space;
    /// let space = Space::periodic([Some(10.0), None, None])?;
    /// let image = space.minimum_image([0.5, 0.0, 0.0], [9.5, 1.0, 0.0]);
    /// assert_eq!((image.shift, image.vector), ([-1, 0, 0], [-1.0, 1.0, 0.0]));
    /// # Ok::<(), lazygrid_kernels::InputError>(())
    /// ```
    #[inline]
    pub fn minimum_image(&self, from: [f64; 3], to: [f64; 3]) -> ImageVector {
        let (shift, vector) = self.nearest(from, to);
        ImageVector { shift: shift.map(|count| count as i32), vector }
    }

    /// Exact contact test: returns `true` if minimum images of `a` and `b` (`x, y, z, r`) touch, or are within
    /// `distance` if given. Nothing overflows or underflows.
    #[inline]
    pub fn touch(&self, a: [f64; 4], b: [f64; 4], distance: Option<f64>) -> bool {
        self.decide(a, b, distance, |space, from, to| match space.triclinic_cell() {
            Some(cell) => cell.minimum_image_vector(apart(from, to)),
            None => space.nearest(from, to).1,
        })
    }

    /// Tests `a` and the image of `b` at `shift` cell vectors like [`touch`](Self::touch).
    pub fn touch_image(&self, a: [f64; 4], b: [f64; 4], shift: [f64; 3], distance: Option<f64>) -> bool {
        self.decide(a, b, distance, |space, from, to| space.image(apart(from, to), shift))
    }

    /// Returns `vector + (S₁e₁ + S₂e₂ + S₃e₃)` for cell vectors `e`. Multiples may overflow if the result does not.
    pub fn image(&self, vector: [f64; 3], shift: [f64; 3]) -> [f64; 3] {
        let vectors = self.cell_vectors();
        let image = shifted(vector, shift, &vectors);
        if image.iter().all(|number| number.is_finite()) {
            return image;
        }
        let vectors = vectors.map(|edge| edge.map(|edge| edge.map(|number| number * DOWN)));
        shifted(vector.map(|number| number * DOWN), shift, &vectors).map(|number| number / DOWN)
    }

    #[inline]
    fn decide(
        &self,
        a: [f64; 4],
        b: [f64; 4],
        distance: Option<f64>,
        displacement: impl Fn(&Self, [f64; 3], [f64; 3]) -> [f64; 3],
    ) -> bool {
        let (vector, reach) = (displacement(self, center(a), center(b)), distance.unwrap_or(a[3] + b[3]));
        let largest = largest(vector, reach);
        if PLAIN.contains(&largest) {
            is_within(vector, reach)
        } else if largest < *PLAIN.start() {
            // Differences are multiples of the smallest number, so none has underflowed.
            is_within(vector.map(|number| number * UP), reach * UP)
        } else {
            let [a, b] = [a, b].map(|numbers| numbers.map(|number| number * DOWN));
            let reach = distance.map_or(a[3] + b[3], |distance| distance * DOWN);
            // The space is scaled only if a difference overflowed, because short cell vectors become 0.
            let vector = match vector.iter().all(|number| number.is_finite()) {
                true => vector.map(|number| number * DOWN),
                false => displacement(&self.scaled(DOWN), center(a), center(b)),
            };
            is_within(vector, reach)
        }
    }

    #[inline]
    fn nearest(&self, from: [f64; 3], to: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let apart = apart(from, to);
        if let Some(cell) = self.triclinic_cell() {
            return cell.minimum_image(apart);
        }
        let (mut shift, mut vector) = ([0.0; 3], apart);
        for (axis, length) in self.lengths().into_iter().enumerate() {
            if let Some(length) = length {
                (shift[axis], vector[axis]) = nearest_along(apart[axis], length);
            }
        }
        (shift, vector)
    }
}

#[inline]
fn nearest_along(apart: f64, length: f64) -> (f64, f64) {
    if apart.abs() < 0.49 * length {
        return (0.0, apart);
    }
    let lengths = -(apart / length).round();
    if lengths.is_infinite() {
        return far_along(apart, length);
    }
    let other = lengths + if apart + lengths * length < 0.0 { 1.0 } else { -1.0 };
    let (image, neighbor) = (apart + lengths * length, apart + other * length);
    if neighbor.abs() < image.abs() { (other, neighbor) } else { (lengths, image) }
}

/// Returns infinitely many lengths, and the image. Numbers of this size are integers, to which adding 1 has no effect.
#[cold]
fn far_along(apart: f64, length: f64) -> (f64, f64) {
    let (apart, sign) = (apart * DOWN, apart.signum());
    let lengths = -(apart / length);
    (-sign * f64::INFINITY, (apart + lengths * length) / DOWN)
}

#[inline]
fn apart(from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| to[axis] - from[axis])
}

#[inline]
fn center([x, y, z, _]: [f64; 4]) -> [f64; 3] {
    [x, y, z]
}

#[inline]
fn largest(vector: [f64; 3], reach: f64) -> f64 {
    let [x, y, z] = vector.map(f64::abs);
    let largest = x.max(y).max(z).max(reach);
    if (x + y + z).is_nan() { f64::INFINITY } else { largest }
}

#[inline]
fn is_within([x, y, z]: [f64; 3], reach: f64) -> bool {
    x * x + y * y + z * z <= reach * reach
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::random::random_fractions;

    #[test]
    fn contact_is_exact_at_any_magnitude() {
        for exponent in [-1060, -900, -500, -300, 0, 300, 480, 1010] {
            let unit = 2.0_f64.powi(exponent / 2) * 2.0_f64.powi(exponent - exponent / 2);
            let a = [0.0, 0.0, 0.0, 2.0 * unit];
            let touching = [3.0 * unit, 4.0 * unit, 0.0, 3.0 * unit];
            let [x, y, z, r] = touching;
            assert!(Space::UNBOUNDED.touch(a, touching, None), "2^{exponent}");
            assert!(!Space::UNBOUNDED.touch(a, [x, y.next_up(), z, r], None), "2^{exponent}");
            assert!(!Space::UNBOUNDED.touch(a, [x, y, z, r.next_down().next_down()], None), "2^{exponent}");
            assert!(Space::UNBOUNDED.touch(a, touching, Some(5.0 * unit)), "2^{exponent}");
        }
        let [left, right] = [[-f64::MAX, 0.0, 0.0, 1.0], [f64::MAX, 0.0, 0.0, 1.0]];
        assert!(!Space::UNBOUNDED.touch(left, right, None));
        assert!(Space::UNBOUNDED.touch(left, right, Some(f64::MAX)) == (2.0 * f64::MAX <= f64::MAX));
        let [left, right] = [left, right].map(|[x, y, z, _]| [x, y, z, f64::MAX]);
        assert!(Space::UNBOUNDED.touch(left, right, None));
        for far in [[0.0; 4], [1e300, -1e300, 1e200, 0.0], [1e-300, 0.0, 0.0, 0.0]] {
            assert!(Space::UNBOUNDED.touch(far, far, None), "{far:?}");
        }
    }

    #[test]
    fn numbers_of_lengths_that_overflow_reach_the_minimum_image() {
        for (x, length) in
            [(1.7e308, 0.5), (-1.7e308, 0.5), (2.0_f64.powi(1000), 2.0_f64.powi(-200)), (1.0, 5e-324)]
        {
            let space = Space::periodic([Some(length), None, None]).expect("a length");
            let [a, b] = [[x, 0.0, 0.0, 1e-3], [0.0; 4]];
            assert!(space.touch(a, b, None) && space.touch(b, a, None), "{x:e} in {length:e}");
            assert!(!space.touch(a, [0.0, 1.0, 0.0, 0.1], None), "{x:e} in {length:e}");
            let image = space.minimum_image([0.0; 3], [x, 0.0, 0.0]);
            let shift = if x < 0.0 { i32::MAX } else { i32::MIN };
            assert_eq!((image.vector, image.shift), ([0.0; 3], [shift, 0, 0]), "{x:e} in {length:e}");
        }
    }

    #[test]
    fn large_spheres_touch_in_small_boxes() {
        let edges = [Some([1e-130, 0.0, 0.0]), Some([3e-131, 1e-130, 0.0]), Some([0.0, 0.0, 1e-130])];
        let small = [Space::triclinic(edges), Space::periodic([Some(1e-160); 3])];
        for space in small.map(|space| space.expect("a box")) {
            let [giant, other] = [[0.0, 0.0, 0.0, 1e150], [3e-131, 2e-131, 0.0, 1e150]];
            assert!(space.touch(giant, giant, None) && space.touch(giant, other, None), "{space:?}");
            assert!(space.touch(giant, other, Some(1e200)), "{space:?}");
        }
    }

    #[test]
    fn vectors_up_to_the_largest_component_have_images() {
        let cells = [
            [Some([1.0, 0.0, 0.0]), Some([0.4, 1.0, 0.0]), Some([-0.3, 0.2, 1.0])],
            [Some([1.0, 0.0, 0.0]), Some([40.3, 1.0, 0.0]), Some([-9.7, 30.1, 1.0])],
            [Some([1.0, 0.0, 0.0]), Some([4000.3, 1.0, 0.0]), None],
            [None, Some([0.4, 1.0, 0.0]), None],
        ];
        for (cell, scale) in
            cells.into_iter().flat_map(|cell| [1.0, 1e-300, 1e100].map(|scale| (cell, scale)))
        {
            let cell = cell.map(|edge| edge.map(|edge: [f64; 3]| edge.map(|number| number * scale)));
            let space = Space::triclinic(cell).expect("a cell");
            let most = space.triclinic_cell().expect("triclinic").max_component();
            let most = (most * DOWN).min(2.0 * (f64::MAX * DOWN));
            for to in [[most; 3], [most, -most, most], [0.0, most, 0.0], [-most, 0.0, 0.3 * most]] {
                let images = [(space, to.map(|number| number / DOWN)), (space.scaled(DOWN), to)]
                    .map(|(space, to)| space.minimum_image([0.0; 3], to).vector);
                let is_finite = |vector: &[f64; 3]| vector.iter().all(|number| number.is_finite());
                assert!(images.iter().any(is_finite), "{cell:?}, {to:?}: {images:?}");
            }
        }
    }

    #[test]
    fn shifts_and_edges_make_the_vector() {
        let edges = [Some([4.0, 0.0, 0.0]), Some([11.5, 5.0, 0.0]), Some([0.3, -7.1, 6.0])];
        let space = Space::triclinic(edges).expect("a box");
        let mut fractions = random_fractions(1);
        let mut random = || 40.0 * fractions() - 20.0;
        for _ in 0..2000 {
            let [from, to] = [(); 2].map(|()| [(); 3].map(|()| random()));
            let ImageVector { shift, vector, .. } = space.minimum_image(from, to);
            let expected = [0, 1, 2].map(|axis| {
                let along = |k: usize| f64::from(shift[k]) * edges[k].expect("an edge")[axis];
                (to[axis] - from[axis]) + (along(0) + along(1) + along(2))
            });
            assert_eq!(vector, expected);
            let squared = |v: [f64; 3]| v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
            for k in 0..125 {
                let steps = [k % 5, k / 5 % 5, k / 25].map(|count| f64::from(count) - 2.0);
                let image = shifted(vector, steps, &edges);
                assert!(squared(image) >= squared(vector) * (1.0 - 1e-12), "{from:?}, {to:?}, {steps:?}");
            }
        }
    }
}
