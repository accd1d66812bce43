//! Particles that move on the CPU, with the overlapping pairs of every step.
//!
//! `cargo run --release -p lazygrid --example steps [SPHERES] [STEPS]`

use std::error::Error;
use std::io::{Write, stdout};

use lazygrid::glam::Vec3;
use lazygrid::{Backend, Config, Detector, Sphere};

fn main() -> Result<(), Box<dyn Error>> {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<usize>());
    let count = numbers.next().transpose()?.unwrap_or(10_000);
    let steps = numbers.next().transpose()?.unwrap_or(10);

    let row = (count as f64).sqrt().ceil() as usize;
    let position = |k: usize| Vec3::new((k % row) as f32, (k / row) as f32, 0.0) * 2.1;
    let mut spheres: Vec<Sphere> =
        (0..count).map(|k| Sphere::new(position(k), 0.25 * (1 + k % 4) as f32)).collect();
    let velocity = |k: usize| Vec3::new((k % 7) as f32 - 3.0, (k % 11) as f32 - 5.0, 0.0) * 0.1;

    let mut detector = Detector::new(Config::default().backend(Backend::Cpu))?;
    for step in 0..steps {
        let pairs = detector.pairs(&spheres)?;
        let deepest = pairs.iter().map(|pair| {
            let [a, b] = [pair.i, pair.j].map(|k| spheres[k as usize]);
            a.radius + b.radius - a.center.distance(b.center)
        });
        let deepest = deepest.fold(0.0, f32::max);
        writeln!(stdout(), "step {step}: {} pairs, the deepest overlap is {deepest:.3}", pairs.len())?;
        spheres.iter_mut().enumerate().for_each(|(k, sphere)| sphere.center += velocity(k));
    }
    writeln!(stdout(), "{}", detector.report().reason)?;
    Ok(())
}
