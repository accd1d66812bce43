/// Capacities for (cell, sphere) entries by the binary digits of the sphere count. Each applies to calls of at least as
/// many digits.
#[derive(Clone, Copy, Debug)]
pub(super) struct EntryCapacity(pub(super) [u32; u32::BITS as usize + 1]);

impl EntryCapacity {
    pub(super) const NONE: Self = Self([0; u32::BITS as usize + 1]);

    pub(super) fn digits(spheres: u32) -> usize {
        (u32::BITS - spheres.leading_zeros()) as usize
    }

    pub(super) fn for_spheres(&self, spheres: u32) -> u32 {
        self.0[..=Self::digits(spheres)].iter().copied().max().unwrap_or_default()
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CapacitySnapshot {
    pub(super) entries: EntryCapacity,
    pub(super) pairs: u32,
    pub(super) deferred_parts: u32,
}
