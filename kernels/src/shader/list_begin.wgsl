// Chooses the cells of a call of few spheres, which one workgroup looks at itself.
#include layout
#include list
#include place
#include sphere

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> count_source: array<u32>;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> survey: Survey;
@group(0) @binding(4) var<storage, read_write> list: List;
@group(0) @binding(5) var<storage, read_write> outcome: Outcome;
@group(0) @binding(6) var<storage, read_write> lengths: Lengths;
@group(0) @binding(7) var<storage, read_write> starts: array<u32>;
@group(0) @binding(8) var<storage, read_write> density: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> species: array<u32>;
@group(0) @binding(10) var<storage, read> reach: array<vec2<u32>>;
#endif
#include reach
#include side
#include ordered
#include subgroup_max
#include periods
#include image
#include list_cells
#include survey
#include configure

@compute @workgroup_size(256)
fn list_begin(
#include place_builtins
) {
#include place_from_builtins
    survey_spheres(place.lane, 256u, place);
    storageBarrier();
    workgroupBarrier();
    configure(place.lane);
}
