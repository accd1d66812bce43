use super::*;

#[test]
fn effective_variant_has_the_whole_text() {
    for kernel in KERNELS {
        for (species, periodic) in [(false, true), (true, false), (true, true)] {
            let variant = Variant { species, periodic, ..Variant::default() };
            let whole = Preprocessor { variant, strict: false }.expand(kernel.source);
            assert!(kernel.wgsl(variant) == whole, "{} {variant:?}", kernel.name);
        }
        let unbounded = kernel.wgsl(Variant::default());
        let periodic = kernel.wgsl(Variant { periodic: true, ..Variant::default() });
        assert_eq!(unbounded != periodic, kernel.knows_periods, "{}", kernel.name);
    }
}

#[test]
fn variant_for_device_fits_its_workgroup_memory() {
    let plain = Variant::default();
    let variant_for = Variant::for_device;
    assert_eq!(variant_for(Some(32), 48 << 10), Variant { subgroups: Some(32), ..plain });
    assert_eq!(variant_for(None, 48 << 10), plain);
    assert_eq!(variant_for(Some(2), 48 << 10), plain);
    assert_eq!(variant_for(Some(32), 16 << 10), Variant { subgroups: Some(32), ..plain });
    assert_eq!(variant_for(Some(8), 16 << 10), plain);
    assert_eq!(variant_for(Some(8), 20 << 10), Variant { subgroups: Some(8), ..plain });
}

#[test]
fn subgroup_kernels_have_the_workgroup_size_of_the_probe() {
    let mut count = 0;
    for kernel in KERNELS.into_iter().filter(|kernel| kernel.uses_subgroups) {
        assert_eq!(kernel.workgroup_size, SUBGROUP_PROBE.workgroup_size, "{}", kernel.name);
        count += 1;
    }
    assert!(count > 8);
}
