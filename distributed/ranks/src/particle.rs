use bytemuck::{Pod, Zeroable};
use lazygrid::Sphere;

/// A sphere as it becomes_ghost between ranks, 32 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Particle {
    /// Centre and radius, in the caller's length unit.
    pub sphere: Sphere,
    /// Its name, unique among all ranks.
    pub id: u64,
    /// Its species; 0 if there are none.
    pub species: u32,
    /// Its place among the spheres of its owner.
    pub index: u32,
}
