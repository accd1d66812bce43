package io.github.lazygrid;

import static io.github.lazygrid.ContractTest.check;
import static io.github.lazygrid.ContractTest.failing;
import static io.github.lazygrid.ContractTest.onCpu;
import static io.github.lazygrid.ContractTest.throwing;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;
import java.nio.IntBuffer;
import java.nio.LongBuffer;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Random;

/** Triclinic boxes, groups and excluded pairs, against the plain loop. */
final class BoxesAndExclusions {
    private static final double[][] TRICLINIC = {{4, 0, 0}, {3, 4, 0}, {-1, 2.5, 5}};
    private static final Algorithm[] CPU = {
        Algorithm.AUTO, Algorithm.NAIVE, Algorithm.HASH_GRID, Algorithm.ARRAY_GRID, Algorithm.RECURSIVE_GRID,
        Algorithm.CELL_LIST
    };
    private static final int COUNT = 120;
    private static final int SPLIT = 50;

    private BoxesAndExclusions() {}

    static void run() {
        triclinic();
        omitted();
        twoSets();
        collected();
        refused();
    }

    /** Whole thirty-seconds, so that the plain loop is exact. */
    private static FloatBuffer scene(int seed) {
        Random random = new Random(seed);
        FloatBuffer rows = Spheres.allocateFloats(4 * COUNT);
        for (int k = 0; k < 4 * COUNT; k++) rows.put(k, random.nextInt(k % 4 == 3 ? 24 : 128) / 32f);
        return rows;
    }

    /** Returns true if images up to four cell vectors away touch. */
    private static boolean touch(FloatBuffer rows, int i, int j, double[][] vectors) {
        double cutoff = (double) rows.get(4 * i + 3) + rows.get(4 * j + 3);
        int far = vectors == null ? 0 : 4;
        for (int x = -far; x <= far; x++) {
            for (int y = -far; y <= far; y++) {
                for (int z = -far; z <= far; z++) {
                    double squared = 0;
                    for (int axis = 0; axis < 3; axis++) {
                        double d = (double) rows.get(4 * i + axis) - rows.get(4 * j + axis);
                        if (vectors != null) d += x * vectors[0][axis] + y * vectors[1][axis] + z * vectors[2][axis];
                        squared += d * d;
                    }
                    if (squared <= cutoff * cutoff) return true;
                }
            }
        }
        return false;
    }

    private static List<int[]> plainLoop(FloatBuffer rows, double[][] vectors) {
        List<int[]> pairs = new ArrayList<>();
        for (int i = 0; i < COUNT; i++) {
            for (int j = i + 1; j < COUNT; j++) if (touch(rows, i, j, vectors)) pairs.add(new int[] {i, j});
        }
        return pairs;
    }

    private static int[] flat(List<int[]> pairs) {
        return pairs.stream().flatMapToInt(Arrays::stream).toArray();
    }

    /** All kinds of results. */
    private static void same(Detector detector, Spheres spheres, List<int[]> expected, String what) {
        same(detector, Query.of(spheres), expected, what);
    }

    private static void same(Detector detector, Query query, List<int[]> expected, String what) {
        check(Arrays.equals(detector.pairsAsArray(query), flat(expected)), what + ": pairs");
        check(detector.count(query) == expected.size(), what + ": count");
        check(detector.neighbors(query).indices().remaining() == 2 * expected.size(), what + ": lists");
        check(detector.stream(query, 8, pairs -> true) == expected.size(), what + ": stream");
    }

    private static void triclinic() {
        FloatBuffer rows = scene(1);
        for (int repeating = 1; repeating <= 3; repeating++) {
            double[][] vectors = new double[3][3];
            for (int k = 0; k < repeating; k++) vectors[k] = TRICLINIC[k];
            List<int[]> expected = plainLoop(rows, vectors);
            for (Algorithm algorithm : CPU) {
                Settings settings = onCpu().algorithm(algorithm);
                settings.cellVectors(vectors[0], repeating > 1 ? vectors[1] : null, repeating > 2 ? vectors[2] : null);
                try (Detector detector = new Detector(settings)) {
                    same(detector, Spheres.rows(rows), expected, repeating + " vectors, " + algorithm);
                }
            }
        }
    }

    private static void omitted() {
        for (double[][] vectors : new double[][][] {null, TRICLINIC}) {
            FloatBuffer rows = scene(2);
            List<int[]> all = plainLoop(rows, vectors), apart = new ArrayList<>(), rest = new ArrayList<>();
            IntBuffer groups = Spheres.allocateInts(COUNT);
            for (int k = 0; k < COUNT; k++) groups.put(k, k % 5 == 4 ? Spheres.NO_GROUP : k % 5);
            List<int[]> listed = new ArrayList<>();
            for (int[] pair : all) {
                boolean together = groups.get(pair[0]) == groups.get(pair[1]) && groups.get(pair[0]) >= 0;
                if (!together) apart.add(pair);
                if (listed.size() * 3 < all.size()) {
                    listed.add(listed.size() % 2 == 0 ? pair : new int[] {pair[1], pair[0]});
                } else if (!together) {
                    rest.add(pair);
                }
            }
            check(!rest.isEmpty() && rest.size() < apart.size() && apart.size() < all.size(), "some of each");
            Settings settings = vectors == null ? onCpu() : onCpu().cellVectors(vectors[0], vectors[1], vectors[2]);
            try (Detector detector = new Detector(settings)) {
                Spheres spheres = Spheres.rows(rows), grouped = spheres.withGroups(groups);
                same(detector, grouped, apart, "groups");
                Exclusions exclusions = Exclusions.of(COUNT, flat(listed));
                same(detector, Query.of(grouped).without(exclusions), rest, "groups and pairs");
                same(detector, Query.of(grouped).without(exclusions).without(null), apart, "no pairs again");
                Neighbors lists = detector.neighbors(spheres);
                Exclusions every = Exclusions.fromCsr(lists.offsets(), lists.indices());
                same(detector, Query.of(spheres).without(every), List.of(), "all that touch");
                same(detector, spheres, all, "as before");
            }
        }
    }

    private static void twoSets() {
        FloatBuffer rows = scene(3);
        IntBuffer groups = Spheres.allocateInts(COUNT);
        for (int k = 0; k < COUNT; k++) groups.put(k, k % 4 == 3 ? Spheres.NO_GROUP : k % 4);
        List<int[]> expected = new ArrayList<>(), listed = new ArrayList<>();
        for (int i = 0; i < SPLIT; i++) {
            for (int j = SPLIT; j < COUNT; j++) {
                if (!touch(rows, i, j, TRICLINIC)) continue;
                boolean together = groups.get(i) == groups.get(j) && groups.get(i) >= 0;
                if ((i + j) % 4 == 0) {
                    listed.add(new int[] {i, j - SPLIT});
                } else if (!together) {
                    expected.add(new int[] {i, j - SPLIT});
                }
            }
        }
        check(!expected.isEmpty() && !listed.isEmpty(), "some of each");
        Spheres a = Spheres.rows(rows.duplicate().limit(4 * SPLIT)).withGroups(groups.duplicate().limit(SPLIT));
        Spheres b = Spheres.rows(rows.duplicate().position(4 * SPLIT)).withGroups(groups.duplicate().position(SPLIT));
        Exclusions exclusions = Exclusions.across(SPLIT, COUNT - SPLIT, flat(listed));
        Query across = Query.across(a, b).without(exclusions);
        for (Algorithm algorithm : CPU) {
            Settings settings = onCpu().algorithm(algorithm).cellVectors(TRICLINIC[0], TRICLINIC[1], TRICLINIC[2]);
            try (Detector detector = new Detector(settings)) {
                check(Arrays.equals(detector.pairsAsArray(across), flat(expected)), "across, " + algorithm);
                check(detector.count(across) == expected.size(), "count across, " + algorithm);
                check(detector.stream(across, 8, pairs -> true) == expected.size(), "stream across, " + algorithm);
                Neighbors lists = detector.neighbors(across);
                check(lists.offsets().remaining() == SPLIT + 1, "lists across, " + algorithm);
                check(lists.indices().remaining() == expected.size(), "neighbors across, " + algorithm);
                Exclusions ofOne = Exclusions.of(COUNT - SPLIT);
                failing(Status.INPUT, "", () -> detector.count(Query.across(a, b).without(ofOne)));
                failing(Status.INPUT, "", () -> detector.count(Query.of(a).without(exclusions)));
                failing(Status.INPUT, "", () -> detector.count(Query.across(b, a).without(exclusions)));
            }
        }
    }

    /** A list lives as long as a query names it. */
    private static void collected() {
        FloatBuffer rows = scene(4);
        List<int[]> all = plainLoop(rows, null);
        Query query = Query.of(Spheres.rows(rows)).without(Exclusions.of(COUNT, flat(all)));
        try (Detector detector = new Detector(onCpu())) {
            for (int iteration = 0; iteration < 5; iteration++) {
                for (int k = 0; k < 100; k++) Exclusions.of(COUNT, flat(all));
                System.gc();
                check(detector.count(query) == 0, "kept, iteration " + iteration);
            }
        }
    }

    private static void refused() {
        failing(Status.INPUT, "(1, 7)", () -> Exclusions.of(7, 0, 1, 1, 7));
        failing(Status.INPUT, "", () -> Exclusions.across(2, 1, 1, 1));
        failing(Status.INPUT, "(4, 0, 0)", () -> new Detector(
            onCpu().cellVectors(new double[] {4, 0, 0}, new double[] {8, 0, 0}, null)).close());
        failing(Status.SETTING, "settings.cell_vectors", () -> new Detector(
            onCpu().periodic(1, 0, 0).cellVectors(new double[] {4, 0, 0}, null, null)).close());
        throwing(IllegalArgumentException.class, e -> true, () -> Exclusions.of(7, 0), "odd");
        throwing(IllegalArgumentException.class, e -> true, () -> Exclusions.of(-1), "negative");
        throwing(IllegalArgumentException.class, e -> true,
            () -> onCpu().cellVectors(new double[2], null, null), "cell vector");
        Spheres spheres = Spheres.rows(scene(5));
        throwing(IllegalArgumentException.class, e -> e.getMessage().contains("groups has 2"),
            () -> spheres.withGroups(Spheres.allocateInts(2)), "groups");
        throwing(IllegalArgumentException.class, e -> true,
            () -> Exclusions.fromCsr(LongBuffer.allocate(1), Spheres.allocateInts(0)), "heap");
        IntBuffer two = Spheres.allocateInts(2);
        LongBuffer offsets =
            ByteBuffer.allocateDirect(24).order(ByteOrder.nativeOrder()).asLongBuffer();
        throwing(IllegalArgumentException.class, e -> true, () -> Exclusions.fromCsr(offsets, two), "last offset");
        offsets.put(1, 5).put(2, 2);
        failing(Status.INPUT, "", () -> Exclusions.fromCsr(offsets, two));
    }
}
