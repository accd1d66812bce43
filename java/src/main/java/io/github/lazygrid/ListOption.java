package io.github.lazygrid;

/** An option of {@link Detector#neighborList(Query, java.util.Set)}, in the order of {@code lazygrid.h}. */
public enum ListOption {
    /**
     * Every pair once, i &lt; j, and one of opposite images of a sphere; otherwise every pair twice. It does not affect
     * two sets.
     */
    HALF,
    /** Only distances below the cutoff, as in ASE; otherwise touching counts. */
    OPEN,
    /**
     * Every sphere is also its own neighbor, at distance 0, unless its cutoff with itself is 0. It does not affect two
     * sets.
     */
    SELF,
    /** {@link NeighborList#shifts}. */
    SHIFTS,
    /** {@link NeighborList#vectors}. */
    VECTORS,
    /** {@link NeighborList#distances}. */
    DISTANCES;

    /** The bit in C. */
    int bit() {
        return 1 << ordinal();
    }
}
