use bytemuck::{Pod, Zeroable};

/// A sphere of a pair, 16 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct SphereRef {
    /// Its id.
    pub id: u64,
    /// The rank that owns it.
    pub rank: u32,
    /// Its index among the spheres of that rank, from 0.
    pub index: u32,
}

/// Two overlapping spheres, the one with the smaller id first, 32 bytes. The derived order is that by ids.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct GlobalPair {
    /// The sphere with the smaller id.
    pub a: SphereRef,
    /// The other one.
    pub b: SphereRef,
}

impl GlobalPair {
    /// The pair of two spheres, in either order.
    #[inline]
    pub fn new(one: SphereRef, other: SphereRef) -> Self {
        if one.id <= other.id { Self { a: one, b: other } } else { Self { a: other, b: one } }
    }

    /// Both ids, the smaller one first.
    #[inline]
    pub fn ids(&self) -> [u64; 2] {
        [self.a.id, self.b.id]
    }
}
