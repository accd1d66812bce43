// Tags are species and id. From the motion to the end of a step, the highest bit marks products of decays that, against
// their random words, do not dissociate in its rest; see decay.rs.
const SPARED: u32 = 0x80000000u;

// Removes the mark, which remains if a step halts.
fn species_of(tag: vec2<u32>) -> u32 {
    return tag.x & ~SPARED;
}
