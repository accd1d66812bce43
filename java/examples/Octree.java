import java.util.Arrays;

/**
 * The structure to replace: an octree over the centers, rebuilt at each step. It needs bounds, a capacity and a depth,
 * and a query for every particle, widened by the largest radius.
 */
final class Octree implements NeighborSearch {
    private static final int CAPACITY = 8;
    private static final int DEPTH = 12;

    /** A cube: either particles, or eight cubes half as wide. */
    private static final class Node {
        final float[] center;
        final float half;
        final int[] particles = new int[CAPACITY];
        int count;
        Node[] children;
        /** Particles at the greatest depth, where cubes are not split. */
        int[] overflow = new int[0];

        Node(float[] center, float half) {
            this.center = center;
            this.half = half;
        }
    }

    @Override
    public void search(Particles particles, Touch touch) {
        float low = Float.POSITIVE_INFINITY, high = Float.NEGATIVE_INFINITY, widest = 0;
        for (int k = 0; k < particles.count; k++) {
            for (int axis = 0; axis < 3; axis++) {
                low = Math.min(low, particles.at(k, axis));
                high = Math.max(high, particles.at(k, axis));
            }
            widest = Math.max(widest, particles.radius(k));
        }
        float middle = (low + high) / 2;
        Node root = new Node(new float[] {middle, middle, middle}, (high - low) / 2);
        for (int k = 0; k < particles.count; k++) insert(root, particles, k, 0);
        for (int k = 0; k < particles.count; k++) query(root, particles, k, particles.radius(k) + widest, touch);
    }

    private static void insert(Node node, Particles particles, int k, int depth) {
        while (node.children != null) {
            node = child(node, particles, k);
            depth++;
        }
        if (node.count < CAPACITY) {
            node.particles[node.count++] = k;
        } else if (depth == DEPTH) {
            node.overflow = Arrays.copyOf(node.overflow, node.overflow.length + 1);
            node.overflow[node.overflow.length - 1] = k;
        } else {
            split(node);
            for (int inside : node.particles) insert(child(node, particles, inside), particles, inside, depth + 1);
            insert(child(node, particles, k), particles, k, depth + 1);
        }
    }

    private static void split(Node node) {
        node.children = new Node[8];
        for (int octant = 0; octant < 8; octant++) {
            float[] center = node.center.clone();
            for (int axis = 0; axis < 3; axis++) {
                center[axis] += (octant >> axis & 1) == 1 ? node.half / 2 : -node.half / 2;
            }
            node.children[octant] = new Node(center, node.half / 2);
        }
    }

    private static Node child(Node node, Particles particles, int k) {
        int octant = 0;
        for (int axis = 0; axis < 3; axis++) {
            if (particles.at(k, axis) >= node.center[axis]) octant |= 1 << axis;
        }
        return node.children[octant];
    }

    private static void query(Node node, Particles particles, int i, float cutoff, Touch touch) {
        for (int axis = 0; axis < 3; axis++) {
            // A margin for the rounding of centers.
            float wide = (node.half + cutoff) * 1.0001f + 1e-4f;
            if (Math.abs(particles.at(i, axis) - node.center[axis]) > wide) return;
        }
        if (node.children != null) {
            for (Node child : node.children) query(child, particles, i, cutoff, touch);
            return;
        }
        for (int k = 0; k < node.count; k++) meet(particles, i, node.particles[k], touch);
        for (int j : node.overflow) meet(particles, i, j, touch);
    }

    private static void meet(Particles particles, int i, int j, Touch touch) {
        if (i < j && particles.touch(i, j)) touch.meet(i, j);
    }
}
