// The species and the id of a particle. From the motion to the end of a step, the highest bit marks particles that decays
// formed in the step and that do not dissociate in its rest, though their random words say so for a whole step; see
// decay.rs.
const SPARED: u32 = 0x80000000u;

// Returns the species without the mark, which remains if a step halts.
fn species_of(tag: vec2<u32>) -> u32 {
    return tag.x & ~SPARED;
}
