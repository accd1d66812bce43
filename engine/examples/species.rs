//! Species: a table of the pairs that react, with their distances.
//!
//! `cargo run --release -p lazygrid --example species`

use std::error::Error;
use std::io::{Write, stdout};

use lazygrid::{Config, Detector, Interaction, Interactions, Spheres};

const NAMES: [&str; 3] = ["acid", "base", "salt"];
const ACID: u32 = 0;
const BASE: u32 = 1;
const SALT: u32 = 2;

fn main() -> Result<(), Box<dyn Error>> {
    let mut reactions = Interactions::new(3, Interaction::Never)?;
    reactions.set(ACID, BASE, Interaction::Within(0.2))?;
    reactions.set(SALT, SALT, Interaction::Touch)?;
    let mut detector = Detector::new(Config::default().interactions(reactions))?;

    let x = [0.0, 0.15, 0.3, 5.0, 5.3, 5.35];
    let (y, z) = ([0.0; 6], [0.0; 6]);
    let radius = [0.0, 0.0, 0.0, 0.2, 0.2, 0.1];
    let species = [ACID, BASE, BASE, SALT, SALT, ACID];
    let molecules = Spheres::columns(&x, &y, &z, &radius)?.with_species(&species)?;

    for pair in detector.pairs(molecules)? {
        let [a, b] = [pair.i, pair.j].map(|k| NAMES[species[k as usize] as usize]);
        writeln!(stdout(), "{} ({a}) and {} ({b})", pair.i, pair.j)?;
    }
    Ok(())
}
