use lazygrid::{Algorithm, Backend, Config, Detector, Pair, Sphere};
use lazygrid_io::scenes::Scene;

use crate::detectors::variant::text;
use crate::scenes::hard::{self, TABLE_WORDS};
use crate::scenes::{self, periodic, triclinic};
use crate::{
    DetectorVariant, EXCLUSION_WORDS, Effort, Gpu, Random, SceneSeed, TestInput, catch_panic, difference,
    shrink,
};

/// Largest scene that is compared with the oracle. The reference for larger ones is the CPU's cell list.
const MAX_ORACLE_SPHERES: usize = 4000;

#[derive(Clone, Debug)]
pub struct SceneCase {
    pub name: String,
    pub scenario: TestInput,
}

pub fn cases(effort: Effort) -> Vec<SceneCase> {
    let case = |name: &str, scenario: TestInput| SceneCase { name: name.to_owned(), scenario };
    let mut cases: Vec<SceneCase> =
        scenes::scenes().into_iter().map(|(name, spheres)| case(name, spheres.into())).collect();
    let mut random = Random(1);
    let rounds = if effort == Effort::Full { 20 } else { 1 };
    for _ in 0..rounds {
        for family in hard::FAMILIES {
            let spheres = (family.spheres)(&SceneSeed::drawn(&mut random, 200));
            cases.push(case(family.name, spheres.clone().into()));
            cases.push(case(&format!("{}, species", family.name), with_species(spheres, &mut random)));
        }
        for family in periodic::FAMILIES.into_iter().chain(triclinic::FAMILIES) {
            let scenario = (family.scene)(&SceneSeed::drawn(&mut random, 200));
            let mixed =
                TestInput { space: scenario.space, ..with_species(scenario.spheres.clone(), &mut random) };
            cases.push(case(family.name, scenario));
            cases.push(case(&format!("{}, species", family.name), mixed));
        }
        for kind in 0..3 {
            let words = SceneSeed::drawn(&mut random, 200);
            let mixed = with_species(hard::soup(&words), &mut random);
            for (name, scenario) in [
                ("duplicates", hard::duplicates(&words).into()),
                ("soup, species", mixed),
                ("soup in a box", periodic::soup(&words)),
                ("soup in a triclinic cell", triclinic::soup(&words)),
            ] {
                let mut words = [(); EXCLUSION_WORDS].map(|()| random.word());
                words[1] = kind;
                cases.push(case(&format!("{name}, exclusions"), scenario.with_exclusions(&words)));
            }
        }
    }
    let sizes: &[usize] = match effort {
        Effort::Quick => &[5000],
        Effort::Default => &[10_000],
        Effort::Full => &[20_000, 1_000_000],
    };
    for &n in sizes {
        for scene in Scene::ALL.into_iter().filter(|scene| *scene != Scene::Point) {
            let spheres = scene.spheres(n, 1);
            let side = spheres.iter().map(|sphere| sphere.center.x).fold(0.0, f32::max);
            let space = periodic::space([Some(side), None, Some(1.5 * side)]);
            cases.push(case(&format!("{n} spheres, {scene}"), spheres.clone().into()));
            let periodic = TestInput { space, ..spheres.clone().into() };
            cases.push(case(&format!("{n} spheres, {scene}, periodic"), periodic));
            if scene == Scene::FiveSizes {
                let vectors = triclinic::tilted([Some(side); 3], [0.4 * side, -0.3 * side, 0.2 * side]);
                let triclinic = TestInput { space: triclinic::space(vectors), ..spheres.into() };
                cases.push(case(&format!("{n} spheres, {scene}, in a triclinic cell"), triclinic));
            }
        }
    }
    cases
}

pub(crate) fn with_species(spheres: Vec<Sphere>, random: &mut Random) -> TestInput {
    let table = [(); TABLE_WORDS].map(|()| random.word());
    let ids: Vec<u32> = spheres.iter().map(|_| random.word()).collect();
    let mixture = hard::mixture(&spheres, &table, &ids);
    TestInput { mixture: Some(mixture), ..spheres.into() }
}

pub fn expected(scenario: &TestInput) -> Result<Vec<Pair>, String> {
    if scenario.spheres.len() <= MAX_ORACLE_SPHERES {
        return Ok(scenario.oracle());
    }
    let config = Config::default().backend(Backend::Cpu).algorithm(Algorithm::CellList);
    catch_panic(|| {
        let mut detector = Detector::new(scenario.config(config).map_err(text)?).map_err(text)?;
        detector.pairs(scenario.query()).map_err(text)?;
        Ok(detector.into_pairs())
    })
}

#[derive(Clone, Debug, Default)]
pub struct FailedCase {
    pub name: String,
    pub what: String,
    pub scenario: Option<TestInput>,
    /// Options of `lazygrid detect` that repeat the failure, if any.
    pub options: String,
    pub environment: &'static str,
}

/// # Errors
/// Returns the first difference from the expected pairs, or the detector's error.
pub fn verify(
    scenario: &TestInput,
    variant: &DetectorVariant,
    pairs: impl FnOnce(&TestInput) -> Result<Vec<Pair>, String>,
) -> Result<(), String> {
    difference(scenario, &pairs(scenario)?, &expected(scenario)?, variant.tolerance())
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// Smallest measured time in seconds per unit of work.
    rate: Option<f64>,
}

impl Pace {
    /// Smallest call that is measured, because smaller ones say little about larger ones.
    const MIN_SPHERES: usize = 1000;

    /// Predicts the seconds of a call; 0 before the first measurement.
    pub fn forecast(self, variant: &DetectorVariant, spheres: usize) -> f64 {
        self.rate.unwrap_or(0.0) * Self::work(variant, spheres)
    }

    pub fn saw(&mut self, variant: &DetectorVariant, spheres: usize, seconds: f64) {
        if spheres >= Self::MIN_SPHERES {
            let rate = seconds / Self::work(variant, spheres);
            self.rate = Some(self.rate.map_or(rate, |least| least.min(rate)));
        }
    }

    fn work(variant: &DetectorVariant, spheres: usize) -> f64 {
        (spheres as f64).powi(if variant.algorithm == Algorithm::Naive { 2 } else { 1 })
    }
}

impl SceneCase {
    pub fn fault(&self, variant: &DetectorVariant, gpu: Option<&Gpu>, expected: &[Pair]) -> Option<String> {
        let found = variant.pairs(gpu, &self.scenario);
        found.and_then(|found| difference(&self.scenario, &found, expected, variant.tolerance())).err()
    }

    pub fn failure(
        &self,
        variant: &DetectorVariant,
        gpu: Option<&Gpu>,
        what: String,
        tries: usize,
    ) -> FailedCase {
        let failing =
            |smaller: &TestInput| verify(smaller, variant, |scenario| variant.pairs(gpu, scenario)).err();
        let (scenario, what) = shrink(self.scenario.clone(), what, tries, failing);
        let name = format!("{}: {variant}", self.name);
        let (options, environment) = (variant.options(gpu), variant.environment());
        FailedCase { name, what, scenario: Some(scenario), options, environment }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::variant::TargetDevice;
    use lazygrid::Simd;

    #[test]
    fn pace_is_that_of_the_fastest_large_call() {
        let [naive, list] = [Algorithm::Naive, Algorithm::CellList].map(|algorithm| {
            DetectorVariant::new(algorithm, TargetDevice::Cpu { simd: Simd::Portable, threads: Some(1) })
        });
        let mut pace = Pace::default();
        pace.saw(&naive, 10, 5.0);
        assert_eq!(pace.forecast(&naive, 1000), 0.0);
        pace.saw(&naive, 1000, 3.0);
        pace.saw(&naive, 1000, 1.0);
        pace.saw(&naive, 1000, 2.0);
        assert!((pace.forecast(&naive, 2000) - 4.0).abs() < 1e-9);
        assert!((Pace { rate: Some(1e-3) }.forecast(&list, 2000) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn reference_for_large_scenes_matches_the_oracle() {
        let scenario = TestInput::from(Scene::FiveSizes.spheres(MAX_ORACLE_SPHERES + 1, 3));
        assert_eq!(expected(&scenario), Ok(scenario.oracle()));
    }

    #[test]
    fn cases_are_reproducible_and_valid() {
        let (once, again) = (cases(Effort::Quick), cases(Effort::Quick));
        assert!(once.iter().zip(&again).all(|(a, b)| a.scenario == b.scenario));
        for SceneCase { name, scenario } in once {
            let valid = |s: &Sphere| s.center.is_finite() && s.radius.is_finite() && s.radius >= 0.0;
            assert!(scenario.spheres.iter().all(valid), "{name}");
        }
    }

    #[test]
    fn missing_pairs_and_panics_are_detected() {
        let variant = DetectorVariant::new(
            Algorithm::Naive,
            TargetDevice::Cpu { simd: Simd::Portable, threads: Some(1) },
        );
        let scenario = TestInput::from(scenes::cloud(1, 300, 4.0, |random| random.unit()));
        assert_eq!(verify(&scenario, &variant, |s| variant.pairs(None, s)), Ok(()));
        let losing = |s: &TestInput| variant.pairs(None, s).map(|pairs| pairs[1..].to_vec());
        assert!(verify(&scenario, &variant, losing).is_err_and(|text| text.contains("1 missing")));
        let panicking = |_: &TestInput| catch_panic(|| panic!("out of range"));
        assert_eq!(verify(&scenario, &variant, panicking), Err("panicked: out of range".to_owned()));
    }
}
