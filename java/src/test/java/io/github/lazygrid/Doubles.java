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
import java.util.Arrays;

/** Spheres in double precision and in each layout. Those in double precision are tangent where floats are 64 apart. */
final class Doubles {
    private static final double[] CENTERS = {1e9, 3, 7, 1e9 + 1, 3, 7, 1e9 + 2.5, 3, 7};

    private Doubles() {}

    static void run() {
        layouts();
        floats();
        twoSets();
        lengths();
        refused();
    }

    private static DoubleBuffer direct(double... values) {
        return Spheres.doubles(values.length).put(0, values);
    }

    private static void hasOnePair(Detector detector, Spheres spheres, String what) {
        int[] pairs = detector.pairsCopied(spheres);
        check(spheres.count() == 3 && Arrays.equals(pairs, new int[] {0, 1}), what + ": " + Arrays.toString(pairs));
    }

    private static void layouts() {
        double[] rows = new double[12];
        double[][] columns = new double[4][3];
        for (int k = 0; k < 12; k++) {
            rows[k] = k % 4 == 3 ? 0.5 : CENTERS[k / 4 * 3 + k % 4];
            columns[k % 4][k / 4] = rows[k];
        }
        try (Detector detector = new Detector(onCpu())) {
            hasOnePair(detector, Spheres.rows(direct(rows)), "rows");
            hasOnePair(detector, Spheres.columns(direct(columns[0]), direct(columns[1]), direct(columns[2]),
                direct(columns[3])), "columns");
            hasOnePair(detector, Spheres.points(direct(CENTERS), 0.5), "points");
            hasOnePair(detector, Spheres.points(direct(CENTERS), direct(columns[3])), "points with radii");
            DoubleBuffer written = Spheres.doubles(16).put(4, rows).position(4);
            Spheres later = Spheres.rows(written);
            hasOnePair(detector, later, "from a position on");
            written.put(4, 1e9 + 1e-6);
            check(detector.count(later) == 1, "what was written since is read");
            written.put(4, 1e9 - 1e-6);
            check(detector.count(later) == 0, "no number is rounded");
            check(detector.count(Spheres.rows(Spheres.doubles(0))) == 0, "none");
        }
    }

    private static void floats() {
        FloatBuffer centers = Spheres.floats(9).put(0, new float[] {1, 10, 100, 2, 10, 100, 3.5f, 10, 100});
        try (Detector detector = new Detector(onCpu())) {
            hasOnePair(detector, Spheres.points(centers, 0.5f), "points");
            FloatBuffer radii = Spheres.floats(3).put(0, new float[] {0.25f, 0.75f, 0.5f});
            hasOnePair(detector, Spheres.points(centers, radii), "points with radii");
        }
    }

    private static void twoSets() {
        Spheres points = Spheres.points(direct(CENTERS), 0.5);
        FloatBuffer rows = Spheres.floats(8).put(0, new float[] {1e9f, 3, 7, 0.5f, 0, 0, 0, 1});
        Query query = Query.across(points, Spheres.rows(rows));
        for (Algorithm algorithm : new Algorithm[] {Algorithm.AUTO, Algorithm.HASH_GRID, Algorithm.CELL_LIST}) {
            try (Detector detector = new Detector(onCpu().algorithm(algorithm))) {
                check(Arrays.equals(detector.pairsCopied(query), new int[] {0, 0, 1, 0}), "across, " + algorithm);
                check(detector.neighbors(query).offsets().get(3) == 2, "lists, " + algorithm);
                Query rest = query.without(Exclusions.across(3, 2, 0, 0));
                check(Arrays.equals(detector.pairsCopied(rest), new int[] {1, 0}), "without, " + algorithm);
                check(detector.count(query) == 2, "as before, " + algorithm);
            }
        }
    }

    private static void lengths() {
        Spheres spheres = Spheres.rows(direct(0, 0, 0, 0.5, 9.1, 0, 0, 0.5));
        for (double length : new double[] {10.1, 10.1 + 1e-9}) {
            Settings[] each = {onCpu().periodic(length, 0, 0), onCpu().edges(new double[] {length, 0, 0}, null, null)};
            for (Settings settings : each) {
                try (Detector detector = new Detector(settings)) {
                    check(detector.count(spheres) == (length == 10.1 ? 1 : 0), "length " + length);
                }
            }
        }
        Interactions within = new Interactions(1, Interaction.within(9.1));
        Interactions below = new Interactions(1, Interaction.within(9.1 - 1e-12));
        for (Interactions table : new Interactions[] {within, below}) {
            try (Detector detector = new Detector(onCpu().interactions(table))) {
                long found = detector.count(spheres.withSpecies(Spheres.ints(2)));
                check(found == (table == within ? 1 : 0), "distance, " + found);
            }
        }
    }

    private static void refused() {
        throwing(IllegalArgumentException.class, e -> true, () -> Spheres.rows(DoubleBuffer.allocate(4)), "heap");
        throwing(IllegalArgumentException.class, e -> true,
            () -> Spheres.rows(ByteBuffer.allocateDirect(32).asDoubleBuffer()), "other order");
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("4 for each"),
            () -> Spheres.rows(Spheres.doubles(5)), "no rows");
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("3 for each"),
            () -> Spheres.points(Spheres.doubles(5), 1), "no points");
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("radii has 2"),
            () -> Spheres.points(Spheres.doubles(9), Spheres.doubles(2)), "radii");
        ByteBuffer bytes = ByteBuffer.allocateDirect(41).order(ByteOrder.nativeOrder()).position(1);
        try (Detector detector = new Detector(onCpu())) {
            Spheres shifted = Spheres.rows(bytes.slice().order(ByteOrder.nativeOrder()).asDoubleBuffer().limit(4));
            failing(Status.ARGUMENT, "a multiple of 8", () -> detector.count(shifted));
            failing(Status.INPUT, "sphere 0", () -> detector.count(Spheres.rows(direct(0, Double.NaN, 0, 1))));
            failing(Status.INPUT, "sphere 0", () -> detector.count(Spheres.points(Spheres.doubles(3), -1e-300)));
            check(detector.count(Spheres.rows(line(3))) == 2, "of use afterwards");
        }
    }
}
