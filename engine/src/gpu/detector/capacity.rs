//! The capacities that calls were found to need.

/// Entries there is to be room for at least, by the binary digits of the spheres of the call that needed them: in
/// calls of as many digits or more.
#[derive(Clone, Copy, Debug)]
pub(super) struct EntryCapacity(pub(super) [u32; u32::BITS as usize + 1]);

impl EntryCapacity {
    pub(super) const NONE: Self = Self([0; u32::BITS as usize + 1]);

    pub(super) fn digits(spheres: u32) -> usize {
        (u32::BITS - spheres.leading_zeros()) as usize
    }

    pub(super) fn of(&self, spheres: u32) -> u32 {
        self.0[..=Self::digits(spheres)].iter().copied().max().unwrap_or_default()
    }
}

/// What was raised for calls that needed more, to be restored where the device has not so much.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CapacitySnapshot {
    pub(super) entries: EntryCapacity,
    pub(super) pairs: u32,
}
