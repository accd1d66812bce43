// Brownian bridges; see path_hit.rs. Halves of segment k are 2k and 2k + 1, visited in the order of time.

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

// A path, or a segment between corners at the side of a vessel.
struct PathSegment {
    start: vec3<f32>,
    end: vec3<f32>,
    begin: f32,
    fraction: f32,
    // Added to numbers of segments in draws.
    first: u32,
}

// `lengths` are the drift, sqrt(2 D dt), and the particle's radius.
fn segment_hit(event: EventRow, receiver: ReceiverRow, segment: PathSegment, lengths: vec3<f32>, id: u32) -> Hit {
    var ends: array<vec3<f32>, LEVELS + 1u>;
    ends[0] = segment.end;
    var start = segment.start;
    var number = 1u;
    var level = 0u;
    for (var k = 0u; k < SEGMENTS; k++) {
        let to = ends[level];
        let fraction_of_segment = power_of_half(level);
        let fraction = segment.fraction * fraction_of_segment;
        let begin = segment.begin + f32(number - (1u << level)) * fraction;
        let spread = lengths.y * power_of_half(level / 2u) * select(1.0, 0.70710677, (level & 1u) != 0u);
        let middle = start + 0.5 * (to - start);
        let half = 0.5 * length(to - start - fraction * receiver.displacement);
        let center = receiver.center + (begin + 0.5 * fraction) * receiver.displacement;
        let is_near = signed_distance(event.radius, center, confined(middle, lengths.z)) <= half + BEND * spread;
        if (is_near && number < LAST && is_long(fraction_of_segment * lengths.x, spread, event.radius)) {
            let words = philox(vec4(id, segment.first + number, control.step, PURPOSE_PATH), params.key);
            level++;
            number *= 2u;
            ends[level] = middle + 0.5 * spread * flattened(normals(words));
            continue;
        }
        if (is_near) {
            let confined_ends = mat2x3(confined(start, lengths.z), confined(to, lengths.z));
            let first = receiver.center + begin * receiver.displacement;
            let last = receiver.center + (begin + fraction) * receiver.displacement;
            let heights = heights_between(event.radius, mat2x3(first, last), confined_ends);
            if (hits_sphere(event, heights, 0.5 * spread * spread, id, segment.first + number - 1u)) {
                return Hit(true, begin, fraction, heights / spread);
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
        return segment_hit(event, receiver, PathSegment(path.before, path.end, 0.0, 1.0, 0u), lengths, id);
    }
    let whole = path.end - path.before;
    let along = whole - across(whole);
    var start = path.before;
    var displacement = across(path.free_end - path.before);
    var begin = 0.0;
    for (var k = 0u; k <= VESSEL_REFLECTIONS; k++) {
        let rest = 1.0 - begin;
        let time = min(time_to_side(across_vessel(start), displacement, inset), 1.0);
        let fraction = time * rest;
        let end = start + time * (displacement + rest * along);
        let segment_lengths = vec3(fraction * lengths.x, sqrt(fraction) * lengths.y, lengths.z);
        let hit = segment_hit(event, receiver, PathSegment(start, end, begin, fraction, k * 2u * LAST), segment_lengths, id);
        if (hit.is_hit || time >= 1.0) {
            return hit;
        }
        start = end;
        begin += fraction;
        let normal = across_vessel(start) / inset;
        displacement *= 1.0 - time;
        displacement -= 2.0 * dot(displacement, normal) * normal;
    }
    return hit_at(false, 0.0);
}
