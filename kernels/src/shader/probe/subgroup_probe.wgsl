// Tests two assumptions that no API promises: subgroups are full, and lanes follow local indices.
#include thread

struct SubgroupProbe {
    faults: atomic<u32>,
    invocations: atomic<u32>,
    smallest: atomic<u32>,
    largest: atomic<u32>,
}

@group(0) @binding(0) var<storage, read_write> probe: SubgroupProbe;

@compute @workgroup_size(256)
fn subgroup_probe(
#include thread_builtins
) {
#include thread_from_builtins
    atomicAdd(&probe.invocations, 1u);
#ifdef SUBGROUPS
    let present = countOneBits(subgroupBallot(true));
    let size = thread.subgroup_size;
    let is_full = present.x + present.y + present.z + present.w == size && size * thread.subgroups == 256u;
    let before = subgroupExclusiveAdd(1u);
    let is_in_order = thread.subgroup * size + thread.lane == thread.local_index && before == thread.lane;
    atomicOr(&probe.faults, select(1u, 0u, is_full) | select(2u, 0u, is_in_order));
    atomicMin(&probe.smallest, size);
    atomicMax(&probe.largest, size);
#else
    atomicOr(&probe.faults, 4u);
#endif
}
