// Takes `count` places in the list whose length `outcome.#{ARGUMENT}` holds; the length goes on past the list's
// capacity, in 64 bits. Returns the first place, which is at or above the capacity when nothing may be written.
fn #{ARGUMENT}_reserve(count: u32) -> u32 {
    let first = atomicAdd(&outcome.#{ARGUMENT}_lo, count);
    if (first > 0xffffffffu - count) {
        atomicAdd(&outcome.#{ARGUMENT}_hi, 1u);
        return 0xffffffffu;
    }
    return select(first, 0xffffffffu, atomicLoad(&outcome.#{ARGUMENT}_hi) != 0u);
}
