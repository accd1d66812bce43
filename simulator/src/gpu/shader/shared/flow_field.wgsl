// See flow_field.rs and vessel_flow.rs.

fn field_velocity(point: vec3<f32>) -> vec3<f32> {
    let last = params.field_points - vec3(1u);
    let at = clamp((point - params.field_origin) / params.field_spacing, vec3(0.0), vec3<f32>(last));
    let first = min(vec3<u32>(at), max(last, vec3(1u)) - vec3(1u));
    let fraction = at - vec3<f32>(first);
    var sum = vec3(0.0);
    for (var corner = 0u; corner < 8u; corner++) {
        let upper = (vec3(corner) >> vec3(0u, 1u, 2u)) & vec3(1u);
        let weight = select(1.0 - fraction, fraction, upper == vec3(1u));
        let p = min(first + upper, last);
        let index = (p.x * params.field_points.y + p.y) * params.field_points.z + p.z;
        let velocity = bitcast<vec3<f32>>(scene_rows[params.field_at + index].xyz);
        sum += weight.x * weight.y * weight.z * velocity;
    }
    return sum;
}

// The predicted `end` is without flow and walls.
fn carried_by_field(before: vec3<f32>, end: vec3<f32>, radius: f32) -> vec3<f32> {
    if (params.field_points.x == 0u) {
        return vec3(0.0);
    }
    let first = field_velocity(before);
    let last = field_velocity(confined(end + params.flow_duration * first, radius));
    return 0.5 * params.flow_duration * (first + last);
}
