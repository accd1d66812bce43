import io.github.lazygrid.Detector;
import io.github.lazygrid.Spheres;
import java.nio.IntBuffer;

/** The replacement of the octree: no bounds, no capacity, no query per particle. */
final class Lazygrid implements NeighborSearch {
    private final Detector detector = new Detector();
    /** Created once: the simulator moves its particles in one buffer. */
    private Spheres spheres;

    @Override
    public void search(Particles particles, Touch touch) {
        if (spheres == null) spheres = Spheres.rows(particles.rows);
        IntBuffer pairs = detector.pairs(spheres);
        while (pairs.hasRemaining()) touch.meet(pairs.get(), pairs.get());
    }

    @Override
    public void close() {
        detector.close();
    }
}
