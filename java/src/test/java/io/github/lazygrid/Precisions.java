package io.github.lazygrid;

import static io.github.lazygrid.ContractTest.check;
import static io.github.lazygrid.ContractTest.failing;
import static io.github.lazygrid.ContractTest.line;
import static io.github.lazygrid.ContractTest.onCpu;
import static io.github.lazygrid.ContractTest.throwing;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.DoubleBuffer;
import java.nio.FloatBuffer;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Random;

/** Spheres in double precision and in all layouts: no number is rounded. */
final class Precisions {
    /** Neighboring floats are 64 apart here, doubles 1.2e-7. */
    private static final double FAR = 1e9;
    private static final Algorithm[] CPU = {
        Algorithm.AUTO, Algorithm.NAIVE, Algorithm.HASH_GRID, Algorithm.ARRAY_GRID, Algorithm.RECURSIVE_GRID,
        Algorithm.CELL_LIST
    };

    private Precisions() {}

    static void run() {
        farAway();
        tangent();
        twoSets();
        periodic();
        distances();
        points();
        refused();
    }

    private static DoubleBuffer direct(double... values) {
        return Spheres.allocateDoubles(values.length).put(0, values);
    }

    private static DoubleBuffer doubles(FloatBuffer floats) {
        DoubleBuffer doubles = Spheres.allocateDoubles(floats.remaining());
        for (int k = 0; k < floats.remaining(); k++) doubles.put(k, floats.get(floats.position() + k));
        return doubles;
    }

    /** Column {@code axis} of rows. */
    private static DoubleBuffer column(DoubleBuffer rows, int axis) {
        DoubleBuffer column = Spheres.allocateDoubles(rows.remaining() / 4);
        for (int k = 0; k < column.capacity(); k++) column.put(k, rows.get(4 * k + axis));
        return column;
    }

    private static Spheres columns(DoubleBuffer rows) {
        return Spheres.columns(column(rows, 0), column(rows, 1), column(rows, 2), column(rows, 3));
    }

    /** Random spheres {@code offset} away from the origin in multiples of 1/64, so that the plain loop is exact. */
    private static DoubleBuffer scene(int seed, int count, double offset) {
        Random random = new Random(seed);
        DoubleBuffer rows = Spheres.allocateDoubles(4 * count);
        for (int k = 0; k < 4 * count; k++) {
            rows.put(k, k % 4 == 3 ? random.nextInt(24) / 64.0 : offset + random.nextInt(256) / 64.0);
        }
        return rows;
    }

    private static boolean overlap(DoubleBuffer a, int i, DoubleBuffer b, int j) {
        double squared = 0;
        for (int axis = 0; axis < 3; axis++) {
            double d = a.get(4 * i + axis) - b.get(4 * j + axis);
            squared += d * d;
        }
        double cutoff = a.get(4 * i + 3) + b.get(4 * j + 3);
        return squared <= cutoff * cutoff;
    }

    private static int[] plainLoop(DoubleBuffer a, DoubleBuffer b) {
        List<Integer> pairs = new ArrayList<>();
        for (int i = 0; i < a.capacity() / 4; i++) {
            for (int j = a == b ? i + 1 : 0; j < b.capacity() / 4; j++) {
                if (overlap(a, i, b, j)) pairs.addAll(List.of(i, j));
            }
        }
        return pairs.stream().mapToInt(Integer::intValue).toArray();
    }

    private static void farAway() {
        DoubleBuffer rows = scene(11, 400, FAR);
        int[] expected = plainLoop(rows, rows);
        check(expected.length > 100, "some pairs");
        DoubleBuffer shifted = Spheres.allocateDoubles(4 * 400 + 4);
        for (int k = 0; k < 4 * 400; k++) shifted.put(k + 4, rows.get(k));
        shifted.position(4);
        for (Algorithm algorithm : CPU) {
            try (Detector detector = new Detector(onCpu().algorithm(algorithm))) {
                check(Arrays.equals(detector.pairsAsArray(Spheres.rows(rows)), expected), "rows, " + algorithm);
                check(Arrays.equals(detector.pairsAsArray(columns(rows)), expected), "columns, " + algorithm);
                check(Arrays.equals(detector.pairsAsArray(Spheres.rows(shifted)), expected), "position, " + algorithm);
            }
        }
    }

    /** A cutoff of exactly the distance counts; one ulp less does not. */
    private static void tangent() {
        try (Detector detector = new Detector(onCpu())) {
            for (double offset : new double[] {0, FAR}) {
                DoubleBuffer rows = direct(offset, 0, 0, 0, offset + 0.75, 0, 0, 0.75);
                Spheres spheres = Spheres.rows(rows);
                check(detector.count(spheres) == 1, "touching at " + offset);
                rows.put(7, Math.nextDown(0.75));
                check(detector.count(spheres) == 0, "just apart at " + offset);
                rows.put(4, Math.nextUp(offset + 0.75)).put(7, 0.75);
                check(detector.count(spheres) == 0, "moved apart at " + offset);
            }
        }
    }

    private static void twoSets() {
        DoubleBuffer one = scene(12, 150, FAR), other = scene(13, 250, FAR);
        int[] expected = plainLoop(one, other);
        check(expected.length > 100, "some pairs across");
        FloatBuffer floats = line(50);
        for (Algorithm algorithm : CPU) {
            try (Detector detector = new Detector(onCpu().algorithm(algorithm))) {
                Query query = Query.across(Spheres.rows(one), columns(other));
                check(Arrays.equals(detector.pairsAsArray(query), expected), "across, " + algorithm);
                check(detector.count(query) == expected.length / 2, "count across, " + algorithm);
                check(detector.neighbors(query).indices().remaining() == expected.length / 2, "lists, " + algorithm);
                // Each touches itself and its neighbors, in any precision of the sets.
                Query mixed = Query.across(Spheres.rows(floats), Spheres.rows(doubles(floats)));
                check(detector.count(mixed) == 148, "both precisions, " + algorithm);
            }
        }
    }

    /** 10.1 is no float: 10.1f is larger by 3.8e-7. */
    private static void periodic() {
        double length = 10.1, radius = 0.0625;
        double last = length - 2 * radius;
        check(length - last == 2 * radius, "an exact difference");
        DoubleBuffer rows = direct(0, 0, 0, radius, last, 0, 0, radius);
        Spheres spheres = Spheres.rows(rows);
        double[][] vectors = {{length, 0, 0}, null, null};
        for (Settings settings : new Settings[] {
            onCpu().periodic(length, 0, 0), onCpu().cellVectors(vectors[0], vectors[1], vectors[2])
        }) {
            try (Detector detector = new Detector(settings)) {
                check(detector.count(spheres) == 1, "touching over the periodic boundary");
                rows.put(4, Math.nextDown(last));
                check(detector.count(spheres) == 0, "just apart over the periodic boundary");
                rows.put(4, last);
            }
        }
        try (Detector detector = new Detector(onCpu().periodic((float) length, 0, 0))) {
            check(detector.count(spheres) == 0, "apart in the longer box");
        }
    }

    /** Distances of interactions are not rounded. */
    private static void distances() {
        double distance = 0.1;
        Spheres spheres = Spheres.points(direct(0, 0, 0, distance, 0, 0), 0.0).withSpecies(Spheres.allocateInts(2));
        for (double within : new double[] {distance, Math.nextDown(distance)}) {
            Interactions table = new Interactions(1, Interaction.within(within));
            try (Detector detector = new Detector(onCpu().interactions(table))) {
                check(detector.count(spheres) == (within == distance ? 1 : 0), "within " + within);
            }
        }
    }

    private static void points() {
        DoubleBuffer centers = direct(FAR, 0, 0, FAR + 0.5, 0, 0, FAR + 1.25, 0, 0);
        FloatBuffer few = Spheres.allocateFloats(9).put(3, 0.5f).put(6, 1.25f);
        try (Detector detector = new Detector(onCpu())) {
            int[] pairs = detector.pairsAsArray(Spheres.points(centers, 0.25));
            check(Arrays.equals(pairs, new int[] {0, 1}), "points: " + Arrays.toString(pairs));
            check(detector.count(Spheres.points(centers, 0.375)) == 2, "a larger radius");
            check(detector.count(Spheres.points(few, 0.25f)) == 1, "points of floats");
            check(detector.count(Spheres.points(Spheres.allocateDoubles(0), 1)) == 0, "no points");
            check(detector.count(Spheres.rows(Spheres.allocateDoubles(0))) == 0, "no rows");
            Spheres moving = Spheres.points(centers, 0.25);
            centers.put(6, FAR + 1);
            check(detector.count(moving) == 2, "what was written since is read");
            failing(Status.INPUT, "sphere 0", () -> detector.count(Spheres.points(centers, -1.0)));
        }
    }

    private static void refused() {
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("Spheres.allocateDoubles"),
            () -> Spheres.rows(DoubleBuffer.allocate(4)), "heap");
        ByteOrder other =
            ByteOrder.nativeOrder() == ByteOrder.LITTLE_ENDIAN ? ByteOrder.BIG_ENDIAN : ByteOrder.LITTLE_ENDIAN;
        throwing(IllegalArgumentException.class, e -> true,
            () -> Spheres.rows(ByteBuffer.allocateDirect(32).order(other).asDoubleBuffer()), "other order");
        throwing(IllegalArgumentException.class, e -> true, () -> Spheres.rows(Spheres.allocateDoubles(5)), "no rows");
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("give 3"),
            () -> Spheres.points(Spheres.allocateDoubles(4), 1), "no centers");
        DoubleBuffer two = Spheres.allocateDoubles(2);
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("r has 1"),
            () -> Spheres.columns(two, two, two, Spheres.allocateDoubles(1)), "lengths");
        DoubleBuffer bad = scene(14, 3, 0).put(8, Double.NaN);
        try (Detector detector = new Detector(onCpu())) {
            failing(Status.INPUT, "sphere 2", () -> detector.count(Spheres.rows(bad)));
        }
    }
}
