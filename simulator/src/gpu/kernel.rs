//! The kernels: their WGSL and what they bind. Nothing here calls a device.

/// Threads of a workgroup.
pub(super) const GROUP: u32 = 256;

/// How a kernel uses a binding; its place in [`Kernel::bindings`] is its number in group 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Access {
    Uniform,
    Read,
    Write,
}

use Access::{Read, Uniform, Write};

/// One compute stage; its name is that of its file and of its entry point.
#[derive(Debug)]
pub(super) struct Kernel {
    pub(super) name: &'static str,
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
        Uniform "params", Write "control", Read "spheres", Read "tags", Write "moved", Write "species", Write "ids",
        Read "kinds", Read "fates",
    ];
    /// Takes over what the detector found, or freezes the run.
    PAIRS_CHECK = "pairs_check" [Uniform "params", Write "control", Write "outcome"];
    /// Lists the pairs that chance lets react.
    CANDIDATES_DRAW = "candidates_draw" [
        Uniform "params", Write "control", Read "pairs", Read "moved", Read "species", Read "ids", Read "rules",
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
    SURVIVORS_COUNT = "survivors_count" [Write "control", Read "moved", Write "claims", Write "sums"];
    /// Scans those counts and settles the step.
    SURVIVORS_SCAN = "survivors_scan" [Uniform "params", Write "control", Write "sums", Write "log"];
    /// Brings together what stays.
    SURVIVORS_PLACE = "survivors_place" [
        Write "control", Read "moved", Read "species", Read "ids", Write "claims", Read "sums", Write "spheres",
        Write "tags",
    ];
    /// What is inside transparent receivers.
    RECEIVERS_COUNT = "receivers_count" [
        Uniform "params", Write "control", Read "spheres", Read "tags", Read "watches", Write "inside",
    ];
}

/// Pieces of WGSL that several kernels have, by the name after `#include`.
const SHARED: &[(&str, &str)] = &[
    ("boundary", include_str!("shader/shared/boundary.wgsl")),
    ("candidate", include_str!("shader/shared/candidate.wgsl")),
    ("claiming", include_str!("shader/shared/claiming.wgsl")),
    ("control", include_str!("shader/shared/control.wgsl")),
    ("normal", include_str!("shader/shared/normal.wgsl")),
    ("params", include_str!("shader/shared/params.wgsl")),
    ("philox", include_str!("shader/shared/philox.wgsl")),
    ("round", include_str!("shader/shared/round.wgsl")),
    ("running_sum", include_str!("shader/shared/running_sum.wgsl")),
    ("settling", include_str!("shader/shared/settling.wgsl")),
    ("survivor", include_str!("shader/shared/survivor.wgsl")),
];

impl Kernel {
    /// The complete text.
    pub(super) fn wgsl(&self) -> String {
        expand(self.source)
    }
}

/// A text with its pieces in place.
pub(super) fn expand(source: &str) -> String {
    let line = |line: &str| match line.strip_prefix("#include ") {
        None => format!("{line}\n"),
        Some(name) => SHARED.iter().filter(|(known, _)| *known == name).map(|&(_, text)| text).collect(),
    };
    source.lines().map(line).collect()
}

#[cfg(test)]
mod tests {
    use std::mem::{offset_of, size_of};

    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use naga::{AddressSpace, Module, StorageAccess, TypeInner};

    use super::super::layout::{CANDIDATE_BYTES, CLAIM_BYTES, Fate, Head, Kind, Params, Rule, Watch};
    use super::*;

    fn parsed(kernel: &Kernel) -> Module {
        let source = kernel.wgsl();
        let module = naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}: {}", kernel.name, error.emit_to_string(&source)));
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|error| panic!("{}: {}", kernel.name, error.emit_to_string(&source)));
        let options = naga::back::spv::Options { lang_version: (1, 3), ..Default::default() };
        naga::back::spv::write_vec(&module, &info, &options, None)
            .unwrap_or_else(|error| panic!("{}: {error}", kernel.name));
        module
    }

    #[test]
    fn metadata_matches_every_shader() {
        for kernel in KERNELS {
            let module = parsed(kernel);
            assert_eq!(module.entry_points.len(), 1, "{}", kernel.name);
            assert_eq!(module.entry_points[0].name, kernel.name);
            let mut found = Vec::new();
            for (_, global) in module.global_variables.iter() {
                let Some(binding) = &global.binding else { continue };
                let access = match global.space {
                    AddressSpace::Uniform => Uniform,
                    AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => Write,
                    _ => Read,
                };
                found.push((binding.binding, global.name.clone().unwrap_or_default(), access));
            }
            found.sort_by_key(|(number, ..)| *number);
            let said: Vec<_> =
                (0..).zip(kernel.bindings).map(|(k, &(name, access))| (k, name.to_owned(), access)).collect();
            assert_eq!(found, said, "{}", kernel.name);
            let storage = kernel.bindings.iter().filter(|(_, access)| *access != Uniform).count();
            assert!(storage <= 8, "{} binds {storage} storage buffers", kernel.name);
        }
    }

    /// Name, size and (member, offset) list of a Rust structure.
    macro_rules! layout {
        ($type:ident { $($field:ident),* $(,)? }) => {
            (stringify!($type), size_of::<$type>(), vec![$((stringify!($field), offset_of!($type, $field))),*])
        };
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
                axes,
                low,
                high
            }),
            layout!(Kind { drift, length, diffusion, radius, fates_begin, fates_end }),
            layout!(Fate { center, radius, kind, receiver, up_to, product, tally }),
            layout!(Watch { center, radius, first, species }),
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
        let sizes = [("Candidate", CANDIDATE_BYTES), ("Claim", CLAIM_BYTES)];
        let mut held = 0;
        for kernel in KERNELS {
            let module = parsed(kernel);
            for (_, ty) in module.types.iter() {
                let TypeInner::Struct { members, span } = &ty.inner else { continue };
                let name = ty.name.as_deref().unwrap_or_default();
                let offsets: Vec<_> = members
                    .iter()
                    .map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize))
                    .collect();
                if name == "Control" {
                    assert_eq!(offsets.last(), Some(&("tallies", size_of::<Head>())), "{}", kernel.name);
                    held += 1;
                }
                if let Some((_, bytes)) = sizes.iter().find(|(known, _)| *known == name) {
                    assert_eq!(u64::from(*span), *bytes, "{name} in {}", kernel.name);
                    held += 1;
                }
                if let Some((_, size, fields)) = layouts.iter().find(|(known, ..)| *known == name) {
                    assert_eq!((*span as usize, &offsets), (*size, fields), "{name} in {}", kernel.name);
                    held += 1;
                }
            }
        }
        assert!(held > KERNELS.len(), "only {held} structures were compared");
    }
}
