// Reduces the spheres to bounds and counts per size class, and clears the call's counters.

var<workgroup> group_low: array<atomic<u32>, 3>;
var<workgroup> group_high: array<atomic<u32>, 3>;
var<workgroup> group_smallest: atomic<u32>;
var<workgroup> group_quarantined: atomic<u32>;
var<workgroup> group_members: array<atomic<u32>, MAX_SIDES * CLASSES>;
var<workgroup> group_largest: array<atomic<u32>, 256>;

struct Streak {
    // The size class plus CLASSES times the side.
    size_class: u32,
    members: u32,
    largest: u32,
}

struct ThreadStats {
    low: vec3<u32>,
    high: vec3<u32>,
    smallest: u32,
    quarantined: u32,
    streak: Streak,
}

fn end_streak(streak: Streak) {
    if (streak.members != 0u) {
        atomicAdd(&group_members[streak.size_class], streak.members);
        atomicMax(&group_largest[streak.size_class % CLASSES], streak.largest);
    }
}

fn add_sphere(own: ptr<function, ThreadStats>, index: u32, sphere: vec4<f32>) {
    if (!is_accepted(index, sphere)) {
        (*own).quarantined += 1u;
        return;
    }
    if (!may_pair(index, sphere)) {
        return;
    }
    let radius = bitcast<u32>(effective_radius(index, sphere));
    (*own).low = max((*own).low, ~to_sortable(sphere.xyz));
    (*own).high = max((*own).high, to_sortable(sphere.xyz));
    (*own).smallest = max((*own).smallest, ~radius);
    let size_class = side_of(index) * CLASSES + (radius >> 23u);
    if ((*own).streak.size_class != size_class) {
        end_streak((*own).streak);
        (*own).streak = Streak(size_class, 0u, 0u);
    }
    (*own).streak.members += 1u;
    (*own).streak.largest = max((*own).streak.largest, radius);
}

// Whole workgroups must call it. Threads stride over the spheres.
fn reduce_stats(first: u32, stride: u32, thread: Thread) {
    let local_index = thread.local_index;
    for (var side = 0u; side < params.sides; side++) {
        atomicStore(&group_members[side * CLASSES + local_index], 0u);
    }
    atomicStore(&group_largest[local_index], 0u);
    if (local_index < 3u) {
        atomicStore(&group_low[local_index], 0u);
        atomicStore(&group_high[local_index], 0u);
    }
    if (local_index == 0u) {
        atomicStore(&group_smallest, 0u);
        atomicStore(&group_quarantined, 0u);
    }
    workgroupBarrier();

    let count = min(count_source[0], params.spheres);
    var own = ThreadStats(vec3(0u), vec3(0u), 0u, 0u, Streak(0u, 0u, 0u));
    // Four loads are in flight at once.
    let rounds = (count + 4u * stride - 1u) / (4u * stride);
    for (var round = 0u; round < rounds; round++) {
#repeat K 4
        let index_#{K} = first + (4u * round + #{K}u) * stride;
        let sphere_#{K} = spheres[min(index_#{K}, count - 1u)];
#end
#repeat K 4
        if (index_#{K} < count) {
            add_sphere(&own, index_#{K}, sphere_#{K});
        }
#end
    }
    end_streak(own.streak);
    for (var axis = 0u; axis < 3u; axis++) {
        let lowest = max_in_subgroup(own.low[axis]);
        let highest = max_in_subgroup(own.high[axis]);
        if (is_leader(thread)) {
            atomicMax(&group_low[axis], lowest);
            atomicMax(&group_high[axis], highest);
        }
    }
    let least = max_in_subgroup(own.smallest);
    if (is_leader(thread)) {
        atomicMax(&group_smallest, least);
    }
    if (own.quarantined != 0u) {
        atomicAdd(&group_quarantined, own.quarantined);
    }
    clear_counters(first, stride);
    workgroupBarrier();

    for (var side = 0u; side < params.sides; side++) {
        let members = atomicLoad(&group_members[side * CLASSES + local_index]);
        if (members != 0u) {
            atomicAdd(&stats.members[side * CLASSES + local_index], members);
            atomicMax(&stats.largest[local_index], atomicLoad(&group_largest[local_index]));
        }
    }
    if (local_index < 3u) {
        atomicMax(&stats.low[local_index], atomicLoad(&group_low[local_index]));
        atomicMax(&stats.high[local_index], atomicLoad(&group_high[local_index]));
    }
    if (local_index == 0u) {
        atomicMax(&stats.smallest, atomicLoad(&group_smallest));
        let bad = atomicLoad(&group_quarantined);
        if (bad != 0u) {
            atomicAdd(&stats.quarantined, bad);
        }
    }
}

fn clear_counters(first: u32, stride: u32) {
    let rounds = (params.counters + stride - 1u) / stride;
    for (var round = 0u; round < rounds; round++) {
        let counter = first + round * stride;
        if (counter < params.counters) {
            starts[counter] = 0u;
        }
    }
    let density_rounds = (params.occupancy_slots + stride - 1u) / stride;
    for (var round = 0u; round < density_rounds; round++) {
        let counter = first + round * stride;
        if (counter < params.occupancy_slots) {
            occupancy[counter] = 0u;
        }
    }
}
