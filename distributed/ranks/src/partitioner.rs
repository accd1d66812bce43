use bytemuck::Pod;
use lazygrid::Error;

use crate::communicator::{agree_on_memory, gather};
use crate::memory::try_collect;
use crate::sample::{Sample, SampleFilter};
use crate::{Communicator, Coordinate, LoadBalance, Partition, WrappedSphere, tie_breaker};

#[derive(Clone, Debug, Default)]
pub struct Partitioner {
    current: Option<FreshPartition>,
}

#[derive(Clone, Debug)]
struct FreshPartition {
    partition: Partition,
    fresh: f64,
}

#[derive(Clone, Debug)]
pub struct Assignment {
    pub ranks: Vec<u32>,
    pub owned: LoadBalance,
    pub rebuilt: bool,
}

impl Partitioner {
    /// Returns the ranks of the spheres' domains. Rebuilds the partition if a rank would have more than
    /// `bound` times the mean. Collective.
    pub fn assign<T: Coordinate, C: Communicator>(
        &mut self,
        communicator: &mut C,
        spheres: &[WrappedSphere<T>],
        ids: &[u64],
        bound: f64,
    ) -> Result<Assignment, C::Error> {
        let mut rebuilt = false;
        loop {
            if let Some(current) = &mut self.current {
                let (ranks, owned) = owners(communicator, &current.partition, spheres, ids)?;
                if rebuilt {
                    current.fresh = owned.imbalance();
                }
                if rebuilt || !owned.is_imbalanced(bound, current.fresh) {
                    return Ok(Assignment { ranks, owned, rebuilt });
                }
            }
            let partition = partition(communicator, spheres, ids)?;
            self.current = Some(FreshPartition { partition, fresh: 1.0 });
            rebuilt = true;
        }
    }
}

fn owners<T: Coordinate, C: Communicator>(
    communicator: &mut C,
    partition: &Partition,
    spheres: &[WrappedSphere<T>],
    ids: &[u64],
) -> Result<(Vec<u32>, LoadBalance), C::Error> {
    let owner =
        |(sphere, &id): (&WrappedSphere<T>, &u64)| partition.domain_of(sphere.center, tie_breaker(id));
    let owner_ranks = try_collect(spheres.len(), spheres.iter().zip(ids).map(owner), "the ranks of spheres");
    let owner_ranks = agree_on_memory(communicator, owner_ranks)?;
    let mut counts = vec![0; partition.domains() as usize];
    owner_ranks.iter().for_each(|&rank| counts[rank as usize] += 1);
    let owned = LoadBalance::from_counts(&communicator.all_reduce_sum(&counts));
    Ok((owner_ranks, owned))
}

fn partition<T: Coordinate, C: Communicator>(
    communicator: &mut C,
    spheres: &[WrappedSphere<T>],
    ids: &[u64],
) -> Result<Partition, C::Error> {
    let ranks = communicator.ranks();
    let filter = SampleFilter::new(communicator.all_reduce_sum(&[ids.len() as u64])[0], ranks);
    let chosen = spheres.iter().zip(ids).filter(|&(_, &id)| filter.takes(id));
    let sample: Vec<Sample> = chosen.map(|(sphere, &id)| Sample::new(sphere.center, id)).collect();
    let mut sample = gather(communicator, "a sample of the spheres", &sample)?;
    let planes = match communicator.rank() {
        0 => Partition::new(&mut sample, ranks).planes().to_vec(),
        _ => Vec::new(),
    };
    let (planes, _) = communicator.all_gather("the planes of the partition", &planes)?;
    let partition =
        Partition::from_planes(ranks, planes).map_err(|error| communicator.failure(error.to_string()));
    communicator.agree(partition)
}

#[derive(Clone, Debug, Default)]
pub struct Migration {
    /// Previous indices, by destination, then ascending.
    order: Vec<u32>,
    counts: Vec<usize>,
}

impl Migration {
    /// Keeps all `spheres` on `rank`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn identity(spheres: usize, rank: u32, ranks: u32) -> Result<Self, Error> {
        let mut counts = vec![0; ranks as usize];
        counts[rank as usize] = spheres;
        Ok(Self { order: try_collect(spheres, 0..spheres as u32, "the order of spheres")?, counts })
    }

    /// Sends each sphere to its destination, below `ranks`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn to_ranks(destinations: &[u32], ranks: u32) -> Result<Self, Error> {
        let mut counts = vec![0; ranks as usize];
        destinations.iter().for_each(|&rank| counts[rank as usize] += 1);
        let mut order: Vec<u32> =
            try_collect(destinations.len(), 0..destinations.len() as u32, "the order of spheres")?;
        // A stable sort allocates; the index keeps the order.
        order.sort_unstable_by_key(|&k| (destinations[k as usize], k));
        Ok(Self { order, counts })
    }

    pub fn spheres(&self) -> usize {
        self.order.len()
    }

    pub fn sent_count(&self, rank: u32) -> usize {
        self.spheres() - self.counts[rank as usize]
    }

    /// Moves `data(k)` of each sphere `k`. Returns data by previous rank and order. Collective.
    pub fn apply<T: Pod, C: Communicator>(
        &self,
        communicator: &mut C,
        what: &str,
        data: impl Fn(u32) -> T,
    ) -> Result<Vec<T>, C::Error> {
        let send = try_collect(self.order.len(), self.order.iter().map(|&k| data(k)), "spheres to send");
        let send = agree_on_memory(communicator, send)?;
        communicator.all_to_all_v(what, &send, &self.counts).map(|(received, _)| received)
    }
}
