use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;

/// A sphere as it becomes_ghost between ranks, 32 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Particle {
    /// Center and radius, in the caller's length unit.
    pub sphere: Sphere,
    /// Id, unique among all ranks.
    pub id: u64,
    /// Species; 0 without interactions.
    pub species: u32,
    /// Index among the spheres of its owner.
    pub index: u32,
}
