// Equal to philox.rs, word for word.
const PURPOSE_MOVE: u32 = 0u;
const PURPOSE_RECEIVER: u32 = 3u;
const PURPOSE_PAIR: u32 = 4u;
const PURPOSE_DECAY: u32 = 5u;
const PURPOSE_PATH: u32 = 6u;
const PURPOSE_DISSOCIATION: u32 = 7u;
const PURPOSE_TUMBLE: u32 = 11u;
const PURPOSE_UNBINDING: u32 = 13u;
const PURPOSE_HIT_TIME: u32 = 14u;
const PURPOSE_WALL: u32 = 15u;
const PURPOSE_MEMBRANE: u32 = 16u;
const PURPOSE_SURFACE_DIFFUSION: u32 = 17u;

fn wide(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    let cross = a1 * b0 + (low >> 16u);
    let middle = a0 * b1 + (cross & 0xffffu);
    return vec2(a * b, a1 * b1 + (cross >> 16u) + (middle >> 16u));
}

fn philox(start: vec4<u32>, start_key: vec2<u32>) -> vec4<u32> {
    var counter = start;
    var key = start_key;
    for (var round = 0u; round < 10u; round++) {
        let first = wide(0xD2511F53u, counter.x);
        let second = wide(0xCD9E8D57u, counter.z);
        counter = vec4(second.y ^ counter.y ^ key.x, second.x, first.y ^ counter.w ^ key.y, first.x);
        key += vec2(0x9E3779B9u, 0xBB67AE85u);
    }
    return counter;
}

fn open_unit(word: u32) -> f32 {
    return (f32(word >> 9u) + 0.5) * 0x1p-23;
}
