// Takes `count` places in the list whose length `outcome.#{ARGUMENT}` holds; the length goes on past the list's
// capacity, in 64 bits. Returns the first place, which is at or above the capacity when nothing may be written.
//
// While the low word has wrapped and the high one has not been raised yet, another thread may be given a place below
// the capacity that is in use, and write there. The number is exact nevertheless, and above the capacity, so that the
// list is known to be incomplete; but then an item in it may be made of halves of two. A later look at the high word
// would not mend that, as atomics of different words are not ordered.
fn #{ARGUMENT}_reserve(count: u32) -> u32 {
    let first = atomicAdd(&outcome.#{ARGUMENT}_lo, count);
    if (first > 0xffffffffu - count) {
        atomicAdd(&outcome.#{ARGUMENT}_hi, 1u);
        return 0xffffffffu;
    }
    return select(first, 0xffffffffu, atomicLoad(&outcome.#{ARGUMENT}_hi) != 0u);
}
