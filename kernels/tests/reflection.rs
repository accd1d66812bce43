//! Compares metadata and Rust layouts with every shader.

#[path = "../../tests/src/reflection.rs"]
mod reflection;

use std::mem::{offset_of, size_of};

use lazygrid_kernels::kernel::{Access, KERNELS, Kernel, SubgroupProbe, Variant};
use lazygrid_kernels::layout::{
    Bounds, CellListLayout, CellListLevel, ColumnLayout, Grid, InputStats, LevelKeys, Outcome, RadixPass,
    SearchParams, SkinParams, SkinState, SortCounts, SpeciesParams,
};
use naga::valid::ModuleInfo;
use naga::{AddressSpace, Literal, Module};
use reflection::{bindings, check_constants, laid_out, layout, parse, spirv, structures};

fn each_shader(mut check: impl FnMut(&'static Kernel, Variant, &Module, &ModuleInfo)) {
    for kernel in KERNELS {
        for variant in kernel.variants() {
            let (module, info) = parse(&format!("{} {variant:?}", kernel.name), &kernel.wgsl(variant));
            check(kernel, variant, &module, &info);
        }
    }
}

#[test]
fn metadata_matches_every_shader() {
    each_shader(|kernel, variant, module, _| {
        let name = kernel.name;
        assert_eq!(module.entry_points.len(), 1, "{name}");
        assert_eq!(module.entry_points[0].name, name);
        assert_eq!(module.entry_points[0].workgroup_size, [kernel.workgroup_size, 1, 1], "{name}");
        let said: Vec<_> = (0..)
            .zip(kernel.bindings(variant))
            .map(|(number, binding)| (number, binding.name.to_owned(), binding.access))
            .collect();
        assert_eq!(bindings(name, module), said, "{name} {variant:?}");
    });
}

#[test]
fn shader_constants_match_the_layout() {
    let whole = |value: u32| Literal::U32(value);
    let expected = [
        ("NEVER", Literal::F32(SearchParams::NEVER)),
        ("TOUCH", Literal::F32(SearchParams::TOUCH)),
        ("BY_SPECIES", Literal::F32(SearchParams::BY_SPECIES)),
        ("TOUCHES", whole(SpeciesParams::TOUCHES)),
        ("IDLE", whole(SpeciesParams::IDLE)),
        ("SIDE_SHIFT", whole(SpeciesParams::SIDE_SHIFT)),
        ("LEVELS", whole(CellListLayout::LEVELS as u32)),
        ("OVERFLOW_WORK", whole(Outcome::OVERFLOW_WORK)),
        ("OVERFLOW_LAYOUT", whole(Outcome::OVERFLOW_LAYOUT)),
        ("NO_LIST", whole(SkinState::NO_LIST)),
        ("INPUT_CHANGED", whole(SkinState::INPUT_CHANGED)),
        ("DISPLACEMENT", whole(SkinState::DISPLACEMENT)),
    ];
    let mut found = [0; 12];
    each_shader(|kernel, _, module, _| check_constants(kernel.name, module, &expected, &mut found));
    assert!(found.iter().all(|&shaders| shaders > 0), "{found:?}");
}

#[test]
fn workgroup_memory_is_as_promised() {
    each_shader(|kernel, variant, module, _| {
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).expect("laid out");
        let bytes: u32 = module
            .global_variables
            .iter()
            .filter(|(_, global)| global.space == AddressSpace::WorkGroup)
            .map(|(_, global)| layouter[global.ty].size)
            .sum();
        assert!(bytes <= variant.workgroup_memory(), "{} {variant:?}: {bytes}", kernel.name);
    });
}

#[test]
fn every_shader_translates_to_spirv() {
    let mut written = 0;
    each_shader(|kernel, variant, module, info| {
        let words = spirv(&format!("{} {variant:?}", kernel.name), module, info);
        assert_eq!(words[0], 0x0723_0203);
        written += 1;
    });
    assert_eq!(written, KERNELS.iter().map(|kernel| kernel.variants().len()).sum::<usize>());
    assert!(written > 2 * KERNELS.len());
}

#[test]
fn rust_structures_have_the_layout_of_the_shaders() {
    let layouts = [
        layout!(words SearchParams {
            spheres,
            pair_capacity,
            entry_capacity,
            key_bits,
            cell_ratio,
            species,
            search_groups,
            consumer_workgroup_size,
            window_begin,
            window_end,
            split_policy,
            tau,
            occupancy_slots,
            tiles_per_submission,
            period_x,
            period_y,
            period_z,
            cells,
            counters,
            second_set_start,
            radix_tile,
            candidates_per_invocation,
            chunks_per_block,
            pairs_in_cell_order,
            sides,
            levels_per_side,
            partners_low,
            partners_high,
            narrow_sides,
            interaction,
            first_workgroup,
            workgroups_per_dispatch,
            opaque_zero
        }),
        layout!(words RadixPass { shift, mask, is_first }),
        layout!(CellListLevel {
            cells,
            base,
            low,
            units_per_length,
            cells_per_length,
            far,
            around,
            max_radius,
            searched_levels,
            searches_itself
        }),
        layout!(CellListLayout {
            spheres,
            cells,
            units_per_cell,
            levels,
            has_overfull_cells,
            ordinary,
            class_levels,
            level
        }),
        layout!(words InputStats { low, high, smallest, quarantined, members, largest }),
        layout!(Grid {
            origin,
            spheres,
            inverse_edge,
            ordinary,
            low,
            split_policy,
            high,
            level_mask,
            ring_cells,
            depth_mask,
            passive,
            levels
        }),
        layout!(LevelKeys { bits, base }),
        layout!(words Outcome {
            found_lo,
            found_hi,
            overflow,
            quarantined,
            dispatch_x,
            dispatch_y,
            dispatch_z,
            deferred_blocks,
            entries_lo,
            entries_hi,
            spheres,
            deferred_max_tiles,
            deferred_begin,
            deferred_end,
            max_occupancy,
            pairs_in_cell_order
        }),
        layout!(words ColumnLayout { first, stride }),
        layout!(words SortCounts { items, counters }),
        layout!(words SubgroupProbe { faults, invocations, smallest, largest }),
        layout!(words SkinParams { half_skin, limit_squared, candidate_capacity }),
        layout!(words SkinState { displacement, input_changed, is_complete, spheres, rebuild_reason, age, candidates, last_displacement }),
    ];
    let mut held = 0;
    each_shader(|kernel, _, module, _| {
        for structure in structures(module) {
            let (name, span, members) = &structure;
            if name == "Bounds" {
                let offset_of = |name: &str| members.iter().find(|(member, _)| member == name).expect(name).1;
                let shader = ["low_x", "high_x", "radius_min", "radius_max", "depth_mask", "descending"]
                    .map(offset_of);
                let rust = [
                    offset_of!(Bounds, low),
                    offset_of!(Bounds, high),
                    offset_of!(Bounds, radius_min),
                    offset_of!(Bounds, radius_max),
                    offset_of!(Bounds, depth_mask),
                    offset_of!(Bounds, descending),
                ];
                assert_eq!((shader, *span), (rust, size_of::<Bounds>()), "in {}", kernel.name);
                held += 1;
            }
            if let Some(rust) = layouts.iter().find(|(rust, ..)| rust == name) {
                assert_eq!(&structure, rust, "in {}", kernel.name);
                held += 1;
            }
        }
    });
    assert!(held >= KERNELS.len(), "only {held} structures were compared");
}
