use std::io::{self, Write};

use crate::model::transmitter::Schedule;
use crate::random::philox::Key;
use crate::{Model, Transmitter};

pub(super) fn any(model: &Model) -> bool {
    model.transmitters.iter().any(|t| matches!(t.schedule, Schedule::Message(_)))
}

pub(super) fn write(out: &mut impl Write, model: &Model, seed: u64) -> io::Result<()> {
    writeln!(out, "time,transmitter,symbol")?;
    for (place, Transmitter { name, schedule, .. }) in (0..).zip(&model.transmitters) {
        let Schedule::Message(message) = schedule else { continue };
        for k in 0..message.symbols.len() {
            let symbol = message.symbol(k, place, Key::new(seed));
            writeln!(out, "{},{name},{symbol}", message.time_of(k))?;
        }
    }
    Ok(())
}

/// Estimates the bytes of the file, by the mean length of the times of 17 symbols of each message.
pub(super) fn expected_bytes(model: &Model) -> f64 {
    let of_transmitter = |Transmitter { name, schedule, .. }: &Transmitter| {
        let Schedule::Message(message) = schedule else { return 0.0 };
        let count = message.symbols.len();
        // Multiples of a prime number: every sixteenth time of a round count has few digits.
        let time = |k: u32| message.time_of((u64::from(count) * u64::from(k) / 17) as u32).to_string().len();
        let mean = (0..17).map(time).sum::<usize>() as f64 / 17.0;
        f64::from(count) * (mean + (name.len() + ",,0\n".len()) as f64)
    };
    model.transmitters.iter().map(of_transmitter).sum()
}
