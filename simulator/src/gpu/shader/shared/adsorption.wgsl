// See adsorption.rs.
#include erfcx

// In sqrt(4 D dt); larger heights do not occur.
const FAR: f32 = 5.0;
const TRIALS: u32 = 1000u;

// kappa sqrt(dt / D), then with the effect of curvature, and sqrt(D dt).
struct Surface {
    own: f32,
    all: f32,
    length: f32,
    radius: f32,
}

fn surface_of(own: f32, length: f32, radius: f32) -> Surface {
    return Surface(own, own + length / radius, length, radius);
}

fn on_plane(surface: Surface, distances: f32) -> f32 {
    return min(ROOT_PI * surface.own * erfcx(surface.all + distances / (2.0 * surface.length)), 1.0);
}

// Between two heights, negative inside.
fn adsorption_probability(surface: Surface, a: f32, b: f32) -> f32 {
    let before = surface.radius + a;
    let after = surface.radius + b;
    let exponent = select(before * after, surface.radius * (a + b + surface.radius), b > 0.0);
    let image = one_minus_exp(exponent / (surface.length * surface.length));
    let near = on_plane(surface, a + abs(b));
    let far = on_plane(surface, before + after);
    if (image > 0.0) {
        return clamp(far + (near - far) / image, 0.0, 1.0);
    }
    return near;
}

// erfcx(y) - erfcx(x + y), by derivatives where the difference would cancel.
fn taken_from(x: f32, y: f32) -> f32 {
    let here = erfcx(y);
    if (x > 0.02) {
        return here - erfcx(x + y);
    }
    let first = 2.0 * y * here - 2.0 / ROOT_PI;
    let second = 2.0 * here + 2.0 * y * first;
    let third = 4.0 * first + 2.0 * y * second;
    return -x * (first + x * (0.5 * second + x * third / 6.0));
}

// The mean of erfcx(x * sqrt(t)) for t from 0 to 1.
fn mean_of(x: f32) -> f32 {
    if (x > 0.5) {
        return 2.0 / (x * x) * (0.5 * (erfcx(x) - 1.0) + x / ROOT_PI);
    }
    // The series of (-x)^n / gamma(n / 2 + 2).
    let high = 0.008333333333333333 - x * (0.003473605901592727 - x * (0.001388888888888889
        - x * (0.0005344009079373427 - x * 0.0001984126984126984)));
    return 1.0 - x * (0.752252778063675 - x * (0.5 - x * (0.3009011112254701 - x * (0.16666666666666666
        - x * (0.08597174606442003 - x * (0.041666666666666664 - x * (0.01910483245876 - x * high)))))));
}

// The adsorbed fraction of the flux: adsorbed particles are missing near the surface.
fn effective_part(surface: Surface) -> f32 {
    if (surface.own <= 0.0) {
        return 0.0;
    }
    let free = surface.length / (surface.radius * surface.all);
    return free + (1.0 - free) * mean_of(surface.all);
}

struct Draws {
    counter: vec4<u32>,
    words: vec4<u32>,
    used: u32,
}

fn word_of(draws: ptr<function, Draws>) -> u32 {
    if ((*draws).used == 4u) {
        (*draws).words = philox((*draws).counter, params.key);
        (*draws).counter.y += 1u;
        (*draws).used = 0u;
    }
    let word = (*draws).words[(*draws).used];
    (*draws).used += 1u;
    return word;
}

fn unit_of(draws: ptr<function, Draws>) -> f32 {
    return unit_32(word_of(draws));
}

fn height_after(surface: Surface, draws: ptr<function, Draws>) -> f32 {
    let scale = 2.0 * surface.length;
    let most = taken_from(surface.all, 0.0) * (1.0 + FAR * scale / surface.radius);
    var height = 0.0;
    for (var trial = 0u; trial < TRIALS; trial++) {
        let far = sqrt(-ln(unit_of(draws)));
        // At most a right angle: devices' cosines may be wrong in the fourth digit.
        let y = far * cos_sin(word_of(draws) >> 2u).x;
        let u = unit_of(draws);
        height = y * scale;
        if (y < FAR && u * most < taken_from(surface.all, y) * (1.0 + height / surface.radius)) {
            break;
        }
    }
    return height;
}
