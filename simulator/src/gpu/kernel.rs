use lazygrid::gpu::Access;
use lazygrid::gpu::Access::{Read, ReadWrite as Write, Uniform};
use lazygrid::gpu::wgsl;

/// Storage buffers per stage with surfaces. Other models need eight, which every device has.
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

macro_rules! shared {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("shader/shared/", $name, ".wgsl")))),*]
    };
}

const SHARED: &[(&str, &str)] = shared! {
    "absorbing_wall", "adsorption", "apply_reaction", "born", "boundary", "candidate", "chemotaxis", "claims",
    "collided", "compaction", "control", "decay", "erfcx", "event", "event_rows", "events", "first_passage",
    "flow_field", "gap", "hit", "matching_stage", "membrane_spheres", "membranes", "mover", "near",
    "no_membranes", "normal", "output_order", "params", "particles_move", "path", "path_bridge", "path_hit",
    "path_line", "philox", "push", "receiver_cells", "receptor", "reflection", "round", "running_sum",
    "short_paths", "surface_diffusion", "tag", "unit_32", "velocity", "velocity_index", "vessel", "wall",
    "window",
};

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
