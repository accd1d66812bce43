package io.github.lazygrid;

/** In which order pairs come. The order is that of {@code lazygrid.h}. */
public enum Order {
    /** By i, then j. */
    CANONICAL,
    /** As they are found, which saves the sorting. */
    UNORDERED
}
