// Reserves positions and returns the first, at or above the capacity if nothing may be written. The length continues
// past the capacity, in 64 bits. Between the wrap of the low word and the increment of the high word, another thread
// may overwrite a used position. An item may then mix two items, but the exact length shows that the list is
// incomplete. Reading the high word again would not help, because atomics on different words are not ordered.
fn #{ARGUMENT}_reserve(count: u32) -> u32 {
    let first = atomicAdd(&outcome.#{ARGUMENT}_lo, count);
    if (first > 0xffffffffu - count) {
        atomicAdd(&outcome.#{ARGUMENT}_hi, 1u);
        return 0xffffffffu;
    }
    return select(first, 0xffffffffu, atomicLoad(&outcome.#{ARGUMENT}_hi) != 0u);
}
