//! Scenes of tests, benchmarks and figures.
//!
//! The number of spheres and a seed determine the bytes of a scene on every platform, by `ChaCha8`, `f64`
//! arithmetic, and `libm`.

mod expected;

use lazygrid::Sphere;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, UnitBall, UnitSphere};

use crate::names::text_is_name;

pub use expected::{PairCount, periodic_box_pairs};

/// Volume of the spheres over the ball's, in uniform scenes.
const DENSITY: f64 = 0.05;
/// Determines the spread of bursts.
const BURST_PAIRS_PER_SPHERE: f64 = 20.0;

const FIVE_SIZES: [f32; 5] = [1.0, 0.5, 0.25, 0.125, 0.0625];
const TEN_POWERS: [f32; 10] =
    [1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625, 0.0078125, 0.00390625, 0.001953125];
const TEN_TENTHS: [f32; 10] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];

/// Two sizes: transceivers of radius 1, and carriers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Transceivers {
    /// Number of transceivers, at most all spheres.
    pub count: u32,
    /// Radius of a transceiver over a carrier's; 0 counts as 1.
    pub ratio: u32,
}

impl Transceivers {
    /// Thirty, a hundred times as large.
    pub const DEFAULT: Self = Self { count: 30, ratio: 100 };

    fn among(self, n: usize) -> usize {
        n.min(self.count as usize)
    }

    /// Returns the radius of a carrier.
    pub fn carrier(self) -> f32 {
        1.0 / self.ratio.max(1) as f32
    }
}

impl Default for Transceivers {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// A distribution of spheres in random order, in units of the largest radius.
///
/// ```
/// # use lazygrid_io::scenes::Scene;
/// let scene: Scene = "five-sizes".parse()?;
/// let mut spheres = scene.spheres(1000, 7);
/// Scene::advance(&mut spheres, 7, 0);
/// # Ok::<(), lazygrid::UnknownName>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Scene {
    /// Radius 1; uniform in a ball, 5 % filled.
    Equal,
    /// Radii 1, ½ … 1⁄16, equally frequent; uniform in a ball, 5 % filled.
    FiveSizes,
    /// Radii 1, ½ … 1⁄512, equally frequent; normal about the origin, with 20 pairs per sphere. Fewer than 42
    /// spheres all coincide.
    Burst,
    /// [`Burst`](Self::Burst) with radii 0.1, 0.2 … 1.
    BurstLinear,
    /// Radii of [`Burst`](Self::Burst); all centers at the origin.
    Point,
    /// Large and small spheres; uniform in a ball, 5 % filled by both.
    Transceivers(Transceivers),
}

impl Scene {
    /// All scenes, with default parameters, in the order of the help.
    pub const ALL: [Self; 6] = [
        Self::Equal,
        Self::FiveSizes,
        Self::Burst,
        Self::BurstLinear,
        Self::Point,
        Self::Transceivers(Transceivers::DEFAULT),
    ];

    /// Returns the name in lower case with hyphens.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Equal => "equal",
            Self::FiveSizes => "five-sizes",
            Self::Burst => "burst",
            Self::BurstLinear => "burst-linear",
            Self::Point => "point",
            Self::Transceivers(_) => "transceivers",
        }
    }

    /// Returns `n` spheres.
    pub fn spheres(self, n: usize, seed: u64) -> Vec<Sphere> {
        let mut rng = stream(seed, 0);
        let mut radii = self.sizes().radii(n);
        radii.shuffle(&mut rng);
        let cloud = self.cloud(n);
        radii.into_iter().map(|radius| Sphere::new(cloud.sample(&mut rng), radius)).collect()
    }

    /// Step of the benchmarks' motion, in radii.
    pub const STEP: f32 = 0.1;

    /// Moves every sphere by [`STEP`](Self::STEP) in a random direction.
    pub fn advance(spheres: &mut [Sphere], seed: u64, step: u32) {
        Self::advance_by(Self::STEP, spheres, seed, step);
    }

    /// Moves every sphere by `step_in_radii` times its radius in a random direction.
    pub fn advance_by(step_in_radii: f32, spheres: &mut [Sphere], seed: u64, step: u32) {
        let mut rng = stream(seed, 1 + u64::from(step));
        for sphere in spheres {
            let direction: [f64; 3] = UnitSphere.sample(&mut rng);
            sphere.center += glam::Vec3::from(direction.map(|d| d as f32)) * (step_in_radii * sphere.radius);
        }
    }

    /// Returns the exact distribution over seeds of the number of overlapping pairs.
    pub fn expected_pairs(self, n: usize) -> PairCount {
        expected::pairs(&self.sizes().classes(n), self.cloud(n))
    }

    fn cloud(self, n: usize) -> CenterDistribution {
        let classes = self.sizes().classes(n);
        match self {
            Self::Equal | Self::FiveSizes | Self::Transceivers(_) => {
                let cubes: f64 = classes.iter().map(|c| c.count * c.radius.powi(3)).sum();
                CenterDistribution::Ball { radius: libm::cbrt(cubes / DENSITY) }
            }
            Self::Burst | Self::BurstLinear => {
                CenterDistribution::Normal { sigma: expected::sigma_for(&classes, BURST_PAIRS_PER_SPHERE) }
            }
            Self::Point => CenterDistribution::Normal { sigma: 0.0 },
        }
    }

    const fn sizes(self) -> RadiusMix {
        match self {
            Self::Equal => RadiusMix::EquallyOften(&[1.0]),
            Self::FiveSizes => RadiusMix::EquallyOften(&FIVE_SIZES),
            Self::Burst | Self::Point => RadiusMix::EquallyOften(&TEN_POWERS),
            Self::BurstLinear => RadiusMix::EquallyOften(&TEN_TENTHS),
            Self::Transceivers(mixture) => RadiusMix::Two(mixture),
        }
    }
}

text_is_name!(Scene, "scene");

#[derive(Clone, Copy, Debug)]
enum RadiusMix {
    EquallyOften(&'static [f32]),
    Two(Transceivers),
}

impl RadiusMix {
    fn radii(self, n: usize) -> Vec<f32> {
        match self {
            Self::EquallyOften(sizes) => sizes.iter().copied().cycle().take(n).collect(),
            Self::Two(mixture) => {
                let mut radii = vec![mixture.carrier(); n];
                radii[..mixture.among(n)].fill(1.0);
                radii
            }
        }
    }

    fn classes(self, n: usize) -> Vec<SizeGroup> {
        let class = |count: usize, radius: f32| SizeGroup { count: count as f64, radius: radius.into() };
        match self {
            Self::EquallyOften(sizes) => {
                let count = |k| (n + sizes.len() - 1 - k) / sizes.len();
                sizes.iter().enumerate().map(|(k, &radius)| class(count(k), radius)).collect()
            }
            Self::Two(mixture) => {
                let count = mixture.among(n);
                vec![class(count, 1.0), class(n - count, mixture.carrier())]
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct SizeGroup {
    count: f64,
    radius: f64,
}

#[derive(Clone, Copy, Debug)]
enum CenterDistribution {
    Ball { radius: f64 },
    Normal { sigma: f64 },
}

impl CenterDistribution {
    fn sample(self, rng: &mut ChaCha8Rng) -> [f32; 3] {
        let (scale, point) = match self {
            Self::Ball { radius } => (radius, UnitBall.sample(rng)),
            Self::Normal { sigma } => (sigma, [(); 3].map(|()| StandardNormal.sample(rng))),
        };
        point.map(|x: f64| (scale * x) as f32)
    }
}

fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

#[cfg(test)]
mod tests;
