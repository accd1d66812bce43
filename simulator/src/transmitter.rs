//! Where particles come from: bursts at given times.

use crate::normal;
use crate::philox::open_unit;

/// Releases particles at given times.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmitter {
    /// Its name in messages.
    pub name: String,
    /// Its centre, in µm.
    pub center: [f32; 3],
    /// Where around the centre particles appear.
    pub shape: Shape,
    /// When, in s. A burst appears before the first step that begins then or later, and takes part in it.
    pub times: Vec<f64>,
    /// How many of each species at each time.
    pub release: Vec<(u32, u32)>,
}

/// Where around a centre particles appear.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Shape {
    /// All at one point.
    #[default]
    Point,
    /// Normal along each axis, with this standard deviation in µm.
    Gaussian(f32),
    /// Uniform in a shell between two radii in µm; a ball where the inner one is 0.
    Shell(f32, f32),
    /// Uniform in a box of these edges in µm.
    Box([f32; 3]),
    /// On a cubic lattice with this many places along each axis that fills a box of these edges in µm. Places are
    /// taken in order, x fastest.
    Lattice([f32; 3], [u32; 3]),
}

impl Transmitter {
    /// Whether there is a burst at the beginning of `step`.
    pub fn fires(&self, step: u32, time_step: f64) -> bool {
        self.times.iter().any(|&time| step_of(time, time_step) == Some(step))
    }

    /// How many bursts there are from step `begin` on and before step `end`.
    pub fn fires_between(&self, begin: u32, end: u32, time_step: f64) -> usize {
        let within = |&time: &f64| step_of(time, time_step).is_some_and(|step| (begin..end).contains(&step));
        self.times.iter().copied().filter(|t| within(t)).count()
    }

    /// The first of the times that do not come within so many steps, and how many they are.
    pub fn after(&self, steps: u32, time_step: f64) -> Option<(f64, usize)> {
        let late =
            || self.times.iter().copied().filter(|&t| step_of(t, time_step).is_none_or(|step| step >= steps));
        Some((late().min_by(f64::total_cmp)?, late().count()))
    }

    /// How many particles one burst has.
    pub fn burst(&self) -> u64 {
        self.release.iter().map(|&(_, count)| u64::from(count)).sum()
    }
}

/// The first step that begins at `time` or later; none where there are not that many steps.
fn step_of(time: f64, time_step: f64) -> Option<u32> {
    // A time that is a multiple of Δt but for rounding belongs to that multiple.
    let steps = (time / time_step - 1e-6).ceil().max(0.0);
    (steps < f64::from(u32::MAX)).then_some(steps as u32)
}

impl Shape {
    /// Where the particle with these words, the `place`th of its burst, appears.
    pub(crate) fn offset(self, words: [u32; 4], place: u32) -> [f32; 3] {
        match self {
            Self::Point => [0.0; 3],
            Self::Gaussian(width) => normal::normals(words).map(|z| z * width),
            Self::Shell(inner, outer) => {
                let [a, b] = [inner, outer].map(|r| f64::from(r).powi(3));
                let radius = libm::cbrt(a + (b - a) * f64::from(open_unit(words[0]))) as f32;
                direction(words[1], words[2]).map(|c| c * radius)
            }
            Self::Box(edges) => std::array::from_fn(|k| (open_unit(words[k]) - 0.5) * edges[k]),
            Self::Lattice(edges, [nx, ny, nz]) => {
                let at = [place % nx, place / nx % ny, place / nx / ny % nz];
                let count = [nx, ny, nz];
                std::array::from_fn(|k| ((at[k] as f32 + 0.5) / count[k] as f32 - 0.5) * edges[k])
            }
        }
    }
}

/// A uniformly distributed direction, as a vector of length 1.
#[inline]
pub fn direction(first: u32, second: u32) -> [f32; 3] {
    let z = 2.0 * open_unit(first) - 1.0;
    let across = (1.0 - z * z).max(0.0).sqrt();
    let [cosine, sine] = normal::turn(second);
    [across * cosine, across * sine, z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::philox::{Key, Purpose};

    #[test]
    fn a_burst_belongs_to_the_step_that_begins_at_its_time() {
        assert_eq!(step_of(0.0, 0.1), Some(0));
        assert_eq!(step_of(0.3, 0.1), Some(3));
        assert_eq!(step_of(0.30001, 0.1), Some(4));
        assert_eq!(step_of(1e30, 0.1), None);
    }

    #[test]
    fn shapes_keep_their_bounds_and_means() {
        let key = Key::new(5);
        let shapes = [Shape::Gaussian(2.0), Shape::Shell(1.0, 2.0), Shape::Box([1.0, 2.0, 3.0])];
        for shape in shapes {
            let n = 20_000;
            let mut mean = [0.0; 3];
            for id in 0..n {
                let p = shape.offset(key.draw(id, 0, 0, Purpose::Release), id).map(f64::from);
                (0..3).for_each(|k| mean[k] += p[k] / f64::from(n));
                let r = p.iter().map(|c| c * c).sum::<f64>().sqrt();
                match shape {
                    Shape::Shell(a, b) => assert!(r >= f64::from(a) - 1e-6 && r <= f64::from(b) + 1e-6),
                    Shape::Box(e) => (0..3).for_each(|k| assert!(p[k].abs() <= f64::from(e[k]) / 2.0)),
                    _ => {}
                }
            }
            assert!(mean.iter().all(|m| m.abs() < 5.0 * 2.0 / f64::from(n).sqrt()), "{shape:?} {mean:?}");
        }
    }

    #[test]
    fn a_lattice_fills_its_box() {
        let shape = Shape::Lattice([4.0, 2.0, 2.0], [4, 2, 2]);
        assert_eq!(shape.offset([0; 4], 0), [-1.5, -0.5, -0.5]);
        assert_eq!(shape.offset([0; 4], 5), [-0.5, 0.5, -0.5]);
        assert_eq!(shape.offset([0; 4], 15), [1.5, 0.5, 0.5]);
    }
}
