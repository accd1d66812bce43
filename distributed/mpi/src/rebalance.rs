use lazygrid_ranks::{
    Assignment, Communicator, Coordinate, LoadBalance, Migration, Particle, Partitioner, SphereWrapper,
    WrappedSphere,
};

use crate::communicator::{MpiCommunicator, try_reserved};
use crate::{Error, LocalSpheres, OwnedSpheres};

#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RebalanceReport {
    pub owned: LoadBalance,
    pub moved: u64,
    pub rebuilt: bool,
    /// For [`migrate_data`](crate::Distributed::migrate_data).
    pub migration: Migration,
}

pub(crate) fn rebalance(
    comm: &mut MpiCommunicator,
    partitioner: &mut Partitioner,
    wrapper: &SphereWrapper,
    bound: f64,
    particles: &mut OwnedSpheres,
) -> Result<RebalanceReport, Error> {
    let (columns, local) = checked(comm, particles)?;
    let rank = comm.rank();
    let assignment = match columns.doubles || wrapper.needs_f64() {
        true => assign(comm, partitioner, wrapper.wrap_all_f64(local.spheres), local.ids, bound),
        false => assign(comm, partitioner, wrapper.wrap_all(local.particles()), local.ids, bound),
    };
    let Assignment { ranks, owned, rebuilt } = assignment?;
    if rebuilt {
        log::info!("the partition was built, with an imbalance of {:.2}", owned.imbalance());
    }
    let migration = Migration::to_ranks(&ranks, comm.ranks());
    let migration = comm.agree(migration.map_err(|error| Error::from_detector(rank, error)))?;
    let moved = comm.all_reduce_sum(&[migration.sent_count(comm.rank()) as u64])[0];
    let came = migration.apply(comm, "spheres that change rank", |k| local.particle(k))?;
    let doubles = match columns.doubles {
        true => Some(migration.apply(comm, "spheres that change rank", |k| local.row(k))?),
        false => None,
    };
    *particles = comm.agree(unpacked(&came, doubles, columns.species, rank))?;
    Ok(RebalanceReport { owned, moved, rebuilt, migration })
}

fn assign<T: Coordinate>(
    comm: &mut MpiCommunicator,
    partitioner: &mut Partitioner,
    wrapped: Result<Vec<WrappedSphere<T>>, lazygrid::Error>,
    ids: &[u64],
    bound: f64,
) -> Result<Assignment, Error> {
    let rank = comm.rank();
    let wrapped = comm.agree(wrapped.map_err(|error| Error::from_detector(rank, error)))?;
    partitioner.assign(comm, &wrapped, ids, bound)
}

struct Columns {
    species: bool,
    doubles: bool,
}

fn checked<'a>(
    comm: &mut MpiCommunicator,
    particles: &'a OwnedSpheres,
) -> Result<(Columns, LocalSpheres<'a>), Error> {
    let rank = comm.rank();
    let refuse = |message: String| Error::Input { rank, index: None, message };
    let local = particles.local().map_err(|error| refuse(error.to_string()));
    let local = comm.agree(local.and_then(|local| local.check(rank, None).map(|()| local)))?;
    let has_spheres = !particles.ids.is_empty();
    let has_columns = [particles.species.is_some(), particles.doubles.is_some() && has_spheres];
    let all = comm.all_reduce_sum(&has_columns.map(u64::from));
    let [species, doubles] = [all[0] > 0, all[1] > 0];
    let lacking = match has_spheres {
        true if species && !has_columns[0] => {
            Some("the spheres have no species ids, but those of other ranks do; give all spheres species ids")
        }
        true if doubles && !has_columns[1] => {
            Some("the spheres are f32, but those of other ranks f64; give all ranks one type")
        }
        _ => None,
    };
    comm.agree(lacking.map_or(Ok(()), |message| Err(refuse(message.to_owned()))))?;
    Ok((Columns { species, doubles }, local))
}

fn unpacked(
    came: &[Particle],
    doubles: Option<Vec<[f64; 4]>>,
    has_species: bool,
    rank: u32,
) -> Result<OwnedSpheres, Error> {
    let species = has_species.then(|| column(came, rank, |particle| particle.species)).transpose()?;
    let spheres = match doubles {
        Some(_) => Vec::new(),
        None => column(came, rank, |particle| particle.sphere)?,
    };
    Ok(OwnedSpheres { spheres, doubles, ids: column(came, rank, |particle| particle.id)?, species })
}

fn column<T>(came: &[Particle], rank: u32, field: impl Fn(&Particle) -> T) -> Result<Vec<T>, Error> {
    let mut column = try_reserved("spheres that change rank", came.len() as u64, rank)?;
    column.extend(came.iter().map(field));
    Ok(column)
}
