use super::minimum_image::{DOWN, PLAIN, UP, apart, largest};
use crate::Space;

impl Space {
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

    #[inline]
    fn decide(
        &self,
        a: [f64; 4],
        b: [f64; 4],
        distance: Option<f64>,
        displacement: impl Fn(&Self, [f64; 3], [f64; 3]) -> [f64; 3],
    ) -> bool {
        let (vector, cutoff) = (displacement(self, center(a), center(b)), distance.unwrap_or(a[3] + b[3]));
        let largest = largest(vector, cutoff);
        if PLAIN.contains(&largest) {
            is_within(vector, cutoff)
        } else if largest < *PLAIN.start() {
            // Differences are multiples of the smallest number, so none has underflowed.
            is_within(vector.map(|number| number * UP), cutoff * UP)
        } else {
            let [a, b] = [a, b].map(|numbers| numbers.map(|number| number * DOWN));
            let cutoff = distance.map_or(a[3] + b[3], |distance| distance * DOWN);
            // The space is scaled only if a difference overflowed, because short cell vectors become 0.
            let vector = match vector.iter().all(|number| number.is_finite()) {
                true => vector.map(|number| number * DOWN),
                false => displacement(&self.scaled(DOWN), center(a), center(b)),
            };
            is_within(vector, cutoff)
        }
    }
}

#[inline]
fn center([x, y, z, _]: [f64; 4]) -> [f64; 3] {
    [x, y, z]
}

#[inline]
fn is_within([x, y, z]: [f64; 3], cutoff: f64) -> bool {
    x * x + y * y + z * z <= cutoff * cutoff
}

#[cfg(test)]
mod tests {
    use crate::Space;

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
    fn large_spheres_touch_in_small_boxes() {
        let cell_vectors = [Some([1e-130, 0.0, 0.0]), Some([3e-131, 1e-130, 0.0]), Some([0.0, 0.0, 1e-130])];
        let small = [Space::triclinic(cell_vectors), Space::periodic([Some(1e-160); 3])];
        for space in small.map(|space| space.expect("a box")) {
            let [giant, other] = [[0.0, 0.0, 0.0, 1e150], [3e-131, 2e-131, 0.0, 1e150]];
            assert!(space.touch(giant, giant, None) && space.touch(giant, other, None), "{space:?}");
            assert!(space.touch(giant, other, Some(1e200)), "{space:?}");
        }
    }
}
