//! Scenes that are hard on grids.

pub mod hard;
pub mod motion;
pub mod periodic;
pub mod triclinic;

mod random;
mod seed;

use lazygrid::Sphere;

pub use random::Random;
pub use seed::{ElementSeed, SceneSeed, SeedReader};

/// Returns spheres with centers uniform in the cube from the origin to `extent`.
pub fn cloud(seed: u64, n: usize, extent: f32, radius: impl Fn(&mut Random) -> f32) -> Vec<Sphere> {
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

pub fn scenes() -> Vec<(&'static str, Vec<Sphere>)> {
    let lattice = |spacing: f32, radius: f32| -> Vec<Sphere> {
        let at =
            |i: i32| [(i % 10) as f32 * spacing, (i / 10 % 10) as f32 * spacing, (i / 100) as f32 * spacing];
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
