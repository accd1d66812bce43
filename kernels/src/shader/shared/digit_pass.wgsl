struct RadixPass {
    // The lowest bit of this pass's digit, and what is left of a key shifted by that.
    shift: u32,
    mask: u32,
    // 1 where the payload is the place of each key, and is not read.
    is_first: u32,
}

fn digit_of(key: u32) -> u32 {
    return (key >> digit_pass.shift) & digit_pass.mask;
}
