use lazygrid::{Backend, Interactions, Order, Space};
use lazygrid_ranks::Settings;

use crate::Error;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Ownership {
    /// Spheres stay on the caller's ranks.
    #[default]
    Keep,
    /// [`rebalance`](crate::Distributed::rebalance) moves spheres to their domains, and rebuilds these if a rank has
    /// more than `bound` times the mean load.
    Balance {
        /// At least 1.
        bound: f64,
    },
}

impl Ownership {
    pub const BALANCE: Self = Self::Balance { bound: 1.2 };
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Delivery {
    /// Each pair to one owner of its spheres.
    #[default]
    Once,
    /// Each pair to every owner of its spheres.
    Owners,
}

/// Settings of a [`Distributed`](crate::Distributed). Backend, threads, `max_pairs` and `detector` may differ between
/// ranks.
#[derive(Clone, Debug)]
pub struct Config {
    pub(crate) detector: lazygrid::Config,
    pub(crate) backend: Backend,
    pub(crate) space: Space,
    pub(crate) interactions: Option<Interactions>,
    pub(crate) order: Order,
    pub(crate) threads: Option<usize>,
    pub(crate) ownership: Ownership,
    pub(crate) delivery: Delivery,
    pub(crate) max_pairs: u64,
    pub(crate) message_limit: u64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            detector: lazygrid::Config::default(),
            backend: Backend::Auto,
            space: Space::UNBOUNDED,
            interactions: None,
            order: Order::Canonical,
            threads: None,
            ownership: Ownership::Keep,
            delivery: Delivery::Once,
            max_pairs: 1 << 27,
            message_limit: 1 << 28,
        }
    }
}

impl Config {
    /// Default: [`Ownership::Keep`].
    pub fn ownership(mut self, ownership: Ownership) -> Self {
        self.ownership = ownership;
        self
    }

    /// Default: [`Delivery::Once`].
    pub fn delivery(mut self, delivery: Delivery) -> Self {
        self.delivery = delivery;
        self
    }

    /// Default: unbounded.
    pub fn space(mut self, space: Space) -> Self {
        self.space = space;
        self
    }

    /// Requires species of all spheres.
    pub fn interactions(mut self, interactions: Interactions) -> Self {
        self.interactions = Some(interactions);
        self
    }

    /// Order of a rank's list, by default by ids.
    pub fn order(mut self, order: Order) -> Self {
        self.order = order;
        self
    }

    /// Default: [`Backend::Auto`], by which the first ranks of a node use a hardware GPU each, the others the CPU.
    /// With [`Backend::Gpu`], ranks may share GPUs.
    pub fn backend(mut self, backend: Backend) -> Self {
        self.backend = backend;
        self
    }

    /// Default: the rank's share of the cores of its node.
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = Some(threads);
        self
    }

    /// Maximum pairs in a rank's list, 32 bytes each. Default: 2²⁷ (4 GiB). Counting and streaming have no limit.
    pub fn max_pairs(mut self, max_pairs: u64) -> Self {
        self.max_pairs = max_pairs;
        self
    }

    /// Maximum bytes of a message, from 64 per rank to 2³¹ − 1 (MPI's limit). Larger data take rounds. Default: 2²⁸.
    pub fn message_limit(mut self, bytes: u64) -> Self {
        self.message_limit = bytes;
        self
    }

    /// Other settings of the detector. This configuration overrides its space, interactions, order, backend and limits.
    pub fn detector(mut self, detector: lazygrid::Config) -> Self {
        self.detector = detector;
        self
    }

    pub(crate) fn shared(&self) -> Settings {
        let ownership = match self.ownership {
            Ownership::Keep => "keep".to_owned(),
            Ownership::Balance { bound } => format!("balance with the bound {bound}"),
        };
        let delivery = match self.delivery {
            Delivery::Once => "once",
            Delivery::Owners => "owners",
        };
        Settings::new(env!("CARGO_PKG_VERSION"))
            .with_space(&self.space)
            .with_interactions(self.interactions.as_ref())
            .with("ownership", ownership)
            .with("delivery", delivery)
            .with("order", format_args!("{:?}", self.order))
            .with("message_limit", self.message_limit)
    }

    pub(crate) fn check(&self, ranks: u32) -> Result<(), Error> {
        let refuse = |name: &str, value: String, range: String| {
            Err(Error::Setting { name: name.to_owned(), value, range })
        };
        // Two of the largest elements, for each rank.
        let least = 64 * u64::from(ranks);
        if !(least..=i32::MAX as u64).contains(&self.message_limit) {
            let range =
                format!("choose between {least} (64 for each of {ranks} ranks) and {} bytes", i32::MAX);
            return refuse("message_limit", self.message_limit.to_string(), range);
        }
        match self.ownership {
            Ownership::Balance { bound } if !(bound.is_finite() && bound >= 1.0) => {
                refuse("bound", bound.to_string(), "choose a finite number of at least 1".to_owned())
            }
            _ if self.threads == Some(0) => {
                refuse("threads", "0".to_owned(), "choose at least one, or leave it unset".to_owned())
            }
            _ => Ok(()),
        }
    }
}
