package io.github.lazygrid;

/** What became of a call of the library. The order is that of {@code lazygrid.h}. */
public enum Status {
    /** The call did what was asked. */
    OK,
    /** An argument is wrong by itself. */
    ARGUMENT,
    /** An input is refused: not finite, a negative radius, an unknown species, a length or distance that is none. */
    INPUT,
    /** A setting is out of range, or two do not go together. */
    SETTING,
    /** A list would hold more pairs than {@link Settings#maxPairs(long)}. */
    TOO_MANY_PAIRS,
    /** The system or the GPU refused memory. */
    OUT_OF_MEMORY,
    /** The system refused threads. */
    THREADS,
    /** A GPU was asked for and cannot be used. */
    GPU_UNAVAILABLE,
    /** Something does not fit the GPU, or a Java buffer. */
    DEVICE_LIMIT,
    /** The GPU was lost or refused a call; make another detector. */
    DEVICE_LOST,
    /** The GPU did not finish in time. */
    TIMEOUT,
    /** The detector is in use by another thread, or a consumer of pairs searches. */
    BUSY,
    /** A fault of the library; close the detector. */
    INTERNAL;

    /** The status with that number; one that this version does not know is a fault. */
    static Status of(int number) {
        Status[] all = values();
        return number >= 0 && number < all.length ? all[number] : INTERNAL;
    }
}
