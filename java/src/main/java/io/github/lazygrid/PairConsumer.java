package io.github.lazygrid;

import java.nio.IntBuffer;

/** Receives the pairs of a stream. */
@FunctionalInterface
public interface PairConsumer {
    /**
     * Receives some pairs. It may run in any thread, never concurrently, and must not search. Its exception ends the
     * search and is rethrown by {@link Detector#stream(Query, int, PairConsumer)}.
     *
     * @param pairs consecutive i and j, valid until this returns
     * @return true to continue
     */
    boolean take(IntBuffer pairs);
}
