struct Round {
    // The list of candidates with which the round begins; the round continues with the other list.
    source: u32,
}
