// Reserves positions in the list whose length is `outcome.#{ARGUMENT}`, a 64-bit number that continues past the list's
// capacity. Returns the first position, at or above the capacity if nothing may be written. Between the wrap of the low
// word and the increment of the high word, another thread may get and overwrite a used position. The length stays exact
// and above the capacity, so the list is known to be incomplete, but an item may consist of halves of two items.
// Reading the high word again would not help, because atomics on different words are not ordered.
fn #{ARGUMENT}_reserve(count: u32) -> u32 {
    let first = atomicAdd(&outcome.#{ARGUMENT}_lo, count);
    if (first > 0xffffffffu - count) {
        atomicAdd(&outcome.#{ARGUMENT}_hi, 1u);
        return 0xffffffffu;
    }
    return select(first, 0xffffffffu, atomicLoad(&outcome.#{ARGUMENT}_hi) != 0u);
}
