use bytemuck::Pod;

use crate::carrier::gather;
use crate::sample::{Choice, Sample};
use crate::{Body, Carrier, Census, Partition, tie};

/// The parts of space that ranks have, from step to step.
#[derive(Clone, Debug, Default)]
pub struct Parting {
    kept: Option<Kept>,
}

#[derive(Clone, Debug)]
struct Kept {
    partition: Partition,
    /// The imbalance when it was made.
    fresh: f64,
}

/// The destination of each sphere.
#[derive(Clone, Debug)]
pub struct Assigned {
    /// The rank of each sphere of this rank.
    pub ranks: Vec<u32>,
    /// The resulting distribution of the spheres among ranks.
    pub owned: Census,
    /// `true` if the parts were made again.
    pub rebuilt: bool,
}

impl Parting {
    /// The ranks in whose parts spheres are. The parts are made again where some rank would have more than `bound` times
    /// its share.
    ///
    /// # Errors
    /// Fails if the communicator fails.
    pub fn assign<C: Carrier>(
        &mut self,
        carrier: &mut C,
        (bodies, ids): (&[Body], &[u64]),
        bound: f64,
    ) -> Result<Assigned, C::Error> {
        let mut rebuilt = false;
        loop {
            if let Some(kept) = &mut self.kept {
                let (ranks, owned) = share_out(carrier, &kept.partition, (bodies, ids));
                if rebuilt {
                    kept.fresh = owned.imbalance();
                }
                if rebuilt || !owned.exceeds(bound, kept.fresh) {
                    return Ok(Assigned { ranks, owned, rebuilt });
                }
            }
            self.kept = Some(Kept { partition: partition(carrier, (bodies, ids))?, fresh: 1.0 });
            rebuilt = true;
        }
    }
}

/// The part of each sphere of this rank, and how many come to each rank.
fn share_out(
    carrier: &mut impl Carrier,
    partition: &Partition,
    (bodies, ids): (&[Body], &[u64]),
) -> (Vec<u32>, Census) {
    let part = |(body, &id): (&Body, &u64)| partition.part_of(body.center, tie(id));
    let parts: Vec<u32> = bodies.iter().zip(ids).map(part).collect();
    let mut counts = vec![0; partition.parts() as usize];
    parts.iter().for_each(|&part| counts[part as usize] += 1);
    let owned = Census::of(&carrier.sum(&counts));
    (parts, owned)
}

/// Rank 0 cuts the sample of all ranks, and tells them.
fn partition<C: Carrier>(carrier: &mut C, (bodies, ids): (&[Body], &[u64])) -> Result<Partition, C::Error> {
    let ranks = carrier.ranks();
    let choice = Choice::new(carrier.sum(&[ids.len() as u64])[0], ranks);
    let chosen = bodies.iter().zip(ids).filter(|&(_, &id)| choice.takes(id));
    let sample: Vec<Sample> = chosen.map(|(body, &id)| Sample::new(body.center, id)).collect();
    let mut sample = gather(carrier, "a sample of the spheres", &sample)?;
    let splits = match carrier.rank() {
        0 => Partition::new(&mut sample, ranks).splits().to_vec(),
        _ => Vec::new(),
    };
    let (splits, _) = carrier.share("the parts of space", &splits)?;
    let partition = Partition::from_splits(ranks, splits).map_err(|error| carrier.failure(error.to_string()));
    carrier.agree(partition)
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
    /// Everybody stays on their rank of so many.
    pub fn none(spheres: usize, (rank, ranks): (u32, u32)) -> Self {
        let mut counts = vec![0; ranks as usize];
        counts[rank as usize] = spheres;
        Self { order: (0..spheres as u32).collect(), counts }
    }

    /// Each to its rank of so many.
    pub fn to(ranks_of: &[u32], ranks: u32) -> Self {
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

    /// How many of them did not stay on this rank.
    pub fn leaving(&self, rank: u32) -> usize {
        self.spheres() - self.counts[rank as usize]
    }

    /// Brings what belongs to the spheres to where they went: what came from rank 0, then what came from rank 1 and so on,
    /// what stayed in its place among them, each in the order it had there.
    ///
    /// # Errors
    /// Fails if the communicator fails.
    pub fn carry<T: Pod, C: Carrier>(
        &self,
        carrier: &mut C,
        what: &str,
        of: impl Fn(u32) -> T,
    ) -> Result<Vec<T>, C::Error> {
        let send: Vec<T> = self.order.iter().map(|&k| of(k)).collect();
        carrier.exchange(what, &send, &self.counts).map(|(received, _)| received)
    }
}
