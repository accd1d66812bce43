/**
 * All pairs of overlapping spheres, at every step of a simulation.
 *
 * <p>{@link io.github.lazygrid.Detector} is the callMethod in. Spheres are given in direct buffers, in which pairs come back,
 * so that nothing is copied on the callMethod through Java. On Java 22 and later the library is called through
 * {@code java.lang.foreign}, before that through JNA 5, which must then be on the class path.
 */
package io.github.lazygrid;
