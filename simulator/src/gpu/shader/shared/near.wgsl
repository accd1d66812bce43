// Bindings of kernels that list neighbors.
#include control
#include params
#include boundary
#include candidate
#include window

// NextEvent by words; counts grow while lists are made.
struct Lists {
    words: array<atomic<u32>, 7>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> near_pairs: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> movers: array<Mover>;
@group(0) @binding(3) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> reaction_rows: array<ReactionRow>;
@group(0) @binding(5) var<storage, read_write> window: Window;
@group(0) @binding(6) var<storage, read_write> next_events: array<Lists>;

#include gap

// Returns the mark of a candidate pair: 0, PASSES if they overlap and may bounce, or NOTHING if no neighbors.
fn mark_of(pair: vec2<u32>) -> u32 {
    let a = movers[pair.x];
    let b = movers[pair.y];
    let touch = a.radius + b.radius;
    let gap = gap_at(a, b, window.now);
    if (touch <= 0.0 || gap > 2.0 * window.allowance) {
        return NOTHING;
    }
    var place = b.base + b.offset;
    if (a.id < b.id) {
        place = a.base + a.offset;
    }
    let reacts = reaction_rows[tags[pair.x].x * params.species + tags[pair.y].x].first != NOTHING;
    if (!reacts && -gap <= 4e-6 * (abs(place.x) + abs(place.y) + abs(place.z) + touch)) {
        return 0u;
    }
    return select(NOTHING, PASSES, params.is_elastic != 0u && window.now == 0.0 && gap < 0.0);
}
