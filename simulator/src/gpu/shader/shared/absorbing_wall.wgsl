// See wall.rs.

// Faces: low-x, high-x, low-y, high-y, low-z, high-z.
const SIDE: u32 = 6u;
const SPHERE: u32 = 4u;
const IMAGES: u32 = 6u;

// Negative beyond the wall.
fn wall_height(face: u32, radius: f32, point: vec3<f32>) -> f32 {
    if (face >= SIDE) {
        return params.vessel_radius - radius - length(across_vessel(point));
    }
    let axis = face / 2u;
    if (face % 2u == 0u) {
        return point[axis] - (params.low[axis] + radius);
    }
    return params.high[axis] - radius - point[axis];
}

// Combines terms of the CPU's `f64` sum, so that none cancels.
fn hit_from_inside(radius: f32, heights: vec2<f32>, diffusion: f32) -> f32 {
    if (diffusion >= radius * radius) {
        return 1.0;
    }
    let above = min(heights, vec2((1.0 - 1e-4) * radius));
    let ends = radius - above;
    let w = ends.x * ends.y / diffusion;
    var sum = 0.0;
    for (var k = 1u; k <= IMAGES; k++) {
        let far = f32(k) * radius;
        let rest = far - radius + above;
        let inner = -rest.x * rest.y / diffusion;
        let outer = -(far + ends.x) * (far + ends.y) / diffusion;
        if (w < 0.5) {
            let u = 2.0 * far * ends / diffusion;
            let product = one_minus_exp(u.x) * one_minus_exp(u.y) / one_minus_exp(w);
            sum += exp(inner + w) * (product - 1.0) - exp(outer + w);
        } else {
            let crossed = exp(-far * (rest.x + ends.y) / diffusion) + exp(-far * (rest.y + ends.x) / diffusion);
            sum += (exp(inner) + exp(outer) - crossed) / one_minus_exp(w);
        }
    }
    return sum;
}

// For a vessel, the point itself.
fn foot_at(face: u32, radius: f32, point: vec3<f32>) -> vec3<f32> {
    var foot = point;
    if (face < SIDE) {
        let axis = face / 2u;
        foot = with_component(foot, axis, select(params.high[axis] - radius, params.low[axis] + radius, face % 2u == 0u));
    }
    return foot;
}

// Reflections at receivers: the first contact, and the last segment, extended backwards to the length of a step.
struct PathTurns {
    exist: bool,
    contact: vec3<f32>,
    before: vec3<f32>,
    end: vec3<f32>,
}

fn without_turns() -> PathTurns {
    return PathTurns(false, vec3(0.0), vec3(0.0), vec3(0.0));
}

// Extends the path beyond absorbing planes, for surfaces in front of them.
fn aimed(kind: SpeciesRow, path: Path) -> Path {
    var end = path.end;
    var after = path.after;
    for (var k = kind.walls_begin; k < kind.events_end; k++) {
        let face = event_rows[k].kind - WALL;
        if (face < SIDE && wall_height(face, kind.radius, path.free_end) <= 0.0) {
            end = with_component(end, face / 2u, path.free_end[face / 2u]);
            after = with_component(after, face / 2u, path.free_end[face / 2u]);
        }
    }
    return Path(path.before, end, after, path.velocity, path.free_end, path.drift);
}

fn touch_probability(radius: f32, heights: vec2<f32>, diffusion: f32) -> f32 {
    if (heights.y <= 0.0) {
        return 1.0;
    }
    let product = heights.x * heights.y;
    if (product >= NEVER * diffusion) {
        return 0.0;
    }
    if (params.vessel_axis == SPHERE) {
        return hit_from_inside(params.vessel_radius - radius, heights, diffusion);
    }
    return exp(-product / diffusion);
}

fn wall_hit_of(event: EventRow, kind: SpeciesRow, path: Path, turns: PathTurns, id: u32) -> Hit {
    let face = event.kind - WALL;
    if (is_separated(kind, path.after, foot_at(face, kind.radius, path.after))) {
        return hit_at(false, 0.0);
    }
    let heights = vec2(wall_height(face, kind.radius, path.before), wall_height(face, kind.radius, path.free_end));
    if (heights.x <= 0.0) {
        return hit_at(true, 0.0);
    }
    var direct = touch_probability(kind.radius, heights, kind.diffusion);
    var turned = 0.0;
    var ends = heights;
    if (turns.exist) {
        if (heights.y <= 0.0 && face < SIDE && wall_height(face, kind.radius, turns.contact) > 0.0) {
            direct = 0.0;
        }
        let last = vec2(wall_height(face, kind.radius, turns.before), wall_height(face, kind.radius, turns.end));
        if (last.x > 0.0 || last.y <= 0.0) {
            turned = touch_probability(kind.radius, last, kind.diffusion);
            ends = last;
        }
    }
    let probability = direct + turned;
    if (probability <= 0.0) {
        return hit_at(false, 0.0);
    }
    if (probability < 1.0 || turned > 0.0) {
        let words = philox(vec4(id, event.receiver, control.step, PURPOSE_RECEIVER), params.key);
        let word = open_unit(words.x);
        if (probability < 1.0 && word >= probability) {
            return hit_at(false, 0.0);
        }
        if (turned > 0.0 && word >= direct) {
            return hit_between(ends, kind.diffusion);
        }
    }
    return hit_between(heights, kind.diffusion);
}

// The first hit so far, with its row, or NOTHING.
struct FirstHit {
    row: u32,
    hit: Hit,
}

fn first_with_walls(receiver: FirstHit, path: Path, turns: PathTurns, kind: SpeciesRow, id: u32) -> FirstHit {
    var first = receiver;
    for (var k = kind.walls_begin; k < kind.events_end; k++) {
        let event = event_rows[k];
        let hit = wall_hit_of(event, kind, path, turns, id);
        if (hit.is_hit && is_earlier(hit, event.receiver, first.hit, first.row, id)) {
            first = FirstHit(k, hit);
        }
    }
    return first;
}

fn captured_or_decayed(moved: Moved, first: FirstHit, kind: SpeciesRow, id: u32) -> Moved {
    if (first.row == NOTHING) {
        return decay(moved, Capture(NOTHING, 0.0), id);
    }
    return decay(moved, capture_of(first.row, first.hit, kind, id), id);
}
