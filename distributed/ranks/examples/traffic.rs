//! Prints the bytes sent per step and the balance, with all ranks in one process.
//!
//!     cargo run --release -p lazygrid-ranks --example traffic [SPHERES [RANKS]…]

#![allow(clippy::print_stdout, reason = "a program")]

use lazygrid::Sphere;
use lazygrid_ranks::in_process::InProcessRanks;
use lazygrid_ranks::{ClassBounds, Particle, SphereWrapper};

struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u32 << 24) as f32
    }

    fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.next()).sum::<f32>() - 6.0
    }
}

fn uniform(spheres: usize, sizes: i32) -> Vec<Sphere> {
    let mut random = Random(1);
    let radius = |k: usize| 0.5_f32.powi(k as i32 % sizes);
    let volume: f64 = (0..spheres).map(|k| 4.19 * f64::from(radius(k)).powi(3)).sum();
    let side = (volume / 0.05).cbrt() as f32;
    (0..spheres).map(|k| Sphere::new([(); 3].map(|()| side * random.next()), radius(k))).collect()
}

fn giant(spheres: usize) -> Vec<Sphere> {
    let mut all = uniform(spheres, 1);
    let side = (spheres as f32 * 4.19 / 0.05).cbrt();
    all[spheres / 2] = Sphere::new([side / 2.0; 3], side / 4.0);
    all
}

fn gaussian(spheres: usize) -> Vec<Sphere> {
    let mut random = Random(2);
    let scale = (spheres as f32 * 4.19 / 0.05).cbrt() / 2.5 / 1.4;
    (0..spheres).map(|_| Sphere::new([(); 3].map(|()| scale * random.normal()), 1.0)).collect()
}

fn main() -> Result<(), lazygrid::Error> {
    let mut numbers = std::env::args().skip(1).filter_map(|word| word.parse::<usize>().ok());
    let spheres = numbers.next().unwrap_or(1_000_000);
    let mut ranks: Vec<u32> = numbers.map(|ranks| ranks as u32).collect();
    if ranks.is_empty() {
        ranks = vec![8, 64, 512];
    }
    println!("{spheres} spheres; counted in one process, not measured\n");
    println!(
        "scene      | ranks | owned max/mean | ghosts/n | ghosts max | bytes per sphere | bytes per rank, max"
    );
    println!(
        "---------- | ----- | -------------- | -------- | ---------- | ---------------- | -------------------"
    );
    for (name, scene) in [
        ("uniform", uniform(spheres, 1)),
        ("five sizes", uniform(spheres, 5)),
        ("giant", giant(spheres)),
        ("gaussian", gaussian(spheres)),
        ("one point", vec![Sphere::new([1.0; 3], 1.0); spheres.min(100_000)]),
    ] {
        let particle = |(id, sphere)| Particle { sphere, id, species: 0, index: 0 };
        let particles: Vec<_> = (0..).zip(scene).map(particle).collect();
        ranks.iter().try_for_each(|&ranks| print_row(name, &particles, ranks))?;
    }
    Ok(())
}

fn print_row(name: &str, particles: &[Particle], ranks: u32) -> Result<(), lazygrid::Error> {
    let in_process = InProcessRanks::balanced(particles, ranks, SphereWrapper::default())?;
    let (owned, ghosts) = (in_process.owned(), in_process.ghosts());
    let bounds = in_process.bounds() * size_of::<ClassBounds>() as u64;
    let sent = ghosts.total * size_of::<Particle>() as u64 + bounds * u64::from(ranks - 1);
    println!(
        "{name:10} | {ranks:5} | {:14.3} | {:7.2}% | {:10} | {:16.2} | {:19}",
        owned.imbalance(),
        100.0 * ghosts.total as f64 / owned.total as f64,
        ghosts.most,
        sent as f64 / owned.total as f64,
        ghosts.most * size_of::<Particle>() as u64 + bounds,
    );
    Ok(())
}
