// Stubs for models whose drift carries no particle past a receiver; they make kernels faster.

fn is_long(drift: f32, spread: f32, radius: f32) -> bool {
    return false;
}

fn bridge_hit(event: EventRow, receiver: ReceiverRow, path: Path, lengths: vec3<f32>, id: u32) -> Hit {
    return hit_at(false, 0.0);
}

fn line_time(event: EventRow, receiver: ReceiverRow, path: Path, radius: f32) -> f32 {
    let start = minimum_image(path.before - receiver.center);
    return entry_time(start, path.end - path.before - receiver.displacement, event.radius);
}
