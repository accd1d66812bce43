struct Pass {
    // The lowest bit of this pass's digit.
    shift: u32,
}
