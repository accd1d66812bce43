#include evaluation_order

// Above this radius, rounding may lose half a skin.
const LARGE: f32 = 1e30;

// Returns the radius plus half the skin, finite and rounded up by more than the rounding error.
fn inflated_radius(radius: f32) -> f32 {
    return min(inflated_sum(radius, skin.half_skin, 0x1.00002p0), 0x1.fffffep127);
}
