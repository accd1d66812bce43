#include event_rows

fn receiver_at(receiver: u32, step: u32) -> ReceiverRow {
    let row = 2u * ((step - trajectory.first) * trajectory.stride + receiver);
    return ReceiverRow(bitcast<vec3<f32>>(scene_rows[row].xyz), bitcast<vec3<f32>>(scene_rows[row + 1u].xyz));
}

fn signed_distance(radius: f32, center: vec3<f32>, point: vec3<f32>) -> f32 {
    let d = minimum_image(point - center);
    return sqrt(d.x * d.x + d.y * d.y + d.z * d.z) - radius;
}
