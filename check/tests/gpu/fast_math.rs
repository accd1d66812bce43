//! The kernels under transformations that WGSL allows and fast-math compilers make. Results stay within the
//! contract only with the guards of `evaluation_order.wgsl`.

mod inline;
mod rewrite;

use crate::common::periodic::{Scene, cloud, detect, lengths, subjects};
use crate::common::{Random, device};
use inline::inlined;
use lazygrid::gpu::{GpuConfig, GpuDevice, GpuSession};
use lazygrid::{Algorithm, Sphere, Spheres};
use rewrite::Rewrite::{Contract, Distribute, Factor, Flush, Reassociate};
use rewrite::{Rewrite, rewritten};

fn transformed(text: &str, rewrites: &[Rewrite]) -> String {
    rewritten(&inlined(text), rewrites)
}

fn unguarded(text: &str, function: &str) -> String {
    let header = format!("fn {function}(");
    let Some((before, rest)) = text.split_once(&header) else { return text.to_owned() };
    let (body, after) = rest.split_once("\n}").expect("a function ends");
    assert!(body.contains("opaque"), "{function} has no guard");
    let body = body.replace("opaque3(", "(").replace("opaque(", "(");
    format!("{before}{header}{body}\n}}{after}")
}

fn scenes() -> Vec<Scene> {
    // Multiples of one ulp of 500. Odd distances across the boundary are multiples of half an ulp of
    // 1000, where a sum is rounded; some lie just below the cutoff of 51.5 units.
    let unit = (-15.0_f32).exp2();
    let at_boundary = (1..=75).flat_map(|k| [500.0 - k as f32 * unit, k as f32 * unit - 500.0]);
    let at_boundary = at_boundary.map(|x| Sphere::new([x, 0.0, 0.0], 25.75 * unit)).collect();
    let mut random = Random(8);
    let tiny =
        (0..100).map(|_| Sphere::new([1e9, 1e-20 * random.unit(), 1e-20 * random.unit()], 1e-21)).collect();
    let last = |k: u32| f32::from_bits(f32::MAX.to_bits() - k);
    let largest =
        (0..40).map(|k| Sphere::new([last(k / 2), last(k % 2), 0.0], (2.0_f32).powi(103))).collect();
    vec![
        Scene::new("periodic boundary", lengths(7, [1000.0; 3]), at_boundary),
        Scene::new("tiny differences", lengths(0, [1.0; 3]), tiny),
        Scene::new("largest floats", lengths(0, [1.0; 3]), largest),
    ]
}

fn more_scenes() -> Vec<Scene> {
    let sizes = |random: &mut Random| 0.5 * (-(random.unit() * 8.0)).exp2();
    let small = |random: &mut Random| 1e-38 * random.unit();
    let mut subnormal = cloud(11, 150, 1e-37, small);
    subnormal.extend(cloud(12, 50, 1e-38, small));
    vec![
        Scene::new("sizes", lengths(5, [6.0; 3]), cloud(9, 200, 6.0, sizes)),
        Scene::new("far away", lengths(0, [1.0; 3]), {
            let mut far = cloud(10, 200, 6.0, sizes);
            far.iter_mut().for_each(|sphere| sphere.center += 3e5);
            far
        }),
        Scene::new("subnormal", lengths(0, [1.0; 3]), subnormal),
    ]
}

fn failures(gpu: &GpuDevice, scenes: &[Scene]) -> Vec<String> {
    let mut failures = Vec::new();
    for scene in scenes {
        for (algorithm, tau, settings) in subjects() {
            let settings = settings.subgroups(false);
            let (_, pairs) = detect(gpu, scene, settings);
            failures.extend(scene.verify(&format!("{algorithm} τ {tau}"), &pairs).err());
        }
    }
    failures
}

fn assert_within_contract(rewrite: fn(&str) -> String) {
    let Some(gpu) = device() else { return };
    let gpu = gpu.with_rewritten_kernels(rewrite);
    let failures = failures(&gpu, &[scenes(), more_scenes()].concat());
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn reassociated_kernels_stay_within_the_contract() {
    assert_within_contract(|text| transformed(text, &[Reassociate]));
}

#[test]
fn factored_kernels_stay_within_the_contract() {
    assert_within_contract(|text| transformed(text, &[Factor]));
}

#[test]
fn distributed_kernels_stay_within_the_contract() {
    assert_within_contract(|text| transformed(text, &[Distribute, Contract]));
}

#[test]
fn contracted_kernels_stay_within_the_contract() {
    assert_within_contract(|text| transformed(text, &[Contract, Flush]));
}

#[test]
fn reassociated_contracted_and_flushed_kernels_stay_within_the_contract() {
    assert_within_contract(|text| transformed(text, &[Reassociate, Contract, Flush]));
}

#[test]
fn kernels_without_a_guard_leave_the_contract() {
    let Some(gpu) = device() else { return };
    if gpu.adapter.is_hardware {
        // NVIDIA's compiler factors the distributed product again. Others were not tried.
        return;
    }
    type Rewrite = fn(&str) -> String;
    let cases: [(&str, Rewrite); 2] = [
        ("periodic boundary", |text| transformed(&unguarded(text, "across_boundary"), &[Reassociate])),
        ("tiny differences", |text| transformed(&unguarded(text, "magnified"), &[Distribute])),
    ];
    for (name, rewrite) in cases {
        let gpu = gpu.clone().with_rewritten_kernels(rewrite);
        let scene: Vec<_> = scenes().into_iter().filter(|scene| scene.name == name).collect();
        assert_eq!(scene.len(), 1);
        assert!(!failures(&gpu, &scene).is_empty(), "{name}: the guard is not needed");
    }
}

fn rebuilds(gpu: &GpuDevice, rewrite: fn(&str) -> String) -> usize {
    let gpu = gpu.clone().with_rewritten_kernels(rewrite);
    let settings = GpuConfig::default().algorithm(Algorithm::CellList).subgroups(false);
    let mut session = GpuSession::new(gpu, settings).expect("made");
    session.set_skin(Some(0.37)).expect("a skin");
    let spheres = cloud(20, 300, 6.0, |random| 0.1 + 0.2 * random.unit());
    let mut call = || {
        let ticket = session.begin(Spheres::from(&spheres)).expect("begun");
        session.finish(ticket, 1 << 20).expect("finished");
        session.candidate_list_stats().expect("a list").rebuilt.is_some()
    };
    assert!(call());
    (0..3).filter(|_| call()).count()
}

/// Compilers may treat one expression differently in two kernels. On llvmpipe this test also passes without
/// the guard.
#[test]
fn inflated_radii_agree_between_kernels() {
    let Some(gpu) = device() else { return };
    let guarded = |text: &str| match text.contains("fn skin_displacement(") {
        true => transformed(text, &[Distribute, Contract]),
        false => text.to_owned(),
    };
    assert_eq!(rebuilds(&gpu, guarded), 0);
}

#[test]
fn calls_and_sums_are_rewritten() {
    let text = "fn twice(a: f32) -> f32 {\n    return a + a;\n}\n
fn crossing(a: f32, b: f32, half: f32) -> f32 {\n    return (half - abs(a)) + (half - twice(b));\n}\n";
    let found = transformed(text, &[Reassociate]);
    let expected = "(((half) + (half)) - ((((abs(a)) + (b)) + (b))))";
    assert!(found.contains(expected), "{found}");
    let fused =
        rewritten("fn f(a: f32, b: vec3<f32>) -> vec3<f32> {\n    return a * b + b;\n}\n", &[Contract]);
    assert!(fused.contains("fma(vec3<f32>(a), (b), (b))"), "{fused}");
    let plain = "fn f(a: f32, b: f32) -> f32 {\n    return a * b - b * 2.0;\n}\n";
    let factored = rewritten(plain, &[Factor]);
    assert!(factored.contains("((a) - (2.0f)) * (b)"), "{factored}");
    let distributed = rewritten(&factored, &[Distribute]);
    assert!(distributed.contains("(a) * (b) - (2.0f) * (b)"), "{distributed}");
    let flushed = rewritten(plain, &[Flush]);
    assert!(flushed.contains("flushed_1(flushed_1(a * b) - flushed_1(b * 2.0))"), "{flushed}");
}
