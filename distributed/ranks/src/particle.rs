use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;

/// A sphere as sent between ranks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Particle {
    pub sphere: Sphere,
    /// Unique among all ranks.
    pub id: u64,
    /// 0 without interactions.
    pub species: u32,
    pub index: u32,
}
