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
