package io.github.lazygrid;

/**
 * Whether a detector keeps candidates, pairs that may soon overlap, from call to call. An answer never depends on it.
 *
 * @param kind which rule
 * @param distance how far too far apart to touch candidates are for {@link Kind#FIXED}, in the length unit of the
 *     spheres; else 0
 */
public record Skin(Kind kind, double distance) {
    /** The rules, in the order of {@code lazygrid.h}. */
    public enum Kind {
        /** Candidates where that is expected to take less time. */
        AUTO,
        /** Every search starts from scratch. */
        OFF,
        /** Candidates up to a given distance. */
        FIXED
    }

    /** Candidates where spheres move so little that it is expected to take less time; by the spheres, not by a clock. */
    public static final Skin AUTO = new Skin(Kind.AUTO, 0);

    /** Every search starts from scratch. */
    public static final Skin OFF = new Skin(Kind.OFF, 0);

    /**
     * Candidates are the pairs that are up to this much too far apart to touch, until some sphere has moved by half of
     * it. On the CPU only with {@link Algorithm#AUTO} and {@link Algorithm#CELL_LIST}.
     *
     * @param distance in the length unit of the spheres; 1e-14 to 1e17
     * @return the rule
     */
    public static Skin fixed(double distance) {
        return new Skin(Kind.FIXED, distance);
    }
}
