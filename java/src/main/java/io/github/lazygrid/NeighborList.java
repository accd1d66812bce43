package io.github.lazygrid;

import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import java.nio.LongBuffer;

/**
 * A neighbor list with geometry, in order of i, j and the shift. The entries of sphere k are {@code offsets.get(k)} to
 * {@code offsets.get(k + 1) - 1}. Buffers that were not asked for are empty.
 *
 * <p>All buffers are read-only and lie in the detector's memory. They must not be used after the next search with it,
 * nor after it is closed.
 *
 * @param offsets where each sphere's entries start; one more than there are spheres, the last the number of entries
 * @param pairs i and j of each entry: the sphere and its neighbor. In a full list i may be the larger
 * @param shifts three numbers for each entry: how many times each edge of the space leads to the image of the neighbor
 * @param vectors x, y and z for each entry, from the sphere to that image
 * @param distances the length of each vector
 */
public record NeighborList(
    LongBuffer offsets, IntBuffer pairs, IntBuffer shifts, DoubleBuffer vectors, DoubleBuffer distances) {

    /**
     * How many entries there are.
     *
     * @return the number
     */
    public int length() {
        return pairs.capacity() / 2;
    }
}
