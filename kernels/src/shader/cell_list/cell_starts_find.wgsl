// Finds the first sphere of each cell. A workgroup processes a block of cells.
#include layout
#include cell_list
#include thread

@group(0) @binding(0) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(1) var<storage, read> cells: array<u32>;
@group(0) @binding(2) var<storage, read_write> starts: array<u32>;

const WORKGROUP_SIZE: u32 = 256u;
const ITEMS: u32 = 8u;
const BLOCK: u32 = WORKGROUP_SIZE * ITEMS;
// A binary search serves blocks with more spheres.
const MAX_SCANNED: u32 = 32768u;

// One word in 33 is padding, so that threads with eight cells each read different banks.
var<workgroup> firsts: array<atomic<u32>, BLOCK + BLOCK / 32u>;
// Minima of `firsts` over the cells after those of each thread.
var<workgroup> later: array<u32, 512>;
var<workgroup> block_range: array<u32, 2>;
var<workgroup> passed: array<atomic<u32>, 2>;
const PROBES: u32 = WORKGROUP_SIZE / 2u;

fn slot_of(number: u32) -> u32 {
    return number + number / 32u;
}

fn first_from(cell: u32, low: u32, high: u32) -> u32 {
    var begin = low;
    var end = high;
    for (var iteration = 32u - countLeadingZeros(high - low); iteration > 0u; iteration--) {
        if (begin >= end) {
            break;
        }
        let middle = begin + (end - begin) / 2u;
        if (cells[middle] < cell) {
            begin = middle + 1u;
        } else {
            end = middle;
        }
    }
    return begin;
}

@compute @workgroup_size(256)
fn cell_starts_find(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let first_cell = workgroup_index(id, groups) * BLOCK;
    let counters = cell_list.cells + 2u;
    if (first_cell >= counters) {
        return;
    }
    // Each half of the workgroup searches for one end of the range. A round divides `low..high` by the 2^7 probes, so
    // rounds are a seventh of the bits of the number of spheres.
    let half = thread.local_index / PROBES;
    let probe = thread.local_index % PROBES;
    let end_cell = first_cell + half * BLOCK;
    var low = 0u;
    var high = cell_list.spheres;
    let search_rounds = (32u - countLeadingZeros(cell_list.spheres) + 6u) / 7u;
    for (var round = 0u; round < search_rounds; round++) {
        if (probe == 0u) {
            atomicStore(&passed[half], 0u);
        }
        workgroupBarrier();
        let step = (high - low + PROBES - 1u) / PROBES;
        let position = low + probe * step;
        if (position < high && cells[position] < end_cell) {
            atomicAdd(&passed[half], 1u);
        }
        workgroupBarrier();
        let count = atomicLoad(&passed[half]);
        high = min(high, low + count * step);
        low = select(low, low + (count - 1u) * step + 1u, count != 0u);
        workgroupBarrier();
    }
    if (probe == 0u) {
        block_range[half] = low;
    }
    let begin = workgroupUniformLoad(&block_range[0]);
    let end = workgroupUniformLoad(&block_range[1]);
    if (end - begin > MAX_SCANNED) {
        for (var item = 0u; item < ITEMS; item++) {
            let cell = first_cell + item * WORKGROUP_SIZE + thread.local_index;
            if (cell < counters) {
                starts[cell] = first_from(cell, begin, end);
            }
        }
        return;
    }

    for (var item = 0u; item < ITEMS; item++) {
        atomicStore(&firsts[slot_of(item * WORKGROUP_SIZE + thread.local_index)], end);
    }
    workgroupBarrier();
    let rounds = (end - begin + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    for (var round = 0u; round < rounds; round++) {
        let position = begin + round * WORKGROUP_SIZE + thread.local_index;
        if (position < end) {
            let cell = cells[position];
            if (position == begin || cells[position - 1u] != cell) {
                atomicStore(&firsts[slot_of(cell - first_cell)], position);
            }
        }
    }
    workgroupBarrier();
    var earliest = end;
    for (var item = 0u; item < ITEMS; item++) {
        earliest = min(earliest, atomicLoad(&firsts[slot_of(thread.local_index * ITEMS + item)]));
    }
    var front = 0u;
    later[thread.local_index] = earliest;
    workgroupBarrier();
    for (var step = 1u; step < WORKGROUP_SIZE; step *= 2u) {
        var value = later[front + thread.local_index];
        if (thread.local_index + step < WORKGROUP_SIZE) {
            value = min(value, later[front + thread.local_index + step]);
        }
        front = WORKGROUP_SIZE - front;
        later[front + thread.local_index] = value;
        workgroupBarrier();
    }
    // Backward, because an empty cell starts at the start of the next cell.
    var start = end;
    if (thread.local_index + 1u < WORKGROUP_SIZE) {
        start = later[front + thread.local_index + 1u];
    }
    for (var item = 0u; item < ITEMS; item++) {
        let slot = slot_of(thread.local_index * ITEMS + (ITEMS - 1u - item));
        start = min(start, atomicLoad(&firsts[slot]));
        atomicStore(&firsts[slot], start);
    }
    workgroupBarrier();
    for (var item = 0u; item < ITEMS; item++) {
        let number = item * WORKGROUP_SIZE + thread.local_index;
        if (first_cell + number < counters) {
            starts[first_cell + number] = atomicLoad(&firsts[slot_of(number)]);
        }
    }
}
