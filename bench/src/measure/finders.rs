use std::error::Error;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::Duration;

use lazygrid::{Backend, Detector, PhaseTime, Sphere, Spheres, gpu};

use super::{Found, PairFinder};
use crate::SpeciesScene;

pub(super) struct List {
    pub(super) detector: Detector,
    pub(super) species: Option<(SpeciesScene, Vec<u32>)>,
}

impl PairFinder for List {
    fn prepare(&mut self, spheres: &[Sphere]) -> Result<(), Box<dyn Error>> {
        if let Some((scene, species)) = &mut self.species {
            *species = scene.species(spheres.len());
        }
        Ok(())
    }

    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        let all = Spheres::from(spheres);
        let all = match &self.species {
            None => all,
            Some((_, species)) => all.with_species(species)?,
        };
        Ok(Found::Pairs(self.detector.pairs(all)?))
    }

    fn phases(&self) -> Vec<PhaseTime> {
        self.detector.report().phases
    }

    fn gpu_time(&self) -> Option<Duration> {
        let report = self.detector.report();
        let on_device = |phase: &&PhaseTime| gpu::GpuPhase::ALL.iter().any(|p| p.name() == phase.name);
        let times: Vec<Duration> = report.phases.iter().filter(on_device).map(|p| p.time).collect();
        (report.backend == Backend::Gpu && !times.is_empty()).then(|| times.iter().sum())
    }

    fn note(&self) -> String {
        self.detector.report().algorithm.to_string()
    }
}

pub(super) struct Count(pub(super) Detector);

impl PairFinder for Count {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        Ok(Found::Count(self.0.count(spheres)?))
    }

    fn note(&self) -> String {
        self.0.report().algorithm.to_string()
    }
}

pub(super) struct Stream(pub(super) Detector);

impl PairFinder for Stream {
    fn run(&mut self, spheres: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        const CHUNK: usize = 1 << 20;
        let mut pairs = 0;
        self.0.stream(spheres, CHUNK, |chunk| {
            pairs += black_box(chunk).len() as u64;
            ControlFlow::Continue(())
        })?;
        Ok(Found::Count(pairs))
    }

    fn note(&self) -> String {
        self.0.report().algorithm.to_string()
    }
}
