package io.github.lazygrid;

import static io.github.lazygrid.ContractTest.check;
import static io.github.lazygrid.ContractTest.failing;
import static io.github.lazygrid.ContractTest.line;
import static io.github.lazygrid.ContractTest.onCpu;
import static io.github.lazygrid.ContractTest.overlap;
import static io.github.lazygrid.ContractTest.throwing;

import java.nio.FloatBuffer;
import java.nio.IntBuffer;
import java.util.Arrays;
import java.util.Random;
import java.util.stream.IntStream;

/** Pairs across two sets, and skins, against the plain loop and searches of one set. */
final class SetsAndSkins {
    private SetsAndSkins() {}

    static void run() {
        results();
        species();
        secondSet();
        skins();
        refusedSkins();
    }

    private static FloatBuffer scene(Random random, int count) {
        FloatBuffer rows = Spheres.allocateFloats(4 * count);
        for (int k = 0; k < 4 * count; k++) rows.put(k, random.nextFloat() * (k % 4 == 3 ? 0.3f : 3));
        return rows;
    }

    private static int[] copy(IntBuffer numbers) {
        int[] copy = new int[numbers.remaining()];
        numbers.get(copy);
        return copy;
    }

    private static void results() {
        Random random = new Random(2);
        try (Detector detector = new Detector(onCpu())) {
            for (int iteration = 0; iteration < 20; iteration++) {
                int n = random.nextInt(300), m = random.nextInt(300);
                FloatBuffer one = scene(random, n), other = scene(random, m);
                Query query = Query.across(Spheres.rows(one), Spheres.rows(other));
                int[] expected = IntStream.range(0, n).boxed().flatMapToInt(i -> IntStream.range(0, m)
                    .filter(j -> overlap(one, i, other, j)).flatMap(j -> IntStream.of(i, j))).toArray();
                IntBuffer found = detector.pairs(query);
                check(found.isReadOnly() && Arrays.equals(copy(found), expected), "scene " + iteration);
                check(detector.count(query) == expected.length / 2, "count of scene " + iteration);
                Neighbors lists = detector.neighbors(query);
                int[] listed = IntStream.range(0, n).boxed()
                    .flatMapToInt(i -> Arrays.stream(copy(lists.neighborsOf(i))).flatMap(j -> IntStream.of(i, j)))
                    .toArray();
                check(lists.offsets().remaining() == n + 1 && Arrays.equals(listed, expected), "lists " + iteration);
                IntBuffer streamed = IntBuffer.allocate(expected.length);
                long handed = detector.stream(query, 7, pairs -> {
                    check(pairs.remaining() <= 14, "chunk");
                    streamed.put(pairs);
                    return true;
                });
                check(handed == expected.length / 2 && Arrays.equals(streamed.array(), expected), "stream " + iteration);
            }
        }
    }

    /** The pairs of one set that are of both parts equal the pairs across its parts. */
    private static void species() {
        int count = 400, split = 150;
        FloatBuffer rows = scene(new Random(3), count);
        IntBuffer ids = Spheres.allocateInts(count);
        for (int k = 0; k < count; k++) ids.put(k, k % 2);
        Interactions table = new Interactions(2, Interaction.TOUCH).set(0, 1, Interaction.within(0.5f));
        Spheres all = Spheres.rows(rows).withSpecies(ids);
        Spheres a = Spheres.rows(rows.duplicate().limit(4 * split)).withSpecies(ids.duplicate().limit(split));
        Spheres bare = Spheres.rows(rows.duplicate().position(4 * split));
        Spheres b = bare.withSpecies(ids.duplicate().position(split));
        try (Detector detector = new Detector(onCpu().interactions(table))) {
            int[] pairs = detector.pairsAsArray(all);
            int[] across = IntStream.range(0, pairs.length / 2)
                .filter(k -> pairs[2 * k] < split && pairs[2 * k + 1] >= split)
                .flatMap(k -> IntStream.of(pairs[2 * k], pairs[2 * k + 1] - split)).toArray();
            check(across.length > 0 && Arrays.equals(detector.pairsAsArray(Query.across(a, b)), across), "species across");
            failing(Status.INPUT, "in the second set, ", () -> detector.count(Query.across(a, bare)));
        }
    }

    private static void secondSet() {
        FloatBuffer bad = line(3);
        bad.put(11, Float.NaN);
        Spheres good = Spheres.rows(line(100)), wrong = Spheres.rows(bad);
        Query both = Query.across(good, good);
        Detector detector = new Detector(onCpu().maxPairs(5));
        failing(Status.INPUT, "in the second set, sphere 2", () -> detector.pairs(Query.across(good, wrong)));
        throwing(LazygridException.class, e -> e.getMessage().startsWith("sphere 2"),
            () -> detector.neighbors(Query.across(wrong, good)), "first set");
        // Each touches itself and its neighbors.
        throwing(TooManyPairsException.class, e -> e.found() == 298, () -> detector.pairs(both), "too many");
        check(detector.count(both) == 298, "counts have no limit");
        failing(Status.BUSY, "in use",
            () -> detector.stream(both, 9, pairs -> detector.count(both) > 0));
        throwing(UnsupportedOperationException.class, e -> true, () -> detector.stream(both, 9, pairs -> {
            throw new UnsupportedOperationException();
        }), "thrown by a consumer");
        detector.close();
        throwing(IllegalStateException.class, e -> true, () -> detector.count(both), "closed");
        throwing(NullPointerException.class, e -> true, () -> Query.across(good, null), "no second set");
        throwing(NullPointerException.class, e -> true, () -> Query.of(null), "no set");
    }

    private static void skins() {
        int count = 3000, reused = 0;
        Random random = new Random(4);
        FloatBuffer rows = scene(random, count);
        for (int k = 0; k < 4 * count; k++) if (k % 4 != 3) rows.put(k, 4 * rows.get(k));
        Spheres spheres = Spheres.rows(rows);
        try (Detector off = new Detector(onCpu().skin(Skin.OFF)); Detector auto = new Detector(onCpu().skin(Skin.AUTO));
                Detector fixed = new Detector(onCpu().skin(Skin.fixed(0.2)))) {
            for (int step = 0; step < 12; step++) {
                int[] expected = off.pairsAsArray(spheres);
                check(expected.length > 100 && off.reportJson().contains("\"candidates\":null"), "off");
                check(Arrays.equals(auto.pairsAsArray(spheres), expected), "auto, step " + step);
                check(Arrays.equals(fixed.pairsAsArray(spheres), expected), "fixed, step " + step);
                if (fixed.reportJson().contains("\"rebuilt\":null")) reused++;
                for (int k = 0; k < 4 * count; k++) {
                    if (k % 4 != 3) rows.put(k, rows.get(k) + 0.02f * (random.nextFloat() - 0.5f));
                }
            }
        }
        check(reused >= 6, "reused in " + reused + " steps");
    }

    private static void refusedSkins() {
        for (double distance : new double[] {0, -1, 1e-20, 1e30, Double.NaN}) {
            failing(Status.SETTING, "skin = ", () -> new Detector(onCpu().skin(Skin.fixed(distance))).close());
        }
        failing(Status.SETTING, "skin = ",
            () -> new Detector(onCpu().skin(Skin.fixed(0.1)).algorithm(Algorithm.NAIVE)).close());
        failing(Status.SETTING, "skin_distance is 0.5",
            () -> new Detector(onCpu().skin(new Skin(Skin.Kind.OFF, 0.5))).close());
    }
}
