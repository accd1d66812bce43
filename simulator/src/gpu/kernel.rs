//! The kernels: their WGSL and what they bind. Nothing here calls a device.

use lazygrid::gpu::Access;
use lazygrid::gpu::Access::{Read, ReadWrite as Write, Uniform};
use lazygrid::gpu::wgsl;

/// Storage buffers that a model with surfaces takes in one stage; others take eight, which every device has.
pub(super) const SURFACE_BUFFERS: u32 = 10;
/// Threads of a workgroup.
pub(super) const GROUP: u32 = 256;

/// One compute stage; its name is that of its file and of its entry point.
#[derive(Debug)]
pub(super) struct Kernel {
    pub(super) name: &'static str,
    /// Names, and how they are used; its place is a binding's number in group 0.
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
        /// Every kernel.
        #[cfg(test)]
        pub(super) static KERNELS: &[&Kernel] = &[$(&$id),*];
    };
}

kernels! {
    /// Puts a burst behind the particles that are there.
    BURST_APPEND = "burst_append" [
        Uniform "burst", Write "control", Read "burst_spheres", Read "burst_tags", Write "spheres", Write "tags",
    ];
    /// Begins a step.
    STEP_BEGIN = "step_begin" [Uniform "params", Write "control"];
    /// Every particle by itself.
    PARTICLES_MOVE = "particles_move" [
        Uniform "params", Uniform "journey", Write "control", Read "spheres", Read "tags", Write "moved",
        Write "species", Read "kinds", Read "fates", Read "bodies",
    ];
    /// The same where surfaces turn some back.
    PARTICLES_TURN = "particles_turn" [
        Uniform "params", Uniform "journey", Write "control", Read "spheres", Read "tags", Write "moved",
        Write "species", Read "kinds", Read "fates", Read "bodies", Write "claims", Write "receptors",
    ];
    /// Begins a step of receptors.
    RECEPTORS_BEGIN = "receptors_begin" [Write "receptors"];
    /// Counts the receptors that are taken.
    RECEPTORS_HOLD = "receptors_hold" [Write "control", Read "spheres", Read "fates", Write "receptors"];
    /// The start of each receiver's list of particles that are to bind.
    RECEPTORS_SCAN = "receptors_scan" [Write "control", Write "receptors"];
    /// Lists these.
    RECEPTORS_GROUP = "receptors_group" [
        Write "control", Read "fates", Write "claims", Write "receptors", Write "bidders",
    ];
    /// Binds those for which receptors are free.
    RECEPTORS_CHOOSE = "receptors_choose" [
        Write "control", Read "tags", Read "fates", Write "claims", Write "receptors", Read "bidders", Write "moved",
    ];
    /// Takes over what the detector found, or freezes the run.
    PAIRS_CHECK = "pairs_check" [Uniform "params", Write "control", Write "outcome"];
    /// Lists the pairs that chance lets react.
    CANDIDATES_DRAW = "candidates_draw" [
        Uniform "params", Write "control", Read "pairs", Read "moved", Read "species", Read "tags", Read "rules",
        Write "candidates", Write "left",
    ];
    /// Begins a round of the matching.
    MATCHING_OPEN = "matching_open" [
        Uniform "round", Write "control", Read "candidates", Read "rules", Write "claims", Read "left",
        Write "left_next",
    ];
    /// Enters the best priority at each particle.
    MATCHING_PROPOSE = "matching_propose" [
        Uniform "round", Write "control", Read "candidates", Read "rules", Write "claims", Read "left_next",
    ];
    /// Decides between equal priorities.
    MATCHING_TIE = "matching_tie" [
        Uniform "round", Write "control", Read "candidates", Read "rules", Write "claims", Read "left_next",
    ];
    /// Lets the winners react.
    MATCHING_SETTLE = "matching_settle" [
        Uniform "params", Uniform "round", Write "control", Read "candidates", Read "rules", Write "claims",
        Read "left_next", Read "moved",
    ];
    /// The rounds that are left, by one workgroup.
    MATCHING_FINISH = "matching_finish" [
        Uniform "params", Uniform "round", Write "control", Read "candidates", Read "rules", Write "claims",
        Read "left", Read "moved",
    ];
    /// Counts the particles that stay.
    SURVIVORS_COUNT = "survivors_count" [
        Uniform "listing", Write "control", Read "order", Read "moved", Read "tags", Write "claims", Write "ids",
        Write "sums",
    ];
    /// Scans those counts and settles the step.
    SURVIVORS_SCAN = "survivors_scan" [Uniform "params", Write "control", Write "sums", Write "log"];
    /// Brings together what stays.
    SURVIVORS_PLACE = "survivors_place" [
        Uniform "listing", Read "order", Read "moved", Read "species", Read "ids", Write "claims", Read "sums",
        Write "spheres", Write "tags",
    ];
    /// The counts inside transparent receivers.
    RECEIVERS_COUNT = "receivers_count" [
        Uniform "params", Uniform "journey", Write "control", Read "spheres", Read "tags", Read "watches",
        Read "bodies", Write "inside",
    ];
}

/// Pieces of WGSL that several kernels have, by the name after `#include`.
const SHARED: &[(&str, &str)] = &[
    ("adsorption", include_str!("shader/shared/adsorption.wgsl")),
    ("boundary", include_str!("shader/shared/boundary.wgsl")),
    ("candidate", include_str!("shader/shared/candidate.wgsl")),
    ("claiming", include_str!("shader/shared/claiming.wgsl")),
    ("control", include_str!("shader/shared/control.wgsl")),
    ("decaying", include_str!("shader/shared/decaying.wgsl")),
    ("fate", include_str!("shader/shared/fate.wgsl")),
    ("fate_rows", include_str!("shader/shared/fate_rows.wgsl")),
    ("listing", include_str!("shader/shared/listing.wgsl")),
    ("meeting", include_str!("shader/shared/meeting.wgsl")),
    ("normal", include_str!("shader/shared/normal.wgsl")),
    ("params", include_str!("shader/shared/params.wgsl")),
    ("philox", include_str!("shader/shared/philox.wgsl")),
    ("receptor", include_str!("shader/shared/receptor.wgsl")),
    ("round", include_str!("shader/shared/round.wgsl")),
    ("running_sum", include_str!("shader/shared/running_sum.wgsl")),
    ("seen", include_str!("shader/shared/seen.wgsl")),
    ("settling", include_str!("shader/shared/settling.wgsl")),
    ("survivor", include_str!("shader/shared/survivor.wgsl")),
    ("turning", include_str!("shader/shared/turning.wgsl")),
];

impl Kernel {
    /// The complete text.
    pub(super) fn wgsl(&self) -> String {
        expand(self.source)
    }
}

/// A text with its pieces in place.
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
        Body, CANDIDATE_BYTES, CLAIM_BYTES, Fate, Head, Journey, Kind, Lists, Params, Rule, Watch,
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
            // Models with surfaces are refused where a device has room for less.
            let most = if kernel.name == PARTICLES_TURN.name { SURFACE_BUFFERS as usize } else { 8 };
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
                turns,
                lists_pairs,
                looks,
                axes,
                low,
                high
            }),
            layout!(Kind {
                drift,
                length,
                diffusion,
                radius,
                fates_begin,
                decays_begin,
                fates_end,
                bend,
                reach,
                lists
            }),
            layout!(Lists { low, per_edge, cells }),
            layout!(Fate {
                drift,
                radius,
                diffusion,
                kind,
                receiver,
                up_to,
                product,
                tally,
                length,
                own,
                unbinding
            }),
            layout!(Body { center, way }),
            layout!(Journey { first, stride, longest, lists_at, lists }),
            layout!(Watch { receiver, radius, first, species }),
            layout!(Rule {
                reaction,
                first,
                up_to,
                flags,
                products,
                radii,
                within,
                unbinding,
                share,
                first_share
            }),
        ];
        Params::assert_uniform_compat();
        let sizes = [("Candidate", CANDIDATE_BYTES), ("Claim", CLAIM_BYTES)];
        let mut held = 0;
        for kernel in KERNELS {
            let (module, _) = parse(kernel.name, &kernel.wgsl());
            for structure in structures(&module) {
                let (name, span, members) = &structure;
                if name == "Control" {
                    let tallies = ("tallies".to_owned(), size_of::<Head>());
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
}
