use std::collections::BTreeMap;
use std::io::{self, Write};

use super::series::moment;
use crate::model::receiver::inside_of;
use crate::{Model, Receiver, State};

pub(crate) fn is_logged(model: &Model) -> bool {
    model.logs_arrivals && model.receivers.iter().any(Receiver::is_momentary)
}

pub(super) fn header(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "step,time,receiver,species,transmitter,released,count")
}

/// Counts particles inside or bound; the origin of inserted ones is empty.
pub(super) fn rows(out: &mut impl Write, model: &Model, state: &State) -> io::Result<()> {
    let State { particles, centers, bound, origins, .. } = state;
    let inside = inside_of(&model.receivers, centers, &model.boundary, particles);
    let inside = inside
        .into_iter()
        .map(|(receiver, at)| (receiver, particles.species[at as usize], particles.id[at as usize]));
    let bound = bound.iter().map(|held| (held.receiver, held.species, held.id));
    let mut counts = BTreeMap::new();
    for (receiver, species, id) in inside.chain(bound) {
        let origin = origins.origin_of(id).map(|origin| (origin.transmitter, origin.step));
        *counts.entry((receiver, species, origin)).or_insert(0_u64) += 1;
    }
    let moment = moment(state.step, model);
    for ((receiver, species, origin), count) in counts {
        let [receiver, species] =
            [&model.receivers[receiver as usize].name, &model.species[species as usize].name];
        let (transmitter, released) = origin.map_or_else(Default::default, |(transmitter, step)| {
            let released = f64::from(step) * model.time_step;
            (model.transmitters[transmitter as usize].name.clone(), released.to_string())
        });
        writeln!(out, "{moment},{receiver},{species},{transmitter},{released},{count}")?;
    }
    Ok(())
}
