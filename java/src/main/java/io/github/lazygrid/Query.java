package io.github.lazygrid;

import java.lang.ref.Reference;
import java.nio.ByteBuffer;
import java.util.Objects;

/**
 * The input of a search: the pairs among one set of spheres, or across two sets, except excluded ones. Queries are
 * immutable and serve any number of searches.
 */
public final class Query {
    /** Size of {@code lazygrid_query} on 64-bit machines. */
    static final int SIZE = 32;
    private static final int FIRST = 8;
    private static final int SECOND = 16;
    private static final int EXCLUSIONS = 24;

    private final Spheres first;
    /** Null for one set. */
    private final Spheres second;
    /** Null without exclusions. */
    private final Exclusions exclusions;

    private Query(Spheres first, Spheres second, Exclusions exclusions) {
        this.first = first;
        this.second = second;
        this.exclusions = exclusions;
    }

    /**
     * Creates a query for the pairs among these spheres, i &lt; j.
     *
     * @param spheres the only set
     * @return the query
     */
    public static Query of(Spheres spheres) {
        return new Query(Objects.requireNonNull(spheres, "spheres"), null, null);
    }

    /**
     * Creates a query for the pairs of one sphere of each set, such as particles and receivers: i is an index in {@code
     * first}, j in {@code second}. The sets may differ in precision and layout. If both are the same spheres, each
     * pairs with itself.
     *
     * @param first the set of i
     * @param second the set of j; messages about it begin with "in the second set, "
     * @return the query
     */
    public static Query across(Spheres first, Spheres second) {
        return new Query(Objects.requireNonNull(first, "first"), Objects.requireNonNull(second, "second"), null);
    }

    /**
     * Returns this query with these exclusions, which replace earlier ones.
     *
     * @param exclusions the pairs, for two sets from {@link Exclusions#across}; null: none. The search refuses
     *     exclusions of other numbers of spheres
     * @return the query, of the same spheres
     */
    public Query without(Exclusions exclusions) {
        return new Query(first, second, exclusions);
    }

    /** The number of spheres with a neighbor list. */
    int lists() {
        return first.count();
    }

    /** Writes a {@code lazygrid_query}, which is valid until this is {@linkplain #keep kept}. */
    void write(ByteBuffer into, int at) {
        into.putLong(at, SIZE);
        into.putLong(at + FIRST, first.address());
        into.putLong(at + SECOND, second == null ? 0 : second.address());
        into.putLong(at + EXCLUSIONS, exclusions == null ? 0 : exclusions.address());
    }

    /** Called after each search, so that the memory of the structure is not freed before. */
    void keep() {
        first.keep();
        if (second != null) second.keep();
        Reference.reachabilityFence(exclusions);
    }
}
