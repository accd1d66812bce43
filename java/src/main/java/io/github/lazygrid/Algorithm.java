package io.github.lazygrid;

/** The algorithm, in the order of {@code lazygrid.h}. All find the same pairs; they differ in time and memory. */
public enum Algorithm {
    /** Chosen at each call; suits almost all programs. */
    AUTO,
    /** Tests all pairs. CPU and GPU. */
    NAIVE,
    /** A uniform grid in a hash table. CPU. */
    HASH_GRID,
    /** A uniform grid as a sorted array. CPU and GPU. */
    ARRAY_GRID,
    /** A grid whose overfull cells are split again. CPU. */
    RECURSIVE_GRID,
    /** Every sphere in the cell of its center, with levels for size classes. CPU and GPU. */
    CELL_LIST,
    /** Nested grids; all smaller spheres continue to the next. GPU. */
    EAGER_GRID,
    /** Nested grids; only smaller spheres of overfull cells continue to the next. GPU. */
    LAZY_GRID
}
