fn to_sortable(value: vec3<f32>) -> vec3<u32> {
    let bits = bitcast<vec3<u32>>(value);
    return select(~bits, bits | vec3(0x80000000u), bits < vec3(0x80000000u));
}

fn from_sortable(key: u32) -> f32 {
    return bitcast<f32>(select(~key, key & 0x7fffffffu, key >= 0x80000000u));
}
