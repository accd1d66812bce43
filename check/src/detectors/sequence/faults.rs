use crate::{Random, TestInput};

pub(super) fn spoil(random: &mut Random, scenario: &mut TestInput, radius: f32) -> &'static str {
    let n = scenario.spheres.len() as u32;
    if n == 0 {
        return "nothing to spoil";
    }
    if let (Some(mixture), 0) = (&mut scenario.mixture, random.below(5)) {
        if random.below(3) == 0 {
            scenario.mixture = None;
            return "no species";
        }
        let id = mixture.rows.len() as u32 + random.below(2) * (u32::MAX / 2);
        mixture.species[random.below(n) as usize] = id;
        return "a species out of range";
    }
    let times = 1 + random.below(3) / 2;
    let kind = random.below(8);
    for _ in 0..times {
        let sphere = &mut scenario.spheres[random.below(n) as usize];
        let axis = random.below(3) as usize;
        match kind {
            0 => sphere.center[axis] = f32::NAN,
            1 => sphere.center[axis] = f32::INFINITY,
            2 => sphere.center = glam::Vec3::NEG_INFINITY,
            3 => sphere.radius = -5.0 * radius,
            4 => sphere.radius = -f32::from_bits(1),
            5 => sphere.radius = f32::NAN,
            6 => sphere.radius = f32::NEG_INFINITY,
            _ => sphere.radius = f32::INFINITY,
        }
    }
    match kind {
        0..=2 => "a center that is not finite",
        3 | 4 => "a negative radius",
        _ => "a radius that is not finite",
    }
}
