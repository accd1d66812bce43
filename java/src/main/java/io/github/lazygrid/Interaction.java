package io.github.lazygrid;

/**
 * The condition for two spheres of given species to pair.
 *
 * @param kind the rule
 * @param distance the largest distance of centers for {@link Kind#WITHIN}, in the unit of the spheres; otherwise unused
 */
public record Interaction(Kind kind, double distance) {
    /** The rules, in the order of {@code lazygrid.h}. */
    public enum Kind {
        /** Never a pair. */
        NEVER,
        /** A pair if centers are at most the sum of radii apart. */
        TOUCH,
        /** A pair if centers are at most a given distance apart, for any radii. */
        WITHIN
    }

    /** Never a pair. */
    public static final Interaction NEVER = new Interaction(Kind.NEVER, 0);

    /** A pair if centers are at most the sum of radii apart. */
    public static final Interaction TOUCH = new Interaction(Kind.TOUCH, 0);

    /**
     * A pair if centers are at most this far apart, for any radii.
     *
     * @param distance in the unit of the spheres; at least 0, and finite
     * @return the interaction
     */
    public static Interaction within(double distance) {
        return new Interaction(Kind.WITHIN, distance);
    }
}
