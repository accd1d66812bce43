//! The kernels: their WGSL and bindings. No function calls a device.

use lazygrid::gpu::Access;
use lazygrid::gpu::Access::{Read, ReadWrite as Write, Uniform};
use lazygrid::gpu::wgsl;

/// Storage buffers per stage of a model with surfaces. Other models need eight, which every device has.
pub(super) const SURFACE_BUFFERS: u32 = 10;
pub(super) const WORKGROUP_SIZE: u32 = 256;

#[derive(Debug)]
pub(super) struct Kernel {
    pub(super) name: &'static str,
    /// Names and accesses; the index is the binding number in group 0.
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
    /// Begins a step.
    STEP_BEGIN = "step_begin" [Uniform "params", Write "control"];
    PARTICLES_MOVE = "particles_move" [
        Uniform "params", Uniform "trajectory", Write "control", Read "spheres", Read "tags", Write "moved",
        Write "species", Read "species_rows", Read "event_rows", Read "receiver_rows",
    ];
    /// Moves particles among surfaces that reflect or adsorb.
    PARTICLES_MOVE_REFLECTING = "particles_move_reflecting" [
        Uniform "params", Uniform "trajectory", Write "control", Read "spheres", Read "tags", Write "moved",
        Write "species", Read "species_rows", Read "event_rows", Read "receiver_rows", Write "claims", Write "receptors",
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
    /// Takes over the detector's result, or halts the run.
    DETECTOR_CHECK = "detector_check" [Uniform "params", Write "control", Write "outcome"];
    REACTIONS_SAMPLE = "reactions_sample" [
        Uniform "params", Write "control", Read "pairs", Read "moved", Read "species", Read "tags", Read "reaction_rows",
        Write "candidates", Write "left",
    ];
    MATCHING_COMPACT = "matching_compact" [
        Uniform "round", Write "control", Read "candidates", Read "reaction_rows", Write "claims", Read "left",
        Write "left_next",
    ];
    /// Records the best priority at each particle.
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
    /// Scans these counts and commits the step.
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
        Read "receiver_rows", Write "inside",
    ];
}

const SHARED: &[(&str, &str)] = &[
    ("adsorption", include_str!("shader/shared/adsorption.wgsl")),
    ("apply_reaction", include_str!("shader/shared/apply_reaction.wgsl")),
    ("born", include_str!("shader/shared/born.wgsl")),
    ("boundary", include_str!("shader/shared/boundary.wgsl")),
    ("candidate", include_str!("shader/shared/candidate.wgsl")),
    ("claims", include_str!("shader/shared/claims.wgsl")),
    ("compaction", include_str!("shader/shared/compaction.wgsl")),
    ("control", include_str!("shader/shared/control.wgsl")),
    ("decay", include_str!("shader/shared/decay.wgsl")),
    ("event", include_str!("shader/shared/event.wgsl")),
    ("event_rows", include_str!("shader/shared/event_rows.wgsl")),
    ("first_passage", include_str!("shader/shared/first_passage.wgsl")),
    ("matching_stage", include_str!("shader/shared/matching_stage.wgsl")),
    ("normal", include_str!("shader/shared/normal.wgsl")),
    ("output_order", include_str!("shader/shared/output_order.wgsl")),
    ("params", include_str!("shader/shared/params.wgsl")),
    ("particles_move", include_str!("shader/shared/particles_move.wgsl")),
    ("path_hit", include_str!("shader/shared/path_hit.wgsl")),
    ("philox", include_str!("shader/shared/philox.wgsl")),
    ("receiver_cells", include_str!("shader/shared/receiver_cells.wgsl")),
    ("receptor", include_str!("shader/shared/receptor.wgsl")),
    ("reflection", include_str!("shader/shared/reflection.wgsl")),
    ("round", include_str!("shader/shared/round.wgsl")),
    ("running_sum", include_str!("shader/shared/running_sum.wgsl")),
    ("unit_32", include_str!("shader/shared/unit_32.wgsl")),
    ("velocity", include_str!("shader/shared/velocity.wgsl")),
    ("velocity_index", include_str!("shader/shared/velocity_index.wgsl")),
    ("vessel", include_str!("shader/shared/vessel.wgsl")),
    ("wall", include_str!("shader/shared/wall.wgsl")),
];

impl Kernel {
    /// Returns the complete text.
    pub(super) fn wgsl(&self) -> String {
        expand(self.source)
    }
}

pub(super) fn expand(source: &str) -> String {
    wgsl::expand(source, SHARED, &|_| false)
}

#[cfg(test)]
#[path = "../../../tests/src/reflection.rs"]
mod reflection;

#[cfg(test)]
mod tests {
    use std::mem::size_of;

    use encase::ShaderType;

    use super::reflection::{bindings, laid_out, layout, parse, spirv, structures};

    use super::super::layout::{
        BORN_BYTES, CANDIDATE_BYTES, CLAIM_BYTES, ControlHeader, DissociationRow, EventRow, OccupancyRow,
        Params, ReactionRow, ReceiverCellsHeader, ReceiverRow, SpeciesRow, TrajectoryHeader,
    };
    use super::*;

    #[test]
    fn metadata_matches_every_shader() {
        for kernel in KERNELS {
            let (module, info) = parse(kernel.name, &kernel.wgsl());
            assert_eq!(module.entry_points.len(), 1, "{}", kernel.name);
            assert_eq!(module.entry_points[0].name, kernel.name);
            assert!(!spirv(kernel.name, (&module, &info)).is_empty());
            let said: Vec<_> =
                (0..).zip(kernel.bindings).map(|(k, &(name, access))| (k, name.to_owned(), access)).collect();
            assert_eq!(bindings(kernel.name, &module), said, "{}", kernel.name);
            let storage = kernel.bindings.iter().filter(|(_, access)| *access != Uniform).count();
            // Models with surfaces are refused on devices with fewer bindings.
            let most =
                if kernel.name == PARTICLES_MOVE_REFLECTING.name { SURFACE_BUFFERS as usize } else { 8 };
            assert!(storage <= most, "{} binds {storage} storage buffers", kernel.name);
        }
    }

    #[test]
    fn rust_structures_have_the_layout_of_the_shaders() {
        let layouts = [
            layout!(Params {
                key,
                species,
                tallies,
                first_reaction,
                is_open,
                max_iterations,
                lists_pairs,
                max_requeries,
                has_velocity,
                logs_arrivals,
                time_step,
                axes,
                vessel_axis,
                low,
                vessel_radius,
                high,
                peak_flow,
                vessel_center
            }),
            layout!(SpeciesRow {
                drift,
                length,
                diffusion,
                radius,
                events_begin,
                decays_begin,
                events_end,
                bend,
                reach,
                cell_lists,
                speed,
                thermal_speed,
                tumbles,
                tumble_threshold,
                decay_rate
            }),
            layout!(ReceiverCellsHeader { low, cells_per_length, counts }),
            layout!(EventRow {
                drift,
                radius,
                diffusion,
                kind,
                receiver,
                threshold,
                product,
                tally,
                length,
                own,
                unbinding,
                share
            }),
            layout!(ReceiverRow { center, displacement }),
            layout!(TrajectoryHeader { first, stride, max_displacement, cells_at, cells }),
            layout!(OccupancyRow { receiver, radius, first, species }),
            layout!(ReactionRow {
                reaction,
                next,
                next_shell,
                first,
                threshold,
                flags,
                products,
                radii,
                within,
                unbinding,
                share,
                first_share,
                speeds,
                product_speeds,
                thermal_speeds
            }),
            layout!(DissociationRow {
                threshold,
                next,
                tally,
                is_within,
                unbinding,
                share,
                products,
                radii,
                speed,
                product_speed,
                thermal_speed
            }),
        ];
        Params::assert_uniform_compat();
        let sizes = [("Candidate", CANDIDATE_BYTES), ("Claim", CLAIM_BYTES), ("Born", BORN_BYTES)];
        let mut held = 0;
        for kernel in KERNELS {
            let (module, _) = parse(kernel.name, &kernel.wgsl());
            for structure in structures(&module) {
                let (name, span, members) = &structure;
                if name == "Control" {
                    let tallies = ("tallies".to_owned(), size_of::<ControlHeader>());
                    assert_eq!(members.last(), Some(&tallies), "{}", kernel.name);
                    held += 1;
                }
                if let Some((_, bytes)) = sizes.iter().find(|(known, _)| known == name) {
                    assert_eq!(*span as u64, *bytes, "{name} in {}", kernel.name);
                    held += 1;
                }
                if let Some(rust) = layouts.iter().find(|(known, ..)| known == name) {
                    assert_eq!(&structure, rust, "in {}", kernel.name);
                    held += 1;
                }
            }
        }
        assert!(held > KERNELS.len(), "only {held} structures were compared");
    }

    /// `npm ci --prefix kernels/tint` installs Tint. Without it the test is skipped, unless `LAZYGRID_REQUIRE_TINT` is set.
    #[test]
    fn tint_accepts_every_text() {
        let tint = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../kernels/tint");
        if !tint.join("node_modules").exists() && std::env::var_os("LAZYGRID_REQUIRE_TINT").is_none() {
            #[expect(clippy::print_stderr, reason = "a skipped test says why")]
            {
                eprintln!("skipped: Tint is not installed; `npm ci --prefix kernels/tint` does that");
            }
            return;
        }
        let folder = tempfile::tempdir().expect("a folder");
        for kernel in KERNELS {
            let path = folder.path().join(kernel.name).with_extension("wgsl");
            std::fs::write(path, kernel.wgsl()).expect("written");
        }
        let check = tint.join("check.mjs");
        let run =
            std::process::Command::new("node").arg(check).arg(folder.path()).output().expect("node runs");
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stdout));
    }
}
