// Which receivers a particle may meet, as nearby.rs lists them.
struct Seen {
    // Places in the table of fates, or in the lists.
    begin: u32,
    end: u32,
    is_listed: bool,
}

fn word_of_lists(k: u32) -> u32 {
    return bodies[journey.lists_at + k / 4u][k % 4u];
}

// The receivers that a particle may meet that begins at a point and gets so far, and that receivers come towards.
fn seen_by(kind: Kind, point: vec3<f32>, reach: f32) -> Seen {
    let every = Seen(kind.fates_begin, kind.decays_begin, false);
    let lists = journey.lists;
    if (kind.lists == NOTHING || lists.cells.x == 0u || !(reach <= kind.reach + 3.0 * journey.longest)) {
        return every;
    }
    let at = floor((point - lists.low) * lists.per_edge);
    let within = (at >= vec3(0.0)) & (at < vec3<f32>(lists.cells));
    if (!all(within)) {
        // Where space does not repeat, receivers are within the cells.
        if (any(!within & (params.axes == vec3(2u)))) {
            return every;
        }
        return Seen(0u, 0u, false);
    }
    let cell = vec3<u32>(at);
    let count = lists.cells.x * lists.cells.y * lists.cells.z;
    let k = kind.lists * (count + 1u) + cell.x + lists.cells.x * (cell.y + lists.cells.y * cell.z);
    return Seen(word_of_lists(k), word_of_lists(k + 1u), true);
}

// The place of such a receiver in the table of fates.
fn fate_at(seen: Seen, k: u32) -> u32 {
    if (seen.is_listed) {
        return word_of_lists(k);
    }
    return k;
}

// How far a particle gets on a way, from where it begins.
fn reach_of(path: Path) -> f32 {
    return max(length(path.end - path.before), length(nearest(path.after - path.before)));
}
