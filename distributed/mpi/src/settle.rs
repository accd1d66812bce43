use bytemuck::{Pod, Zeroable};
use lazygrid_ranks::sample::{Choice, Sample};
use lazygrid_ranks::{Bodies, Body, Census, Particle, Partition, Split, tie};

use crate::wire::Wire;
use crate::{Error, Local, Particles};

/// What [`settle`](crate::Distributed::settle) did.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Settled {
    /// How the spheres are shared among ranks now.
    pub owned: Census,
    /// How many spheres changed rank, of all.
    pub moved: u64,
    /// Whether the parts were made again.
    pub rebuilt: bool,
    /// Where the spheres went, for [what else belongs to them](crate::Distributed::follow).
    pub migration: Migration,
}

/// Where the spheres of this rank went.
#[derive(Clone, Debug, Default)]
pub struct Migration {
    /// Places before, by the rank they went to; within one, ascending.
    order: Vec<u32>,
    /// How many went to each rank, this one included.
    counts: Vec<usize>,
}

impl Migration {
    /// Everybody stays.
    pub(crate) fn none(spheres: usize, (rank, ranks): (u32, u32)) -> Self {
        let mut counts = vec![0; ranks as usize];
        counts[rank as usize] = spheres;
        Self { order: (0..spheres as u32).collect(), counts }
    }

    /// To these ranks.
    fn to(ranks_of: &[u32], ranks: u32) -> Self {
        let mut order: Vec<u32> = (0..ranks_of.len() as u32).collect();
        order.sort_by_key(|&k| ranks_of[k as usize]);
        let mut counts = vec![0; ranks as usize];
        ranks_of.iter().for_each(|&rank| counts[rank as usize] += 1);
        Self { order, counts }
    }

    /// How many spheres there were.
    pub fn spheres(&self) -> usize {
        self.order.len()
    }

    /// Brings what belongs to the spheres to where they went.
    pub(crate) fn carry<T: Pod>(
        &self,
        wire: &mut Wire,
        what: &str,
        of: impl Fn(u32) -> T,
    ) -> Result<Vec<T>, Error> {
        let send: Vec<T> = self.order.iter().map(|&k| of(k)).collect();
        wire.exchange(what, &send, &self.counts).map(|(received, _)| received)
    }
}

/// The parts of space that ranks have, from step to step.
#[derive(Debug)]
pub(crate) struct Parting {
    partition: Partition,
    /// The imbalance when it was made.
    fresh: f64,
}

/// Moves the particles of all ranks to the ranks whose parts they are in.
pub(crate) fn settle(
    wire: &mut Wire,
    parting: &mut Option<Parting>,
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
    let mut rebuilt = false;
    let (parts, owned) = loop {
        if let Some(kept) = parting {
            let (parts, owned) = share_out(wire, &kept.partition, (&bodies, local.ids));
            if rebuilt {
                kept.fresh = owned.imbalance();
            }
            if rebuilt || !owned.exceeds(bound, kept.fresh) {
                break (parts, owned);
            }
            log::info!("imbalance {:.2} is above {bound}: the parts are made again", owned.imbalance());
        }
        *parting = Some(Parting { partition: partition(wire, &bodies, local.ids)?, fresh: 1.0 });
        rebuilt = true;
    };
    let migration = Migration::to(&parts, wire.ranks());
    let stayed = migration.counts[wire.rank() as usize];
    let moved = wire.sum(&[(parts.len() - stayed) as u64])[0];
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

/// The part of each sphere of this rank, and how many come to each rank.
fn share_out(wire: &mut Wire, partition: &Partition, (bodies, ids): (&[Body], &[u64])) -> (Vec<u32>, Census) {
    let part = |(body, &id): (&Body, &u64)| partition.part_of(body.center, tie(id));
    let parts: Vec<u32> = bodies.iter().zip(ids).map(part).collect();
    let mut counts = vec![0; partition.parts() as usize];
    parts.iter().for_each(|&part| counts[part as usize] += 1);
    let owned = Census::of(&wire.sum(&counts));
    (parts, owned)
}

/// Rank 0 cuts the sample of all ranks, and tells them.
fn partition(wire: &mut Wire, bodies: &[Body], ids: &[u64]) -> Result<Partition, Error> {
    let ranks = wire.ranks();
    let choice = Choice::new(wire.sum(&[ids.len() as u64])[0], ranks);
    let chosen = bodies.iter().zip(ids).filter(|&(_, &id)| choice.takes(id));
    let sample: Vec<Sample> = chosen.map(|(body, &id)| Sample::new(body.center, id)).collect();
    let mut counts = vec![0; ranks as usize];
    counts[0] = sample.len();
    let (mut sample, _) = wire.exchange("a sample of the spheres", &sample, &counts)?;
    let mut splits = match wire.rank() {
        0 => Partition::new(&mut sample, ranks).splits().to_vec(),
        _ => vec![Split::zeroed(); ranks as usize - 1],
    };
    wire.broadcast(&mut splits);
    let rank = wire.rank();
    Partition::from_splits(ranks, splits)
        .map_err(|error| Error::Detection { rank, message: error.to_string() })
}

fn unpacked(came: &[Particle], has_species: bool) -> Particles {
    Particles {
        spheres: came.iter().map(|particle| particle.sphere).collect(),
        ids: came.iter().map(|particle| particle.id).collect(),
        species: has_species.then(|| came.iter().map(|particle| particle.species).collect()),
    }
}
