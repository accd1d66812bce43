// See membrane.rs.
#include membrane_spheres

struct MembranePlane {
    position: f32,
    // Largest coordinate on the other side.
    below: f32,
    // 2 kappa / D.
    rate: f32,
    axis: u32,
    membrane: u32,
}

// Rows of the next planes at or below a coordinate and above it, or NOTHING.
struct Slab {
    low: u32,
    high: u32,
}

fn membrane_plane(k: u32) -> MembranePlane {
    let row = scene_rows[k];
    return MembranePlane(bitcast<f32>(row.x), bitcast<f32>(row.y), bitcast<f32>(row.z), row.w & 3u, row.w >> 2u);
}

fn slab_around(kind: SpeciesRow, axis: u32, x: f32) -> Slab {
    var slab = Slab(NOTHING, NOTHING);
    var low = 0.0;
    var high = 0.0;
    for (var k = 0u; k < kind.membrane_planes.y; k++) {
        let row = kind.membrane_planes.x + k;
        let plane = membrane_plane(row);
        if (plane.axis != axis) {
            continue;
        }
        if (plane.position <= x && (slab.low == NOTHING || plane.position > low)) {
            slab.low = row;
            low = plane.position;
        }
        if (plane.position > x && (slab.high == NOTHING || plane.position < high)) {
            slab.high = row;
            high = plane.position;
        }
    }
    return slab;
}

fn mirrored_in(slab: Slab, x: f32) -> f32 {
    var y = x;
    let low = membrane_plane(select(slab.low, 0u, slab.low == NOTHING));
    if (slab.low != NOTHING && y < low.position) {
        y = 2.0 * low.position - y;
    }
    if (slab.high != NOTHING) {
        let high = membrane_plane(slab.high);
        y = min(select(y, 2.0 * high.position - y, y >= high.position), high.below);
    }
    return select(max(y, low.position), y, slab.low == NOTHING);
}

fn nearer_plane(slab: Slab, ends: vec2<f32>) -> u32 {
    if (slab.low == NOTHING || slab.high == NOTHING) {
        return min(slab.low, slab.high);
    }
    let below = ends - membrane_plane(slab.low).position;
    let above = membrane_plane(slab.high).position - ends;
    return select(slab.high, slab.low, below.x + below.y < above.x + above.y);
}

fn hold_back_by_planes(start: Path, kind: SpeciesRow, axis: u32, id: u32) -> Path {
    var path = start;
    let before = path.before[axis];
    var end = path.free_end[axis];
    var slab = slab_around(kind, axis, before);
    let nearer = nearer_plane(slab, vec2(before, end));
    if (nearer == NOTHING) {
        return path;
    }
    let plane = membrane_plane(nearer);
    let sign = select(-1.0, 1.0, nearer == slab.low);
    let heights = sign * (vec2(before, end) - plane.position);
    let words = philox(vec4(id, plane.membrane, control.step, PURPOSE_MEMBRANE), params.key);
    let lowest = lowest_point(heights, kind.length, words.x);
    if (lowest < 0.0) {
        let passes = unit_32(words.y) < 0.5 * one_minus_exp(-plane.rate * lowest);
        end = plane.position + select(sign, -sign, passes) * (heights.y - lowest);
        if (passes) {
            slab = slab_around(kind, axis, select(plane.position, plane.below, sign > 0.0));
        }
    }
    end = mirrored_in(slab, end);
    path.free_end = with_component(path.free_end, axis, end);
    path.end = with_component(path.end, axis, end);
    let after = confined_axes(path.free_end, kind.radius)[axis];
    let held = select(mirrored_in(slab, after), after, params.axes[axis] == 2u);
    path.after = with_component(path.after, axis, held);
    return path;
}

fn is_separated(kind: SpeciesRow, a: vec3<f32>, b: vec3<f32>) -> bool {
    let c = a + minimum_image(b - a);
    for (var k = 0u; k < kind.membrane_planes.y; k++) {
        let plane = membrane_plane(kind.membrane_planes.x + k);
        if ((a[plane.axis] >= plane.position) != (c[plane.axis] >= plane.position)) {
            return true;
        }
    }
    return is_across_sphere(kind, a, b);
}

fn held_back(start: Path, kind: SpeciesRow, id: u32) -> Path {
    if (kind.membrane_planes.y + kind.membrane_spheres.y == 0u) {
        return start;
    }
    var path = start;
    var side = start.before;
    if (may_reach_sphere(kind, start)) {
        path = hold_back_by_spheres(start, kind, id);
        side = path.after;
    }
    for (var axis = 0u; axis < 3u; axis++) {
        path = hold_back_by_planes(path, kind, axis, id);
    }
    if (is_across_sphere(kind, side, path.after)) {
        return at_rest(start);
    }
    return path;
}
