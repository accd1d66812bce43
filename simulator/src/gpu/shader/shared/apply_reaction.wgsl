fn apply_if_best(index: u32) {
    let candidate = candidates[index];
    let rule = reaction_rows[candidate.rule];
    for (var side = 0u; side < 2u; side++) {
        let at = candidate.at[side];
        if (claims_it(rule, side) && (atomicLoad(&claims[at].priority) != candidate.priority
            || atomicLoad(&claims[at].other) != candidate.ids[1u - side])) {
            return;
        }
    }
    react(candidate, rule);
}

// Reactions only read positions, so a catalyst can take part in several.
fn react(candidate: Candidate, rule: ReactionRow) {
    let first = moved[candidate.at.x].xyz;
    let meeting = first + rule.first_fraction * minimum_image(moved[candidate.at.y].xyz - first);
    var apart = vec3(0.0);
    let separates = (rule.flags & 8u) != 0u;
    // Products next to a catalyst stay at their reactants.
    let stays = !separates && (rule.flags & 3u) != 3u;
    if (separates) {
        let low = min(candidate.ids.x, candidate.ids.y);
        let high = max(candidate.ids.x, candidate.ids.y);
        let words = philox(vec4(low, high, control.step, PURPOSE_PAIR), params.key);
        apart = direction_within(direction(words.z, words.w)) * rule.unbinding;
    }
    for (var side = 0u; side < 2u; side++) {
        if (claims_it(rule, side)) {
            let along = f32(side) - rule.first_product_fraction;
            let at = candidate.at[side];
            claims[at].product = rule.products[side];
            let position = select(meeting, moved[at].xyz, stays);
            claims[at].sphere = vec4(confined(position + along * apart, rule.radii[side]), rule.radii[side]);
            if (params.has_velocity != 0u && rule.products[side] != NOTHING) {
                let own = arrayLength(&moved) / 2u + at;
                let before = vec2(rule.speeds[side], rule.thermal_speeds[side]);
                let after = vec2(rule.product_speeds[side], rule.product_thermal_speeds[side]);
                let velocity = moved[own].xyz;
                moved[own] = vec4(
                    converted_velocity(velocity, before, after, candidate.ids[side], VELOCITY_OF_PRODUCT), 0.0);
            }
            atomicStore(&claims[at].is_taken, 1u);
        }
    }
    atomicAdd(&control.tallies[params.first_reaction + rule.reaction], 1u);
}
