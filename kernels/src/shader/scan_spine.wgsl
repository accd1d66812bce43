// Second stage of the scan: one workgroup turns the sums of all tiles, however many, into their exclusive
// prefixes, and leaves the total.
#include layout
#include place

@group(0) @binding(0) var<storage, read> lengths: Lengths;
@group(0) @binding(1) var<storage, read_write> sums: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> total: vec2<u32>;

#include wide
const TILE: u32 = 256u * #{SCAN_ITEMS}u;
const ITEMS: u32 = 8u;

var<workgroup> scan: array<vec2<u32>, 512>;

@compute @workgroup_size(256)
fn scan_spine(
#include place_builtins
) {
#include place_from_builtins
    let tiles = lengths.counters / TILE + select(0u, 1u, lengths.counters % TILE != 0u);
    var carry = vec2(0u);
    let rounds = (tiles + 256u * ITEMS - 1u) / (256u * ITEMS);
    for (var round = 0u; round < rounds; round++) {
        let mine = (round * 256u + place.lane) * ITEMS;
        var sum = vec2(0u);
        for (var item = 0u; item < ITEMS; item++) {
            if (mine + item < tiles) {
                sum = wide_add(sum, sums[mine + item]);
            }
        }
        var front = 0u;
        scan[place.lane] = sum;
        workgroupBarrier();
        for (var step = 1u; step < 256u; step *= 2u) {
            var value = scan[front + place.lane];
            if (place.lane >= step) {
                value = wide_add(value, scan[front + place.lane - step]);
            }
            front = 256u - front;
            scan[front + place.lane] = value;
            workgroupBarrier();
        }
        var running = carry;
        if (place.lane > 0u) {
            running = wide_add(carry, scan[front + place.lane - 1u]);
        }
        carry = wide_add(carry, scan[front + 255u]);
        for (var item = 0u; item < ITEMS; item++) {
            if (mine + item < tiles) {
                let next = wide_add(running, sums[mine + item]);
                sums[mine + item] = running;
                running = next;
            }
        }
        workgroupBarrier();
    }
    if (place.lane == 0u) {
        total = carry;
    }
}
