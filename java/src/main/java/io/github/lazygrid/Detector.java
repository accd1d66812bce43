package io.github.lazygrid;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.IntBuffer;
import java.util.concurrent.atomic.AtomicBoolean;

/**
 * Finds overlapping spheres, call after call, reusing its memory.
 *
 * <pre>{@code
 * FloatBuffer rows = Spheres.floats(4 * n);                  // x, y, z, r of each sphere
 * Spheres spheres = Spheres.rows(rows);
 * try (Detector detector = new Detector()) {
 *     for (int step = 0; step < steps; step++) {
 *         move(rows);
 *         IntBuffer pairs = detector.pairs(spheres);
 *         while (pairs.hasRemaining()) collide(pairs.get(), pairs.get());
 *     }
 * }
 * }</pre>
 *
 * <p>Buffers that come out of a search lie in the detector's memory. They must not be used after the next search with
 * it, nor after it is closed: what is read then is anything, or ends the process. {@link #pairsCopied} has no such
 * rule.
 *
 * <p>Any thread may call, one at a time: a second one, and a consumer that calls back, get
 * {@link Status#BUSY}. A detector that is not closed keeps its memory until the process ends.
 */
public final class Detector implements AutoCloseable {
    /** Places for what the library writes: two addresses or numbers. */
    private final ByteBuffer out = ByteBuffer.allocateDirect(16).order(ByteOrder.nativeOrder());
    private final long first = Library.address(out, 1);
    private final long second = first + 8;
    private final AtomicBoolean isInUse = new AtomicBoolean();
    /** The detector's address; 0 when it is closed. */
    private long detector;

    /**
     * A detector with the default settings.
     *
     * @throws LazygridException where the system refuses threads or memory
     */
    public Detector() {
        this(new Settings());
    }

    /**
     * A detector. The backend is decided here.
     *
     * @param settings what it is asked to do
     * @throws LazygridException {@link Status#SETTING} or {@link Status#INPUT} for a setting out of range,
     *     {@link Status#GPU} where a GPU is asked for and cannot be used
     */
    public Detector(Settings settings) {
        try (NativeSettings given = new NativeSettings(settings)) {
            check(Library.create(given.address(), first), 0);
        }
        detector = out.getLong(0);
    }

    /**
     * The version of the native library.
     *
     * @return as "0.1.0"
     */
    public static String version() {
        return Library.version();
    }

    /**
     * The overlapping pairs, each once: i and j of each, one after the other. Of one set i &lt; j; of two, i is an index in
     * the first and j one in the second. Valid until the next search.
     *
     * @param query which pairs
     * @return the pairs, read-only, in the detector's memory
     * @throws TooManyPairsException for more than {@link Settings#maxPairs(long)}, with their exact number
     * @throws LazygridException {@link Status#INPUT} for spheres that are not finite, negative radii, unknown species and
     *     exclusions of other spheres, where a message about the second set says so; {@link Status#LIMIT} for more than
     *     2<sup>28</sup> - 1 pairs, which a buffer of 2 GiB cannot hold
     */
    public IntBuffer pairs(Query query) {
        enter();
        try {
            int status = Library.pairs(detector, query.address(), first, second);
            query.keep();
            if (status == Status.TOO_MANY_PAIRS.ordinal()) {
                throw new TooManyPairsException(Library.lastError(detector), out.getLong(8));
            }
            check(status, detector);
            return integers(out.getLong(0), 2 * out.getLong(8)).asReadOnlyBuffer();
        } finally {
            leave();
        }
    }

    /**
     * The overlapping pairs among spheres, as {@link #pairs(Query)}.
     *
     * @param spheres where they are now
     * @return the pairs, read-only, in the detector's memory
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public IntBuffer pairs(Spheres spheres) {
        return pairs(spheres.query());
    }

    /**
     * The overlapping pairs in an array of the caller's.
     *
     * @param query which pairs
     * @return i and j of each pair, one after the other
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public int[] pairsCopied(Query query) {
        IntBuffer pairs = pairs(query);
        int[] copy = new int[pairs.remaining()];
        pairs.get(copy);
        return copy;
    }

    /**
     * The overlapping pairs among spheres in an array of the caller's.
     *
     * @param spheres where they are now
     * @return i and j of each pair, one after the other
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public int[] pairsCopied(Spheres spheres) {
        return pairsCopied(spheres.query());
    }

    /**
     * The number of pairs. Needs no memory for them, so that any number can be counted.
     *
     * @param query which pairs
     * @return the number
     * @throws LazygridException as {@link #pairs(Query)}, except for the number of pairs
     */
    public long count(Query query) {
        enter();
        try {
            int status = Library.count(detector, query.address(), first);
            query.keep();
            check(status, detector);
            return out.getLong(0);
        } finally {
            leave();
        }
    }

    /**
     * The number of pairs among spheres.
     *
     * @param spheres where they are now
     * @return the number
     * @throws LazygridException as {@link #count(Query)}
     */
    public long count(Spheres spheres) {
        return count(spheres.query());
    }

    /**
     * The pairs as neighbor lists, ascending: of one set every pair is in both lists, of two sets there is a list for each
     * sphere of the first one, with its neighbors in the second. Valid until the next search.
     *
     * @param query which pairs
     * @return the lists, in the detector's memory
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public Neighbors neighbors(Query query) {
        enter();
        try {
            int status = Library.neighbors(detector, query.address(), first, second);
            query.keep();
            return lists(status, query.lists());
        } finally {
            leave();
        }
    }

    /**
     * The pairs among spheres as neighbor lists, as {@link #neighbors(Query)}.
     *
     * @param spheres where they are now
     * @return the lists, in the detector's memory
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public Neighbors neighbors(Spheres spheres) {
        return neighbors(spheres.query());
    }

    /** The lists that a search has found for so many spheres, if it has. */
    private Neighbors lists(int status, long count) {
        check(status, detector);
        long offsets = out.getLong(0), indices = out.getLong(8);
        if (count + 1 > Integer.MAX_VALUE / Long.BYTES) throw tooLarge(count + 1);
        ByteBuffer starts = Library.view(offsets, (int) (count + 1) * Long.BYTES);
        long total = starts.getLong((int) count * Long.BYTES);
        return new Neighbors(
            starts.order(ByteOrder.nativeOrder()).asLongBuffer().asReadOnlyBuffer(),
            integers(indices, total).asReadOnlyBuffer());
    }

    /**
     * Hands the pairs among spheres over in chunks, as {@link #stream(Query, int, PairConsumer)}.
     *
     * @param spheres where they are now
     * @param chunk the most pairs of a chunk, at least 1
     * @param consumer takes them
     * @return how many were handed over
     * @throws LazygridException as {@link #count(Query)}; and whatever the consumer throws
     */
    public long stream(Spheres spheres, int chunk, PairConsumer consumer) {
        return stream(spheres.query(), chunk, consumer);
    }

    /**
     * Hands the pairs over in chunks; memory stays bounded whatever their number.
     *
     * @param query which pairs
     * @param chunk the most pairs of a chunk, at least 1
     * @param consumer takes them
     * @return how many were handed over
     * @throws LazygridException as {@link #count(Query)}; and whatever the consumer throws
     */
    public long stream(Query query, int chunk, PairConsumer consumer) {
        enter();
        try {
            // Written by whichever thread of the library, read when all have ended.
            Throwable[] thrown = new Throwable[1];
            Library.Consumer take = (pairs, count) -> {
                try {
                    return consumer.take(integers(pairs, 2 * count).asReadOnlyBuffer()) ? 0 : 1;
                } catch (Throwable any) {
                    thrown[0] = any;
                    return 1;
                }
            };
            int status = Library.stream(detector, query.address(), chunk, take, first);
            query.keep();
            if (thrown[0] instanceof RuntimeException unchecked) throw unchecked;
            if (thrown[0] instanceof Error error) throw error;
            if (thrown[0] != null) throw new IllegalStateException("the consumer threw", thrown[0]);
            check(status, detector);
            return out.getLong(0);
        } finally {
            leave();
        }
    }

    /**
     * What the last search did and why, as JSON: "spheres", "pairs", "backend", "adapter", "algorithm", "reason",
     * "gpu", "candidates" (null where it searched without any), and "phases", seconds by name.
     *
     * @return one JSON object
     */
    public String reportJson() {
        enter();
        try {
            check(Library.reportJson(detector, first), detector);
            return Library.text(out.getLong(0));
        } finally {
            leave();
        }
    }

    /**
     * An estimate of the bytes that the detector holds for so many spheres, besides the result.
     *
     * @param spheres how many
     * @return bytes; -1 where a GPU cannot hold them
     */
    public long memoryFor(long spheres) {
        enter();
        try {
            check(Library.memoryFor(detector, spheres, first), detector);
            return out.getLong(0);
        } finally {
            leave();
        }
    }

    /**
     * Frees the detector and all that it handed out. A second time it does nothing.
     *
     * @throws LazygridException {@link Status#BUSY} while a search runs
     */
    @Override
    public void close() {
        if (!isInUse.compareAndSet(false, true)) throw busy();
        try {
            if (detector != 0) check(Library.destroy(detector), 0);
            detector = 0;
        } finally {
            leave();
        }
    }

    private void enter() {
        if (!isInUse.compareAndSet(false, true)) throw busy();
        if (detector == 0) {
            leave();
            throw new IllegalStateException("the detector is closed");
        }
    }

    private void leave() {
        isInUse.set(false);
    }

    private static LazygridException busy() {
        return new LazygridException(Status.BUSY, "the detector is in use, or a consumer searches");
    }

    /** Throws what a status means; {@code detector} is 0 where there is none. */
    static void check(int status, long detector) {
        // What is busy has no message of its own.
        if (status == Status.BUSY.ordinal()) throw busy();
        if (status != 0) throw new LazygridException(Status.of(status), Library.lastError(detector));
    }

    private static IntBuffer integers(long address, long count) {
        if (count > Integer.MAX_VALUE / Integer.BYTES) throw tooLarge(count);
        return Library.view(address, (int) count * Integer.BYTES).asIntBuffer();
    }

    private static LazygridException tooLarge(long count) {
        return new LazygridException(
            Status.LIMIT, count + " numbers are more than a buffer of 2 GiB holds; stream the pairs, or count them");
    }
}
