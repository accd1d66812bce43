#include mover

fn displacement_at(a: Mover, b: Mover, time: f32) -> vec3<f32> {
    return minimum_image((b.base - a.base) + (offset_at(b, time) - offset_at(a, time)));
}

fn gap_at(a: Mover, b: Mover, time: f32) -> f32 {
    return length(displacement_at(a, b, time)) - (a.radius + b.radius);
}
