package io.github.lazygrid;

/** Where to search. The order is that of {@code lazygrid.h}. */
public enum Backend {
    /** A real GPU if there is one, else the CPU; decided when a detector is made. */
    AUTO,
    /** The CPU. */
    CPU,
    /** A GPU, one in software included. Never falls back. */
    GPU
}
