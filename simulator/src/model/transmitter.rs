use crate::model::Model;
use crate::model::boundary::Boundary;
use crate::model::message::Message;
use crate::model::time::step_of;
use crate::random::gaussian;
use crate::random::philox::{Key, open_unit};

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transmitter {
    pub name: String,
    pub center: [f32; 3],
    /// Index of a moving receiver whose center the transmitter follows.
    pub carrier: Option<u32>,
    pub shape: Shape,
    pub schedule: Schedule,
    /// Species and number per burst.
    pub release: Vec<(u32, u32)>,
    pub numbers: CountDistribution,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Schedule {
    /// A burst at each of these ascending times, in s, in the first step that begins then or later.
    Times(Vec<f64>),
    /// A burst for each symbol.
    Message(Message),
    Steady {
        /// In s.
        from: f64,
        /// In s.
        until: f64,
        /// In 1/s, by species.
        rates: Vec<(u32, f64)>,
    },
}

impl Default for Schedule {
    fn default() -> Self {
        Self::Times(vec![0.0])
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CountDistribution {
    /// The exact number. Steady release is evenly spaced.
    #[default]
    Fixed,
    /// A Poisson number with this mean. Steady release is a Poisson process.
    Poisson,
}

/// Distribution of released particles around the center. Lengths are in µm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Shape {
    #[default]
    Point,
    /// Normal, with this standard deviation along each axis.
    Gaussian(f32),
    /// Uniform in a shell between two radii; a ball if the inner is 0.
    Shell(f32, f32),
    /// Uniform in a box with these sides.
    Box([f32; 3]),
    /// Uniform in a cylinder: axis, radius, length; a disk if the length is 0.
    Cylinder(usize, f32, f32),
    /// Lattice in a box: sides, and sites per axis, filled x fastest. Bursts begin at the first site. Steady release
    /// continues from site to site, or takes random sites if it is a Poisson process.
    Lattice([f32; 3], [u32; 3]),
}

impl Model {
    pub(crate) fn release_beyond_range(&self) -> Option<String> {
        self.transmitters.iter().find_map(Transmitter::point_beyond_range)
    }
}

impl Transmitter {
    /// Returns the species and numbers of each burst at the beginning of `step`. `index`, of the transmitter, selects
    /// random symbols.
    pub fn bursts(&self, index: u32, step: u32, time_step: f64, key: Key) -> Vec<Vec<(u32, u32)>> {
        match &self.schedule {
            Schedule::Times(times) => {
                let [end, begin] =
                    [step.saturating_add(1), step].map(|step| count_before(times, step, time_step));
                vec![self.release.clone(); end - begin]
            }
            Schedule::Message(message) => {
                let symbols = message.due(step, time_step).map(|k| message.symbol(k, index, key));
                symbols.map(|symbol| message.modulation.burst(symbol, &self.release)).collect()
            }
            Schedule::Steady { .. } => Vec::new(),
        }
    }

    /// Counts the entries of all bursts but the first, in the step with the most bursts.
    pub(crate) fn repeated_entries(&self, time_step: f64) -> u64 {
        let Schedule::Times(times) = &self.schedule else { return 0 };
        let steps = times.chunk_by(|&a, &b| step_of(a, time_step) == step_of(b, time_step));
        let released = steps.filter(|times| step_of(times[0], time_step).is_some());
        let max_repeats = released.map(<[f64]>::len).max().unwrap_or(0);
        (max_repeats.saturating_sub(1) as u64).saturating_mul(self.release.len() as u64)
    }

    pub fn species(&self) -> impl Iterator<Item = u32> {
        let steady = match &self.schedule {
            Schedule::Steady { rates, .. } => rates.as_slice(),
            _ => &[],
        };
        self.release.iter().map(|&(species, _)| species).chain(steady.iter().map(|&(species, _)| species))
    }

    pub fn mean_between(&self, [begin, end]: [u32; 2], time_step: f64) -> Vec<(u32, f64)> {
        let scaled = |by: f64| self.release.iter().map(move |&(species, n)| (species, by * f64::from(n)));
        match &self.schedule {
            Schedule::Times(times) => {
                let count = |step| count_before(times, step, time_step);
                scaled((count(end) - count(begin)) as f64).collect()
            }
            Schedule::Message(message) => {
                let count = |step| message.sent_before(step, time_step);
                scaled(f64::from(count(end) - count(begin)) * message.modulation.mean(self.release.len()))
                    .collect()
            }
            Schedule::Steady { from, until, rates } => {
                let [begin, end] = [begin, end].map(|step| (f64::from(step) - 1.0) * time_step);
                let time = (end.min(*until) - begin.max(*from)).max(0.0);
                rates.iter().map(|&(species, rate)| (species, rate * time)).collect()
            }
        }
    }

    /// Returns an error text if points may exceed the range of `f32`.
    pub(crate) fn point_beyond_range(&self) -> Option<String> {
        let half_extent = self.shape.half_extent();
        let farthest = |k: usize| f64::from(self.center[k].abs()) + half_extent[k];
        let farthest = [0, 1, 2].map(farthest).into_iter().fold(0.0, f64::max);
        (farthest > f64::from(f32::MAX)).then(|| {
            format!(
                "{} may release particles at coordinates up to {farthest:.1e} µm, more than the limit of {:.1e} µm of single \
                 precision; move its center towards the origin, or make its shape smaller",
                self.name,
                f32::MAX
            )
        })
    }

    /// Returns the first missed release time, in s, and the number of missed bursts; `None` for steady release.
    pub fn after(&self, steps: u32, time_step: f64) -> Option<(f64, Option<usize>)> {
        let is_late = |time: f64| step_of(time, time_step).is_none_or(|step| step >= steps);
        match &self.schedule {
            Schedule::Times(times) => {
                let first = times.partition_point(|&time| !is_late(time));
                Some((*times.get(first)?, Some(times.len() - first)))
            }
            Schedule::Message(message) => {
                let first = message.sent_before(steps, time_step);
                let left = message.symbols.len() - first;
                (left > 0).then(|| (message.time_of(first), Some(left as usize)))
            }
            Schedule::Steady { from, .. } => is_late(*from).then_some((*from, None)),
        }
    }
}

fn count_before(times: &[f64], step: u32, time_step: f64) -> usize {
    times.partition_point(|&time| step_of(time, time_step).is_some_and(|burst_step| burst_step < step))
}

/// Bound of a normal number, which is at most 5.77.
const LARGEST_NORMAL: f64 = 6.0;

impl Shape {
    /// Bounds the distance of released particles from the center along each axis, in µm.
    pub(crate) fn half_extent(self) -> [f64; 3] {
        match self {
            Self::Point => [0.0; 3],
            Self::Gaussian(width) => [LARGEST_NORMAL * f64::from(width); 3],
            Self::Shell(_, outer) => [outer.into(); 3],
            Self::Box(sides) | Self::Lattice(sides, _) => sides.map(|side| 0.5 * f64::from(side)),
            Self::Cylinder(along, radius, length) => {
                let half = 0.5 * f64::from(length);
                std::array::from_fn(|k| if k == along { half } else { radius.into() })
            }
        }
    }

    pub(crate) fn random_site(self, word: u32) -> u32 {
        let Self::Lattice(_, sites) = self else { return 0 };
        let count: u128 = sites.map(u128::from).into_iter().product();
        ((u128::from(word) * count) >> 32).min(u32::MAX.into()) as u32
    }

    /// Returns an offset, in µm, drawn by `words`; for a lattice, that of `site`.
    pub(crate) fn offset(self, words: [u32; 4], site: u32, boundary: &Boundary) -> [f32; 3] {
        match self {
            Self::Point => [0.0; 3],
            Self::Gaussian(width) => gaussian::normals(words).map(|z| z * width),
            Self::Shell(inner, outer) => {
                let dimensions = boundary.dimensions();
                let [a, b] = [inner, outer].map(|r| f64::from(r).powi(dimensions as i32));
                let power = a + (b - a) * f64::from(open_unit(words[0]));
                let radius = match dimensions {
                    3 => libm::cbrt(power),
                    2 => power.sqrt(),
                    _ => power,
                };
                let direction = gaussian::direction(words[1], words[2]);
                boundary.direction_within(direction).map(|c| c * radius as f32)
            }
            Self::Box(sides) => std::array::from_fn(|k| (open_unit(words[k]) - 0.5) * sides[k]),
            Self::Cylinder(along, radius, length) => {
                let distance = radius * open_unit(words[0]).sqrt();
                let [cosine, sine] = gaussian::cos_sin(words[1]);
                let mut offset = [0.0; 3];
                offset[along % 3] = (open_unit(words[2]) - 0.5) * length;
                offset[(along + 1) % 3] = distance * cosine;
                offset[(along + 2) % 3] = distance * sine;
                offset
            }
            Self::Lattice(sides, [nx, ny, nz]) => {
                let at = [site % nx, site / nx % ny, site / nx / ny % nz];
                let count = [nx, ny, nz];
                std::array::from_fn(|k| ((at[k] as f32 + 0.5) / count[k] as f32 - 0.5) * sides[k])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Species;
    use crate::random::philox::Purpose;

    #[test]
    fn a_burst_belongs_to_the_step_that_begins_at_its_time() {
        assert_eq!(step_of(0.0, 0.1), Some(0));
        assert_eq!(step_of(0.3, 0.1), Some(3));
        assert_eq!(step_of(0.30001, 0.1), Some(4));
        assert_eq!(step_of(1e30, 0.1), None);
        let times = Schedule::Times(vec![0.0, 0.25, 0.3, 0.30001, 1e30]);
        let transmitter = Transmitter { schedule: times, release: vec![(2, 5)], ..Transmitter::default() };
        let bursts = |step| transmitter.bursts(0, step, 0.1, Key::new(1)).len();
        assert_eq!([0, 1, 2, 3, 4, 5].map(bursts), [1, 0, 0, 2, 1, 0]);
        assert_eq!(transmitter.mean_between([1, 5], 0.1), [(2, 15.0)]);
        assert_eq!(transmitter.after(4, 0.1), Some((0.30001, Some(2))));
    }

    #[test]
    fn repeated_bursts_of_a_step_are_limited() {
        let transmitter = |bursts: usize, entries| Transmitter {
            schedule: Schedule::Times([vec![0.0], vec![0.1; bursts], vec![1e30; 9 * bursts]].concat()),
            release: vec![(0, 0); entries],
            ..Transmitter::default()
        };
        let check = |transmitters| {
            let species = vec![Species::default()];
            Model { time_step: 0.1, species, transmitters, ..Model::default() }.check()
        };
        assert_eq!(transmitter(1, 1 << 20).repeated_entries(0.1), 0);
        assert!(check(vec![transmitter(1, 1 << 21), transmitter(1025, 1024)]).is_ok());
        for refused in [vec![transmitter(1026, 1024)], vec![transmitter(600, 1024); 2]] {
            let error = check(refused).unwrap_err().to_string();
            assert!(error.contains("and may have 1048576; give fewer times"), "{error}");
        }
    }

    #[test]
    fn a_steady_release_has_its_time() {
        let schedule = Schedule::Steady { from: 0.25, until: 0.6, rates: vec![(1, 100.0)] };
        let transmitter = Transmitter { schedule, ..Transmitter::default() };
        let mean = |begin, end| transmitter.mean_between([begin, end], 0.1)[0].1;
        for (begin, end, expected) in [(0, 3, 0.0), (3, 4, 5.0), (4, 5, 10.0), (7, 99, 0.0), (0, 99, 35.0)] {
            assert!((mean(begin, end) - expected).abs() < 1e-9, "{begin}..{end}: {}", mean(begin, end));
        }
        assert_eq!((transmitter.after(3, 0.1), transmitter.after(4, 0.1)), (Some((0.25, None)), None));
    }

    #[test]
    fn shapes_keep_their_bounds_and_means() {
        let key = Key::new(5);
        let shapes = [
            Shape::Gaussian(2.0),
            Shape::Shell(1.0, 2.0),
            Shape::Box([1.0, 2.0, 3.0]),
            Shape::Cylinder(1, 2.0, 3.0),
        ];
        for shape in shapes {
            let n = 20_000;
            let mut mean = [0.0; 3];
            for id in 0..n {
                let words = key.draw(id, 0, 0, Purpose::Release);
                let p = shape.offset(words, id, &Boundary::default()).map(f64::from);
                (0..3).for_each(|k| mean[k] += p[k] / f64::from(n));
                let r = p.iter().map(|c| c * c).sum::<f64>().sqrt();
                match shape {
                    Shape::Shell(a, b) => assert!(r >= f64::from(a) - 1e-6 && r <= f64::from(b) + 1e-6),
                    Shape::Cylinder(..) => assert!(p[1].abs() <= 1.5 && p[0].hypot(p[2]) <= 2.0 + 1e-6),
                    Shape::Box(e) => (0..3).for_each(|k| assert!(p[k].abs() <= f64::from(e[k]) / 2.0)),
                    _ => {}
                }
            }
            assert!(mean.iter().all(|m| m.abs() < 5.0 * 2.0 / f64::from(n).sqrt()), "{shape:?} {mean:?}");
        }
    }

    #[test]
    fn points_beyond_the_range_of_numbers_are_refused() {
        let check = |center, shape| {
            let transmitter = Transmitter { name: "tx".into(), center, shape, ..Transmitter::default() };
            Model { time_step: 0.1, transmitters: vec![transmitter], ..Model::default() }.check()
        };
        let far = [0.0, 3e38, 0.0];
        let accepted = [
            Shape::Point,
            Shape::Gaussian(5e36),
            Shape::Shell(0.0, 3e37),
            Shape::Box([3e38, 6e37, 1.0]),
            Shape::Cylinder(1, 3e38, 6e37),
        ];
        for shape in accepted {
            assert!(check(far, shape).is_ok(), "{shape:?}");
        }
        let refused = [
            Shape::Gaussian(1e37),
            Shape::Shell(1.0, 5e37),
            Shape::Box([2e38; 3]),
            Shape::Cylinder(0, 1e38, 1.0),
        ];
        for shape in refused {
            let error = check(far, shape).unwrap_err().to_string();
            let expected = "tx may release particles at coordinates up to ";
            assert!(
                error.contains(expected) && error.contains("more than the limit of 3.4e38 µm"),
                "{error}"
            );
        }
    }

    #[test]
    fn a_lattice_fills_its_box() {
        let shape = Shape::Lattice([4.0, 2.0, 2.0], [4, 2, 2]);
        let site = |site| shape.offset([0; 4], site, &Boundary::default());
        assert_eq!(site(0), [-1.5, -0.5, -0.5]);
        assert_eq!(site(5), [-0.5, 0.5, -0.5]);
        assert_eq!(site(15), [1.5, 0.5, 0.5]);
    }
}
