use lazygrid::gpu::Access;
use lazygrid::gpu::Access::{Read, ReadWrite as Write, Uniform};
use lazygrid::gpu::wgsl;

/// Storage buffers per stage of a model with surfaces. Other models need eight, which every device has.
pub(super) const SURFACE_BUFFERS: u32 = 10;
pub(super) const WORKGROUP_SIZE: u32 = 256;

#[derive(Debug)]
pub(super) struct Kernel {
    pub(super) name: &'static str,
    /// Indexed by binding number in group 0.
    pub(super) bindings: &'static [(&'static str, Access)],
    source: &'static str,
}

macro_rules! kernels {
    ($($(#[$doc:meta])* $id:ident = $name:literal [$($access:ident $binding:literal),* $(,)?];)*) => {
        $($(#[$doc])* pub(super) static $id: Kernel = Kernel {
            name: $name,
            bindings: &[$(($binding, $access)),*],
            source: include_str!(concat!("shader/", $name, ".wgsl")),
        };)*
        #[cfg(test)]
        pub(super) static KERNELS: &[&Kernel] = &[$(&$id),*];
    };
}

kernels! {
    BURST_APPEND = "burst_append" [
        Uniform "burst", Write "control", Read "burst_spheres", Read "burst_tags", Write "spheres", Write "tags",
        Uniform "params",
    ];
    STEP_BEGIN = "step_begin" [Uniform "params", Write "control"];
    PARTICLES_MOVE = "particles_move" [
        Uniform "params", Uniform "trajectory", Write "control", Read "spheres", Write "tags", Write "moved",
        Write "species", Read "species_rows", Read "event_rows", Read "scene_rows",
    ];
    PARTICLES_MOVE_REFLECTING = "particles_move_reflecting" [
        Uniform "params", Uniform "trajectory", Write "control", Read "spheres", Write "tags", Write "moved",
        Write "species", Read "species_rows", Read "event_rows", Read "scene_rows", Write "claims", Write "receptors",
    ];
    COLLISIONS_BEGIN = "collisions_begin" [
        Uniform "params", Write "control", Read "spheres", Read "tags", Read "species_rows", Write "movers",
        Write "next_events", Write "window", Read "scene_rows",
    ];
    WINDOW_BEGIN = "window_begin" [Uniform "params", Write "control", Write "window"];
    WINDOW_SPHERES = "window_spheres" [
        Uniform "params", Write "window", Read "movers", Write "next_events", Write "inflated", Read "tags",
        Write "species",
    ];
    CANDIDATES_CHECK = "candidates_check" [Write "control", Write "window", Write "near_outcome"];
    NEIGHBORS_COUNT = "neighbors_count" [
        Uniform "params", Write "near_pairs", Read "movers", Read "tags", Read "reaction_rows", Write "window",
        Write "next_events",
    ];
    NEIGHBORS_RESERVE = "neighbors_reserve" [Write "control", Write "window", Write "next_events"];
    NEIGHBORS_LIST = "neighbors_list" [
        Read "near_pairs", Write "window", Write "next_events", Write "neighbors",
    ];
    COLLISIONS_PREDICT = "collisions_predict" [
        Uniform "params", Uniform "round", Write "window", Read "movers", Write "next_events", Read "neighbors",
    ];
    COLLISIONS_CHOOSE = "collisions_choose" [
        Uniform "params", Uniform "round", Write "control", Write "window", Read "movers", Write "next_events",
        Read "neighbors",
    ];
    COLLISIONS_APPLY = "collisions_apply" [
        Uniform "params", Uniform "round", Write "control", Write "window", Write "movers", Write "next_events",
    ];
    WINDOW_END = "window_end" [
        Uniform "params", Uniform "round", Write "control", Write "window", Write "movers",
    ];
    COLLISIONS_LAND = "collisions_land" [
        Uniform "params", Write "control", Write "window", Read "movers", Read "next_events", Write "moved",
    ];
    SEPARATION_PUSH = "separation_push" [
        Uniform "params", Uniform "round", Write "control", Read "pairs", Read "moved", Read "species", Read "tags",
        Write "claims", Read "reaction_rows", Write "pushes",
    ];
    SEPARATION_MOVE = "separation_move" [
        Uniform "params", Uniform "trajectory", Write "control", Write "moved", Read "species", Read "species_rows",
        Read "event_rows", Read "scene_rows", Write "pushes",
    ];
    RECEPTORS_RESET = "receptors_reset" [Write "receptors"];
    RECEPTORS_COUNT_BOUND = "receptors_count_bound" [Write "control", Read "spheres", Read "event_rows", Write "receptors"];
    RECEPTORS_SCAN_REQUESTS = "receptors_scan_requests" [Write "control", Write "receptors"];
    RECEPTORS_GROUP_REQUESTS = "receptors_group_requests" [
        Write "control", Read "event_rows", Write "claims", Write "receptors", Write "requesters",
    ];
    RECEPTORS_SELECT = "receptors_select" [
        Write "control", Read "tags", Read "event_rows", Write "claims", Write "receptors", Read "requesters", Write "moved",
    ];
    DETECTOR_CHECK = "detector_check" [Uniform "params", Write "control", Write "outcome"];
    REACTIONS_SAMPLE = "reactions_sample" [
        Uniform "params", Write "control", Read "pairs", Read "moved", Read "species", Read "tags", Read "reaction_rows",
        Write "candidates", Write "left",
    ];
    MATCHING_COMPACT = "matching_compact" [
        Uniform "round", Write "control", Read "candidates", Read "reaction_rows", Write "claims", Read "left",
        Write "left_next",
    ];
    MATCHING_PROPOSE = "matching_propose" [
        Uniform "round", Write "control", Read "candidates", Read "reaction_rows", Write "claims", Read "left_next",
    ];
    MATCHING_BREAK_TIES = "matching_break_ties" [
        Uniform "round", Write "control", Read "candidates", Read "reaction_rows", Write "claims", Read "left_next",
    ];
    MATCHING_APPLY = "matching_apply" [
        Uniform "params", Uniform "round", Write "control", Read "candidates", Read "reaction_rows", Write "claims",
        Read "left_next", Write "moved",
    ];
    MATCHING_FINISH = "matching_finish" [
        Uniform "params", Uniform "round", Write "control", Read "candidates", Read "reaction_rows", Write "claims",
        Read "left", Write "moved",
    ];
    SURVIVORS_COUNT = "survivors_count" [
        Uniform "output_order", Write "control", Read "order", Read "moved", Read "tags", Write "claims", Write "ids",
        Write "sums", Uniform "params", Write "events",
    ];
    SURVIVORS_SCAN = "survivors_scan" [Uniform "params", Write "control", Write "sums", Write "log"];
    SURVIVORS_PLACE = "survivors_place" [
        Uniform "output_order", Read "order", Read "moved", Read "species", Read "ids", Write "claims", Read "sums",
        Write "spheres", Write "tags", Uniform "params",
    ];
    PARTICLES_DISSOCIATE = "particles_dissociate" [
        Uniform "params", Write "control", Write "moved", Read "species", Read "tags", Write "claims",
        Read "dissociation_rows", Write "born", Write "born_keys0",
    ];
    BORN_SORT = "born_sort" [Write "control", Write "born_keys0", Write "born_keys1"];
    BORN_PLACE = "born_place" [
        Uniform "params", Write "control", Read "born", Read "born_keys0", Write "spheres", Write "tags",
        Write "events",
    ];
    RECEIVERS_COUNT = "receivers_count" [
        Uniform "params", Uniform "trajectory", Write "control", Read "spheres", Read "tags", Read "occupancy_rows",
        Read "scene_rows", Write "inside",
    ];
}

const SHARED: &[(&str, &str)] = &[
    ("absorbing_wall", include_str!("shader/shared/absorbing_wall.wgsl")),
    ("adsorption", include_str!("shader/shared/adsorption.wgsl")),
    ("apply_reaction", include_str!("shader/shared/apply_reaction.wgsl")),
    ("born", include_str!("shader/shared/born.wgsl")),
    ("boundary", include_str!("shader/shared/boundary.wgsl")),
    ("candidate", include_str!("shader/shared/candidate.wgsl")),
    ("chemotaxis", include_str!("shader/shared/chemotaxis.wgsl")),
    ("claims", include_str!("shader/shared/claims.wgsl")),
    ("collided", include_str!("shader/shared/collided.wgsl")),
    ("compaction", include_str!("shader/shared/compaction.wgsl")),
    ("control", include_str!("shader/shared/control.wgsl")),
    ("decay", include_str!("shader/shared/decay.wgsl")),
    ("erfcx", include_str!("shader/shared/erfcx.wgsl")),
    ("event", include_str!("shader/shared/event.wgsl")),
    ("event_rows", include_str!("shader/shared/event_rows.wgsl")),
    ("events", include_str!("shader/shared/events.wgsl")),
    ("first_passage", include_str!("shader/shared/first_passage.wgsl")),
    ("flow_field", include_str!("shader/shared/flow_field.wgsl")),
    ("gap", include_str!("shader/shared/gap.wgsl")),
    ("matching_stage", include_str!("shader/shared/matching_stage.wgsl")),
    ("membrane_spheres", include_str!("shader/shared/membrane_spheres.wgsl")),
    ("membranes", include_str!("shader/shared/membranes.wgsl")),
    ("mover", include_str!("shader/shared/mover.wgsl")),
    ("near", include_str!("shader/shared/near.wgsl")),
    ("no_membranes", include_str!("shader/shared/no_membranes.wgsl")),
    ("normal", include_str!("shader/shared/normal.wgsl")),
    ("output_order", include_str!("shader/shared/output_order.wgsl")),
    ("params", include_str!("shader/shared/params.wgsl")),
    ("particles_move", include_str!("shader/shared/particles_move.wgsl")),
    ("path", include_str!("shader/shared/path.wgsl")),
    ("hit", include_str!("shader/shared/hit.wgsl")),
    ("path_bridge", include_str!("shader/shared/path_bridge.wgsl")),
    ("path_hit", include_str!("shader/shared/path_hit.wgsl")),
    ("path_line", include_str!("shader/shared/path_line.wgsl")),
    ("philox", include_str!("shader/shared/philox.wgsl")),
    ("push", include_str!("shader/shared/push.wgsl")),
    ("receiver_cells", include_str!("shader/shared/receiver_cells.wgsl")),
    ("receptor", include_str!("shader/shared/receptor.wgsl")),
    ("reflection", include_str!("shader/shared/reflection.wgsl")),
    ("round", include_str!("shader/shared/round.wgsl")),
    ("running_sum", include_str!("shader/shared/running_sum.wgsl")),
    ("short_paths", include_str!("shader/shared/short_paths.wgsl")),
    ("surface_diffusion", include_str!("shader/shared/surface_diffusion.wgsl")),
    ("tag", include_str!("shader/shared/tag.wgsl")),
    ("unit_32", include_str!("shader/shared/unit_32.wgsl")),
    ("velocity", include_str!("shader/shared/velocity.wgsl")),
    ("velocity_index", include_str!("shader/shared/velocity_index.wgsl")),
    ("vessel", include_str!("shader/shared/vessel.wgsl")),
    ("wall", include_str!("shader/shared/wall.wgsl")),
    ("window", include_str!("shader/shared/window.wgsl")),
];

/// Features whose absence makes kernels faster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Variant {
    pub(super) has_membranes: bool,
    /// Drift may carry a particle past a receiver within a step.
    pub(super) has_long_paths: bool,
}

impl Kernel {
    pub(super) fn wgsl(&self, variant: Variant) -> String {
        expand(self.source, variant)
    }
}

pub(super) fn expand(source: &str, variant: Variant) -> String {
    wgsl::expand(source, SHARED, &|name| match name {
        "WITHOUT_MEMBRANES" => !variant.has_membranes,
        "WITHOUT_LONG_PATHS" => !variant.has_long_paths,
        _ => false,
    })
}

#[cfg(test)]
mod tests;
