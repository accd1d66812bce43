// A particle after its own step. A removed one has a radius of -1 until the end of the step, or less if a receiver
// removed it, which the radius names.
struct Moved {
    sphere: vec4<f32>,
    species: u32,
    velocity: vec3<f32>,
}

const MAX_DECAYS: u32 = 64u;
const ARRIVAL_UNIT: f32 = 0x1p-17;

// The radius of a particle that a receiver removed; log_arrival reads it.
fn radius_of_arrived(receiver: u32) -> f32 {
    return -1.0 - f32(receiver + 1u) * ARRIVAL_UNIT;
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

// The part of `left` steps after which a given decay happened; `rate` is per step.
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

// A further decay of a particle that exists for `left` of the step, or NOTHING.
fn next_decay(kind: SpeciesRow, left: f32, word: u32) -> u32 {
    if (kind.decays_begin == kind.walls_begin) {
        return NOTHING;
    }
    let ratio = unit_32(word) / probability_within(kind.decay_rate * left);
    for (var k = kind.decays_begin; k < kind.walls_begin; k++) {
        if (ratio < event_rows[k].share) {
            return k;
        }
    }
    return NOTHING;
}

// Decays a particle without another event, then its products for the rest of the step; see decay.rs.
fn decay(moved: Moved, id: u32) -> Moved {
    var here = moved;
    var kind = species_rows[here.species];
    if (kind.decays_begin == kind.walls_begin) {
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
        if (found == NOTHING) {
            break;
        }
        let event = event_rows[found];
        atomicAdd(&control.tallies[event.tally], 1u);
        if (event.product == NOTHING) {
            here.sphere.w = -1.0;
            break;
        }
        left -= decay_time(kind.decay_rate, left, words.y);
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
