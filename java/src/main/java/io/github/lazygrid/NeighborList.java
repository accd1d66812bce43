package io.github.lazygrid;

import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import java.nio.LongBuffer;

/**
 * A neighbor list with geometry, in order of i, j and the shift. Sphere k has the entries {@code offsets.get(k)} to
 * {@code offsets.get(k + 1) - 1}. Buffers of unrequested quantities are empty.
 *
 * <p>All buffers are read-only, in the detector's memory: do not use them after its next search or its end.
 *
 * @param offsets the start of each sphere's entries; the last is the number of entries
 * @param pairs i and j of each entry: the sphere and its neighbor. In a full list i may be larger
 * @param shifts three numbers per entry: multiples of the cell vectors that lead to the neighbor's image
 * @param vectors x, y and z per entry, from the sphere to that image
 * @param distances the length of each vector
 */
public record NeighborList(
    LongBuffer offsets, IntBuffer pairs, IntBuffer shifts, DoubleBuffer vectors, DoubleBuffer distances) {

    /**
     * The number of entries.
     *
     * @return the number
     */
    public int length() {
        return pairs.capacity() / 2;
    }
}
