struct RadixPass {
    // The lowest bit of the digit, and the mask of a key after the shift.
    shift: u32,
    mask: u32,
    // 1 if the payload is the index of each key, and is not read.
    is_first: u32,
}

fn digit_of(key: u32) -> u32 {
    return (key >> digit_pass.shift) & digit_pass.mask;
}
