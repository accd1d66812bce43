#[path = "../../../../tests/src/reflection.rs"]
mod reflection;

use std::mem::size_of;

use encase::ShaderType;
use naga::Literal;

use reflection::{bindings, check_constants, laid_out, layout, parse, spirv, structures};

use super::super::layout::{
    BORN_BYTES, BOUND_RADIUS, CANDIDATE_BYTES, CLAIM_BYTES, ChemotaxisRow, ControlHeader, DissociationRow,
    EventRow, MOVER_BYTES, NEXT_EVENT_BYTES, OccupancyRow, PUSH_BYTES, Params, ReactionRow,
    ReceiverCellsHeader, ReceiverRow, SpeciesRow, TrajectoryHeader, WINDOW_BYTES,
};
use super::*;
use crate::gpu::layout;
use crate::gpu::tests::adapter::skip::skip;
use crate::random::philox::Purpose;

fn texts() -> impl Iterator<Item = (&'static Kernel, String)> {
    let variant =
        |has_membranes| [true, false].map(|has_long_paths| Variant { has_membranes, has_long_paths });
    let variants = [true, false].map(variant).concat();
    KERNELS.iter().flat_map(move |&kernel| {
        let mut texts: Vec<String> = variants.iter().map(|&variant| kernel.wgsl(variant)).collect();
        texts.sort_unstable();
        texts.dedup();
        texts.into_iter().map(move |text| (kernel, text))
    })
}

#[test]
fn metadata_matches_every_shader() {
    for (kernel, text) in texts() {
        let (module, info) = parse(kernel.name, &text);
        assert_eq!(module.entry_points.len(), 1, "{}", kernel.name);
        assert_eq!(module.entry_points[0].name, kernel.name);
        assert!(!spirv(kernel.name, &module, &info).is_empty());
        let declared: Vec<_> =
            (0..).zip(kernel.bindings).map(|(k, &(name, access))| (k, name.to_owned(), access)).collect();
        assert_eq!(bindings(kernel.name, &module), declared, "{}", kernel.name);
        let storage = kernel.bindings.iter().filter(|(_, access)| *access != Uniform).count();
        let limit = if kernel.name == PARTICLES_MOVE_REFLECTING.name { SURFACE_BUFFERS as usize } else { 8 };
        assert!(storage <= limit, "{} binds {storage} storage buffers", kernel.name);
    }
}

#[test]
fn rust_structures_have_the_layout_of_the_shaders() {
    let layouts = [
        layout! { Params { key, species, tallies, first_reaction, is_open, max_iterations, lists_pairs,
        max_requeries, has_velocity, logs_arrivals, time_step, axes, vessel_axis, low, vessel_radius,
        high, peak_flow, vessel_center, largest_radius, collides, is_elastic, flow_duration, field_at,
        field_origin, field_spacing, field_points } },
        layout! { ChemotaxisRow { center, profile, gradient, level, size, sensitivity, saturates, probability } },
        layout! { SpeciesRow { drift, length, diffusion, radius, events_begin, decays_begin, walls_begin,
        events_end, bend, search_distance, cell_lists, speed, thermal_speed, tumbles, tumble_threshold,
        decay_rate, dissociation_rate, dissociation_threshold, mobility, drifts_at_wall, membrane_planes,
        membrane_spheres, taxis } },
        layout! { ReceiverCellsHeader { low, cells_per_length, counts } },
        layout! { EventRow { drift, radius, diffusion, kind, receiver, threshold, product, tally, length,
        scaled_reactivity, unbinding, cumulative_fraction, ligands_begin, ligands_end, receptor, occupied,
        concentration } },
        layout! { ReceiverRow { center, displacement } },
        layout! { TrajectoryHeader { first, stride, max_displacement, cells_at, cells } },
        layout! { OccupancyRow { receiver, radius, first, species } },
        layout! { ReactionRow { reaction, next, next_shell, first, threshold, flags, products, radii, within,
        unbinding, first_fraction, first_product_fraction, speeds, thermal_speeds, product_speeds,
        product_thermal_speeds, dissociation_thresholds } },
        layout! { DissociationRow { threshold, next, tally, is_within, unbinding, first_fraction, products,
        radii, product_speeds, product_thermal_speeds, speed, thermal_speed } },
    ];
    Params::assert_uniform_compat();
    let sizes = [
        ("Candidate", CANDIDATE_BYTES),
        ("Claim", CLAIM_BYTES),
        ("Born", BORN_BYTES),
        ("Mover", MOVER_BYTES),
        ("NextEvent", NEXT_EVENT_BYTES),
        ("Push", PUSH_BYTES),
        ("Window", WINDOW_BYTES),
    ];
    let mut held = 0;
    for (kernel, text) in texts() {
        let (module, _) = parse(kernel.name, &text);
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

#[test]
fn shader_constants_are_those_of_the_host() {
    macro_rules! constants {
        ($($of:ident: $($name:ident)*;)*) => { vec![$($((stringify!($name), Literal::U32($of::$name))),*),*] };
    }
    let mut expected = constants! {
        ControlHeader: PAIR_OVERFLOW ENTRY_OVERFLOW ROUNDS_LEFT NOT_FINITE TOO_MANY_SURFACES TOO_MANY_REQUESTS
            TOO_MANY_REQUERIES UNFINISHED_SEARCH BIRTH_OVERFLOW PARTICLE_OVERFLOW OUT_OF_IDS EVENT_OVERFLOW
            CANDIDATE_OVERFLOW WINDOW_ROUNDS_LEFT WINDOWS_LEFT TOO_FAST TOO_MANY_NEIGHBORS;
        EventRow: ABSORBING ENDPOINT REFLECTING PARTIAL PER_STEP RECEPTORS DECAY WALL;
        layout: NOTHING SPARED MAX_DECAYS MAX_NEAR MAX_REQUESTS MAX_NEIGHBORS;
    };
    let purposes = [
        ("PURPOSE_MOVE", Purpose::Move),
        ("PURPOSE_VELOCITY", Purpose::Velocity),
        ("PURPOSE_RECEIVER", Purpose::Receiver),
        ("PURPOSE_PAIR", Purpose::Pair),
        ("PURPOSE_DECAY", Purpose::Decay),
        ("PURPOSE_PATH", Purpose::Path),
        ("PURPOSE_DISSOCIATION", Purpose::Dissociation),
        ("PURPOSE_TUMBLE", Purpose::Tumble),
        ("PURPOSE_UNBINDING", Purpose::Unbinding),
        ("PURPOSE_HIT_TIME", Purpose::HitTime),
        ("PURPOSE_WALL", Purpose::Wall),
        ("PURPOSE_MEMBRANE", Purpose::Membrane),
        ("PURPOSE_SURFACE_DIFFUSION", Purpose::SurfaceDiffusion),
    ];
    expected.extend(purposes.map(|(name, purpose)| (name, Literal::U32(purpose as u32))));
    expected.push(("BOUND_RADIUS", Literal::F32(BOUND_RADIUS)));
    let mut found = vec![0; expected.len()];
    for (kernel, text) in texts() {
        check_constants(kernel.name, &parse(kernel.name, &text).0, &expected, &mut found);
    }
    let missing: Vec<_> = expected.iter().zip(found).filter(|(_, shaders)| *shaders == 0).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn tint_accepts_every_text() {
    let tint = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../kernels/tint");
    if !tint.join("node_modules").exists() {
        let why = "Tint is not installed; `npm ci --prefix kernels/tint` does that";
        return skip(Some("LAZYGRID_REQUIRE_TINT"), why);
    }
    let folder = tempfile::tempdir().expect("a folder");
    for (k, (kernel, text)) in texts().enumerate() {
        let path = folder.path().join(format!("{}-{k}.wgsl", kernel.name));
        std::fs::write(path, text).expect("written");
    }
    let check = tint.join("check.mjs");
    let run = std::process::Command::new("node").arg(check).arg(folder.path()).output().expect("node runs");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stdout));
}
