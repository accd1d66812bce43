package io.github.lazygrid;

/** The order of pairs, in the order of {@code lazygrid.h}. */
public enum Order {
    /** By i, then j. */
    CANONICAL,
    /** In the order of discovery, without sorting. */
    UNORDERED
}
