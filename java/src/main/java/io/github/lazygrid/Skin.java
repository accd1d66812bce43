package io.github.lazygrid;

/**
 * The skin of the candidate list that a detector keeps between calls. Results never depend on it.
 *
 * @param kind the rule
 * @param distance the skin for {@link Kind#FIXED}, in the unit of the spheres; otherwise 0
 */
public record Skin(Kind kind, double distance) {
    /** The rules, in the order of {@code lazygrid.h}. */
    public enum Kind {
        /** Keeps a list if that is expected to save time. */
        AUTO,
        /** Searches at every call. */
        OFF,
        /** Keeps the pairs with gaps up to a given distance. */
        FIXED
    }

    /** Keeps a list if spheres move so little that it is expected to save time; the decision uses no clock. */
    public static final Skin AUTO = new Skin(Kind.AUTO, 0);

    /** Searches at every call. */
    public static final Skin OFF = new Skin(Kind.OFF, 0);

    /**
     * Keeps the pairs with gaps up to this distance, until some sphere has moved by half of it. Only with
     * {@link Algorithm#AUTO} and {@link Algorithm#CELL_LIST}.
     *
     * @param distance in the unit of the spheres; 1e-14 to 1e17
     * @return the skin
     */
    public static Skin fixed(double distance) {
        return new Skin(Kind.FIXED, distance);
    }
}
