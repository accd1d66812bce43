//! Scenes that break grids, and all pairs in f64 to judge them by.

use lazygrid::gpu::{Count, GpuDetector, GpuDevice, GpuSettings, GpuSpheres, Outcome};
use lazygrid::{Algorithm, Pair, Sphere};

use super::{Random, download, submit, upload};

pub(crate) fn settings(algorithm: Algorithm, subgroups: bool) -> GpuSettings {
    GpuSettings { algorithm, subgroups, ..GpuSettings::default() }
}

pub(crate) struct Found {
    pub(crate) outcome: Outcome,
    pub(crate) pairs: Vec<Pair>,
}

pub(crate) fn detect_with(own: &GpuDevice, detector: &mut GpuDetector, input: &GpuSpheres<'_>) -> Found {
    submit(own, |encoder| detector.encode(encoder, input)).expect("recorded");
    let outcome = download::<Outcome>(own, detector.outcome().expect("recorded"), 1)[0];
    let written = outcome.found().min(detector.plan().expect("planned").pairs.into()) as usize;
    let mut pairs: Vec<Pair> = download(own, detector.pairs().expect("recorded"), written);
    pairs.sort_unstable();
    Found { outcome, pairs }
}

pub(crate) fn detect(own: &GpuDevice, detector: &mut GpuDetector, spheres: &[Sphere]) -> Found {
    let buffer = upload(own, spheres);
    let count = Count::Host(spheres.len() as u32);
    detect_with(
        own,
        detector,
        &GpuSpheres { spheres: &buffer, count, species: None, window: GpuSpheres::ALL },
    )
}

/// How far a pair is from tangency, in units of the squared reach; `(distance², reach²)` in f64.
fn squares(a: &Sphere, b: &Sphere, reach: f64) -> (f64, f64) {
    let square = |axis: usize| (f64::from(a.center[axis]) - f64::from(b.center[axis])).powi(2);
    (square(0) + square(1) + square(2), reach * reach)
}

/// Holds the sorted `pairs` against all pairs: once each, none missing and none too many, but for those within
/// four ulp of tangency. `reach` says how far apart two spheres may be, if they may pair at all.
pub(crate) fn judge(
    scene: &str,
    spheres: &[Sphere],
    pairs: &[Pair],
    reach: impl Fn(usize, usize) -> Option<f64>,
) {
    assert!(pairs.windows(2).all(|two| two[0] < two[1]), "{scene}: a pair twice");
    let mut given = pairs.iter().copied().peekable();
    for i in 0..spheres.len() {
        for j in i + 1..spheres.len() {
            let pair = Pair { i: i as u32, j: j as u32 };
            let found = given.next_if_eq(&pair).is_some();
            let (wanted, tangent) = reach(i, j).map_or((false, false), |reach| {
                let (distance, limit) = squares(&spheres[i], &spheres[j], reach);
                let tolerance = 4.0 * f64::from(f32::EPSILON) * limit;
                (distance <= limit, (distance - limit).abs() <= tolerance && limit > 0.0)
            });
            assert!(
                found == wanted || tangent,
                "{scene}: {pair:?} {} {}",
                spheres[i].radius,
                spheres[j].radius
            );
        }
    }
    assert_eq!(given.next(), None, "{scene}: not a pair i < j below n");
}

pub(crate) fn touching(spheres: &[Sphere]) -> impl Fn(usize, usize) -> Option<f64> {
    |i, j| Some(f64::from(spheres[i].radius) + f64::from(spheres[j].radius))
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

fn moved(spheres: Vec<Sphere>, by: f32) -> Vec<Sphere> {
    spheres.into_iter().map(|s| Sphere::new(s.center + by, s.radius)).collect()
}

pub(crate) fn scenes() -> Vec<(&'static str, Vec<Sphere>)> {
    let lattice = |edge: f32, radius: f32| -> Vec<Sphere> {
        let at = |i: i32| [(i % 10) as f32 * edge, (i / 10 % 10) as f32 * edge, (i / 100) as f32 * edge];
        (0..1000).map(|i| Sphere::new(at(i), radius)).collect()
    };
    let line: Vec<_> = (0..2000).map(|i| Sphere::new([i as f32 * 0.9, 0.0, 0.0], 0.5)).collect();
    let mut one_huge = cloud(7, 1500, 10.0, |_| 0.05);
    one_huge.push(Sphere::new([5.0; 3], 4.0));
    let mut outlier = cloud(8, 1500, 10.0, |_| 0.2);
    outlier.extend([1e9, -3e38, 3e38].map(|x| Sphere::new([x; 3], 0.2)));
    let powers = cloud(9, 1000, 50.0, |random| 2_f32.powi((random.word() % 13) as i32 - 9));
    let mut crowds = cloud(10, 700, 0.5, |_| 0.02);
    crowds.extend(moved(cloud(11, 600, 0.5, |_| 0.02), 7.0));
    crowds.extend(cloud(12, 300, 100.0, |_| 0.02));
    let tiny = |scale: f32| {
        cloud(13, 300, 1.0, |_| 0.1).into_iter().map(move |s| Sphere::new(s.center * scale, s.radius * scale))
    };
    vec![
        ("empty", vec![]),
        ("one", vec![Sphere::new([1.0; 3], 1.0)]),
        ("two apart", vec![Sphere::new([0.0; 3], 1.0), Sphere::new([2.1, 0.0, 0.0], 1.0)]),
        ("two touching", vec![Sphere::new([0.0; 3], 1.0), Sphere::new([2.0, 0.0, 0.0], 1.0)]),
        ("equal radii", cloud(1, 3000, 30.0, |_| 0.5)),
        ("five sizes", cloud(2, 3000, 30.0, |random| [0.05, 0.1, 0.2, 0.4, 0.8][random.word() as usize % 5])),
        ("sparse", cloud(3, 3000, 1e4, |_| 0.5)),
        ("points", cloud(4, 2000, 1.0, |_| 0.0)),
        ("all at one point", vec![Sphere::new([3.0, -1.0, 7.0], 0.25); 1500]),
        ("points at one point", vec![Sphere::new([3.0, -1.0, 7.0], 0.0); 600]),
        ("lattice in contact", lattice(1.0, 0.5)),
        ("lattice of binary edge", lattice(0.25, 0.125)),
        ("line", line),
        ("one huge among tiny", one_huge),
        ("outliers to the largest float", outlier),
        ("powers of two", powers),
        ("crowds", crowds),
        ("far from the origin", moved(cloud(5, 2000, 20.0, |_| 0.5), 1e6)),
        ("very far from the origin", moved(cloud(6, 500, 20.0, |_| 0.5), 1e9)),
        ("near the largest float", tiny(3e38).collect()),
        ("squares overflow", tiny(1e25).collect()),
        ("squares underflow", tiny(1e-25).collect()),
        ("subnormal", tiny(1e-39).collect()),
        ("huge radii", vec![Sphere::new([3e38, 0.0, 0.0], 3e38), Sphere::new([-3e38, 0.0, 0.0], 3.4e38)]),
        ("one at the largest float", vec![Sphere::new([f32::MAX; 3], 0.0)]),
        (
            "corners of space",
            [f32::MAX, -f32::MAX, f32::MAX, 0.0].map(|x| Sphere::new([x, -x, x], 1.0)).to_vec(),
        ),
        ("negative zero", vec![Sphere::new([-0.0; 3], -0.0), Sphere::new([0.0; 3], 0.0)]),
    ]
}
