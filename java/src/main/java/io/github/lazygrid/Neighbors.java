package io.github.lazygrid;

import java.nio.IntBuffer;
import java.nio.LongBuffer;

/**
 * Neighbor lists in compressed sparse rows: the neighbors of sphere k are the indices {@code offsets.get(k)} to {@code
 * offsets.get(k + 1) - 1}, ascending. Every pair is in both lists; across two sets, spheres of the first list neighbors
 * in the second.
 *
 * <p>Both buffers are in the detector's memory: do not use them after its next search or its end.
 *
 * @param offsets the start of each sphere's list; the last is the number of indices
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
