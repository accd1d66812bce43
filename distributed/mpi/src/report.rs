use lazygrid_ranks::Census;

/// What the last call did, on all ranks together unless it says otherwise.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Report {
    /// How the spheres are shared among ranks.
    pub owned: Census,
    /// How the ghosts are: spheres that travelled to a rank for the search.
    pub ghosts: Census,
    /// How the pairs are that each rank reports.
    pub pairs: Census,
    /// Pairs that were met and are reported by another rank.
    pub elsewhere: u64,
    /// Bytes that this rank sent during the call, those of messages that everybody sends to everybody included.
    pub sent: u64,
    /// What the detector of this rank did, and why.
    pub detector: String,
}
