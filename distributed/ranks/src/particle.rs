use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;

/// A sphere as sent between ranks, 32 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Particle {
    /// In the caller's length unit.
    pub sphere: Sphere,
    /// Unique among all ranks.
    pub id: u64,
    /// 0 without interactions.
    pub species: u32,
    /// Index on its owner.
    pub index: u32,
}
