// If removed, the radius is -1, or less to name the receiver.
struct Moved {
    sphere: vec4<f32>,
    species: u32,
    velocity: vec3<f32>,
    // See tag.wgsl.
    is_spared: bool,
}

// The event of a hit, unless the particle decays or dissociates before.
struct Capture {
    row: u32,
    // In steps.
    time: f32,
}

// Draws the time only if the species decays or dissociates.
fn capture_of(row: u32, hit: Hit, kind: SpeciesRow, id: u32) -> Capture {
    if (kind.decays_begin == kind.walls_begin && kind.dissociation_rate == 0.0) {
        return Capture(row, 0.0);
    }
    return Capture(row, time_of(hit, event_rows[row].receiver, id));
}

const MAX_DECAYS: u32 = 64u;
const ARRIVAL_UNIT: f32 = 0x1p-23;

// Inverse of log_arrival.
fn radius_of_arrived(receiver: u32, arrived: u32) -> f32 {
    if (params.logs_arrivals == 0u) {
        return -1.0;
    }
    return -1.0 - f32(receiver * params.species + arrived + 1u) * ARRIVAL_UNIT;
}

// 1 - exp(-x), without cancellation.
fn probability_within(x: f32) -> f32 {
    if (x > 0.1) {
        return 1.0 - exp(-x);
    }
    return x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0))));
}

// -ln(1 - x), without cancellation.
fn minus_ln_of_rest(x: f32) -> f32 {
    if (x > 0.1) {
        return -ln(1.0 - x);
    }
    return x * (1.0 + x * (1.0 / 2.0 + x * (1.0 / 3.0 + x * (1.0 / 4.0 + x * (1.0 / 5.0 + x * (1.0 / 6.0))))));
}

// The decay happens within `left` steps; `rate` is per step.
fn decay_time(rate: f32, left: f32, word: u32) -> f32 {
    return min(minus_ln_of_rest(unit_32(word) * probability_within(rate * left)) / rate, left);
}

fn first_decay(kind: SpeciesRow, word: u32) -> u32 {
    for (var k = kind.decays_begin; k < kind.walls_begin; k++) {
        if (word <= event_rows[k].threshold) {
            return k;
        }
    }
    return NOTHING;
}

fn next_decay(kind: SpeciesRow, left: f32, word: u32) -> u32 {
    if (kind.decays_begin == kind.walls_begin) {
        return NOTHING;
    }
    let ratio = unit_32(word) / probability_within(kind.decay_rate * left);
    for (var k = kind.decays_begin; k < kind.walls_begin; k++) {
        if (ratio < event_rows[k].cumulative_fraction) {
            return k;
        }
    }
    return NOTHING;
}

// Returns NOTHING if the receiver does not see the species. Rows ascend by receiver.
fn row_of_capture(row: u32, kind: SpeciesRow) -> u32 {
    let receiver = event_rows[row].receiver;
    let is_wall = event_rows[row].kind >= WALL;
    var begin = select(kind.events_begin, kind.walls_begin, is_wall);
    var end = select(kind.decays_begin, kind.events_end, is_wall);
    for (var k = 0u; k < 32u; k++) {
        if (begin >= end) {
            break;
        }
        let middle = begin + (end - begin) / 2u;
        let found = event_rows[middle].receiver;
        if (found == receiver) {
            return middle;
        }
        if (found < receiver) {
            begin = middle + 1u;
        } else {
            end = middle;
        }
    }
    return NOTHING;
}

fn arrive(moved: Moved, row: u32) -> Moved {
    let event = event_rows[row];
    atomicAdd(&control.tallies[event.tally], 1u);
    var here = moved;
    here.sphere.w = radius_of_arrived(event.receiver, here.species);
    return here;
}

// In steps from the beginning of the step or of the particle; 2 without a dissociation.
fn dissociation_time(kind: SpeciesRow, id: u32) -> f32 {
    if (kind.dissociation_rate == 0.0) {
        return 2.0;
    }
    if (philox(vec4(id, 0u, control.step, PURPOSE_DISSOCIATION), params.key).x > kind.dissociation_threshold) {
        return 2.0;
    }
    let words = philox(vec4(id, 1u, control.step, PURPOSE_DISSOCIATION), params.key);
    return decay_time(kind.dissociation_rate, 1.0, words.x);
}

// Dissociations count as decays.
fn decays_before(capture: Capture, species: u32, id: u32) -> bool {
    let kind = species_rows[species];
    if (kind.decays_begin == kind.walls_begin) {
        return dissociation_time(kind, id) < capture.time;
    }
    let words = philox(vec4(id, 0u, control.step, PURPOSE_DECAY), params.key);
    if (first_decay(kind, words.x) == NOTHING) {
        return false;
    }
    return 1.0 - decay_time(kind.decay_rate, 1.0, words.y) > 1.0 - capture.time;
}

// Decays a particle and its products up to a capture; see decay.rs.
fn decay(moved: Moved, capture: Capture, id: u32) -> Moved {
    var here = moved;
    var kind = species_rows[here.species];
    var row = capture.row;
    if (kind.decays_begin == kind.walls_begin) {
        if (row != NOTHING && dissociation_time(kind, id) >= capture.time) {
            here = arrive(here, row);
        }
        return here;
    }
    var left = 1.0;
    for (var generation = 0u; generation < MAX_DECAYS; generation++) {
        let words = philox(vec4(id, generation, control.step, PURPOSE_DECAY), params.key);
        var found = NOTHING;
        if (generation == 0u) {
            found = first_decay(kind, words.x);
        } else {
            found = next_decay(kind, left, words.x);
        }
        var remaining = left;
        if (found != NOTHING) {
            remaining -= decay_time(kind.decay_rate, left, words.y);
        }
        if (generation > 0u && kind.dissociation_rate != 0.0) {
            let time = dissociation_time(kind, id);
            here.is_spared = time <= 1.0 && time >= left;
            if (time < left && left - time > 1.0 - capture.time) {
                break;
            }
        }
        if (row != NOTHING && (found == NOTHING || remaining <= 1.0 - capture.time)) {
            row = row_of_capture(row, kind);
            if (row != NOTHING) {
                return arrive(here, row);
            }
        }
        if (found == NOTHING) {
            break;
        }
        let event = event_rows[found];
        atomicAdd(&control.tallies[event.tally], 1u);
        if (event.product == NOTHING) {
            here.sphere.w = -1.0;
            break;
        }
        left = remaining;
        let product = species_rows[event.product];
        // A larger product may overlap a wall.
        here.sphere = vec4(confined(here.sphere.xyz, product.radius), product.radius);
        let before = vec2(kind.speed, kind.thermal_speed);
        let after = vec2(product.speed, product.thermal_speed);
        here.velocity = converted_velocity(here.velocity, before, after, id, VELOCITY_OF_PRODUCT);
        here.species = event.product;
        kind = product;
    }
    return here;
}
