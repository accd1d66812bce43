import io.github.lazygrid.Spheres;
import java.util.Random;
import java.util.TreeSet;

/**
 * A small simulator of diffusing particles that counts contacts, with an octree and with lazygrid. Both must agree at
 * each step.
 */
final class Simulator {
    private static final int PARTICLES = 5000;
    private static final float EDGE = 25;
    private static final int STEPS = 5;

    private Simulator() {}

    public static void main(String[] arguments) {
        Particles particles = new Particles(PARTICLES, EDGE, Spheres.allocateFloats(4 * PARTICLES), 1);
        Random random = new Random(2);
        try (NeighborSearch octree = new Octree(); NeighborSearch lazygrid = new Lazygrid()) {
            for (int step = 0; step < STEPS; step++) {
                TreeSet<Long> before = meetings(octree, particles);
                TreeSet<Long> now = meetings(lazygrid, particles);
                if (!before.equals(now)) throw new AssertionError("step " + step + " differs");
                System.out.println("step " + step + ": " + now.size() + " meetings, the same by both");
                particles.diffuse(random, 0.1f);
            }
        }
    }

    private static TreeSet<Long> meetings(NeighborSearch search, Particles particles) {
        TreeSet<Long> found = new TreeSet<>();
        search.search(particles, (i, j) -> {
            if (!found.add((long) i << 32 | j)) throw new AssertionError(i + " and " + j + " met twice");
        });
        return found;
    }
}
