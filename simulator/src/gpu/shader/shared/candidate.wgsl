struct Candidate {
    // Indices of the reactants, in the order of the reaction.
    at: vec2<u32>,
    ids: vec2<u32>,
    rule: u32,
    priority: u32,
}

struct Claim {
    // The best key of a round: a priority, and the id of the other particle, which breaks ties.
    priority: atomic<u32>,
    other: atomic<u32>,
    is_taken: atomic<u32>,
    // Its new species, or NOTHING if the particle is consumed.
    product: u32,
    // Center and radius of the product.
    sphere: vec4<f32>,
}

// A reaction of two species. The table begins with the first row of each pair of species, for both orders of the pair;
// further reactions of the pair follow after all of these.
struct ReactionRow {
    reaction: u32,
    // Next rows if the draw does not select this one, and if the pair is farther apart than `within`; NOTHING at the
    // end.
    next: u32,
    next_shell: u32,
    // Species of the first reactant, or NOTHING if the species do not react.
    first: u32,
    threshold: u32,
    // Bits 0 and 1: the reactant is consumed. Bit 2: the detector's cutoff is larger than `within`. Bit 3: the products
    // are placed apart.
    flags: u32,
    products: vec2<u32>,
    radii: vec2<f32>,
    within: f32,
    unbinding: f32,
    // The first reactant's fraction of the distance to the meeting point, and the first product's of `unbinding`.
    share: f32,
    first_share: f32,
    // Speeds of both reactants, and speeds and thermal speeds of both products.
    speeds: vec2<f32>,
    product_speeds: vec2<f32>,
    thermal_speeds: vec2<f32>,
}

fn claims_it(rule: ReactionRow, side: u32) -> bool {
    return (rule.flags & (1u << side)) != 0u;
}
