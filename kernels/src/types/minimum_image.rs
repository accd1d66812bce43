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
pub(super) const PLAIN: std::ops::RangeInclusive<f64> = 3.2e-145..=3.1e144;
const PLAIN_SQUARES: std::ops::RangeInclusive<f64> = 1.1e-289..=9.6e288;
/// Powers of two that scale other lengths into this range.
pub(super) const DOWN: f64 = f64::from_bits((1023 - 600) << 52);
pub(super) const UP: f64 = f64::from_bits((1023 + 600) << 52);

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

    /// Returns `vector + (S₁e₁ + S₂e₂ + S₃e₃)` for cell vectors `e`. Multiples may overflow if the result does not.
    pub fn image(&self, vector: [f64; 3], shift: [f64; 3]) -> [f64; 3] {
        let vectors = self.cell_vectors();
        let image = shifted(vector, shift, &vectors);
        if image.iter().all(|number| number.is_finite()) {
            return image;
        }
        let vectors = vectors.map(|vector| vector.map(|vector| vector.map(|number| number * DOWN)));
        shifted(vector.map(|number| number * DOWN), shift, &vectors).map(|number| number / DOWN)
    }

    #[inline]
    pub(super) fn nearest(&self, from: [f64; 3], to: [f64; 3]) -> ([f64; 3], [f64; 3]) {
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
pub(super) fn apart(from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| to[axis] - from[axis])
}

#[inline]
pub(super) fn largest(vector: [f64; 3], cutoff: f64) -> f64 {
    let [x, y, z] = vector.map(f64::abs);
    let largest = x.max(y).max(z).max(cutoff);
    if (x + y + z).is_nan() { f64::INFINITY } else { largest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::random::random_fractions;

    #[test]
    fn overflowing_numbers_of_lengths_have_the_minimum_image() {
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
            let cell = cell.map(|vector| vector.map(|vector: [f64; 3]| vector.map(|number| number * scale)));
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
    fn image_vector_is_difference_plus_shifts() {
        let cell_vectors = [Some([4.0, 0.0, 0.0]), Some([11.5, 5.0, 0.0]), Some([0.3, -7.1, 6.0])];
        let space = Space::triclinic(cell_vectors).expect("a box");
        let mut fractions = random_fractions(1);
        let mut random = || 40.0 * fractions() - 20.0;
        for _ in 0..2000 {
            let [from, to] = [(); 2].map(|()| [(); 3].map(|()| random()));
            let ImageVector { shift, vector, .. } = space.minimum_image(from, to);
            let expected = [0, 1, 2].map(|axis| {
                let along = |k: usize| f64::from(shift[k]) * cell_vectors[k].expect("a cell vector")[axis];
                (to[axis] - from[axis]) + (along(0) + along(1) + along(2))
            });
            assert_eq!(vector, expected);
            let squared = |v: [f64; 3]| v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
            for k in 0..125 {
                let steps = [k % 5, k / 5 % 5, k / 25].map(|count| f64::from(count) - 2.0);
                let image = shifted(vector, steps, &cell_vectors);
                assert!(squared(image) >= squared(vector) * (1.0 - 1e-12), "{from:?}, {to:?}, {steps:?}");
            }
        }
    }
}
