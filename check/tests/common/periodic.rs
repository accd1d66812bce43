//! Scenes in periodic spaces, and all pairs of minimum images in `f64`.

use lazygrid::gpu::{GpuConfig, GpuDevice, GpuSession, Outcome};
use lazygrid::{Algorithm, Interaction, Interactions, Pair, Space, Sphere, Spheres};

use super::Random;

#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) name: String,
    pub(crate) lengths: [Option<f32>; 3],
    pub(crate) spheres: Vec<Sphere>,
    pub(crate) species: Option<(Vec<u32>, Interactions)>,
}

impl Scene {
    pub(crate) fn new(name: impl Into<String>, lengths: [Option<f32>; 3], spheres: Vec<Sphere>) -> Self {
        Self { name: name.into(), lengths, spheres, species: None }
    }

    fn space(&self) -> Space {
        Space::periodic(self.lengths.map(|length| length.map(f64::from))).expect("lengths")
    }

    fn reach(&self, i: usize, j: usize) -> Option<f64> {
        let touch = || f64::from(self.spheres[i].radius) + f64::from(self.spheres[j].radius);
        let Some((species, table)) = &self.species else { return Some(touch()) };
        match table.get(species[i], species[j]) {
            Interaction::Never => None,
            Interaction::Touch => Some(touch()),
            Interaction::Within(distance) => Some(distance),
        }
    }

    /// Defined as `d − L·round(d/L)`, after exact reduction by whole lengths.
    fn distance_squared(&self, i: usize, j: usize) -> f64 {
        let (a, b) = (self.spheres[i].center, self.spheres[j].center);
        let along = |axis: usize| {
            let (a, b) = (f64::from(a[axis]), f64::from(b[axis]));
            self.lengths[axis].map_or(a - b, |length| {
                let length = f64::from(length);
                let d = a % length - b % length;
                d - length * (d / length).round()
            })
        };
        (0..3).map(|axis| along(axis).powi(2)).sum()
    }

    /// Each pair occurs once, and only pairs within five ulp of tangency may be missing or extra.
    pub(crate) fn verify(&self, context: &str, pairs: &[Pair]) -> Result<(), String> {
        let name = &self.name;
        if !pairs.windows(2).all(|two| two[0] < two[1]) {
            return Err(format!("{name}, {context}: a pair twice"));
        }
        let mut given = pairs.iter().copied().peekable();
        let (mut wrong, mut first) = (0, None);
        for i in 0..self.spheres.len() {
            for j in i + 1..self.spheres.len() {
                let pair = Pair { i: i as u32, j: j as u32 };
                let found = given.next_if_eq(&pair).is_some();
                let (wanted, tangent) = self.reach(i, j).map_or((false, false), |reach| {
                    let (distance, limit) = (self.distance_squared(i, j), reach * reach);
                    let tolerance = 5.0 * f64::from(f32::EPSILON) * limit;
                    (distance <= limit, (distance - limit).abs() <= tolerance && limit > 0.0)
                });
                if found != wanted && !tangent {
                    wrong += 1;
                    first.get_or_insert((found, pair, self.spheres[i], self.spheres[j]));
                }
            }
        }
        match (first, given.next()) {
            (None, None) => Ok(()),
            (first, rest) => Err(format!("{name}, {context}: {wrong} wrong, {first:?}; left {rest:?}")),
        }
    }
}

pub(crate) fn detect(own: &GpuDevice, scene: &Scene, settings: GpuConfig) -> (Outcome, Vec<Pair>) {
    let interactions = scene.species.as_ref().map(|(_, table)| table.clone());
    let settings = settings.space(scene.space()).interactions(interactions);
    let mut session = GpuSession::new(own.clone(), settings).expect("made");
    let mut spheres = Spheres::from(&scene.spheres);
    if let Some((species, _)) = &scene.species {
        spheres = spheres.with_species(species).expect("one each");
    }
    let ticket = session.begin(spheres).expect("begun");
    let mut pairs = session.finish(ticket, 1 << 24).expect("finished").to_vec();
    pairs.sort_unstable();
    (*session.outcome(), pairs)
}

/// LazyGrid also with τ of 0, 1 and 8, for deep refinement.
pub(crate) fn subjects() -> impl Iterator<Item = (Algorithm, u32, GpuConfig)> {
    Algorithm::GPU.iter().flat_map(|&algorithm| {
        let taus: &[u32] = if algorithm == Algorithm::LazyGrid { &[0, 1, 8] } else { &[0] };
        taus.iter().map(move |&tau| (algorithm, tau, GpuConfig::default().algorithm(algorithm).tau(tau)))
    })
}

pub(crate) fn cloud(seed: u64, n: usize, extent: f32, radius: impl Fn(&mut Random) -> f32) -> Vec<Sphere> {
    let mut random = Random(seed);
    (0..n)
        .map(|_| {
            let center = [0; 3].map(|_| random.unit() * extent);
            Sphere::new(center, radius(&mut random))
        })
        .collect()
}

pub(crate) fn lengths(axes: usize, of: [f32; 3]) -> [Option<f32>; 3] {
    [0, 1, 2].map(|axis| (axes >> axis & 1 == 1).then_some(of[axis]))
}
