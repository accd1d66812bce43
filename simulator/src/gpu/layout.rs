//! Rust twins of shader structures, which have the comments.

use bytemuck::{Pod, Zeroable};
use encase::ShaderType;
use glam::{UVec2, UVec3, Vec2, Vec3};

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct Params {
    pub(super) key: UVec2,
    pub(super) species: u32,
    pub(super) tallies: u32,
    pub(super) first_reaction: u32,
    pub(super) is_open: u32,
    pub(super) max_iterations: u32,
    pub(super) lists_pairs: u32,
    pub(super) max_requeries: u32,
    pub(super) has_velocity: u32,
    pub(super) logs_arrivals: u32,
    pub(super) time_step: f32,
    pub(super) axes: UVec3,
    pub(super) vessel_axis: u32,
    pub(super) low: Vec3,
    pub(super) vessel_radius: f32,
    pub(super) high: Vec3,
    pub(super) peak_flow: f32,
    pub(super) vessel_center: Vec3,
    pub(super) largest_radius: f32,
    pub(super) collides: u32,
    pub(super) is_elastic: u32,
    pub(super) flow_duration: f32,
    pub(super) field_at: u32,
    pub(super) field_origin: Vec3,
    pub(super) field_spacing: Vec3,
    pub(super) field_points: UVec3,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct ChemotaxisRow {
    pub(super) center: Vec3,
    /// 0 for species that follow no concentration.
    pub(super) profile: u32,
    pub(super) gradient: Vec3,
    pub(super) level: f32,
    pub(super) size: f32,
    pub(super) sensitivity: f32,
    pub(super) saturates: u32,
    pub(super) probability: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct SpeciesRow {
    pub(super) drift: Vec3,
    pub(super) length: f32,
    pub(super) diffusion: f32,
    pub(super) radius: f32,
    pub(super) events_begin: u32,
    pub(super) decays_begin: u32,
    pub(super) walls_begin: u32,
    pub(super) events_end: u32,
    pub(super) bend: f32,
    pub(super) search_distance: f32,
    pub(super) cell_lists: u32,
    pub(super) speed: f32,
    pub(super) thermal_speed: f32,
    pub(super) tumbles: u32,
    pub(super) tumble_threshold: u32,
    pub(super) decay_rate: f32,
    pub(super) dissociation_rate: f32,
    pub(super) dissociation_threshold: u32,
    pub(super) mobility: f32,
    pub(super) drifts_at_wall: u32,
    pub(super) membrane_planes: UVec2,
    pub(super) membrane_spheres: UVec2,
    pub(super) taxis: ChemotaxisRow,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct EventRow {
    pub(super) drift: Vec3,
    pub(super) radius: f32,
    pub(super) diffusion: f32,
    pub(super) kind: u32,
    pub(super) receiver: u32,
    pub(super) threshold: u32,
    pub(super) product: u32,
    pub(super) tally: u32,
    pub(super) length: f32,
    pub(super) scaled_reactivity: f32,
    pub(super) unbinding: f32,
    pub(super) cumulative_fraction: f32,
    pub(super) ligands_begin: u32,
    pub(super) ligands_end: u32,
    pub(super) receptor: u32,
    pub(super) occupied: u32,
    pub(super) concentration: f32,
}

impl EventRow {
    pub(super) const ABSORBING: u32 = 0;
    pub(super) const ENDPOINT: u32 = 1;
    pub(super) const REFLECTING: u32 = 2;
    pub(super) const PARTIAL: u32 = 3;
    pub(super) const PER_STEP: u32 = 4;
    pub(super) const RECEPTORS: u32 = 5;
    pub(super) const DECAY: u32 = 6;
    pub(super) const WALL: u32 = 7;
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct ReceiverRow {
    pub(super) center: Vec3,
    pub(super) displacement: Vec3,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct ReceiverCellsHeader {
    pub(super) low: Vec3,
    pub(super) cells_per_length: Vec3,
    pub(super) counts: UVec3,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct TrajectoryHeader {
    pub(super) first: u32,
    pub(super) stride: u32,
    pub(super) max_displacement: f32,
    pub(super) cells_at: u32,
    pub(super) cells: ReceiverCellsHeader,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ReceptorRow {
    pub(super) count: u32,
    pub(super) bound: u32,
    pub(super) requests: u32,
    pub(super) first: u32,
    pub(super) tally: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct OccupancyRow {
    pub(super) receiver: u32,
    pub(super) radius: f32,
    pub(super) first: u32,
    pub(super) species: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct ReactionRow {
    pub(super) reaction: u32,
    pub(super) next: u32,
    pub(super) next_shell: u32,
    pub(super) first: u32,
    pub(super) threshold: u32,
    pub(super) flags: u32,
    pub(super) products: UVec2,
    pub(super) radii: Vec2,
    pub(super) within: f32,
    pub(super) unbinding: f32,
    pub(super) first_fraction: f32,
    pub(super) first_product_fraction: f32,
    pub(super) speeds: Vec2,
    pub(super) thermal_speeds: Vec2,
    pub(super) product_speeds: Vec2,
    pub(super) product_thermal_speeds: Vec2,
    pub(super) dissociation_thresholds: UVec2,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
#[repr(C)]
pub(super) struct DissociationRow {
    pub(super) threshold: u32,
    pub(super) next: u32,
    pub(super) tally: u32,
    pub(super) is_within: u32,
    pub(super) unbinding: f32,
    pub(super) first_fraction: f32,
    pub(super) products: UVec2,
    pub(super) radii: Vec2,
    pub(super) product_speeds: Vec2,
    pub(super) product_thermal_speeds: Vec2,
    pub(super) speed: f32,
    pub(super) thermal_speed: f32,
}

impl ReactionRow {
    pub(super) const NARROWER: u32 = 4;
    pub(super) const APART: u32 = 8;
    pub(super) const REACTS: u32 = 16;
    pub(super) const DISSOCIATES: [u32; 2] = [32, 64];
    pub(super) const DRAWS_ORDER: u32 = 128;
}

pub(super) const NOTHING: u32 = u32::MAX;
/// Radius of a particle that is bound in row 0 of the table of events; -3 in row 1.
pub(super) const BOUND_RADIUS: f32 = -2.0;
/// Bit of a tag that marks a product that does not dissociate in the rest of the step.
pub(super) const SPARED: u32 = 1 << 31;
/// Maximum decays of a particle in a step.
pub(super) const MAX_DECAYS: u32 = 64;
/// Maximum reflecting spheres and images near a particle.
pub(super) const MAX_NEAR: u32 = 16;
/// Maximum requests for receptors of one type in a step.
pub(super) const MAX_REQUESTS: u32 = 1 << 20;
/// Maximum neighbors of a colliding particle.
pub(super) const MAX_NEIGHBORS: u32 = 50_000;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ControlHeader {
    pub(super) count: u32,
    pub(super) alive: u32,
    pub(super) incoming: u32,
    pub(super) halted: u32,
    pub(super) step: u32,
    pub(super) done: u32,
    pub(super) logged: u32,
    pub(super) removed: u32,
    pub(super) pairs: u32,
    pub(super) found: [u32; 2],
    pub(super) missing: [u32; 2],
    pub(super) near_surfaces: u32,
    pub(super) requests: u32,
    pub(super) left: [u32; 2],
    pub(super) capacity: u32,
    pub(super) max_births: u32,
    pub(super) max_events: u32,
    pub(super) speed_factor: u32,
    pub(super) next_id: u32,
    pub(super) born: u32,
    pub(super) events: u32,
    pub(super) committed_events: u32,
    pub(super) born_at: u32,
    pub(super) born_id: u32,
    pub(super) born_event: u32,
    pub(super) contacts: u32,
    pub(super) committed_contacts: u32,
}

impl ControlHeader {
    pub(super) const PAIR_OVERFLOW: u32 = 1;
    pub(super) const ENTRY_OVERFLOW: u32 = 2;
    pub(super) const ROUNDS_LEFT: u32 = 4;
    pub(super) const NOT_FINITE: u32 = 8;
    pub(super) const TOO_MANY_SURFACES: u32 = 16;
    pub(super) const TOO_MANY_REQUESTS: u32 = 32;
    pub(super) const TOO_MANY_REQUERIES: u32 = 64;
    pub(super) const UNFINISHED_SEARCH: u32 = 128;
    pub(super) const BIRTH_OVERFLOW: u32 = 256;
    pub(super) const PARTICLE_OVERFLOW: u32 = 512;
    pub(super) const OUT_OF_IDS: u32 = 1024;
    pub(super) const EVENT_OVERFLOW: u32 = 2048;
    pub(super) const CANDIDATE_OVERFLOW: u32 = 4096;
    pub(super) const WINDOW_ROUNDS_LEFT: u32 = 8192;
    pub(super) const WINDOWS_LEFT: u32 = 16384;
    pub(super) const TOO_FAST: u32 = 32768;
    pub(super) const TOO_MANY_NEIGHBORS: u32 = 65536;

    /// Reason of a halt, or 0: the lowest bit, independent of the order of threads.
    pub(super) fn reason(&self) -> u32 {
        self.halted & self.halted.wrapping_neg()
    }

    pub(super) fn missing(&self) -> u64 {
        match self.reason() {
            Self::TOO_MANY_SURFACES => self.near_surfaces.into(),
            Self::TOO_MANY_REQUESTS => self.requests.into(),
            _ => u64::from(self.missing[1]) << 32 | u64::from(self.missing[0]),
        }
    }
}

pub(super) const CANDIDATE_BYTES: u64 = 24;
pub(super) const CLAIM_BYTES: u64 = 32;
pub(super) const BORN_BYTES: u64 = 32;
pub(super) const EVENT_BYTES: u64 = 16;
pub(super) const MOVER_BYTES: u64 = 64;
pub(super) const NEXT_EVENT_BYTES: u64 = 28;
pub(super) const PUSH_BYTES: u64 = 28;
pub(super) const WINDOW_BYTES: u64 = 68;
