import java.nio.FloatBuffer;
import java.util.Random;

/** Particles in a simulator: consecutive x, y, z and radius. */
final class Particles {
    final int count;
    final FloatBuffer rows;

    /** Particles at reproducible random positions in a cube. */
    Particles(int count, float side, FloatBuffer rows, long seed) {
        this.count = count;
        this.rows = rows;
        Random random = new Random(seed);
        for (int k = 0; k < count; k++) {
            for (int axis = 0; axis < 3; axis++) rows.put(4 * k + axis, side * random.nextFloat());
            rows.put(4 * k + 3, 0.2f + 0.3f * random.nextFloat());
        }
    }

    float at(int k, int axis) {
        return rows.get(4 * k + axis);
    }

    float radius(int k) {
        return rows.get(4 * k + 3);
    }

    boolean touch(int i, int j) {
        double squared = 0;
        for (int axis = 0; axis < 3; axis++) {
            double d = (double) at(i, axis) - at(j, axis);
            squared += d * d;
        }
        double cutoff = (double) radius(i) + radius(j);
        return squared <= cutoff * cutoff;
    }

    /** Moves every particle by a random step. */
    void diffuse(Random random, float length) {
        for (int k = 0; k < count; k++) {
            for (int axis = 0; axis < 3; axis++) {
                rows.put(4 * k + axis, at(k, axis) + length * (float) random.nextGaussian());
            }
        }
    }
}
