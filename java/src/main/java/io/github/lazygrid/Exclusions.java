package io.github.lazygrid;

import java.lang.ref.Cleaner;
import java.lang.ref.Reference;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.IntBuffer;
import java.nio.LongBuffer;
import java.util.function.LongToIntFunction;

/**
 * Pairs that a query never reports, such as bonds. A list never changes, so that any threads may use it at once. It serves
 * all queries of as many spheres; when spheres come or go, make another. To leave out whole molecules,
 * {@link Spheres#withGroups groups} cost less.
 *
 * @see Query#without
 */
public final class Exclusions {
    private static final Cleaner CLEANER = Cleaner.create();

    private final long address;

    /** A list that {@code create} makes and writes the address of. */
    private Exclusions(LongToIntFunction create) {
        ByteBuffer out = ByteBuffer.allocateDirect(Long.BYTES).order(ByteOrder.nativeOrder());
        Detector.check(create.applyAsInt(NativeApi.address(out, 1)), 0);
        long made = out.getLong(0);
        Reference.reachabilityFence(out);
        address = made;
        CLEANER.register(this, () -> NativeApi.exclusionsDestroy(made));
    }

    /**
     * Pairs of one set, in either order, or both, and more than once.
     *
     * @param spheres how many there are
     * @param pairs i and j of each, one after the other
     * @return the list
     * @throws IllegalArgumentException for a number of indices that is odd, and a number of spheres below 0
     * @throws LazygridException {@link Status#INPUT} for an index that is of no sphere
     */
    public static Exclusions of(int spheres, int... pairs) {
        check(spheres, "spheres");
        IntBuffer given = direct(pairs);
        return new Exclusions(out -> {
            int status = NativeApi.exclusionsCreate(spheres, NativeApi.address(given, Integer.BYTES), pairs.length / 2, out);
            Reference.reachabilityFence(given);
            return status;
        });
    }

    /**
     * Pairs of one sphere of each of two sets, for {@link Query#across}. Each index counts in its own set.
     *
     * @param first how many spheres the first set has
     * @param second how many the second one has
     * @param pairs i and j of each, one after the other
     * @return the list
     * @throws IllegalArgumentException as {@link #of}
     * @throws LazygridException as {@link #of}
     */
    public static Exclusions across(int first, int second, int... pairs) {
        check(first, "first");
        check(second, "second");
        IntBuffer given = direct(pairs);
        return new Exclusions(out -> {
            long at = NativeApi.address(given, Integer.BYTES);
            int status = NativeApi.exclusionsAcross(first, second, at, pairs.length / 2, out);
            Reference.reachabilityFence(given);
            return status;
        });
    }

    /**
     * The pairs of compressed rows, laid out as in {@link Neighbors}, whose buffers it takes as they are. It is enough
     * that one of two spheres names the other.
     *
     * @param offsets where the row of each sphere begins, and where the last one ends; direct, in native order
     * @param indices the other sphere of each pair; direct, in native order
     * @return the list
     * @throws IllegalArgumentException for another kind of buffer, and where the last offset is not the number of indices
     * @throws LazygridException {@link Status#INPUT} for other offsets that fall, and an index that is of no sphere
     */
    public static Exclusions fromCsr(LongBuffer offsets, IntBuffer indices) {
        LongBuffer starts = offsets.duplicate();
        IntBuffer others = indices.duplicate();
        Spheres.check(starts, "offsets");
        Spheres.check(others, "indices");
        int rows = starts.remaining() - 1;
        if (rows < 0 || starts.get(starts.position() + rows) != others.remaining()) {
            throw new IllegalArgumentException(
                "the last offset must be there and be the number of indices, " + others.remaining());
        }
        return new Exclusions(out -> {
            long at = NativeApi.address(starts, Long.BYTES);
            int status = NativeApi.exclusionsFromCsr(rows, at, NativeApi.address(others, Integer.BYTES), out);
            Reference.reachabilityFence(starts);
            Reference.reachabilityFence(others);
            return status;
        });
    }

    /** Where the list is, for as long as this is reachable. */
    long address() {
        return address;
    }

    private static void check(int count, String name) {
        if (count < 0) throw new IllegalArgumentException(name + " is " + count + ", less than 0");
    }

    private static IntBuffer direct(int[] pairs) {
        if (pairs.length % 2 != 0) {
            throw new IllegalArgumentException("pairs have " + pairs.length + " indices; give 2 for each");
        }
        return Spheres.allocateInts(pairs.length).put(0, pairs);
    }
}
