use lazygrid_ranks::{Assigned, Bodies, Body, Carrier, Census, Migration, Particle, Parting};

use crate::wire::Wire;
use crate::{Error, Local, Particles};

/// The result of [`settle`](crate::Distributed::settle).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Settled {
    /// The new distribution of the spheres among ranks.
    pub owned: Census,
    /// The number of all spheres that changed rank.
    pub moved: u64,
    /// `true` if the parts were made again.
    pub rebuilt: bool,
    /// The destinations of the spheres, for [data that belongs to them](crate::Distributed::follow).
    pub migration: Migration,
}

/// Moves the particles of all ranks to the ranks whose parts they are in.
pub(crate) fn settle(
    wire: &mut Wire,
    parting: &mut Parting,
    (bodies, bound): (&Bodies, f64),
    particles: &mut Particles,
) -> Result<Settled, Error> {
    let (has_species, local) = checked(wire, particles)?;
    let bodies: Vec<Body> = (0..local.ids.len() as u32)
        .map(|k| {
            let particle = local.particle(k);
            bodies.body(particle.sphere, particle.species)
        })
        .collect();
    let Assigned { ranks, owned, rebuilt } = parting.assign(wire, (&bodies, local.ids), bound)?;
    if rebuilt {
        log::info!("the parts were made, with an imbalance of {:.2}", owned.imbalance());
    }
    let migration = Migration::to(&ranks, wire.ranks());
    let moved = wire.sum(&[migration.leaving(wire.rank()) as u64])[0];
    let came = migration.carry(wire, "spheres that change rank", |k| local.particle(k))?;
    *particles = unpacked(&came, has_species);
    Ok(Settled { owned, moved, rebuilt, migration })
}

/// Whether there are species, on which ranks with spheres have to agree; and the particles as a search takes them.
fn checked<'a>(wire: &mut Wire, particles: &'a Particles) -> Result<(bool, Local<'a>), Error> {
    let rank = wire.rank();
    let refuse = |message: String| Error::Input { rank, index: None, message };
    let local = particles.local().map_err(|error| refuse(error.to_string()));
    let local = wire.agree(local.and_then(|local| local.check(rank, None).map(|()| local)))?;
    let has_species = wire.sum(&[particles.species.is_some().into()])[0] > 0;
    let lacks = has_species && particles.species.is_none() && !particles.ids.is_empty();
    let agreed = match lacks {
        true => {
            Err(refuse("the spheres have no species ids, and others have; give all of them some".to_owned()))
        }
        false => Ok(()),
    };
    wire.agree(agreed)?;
    Ok((has_species, local))
}

fn unpacked(came: &[Particle], has_species: bool) -> Particles {
    Particles {
        spheres: came.iter().map(|particle| particle.sphere).collect(),
        ids: came.iter().map(|particle| particle.id).collect(),
        species: has_species.then(|| came.iter().map(|particle| particle.species).collect()),
    }
}
