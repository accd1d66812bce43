use super::*;

/// What a kernel is said not to know of does not occur in its text. (Subgroups are shared pieces' to use.)
#[test]
fn reduced_variants_have_the_whole_text() {
    for kernel in KERNELS {
        for (species, periodic) in [(false, true), (true, false), (true, true)] {
            let variant = Variant { species, periodic, ..Variant::default() };
            let whole = Expansion { variant, is_standard: false }.expand(kernel.source);
            assert!(kernel.wgsl(variant) == whole, "{} {variant:?}", kernel.name);
        }
        let unbounded = kernel.wgsl(Variant::default());
        let periodic = kernel.wgsl(Variant { periodic: true, ..Variant::default() });
        assert_eq!(unbounded != periodic, kernel.knows_periods, "{}", kernel.name);
    }
}
