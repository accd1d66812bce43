package io.github.lazygrid;

/**
 * What {@link Detector#neighborList(Query, java.util.Set)} is asked for, beyond the pairs. The order is that of
 * {@code lazygrid.h}.
 */
public enum ListOption {
    /** Every pair once, i &lt; j, and of opposite images of one sphere one; without it every pair twice. */
    HALF,
    /** Only distances below the reach, as in ASE; without it touching counts. */
    OPEN,
    /** Every sphere of a radius above 0 is its own neighbor, too, at distance 0. */
    SELF,
    /** {@link NeighborList#shifts}. */
    SHIFTS,
    /** {@link NeighborList#vectors}. */
    VECTORS,
    /** {@link NeighborList#distances}. */
    DISTANCES;

    /** The bit that C has for it. */
    int bit() {
        return 1 << ordinal();
    }
}
