use lazygrid::gpu::GpuConfig;
use lazygrid::gpu::plan::Planner;
use lazygrid::{Algorithm, Backend, Config, Detector, Pair, Skin, Sphere};
use lazygrid_check::detectors::compare::{self, SceneCase};
use lazygrid_check::{Effort, TestInput, Tolerance, checksum};
use serde_json::{Value, json};

use super::bundle::{Bundle, Limits};
use super::scenes::KINDS;
use crate::error::CliError;

/// Larger embedded scenes are cut.
const MAX_EMBEDDED_SPHERES: usize = 160;
/// One plan serves all embedded scenes.
const CAPACITY: u32 = 256;
/// Sizes of the scenes that the device makes itself, and the largest of which all pairs are tested.
const GENERATED_SIZES: [u32; 2] = [1000, 5000];
const MAX_NAIVE_SPHERES: u32 = 1000;
/// Entries per sphere of the plans after the first; the most, eight on each of 32 levels, take long to sort.
const ENTRIES: [u32; 2] = [32, 8 * 32];
/// Factor of radii that finds all pairs near tangency.
const WIDENING_FACTOR: f32 = 1.0 + 1e-5;

pub(super) fn scenes(bundle: &mut Bundle) -> Result<Vec<Value>, CliError> {
    let mut scenes = Vec::new();
    for SceneCase { name, scenario } in compare::cases(Effort::Quick) {
        let is_taken = !scenario.is_refined() && (scenario.spheres.len() < 4000);
        if is_taken {
            let scenario = scenario.only(|at| at < MAX_EMBEDDED_SPHERES);
            scenes.push(embedded(bundle, &name, &scenario)?);
        }
    }
    for count in GENERATED_SIZES {
        for (at, kind) in KINDS.iter().enumerate() {
            let scale = kind.scale(count);
            let scenario = TestInput::from(kind.spheres(count, scale));
            let mut scene = expected(&scenario)?;
            let name = format!("{count} spheres, {}", kind.name);
            scene["calls"] = calls(bundle, &scenario, count, &scene)?;
            scenes.push(merged(
                scene,
                json!({ "name": name, "count": count, "capacity": count, "kind": at, "scale": scale }),
            ));
        }
    }
    Ok(scenes)
}

fn embedded(bundle: &mut Bundle, name: &str, scenario: &TestInput) -> Result<Value, CliError> {
    let bits = |sphere: &Sphere| {
        [sphere.center.x, sphere.center.y, sphere.center.z, sphere.radius].map(f32::to_bits)
    };
    let spheres: Vec<u32> = scenario.spheres.iter().flat_map(bits).collect();
    let mut scene = expected(scenario)?;
    scene["calls"] = calls(bundle, scenario, CAPACITY, &scene)?;
    let periodic = scenario.space.is_periodic().then(|| scenario.space.lengths_f32());
    let species = scenario.mixture.as_ref().map(|mixture| &mixture.species);
    Ok(merged(
        scene,
        json!({
            "name": name, "count": scenario.spheres.len(), "capacity": CAPACITY, "spheres": spheres,
            "species": species, "periodic": periodic,
        }),
    ))
}

fn merged(mut scene: Value, more: Value) -> Value {
    if let (Some(scene), Value::Object(more)) = (scene.as_object_mut(), more) {
        scene.extend(more);
    }
    scene
}

/// Returns the certain pairs, and those near tangency.
fn expected(scenario: &TestInput) -> Result<Value, CliError> {
    let wrong = |what: String| CliError::Page { what };
    let found = compare::expected(scenario).map_err(wrong)?;
    // Coincident points have distance 0 on every device.
    let apart = |pair: &Pair| scenario.distance_squared(pair.i as usize, pair.j as usize) > 0.0;
    let is_unsure = |pair: &Pair| Tolerance::Tangent.allows(scenario, *pair) && apart(pair);
    let unsure: Vec<Pair> = near_pairs(scenario)?.into_iter().filter(is_unsure).collect();
    let sure: Vec<Pair> = found.iter().filter(|pair| !unsure.contains(pair)).copied().collect();
    let unsure: Vec<[u32; 2]> = unsure.iter().map(|pair| [pair.i, pair.j]).collect();
    let checksum = format!("{:016x}", checksum(&sure));
    Ok(json!({
        "expected": { "pairs": sure.len(), "checksum": checksum, "unsure": unsure },
    }))
}

fn near_pairs(scenario: &TestInput) -> Result<Vec<Pair>, CliError> {
    let count = scenario.spheres.len() as u32;
    if count as usize <= MAX_EMBEDDED_SPHERES {
        return Ok((0..count).flat_map(|i| (i + 1..count).map(move |j| Pair { i, j })).collect());
    }
    let wider: Vec<Sphere> = scenario
        .spheres
        .iter()
        .map(|sphere| Sphere::new(sphere.center, sphere.radius * WIDENING_FACTOR))
        .collect();
    let config = Config::default().backend(Backend::Cpu).skin(Skin::Off);
    let mut detector = Detector::new(config).map_err(CliError::Setting)?;
    detector.pairs(&wider).map_err(CliError::Setting)?;
    Ok(detector.into_pairs())
}

fn calls(bundle: &mut Bundle, scenario: &TestInput, capacity: u32, scene: &Value) -> Result<Value, CliError> {
    let expected = &scene["expected"];
    let most =
        expected["pairs"].as_u64().unwrap_or(0) + expected["unsure"].as_array().map_or(0, Vec::len) as u64;
    // Few sizes let scenes share plans.
    let pairs =
        [1 << 12, 1 << 14, 1 << 17].into_iter().find(|&pairs| u64::from(pairs) >= most).unwrap_or(1 << 21);
    let mut calls = Vec::new();
    for &algorithm in Algorithm::GPU {
        let sorts: &[(&str, u32)] = match algorithm {
            Algorithm::Naive if capacity > MAX_NAIVE_SPHERES => &[],
            Algorithm::Naive => &[("all pairs", 0)],
            Algorithm::CellList => &[("counting sort", u32::MAX), ("radix sort", 0)],
            _ => &[("radix sort", 0)],
        };
        for &(sort, radix_sort_from) in sorts {
            let interactions = scenario.interactions().map_err(|error| CliError::Setting(error.into()))?;
            let config = GpuConfig::default()
                .algorithm(algorithm)
                .space(scenario.space)
                .interactions(interactions)
                .pair_capacity(pairs)
                .radix_sort_from(radix_sort_from);
            let planner = Planner::new(config, Limits::Large.device_limits()).count_in_buffer(true);
            let mut call = |planner: Planner| bundle.add(&planner.plan(capacity).map_err(CliError::Setting)?);
            let mut grown = vec![call(planner.clone())?];
            for entries in ENTRIES {
                grown.push(call(planner.clone().min_entries(entries * capacity))?);
            }
            grown.dedup();
            calls.push(json!({ "algorithm": algorithm.name(), "way": sort, "calls": grown }));
        }
    }
    Ok(calls.into())
}
