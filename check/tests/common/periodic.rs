use lazygrid::gpu::{GpuConfig, GpuDevice, GpuSession, Outcome};
use lazygrid::{Algorithm, Pair, Sphere};
pub(crate) use lazygrid_check::scenes::cloud;
use lazygrid_check::scenes::periodic::space;
use lazygrid_check::{TestInput, Tolerance, difference};

use super::session_pairs;

#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) name: String,
    pub(crate) input: TestInput,
}

impl Scene {
    pub(crate) fn new(name: impl Into<String>, lengths: [Option<f32>; 3], spheres: Vec<Sphere>) -> Self {
        let space = space(lengths);
        assert_eq!(space.is_periodic(), lengths.iter().any(|length| length.is_some()), "{lengths:?}");
        Self { name: name.into(), input: TestInput { space, ..spheres.into() } }
    }

    pub(crate) fn verify(&self, context: &str, pairs: &[Pair]) -> Result<(), String> {
        difference(&self.input, pairs, &self.input.rounding_oracle(), Tolerance::Tangent)
            .map_err(|text| format!("{}, {context}: {text}", self.name))
    }
}

pub(crate) fn detect(gpu: &GpuDevice, scene: &Scene, settings: GpuConfig) -> (Outcome, Vec<Pair>) {
    let interactions = scene.input.interactions().expect("a table");
    let settings = settings.space(scene.input.space).interactions(interactions);
    let mut session = GpuSession::new(gpu.clone(), settings).expect("made");
    let pairs = session_pairs(&mut session, scene.input.view());
    (*session.outcome(), pairs)
}

/// Small τ make LazyGrid refine deeply.
pub(crate) fn subjects() -> impl Iterator<Item = (Algorithm, u32, GpuConfig)> {
    Algorithm::GPU.iter().flat_map(|&algorithm| {
        let taus: &[u32] = if algorithm == Algorithm::LazyGrid { &[0, 1, 8] } else { &[0] };
        taus.iter().map(move |&tau| (algorithm, tau, GpuConfig::default().algorithm(algorithm).tau(tau)))
    })
}

pub(crate) fn lengths(axes: usize, box_lengths: [f32; 3]) -> [Option<f32>; 3] {
    [0, 1, 2].map(|axis| (axes >> axis & 1 == 1).then_some(box_lengths[axis]))
}
