package io.github.lazygrid;

import java.nio.IntBuffer;

/** Takes the pairs of a stream. */
@FunctionalInterface
public interface PairConsumer {
    /**
     * Takes some pairs. It runs in any thread, in one at a time, and must not search. What it throws ends the search
     * and is thrown by {@link Detector#stream(Query, int, PairConsumer)}.
     *
     * @param pairs i and j of each pair, one after the other; not to be used after this returns
     * @return whether to go on
     */
    boolean take(IntBuffer pairs);
}
