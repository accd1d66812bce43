use std::ops::ControlFlow;

use bytemuck::Pod;
use lazygrid::{Algorithm, Backend, Detector, Order};
use lazygrid_ranks::{
    Bodies, Body, Carrier, Census, Found, Ghosts, Migration, Parting, Published, Search, Tally, gather,
};
use mpi::traits::Communicator;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::identity::Identity;
use crate::node::{Node, Place};
use crate::settle::settle;
use crate::wire::Wire;
use crate::{Config, Delivery, End, Error, GlobalPair, Local, Ownership, Particles, Report, Settled};

/// Finds overlapping pairs among the spheres of all ranks of a communicator, call after call.
///
/// Every method but [`report`](Self::report) is collective: all ranks call it, in the same order. The answer is that of
/// one process with all the spheres, for any distribution of the spheres.
pub struct Distributed {
    wire: Wire,
    config: Config,
    bodies: Bodies,
    search: Search,
    pool: ThreadPool,
    identity: Identity,
    parting: Parting,
    pairs: Vec<GlobalPair>,
    report: Report,
}

/// The input of a search besides the spheres of this rank.
struct Prepared {
    owned: Vec<u64>,
    ghosts: Ghosts,
}

impl Distributed {
    /// For the ranks of this communicator, of which it makes itself a copy, so that messages do not mix. Collective.
    ///
    /// # Errors
    /// On all ranks alike: [`Error::Setting`] for a setting outside its range; [`Error::Settings`] if a setting is not the
    /// same on all ranks, of those that [`Config`] names; [`Error::Detection`] if the detector of a rank cannot be made.
    pub fn new(communicator: &impl Communicator, config: Config) -> Result<Self, Error> {
        let mut wire = Wire::new(communicator.duplicate(), config.message_limit);
        wire.agree(config.check(wire.ranks()))?;
        config.shared().agree(&mut wire)?;
        let node = Node::of(wire.comm());
        let made = detectors(&config, node);
        let threads = config.threads.unwrap_or_else(|| node.threads());
        let made = made.and_then(|detectors| Ok((detectors, pool(threads)?)));
        let rank = wire.rank();
        let ((detector, across), pool) =
            wire.agree(made.map_err(|message| Error::Detection { rank, message }))?;
        let bodies = Bodies::new(config.space, config.interactions.as_ref());
        let search = Search::new(detector, across, bodies.clone(), (rank, wire.ranks()));
        let (identity, report) = (Identity::default(), Report::default());
        Ok(Self {
            wire,
            config,
            bodies,
            search,
            pool,
            identity,
            parting: Parting::default(),
            pairs: Vec::new(),
            report,
        })
    }

    /// Moves the spheres of all ranks to the ranks whose parts of space they are in, where the
    /// [ownership](Config::ownership) is [`Balance`](Ownership::Balance); checks them only, where it is
    /// [`Keep`](Ownership::Keep). Searches give the same pairs with or without it.
    ///
    /// Afterwards a rank has what came from rank 0, then what came from rank 1 and so on, its own in its place among them,
    /// each in the order it had there.
    ///
    /// # Errors
    /// [`Error::Input`] and [`Error::OutOfMemory`]; the spheres are then where they were.
    pub fn settle(&mut self, particles: &mut Particles) -> Result<Settled, Error> {
        let bound = match self.config.ownership {
            Ownership::Balance { bound } => bound,
            Ownership::Keep => return self.keep(particles),
        };
        settle(&mut self.wire, &mut self.parting, (&self.bodies, bound), particles)
    }

    fn keep(&mut self, particles: &Particles) -> Result<Settled, Error> {
        let rank = self.wire.rank();
        let refuse =
            |error: lazygrid::InputError| Error::Input { rank, index: None, message: error.to_string() };
        let checked = particles.local().map_err(refuse).and_then(|local| local.check(rank, None));
        self.wire.agree(checked)?;
        let spheres = particles.ids.len();
        let (counts, _) = self.wire.share("counts", &[spheres as u64])?;
        let migration = Migration::none(spheres, (rank, self.wire.ranks()));
        Ok(Settled { owned: Census::of(&counts), moved: 0, rebuilt: false, migration })
    }

    /// Brings something else that belongs to the spheres, one element per sphere as it was before, to where a
    /// [`settle`](Self::settle) moved them. The result is in the order of the spheres as they are now.
    ///
    /// # Errors
    /// [`Error::Input`] where a rank has not one element per sphere; [`Error::OutOfMemory`].
    pub fn follow<T: Pod>(&mut self, migration: &Migration, column: &[T]) -> Result<Vec<T>, Error> {
        let (rank, length, expected) = (self.wire.rank(), column.len(), migration.spheres());
        let lengths = lazygrid::InputError::Lengths { what: "column", length, expected };
        let checked = if length == expected {
            Ok(())
        } else {
            Err(Error::Input { rank, index: None, message: lengths.to_string() })
        };
        self.wire.agree(checked)?;
        migration.carry(&mut self.wire, "what follows the spheres", |k| column[k as usize])
    }

    /// Brings elements of all ranks to rank 0, those of rank 0 first, then those of rank 1 and so on. The others get none.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] where rank 0 has no room for all.
    pub fn gather<T: Pod>(&mut self, elements: &[T]) -> Result<Vec<T>, Error> {
        gather(&mut self.wire, "what is gathered", elements)
    }

    /// The overlapping pairs that this rank reports, in the order that was asked for. Each pair of all ranks is in the list of
    /// exactly one, or with [`Delivery::Owners`] in that of each rank that owns one of its spheres. The slice lives until the
    /// next call.
    ///
    /// # Errors
    /// [`Error::Input`] for spheres that are not finite, negative radii, unknown species or lengths that differ;
    /// [`Error::DuplicateId`]; [`Error::TooManyPairs`] for more than [`Config::max_pairs`] on a rank;
    /// [`Error::OutOfMemory`]; [`Error::Detection`].
    pub fn pairs(&mut self, local: Local<'_>) -> Result<&[GlobalPair], Error> {
        let prepared = self.prepare(local)?;
        let mut list =
            List { pairs: std::mem::take(&mut self.pairs), limit: self.config.max_pairs, refused: None };
        list.pairs.clear();
        let found = self.search(local, &prepared.ghosts, |pairs| {
            list.add(pairs);
            ControlFlow::Continue(())
        });
        let rank = self.wire.rank();
        let found = found.and_then(|tally| list.check(rank, tally.reported()).map(|()| tally));
        let tally = self.wire.agree(found)?;
        if self.config.delivery == Delivery::Owners {
            let came = deliver(&mut self.wire, &list.pairs)?;
            list.pairs.extend(came);
        }
        if self.config.order == Order::Canonical {
            self.pool.install(|| rayon::slice::ParallelSliceMut::par_sort_unstable(&mut list.pairs[..]));
        }
        self.pairs = list.pairs;
        self.tell(prepared, tally)?;
        Ok(&self.pairs)
    }

    /// Counts the pairs on all ranks together.
    ///
    /// # Errors
    /// The same as [`pairs`](Self::pairs), except [`Error::TooManyPairs`]: any number can be counted.
    pub fn count(&mut self, local: Local<'_>) -> Result<u64, Error> {
        let prepared = self.prepare(local)?;
        let search = &mut self.search;
        let found = self.pool.install(|| search.count(local.spheres, &prepared.ghosts));
        let rank = self.wire.rank();
        let tally = self.wire.agree(found.map_err(|error| failed(rank, error)))?;
        self.tell(prepared, tally)?;
        Ok(self.report.pairs.total)
    }

    /// Hands the pairs that this rank reports to `consume`, in chunks of at most `chunk` pairs and in any order, each pair of
    /// all ranks on one of them. Returns how many pairs all ranks have. `consume` may stop the search of its rank, whose
    /// further pairs are then not counted.
    ///
    /// # Errors
    /// The same as [`count`](Self::count).
    pub fn stream<F>(&mut self, local: Local<'_>, chunk: usize, mut consume: F) -> Result<u64, Error>
    where
        F: FnMut(&[GlobalPair]) -> ControlFlow<()> + Send,
    {
        let prepared = self.prepare(local)?;
        let found = self
            .search(local, &prepared.ghosts, |pairs| pairs.chunks(chunk.max(1)).try_for_each(&mut consume));
        let tally = self.wire.agree(found)?;
        self.tell(prepared, tally)?;
        Ok(self.report.pairs.total)
    }

    /// The report of the last call; the same on all ranks, except for the fields of this rank.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Sends ghosts to where they are needed.
    fn prepare(&mut self, local: Local<'_>) -> Result<Prepared, Error> {
        self.wire.take_sent();
        let (rank, ranks) = (self.wire.rank(), self.wire.ranks());
        let species = self.config.interactions.as_ref().map(|table| table.species());
        self.wire.agree(local.check(rank, species))?;
        let owned = self.identity.check(&mut self.wire, local)?;
        let of = |k: u32| {
            let particle = local.particle(k);
            self.bodies.body(particle.sphere, particle.species)
        };
        let bodies: Vec<Body> = (0..local.ids.len() as u32).map(of).collect();
        let published = Published::by(&mut self.wire, &bodies)?;
        let leaving = self.pool.install(|| published.ghosts(rank, &bodies, &self.bodies.space()));
        drop(bodies);
        debug_assert_eq!(leaving.len(), ranks as usize);
        let ghosts = Ghosts::trade(&mut self.wire, &leaving, |k| local.particle(k))?;
        Ok(Prepared { owned, ghosts })
    }

    /// Searches on this rank; not collective.
    fn search(
        &mut self,
        local: Local<'_>,
        ghosts: &Ghosts,
        mut consume: impl FnMut(&[GlobalPair]) -> ControlFlow<()> + Send,
    ) -> Result<Tally, Error> {
        let rank = self.wire.rank();
        let own = |k: u32| End { id: local.ids[k as usize], rank, index: k };
        let other = |found: Found, k: u32| match found {
            Found::Within => own(k),
            Found::Across => {
                let ghost = &ghosts.particles()[k as usize];
                End { id: ghost.id, rank: ghosts.rank_of(k), index: ghost.index }
            }
        };
        let search = &mut self.search;
        let mut pairs = Vec::new();
        let found = self.pool.install(|| {
            search.run(local.spheres, ghosts, |found, places| {
                pairs.clear();
                pairs.extend(places.iter().map(|&[i, j]| GlobalPair::new(own(i), other(found, j))));
                consume(&pairs)
            })
        });
        found.map_err(|error| failed(rank, error))
    }

    /// Makes the report of a call.
    fn tell(&mut self, prepared: Prepared, tally: Tally) -> Result<(), Error> {
        let ghosts = prepared.ghosts.particles().len() as u64;
        let (told, _) = self.wire.share("counts", &[[ghosts, tally.reported(), tally.elsewhere]])?;
        let each = |k: usize| told.iter().map(|of| of[k]).collect::<Vec<_>>();
        self.report = Report {
            owned: Census::of(&prepared.owned),
            ghosts: Census::of(&each(0)),
            pairs: Census::of(&each(1)),
            elsewhere: each(2).iter().sum(),
            sent: self.wire.take_sent(),
            detector: self.search.detector().report().reason,
        };
        Ok(())
    }
}

/// A list that keeps to its limit, and counts on.
struct List {
    pairs: Vec<GlobalPair>,
    limit: u64,
    /// The bytes that were refused.
    refused: Option<u64>,
}

impl List {
    fn add(&mut self, pairs: &[GlobalPair]) {
        let room = (self.pairs.len() + pairs.len()) as u64;
        if self.refused.is_some() || room > self.limit {
            return;
        }
        match self.pairs.try_reserve(pairs.len()) {
            Ok(()) => self.pairs.extend_from_slice(pairs),
            Err(_) => self.refused = Some(room * size_of::<GlobalPair>() as u64),
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

/// Pairs that other ranks report and whose other sphere is of this rank.
fn deliver(wire: &mut Wire, pairs: &[GlobalPair]) -> Result<Vec<GlobalPair>, Error> {
    let rank = wire.rank();
    let other = |pair: &GlobalPair| if pair.a.rank == rank { pair.b.rank } else { pair.a.rank };
    let send = pairs.iter().map(|pair| (other(pair), *pair)).filter(|&(to, _)| to != rank).collect();
    lazygrid_ranks::deliver(wire, "pairs for their other owner", send).map(|(came, _)| came)
}

/// The report of a rank's detector.
fn failed(rank: u32, error: lazygrid::Error) -> Error {
    match error {
        lazygrid::Error::OutOfMemory { what, bytes } => {
            Error::OutOfMemory { rank, what: what.to_owned(), bytes }
        }
        error => Error::Detection { rank, message: error.to_string() },
    }
}

/// The detector of this rank, and one for pairs of owned spheres and ghosts where it has none of these.
fn detectors(config: &Config, node: Node) -> Result<(Detector, Option<Detector>), String> {
    let ours = |detector: lazygrid::Config| {
        detector.space(config.space).interactions(config.interactions.clone()).order(Order::Unordered)
    };
    let detector = ours(config.detector.clone()).backend(config.backend);
    let detector = match node.place(config.backend) {
        Place::Asked => detector,
        Place::Cpu => detector.backend(Backend::Cpu),
        #[cfg(feature = "gpu")]
        Place::Gpu(index) => detector.adapter(index),
        #[cfg(not(feature = "gpu"))]
        Place::Gpu(_) => detector,
    };
    let made = Detector::new(detector).map_err(|error| error.to_string())?;
    let report = made.report();
    let of_two = matches!(report.algorithm, Algorithm::Auto | Algorithm::CellList | Algorithm::Naive);
    if report.backend == Backend::Cpu && of_two {
        return Ok((made, None));
    }
    // Ghosts are few, and a GPU would be given all owned spheres once more for them. The paper's grids have one set.
    let across = Detector::new(ours(lazygrid::Config::default()).backend(Backend::Cpu));
    Ok((made, Some(across.map_err(|error| error.to_string())?)))
}

/// The threads of this rank.
fn pool(threads: usize) -> Result<ThreadPool, String> {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| format!("could not start {threads} threads: {error}; ask for fewer"))
}
