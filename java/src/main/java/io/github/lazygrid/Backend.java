package io.github.lazygrid;

/** The backend, in the order of {@code lazygrid.h}. */
public enum Backend {
    /** The CPU, or a hardware GPU if one exists and a call has enough spheres. */
    AUTO,
    /** The CPU. */
    CPU,
    /** A GPU or a software adapter. Never falls back. */
    GPU
}
