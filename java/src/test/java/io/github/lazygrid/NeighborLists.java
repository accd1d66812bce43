package io.github.lazygrid;

import static io.github.lazygrid.ContractTest.check;
import static io.github.lazygrid.ContractTest.failing;
import static io.github.lazygrid.ContractTest.line;
import static io.github.lazygrid.ContractTest.onCpu;
import static io.github.lazygrid.ContractTest.throwing;

import java.nio.DoubleBuffer;
import java.nio.FloatBuffer;
import java.util.EnumSet;
import java.util.Random;
import java.util.Set;

/** Neighbor lists with geometry. */
final class NeighborLists {
    private static final Set<ListOption> GEOMETRY =
        EnumSet.of(ListOption.SHIFTS, ListOption.VECTORS, ListOption.DISTANCES);

    private NeighborLists() {}

    static void run() {
        geometry();
        options();
        smallBox();
        twoSets();
    }

    /** In a large box, a list has the pairs of a search, each twice, with the shortest vectors. */
    private static void geometry() {
        int count = 300;
        double length = 10.1;
        Random random = new Random(21);
        DoubleBuffer rows = Spheres.allocateDoubles(4 * count);
        for (int k = 0; k < 4 * count; k++) rows.put(k, random.nextDouble() * (k % 4 == 3 ? 0.8 : length));
        Spheres spheres = Spheres.rows(rows);
        try (Detector detector = new Detector(onCpu().periodic(length, length, length))) {
            long pairs = detector.count(spheres);
            NeighborList list = detector.neighborList(spheres, GEOMETRY);
            check(pairs > 100 && list.length() == 2 * pairs, "every pair twice");
            check(list.offsets().remaining() == count + 1 && list.offsets().get(count) == list.length(), "offsets");
            check(list.pairs().isReadOnly() && list.vectors().isReadOnly(), "read-only");
            boolean placed = true, right = true;
            for (int at = 0; at < list.length(); at++) {
                int i = list.pairs().get(2 * at), j = list.pairs().get(2 * at + 1);
                placed &= list.offsets().get(i) <= at && at < list.offsets().get(i + 1);
                double squared = 0;
                for (int axis = 0; axis < 3; axis++) {
                    double between = rows.get(4 * j + axis) - rows.get(4 * i + axis);
                    double vector = list.vectors().get(3 * at + axis);
                    right &= Math.abs(between + list.shifts().get(3 * at + axis) * length - vector) < 1e-12;
                    squared += vector * vector;
                }
                right &= Math.abs(Math.sqrt(squared) - list.distances().get(at)) < 1e-12;
                right &= list.distances().get(at) <= rows.get(4 * i + 3) + rows.get(4 * j + 3) + 1e-12;
            }
            check(placed, "entries stand between the offsets of their sphere");
            check(right, "shifts, vectors and distances");
        }
    }

    private static void options() {
        // The first two touch, the last two overlap.
        FloatBuffer rows = Spheres.allocateFloats(12);
        rows.put(0, new float[] {0, 0, 0, 0.5f, 1, 0, 0, 0.5f, 1.5f, 0, 0, 0.25f});
        Spheres spheres = Spheres.rows(rows);
        try (Detector detector = new Detector(onCpu())) {
            NeighborList bare = detector.neighborList(spheres, Set.of());
            check(bare.length() == 4, "full: " + bare.length());
            check(bare.shifts().capacity() == 0 && bare.vectors().capacity() == 0, "not asked for");
            check(bare.distances().capacity() == 0, "no distances");
            NeighborList half = detector.neighborList(spheres, Set.of(ListOption.HALF, ListOption.DISTANCES));
            check(half.length() == 2 && half.distances().get(0) == 1 && half.distances().get(1) == 0.5, "half");
            check(half.shifts().capacity() == 0, "distances only");
            check(detector.neighborList(spheres, Set.of(ListOption.OPEN)).length() == 2, "open");
            check(detector.neighborList(spheres, Set.of(ListOption.SELF)).length() == 7, "with self");
            Query query = Query.of(spheres).without(Exclusions.of(3, 2, 1));
            check(detector.neighborList(query, Set.of()).length() == 2, "without a pair");
            NeighborList none = detector.neighborList(Spheres.rows(Spheres.allocateFloats(0)), GEOMETRY);
            check(none.length() == 0 && none.offsets().remaining() == 1, "no spheres");
            check(none.vectors().capacity() == 0 && none.shifts().capacity() == 0, "no geometry");
            rows.put(4, Float.NaN);
            failing(Status.INPUT, "sphere 1", () -> detector.neighborList(spheres, GEOMETRY));
        }
        try (Detector few = new Detector(onCpu().maxPairs(5))) {
            Spheres many = Spheres.rows(line(100));
            throwing(TooManyPairsException.class, e -> e.found() == 99, () -> few.neighborList(many, Set.of()), "a list");
            throwing(TooManyPairsException.class, e -> e.found() == 99, () -> few.neighbors(many), "neighbors");
        }
    }

    /** In a box smaller than the cutoff, a sphere is the neighbor of its own images. */
    private static void smallBox() {
        Spheres one = Spheres.points(Spheres.allocateDoubles(3), 1.0);
        try (Detector detector = new Detector(onCpu().periodic(1, 0, 0))) {
            NeighborList list = detector.neighborList(one, GEOMETRY);
            check(list.length() == 4, "images: " + list.length());
            int[] shifts = {-2, -1, 1, 2};
            for (int k = 0; k < Math.min(4, list.length()); k++) {
                check(list.shifts().get(3 * k) == shifts[k] && list.vectors().get(3 * k) == shifts[k], "image " + k);
            }
            check(detector.neighborList(one, Set.of(ListOption.HALF)).length() == 2, "one of opposite images");
        }
    }

    private static void twoSets() {
        Spheres a = Spheres.rows(line(10)), b = Spheres.points(Spheres.allocateDoubles(3), 0.3);
        try (Detector detector = new Detector(onCpu())) {
            NeighborList list = detector.neighborList(Query.across(a, b), GEOMETRY);
            check(list.length() == 2 && list.offsets().remaining() == 11, "across");
            check(list.pairs().get(2) == 1 && list.pairs().get(3) == 0, "the second set counts by itself");
            check(list.vectors().get(3) == -0.5 && list.distances().get(1) == 0.5, "from the first to the second");
        }
    }
}
