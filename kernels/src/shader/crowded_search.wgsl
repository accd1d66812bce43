// Pairs of entries more than NEAR places apart in one run: each workgroup takes a listed block of 256 entries
// and a share of the tiles that follow, so that a single crowded cell keeps the whole device busy and no invocation
// takes more turns than some devices allow.
#include layout
#include place

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> lengths: Lengths;
@group(0) @binding(3) var<storage, read> keys: array<u32>;
@group(0) @binding(4) var<storage, read> objects: array<u32>;
@group(0) @binding(5) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> outcome: Outcome;
@group(0) @binding(7) var<storage, read_write> pairs: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read> crowded: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> species: array<u32>;
@group(0) @binding(10) var<storage, read> table: array<f32>;
#endif
#include overlap
#include reserve_lane
#include entry
#include crowd
#include tile

const GROUP: u32 = 256u;

// Where the objects of the tile begin, all taken together.
var<workgroup> tile_firsts: atomic<u32>;
// Which of the listed blocks this part of the search takes, and the most tiles that one of them is compared with.
struct Part {
    begin: u32,
    end: u32,
    tiles: u32,
}

var<workgroup> group_part: Part;

// Bits of the pairs among `hits` that this cell owns and that are asked for.
fn owned_hits(object: u32, first: u32, hits: u32) -> u32 {
    var owned = 0u;
    for (var k = 0u; k < 32u; k++) {
        let other = tile_objects[first + k];
        owned |= select(0u, 1u << k, is_owned(object, other) && is_wanted(object, other));
    }
    return owned & hits;
}

@compute @workgroup_size(256)
fn crowded_search(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    if (place.lane == 0u) {
        group_part = Part(
            atomicLoad(&outcome.crowded_begin),
            atomicLoad(&outcome.crowded_end),
            atomicLoad(&outcome.crowded_tiles),
        );
    }
    let part = workgroupUniformLoad(&group_part);
    let listed = part.begin + id.y + id.z * MAX_GROUPS;
    if (listed >= part.end) {
        return;
    }
    let per_share = tiles_per_share(part.end - part.begin, part.tiles);
    let block = crowded[listed];
    let run = run_of(keys[block + GROUP - 1u]);
    let start = block + NEAR + 1u;
    let end = run_end(run, block + GROUP);
    let share = start + id.x * per_share * GROUP;
    let entry = block + place.lane;
    let row_used = run_of(keys[entry]) == run && !is_passive(keys[entry]) && entry + NEAR + 1u < end;
    var row: Row;
    row.object = objects[entry];
    row.sphere = spheres[index_of(row.object)];
#ifdef SPECIES
    row.species = species[index_of(row.object)];
#endif
    // A row that begins here on every axis makes this cell the owner of all its pairs.
    let owns_all = is_owned(row.object, 0u) && asks_for_all(grid.spheres);
    for (var turn = 0u; turn < per_share; turn++) {
        let column = share + turn * GROUP;
        if (column >= end) {
            break;
        }
        workgroupBarrier();
        if (place.lane == 0u) {
            atomicStore(&tile_firsts, 0u);
        }
        workgroupBarrier();
        if (column + place.lane < end) {
            let object = objects[column + place.lane];
            atomicOr(&tile_firsts, object);
            tile_objects[place.lane] = object;
            tile[place.lane] = spheres[index_of(object)];
#ifdef SPECIES
            tile_species[place.lane] = species[index_of(object)];
#endif
        }
        workgroupBarrier();
        // In the first tile only partners beyond the near ones, which end farther on for later threads.
        let begin = select(0u, place.lane, column == start);
        let finish = min(GROUP, end - column);
        // Where many objects share several cells, all but one of these cells are passed over here.
        let row_owns = row_used && is_owned(row.object, atomicLoad(&tile_firsts));
        for (var first = 0u; first < GROUP; first += 32u) {
            let window = tile_window(first, begin, finish);
            var hits = 0u;
            if (row_owns && window != 0u) {
                hits = tile_hits(row, first) & window;
                if (hits != 0u && !owns_all) {
                    hits = owned_hits(row.object, first, hits);
                }
            }
            if (some_lane(hits != 0u)) {
                var at_pair = pairs_reserve_lane(countOneBits(hits), place);
                for (; hits != 0u; hits &= hits - 1u) {
                    if (at_pair >= call.pair_capacity) {
                        break;
                    }
                    let k = firstTrailingBit(hits);
                    pair_write(at_pair, index_of(row.object), index_of(tile_objects[first + k]));
                    at_pair += 1u;
                }
            }
        }
    }
}
