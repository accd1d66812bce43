struct Round {
    source: u32,
}
