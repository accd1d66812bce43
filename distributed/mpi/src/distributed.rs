use std::ops::ControlFlow;

use bytemuck::Pod;
use lazygrid::{Detector, Order, thread_pool};
use lazygrid_ranks::{
    Communicator as _, Coordinate, Ghosts, LoadBalance, Migration, PairCounts, PairKind, Partitioner,
    RankBounds, Search, SphereWrapper, WrappedSphere, gather,
};
use mpi::traits::Communicator;
use rayon::ThreadPool;

use crate::communicator::{MpiCommunicator, try_reserved};
use crate::id_check::IdCheck;
use crate::node_rank::NodeRank;
use crate::rebalance::rebalance;
use crate::{
    Config, Delivery, Error, GlobalPair, LocalSpheres, OwnedSpheres, Ownership, RebalanceReport, Report,
    SphereRef,
};

/// Finds overlapping pairs among the spheres of all ranks, like one process with all spheres.
///
/// Every method except [`report`](Self::report) is collective: all ranks call it in the same order.
pub struct Distributed {
    comm: MpiCommunicator,
    config: Config,
    wrapper: SphereWrapper,
    search: Search,
    pool: ThreadPool,
    id_check: IdCheck,
    partitioner: Partitioner,
    pairs: Vec<GlobalPair>,
    report: Report,
}

struct PreparedSearch {
    owned: Vec<u64>,
    ghosts: Ghosts,
}

impl Distributed {
    /// Creates a detector on a duplicate of the communicator, so messages do not mix. Collective.
    ///
    /// # Errors
    /// On all ranks: [`Error::Setting`] out of range; [`Error::Settings`] if a setting of [`Config`] differs;
    /// [`Error::Detection`] if a rank's detector cannot be created.
    pub fn new(communicator: &impl Communicator, config: Config) -> Result<Self, Error> {
        let mut comm = MpiCommunicator::new(communicator.duplicate(), config.message_limit);
        comm.agree(config.check(comm.ranks()))?;
        config.shared().agree(&mut comm)?;
        let node = NodeRank::new(comm.comm());
        let wrapper = SphereWrapper::new(config.space, config.interactions.as_ref());
        let (rank, ranks) = (comm.rank(), comm.ranks());
        let made = search(&config, node, wrapper.clone(), [rank, ranks]);
        let threads = config.threads.unwrap_or_else(|| node.threads());
        let made =
            made.and_then(|search| Ok((search, thread_pool(threads).map_err(|error| error.to_string())?)));
        let (search, pool) = comm.agree(made.map_err(|message| Error::Detection { rank, message }))?;
        let (id_check, report) = (IdCheck::default(), Report::default());
        Ok(Self {
            comm,
            config,
            wrapper,
            search,
            pool,
            id_check,
            partitioner: Partitioner::default(),
            pairs: Vec::new(),
            report,
        })
    }

    /// Moves spheres to the ranks of their domains with [`Balance`](Ownership::Balance), else only checks
    /// them. Sorts spheres by previous rank and order.
    ///
    /// # Errors
    /// [`Error::Input`] and [`Error::OutOfMemory`]; no sphere has moved.
    pub fn rebalance(&mut self, particles: &mut OwnedSpheres) -> Result<RebalanceReport, Error> {
        let bound = match self.config.ownership {
            Ownership::Balance { bound } => bound,
            Ownership::Keep => return self.keep(particles),
        };
        rebalance(&mut self.comm, &mut self.partitioner, &self.wrapper, bound, particles)
    }

    fn keep(&mut self, particles: &OwnedSpheres) -> Result<RebalanceReport, Error> {
        let rank = self.comm.rank();
        let refuse =
            |error: lazygrid::InputError| Error::Input { rank, index: None, message: error.to_string() };
        let checked = particles.local().map_err(refuse).and_then(|local| local.check(rank, None));
        self.comm.agree(checked)?;
        let spheres = particles.ids.len();
        let (counts, _) = self.comm.all_gather("counts", &[spheres as u64])?;
        let migration = Migration::identity(spheres, rank, self.comm.ranks());
        let migration = self.comm.agree(migration.map_err(|error| Error::from_detector(rank, error)))?;
        Ok(RebalanceReport { owned: LoadBalance::from_counts(&counts), moved: 0, rebuilt: false, migration })
    }

    /// Moves further data, one element per sphere in the previous order. Returns the present order.
    ///
    /// # Errors
    /// [`Error::Input`] for another number of elements; [`Error::OutOfMemory`].
    pub fn migrate_data<T: Pod>(&mut self, migration: &Migration, column: &[T]) -> Result<Vec<T>, Error> {
        let (length, expected) = (column.len(), migration.spheres());
        let lengths = lazygrid::InputError::Lengths { what: "column", length, expected };
        let checked = if length == expected { Ok(()) } else { Err(self.comm.failure(lengths.to_string())) };
        self.comm.agree(checked)?;
        migration.apply(&mut self.comm, "what follows the spheres", |k| column[k as usize])
    }

    /// Gathers elements on rank 0, by rank.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub fn gather<T: Pod>(&mut self, elements: &[T]) -> Result<Vec<T>, Error> {
        gather(&mut self.comm, "what is gathered", elements)
    }

    /// Returns this rank's pairs ([`Config::delivery`]) in the configured order.
    ///
    /// # Errors
    /// [`Error::Input`] for non-finite spheres, negative radii, unknown species, different lengths, or `f64` spheres on
    /// some ranks and `f32` spheres on others;
    /// [`Error::DuplicateId`]; [`Error::TooManyPairs`] above [`Config::max_pairs`]; [`Error::OutOfMemory`];
    /// [`Error::Detection`].
    pub fn pairs(&mut self, local: LocalSpheres<'_>) -> Result<&[GlobalPair], Error> {
        let prepared = self.prepare(local)?;
        let mut list =
            List { pairs: std::mem::take(&mut self.pairs), limit: self.config.max_pairs, refused: None };
        list.pairs.clear();
        let found = self.search(local, &prepared.ghosts, |pairs| {
            list.add(pairs);
            ControlFlow::Continue(())
        });
        let rank = self.comm.rank();
        let found = found.and_then(|counts| list.check(rank, counts.reported()).map(|()| counts));
        let counts = self.comm.agree(found)?;
        if self.config.delivery == Delivery::Owners {
            let came = send_to_ranks(&mut self.comm, &list.pairs)?;
            list.add(&came);
            let complete = list.check(rank, counts.reported() + came.len() as u64);
            self.comm.agree(complete)?;
        }
        if self.config.order == Order::Canonical {
            self.pool.install(|| rayon::slice::ParallelSliceMut::par_sort_unstable(&mut list.pairs[..]));
        }
        self.pairs = list.pairs;
        self.update_report(prepared, counts)?;
        Ok(&self.pairs)
    }

    /// Counts the pairs of all ranks.
    ///
    /// # Errors
    /// See [`pairs`](Self::pairs), without [`Error::TooManyPairs`].
    pub fn count(&mut self, local: LocalSpheres<'_>) -> Result<u64, Error> {
        let prepared = self.prepare(local)?;
        let search = &mut self.search;
        let found = self.pool.install(|| search.count(local.spheres, &prepared.ghosts));
        let rank = self.comm.rank();
        let counts = self.comm.agree(found.map_err(|error| Error::from_detector(rank, error)))?;
        self.update_report(prepared, counts)?;
        Ok(self.report.pairs.total)
    }

    /// Hands this rank's pairs to `consume`, in unordered chunks of at most `chunk`, until it breaks. Returns
    /// the number of pairs handed over on all ranks.
    ///
    /// # Errors
    /// See [`count`](Self::count).
    pub fn stream<F>(&mut self, local: LocalSpheres<'_>, chunk: usize, mut consume: F) -> Result<u64, Error>
    where
        F: FnMut(&[GlobalPair]) -> ControlFlow<()> + Send,
    {
        let prepared = self.prepare(local)?;
        let mut handed = 0;
        let found = self.search(local, &prepared.ghosts, |pairs| {
            pairs.chunks(chunk.max(1)).try_for_each(|pairs| {
                handed += pairs.len() as u64;
                consume(pairs)
            })
        });
        let counts = self.comm.agree(found)?.up_to(handed);
        self.update_report(prepared, counts)?;
        Ok(self.report.pairs.total)
    }

    pub fn report(&self) -> &Report {
        &self.report
    }

    fn prepare(&mut self, local: LocalSpheres<'_>) -> Result<PreparedSearch, Error> {
        self.comm.take_sent();
        let rank = self.comm.rank();
        let species = self.config.interactions.as_ref().map(|table| table.species());
        self.comm.agree(local.check(rank, species))?;
        let owned = self.id_check.check(&mut self.comm, local)?;
        let particle = |k| local.particle(k);
        let ghosts = if owned.are_f64 || self.wrapper.needs_f64() {
            let leaving = self.leaving(self.wrapper.wrap_all_f64(local.spheres))?;
            Ghosts::exchange_f64(&mut self.comm, &leaving, particle, |k| local.row(k))?
        } else {
            let leaving = self.leaving(self.wrapper.wrap_all(local.particles()))?;
            Ghosts::exchange(&mut self.comm, &leaving, particle)?
        };
        Ok(PreparedSearch { owned: owned.of_ranks, ghosts })
    }

    /// Collective.
    fn leaving<T: Coordinate>(
        &mut self,
        wrapped: Result<Vec<WrappedSphere<T>>, lazygrid::Error>,
    ) -> Result<Vec<Vec<u32>>, Error> {
        let rank = self.comm.rank();
        let wrapped = self.comm.agree(wrapped.map_err(|error| Error::from_detector(rank, error)))?;
        let bounds = RankBounds::gather(&mut self.comm, &wrapped)?;
        let leaving = self.pool.install(|| bounds.ghosts(rank, &wrapped, &self.wrapper));
        self.comm.agree(leaving.map_err(|error| Error::from_detector(rank, error)))
    }

    fn search(
        &mut self,
        local: LocalSpheres<'_>,
        ghosts: &Ghosts,
        mut consume: impl FnMut(&[GlobalPair]) -> ControlFlow<()> + Send,
    ) -> Result<PairCounts, Error> {
        let rank = self.comm.rank();
        let owned = |k: u32| SphereRef { id: local.ids[k as usize], rank, index: k };
        let other = |kind: PairKind, k: u32| match kind {
            PairKind::Local => owned(k),
            PairKind::WithGhost => {
                let ghost = &ghosts.particles()[k as usize];
                SphereRef { id: ghost.id, rank: ghosts.rank_of(k), index: ghost.index }
            }
        };
        let search = &mut self.search;
        let mut pairs = Vec::new();
        let found = self.pool.install(|| {
            search.run(local.spheres, ghosts, |kind, found| {
                pairs.clear();
                pairs.extend(found.iter().map(|&[i, j]| GlobalPair::new(owned(i), other(kind, j))));
                consume(&pairs)
            })
        });
        found.map_err(|error| Error::from_detector(rank, error))
    }

    fn update_report(&mut self, prepared: PreparedSearch, counts: PairCounts) -> Result<(), Error> {
        let ghosts = prepared.ghosts.particles().len() as u64;
        let (all_counts, _) =
            self.comm.all_gather("counts", &[[ghosts, counts.reported(), counts.elsewhere]])?;
        let each = |k: usize| all_counts.iter().map(|row| row[k]).collect::<Vec<_>>();
        self.report = Report {
            owned: LoadBalance::from_counts(&prepared.owned),
            ghosts: LoadBalance::from_counts(&each(0)),
            pairs: LoadBalance::from_counts(&each(1)),
            elsewhere: each(2).iter().sum(),
            sent: self.comm.take_sent(),
            detector: self.search.detector().report().reason,
        };
        Ok(())
    }
}

struct List {
    pairs: Vec<GlobalPair>,
    limit: u64,
    refused: Option<u64>,
}

impl List {
    fn add(&mut self, pairs: &[GlobalPair]) {
        let total = (self.pairs.len() + pairs.len()) as u64;
        if self.refused.is_some() || total > self.limit {
            return;
        }
        match self.pairs.try_reserve(pairs.len()) {
            Ok(()) => self.pairs.extend_from_slice(pairs),
            Err(_) => self.refused = Some(total * size_of::<GlobalPair>() as u64),
        }
    }

    fn check(&self, rank: u32, found: u64) -> Result<(), Error> {
        match self.refused {
            _ if found > self.limit => Err(Error::TooManyPairs { rank, found, limit: self.limit }),
            Some(bytes) => Err(Error::OutOfMemory { rank, what: "pairs".to_owned(), bytes }),
            None => Ok(()),
        }
    }
}

fn send_to_ranks(comm: &mut MpiCommunicator, pairs: &[GlobalPair]) -> Result<Vec<GlobalPair>, Error> {
    let rank = comm.rank();
    let other = |pair: &GlobalPair| if pair.a.rank == rank { pair.b.rank } else { pair.a.rank };
    let send = || pairs.iter().map(|pair| (other(pair), *pair)).filter(|&(to, _)| to != rank);
    let reserved = try_reserved("pairs for their other owner", send().count() as u64, rank);
    let mut all = comm.agree(reserved)?;
    all.extend(send());
    lazygrid_ranks::send_to_ranks(comm, "pairs for their other owner", all).map(|(came, _)| came)
}

fn search(
    config: &Config,
    node: NodeRank,
    wrapper: SphereWrapper,
    [rank, ranks]: [u32; 2],
) -> Result<Search, String> {
    let ours = |detector: lazygrid::Config| {
        detector.space(config.space).interactions(config.interactions.clone()).order(Order::Unordered)
    };
    let detector = node.device(config.backend).apply_to(ours(config.detector.clone()), config.backend);
    let made = Detector::new(detector);
    let search =
        made.and_then(|made| Search::new(made, ours(lazygrid::Config::default()), wrapper, rank, ranks));
    search.map_err(|error| error.to_string())
}
