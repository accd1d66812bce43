// Finds each sphere's cell, here and nowhere else, as a key to sort by, and counts the digits of the first pass.
#include layout
#include list
#include place
#include sphere

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<uniform> digit_pass: Pass;
@group(0) @binding(2) var<storage, read> list: List;
@group(0) @binding(3) var<storage, read> lengths: Lengths;
@group(0) @binding(4) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> density: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> outcome: Outcome;
@group(0) @binding(7) var<storage, read_write> keys: array<u32>;
@group(0) @binding(8) var<storage, read_write> counts: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> species: array<u32>;
@group(0) @binding(10) var<storage, read> reach: array<vec2<u32>>;
#endif
#include reach
#include side
#include periods
#include image
#include list_cells
#include home
#include digit_pass

const GROUP: u32 = 256u;
const ITEMS: u32 = #{RADIX_ITEMS}u;

var<workgroup> histogram: array<atomic<u32>, 256>;

@compute @workgroup_size(256)
fn homes_key(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let group = number_of_group(id, groups);
    let start = group * GROUP * ITEMS;
    if (start >= list.spheres) {
        return;
    }
    atomicStore(&histogram[place.lane], 0u);
    workgroupBarrier();
    var crowd = 0u;
    for (var item = 0u; item < ITEMS; item++) {
        let index = start + item * GROUP + place.lane;
        if (index < list.spheres) {
            let home = home_of(index, spheres[index]);
            keys[index] = home.cell;
            atomicAdd(&histogram[digit_of(home.cell)], 1u);
            crowd = max(crowd, home.crowd);
        }
    }
    if (list.is_dense != 0u) {
        keep_crowd(crowd, place.lane);
    }
    workgroupBarrier();
    counts[place.lane * (lengths.counters / 256u) + group] = atomicLoad(&histogram[place.lane]);
}
