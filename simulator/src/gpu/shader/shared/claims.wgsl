// A candidate with the best key (priority, lower id, higher id) at all its claims wins.
fn is_free(candidate: Candidate, rule: ReactionRow) -> bool {
    for (var side = 0u; side < 2u; side++) {
        if (claims_it(rule, side) && atomicLoad(&claims[candidate.at[side]].is_taken) != 0u) {
            return false;
        }
    }
    return true;
}

fn clear(index: u32) {
    let candidate = candidates[index];
    let rule = reaction_rows[candidate.rule];
    for (var side = 0u; side < 2u; side++) {
        if (claims_it(rule, side)) {
            atomicStore(&claims[candidate.at[side]].priority, 0xffffffffu);
            atomicStore(&claims[candidate.at[side]].other, 0xffffffffu);
        }
    }
}

fn propose(index: u32) {
    let candidate = candidates[index];
    let rule = reaction_rows[candidate.rule];
    for (var side = 0u; side < 2u; side++) {
        if (claims_it(rule, side)) {
            atomicMin(&claims[candidate.at[side]].priority, candidate.priority);
        }
    }
}

fn break_ties(index: u32) {
    let candidate = candidates[index];
    let rule = reaction_rows[candidate.rule];
    for (var side = 0u; side < 2u; side++) {
        let at = candidate.at[side];
        if (claims_it(rule, side) && atomicLoad(&claims[at].priority) == candidate.priority) {
            atomicMin(&claims[at].other, candidate.ids[1u - side]);
        }
    }
}
