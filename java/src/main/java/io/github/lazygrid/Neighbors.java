package io.github.lazygrid;

import java.nio.IntBuffer;
import java.nio.LongBuffer;

/**
 * Neighbor lists in compressed sparse rows: those of sphere k are at {@code offsets.get(k)} to
 * {@code offsets.get(k + 1) - 1} of the indices, ascending. Every pair stands in both lists; of a query across two
 * sets only spheres of the first have a list, of those of the second.
 *
 * <p>Both buffers lie in the detector's memory. They must not be used after the next search with it, nor after it is
 * closed.
 *
 * @param offsets where each sphere's list starts; one more than there are spheres, the last the number of indices
 * @param indices the neighbors, list after list
 */
public record Neighbors(LongBuffer offsets, IntBuffer indices) {
    /**
     * The neighbors of one sphere.
     *
     * @param k the index of the sphere
     * @return its neighbors, in the same memory
     */
    public IntBuffer neighborsOf(int k) {
        int first = (int) offsets.get(k);
        return indices.slice(first, (int) offsets.get(k + 1) - first);
    }
}
