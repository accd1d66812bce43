// Two particles that may react.
struct Candidate {
    // The reactants in the order of the reaction.
    at: vec2<u32>,
    // Their ids, in that order.
    ids: vec2<u32>,
    rule: u32,
    priority: u32,
}

// What a particle is claimed for.
struct Claim {
    // The best candidate of a round: its priority, and the id of its other particle, which decides between equals.
    priority: atomic<u32>,
    other: atomic<u32>,
    // 0 as long as the particle is free, 1 once it has reacted.
    is_taken: atomic<u32>,
    // What it turns into; NOTHING where it is used up.
    product: u32,
    // Where the product goes, with its radius.
    sphere: vec4<f32>,
}

// A reaction between two species, as seen from a pair of them. Two entries of the table have the same reaction.
struct Rule {
    reaction: u32,
    // The species that is the first reactant; NOTHING where nothing reacts.
    first: u32,
    up_to: u32,
    // Bits 0 and 1: whether the first and the second reactant are used up. Bit 2: the detector looks further than
    // `within`. Bit 3: products go apart.
    flags: u32,
    products: vec2<u32>,
    radii: vec2<f32>,
    within: f32,
    unbinding: f32,
    // How much of the way to the meeting point is the first reactant's, and to each other the first product's.
    share: f32,
    first_share: f32,
}

fn claims_it(rule: Rule, side: u32) -> bool {
    return (rule.flags & (1u << side)) != 0u;
}
