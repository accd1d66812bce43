//! `GpuDetector` in periodic spaces against all pairs of nearest images in f64.

mod common;

use common::{Random, device, download, submit, upload};
use lazygrid::gpu::{Count, GpuDetector, GpuDevice, GpuSettings, GpuSpheres, Outcome};
use lazygrid::{Algorithm, Interaction, Interactions, Pair, Space, Sphere};

const ALGORITHMS: [Algorithm; 4] =
    [Algorithm::Naive, Algorithm::ArrayGrid, Algorithm::EagerGrid, Algorithm::LazyGrid];

/// Spheres in a space.
struct Scene {
    name: String,
    lengths: [Option<f32>; 3],
    spheres: Vec<Sphere>,
    species: Option<(Vec<u32>, Interactions)>,
}

impl Scene {
    fn new(name: impl Into<String>, lengths: [Option<f32>; 3], spheres: Vec<Sphere>) -> Self {
        Self { name: name.into(), lengths, spheres, species: None }
    }

    fn space(&self) -> Space {
        Space::periodic(self.lengths).expect("lengths")
    }

    /// The largest distance at which two are a pair.
    fn reach(&self, i: usize, j: usize) -> Option<f64> {
        let touch = || f64::from(self.spheres[i].radius) + f64::from(self.spheres[j].radius);
        let Some((species, table)) = &self.species else { return Some(touch()) };
        match table.get(species[i], species[j]) {
            Interaction::Never => None,
            Interaction::Touch => Some(touch()),
            Interaction::Within(distance) => Some(distance.into()),
        }
    }

    /// The squared distance by definition, `d − L·round(d/L)`, of coordinates reduced exactly by whole lengths.
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

    /// Holds sorted pairs against all of them, once each; within five ulp of tangency either is right.
    fn judge(&self, context: &str, pairs: &[Pair]) -> Result<(), String> {
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

fn detect(own: &GpuDevice, scene: &Scene, settings: GpuSettings) -> (Outcome, Vec<Pair>) {
    let interactions = scene.species.as_ref().map(|(_, table)| table.clone());
    let settings = GpuSettings { space: scene.space(), interactions, ..settings };
    let mut detector = GpuDetector::new(&own.device, settings).expect("made");
    let buffer = upload(own, &scene.spheres);
    let species = scene.species.as_ref().map(|(ids, _)| upload(own, ids));
    let count = Count::Host(scene.spheres.len() as u32);
    let input = GpuSpheres { spheres: &buffer, count, species: species.as_ref(), window: GpuSpheres::ALL };
    submit(own, |encoder| detector.encode(encoder, &input)).expect("recorded");
    let outcome = download::<Outcome>(own, detector.outcome().expect("recorded"), 1)[0];
    let mut pairs: Vec<Pair> =
        download(own, detector.pairs().expect("recorded"), outcome.found().min(1 << 20) as usize);
    pairs.sort_unstable();
    (outcome, pairs)
}

/// Every algorithm; LazyGrid with τ of 0, 1 and 8, which refines deeply.
fn subjects() -> impl Iterator<Item = GpuSettings> {
    ALGORITHMS.into_iter().flat_map(|algorithm| {
        let taus: &[u32] = if algorithm == Algorithm::LazyGrid { &[0, 1, 8] } else { &[0] };
        taus.iter().map(move |&tau| GpuSettings { algorithm, tau, ..GpuSettings::default() })
    })
}

fn check(own: &GpuDevice, scene: &Scene) {
    let mut failures = Vec::new();
    for settings in subjects() {
        let context = format!("{} τ {}", settings.algorithm, settings.tau);
        let (outcome, pairs) = detect(own, scene, settings);
        assert_eq!((outcome.overflow, outcome.quarantined), (0, 0), "{}, {context}", scene.name);
        failures.extend(scene.judge(&context, &pairs).err());
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

fn cloud(seed: u64, n: usize, extent: f32, radius: impl Fn(&mut Random) -> f32) -> Vec<Sphere> {
    let mut random = Random(seed);
    (0..n)
        .map(|_| {
            let center = [0; 3].map(|_| random.unit() * extent);
            Sphere::new(center, radius(&mut random))
        })
        .collect()
}

/// The spaces with these lengths where the bits of `axes` say so.
fn lengths(axes: usize, of: [f32; 3]) -> [Option<f32>; 3] {
    [0, 1, 2].map(|axis| (axes >> axis & 1 == 1).then_some(of[axis]))
}

/// Radii of nine octaves and more.
fn octaves(random: &mut Random) -> f32 {
    0.5 * (-((random.word() % 11) as f32) - random.unit()).exp2()
}

#[test]
fn boxes_of_few_cells() {
    let Some(own) = device() else { return };
    for (k, cells) in
        [0.3, 0.9, 1.0, 1.7, 2.0, 3.1, 4.0, 4.1, 5.5, 7.9, 8.0, 8.2, 9.5, 12.3].into_iter().enumerate()
    {
        // The edge is twice the largest diameter, at 0.25.
        let edge = cells * 1.0;
        for axes in [1, 4, 6, 7] {
            let spheres = cloud(k as u64, 400, 7.0, |random| 0.25 * (0.4 + 0.6 * random.unit()));
            check(&own, &Scene::new(format!("{cells} cells on {axes}"), lengths(axes, [edge; 3]), spheres));
        }
    }
}

#[test]
fn nested_rasters_go_round_at_every_depth() {
    let Some(own) = device() else { return };
    let boxes = [[8.0, 8.0, 8.0], [1.0, 3.0, 9.0], [0.1, 20.0, 2.5], [0.02, 0.02, 30.0], [4.7, 5.9, 8.3]];
    for (k, of) in boxes.into_iter().enumerate() {
        for axes in [2, 5, 7] {
            let mut spheres = cloud(100 + k as u64, 500, 8.0, octaves);
            // A crowd on the seams, so that dense cells lie there.
            let mut random = Random(k as u64);
            spheres.extend((0..300).map(|_| {
                let center = [0, 1, 2].map(|axis| of[axis] * 0.5 + 0.05 * (random.unit() - 0.5));
                Sphere::new(center, 0.01 * octaves(&mut random))
            }));
            check(&own, &Scene::new(format!("{of:?} on {axes}"), lengths(axes, of), spheres));
        }
    }
}
