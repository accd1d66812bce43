//! A relay node: it counts the molecules of a far transmitter and forwards each bit with its own.
//!
//! `cargo run --release -p lazygrid-sim --example drive`

use std::io::{Write, stdout};

use lazygrid::Algorithm;
use lazygrid_sim::{
    Decay, Model, Receiver, ReceiverKind, Schedule, Simulation, Species, Transmitter, Unbinding,
};

const SYMBOL: u32 = 200;
const BURST: u32 = 20_000;
const THRESHOLD: u64 = 25;

fn model() -> Model {
    let species = |name: &str| Species { name: name.into(), diffusion: 100.0, ..Species::default() };
    // Molecules that stay disturb later symbols.
    let decay = |name: &str, reactant| Decay {
        name: name.into(),
        reactant,
        products: [None; 2],
        unbinding: Unbinding::Apart(0.0),
        rate: 10.0,
    };
    let transmitter = |name: &str, x| Transmitter {
        name: name.into(),
        center: [x, 0.0, 0.0],
        schedule: Schedule::Times(vec![]),
        ..Transmitter::default()
    };
    let receiver = |name: &str, x, kind, sees| Receiver {
        name: name.into(),
        center: [x, 0.0, 0.0],
        radius: 2.0,
        kind,
        sees,
        ..Receiver::default()
    };
    Model {
        time_step: 1e-3,
        species: vec![species("A"), species("B")],
        decays: vec![decay("A", 0), decay("B", 1)],
        transmitters: vec![transmitter("source", 0.0), transmitter("relay", 7.0)],
        receivers: vec![
            receiver("listens", 7.0, ReceiverKind::Transparent, vec![true, false]),
            receiver("end", 14.0, ReceiverKind::Absorbing, vec![false, true]),
        ],
        ..Model::default()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bits = [true, false, true, true, false];
    let mut simulation = Simulation::new(model(), 4, Algorithm::Auto)?;
    let mut before = 0;
    for bit in bits.into_iter().map(Some).chain([None]) {
        if bit == Some(true) {
            simulation.emit(0, 0, BURST)?;
        }
        let mut peak = 0;
        for _ in 0..SYMBOL {
            simulation.step()?;
            peak = peak.max(simulation.received()[0][0]);
        }
        let arrived = simulation.received()[1][1];
        writeln!(
            stdout(),
            "sent {bit:?}; the relay saw {peak} molecules at most, {} arrived",
            arrived - before
        )?;
        before = arrived;
        if peak > THRESHOLD {
            simulation.emit(1, 1, BURST)?;
        }
    }
    Ok(())
}
