struct Round {
    // Which of the two lists of candidates the round begins with; it goes on with the other one.
    source: u32,
}
