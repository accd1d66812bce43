//! LazyGrid finds equal pairs for all values of τ, which determines the cells to refine.

use glam::Vec3;
use lazygrid::{Algorithm, Backend, Config, Sphere};
use lazygrid_io::scenes::Scene;
use lazygrid_tests::{DetectorVariant, SuiteVariant, TestInput, variants};

fn on_gpu() -> impl Iterator<Item = DetectorVariant> {
    let refines = |s: &DetectorVariant| matches!(s.algorithm, Algorithm::EagerGrid | Algorithm::LazyGrid);
    variants::all().into_iter().filter(|s| s.backend() == Backend::Gpu).filter(refines)
}

fn verify_for_any_tau(name: &str, spheres: Vec<Sphere>) {
    let scenario = TestInput::from(spheres);
    let expected = scenario.oracle();
    for (tau, ratio) in [(0, 1.5), (1, 2.0), (8, 1.5), (8, 4.0), (512, 2.0), (u32::MAX, 2.0)] {
        for variant in on_gpu() {
            let verdict = variant.verify(&scenario, &expected, &Config::default().tau(tau).cell_ratio(ratio));
            verdict.unwrap_or_else(|text| panic!("{name}, tau {tau}, ratio {ratio}: {text}"));
        }
    }
}

#[test]
fn scenes_for_any_tau() {
    for scene in Scene::ALL {
        verify_for_any_tau(scene.name(), scene.spheres(1500, 11));
    }
}

#[test]
fn one_to_twenty_sizes() {
    for sizes in [1, 2, 20] {
        for step in [0.5_f32, 0.61] {
            let mut spheres = Scene::Equal.spheres(1200, 12);
            for (k, sphere) in spheres.iter_mut().enumerate() {
                let scale = step.powi((k % sizes) as i32);
                *sphere = Sphere::new(sphere.center * scale, sphere.radius * scale);
            }
            verify_for_any_tau(&format!("{sizes} sizes by {step}"), spheres);
        }
    }
}

#[test]
fn one_giant_among_grains() {
    let grains = Scene::Equal.spheres(1500, 13).into_iter();
    let mut spheres: Vec<Sphere> =
        grains.map(|s| Sphere::new(s.center * 0.2 + Vec3::new(1_048_576.0, 0.0, 0.0), s.radius)).collect();
    spheres.insert(700, Sphere::new([0.0; 3], 1_048_576.0));
    verify_for_any_tau("giant", spheres);
}
