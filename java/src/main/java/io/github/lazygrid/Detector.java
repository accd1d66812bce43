package io.github.lazygrid;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.IntBuffer;
import java.nio.LongBuffer;
import java.util.Objects;
import java.util.Set;
import java.util.concurrent.atomic.AtomicBoolean;

/**
 * Finds overlapping spheres, reusing its memory between calls.
 *
 * <pre>{@code
 * FloatBuffer rows = Spheres.allocateFloats(4 * n);                  // x, y, z, r of each sphere
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
 * <p>Searches take one set of spheres, or a {@link Query}: one set or two, with or without exclusions.
 *
 * <p>Result buffers are in the detector's memory. Do not use them after the next search or after {@link #close}: reads
 * then return arbitrary values or crash the process. {@link #pairsAsArray} returns a copy.
 *
 * <p>Any thread may call, one at a time: a second thread, and a consumer that calls back, get {@link Status#BUSY}.
 */
public final class Detector implements AutoCloseable {
    /** The offset of results in {@link #callBuffer}: two numbers, or a {@code lazygrid_list}. */
    private static final int OUT = Query.SIZE;

    /** The query of a search, and its results. Allocated once, because a step must not allocate memory. */
    private final ByteBuffer callBuffer = ByteBuffer.allocateDirect(OUT + 48).order(ByteOrder.nativeOrder());
    private final long queryAddress = NativeApi.address(callBuffer, 1);
    private final long first = queryAddress + OUT;
    private final long second = first + Long.BYTES;
    private final AtomicBoolean isInUse = new AtomicBoolean();
    /** The detector's address; 0 when it is closed. */
    private long detector;

    /**
     * Creates a detector with the default settings.
     *
     * @throws LazygridException if the system refuses threads or memory
     */
    public Detector() {
        this(new Settings());
    }

    /**
     * Creates a detector and chooses its backend.
     *
     * @param settings the settings
     * @throws LazygridException {@link Status#SETTING} or {@link Status#INPUT} for a setting out of range, {@link
     *     Status#GPU_UNAVAILABLE} if a required GPU cannot be used
     */
    public Detector(Settings settings) {
        try (NativeSettings nativeSettings = new NativeSettings(settings)) {
            check(NativeApi.create(nativeSettings.address(), first), 0);
        }
        detector = result(0);
    }

    /**
     * The version of the native library.
     *
     * @return such as "0.1.0"
     */
    public static String version() {
        return NativeApi.version();
    }

    /**
     * Returns the overlapping pairs, each once, as consecutive i and j. Among one set i &lt; j; across two sets i is an
     * index in the first and j in the second. Valid until the next search.
     *
     * @param query the spheres
     * @return the pairs, read-only, in the detector's memory
     * @throws TooManyPairsException for more than {@link Settings#maxPairs(long)}, with their exact number
     * @throws LazygridException {@link Status#INPUT} for spheres that are not finite, negative radii, unknown species
     *     and exclusions of other numbers of spheres; {@link Status#DEVICE_LIMIT} for more than 2<sup>28</sup> - 1
     *     pairs, which a buffer of 2 GiB cannot hold
     */
    public IntBuffer pairs(Query query) {
        enter(query);
        try {
            return findPairs(query);
        } finally {
            leave();
        }
    }

    /**
     * Returns {@link #pairs(Query)} of {@link Query#of}.
     *
     * @param spheres the spheres
     * @return the pairs, read-only, in the detector's memory
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public IntBuffer pairs(Spheres spheres) {
        return pairs(Query.of(spheres));
    }

    /**
     * Returns the overlapping pairs in a new array.
     *
     * @param query the spheres
     * @return consecutive i and j
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public int[] pairsAsArray(Query query) {
        enter(query);
        try {
            // Another thread's search may free the buffer once this thread has left.
            IntBuffer pairs = findPairs(query);
            int[] copy = new int[pairs.remaining()];
            pairs.get(copy);
            return copy;
        } finally {
            leave();
        }
    }

    /**
     * Returns {@link #pairsAsArray(Query)} of {@link Query#of}.
     *
     * @param spheres the spheres
     * @return consecutive i and j
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public int[] pairsAsArray(Spheres spheres) {
        return pairsAsArray(Query.of(spheres));
    }

    /**
     * Counts the pairs, in memory independent of their number.
     *
     * @param query the spheres
     * @return the number of pairs
     * @throws LazygridException as {@link #pairs(Query)}, except for too many pairs
     */
    public long count(Query query) {
        enter(query);
        try {
            int status = NativeApi.count(detector, queryAddress, first);
            query.keep();
            check(status, detector);
            return result(0);
        } finally {
            leave();
        }
    }

    /**
     * Counts the pairs among one set.
     *
     * @param spheres the spheres
     * @return the number of pairs
     * @throws LazygridException as {@link #count(Query)}
     */
    public long count(Spheres spheres) {
        return count(Query.of(spheres));
    }

    /**
     * Returns the pairs as neighbor lists. Valid until the next search.
     *
     * @param query the spheres
     * @return the lists, in the detector's memory; across two sets one for each sphere of the first
     * @throws LazygridException as {@link #pairs(Query)}
     */
    public Neighbors neighbors(Query query) {
        enter(query);
        try {
            int status = NativeApi.neighbors(detector, queryAddress, first, second);
            query.keep();
            if (status == Status.TOO_MANY_PAIRS.ordinal()) throw tooMany(ResultBuffers.number(result(0)));
            check(status, detector);
            LongBuffer offsets = ResultBuffers.offsets(result(0), query);
            return new Neighbors(offsets, ResultBuffers.integers(result(1), offsets.get(query.lists())));
        } finally {
            leave();
        }
    }

    /**
     * Returns {@link #neighbors(Query)} of {@link Query#of}.
     *
     * @param spheres the spheres
     * @return the lists, in the detector's memory
     * @throws LazygridException as {@link #neighbors(Query)}
     */
    public Neighbors neighbors(Spheres spheres) {
        return neighbors(Query.of(spheres));
    }

    /**
     * Returns the neighbor list with all periodic images within the cutoff, in a smaller box also a sphere's own, in
     * double precision. Exclusions and groups apply to all images. Valid until the next search.
     *
     * @param query the spheres
     * @param options the contents; an empty set: the pairs of a full list
     * @return the list, in the detector's memory
     * @throws LazygridException as {@link #neighbors(Query)}; {@link Status#DEVICE_LIMIT} for a buffer of 2 GiB or more
     */
    public NeighborList neighborList(Query query, Set<ListOption> options) {
        int bits = options.stream().mapToInt(ListOption::bit).sum();
        enter(query);
        try {
            int status = NativeApi.neighborList(detector, queryAddress, bits, first);
            query.keep();
            if (status == Status.TOO_MANY_PAIRS.ordinal()) throw tooMany(result(0));
            check(status, detector);
            long length = result(0);
            // Quantities that were not requested have no address.
            long shifts = result(3), vectors = result(4), distances = result(5);
            return new NeighborList(
                ResultBuffers.offsets(result(1), query),
                ResultBuffers.integers(result(2), 2 * length),
                ResultBuffers.integers(shifts, shifts == 0 ? 0 : 3 * length),
                ResultBuffers.doubles(vectors, vectors == 0 ? 0 : 3 * length),
                ResultBuffers.doubles(distances, distances == 0 ? 0 : length));
        } finally {
            leave();
        }
    }

    /**
     * Returns {@link #neighborList(Query, Set)} of {@link Query#of}.
     *
     * @param spheres the spheres
     * @param options the contents
     * @return the list, in the detector's memory
     * @throws LazygridException as {@link #neighborList(Query, Set)}
     */
    public NeighborList neighborList(Spheres spheres, Set<ListOption> options) {
        return neighborList(Query.of(spheres), options);
    }

    /**
     * Passes the pairs to a consumer in chunks, in bounded memory.
     *
     * @param query the spheres
     * @param chunk the maximum number of pairs in a chunk, at least 1
     * @param consumer receives the chunks
     * @return the number of delivered pairs
     * @throws LazygridException as {@link #count(Query)}; also the exceptions of the consumer
     * @throws IllegalArgumentException for a chunk of less than 1 pair
     */
    public long stream(Query query, int chunk, PairConsumer consumer) {
        // The library reads an unsigned number.
        if (chunk < 1) throw new IllegalArgumentException("a chunk of " + chunk + " pairs is less than 1");
        enter(query);
        try {
            // Threads of the library write it; it is read after they have ended.
            Throwable[] thrown = new Throwable[1];
            int status = NativeApi.stream(detector, queryAddress, chunk, (pairs, count) -> {
                try {
                    return consumer.take(ResultBuffers.integers(pairs, 2 * count)) ? 0 : 1;
                } catch (Throwable any) {
                    thrown[0] = any;
                    return 1;
                }
            }, first);
            query.keep();
            if (thrown[0] instanceof RuntimeException unchecked) throw unchecked;
            if (thrown[0] instanceof Error error) throw error;
            if (thrown[0] != null) throw new IllegalStateException("the consumer threw", thrown[0]);
            check(status, detector);
            return result(0);
        } finally {
            leave();
        }
    }

    /**
     * Passes the pairs among one set to a consumer in chunks.
     *
     * @param spheres the spheres
     * @param chunk the maximum number of pairs in a chunk, at least 1
     * @param consumer receives the chunks
     * @return the number of delivered pairs
     * @throws LazygridException as {@link #stream(Query, int, PairConsumer)}; also the exceptions of the consumer
     */
    public long stream(Spheres spheres, int chunk, PairConsumer consumer) {
        return stream(Query.of(spheres), chunk, consumer);
    }

    /**
     * Returns the report of the last search as JSON: "spheres", "pairs", "backend", "adapter", "algorithm", "reason",
     * "gpu", "candidates" (null without a candidate list), and "phases", seconds by name.
     *
     * @return one JSON object
     */
    public String reportJson() {
        enter();
        try {
            check(NativeApi.reportJson(detector, first), detector);
            return NativeApi.text(result(0));
        } finally {
            leave();
        }
    }

    /**
     * Estimates the bytes for a number of spheres, without the result.
     *
     * @param spheres the number of spheres, 0 or more, counted up to 2<sup>32</sup> - 2
     * @return bytes; -1 if a GPU cannot hold them
     * @throws IllegalArgumentException for a negative number of spheres
     */
    public long memoryFor(long spheres) {
        // The library reads an unsigned number.
        if (spheres < 0) throw new IllegalArgumentException(spheres + " spheres are less than 0");
        enter();
        try {
            check(NativeApi.memoryFor(detector, spheres, first), detector);
            return result(0);
        } finally {
            leave();
        }
    }

    /**
     * Frees the detector and its buffers, once.
     *
     * @throws LazygridException {@link Status#BUSY} while a search runs
     */
    @Override
    public void close() {
        if (!isInUse.compareAndSet(false, true)) throw busy();
        try {
            if (detector != 0) check(NativeApi.destroy(detector), 0);
            detector = 0;
        } finally {
            leave();
        }
    }

    /** Returns the pairs of the query that {@link #enter(Query)} has written, in the detector's memory. */
    private IntBuffer findPairs(Query query) {
        int status = NativeApi.pairs(detector, queryAddress, first, second);
        query.keep();
        if (status == Status.TOO_MANY_PAIRS.ordinal()) throw tooMany(result(1));
        check(status, detector);
        return ResultBuffers.integers(result(0), 2 * result(1));
    }

    private TooManyPairsException tooMany(long found) {
        return new TooManyPairsException(NativeApi.lastError(detector), found);
    }

    /** Enters and writes the query, which only the thread that is inside may do. */
    private void enter(Query query) {
        Objects.requireNonNull(query, "query");
        enter();
        try {
            query.write(callBuffer, 0);
        } catch (IllegalStateException closed) {
            leave();
            throw closed;
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

    /** Throws the exception of a status; {@code detector} is 0 without a detector. */
    static void check(int status, long detector) {
        // BUSY has no message.
        if (status == Status.BUSY.ordinal()) throw busy();
        if (status != 0) throw new LazygridException(Status.of(status), NativeApi.lastError(detector));
    }

    /** Returns a number or address that the library has written. */
    private long result(int k) {
        return callBuffer.getLong(OUT + Long.BYTES * k);
    }
}
