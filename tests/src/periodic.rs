//! Reference loops for periodic spaces, and the families of [`lazygrid_check::scenes::periodic`] as
//! strategies.

use lazygrid::{Config, Pair};
use lazygrid_check::scenes::periodic as families;
use proptest::prelude::*;

use crate::hard::{self, words};
use crate::{SeedReader, SuiteVariant, TestInput, Tolerance, variants};

/// Tests images up to one length away, which is correct if all spheres are in the box.
pub fn oracle_of_images(scenario: &TestInput) -> Vec<Pair> {
    let lengths = scenario.space.lengths();
    scenario.pairs_by(|i, j, _| {
        let (a, b) = (scenario.spheres[i].center, scenario.spheres[j].center);
        let mut nearest = f64::INFINITY;
        for image in 0..27 {
            let step = |axis: u32| f64::from(image / 3_i32.pow(axis) % 3 - 1);
            let along = |axis: usize| {
                let d = f64::from(a[axis]) - f64::from(b[axis]);
                d + lengths[axis].map_or(0.0, |length| length * step(axis as u32))
            };
            let [x, y, z] = [along(0), along(1), along(2)];
            nearest = f64::min(nearest, x * x + y * y + z * z);
        }
        nearest
    })
}

/// Uses integers, which is correct at any distance if radii, coordinates and lengths are multiples of 2⁻³⁰
/// and lengths are below 2²⁰.
pub fn oracle_of_integers(scenario: &TestInput) -> Vec<Pair> {
    let whole = |x: f64| (x * f64::from(1 << 30)) as i128;
    let lengths = scenario.space.lengths().map(|length| length.map(whole));
    let spheres: Vec<[i128; 4]> = scenario
        .spheres
        .iter()
        .map(|s| [s.center.x, s.center.y, s.center.z, s.radius].map(|x| whole(x.into())))
        .collect();
    let mut pairs = Vec::new();
    for (i, a) in spheres.iter().enumerate() {
        for (j, b) in spheres.iter().enumerate().skip(i + 1) {
            let apart: i128 = (0..3)
                .map(|axis| match lengths[axis] {
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

/// The host sorts the pairs of GPU variants, so one order suffices.
pub fn verify_all(scenario: &TestInput, expected: &[Pair], settings: &Config) -> Result<(), String> {
    variants::for_scenario(scenario).into_iter().try_for_each(|variant| match variant.tolerance() {
        Tolerance::Exact => variant.verify(scenario, expected, settings),
        Tolerance::Tangent => {
            let complain = |text: String| format!("{variant}: {text}");
            let found = variant.find(scenario, settings.clone()).map_err(complain)?;
            crate::difference(scenario, &found, expected, Tolerance::Tangent).map_err(complain)
        }
    })
}

macro_rules! strategies {
    ($($name:ident)*) => {$(
        #[doc = concat!("A strategy for [`lazygrid_check::scenes::periodic::", stringify!($name), "`].")]
        pub fn $name() -> impl Strategy<Value = TestInput> {
            words().prop_map(|words| families::$name(&words))
        }
    )*};
}

strategies! { lattice soup corner unwrapped extremes giant }

pub fn mixture() -> impl Strategy<Value = TestInput> {
    let spheres = prop_oneof![hard::soup(), hard::lattice(), hard::clusters(), hard::duplicates()];
    (hard::mixture(spheres.boxed()), any::<[u32; 6]>()).prop_map(|(scenario, words)| {
        let lengths = families::lengths(&mut SeedReader::new(&words), &[1.5, 4.0, 8.0, 0.7]);
        TestInput { space: families::space(lengths), ..scenario }
    })
}
