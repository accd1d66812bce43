// The steps of a round of the matching, for one candidate each: those that are best at all particles they claim have
// their turn. Keys are (priority, lower id, higher id); among the candidates of one particle that is the order of
// (priority, the other one's id).
fn is_free(candidate: Candidate, rule: Rule) -> bool {
    for (var side = 0u; side < 2u; side++) {
        if (claims_it(rule, side) && atomicLoad(&claims[candidate.at[side]].is_taken) != 0u) {
            return false;
        }
    }
    return true;
}

fn clear(index: u32) {
    let candidate = candidates[index];
    let rule = rules[candidate.rule];
    for (var side = 0u; side < 2u; side++) {
        if (claims_it(rule, side)) {
            atomicStore(&claims[candidate.at[side]].priority, 0xffffffffu);
            atomicStore(&claims[candidate.at[side]].other, 0xffffffffu);
        }
    }
}

fn propose(index: u32) {
    let candidate = candidates[index];
    let rule = rules[candidate.rule];
    for (var side = 0u; side < 2u; side++) {
        if (claims_it(rule, side)) {
            atomicMin(&claims[candidate.at[side]].priority, candidate.priority);
        }
    }
}

fn break_tie(index: u32) {
    let candidate = candidates[index];
    let rule = rules[candidate.rule];
    for (var side = 0u; side < 2u; side++) {
        let at = candidate.at[side];
        if (claims_it(rule, side) && atomicLoad(&claims[at].priority) == candidate.priority) {
            atomicMin(&claims[at].other, candidate.ids[1u - side]);
        }
    }
}
