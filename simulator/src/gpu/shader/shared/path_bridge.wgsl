// Paths that diffuse and drift past a receiver within a step: Brownian bridges; see path_hit.rs. Halves of segment k
// are 2k and 2k + 1, visited in the order of time.

// Largest drift of a segment, in radii of the receiver and in the segment's sqrt(2 D dt).
const SEGMENT_DRIFT = vec2<f32>(0.0625, 0.125);
const BEND: f32 = 3.1;
// Segments from this number are not halved; its bits without the first; all segments.
const LAST: u32 = 4096u;
const LEVELS: u32 = 12u;
const SEGMENTS: u32 = 8191u;

fn is_long(drift: f32, spread: f32, radius: f32) -> bool {
    return drift > SEGMENT_DRIFT.x * radius && drift > SEGMENT_DRIFT.y * spread;
}

fn power_of_half(k: u32) -> f32 {
    return bitcast<f32>((127u - k) << 23u);
}

// A path, or its piece between two corners at the side of a vessel.
struct PathPiece {
    start: vec3<f32>,
    end: vec3<f32>,
    begin: f32,
    part: f32,
    // Added to numbers of segments in draws.
    first: u32,
}

// `lengths` are the drift, sqrt(2 D dt), and the particle's radius.
fn piece_hit(event: EventRow, receiver: ReceiverRow, piece: PathPiece, lengths: vec3<f32>, id: u32) -> Hit {
    var ends: array<vec3<f32>, LEVELS + 1u>;
    ends[0] = piece.end;
    var start = piece.start;
    var number = 1u;
    var level = 0u;
    for (var k = 0u; k < SEGMENTS; k++) {
        let to = ends[level];
        let own = power_of_half(level);
        let part = piece.part * own;
        let begin = piece.begin + f32(number - (1u << level)) * part;
        let spread = lengths.y * power_of_half(level / 2u) * select(1.0, 0.70710677, (level & 1u) != 0u);
        let middle = start + 0.5 * (to - start);
        let half = 0.5 * length(to - start - part * receiver.displacement);
        let center = receiver.center + (begin + 0.5 * part) * receiver.displacement;
        let is_near = signed_distance(event.radius, center, confined(middle, lengths.z)) <= half + BEND * spread;
        if (is_near && number < LAST && is_long(own * lengths.x, spread, event.radius)) {
            let words = philox(vec4(id, piece.first + number, control.step, PURPOSE_PATH), params.key);
            level++;
            number *= 2u;
            ends[level] = middle + 0.5 * spread * flattened(normals(words));
            continue;
        }
        if (is_near) {
            let confined_ends = mat2x3(confined(start, lengths.z), confined(to, lengths.z));
            let first = receiver.center + begin * receiver.displacement;
            let last = receiver.center + (begin + part) * receiver.displacement;
            let heights = heights_between(event.radius, mat2x3(first, last), confined_ends);
            if (hits_sphere(event, heights, 0.5 * spread * spread, id, piece.first + number - 1u)) {
                return Hit(true, begin, part, heights / spread);
            }
        }
        start = to;
        // Leaves all segments that end here. Their numbers are odd.
        let finished = countTrailingZeros(~number);
        number >>= finished;
        if (number == 0u) {
            break;
        }
        level -= finished;
        number++;
        ends[level] = ends[level - 1u];
    }
    return hit_at(false, 0.0);
}

fn bridge_hit(event: EventRow, receiver: ReceiverRow, path: Path, lengths: vec3<f32>, id: u32) -> Hit {
    let inset = params.vessel_radius - lengths.z;
    if (!turns_at_side(path, path.free_end, inset)) {
        return piece_hit(event, receiver, PathPiece(path.before, path.end, 0.0, 1.0, 0u), lengths, id);
    }
    let whole = path.end - path.before;
    let along = whole - across(whole);
    var start = path.before;
    var displacement = across(path.free_end - path.before);
    var begin = 0.0;
    for (var k = 0u; k <= VESSEL_REFLECTIONS; k++) {
        let rest = 1.0 - begin;
        let time = min(time_to_side(across_vessel(start), displacement, inset), 1.0);
        let part = time * rest;
        let end = start + time * (displacement + rest * along);
        let own = vec3(part * lengths.x, sqrt(part) * lengths.y, lengths.z);
        let hit = piece_hit(event, receiver, PathPiece(start, end, begin, part, k * 2u * LAST), own, id);
        if (hit.is_hit || time >= 1.0) {
            return hit;
        }
        start = end;
        begin += part;
        let normal = across_vessel(start) / inset;
        displacement *= 1.0 - time;
        displacement -= 2.0 * dot(displacement, normal) * normal;
    }
    return hit_at(false, 0.0);
}
