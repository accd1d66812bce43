import io.github.lazygrid.Detector;
import io.github.lazygrid.Spheres;
import java.nio.IntBuffer;

/** What takes the octree's place: no bounds, no capacity, no query for each particle. */
final class Lazygrid implements NeighborSearch {
    private final Detector detector = new Detector();
    /** Made once: the simulator moves its particles in the same buffer. */
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
