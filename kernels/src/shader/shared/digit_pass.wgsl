struct RadixPass {
    shift: u32,
    mask: u32,
    is_first: u32,
}

fn digit_of(key: u32) -> u32 {
    return (key >> digit_pass.shift) & digit_pass.mask;
}
