use bytemuck::Pod;
use lazygrid_ranks::{
    Assignment, Communicator, LoadBalance, Migration, Particle, Partitioner, SphereWrapper,
};

use crate::communicator::{MpiCommunicator, try_zeroed};
use crate::{Error, LocalSpheres, OwnedSpheres};

#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RebalanceReport {
    pub owned: LoadBalance,
    pub moved: u64,
    pub rebuilt: bool,
    /// For [further data](crate::Distributed::migrate_data).
    pub migration: Migration,
}

pub(crate) fn rebalance(
    comm: &mut MpiCommunicator,
    partitioner: &mut Partitioner,
    wrapper: &SphereWrapper,
    bound: f64,
    particles: &mut OwnedSpheres,
) -> Result<RebalanceReport, Error> {
    let (has_species, local) = checked(comm, particles)?;
    let rank = comm.rank();
    let wrapped = wrapper.wrap_all((0..local.ids.len()).map(|k| local.particle(k as u32)));
    let wrapped = comm.agree(wrapped.map_err(|error| Error::of_detector(rank, error)))?;
    let Assignment { ranks, owned, rebuilt } = partitioner.assign(comm, &wrapped, local.ids, bound)?;
    if rebuilt {
        log::info!("the partition was built, with an imbalance of {:.2}", owned.imbalance());
    }
    let migration = Migration::to_ranks(&ranks, comm.ranks());
    let migration = comm.agree(migration.map_err(|error| Error::of_detector(rank, error)))?;
    let moved = comm.all_reduce_sum(&[migration.sent_count(comm.rank()) as u64])[0];
    let came = migration.apply(comm, "spheres that change rank", |k| local.particle(k))?;
    *particles = comm.agree(unpacked(&came, has_species, rank))?;
    Ok(RebalanceReport { owned, moved, rebuilt, migration })
}

/// Returns whether the spheres have species, on which ranks with spheres must agree, and this rank's spheres.
fn checked<'a>(
    comm: &mut MpiCommunicator,
    particles: &'a OwnedSpheres,
) -> Result<(bool, LocalSpheres<'a>), Error> {
    let rank = comm.rank();
    let refuse = |message: String| Error::Input { rank, index: None, message };
    let local = particles.local().map_err(|error| refuse(error.to_string()));
    let local = comm.agree(local.and_then(|local| local.check(rank, None).map(|()| local)))?;
    let has_species = comm.all_reduce_sum(&[particles.species.is_some().into()])[0] > 0;
    let lacks = has_species && particles.species.is_none() && !particles.ids.is_empty();
    let agreed = match lacks {
        true => Err(refuse(
            "the spheres have no species ids, but those of other ranks do; give all spheres species ids"
                .to_owned(),
        )),
        false => Ok(()),
    };
    comm.agree(agreed)?;
    Ok((has_species, local))
}

fn unpacked(came: &[Particle], has_species: bool, rank: u32) -> Result<OwnedSpheres, Error> {
    let species = has_species.then(|| column(came, rank, |particle| particle.species)).transpose()?;
    Ok(OwnedSpheres {
        spheres: column(came, rank, |particle| particle.sphere)?,
        ids: column(came, rank, |particle| particle.id)?,
        species,
    })
}

fn column<T: Pod>(came: &[Particle], rank: u32, field: impl Fn(&Particle) -> T) -> Result<Vec<T>, Error> {
    let mut column = try_zeroed("spheres that change rank", came.len() as u64, rank)?;
    column.iter_mut().zip(came).for_each(|(value, particle)| *value = field(particle));
    Ok(column)
}
