use lazygrid_ranks::LoadBalance;

/// A report of the last call on all ranks, unless a field says otherwise.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Report {
    /// Distribution of the spheres.
    pub owned: LoadBalance,
    /// Distribution of the ghosts: spheres sent to a rank for the search.
    pub ghosts: LoadBalance,
    /// Reported pairs.
    pub pairs: LoadBalance,
    /// Pairs found here and reported by another rank.
    pub elsewhere: u64,
    /// Bytes that this rank sent.
    pub sent: u64,
    pub detector: String,
}
