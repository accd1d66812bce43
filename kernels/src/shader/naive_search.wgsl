// All pairs: each workgroup takes 256 spheres and a share of the tiles of those with larger indices, or of two sets 256
// spheres of the first and a share of the tiles of the second. There are so many workgroups that no invocation takes more
// turns than some devices allow.
#include layout
#include place
#include sphere

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> outcome: Outcome;
@group(0) @binding(4) var<storage, read_write> pairs: array<vec2<u32>>;
#ifdef SPECIES
@group(0) @binding(5) var<storage, read> species: array<u32>;
@group(0) @binding(6) var<storage, read> reach: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> table: array<f32>;
#endif
#include reach
#include overlap
#include reserve_lane
#include tile

const GROUP: u32 = 256u;

var<workgroup> tile_valid: array<atomic<u32>, 8>;

@compute @workgroup_size(256)
fn naive_search(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let group = number_of_group(id, groups);
    let count = grid.spheres;
    let blocks = (count + GROUP - 1u) / GROUP;
    // Of two sets the first has the rows and the second the columns.
    let rows = select(count, min(call.split, count), call.split != 0u);
    let row_blocks = (rows + GROUP - 1u) / GROUP;
    let shares = clamp(call.search_groups / max(row_blocks, 1u), 1u, max(blocks, 1u));
    let block = group / shares;
    let first_row = block * GROUP;
    if (block >= row_blocks || first_row >= call.window_end || first_row + (GROUP - 1u) < call.window_begin) {
        return;
    }
    let first_column = max(block, call.split / GROUP);
    var row: Row;
    row.object = first_row + place.lane;
    var row_used = false;
    if (row.object < rows && is_in_window(row.object)) {
        row.sphere = spheres[row.object];
        row_used = is_accepted(row.object, row.sphere);
#ifdef SPECIES
        row.species = min(species[row.object], call.species - 1u);
#endif
    }
    for (var turn = 0u; turn < blocks; turn++) {
        let column = first_column + group % shares + turn * shares;
        if (column >= blocks) {
            break;
        }
        workgroupBarrier();
        if (place.lane < 8u) {
            atomicStore(&tile_valid[place.lane], 0u);
        }
        workgroupBarrier();
        let other = column * GROUP + place.lane;
        if (other < count) {
            let sphere = spheres[other];
            tile[place.lane] = sphere;
#ifdef SPECIES
            tile_species[place.lane] = min(species[other], call.species - 1u);
#endif
            if (is_accepted(other, sphere)) {
                atomicOr(&tile_valid[place.lane / 32u], 1u << (place.lane % 32u));
            }
        }
        workgroupBarrier();
        // In the block's own tile only larger indices, in the first tile of the second set only spheres of that set.
        let of_second = max(call.split, column * GROUP) - column * GROUP;
        let begin = max(select(0u, place.lane + 1u, column == block), of_second);
        for (var first = 0u; first < GROUP; first += 32u) {
            let window = tile_window(first, begin, GROUP) & atomicLoad(&tile_valid[first / 32u]);
            var hits = 0u;
            if (row_used && window != 0u) {
                hits = tile_hits(row, first) & window;
            }
            if (some_lane(hits != 0u)) {
                var at_pair = pairs_reserve_lane(countOneBits(hits), place);
                for (; hits != 0u; hits &= hits - 1u) {
                    if (at_pair >= call.pair_capacity) {
                        break;
                    }
                    let k = firstTrailingBit(hits);
                    pair_write(at_pair, row.object, column * GROUP + first + k);
                    at_pair += 1u;
                }
            }
        }
    }
}
