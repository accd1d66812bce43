//! A periodic box: pairs and neighbors across its boundary, from unwrapped coordinates.
//!
//! `cargo run --release -p lazygrid --example periodic`

use std::error::Error;
use std::io::{Write, stdout};

use lazygrid::glam::Vec3;
use lazygrid::{Config, Detector, Space, Sphere};

fn main() -> Result<(), Box<dyn Error>> {
    let slab = Space::periodic([Some(10.0), Some(10.0), None])?;
    let mut detector = Detector::new(Config::default().space(slab))?;

    let mut spheres = [
        Sphere::new([0.2, 5.0, 0.0], 0.5),
        Sphere::new([9.6, 5.0, 0.0], 0.5),
        Sphere::new([5.0, 5.0, 0.0], 0.5),
    ];
    for step in 0..3 {
        let neighbors = detector.neighbors(&spheres)?;
        for (k, sphere) in spheres.iter().enumerate() {
            for &other in neighbors.neighbors_of(k) {
                let distance = slab.distance_squared(sphere.center, spheres[other as usize].center).sqrt();
                writeln!(stdout(), "step {step}: {k} and {other} are {distance:.2} apart")?;
            }
        }
        spheres[2].center += Vec3::new(20.0 + 2.0, 0.0, 0.0);
    }
    writeln!(
        stdout(),
        "the last one is at {}, which is {}",
        spheres[2].center,
        slab.wrap(spheres[2].center)
    )?;
    Ok(())
}
