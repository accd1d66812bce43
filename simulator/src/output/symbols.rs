use std::io::{self, Write};

use crate::model::transmitter::Schedule;
use crate::output::disk_estimate::mean_length;
use crate::random::philox::Key;
use crate::{Model, Transmitter};

pub(super) fn any(model: &Model) -> bool {
    model.transmitters.iter().any(|t| matches!(t.schedule, Schedule::Message(_)))
}

pub(super) fn write(out: &mut impl Write, model: &Model, seed: u64) -> io::Result<()> {
    writeln!(out, "time,transmitter,symbol")?;
    for (index, Transmitter { name, schedule, .. }) in (0..).zip(&model.transmitters) {
        let Schedule::Message(message) = schedule else { continue };
        for k in 0..message.symbols.len() {
            let symbol = message.symbol(k, index, Key::new(seed));
            writeln!(out, "{},{name},{symbol}", message.time_of(k))?;
        }
    }
    Ok(())
}

/// Estimates the bytes of the file, by the times of some symbols of each message.
pub(super) fn expected_bytes(model: &Model) -> f64 {
    let of_transmitter = |Transmitter { name, schedule, .. }: &Transmitter| {
        let Schedule::Message(message) = schedule else { return 0.0 };
        let count = message.symbols.len();
        // A prime number: a power of two divides round counts, whose times have few digits.
        let time = mean_length([0, count], 17, |k| message.time_of(k).to_string().len());
        f64::from(count) * (time + (name.len() + ",,0\n".len()) as f64)
    };
    model.transmitters.iter().map(of_transmitter).sum()
}
