use lazygrid_ranks::LoadBalance;

/// The last call, on all ranks.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Report {
    pub owned: LoadBalance,
    /// Spheres received for the search.
    pub ghosts: LoadBalance,
    pub pairs: LoadBalance,
    /// Pairs found here and reported by another rank.
    pub elsewhere: u64,
    /// Bytes that this rank sent.
    pub sent: u64,
    pub detector: String,
}
