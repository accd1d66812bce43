package io.github.lazygrid;

import java.lang.ref.Reference;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.Objects;

/**
 * A question to a detector: the pairs among one set of spheres, or those of one sphere of each of two sets, without the
 * excluded ones. Made once, it serves every step of a simulation; a search with it allocates no query.
 *
 * <p>Two sets work with every {@link Algorithm}.
 */
public final class Query {
    /** Layout of {@code lazygrid_query} on 64-bit machines. */
    private static final int SIZE = 32;
    private static final int FIRST = 8;
    private static final int SECOND = 16;
    private static final int EXCLUSIONS = 24;

    private final Spheres first;
    /** Null for one set. */
    private final Spheres second;
    /** Null for none. */
    private final Exclusions exclusions;
    private final ByteBuffer structure = ByteBuffer.allocateDirect(SIZE).order(ByteOrder.nativeOrder());
    private final long address = Library.address(structure, 1);

    Query(Spheres first, Spheres second, Exclusions exclusions) {
        this.first = first;
        this.second = second;
        this.exclusions = exclusions;
        structure.putLong(0, SIZE);
        structure.putLong(FIRST, first.address());
        structure.putLong(SECOND, second == null ? 0 : second.address());
        structure.putLong(EXCLUSIONS, exclusions == null ? 0 : exclusions.address());
    }

    /**
     * The pairs among spheres.
     *
     * @param spheres where they are at each search
     * @return the query
     */
    public static Query of(Spheres spheres) {
        return spheres.query();
    }

    /**
     * The pairs of one sphere of each of two sets: i is an index in the first set and j one in the second. Both may be the
     * same spheres; each is then a pair with itself.
     *
     * @param first the first set
     * @param second the second set
     * @return the query
     */
    public static Query across(Spheres first, Spheres second) {
        return new Query(first, Objects.requireNonNull(second), null);
    }

    /**
     * The same query, of which some pairs are never reported.
     *
     * @param pairs these pairs, made by {@link Exclusions#of} for one set and by {@link Exclusions#across} for two; a list
     *     for other numbers of spheres is refused by the search
     * @return the query, of the same spheres
     */
    public Query without(Exclusions pairs) {
        return new Query(first, second, pairs);
    }

    /** The number of neighbor lists. */
    int lists() {
        return first.count();
    }

    /** The address of a {@code lazygrid_query}, for as long as this is {@linkplain #keep kept}. */
    long address() {
        return address;
    }

    /** Called after each use of the address: until then nothing is freed that it leads to. */
    void keep() {
        Reference.reachabilityFence(this);
    }
}
