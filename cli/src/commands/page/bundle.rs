use std::collections::BTreeMap;

use lazygrid::gpu::plan::{CallPlan, PlanKernel, Planner, SubgroupProbe};
use lazygrid::gpu::{DeviceLimits, GpuConfig, wgpu};
use lazygrid::{Algorithm, Backend, Config, Detector, Error, Skin};
use serde_json::{Map, Value, json};

use super::checks;
use super::scenes::KINDS;
use crate::error::CliError;

const SIZES: [u32; 9] = [1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000];
/// Largest size of the naive algorithm: all pairs of more spheres take seconds on most GPUs.
const MAX_NAIVE_SPHERES: u32 = 100_000;
/// Above, the CPU counts no pairs for the page.
const MAX_COUNTED_SPHERES: u32 = 1_000_000;
/// Pairs that a scene can color, per sphere and in all: 128 MiB, which every device can bind.
const PAIRS_PER_SPHERE: u32 = 24;
const MAX_COLORED_PAIRS: u32 = 1 << 24;
/// Subgroup sizes of kernels; without subgroups they run everywhere.
const SUBGROUPS: [Option<u32>; 7] = [None, Some(4), Some(8), Some(16), Some(32), Some(64), Some(128)];

/// Limits, the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Limits {
    Large,
    /// WebGPU's default.
    Default,
}

impl Limits {
    pub(super) fn device_limits(self) -> DeviceLimits {
        let mut limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 16, ..wgpu::Limits::default() };
        if self == Self::Large {
            limits.max_storage_buffer_binding_size = 1 << 30;
            limits.max_buffer_size = 1 << 30;
        }
        DeviceLimits::from(&limits)
    }
}

#[derive(Debug, Default)]
pub(super) struct Bundle {
    texts: Texts,
    kernels: Vec<(PlanKernel, Value)>,
    plans: Vec<Value>,
    plan_numbers: BTreeMap<String, usize>,
    calls: Vec<Value>,
    call_numbers: BTreeMap<String, usize>,
}

impl Bundle {
    pub(super) fn add(&mut self, plan: &CallPlan) -> Result<usize, CliError> {
        let kernels: Value =
            plan.sequence.kernels.iter().map(|kernel| self.kernel(kernel)).collect::<Result<_, _>>()?;
        let mut without_kernels = plan.clone();
        without_kernels.sequence.kernels.clear();
        let mut form = serde_json::to_value(without_kernels).map_err(CliError::Json)?;
        let mut constants = Vec::new();
        for buffer in form["buffers"].as_array_mut().into_iter().flatten() {
            constants.extend(buffer.as_object_mut().and_then(|buffer| buffer.remove("words")));
        }
        form["kernels"] = kernels;
        let plan = numbered(&mut self.plans, &mut self.plan_numbers, form);
        let call = json!({ "plan": plan, "constants": constants });
        Ok(numbered(&mut self.calls, &mut self.call_numbers, call))
    }

    fn kernel(&mut self, kernel: &PlanKernel) -> Result<Value, CliError> {
        if let Some((_, known)) = self.kernels.iter().find(|(known, _)| known == kernel) {
            return Ok(known.clone());
        }
        let mut form = serde_json::to_value(kernel).map_err(CliError::Json)?;
        form["wgsl"] = json!(SUBGROUPS.map(|size| self.texts.add(kernel.with_subgroups(size).wgsl())));
        self.kernels.push((*kernel, form.clone()));
        Ok(form)
    }

    fn probe(&mut self) -> Result<Value, CliError> {
        let SubgroupProbe { faults, invocations, smallest, largest, .. } = SubgroupProbe::BEFORE;
        let kernel = Planner::subgroup_probe(1);
        let workgroups = SubgroupProbe::WORKGROUPS;
        Ok(json!({
            "kernel": self.kernel(&kernel)?, "workgroups": workgroups,
            "before": [faults, invocations, smallest, largest],
            "invocations": workgroups * kernel.workgroup_size(),
            "faults": {
                "subgroups are not full": SubgroupProbe::PARTIAL,
                "lanes of subgroups do not follow local indices": SubgroupProbe::OUT_OF_ORDER,
            },
        }))
    }
}

#[derive(Debug, Default)]
struct Texts {
    lines: Vec<String>,
    positions: BTreeMap<String, Vec<usize>>,
    runs: Vec<Vec<[usize; 2]>>,
    numbers: BTreeMap<String, usize>,
}

impl Texts {
    fn add(&mut self, text: String) -> usize {
        if let Some(&known) = self.numbers.get(&text) {
            return known;
        }
        let lines: Vec<&str> = text.lines().collect();
        let mut runs: Vec<[usize; 2]> = Vec::new();
        let mut rest = &lines[..];
        while let Some(first) = rest.first() {
            let same = |&at: &usize| {
                let known = self.lines[at..].iter();
                [at, known.zip(rest).take_while(|(known, line)| known == line).count()]
            };
            let positions = self.positions.get(*first).into_iter().flatten();
            let run = positions.map(same).max_by_key(|[_, length]| *length).unwrap_or_else(|| {
                let at = self.lines.len();
                self.lines.push((*first).to_owned());
                self.positions.entry((*first).to_owned()).or_default().push(at);
                [at, 1]
            });
            match runs.last_mut() {
                Some(last) if last[0] + last[1] == run[0] => last[1] += run[1],
                _ => runs.push(run),
            }
            rest = &rest[run[1]..];
        }
        self.runs.push(runs);
        self.numbers.insert(text, self.runs.len() - 1);
        self.runs.len() - 1
    }
}

fn numbered(list: &mut Vec<Value>, numbers: &mut BTreeMap<String, usize>, value: Value) -> usize {
    *numbers.entry(value.to_string()).or_insert_with(|| {
        list.push(value);
        list.len() - 1
    })
}

pub(super) fn contents(version: &str, commit: &str) -> Result<Value, CliError> {
    let mut bundle = Bundle::default();
    let sizes = SIZES.into_iter().map(|spheres| size(&mut bundle, spheres)).collect::<Result<Vec<_>, _>>()?;
    let checks = checks::scenes(&mut bundle)?;
    let scenes = KINDS.iter().map(scene).collect::<Result<Vec<_>, _>>()?;
    let probe = bundle.probe()?;
    let subgroups: Vec<Value> = SUBGROUPS
        .iter()
        .map(|&size| json!({ "size": size, "workgroup_memory": Planner::workgroup_memory(size) }))
        .collect();
    Ok(json!({
        "version": version, "commit": commit, "subgroups": subgroups, "probe": probe,
        "algorithms": Algorithm::GPU.iter().map(|algorithm| algorithm.name()).collect::<Vec<_>>(),
        "sizes": sizes, "scenes": scenes, "checks": checks,
        "plans": bundle.plans, "calls": bundle.calls, "lines": bundle.texts.lines, "texts": bundle.texts.runs,
        "wgsl": {
            "scene": include_str!("scene.wgsl"), "draw": include_str!("draw.wgsl"), "copy": include_str!("copy.wgsl"),
        },
    }))
}

fn size(bundle: &mut Bundle, spheres: u32) -> Result<Value, CliError> {
    let pairs = spheres.saturating_mul(PAIRS_PER_SPHERE).min(MAX_COLORED_PAIRS);
    let config = |algorithm| GpuConfig::default().algorithm(algorithm).pair_capacity(pairs);
    let mut calls = Map::new();
    for &algorithm in Algorithm::GPU {
        if algorithm == Algorithm::Naive && spheres > MAX_NAIVE_SPHERES {
            continue;
        }
        let mut of_limits = Vec::new();
        for limits in [Limits::Large, Limits::Default] {
            let planner = Planner::new(config(algorithm), limits.device_limits()).count_in_buffer(true);
            match planner.plan(spheres) {
                Ok(plan) => of_limits.push(bundle.add(&plan)?),
                // Larger limits have a plan.
                Err(Error::LimitExceeded { .. }) => {}
                Err(error) => return Err(CliError::Setting(error)),
            }
        }
        of_limits.dedup();
        calls.insert(algorithm.name().to_owned(), of_limits.into());
    }
    let auto = Planner::new(config(Algorithm::Auto), Limits::Large.device_limits())
        .plan(spheres)
        .map_err(CliError::Setting)?
        .algorithm;
    Ok(json!({ "spheres": spheres, "auto": auto.name(), "calls": calls }))
}

fn scene(kind: &super::scenes::SceneKind) -> Result<Value, CliError> {
    let config = Config::default().backend(Backend::Cpu).skin(Skin::Off);
    let mut detector = Detector::new(config).map_err(CliError::Setting)?;
    let mut pairs = Map::new();
    for count in SIZES.into_iter().filter(|count| (10_000..=MAX_COUNTED_SPHERES).contains(count)) {
        let spheres = kind.spheres(count, kind.scale(count));
        pairs.insert(count.to_string(), detector.count(&spheres).map_err(CliError::Setting)?.into());
    }
    let mut form = serde_json::to_value(kind).map_err(CliError::Json)?;
    form["scales"] = SIZES.map(|count| kind.scale(count)).to_vec().into();
    form["pairs"] = pairs.into();
    Ok(form)
}
