//! Spheres in periodic spaces: the plain loops that judge detectors there, and strategies that shrink.

use lazygrid::{Config, Pair, Space, Sphere};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use crate::{Scenario, Subject, Tolerance, adversary, difference};

/// A scenario in a space of which some axes are periodic.
#[derive(Clone, Debug)]
pub struct Periodic {
    /// What lies in it.
    pub scenario: Scenario,
    /// The length of each periodic axis.
    pub lengths: [Option<f32>; 3],
}

impl Periodic {
    /// The space.
    pub fn space(&self) -> Space {
        Space::periodic(self.lengths).expect("lengths of a box")
    }

    /// All pairs in canonical order, by `apart`, the squared distance of the nearest images of two spheres.
    fn pairs(&self, apart: impl Fn(&Self, usize, usize) -> f64) -> Vec<Pair> {
        let spheres = self.scenario.spheres.len();
        let all = (0..spheres).flat_map(|i| (i + 1..spheres).map(move |j| (i, j)));
        let touch = |&(i, j): &(usize, usize)| {
            self.scenario.reach(i, j).is_some_and(|reach| apart(self, i, j) <= reach * reach)
        };
        all.filter(touch).map(|(i, j)| Pair { i: i as u32, j: j as u32 }).collect()
    }

    /// The pairs by definition: `d − L·round(d/L)` on every periodic axis, of coordinates that have been reduced by
    /// whole lengths, which remainders do without rounding.
    pub fn oracle(&self) -> Vec<Pair> {
        self.pairs(|periodic, i, j| {
            let (a, b) = (periodic.scenario.spheres[i].center, periodic.scenario.spheres[j].center);
            (0..3).fold(0.0, |sum, axis| {
                let (a, b) = (f64::from(a[axis]), f64::from(b[axis]));
                let d = match periodic.lengths[axis].map(f64::from) {
                    Some(length) => {
                        let d = a % length - b % length;
                        d - length * (d / length).round()
                    }
                    None => a - b,
                };
                sum + d * d
            })
        })
    }

    /// The pairs by looking at all images one length away and nearer: right where all spheres lie in the box.
    pub fn oracle_of_images(&self) -> Vec<Pair> {
        self.pairs(|periodic, i, j| {
            let d = periodic.differences(i, j);
            let mut nearest = f64::INFINITY;
            for image in 0..27 {
                let step = |axis: u32| f64::from(image / 3_i32.pow(axis) % 3 - 1);
                let along = |axis: usize| {
                    d[axis]
                        + periodic.lengths[axis].map_or(0.0, |length| f64::from(length) * step(axis as u32))
                };
                let [x, y, z] = [along(0), along(1), along(2)];
                nearest = f64::min(nearest, x * x + y * y + z * z);
            }
            nearest
        })
    }

    /// The pairs by whole numbers, for radii, coordinates and lengths that are multiples of 2⁻³⁰ and lengths below
    /// 2²⁰: right at any distance.
    pub fn oracle_of_integers(&self) -> Vec<Pair> {
        let whole = |x: f64| (x * f64::from(1 << 30)) as i128;
        let spheres: Vec<[i128; 4]> = self
            .scenario
            .spheres
            .iter()
            .map(|s| [s.center.x, s.center.y, s.center.z, s.radius].map(|x| whole(x.into())))
            .collect();
        let mut pairs = Vec::new();
        for (i, a) in spheres.iter().enumerate() {
            for (j, b) in spheres.iter().enumerate().skip(i + 1) {
                let apart: i128 = (0..3)
                    .map(|axis| match self.lengths[axis].map(|length| whole(length.into())) {
                        Some(length) => {
                            let d = (a[axis] - b[axis]).rem_euclid(length);
                            d.min(length - d).pow(2)
                        }
                        None => (a[axis] - b[axis]).pow(2),
                    })
                    .sum();
                if apart <= (a[3] + b[3]).pow(2) {
                    pairs.push(Pair { i: i as u32, j: j as u32 });
                }
            }
        }
        pairs
    }

    fn differences(&self, i: usize, j: usize) -> [f64; 3] {
        let (a, b) = (self.scenario.spheres[i].center, self.scenario.spheres[j].center);
        [0, 1, 2].map(|axis| f64::from(a[axis]) - f64::from(b[axis]))
    }

    /// Judges every subject: those of the CPU in both orders, those of the GPU, which orders on the host, in one.
    ///
    /// # Errors
    /// What is wrong with whose result.
    pub fn judge(&self, expected: &[Pair], settings: &Config) -> Result<(), String> {
        let settings = settings.clone().space(self.space());
        Subject::all().into_iter().try_for_each(|subject| match subject.tolerance() {
            Tolerance::Exact => subject.judge(&self.scenario, expected, &settings),
            Tolerance::Tangent => {
                let complain = |text: String| format!("{subject}: {text}");
                let found = subject.pairs(&self.scenario, settings.clone()).map_err(complain)?;
                let excused = self.excused(&found, expected);
                difference(&self.scenario, &found, &excused, Tolerance::Exact).map_err(complain)
            }
        })
    }

    /// The `expected` pairs, but for those so near to tangency that the GPU may decide either way: these are as
    /// they were `found`.
    pub fn excused(&self, found: &[Pair], expected: &[Pair]) -> Vec<Pair> {
        let mut all: Vec<Pair> = [found, expected].concat();
        all.sort_unstable();
        all.dedup();
        all.retain(|pair| match self.is_tangent(pair) {
            true => found.contains(pair),
            false => expected.binary_search(pair).is_ok(),
        });
        all
    }

    /// Within five ulp, relative to the squared reach: four as in unbounded spaces, and one as a distance across the
    /// seam is the sum of two.
    fn is_tangent(&self, pair: &Pair) -> bool {
        let (i, j) = (pair.i as usize, pair.j as usize);
        let [a, b] = [i, j].map(|k| self.scenario.spheres[k].center);
        self.scenario.reach(i, j).is_some_and(|reach| {
            let limit = reach * reach;
            let off = (self.space().distance_squared(a, b) - limit).abs();
            off <= 5.0 * f64::from(f32::EPSILON) * limit
        })
    }
}

/// Boxes of one, two or three periodic axes, with lengths from those given.
fn lengths(of: Vec<f32>) -> impl Strategy<Value = [Option<f32>; 3]> {
    let axis = || prop_oneof![3 => select(of.clone()).prop_map(Some), 1 => Just(None)];
    (axis(), axis(), axis()).prop_map(|(x, y, z)| [x, y, z])
}

fn periodic(spheres: Vec<Sphere>, lengths: [Option<f32>; 3]) -> Periodic {
    Periodic { scenario: spheres.into(), lengths }
}

/// Sites of a lattice in exact contact whose box is a whole number of spacings, moved by whole boxes and by half
/// spacings; some spheres are twice as large, points, or larger than the box.
pub fn lattice() -> impl Strategy<Value = Periodic> {
    let spacing = select(vec![1.0_f32, 0.25, 3.0, 1.0 / 1024.0]);
    let sites =
        vec((proptest::array::uniform3(-12_i8..12), select(vec![0.5_f32, 0.5, 0.5, 1.0, 0.0, 6.0])), 0..200);
    let counts = lengths((1_u8..8).map(f32::from).collect());
    (spacing, select(vec![0.0_f32, 0.5, -1024.0]), counts, sites).prop_map(
        |(spacing, shift, counts, sites)| {
            let place = |at: i8| (f32::from(at) + shift) * spacing;
            let sphere = |(at, r): ([i8; 3], f32)| Sphere::new(at.map(place), r * spacing);
            periodic(sites.into_iter().map(sphere).collect(), counts.map(|count| count.map(|c| c * spacing)))
        },
    )
}

/// Spheres at random, of sizes from nothing to more than the box, with coordinates up to a few boxes outside.
pub fn soup() -> impl Strategy<Value = Periodic> {
    let radius = prop_oneof![6 => 0.0_f32..0.3, 2 => 0.3_f32..1.5, 1 => Just(0.0), 1 => 1.5_f32..12.0];
    let spheres = vec((proptest::array::uniform3(-4.0_f32..4.0), radius), 0..300);
    let box_of = prop_oneof![
        lengths(vec![8.0, 7.3, 4.1]).boxed(),
        (0.05_f32..9.0, 0.05_f32..9.0, 0.05_f32..9.0)
            .prop_map(|(x, y, z)| [Some(x), Some(y), Some(z)])
            .boxed(),
        lengths(vec![0.3, 1.1, 2.5, 5.0]).boxed(),
    ];
    (box_of, spheres).prop_map(|(lengths, spheres)| {
        periodic(spheres.into_iter().map(|(at, r)| Sphere::new(at, r)).collect(), lengths)
    })
}

/// Spheres at the corner of the box: on the seam, next to it by some units in the last place, at its far end.
pub fn corner() -> impl Strategy<Value = Periodic> {
    let turns = select(vec![0.0_f32, 0.5, -0.5, 1.0, -1.0, 2.0]);
    let coordinate = (turns, -3_i8..=3);
    let radius = select(vec![0.0_f32, 1e-7, 2e-7, 0.01, 0.2]);
    let spheres = vec((proptest::array::uniform3(coordinate), radius), 0..200);
    (lengths(vec![1.0, 10.0, 0.1, 3.3]), spheres).prop_map(|(lengths, spheres)| {
        let place = |(turns, ulps): (f32, i8), length: Option<f32>| {
            let x = turns * length.unwrap_or(1.0);
            (0..ulps.unsigned_abs()).fold(x, |x, _| if ulps > 0 { x.next_up() } else { x.next_down() })
        };
        let sphere = |(at, radius): ([(f32, i8); 3], f32)| {
            Sphere::new([0, 1, 2].map(|axis| place(at[axis], lengths[axis])), radius)
        };
        periodic(spheres.into_iter().map(sphere).collect(), lengths)
    })
}

/// Spheres that an unwrapped simulation has carried away, up to 2⁵⁰ boxes.
pub fn unwrapped() -> impl Strategy<Value = Periodic> {
    let coordinate = (-1024_i32..1024, 0_u32..50, any::<bool>());
    let radius = (0_u16..256).prop_map(|k| f32::from(k) / 1024.0);
    let spheres = vec((proptest::array::uniform3(coordinate), radius), 0..200);
    let length = select(vec![2.0_f32, 1.625, 0.75, 1.0 / 3.0]);
    (proptest::array::uniform3(length), spheres).prop_map(|(lengths, spheres)| {
        // Multiples of 2⁻³⁰ throughout.
        let lengths = lengths.map(|length| (length * 1024.0 * 1024.0).round() / (1024.0 * 1024.0));
        let place = |(at, doublings, far): (i32, u32, bool), length: f32| {
            let turns = if far { length * (doublings as f32).exp2() } else { 0.0 };
            at as f32 / 1024.0 + turns
        };
        let sphere = |(at, radius): ([(i32, u32, bool); 3], f32)| {
            Sphere::new([0, 1, 2].map(|axis| place(at[axis], lengths[axis])), radius)
        };
        periodic(spheres.into_iter().map(sphere).collect(), lengths.map(Some))
    })
}

/// Spheres and boxes of lengths at which arithmetic in `f32` changes, up to some boxes outside.
pub fn extremes() -> impl Strategy<Value = Periodic> {
    let spheres = vec((proptest::array::uniform3(-32_i8..=32), 0_u8..=8), 0..200);
    let box_of = prop_oneof![
        3 => lengths(vec![1.0, 2.5, 7.0, 16.0, 0.25]).prop_map(|lengths| (lengths, true)),
        1 => lengths(vec![1.0, 3e38]).prop_map(|lengths| (lengths, false)),
    ];
    (adversary::extreme_unit(), box_of, spheres).prop_map(|(unit, (lengths, in_units), spheres)| {
        let of = |quarters: f64| (0.25 * quarters * f64::from(unit)) as f32;
        // The smallest units have no parts.
        let length = |length: f32| if in_units { of(4.0 * f64::from(length)).max(unit) } else { length };
        let sphere = |(at, size): ([i8; 3], u8)| Sphere::new(at.map(|at| of(at.into())), of(size.into()));
        periodic(spheres.into_iter().map(sphere).collect(), lengths.map(|of| of.map(length)))
    })
}

/// One sphere of about the size of the box among many far smaller ones.
pub fn giant() -> impl Strategy<Value = Periodic> {
    let tiny = vec(proptest::array::uniform3(0.0_f32..10.0), 0..300);
    let box_of = lengths(vec![10.0, 6.0, 2.0]);
    (box_of, tiny, proptest::array::uniform3(0.0_f32..10.0), 0.5_f32..12.0).prop_map(
        |(lengths, tiny, at, giant)| {
            let mut spheres: Vec<Sphere> = tiny.into_iter().map(|at| Sphere::new(at, 0.05)).collect();
            spheres.insert(spheres.len() / 2, Sphere::new(at, giant));
            periodic(spheres, lengths)
        },
    )
}

/// Spheres that are hard on grids without seams, in boxes of moderate lengths; four species of every interaction.
pub fn mixture() -> impl Strategy<Value = Periodic> {
    let spheres =
        prop_oneof![adversary::soup(), adversary::lattice(), adversary::clusters(), adversary::duplicates()];
    (adversary::mixture(spheres.boxed()), lengths(vec![1.5, 4.0, 8.0, 0.7]))
        .prop_map(|(scenario, lengths)| Periodic { scenario, lengths })
}
