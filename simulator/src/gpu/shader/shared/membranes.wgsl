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
    // Parts of a step; see gaps.rs.
    substeps: u32,
}

// Rows of the next planes at or below a coordinate and above it, or NOTHING.
struct Slab {
    low: u32,
    high: u32,
}

fn membrane_plane(k: u32) -> MembranePlane {
    let row = scene_rows[k];
    let substeps = (row.w >> 2u) & 511u;
    return MembranePlane(bitcast<f32>(row.x), bitcast<f32>(row.y), bitcast<f32>(row.z), row.w & 3u, row.w >> 11u, substeps);
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
        y = select(y, 2.0 * high.position - y, y >= high.position);
        if (slab.low != NOTHING && y < low.position) {
            let width = high.position - low.position;
            let rest = y - low.position - 2.0 * width * floor((y - low.position) / (2.0 * width));
            y = low.position + (width - abs(width - rest));
        }
        y = min(y, high.below);
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

struct HeldEnd {
    free: f32,
    confined: f32,
}

// `spread` is the standard deviation.
fn substep_end(kind: SpeciesRow, axis: u32, ends: vec2<f32>, spread: f32, id: u32, substep: u32) -> HeldEnd {
    var end = ends.y;
    var slab = slab_around(kind, axis, ends.x);
    let nearer = nearer_plane(slab, ends);
    let plane = membrane_plane(nearer);
    let sign = select(-1.0, 1.0, nearer == slab.low);
    let heights = sign * (ends - plane.position);
    let words = philox(vec4(id, plane.membrane, control.step, PURPOSE_MEMBRANE | (substep << 8u)), params.key);
    let lowest = lowest_point(heights, spread, words.x);
    if (lowest < 0.0) {
        let passes = unit_32(words.y) < 0.5 * one_minus_exp(-plane.rate * lowest);
        end = plane.position + select(sign, -sign, passes) * (heights.y - lowest);
        if (passes) {
            slab = slab_around(kind, axis, select(plane.position, plane.below, sign > 0.0));
        }
    }
    end = mirrored_in(slab, end);
    let after = confined_axes(vec3(end), kind.radius)[axis];
    return HeldEnd(end, select(mirrored_in(slab, after), after, params.axes[axis] == 2u));
}

// See gaps.rs.
fn is_clear_of_planes(kind: SpeciesRow, axis: u32, ends: vec2<f32>) -> bool {
    for (var k = 0u; k < kind.membrane_planes.y; k++) {
        let plane = membrane_plane(kind.membrane_planes.x + k);
        let heights = ends - plane.position;
        if (plane.axis == axis && 2.0 * heights.x * heights.y < NEVER * kind.length * kind.length) {
            return false;
        }
    }
    return true;
}

// Takes substeps of a Brownian bridge.
fn held_end(kind: SpeciesRow, axis: u32, ends: vec2<f32>, substeps: u32, id: u32) -> HeldEnd {
    if (substeps == 1u || is_clear_of_planes(kind, axis, ends)) {
        return substep_end(kind, axis, ends, kind.length, id, 0u);
    }
    let spread = kind.length / sqrt(f32(substeps));
    var whole = HeldEnd(ends.x, ends.x);
    var sign = 1.0;
    var rest = ends.y - ends.x;
    for (var substep = 0u; substep < substeps; substep++) {
        let left = f32(substeps - substep);
        let words = philox(vec4(id, 0xffffffffu - axis, control.step, PURPOSE_MEMBRANE | (substep << 8u)), params.key);
        let displacement = rest / left + spread * sqrt(1.0 - 1.0 / left) * normals(words).x;
        rest -= displacement;
        let at = whole.confined;
        let held = substep_end(kind, axis, vec2(at, at + displacement), spread, id, substep);
        whole = HeldEnd(whole.free + sign * (held.free - at), held.confined);
        sign = select(sign, -sign, reversed_axes(vec3(held.free), kind.radius)[axis]);
    }
    return whole;
}

fn hold_back_by_planes(start: Path, kind: SpeciesRow, axis: u32, id: u32) -> Path {
    var path = start;
    let ends = vec2(path.before[axis], path.free_end[axis]);
    let nearer = nearer_plane(slab_around(kind, axis, ends.x), ends);
    if (nearer == NOTHING) {
        return path;
    }
    let held = held_end(kind, axis, ends, membrane_plane(nearer).substeps, id);
    path.free_end = with_component(path.free_end, axis, held.free);
    path.end = with_component(path.end, axis, held.free);
    path.after = with_component(path.after, axis, held.confined);
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
