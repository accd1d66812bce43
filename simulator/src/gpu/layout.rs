//! Rust twins of the structures in the shaders. A test holds sizes and offsets against them.
//!
//! Structures that are written lie in buffers as WGSL says (`ShaderType`). `repr(C)` keeps their members in order, by which
//! the test tells them apart. [`Head`] is read back as the bytes that it is: words alone are the same on both sides.

use bytemuck::{Pod, Zeroable};
use encase::ShaderType;
use glam::{UVec2, UVec3, Vec2, Vec3};

/// The constants of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Params {
    pub(super) key: UVec2,
    pub(super) species: u32,
    /// The number of tallies of a step.
    pub(super) tallies: u32,
    /// The first tally of reactions.
    pub(super) first_reaction: u32,
    pub(super) is_open: u32,
    /// The most loop turns of the last rounds of a matching.
    pub(super) turns: u32,
    /// `true` if pairs are listed, and not only counted.
    pub(super) lists_pairs: u32,
    /// The most searches for surfaces per particle and step.
    pub(super) looks: u32,
    /// The boundary of each axis: 0 open, 1 reflecting, 2 periodic.
    pub(super) axes: UVec3,
    pub(super) low: Vec3,
    pub(super) high: Vec3,
}

/// The step of one species.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Kind {
    pub(super) drift: Vec3,
    pub(super) length: f32,
    pub(super) diffusion: f32,
    pub(super) radius: f32,
    pub(super) fates_begin: u32,
    pub(super) decays_begin: u32,
    pub(super) fates_end: u32,
    pub(super) bend: f32,
    /// Receivers within this distance are listed.
    pub(super) reach: f32,
    /// Its place among the species for which receivers are listed, or [`NOTHING`].
    pub(super) lists: u32,
}

/// The possible events of a particle of one species.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Fate {
    pub(super) drift: Vec3,
    pub(super) radius: f32,
    pub(super) diffusion: f32,
    pub(super) kind: u32,
    pub(super) receiver: u32,
    pub(super) up_to: u32,
    pub(super) product: u32,
    pub(super) tally: u32,
    pub(super) length: f32,
    pub(super) own: f32,
    pub(super) unbinding: f32,
}

impl Fate {
    pub(super) const ABSORBING: u32 = 0;
    pub(super) const ENDPOINT: u32 = 1;
    pub(super) const REFLECTING: u32 = 2;
    pub(super) const PARTIAL: u32 = 3;
    pub(super) const PER_STEP: u32 = 4;
    pub(super) const RECEPTORS: u32 = 5;
    pub(super) const DECAY: u32 = 6;
}

/// The position of a receiver at the beginning of a step, and its displacement in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Body {
    pub(super) center: Vec3,
    pub(super) way: Vec3,
}

/// The cells by which receivers are listed; none if there are no lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Lists {
    pub(super) low: Vec3,
    pub(super) per_edge: Vec3,
    pub(super) cells: UVec3,
}

/// The steps for which it is known where receivers are.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Journey {
    pub(super) first: u32,
    pub(super) stride: u32,
    pub(super) longest: f32,
    /// The first row, of 16 bytes, of the lists of receivers.
    pub(super) lists_at: u32,
    pub(super) lists: Lists,
}

/// The receptors of a receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct ReceptorRow {
    pub(super) count: u32,
    pub(super) held: u32,
    pub(super) bids: u32,
    pub(super) first: u32,
}

/// A species in a transparent receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Watch {
    pub(super) receiver: u32,
    pub(super) radius: f32,
    pub(super) first: u32,
    pub(super) species: u32,
}

/// A reaction between two species, as an entry of the table by both.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Rule {
    pub(super) reaction: u32,
    /// The species that is the first reactant, or [`NOTHING`].
    pub(super) first: u32,
    pub(super) up_to: u32,
    pub(super) flags: u32,
    pub(super) products: UVec2,
    pub(super) radii: Vec2,
    pub(super) within: f32,
    pub(super) unbinding: f32,
    pub(super) share: f32,
    pub(super) first_share: f32,
}

impl Rule {
    /// The detector looks further than `within`.
    pub(super) const NARROWER: u32 = 4;
    /// Products go apart.
    pub(super) const APART: u32 = 8;
}

/// No species.
pub(super) const NOTHING: u32 = u32::MAX;

/// The head of the control buffer, before the tallies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Head {
    pub(super) count: u32,
    pub(super) alive: u32,
    pub(super) incoming: u32,
    pub(super) frozen: u32,
    pub(super) step: u32,
    pub(super) done: u32,
    pub(super) logged: u32,
    pub(super) gone: u32,
    pub(super) pairs: u32,
    pub(super) found: [u32; 2],
    pub(super) lacking: [u32; 2],
    pub(super) left: [u32; 2],
}

impl Head {
    pub(super) const NO_ROOM_FOR_PAIRS: u32 = 1;
    pub(super) const NO_ROOM_FOR_ENTRIES: u32 = 2;
    pub(super) const ROUNDS_LEFT: u32 = 4;
    pub(super) const NOT_FINITE: u32 = 8;
    pub(super) const TOO_MANY_NEAR: u32 = 16;
    pub(super) const TOO_MANY_BIDS: u32 = 32;
    pub(super) const THROWN_TOO_FAR: u32 = 64;

    /// The capacity that the device lacks.
    pub(super) fn lacking(&self) -> u64 {
        u64::from(self.lacking[1]) << 32 | u64::from(self.lacking[0])
    }
}

/// Bytes of a candidate pair.
pub(super) const CANDIDATE_BYTES: u64 = 24;
/// Bytes of what a particle is claimed for.
pub(super) const CLAIM_BYTES: u64 = 32;
