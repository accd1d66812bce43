/**
 * All pairs of overlapping spheres, at every step of a simulation.
 *
 * <p>Start with {@link io.github.lazygrid.Detector}. Spheres and pairs are in direct buffers, without copies. Java 22
 * and later call the library through {@code java.lang.foreign}, earlier versions through JNA 5, which must be on the
 * class path.
 */
package io.github.lazygrid;
