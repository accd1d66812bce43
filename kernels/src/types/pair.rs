use bytemuck::{Pod, Zeroable};

/// An overlapping pair of input indices, `i < j`. For two sets, `i` is in the first and `j` in the second. Full
/// neighbor lists contain both orders.
///
/// The derived ordering (by `i`, then `j`) is the canonical order of results. The layout is `[u32; 2]`
/// (`bytemuck::cast_slice`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct Pair {
    /// First index.
    pub i: u32,
    /// Second index.
    pub j: u32,
}

impl Pair {
    /// Creates the pair of two different indices of one set, in either order.
    #[inline]
    pub fn new(a: u32, b: u32) -> Self {
        debug_assert_ne!(a, b, "a sphere does not pair with itself");
        Self { i: a.min(b), j: a.max(b) }
    }
}
