use bytemuck::{Pod, Zeroable};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct SphereRef {
    pub id: u64,
    pub rank: u32,
    pub index: u32,
}

/// Two overlapping spheres, the smaller id first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct GlobalPair {
    pub a: SphereRef,
    pub b: SphereRef,
}

impl GlobalPair {
    #[inline]
    pub fn new(one: SphereRef, other: SphereRef) -> Self {
        if one.id <= other.id { Self { a: one, b: other } } else { Self { a: other, b: one } }
    }

    #[inline]
    pub fn ids(&self) -> [u64; 2] {
        [self.a.id, self.b.id]
    }
}
