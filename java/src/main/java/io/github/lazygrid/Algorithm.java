package io.github.lazygrid;

/** How to search. All find the same pairs; they differ in time and memory. The order is that of {@code lazygrid.h}. */
public enum Algorithm {
    /** Chosen at each call; right for almost all programs. */
    AUTO,
    /** All with all. CPU and GPU. */
    NAIVE,
    /** A uniform grid in a hash table. CPU. */
    HASH_GRID,
    /** A uniform grid as a sorted array. CPU and GPU. */
    ARRAY_GRID,
    /** A grid whose crowded cells are split again. CPU. */
    RECURSIVE_GRID,
    /** Every sphere in the cell of its center, levels for groups of sizes. CPU and GPU. */
    CELL_LIST,
    /** Nested grids; all smaller spheres go on to the next. GPU. */
    EAGER_GRID,
    /** Nested grids; only smaller spheres of crowded cells go on to the next. GPU. */
    LAZY_GRID
}
