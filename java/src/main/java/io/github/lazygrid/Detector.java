package io.github.lazygrid;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.IntBuffer;
import java.util.concurrent.atomic.AtomicBoolean;
import java.util.function.ToIntFunction;

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
     * The overlapping pairs, each once: i and j of each, one after the other, i &lt; j. Valid until the next search.
     *
     * @param spheres where they are now
     * @return the pairs, read-only, in the detector's memory
     * @throws TooManyPairsException for more than {@link Settings#maxPairs(long)}, with their exact number
     * @throws LazygridException {@link Status#INPUT} for spheres that are not finite, negative radii, unknown
     *     species and exclusions of other spheres; {@link Status#LIMIT} for more than 2<sup>28</sup> - 1 pairs, which a buffer of 2 GiB cannot hold
     */
    public IntBuffer pairs(Spheres spheres) {
        enter();
        try {
            int status = Library.pairs(detector, spheres.address(), first, second);
            spheres.keep();
            return found(status);
        } finally {
            leave();
        }
    }

    /**
     * The pairs of one sphere of each set: i is an index in {@code a} and j one in {@code b}. No two spheres of one set
     * are ever compared: particles against receivers, say. On the CPU with {@link Algorithm#AUTO},
     * {@link Algorithm#CELL_LIST} or {@link Algorithm#NAIVE} only. Valid until the next search.
     *
     * @param a the first set, where its spheres are now
     * @param b the second set
     * @return the pairs, read-only, in the detector's memory
     * @throws LazygridException as {@link #pairs}, where what is wrong with {@code b} is said to be of the second set;
     *     {@link Status#SETTING} on the CPU for another algorithm
     */
    public IntBuffer between(Spheres a, Spheres b) {
        enter();
        try {
            int status = Library.between(detector, a.address(), b.address(), first, second);
            a.keep();
            b.keep();
            return found(status);
        } finally {
            leave();
        }
    }

    /** The pairs that a search has found, if it has. */
    private IntBuffer found(int status) {
        if (status == Status.TOO_MANY_PAIRS.ordinal()) {
            throw new TooManyPairsException(Library.lastError(detector), out.getLong(8));
        }
        check(status, detector);
        return integers(out.getLong(0), 2 * out.getLong(8)).asReadOnlyBuffer();
    }

    /**
     * The overlapping pairs in an array of the caller's.
     *
     * @param spheres where they are now
     * @return i and j of each pair, one after the other
     * @throws LazygridException as {@link #pairs}
     */
    public int[] pairsCopied(Spheres spheres) {
        IntBuffer pairs = pairs(spheres);
        int[] copy = new int[pairs.remaining()];
        pairs.get(copy);
        return copy;
    }

    /**
     * How many pairs there are. Needs no memory for them, so that any number can be counted.
     *
     * @param spheres where they are now
     * @return the number
     * @throws LazygridException as {@link #pairs}, but for the number of pairs
     */
    public long count(Spheres spheres) {
        enter();
        try {
            int status = Library.count(detector, spheres.address(), first);
            spheres.keep();
            check(status, detector);
            return out.getLong(0);
        } finally {
            leave();
        }
    }

    /**
     * How many pairs of one sphere of each set there are.
     *
     * @param a the first set, where its spheres are now
     * @param b the second set
     * @return the number
     * @throws LazygridException as {@link #between}, but for the number of pairs
     */
    public long countBetween(Spheres a, Spheres b) {
        enter();
        try {
            int status = Library.countBetween(detector, a.address(), b.address(), first);
            a.keep();
            b.keep();
            check(status, detector);
            return out.getLong(0);
        } finally {
            leave();
        }
    }

    /**
     * The pairs as neighbour lists. Valid until the next search.
     *
     * @param spheres where they are now
     * @return the lists, in the detector's memory
     * @throws LazygridException as {@link #pairs}
     */
    public Neighbors neighbors(Spheres spheres) {
        enter();
        try {
            int status = Library.neighbors(detector, spheres.address(), first, second);
            spheres.keep();
            return lists(status, spheres.count());
        } finally {
            leave();
        }
    }

    /**
     * For every sphere of {@code a} those of {@code b} that it overlaps, ascending. Valid until the next search.
     *
     * @param a the first set, where its spheres are now
     * @param b the second set
     * @return a list for each sphere of {@code a}, in the detector's memory; every pair stands in one
     * @throws LazygridException as {@link #between}
     */
    public Neighbors neighborsBetween(Spheres a, Spheres b) {
        enter();
        try {
            int status = Library.neighborsBetween(detector, a.address(), b.address(), first, second);
            a.keep();
            b.keep();
            return lists(status, a.count());
        } finally {
            leave();
        }
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
     * Hands the pairs over in chunks; memory stays bounded whatever their number.
     *
     * @param spheres where they are now
     * @param chunk the most pairs of a chunk, at least 1
     * @param consumer takes them
     * @return how many were handed over
     * @throws LazygridException as {@link #count}; and whatever the consumer throws
     */
    public long stream(Spheres spheres, int chunk, PairConsumer consumer) {
        return streamed(consumer, take -> {
            int status = Library.stream(detector, spheres.address(), chunk, take, first);
            spheres.keep();
            return status;
        });
    }

    /**
     * Hands the pairs of one sphere of each set over in chunks, as {@link #stream} does.
     *
     * @param a the first set, where its spheres are now
     * @param b the second set
     * @param chunk the most pairs of a chunk, at least 1
     * @param consumer takes them
     * @return how many were handed over
     * @throws LazygridException as {@link #countBetween}; and whatever the consumer throws
     */
    public long streamBetween(Spheres a, Spheres b, int chunk, PairConsumer consumer) {
        return streamed(consumer, take -> {
            int status = Library.streamBetween(detector, a.address(), b.address(), chunk, take, first);
            a.keep();
            b.keep();
            return status;
        });
    }

    /** Runs a search that hands pairs over, and throws what the consumer has thrown. */
    private long streamed(PairConsumer consumer, ToIntFunction<Library.Consumer> search) {
        enter();
        try {
            // Written by whichever thread of the library, read when all have ended.
            Throwable[] thrown = new Throwable[1];
            int status = search.applyAsInt((pairs, count) -> {
                try {
                    return consumer.take(integers(pairs, 2 * count).asReadOnlyBuffer()) ? 0 : 1;
                } catch (Throwable any) {
                    thrown[0] = any;
                    return 1;
                }
            });
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
