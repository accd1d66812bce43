package io.github.lazygrid;

/** Where to search. The order is that of {@code lazygrid.h}. */
public enum Backend {
    /** The CPU, or a real GPU if there is one and a call has enough spheres. */
    AUTO,
    /** The CPU. */
    CPU,
    /** A GPU, one in software included. Never falls back. */
    GPU
}
