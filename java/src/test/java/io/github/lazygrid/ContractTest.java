package io.github.lazygrid;

import java.io.IOException;
import java.lang.management.BufferPoolMXBean;
import java.lang.management.ManagementFactory;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;
import java.nio.IntBuffer;
import java.nio.file.Files;
import java.nio.file.Path;
import java.time.Duration;
import java.util.Arrays;
import java.util.Locale;
import java.util.Random;
import java.util.Set;
import java.util.TreeSet;
import java.util.concurrent.atomic.AtomicLong;
import java.util.function.Predicate;
import java.util.regex.Matcher;
import java.util.regex.Pattern;

/**
 * The promises of the documentation. Arguments: the expected technique of calls, {@code JNA} or {@code
 * java.lang.foreign}, and the path of {@code lazygrid.h}. Returns 0 and prints "N passed, 0 failed".
 */
public final class ContractTest {
    private static int passed;
    private static int failed;

    private ContractTest() {}

    static void check(boolean condition, String what) {
        if (condition) {
            passed++;
        } else {
            failed++;
            StackTraceElement line = new Throwable().getStackTrace()[1];
            System.err.println(line + ": not so: " + what);
        }
    }

    static <E extends Throwable> void throwing(Class<E> type, Predicate<E> right, Runnable work, String what) {
        try {
            work.run();
        } catch (Throwable thrown) {
            check(type.isInstance(thrown) && right.test(type.cast(thrown)), what + ": " + thrown);
            return;
        }
        check(false, what + ": nothing was thrown");
    }

    static void failing(Status status, String says, Runnable work) {
        throwing(LazygridException.class, e -> e.status() == status && e.getMessage().contains(says), work,
            status + " with " + says);
    }

    static Settings onCpu() {
        return new Settings().backend(Backend.CPU);
    }

    /** Each touches the next. */
    static FloatBuffer line(int count) {
        FloatBuffer rows = Spheres.allocateFloats(4 * count);
        for (int k = 0; k < count; k++) rows.put(4 * k, 0.5f * k).put(4 * k + 3, 0.3f);
        return rows;
    }

    private static FloatBuffer direct(float... values) {
        return Spheres.allocateFloats(values.length).put(0, values);
    }

    private static void inputs() {
        try (Detector detector = new Detector(onCpu())) {
            FloatBuffer rows = direct(0, 0, 0, 1, 1.5f, 0, 0, 1, 9, 0, 0, 0.1f);
            int[] pairs = detector.pairsAsArray(Spheres.rows(rows));
            check(Arrays.equals(pairs, new int[] {0, 1}), "rows: " + Arrays.toString(pairs));
            FloatBuffer zero = direct(0, 0, 0);
            Spheres columns = Spheres.columns(direct(0, 1.5f, 9), zero, zero, direct(1, 1, 0.1f));
            check(detector.count(columns) == 1, "columns");
            rows.position(4);
            Spheres last = Spheres.rows(rows);
            check(last.count() == 2 && detector.count(last) == 0, "a position counts");
            rows.put(8, 1.6f);
            check(detector.count(last) == 1, "what was written since is read");
            Spheres none = Spheres.rows(Spheres.allocateFloats(0));
            check(detector.count(none) == 0 && detector.pairs(none).remaining() == 0, "no spheres");
            check(detector.neighbors(none).offsets().remaining() == 1, "no lists");
        }
        throwing(IllegalArgumentException.class, e -> e.getMessage().startsWith("-1 values"),
            () -> Spheres.allocateFloats(-1), "negative length");
        throwing(IllegalArgumentException.class, e -> true, () -> Spheres.rows(FloatBuffer.allocate(4)), "heap");
        throwing(IllegalArgumentException.class, e -> true,
            () -> Spheres.rows(ByteBuffer.allocateDirect(16).asFloatBuffer()), "other order");
        throwing(IllegalArgumentException.class, e -> true, () -> Spheres.rows(Spheres.allocateFloats(5)), "no rows");
        FloatBuffer two = Spheres.allocateFloats(2);
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("z has 3"),
            () -> Spheres.columns(two, two, Spheres.allocateFloats(3), two), "lengths");
    }

    private static void settings() {
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("zero character"),
            () -> new Settings().adapter("a\0b"), "adapter with a zero");
        for (Duration timeout : new Duration[] {Duration.ZERO, Duration.ofSeconds(-3), Duration.ofDays(40_000)}) {
            throwing(IllegalArgumentException.class, e -> e.getMessage().contains("a timeout of " + timeout),
                () -> new Settings().timeout(timeout), "timeout " + timeout);
        }
        check(new Settings().timeout(Duration.ofMillis(1500)).timeoutSeconds == 2, "a timeout is rounded up");
        throwing(LazygridException.class, e -> e.getMessage().contains("a timeout of 1 seconds limits searches on a GPU"),
            () -> new Detector(onCpu().timeout(Duration.ofMillis(1))), "timeout on the CPU");
    }

    private static void results() {
        int count = 20_000;
        Spheres spheres = Spheres.rows(line(count));
        try (Detector detector = new Detector(onCpu())) {
            IntBuffer pairs = detector.pairs(spheres);
            check(pairs.remaining() == 2 * (count - 1) && pairs.isReadOnly(), "pairs");
            check(pairs.get(0) == 0 && pairs.get(1) == 1 && pairs.get(2 * count - 3) == count - 1, "canonical");
            Neighbors neighbors = detector.neighbors(spheres);
            check(neighbors.neighborsOf(0).remaining() == 1 && neighbors.neighborsOf(7).get(0) == 6, "neighbors");
            check(neighbors.neighborsOf(7).get(1) == 8, "ascending");
            check(detector.reportJson().contains("\"pairs\":" + (count - 1)), "report");
            check(detector.memoryFor(1000) > 0, "memory");
            check(detector.memoryFor(Long.MAX_VALUE) == detector.memoryFor((1L << 32) - 2), "memory of the most spheres");
            throwing(IllegalArgumentException.class, e -> e.getMessage().contains("-1 spheres"),
                () -> detector.memoryFor(-1), "memory of a negative number");
        }
        check(Detector.version().matches("\\d+\\.\\d+\\.\\d+"), "version " + Detector.version());
    }

    /** Against the plain loop. */
    private static void arbitraryScenes() {
        Random random = new Random(1);
        try (Detector detector = new Detector(onCpu())) {
            for (int iteration = 0; iteration < 20; iteration++) {
                int count = random.nextInt(300);
                FloatBuffer rows = Spheres.allocateFloats(4 * count);
                for (int k = 0; k < 4 * count; k++) rows.put(k, random.nextFloat() * (k % 4 == 3 ? 0.2f : 3));
                StringBuilder expected = new StringBuilder();
                for (int i = 0; i < count; i++) {
                    for (int j = i + 1; j < count; j++) {
                        if (overlap(rows, i, rows, j)) expected.append(i).append(' ').append(j).append(' ');
                    }
                }
                StringBuilder found = new StringBuilder();
                for (int index : detector.pairsAsArray(Spheres.rows(rows))) found.append(index).append(' ');
                check(found.compareTo(expected) == 0, "scene " + iteration);
            }
        }
    }

    static boolean overlap(FloatBuffer a, int i, FloatBuffer b, int j) {
        double squared = 0;
        for (int axis = 0; axis < 3; axis++) {
            double d = (double) a.get(4 * i + axis) - b.get(4 * j + axis);
            squared += d * d;
        }
        double cutoff = (double) a.get(4 * i + 3) + b.get(4 * j + 3);
        return squared <= cutoff * cutoff;
    }

    private static void streams() {
        Spheres spheres = Spheres.rows(line(20_000));
        for (Order order : Order.values()) {
            try (Detector detector = new Detector(onCpu().order(order).threads(2));
                    Detector other = new Detector(onCpu())) {
                AtomicLong seen = new AtomicLong();
                long handed = detector.stream(spheres, 100, pairs -> {
                    check(pairs.remaining() <= 200, "chunk");
                    seen.addAndGet(pairs.remaining() / 2);
                    return true;
                });
                check(handed == 19_999 && seen.get() == handed, "all: " + handed + ", " + seen);
                check(detector.stream(spheres, 100, pairs -> false) <= 100, "ended");
                throwing(UnsupportedOperationException.class, e -> e.getMessage().equals("enough"),
                    () -> detector.stream(spheres, 100, pairs -> {
                        throw new UnsupportedOperationException("enough");
                    }), "thrown by a consumer");
                failing(Status.BUSY, "in use",
                    () -> detector.stream(spheres, 100, pairs -> detector.count(spheres) > 0));
                failing(Status.BUSY, "in use",
                    () -> detector.stream(spheres, 100, pairs -> other.count(spheres) > 0));
                failing(Status.BUSY, "in use", () -> detector.stream(spheres, 100, pairs -> {
                    detector.close();
                    return true;
                }));
                for (int chunk : new int[] {0, -1, Integer.MIN_VALUE}) {
                    throwing(IllegalArgumentException.class, e -> e.getMessage().contains("a chunk of " + chunk),
                        () -> detector.stream(spheres, chunk, pairs -> true), "chunk " + chunk);
                }
                check(detector.count(spheres) == 19_999, "of use afterwards");
            }
        }
    }

    private static void errors() {
        Spheres spheres = Spheres.rows(line(100));
        Detector detector = new Detector(onCpu().maxPairs(5));
        throwing(TooManyPairsException.class, e -> e.found() == 99, () -> detector.pairs(spheres), "too many pairs");
        FloatBuffer bad = line(3);
        bad.put(11, Float.NaN);
        failing(Status.INPUT, "sphere 2", () -> detector.count(Spheres.rows(bad)));
        detector.close();
        detector.close();
        throwing(IllegalStateException.class, e -> true, () -> detector.count(spheres), "closed");
        failing(Status.SETTING, "does not run on the cpu backend",
            () -> new Detector(onCpu().algorithm(Algorithm.LAZY_GRID)).close());
        failing(Status.INPUT, "periodic axis y", () -> new Detector(onCpu().periodic(1, -1, 0)).close());
        throwing(LazygridException.class, e -> true,
            () -> new Detector(onCpu().adapter("none such")).close(), "adapter");
        throwing(IllegalArgumentException.class, e -> true, () -> onCpu().threads(-1), "threads");
    }

    /** Java 17 has no arenas, so that reflection reaches them. */
    private static void arenas() throws Exception {
        Class<?> arenas;
        try {
            arenas = Class.forName("java.lang.foreign.Arena");
            arenas.getMethod("ofShared");
        } catch (ReflectiveOperationException none) {
            return;
        }
        Object arena = arenas.getMethod("ofShared").invoke(null);
        Object segment = Class.forName("java.lang.foreign.SegmentAllocator")
            .getMethod("allocate", long.class, long.class).invoke(arena, 16L * 100, 4L);
        ByteBuffer bytes =
            (ByteBuffer) Class.forName("java.lang.foreign.MemorySegment").getMethod("asByteBuffer").invoke(segment);
        Spheres spheres = Spheres.rows(bytes.order(ByteOrder.nativeOrder()).asFloatBuffer());
        try (Detector detector = new Detector(onCpu())) {
            check(detector.count(spheres) == 4950, "points at the origin");
            arenas.getMethod("close").invoke(arena);
            throwing(IllegalStateException.class, e -> e.getMessage().contains("arena"),
                () -> detector.count(spheres), "a closed arena");
            check(detector.count(Spheres.rows(line(100))) == 99, "of use afterwards");
        }
    }

    private static void speciesAndBoxes() {
        int acid = 0, base = 1;
        Interactions reactions = new Interactions(2, Interaction.NEVER).set(acid, base, Interaction.within(0.5));
        FloatBuffer rows = direct(0.1f, 0, 0, 0, 9.8f, 0, 0, 0, 9.9f, 0, 0, 0);
        IntBuffer species = Spheres.allocateInts(3).put(0, new int[] {acid, base, acid});
        try (Detector detector = new Detector(onCpu().interactions(reactions).periodic(10, 0, 0))) {
            int[] pairs = detector.pairsAsArray(Spheres.rows(rows).withSpecies(species));
            check(Arrays.equals(pairs, new int[] {0, 1, 1, 2}), Arrays.toString(pairs));
            failing(Status.INPUT, "no species ids", () -> detector.count(Spheres.rows(rows)));
            Spheres none = Spheres.rows(Spheres.allocateFloats(0)).withSpecies(Spheres.allocateInts(0));
            check(detector.count(none) == 0, "no spheres, no pairs");
        }
        reactions.set(0, 2, Interaction.TOUCH);
        failing(Status.INPUT, "species id 2", () -> new Detector(onCpu().interactions(reactions)).close());
        throwing(IllegalArgumentException.class, e -> true,
            () -> Spheres.rows(rows).withSpecies(Spheres.allocateInts(2)), "species");
    }

    private static void threads() throws InterruptedException {
        Thread[] workers = new Thread[4];
        AtomicLong right = new AtomicLong();
        for (int k = 0; k < workers.length; k++) {
            workers[k] = new Thread(() -> {
                Spheres spheres = Spheres.rows(line(3000));
                try (Detector detector = new Detector(onCpu())) {
                    for (int call = 0; call < 5; call++) right.addAndGet(detector.count(spheres) == 2999 ? 1 : 0);
                }
            });
            workers[k].start();
        }
        for (Thread worker : workers) worker.join();
        check(right.get() == 20, "threads: " + right);
    }

    /** An array has the pairs of its own call, although the next call of another thread reuses their memory. */
    private static void sharedDetector() throws InterruptedException {
        // The second call is short enough to end before the first array is copied.
        int[] counts = {2000, 300}, iterations = {10, 200};
        AtomicLong right = new AtomicLong();
        try (Detector detector = new Detector(onCpu().threads(1))) {
            Thread[] workers = new Thread[counts.length];
            for (int k = 0; k < workers.length; k++) {
                FloatBuffer rows = Spheres.allocateFloats(4 * counts[k]);
                for (int sphere = 0; sphere < counts[k]; sphere++) rows.put(4 * sphere + 3, 1);
                Spheres spheres = Spheres.rows(rows);
                int[] expected = detector.pairsAsArray(spheres);
                int most = iterations[k];
                workers[k] = new Thread(() -> {
                    for (int iteration = 0; iteration < most; iteration++) {
                        if (Arrays.equals(whenFree(detector, spheres), expected)) right.incrementAndGet();
                    }
                });
            }
            for (Thread worker : workers) worker.start();
            for (Thread worker : workers) worker.join();
        }
        check(right.get() == 210, "arrays of a shared detector: " + right);
    }

    private static int[] whenFree(Detector detector, Spheres spheres) {
        while (true) {
            try {
                return detector.pairsAsArray(spheres);
            } catch (LazygridException busy) {
                if (busy.status() != Status.BUSY) throw busy;
                Thread.yield();
            }
        }
    }

    /** Steps reuse the structures of spheres and detectors, also in searches without pairs. */
    private static void steps() {
        BufferPoolMXBean pool = ManagementFactory.getPlatformMXBeans(BufferPoolMXBean.class).stream()
            .filter(one -> one.getName().equals("direct")).findFirst().orElseThrow();
        Spheres spheres = Spheres.rows(line(100)), one = Spheres.rows(line(1));
        Exclusions exclusions = Exclusions.of(100, 0, 1);
        try (Detector detector = new Detector(onCpu())) {
            long before = 0;
            for (int step = 0; step < 100; step++) {
                // The first step loads classes.
                if (step == 1) before = pool.getCount();
                check(detector.count(Query.of(spheres).without(exclusions)) == 98, "step " + step);
                check(detector.pairs(Query.across(spheres, one)).remaining() == 4, "across, step " + step);
                check(detector.pairs(one).remaining() == 0, "one sphere, step " + step);
                check(detector.neighbors(one).indices().remaining() == 0, "no neighbors, step " + step);
                check(detector.neighborList(spheres, Set.of()).length() == 198, "list, step " + step);
            }
            check(pool.getCount() <= before, pool.getCount() + " direct buffers, at first " + before);
        }
    }

    /** The numbers of enumerations equal the header's. */
    private static void header(Path path) throws IOException {
        TreeSet<String> named = new TreeSet<>();
        Matcher matcher = Pattern.compile("LAZYGRID_([A-Z_0-9]+) = (\\d+)").matcher(Files.readString(path));
        while (matcher.find()) named.add(matcher.group(1) + " " + matcher.group(2));
        TreeSet<String> expected = new TreeSet<>();
        for (Status status : Status.values()) {
            expected.add((status == Status.OK ? "" : "ERROR_") + status + " " + status.ordinal());
        }
        for (Enum<?>[] all : new Enum<?>[][] {Backend.values(), Algorithm.values(), Order.values()}) {
            String kind = all[0].getDeclaringClass().getSimpleName().toUpperCase(Locale.ROOT);
            for (Enum<?> value : all) expected.add(kind + "_" + value + " " + value.ordinal());
        }
        for (Interaction.Kind kind : Interaction.Kind.values()) expected.add(kind + " " + kind.ordinal());
        for (Skin.Kind kind : Skin.Kind.values()) expected.add("SKIN_" + kind + " " + kind.ordinal());
        for (Spheres.Precision precision : Spheres.Precision.values()) expected.add(precision + " " + precision.ordinal());
        for (ListOption option : ListOption.values()) expected.add("LIST_" + option + " " + option.bit());
        check(named.equals(expected), "header " + named + ", here " + expected);
    }

    /**
     * Runs all.
     *
     * @param arguments see above
     * @throws Exception if a test cannot run
     */
    public static void main(String[] arguments) throws Exception {
        check(NativeApi.callMethod().equals(arguments[0]), "called through " + NativeApi.callMethod());
        header(Path.of(arguments[1]));
        inputs();
        settings();
        results();
        arbitraryScenes();
        streams();
        errors();
        speciesAndBoxes();
        arenas();
        steps();
        SetsAndSkins.run();
        BoxesAndExclusions.run();
        Precisions.run();
        NeighborLists.run();
        threads();
        sharedDetector();
        finish();
    }

    /** Prints the numbers and ends the process. */
    static void finish() {
        System.out.println(passed + " passed, " + failed + " failed");
        System.exit(failed == 0 ? 0 : 1);
    }
}
