package io.github.lazygrid;

import java.lang.ref.Cleaner;
import java.lang.ref.Reference;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.IntBuffer;
import java.nio.LongBuffer;
import java.util.function.LongToIntFunction;

/**
 * Pairs that a query never reports, such as bonds, for one number of spheres. A list is immutable; any threads may
 * share it. To exclude whole molecules, {@link Spheres#withGroups groups} cost less.
 *
 * @see Query#without
 */
public final class Exclusions {
    private static final Cleaner CLEANER = Cleaner.create();

    private final long address;

    /** Creates the list; {@code create} writes its address. */
    private Exclusions(LongToIntFunction create) {
        ByteBuffer out = ByteBuffer.allocateDirect(Long.BYTES).order(ByteOrder.nativeOrder());
        Detector.check(create.applyAsInt(NativeApi.address(out, 1)), 0);
        long made = out.getLong(0);
        Reference.reachabilityFence(out);
        address = made;
        CLEANER.register(this, () -> NativeApi.exclusionsDestroy(made));
    }

    /**
     * Creates exclusions of one set, in either order and possibly repeated.
     *
     * @param spheres the number of spheres
     * @param pairs consecutive i and j
     * @return the list
     * @throws IllegalArgumentException for an odd number of indices, or a negative number of spheres
     * @throws LazygridException {@link Status#INPUT} for an index out of range
     */
    public static Exclusions of(int spheres, int... pairs) {
        check(spheres, "spheres");
        IntBuffer buffer = direct(pairs);
        return new Exclusions(out -> {
            int status = NativeApi.exclusionsCreate(spheres, NativeApi.address(buffer, Integer.BYTES), pairs.length / 2, out);
            Reference.reachabilityFence(buffer);
            return status;
        });
    }

    /**
     * Creates exclusions of one sphere of each of two sets, for {@link Query#across}, by index in each set.
     *
     * @param first the size of the first set
     * @param second the size of the second set
     * @param pairs consecutive i and j
     * @return the list
     * @throws IllegalArgumentException as {@link #of}
     * @throws LazygridException as {@link #of}
     */
    public static Exclusions across(int first, int second, int... pairs) {
        check(first, "first");
        check(second, "second");
        IntBuffer buffer = direct(pairs);
        return new Exclusions(out -> {
            long at = NativeApi.address(buffer, Integer.BYTES);
            int status = NativeApi.exclusionsAcross(first, second, at, pairs.length / 2, out);
            Reference.reachabilityFence(buffer);
            return status;
        });
    }

    /**
     * Creates exclusions from compressed sparse rows in the layout of {@link Neighbors}. One of the two rows of a pair
     * suffices.
     *
     * @param offsets the start of each sphere's row, and the end of the last; direct, in native order
     * @param indices the other sphere of each pair; direct, in native order
     * @return the list
     * @throws IllegalArgumentException for another kind of buffer, or if the last offset is not the number of indices
     * @throws LazygridException {@link Status#INPUT} for decreasing offsets, and an index out of range
     */
    public static Exclusions fromCsr(LongBuffer offsets, IntBuffer indices) {
        LongBuffer starts = offsets.duplicate();
        IntBuffer others = indices.duplicate();
        Spheres.check(starts, "offsets");
        Spheres.check(others, "indices");
        int rows = starts.remaining() - 1;
        if (rows < 0 || starts.get(starts.position() + rows) != others.remaining()) {
            String last =
                rows < 0 ? "there are no offsets" : "the last offset is " + starts.get(starts.position() + rows);
            throw new IllegalArgumentException(
                last + ", with " + others.remaining() + " indices; end the offsets with the number of indices");
        }
        return new Exclusions(out -> {
            long at = NativeApi.address(starts, Long.BYTES);
            int status = NativeApi.exclusionsFromCsr(rows, at, NativeApi.address(others, Integer.BYTES), out);
            Reference.reachabilityFence(starts);
            Reference.reachabilityFence(others);
            return status;
        });
    }

    /** The list's address, while this is reachable. */
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
