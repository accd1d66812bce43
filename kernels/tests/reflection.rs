//! Holds the metadata and the Rust layouts against every shader, with naga and without a device.

use std::mem::{offset_of, size_of};

use lazygrid_kernels::kernel::{Access, KERNELS, Kernel, Variant};
use lazygrid_kernels::layout::{Bounds, Call, Grid, Lengths, Level, Outcome};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};

fn each_shader(mut check: impl FnMut(&'static Kernel, Variant, &Module, &ModuleInfo)) {
    for kernel in KERNELS {
        for variant in kernel.variants() {
            let source = kernel.wgsl(variant);
            let module = naga::front::wgsl::parse_str(&source).unwrap_or_else(|error| {
                panic!("{} {variant:?}: {}", kernel.name, error.emit_to_string(&source))
            });
            let info = Validator::new(
                ValidationFlags::all(),
                Capabilities::SUBGROUP | Capabilities::SUBGROUP_BARRIER,
            )
            .validate(&module)
            .unwrap_or_else(|error| panic!("{} {variant:?}: {}", kernel.name, error.emit_to_string(&source)));
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
        assert_eq!(module.entry_points[0].workgroup_size, [kernel.group_size, 1, 1], "{name}");
        let mut found: Vec<_> = module
            .global_variables
            .iter()
            .filter_map(|(_, global)| {
                let binding = global.binding.as_ref()?;
                assert_eq!(binding.group, 0, "{name}");
                let access = match global.space {
                    AddressSpace::Uniform => Access::Uniform,
                    AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                        Access::ReadWrite
                    }
                    AddressSpace::Storage { .. } => Access::Read,
                    space => panic!("{name}: {space:?}"),
                };
                Some((binding.binding, global.name.clone().expect("a named binding"), access))
            })
            .collect();
        found.sort_by_key(|(number, ..)| *number);
        let said: Vec<_> = (0..)
            .zip(kernel.bindings(variant))
            .map(|(number, binding)| (number, binding.name.to_owned(), binding.access))
            .collect();
        assert_eq!(found, said, "{name} {variant:?}");
    });
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
        let options = naga::back::spv::Options { lang_version: (1, 3), ..Default::default() };
        let words = naga::back::spv::write_vec(module, info, &options, None)
            .unwrap_or_else(|error| panic!("{} {variant:?}: {error}", kernel.name));
        assert_eq!(words[0], 0x0723_0203);
        written += 1;
    });
    assert_eq!(written, KERNELS.iter().map(|kernel| kernel.variants().len()).sum::<usize>());
    assert!(written > 2 * KERNELS.len());
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
        layout!(Call {
            spheres,
            pair_capacity,
            entry_capacity,
            key_bits,
            raster_ratio,
            species,
            search_groups,
            consumer_group,
            window_begin,
            window_end,
            refinement,
            tau,
            density_slots,
            part_tiles,
            period_x,
            period_y,
            period_z
        }),
        layout!(Grid {
            origin,
            spheres,
            inverse_edge,
            ordinary,
            low,
            refinement,
            high,
            depths,
            turns,
            occupied,
            passive,
            levels
        }),
        layout!(Level { bits, base }),
        layout!(Outcome {
            found_lo,
            found_hi,
            overflow,
            quarantined,
            dispatch_x,
            dispatch_y,
            dispatch_z,
            crowded,
            entries_lo,
            entries_hi,
            spheres,
            crowded_tiles,
            crowded_begin,
            crowded_end
        }),
        layout!(Lengths { items, counters }),
    ];
    let mut held = 0;
    each_shader(|kernel, _, module, _| {
        for (_, ty) in module.types.iter() {
            let TypeInner::Struct { members, span } = &ty.inner else { continue };
            let name = ty.name.as_deref().expect("a named structure");
            if name == "Bounds" {
                let of =
                    |name: &str| members.iter().find(|m| m.name.as_deref() == Some(name)).expect(name).offset;
                let shader = ["low_x", "high_x", "radius_min", "radius_max", "depths", "descending"].map(of);
                let rust = [
                    offset_of!(Bounds, low),
                    offset_of!(Bounds, high),
                    offset_of!(Bounds, radius_min),
                    offset_of!(Bounds, radius_max),
                    offset_of!(Bounds, depths),
                    offset_of!(Bounds, descending),
                ];
                assert_eq!(shader.map(|offset| offset as usize), rust, "in {}", kernel.name);
                assert_eq!(*span as usize, size_of::<Bounds>());
                held += 1;
            }
            if let Some((_, size, fields)) = layouts.iter().find(|(rust, ..)| *rust == name) {
                let shader: Vec<_> = members
                    .iter()
                    .map(|m| (m.name.as_deref().expect("a named member"), m.offset as usize))
                    .collect();
                assert_eq!((*span as usize, shader), (*size, fields.clone()), "{name} in {}", kernel.name);
                held += 1;
            }
        }
    });
    assert!(held >= KERNELS.len(), "only {held} structures were compared");
}
