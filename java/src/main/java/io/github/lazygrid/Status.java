package io.github.lazygrid;

/** The status of a call, in the order of {@code lazygrid.h}. */
public enum Status {
    /** The call succeeded. */
    OK,
    /** An argument is invalid. */
    ARGUMENT,
    /** Invalid input: not finite, a negative radius, an unknown species, an invalid length or distance. */
    INPUT,
    /** A setting is out of range, or two settings contradict each other. */
    SETTING,
    /** A list would hold more pairs than {@link Settings#maxPairs(long)}. */
    TOO_MANY_PAIRS,
    /** The system or the GPU is out of memory. */
    OUT_OF_MEMORY,
    /** The system cannot start threads. */
    THREADS,
    /** The settings require a GPU, and none can be used. */
    GPU_UNAVAILABLE,
    /** The input or the result exceeds a limit of the GPU or of a Java buffer. */
    DEVICE_LIMIT,
    /** The GPU was lost or rejected a call; create a new detector. */
    DEVICE_LOST,
    /** The GPU did not finish in time. */
    TIMEOUT,
    /** Another thread uses the detector, or a consumer of pairs searches. */
    BUSY,
    /** A bug in the library; close the detector. */
    INTERNAL;

    /** The status with this number; {@link #INTERNAL} for an unknown one. */
    static Status of(int number) {
        Status[] all = values();
        return number >= 0 && number < all.length ? all[number] : INTERNAL;
    }
}
