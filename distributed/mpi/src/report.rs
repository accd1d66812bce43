use lazygrid_ranks::LoadBalance;

/// The report of the last call, on all ranks together unless a field says otherwise.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Report {
    /// The distribution of the spheres among ranks.
    pub owned: LoadBalance,
    /// The distribution of the ghosts: spheres that were sent to a rank for the search.
    pub ghosts: LoadBalance,
    /// The distribution of the pairs among the ranks that report them.
    pub pairs: LoadBalance,
    /// Pairs that were met and are reported by another rank.
    pub elsewhere: u64,
    /// Bytes that this rank sent during the call, including messages to all ranks.
    pub sent: u64,
    /// The report of this rank's detector.
    pub detector: String,
}
