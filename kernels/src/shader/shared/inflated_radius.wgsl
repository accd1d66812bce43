#include evaluation_order

// Above this radius, rounding may lose half a skin.
const LARGE: f32 = 1e30;

// Rounds up by more than the rounding error, but to a finite number.
fn inflated_radius(radius: f32) -> f32 {
    return min(inflated_sum(radius, skin.half_skin, 0x1.00002p0), 0x1.fffffep127);
}
