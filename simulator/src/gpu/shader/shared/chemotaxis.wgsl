// See chemotaxis.rs.
#include unit_32

const NO_TAXIS: u32 = 0u;
const LINEAR: u32 = 1u;
const GAUSSIAN: u32 = 2u;
const SOURCE: u32 = 3u;

// Returns the gradient, then the concentration.
fn concentration_at(taxis: ChemotaxisRow, point: vec3<f32>) -> vec4<f32> {
    let r = minimum_image(point - taxis.center);
    if (taxis.profile == LINEAR) {
        let c = taxis.level + dot(r, taxis.gradient);
        return select(vec4(0.0), vec4(taxis.gradient, c), c > 0.0);
    }
    let scaled = r / taxis.size;
    let square = dot(scaled, scaled);
    if (taxis.profile == GAUSSIAN) {
        let c = taxis.level * exp(-0.5 * square);
        return vec4(-c / taxis.size * scaled, c);
    }
    if (square <= 1.0) {
        return vec4(0.0, 0.0, 0.0, taxis.level);
    }
    let c = taxis.level / sqrt(square);
    return vec4(-c / square / taxis.size * scaled, c);
}

fn is_tumbling(kind: SpeciesRow, point: vec3<f32>, velocity: vec3<f32>, word: u32) -> bool {
    let taxis = kind.taxis;
    if (taxis.profile == NO_TAXIS) {
        return word <= kind.tumble_threshold;
    }
    let found = concentration_at(taxis, point);
    var rise = dot(found.xyz, velocity);
    if (taxis.saturates != 0u) {
        rise /= (1.0 + found.w) * (1.0 + found.w);
    }
    return unit_32(word) < taxis.probability * exp(-taxis.sensitivity * rise);
}
