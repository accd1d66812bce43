fn unit_32(word: u32) -> f32 {
    return min((f32(word) + 0.5) * 0x1p-32, 0.99999994);
}
