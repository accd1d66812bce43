// Radii from which half a skin may be lost in them.
const LARGE: f32 = 1e30;

// The radius with which a sphere is kept. It grows by more than rounding takes away anywhere, and stays finite.
fn inflated_radius(radius: f32) -> f32 {
    return min((radius + skin.half_skin) * 0x1.00002p0, 0x1.fffffep127);
}
