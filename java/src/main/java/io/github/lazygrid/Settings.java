package io.github.lazygrid;

import java.time.Duration;

/** The settings of a detector. The defaults suit almost all programs. Each method returns these settings. */
public final class Settings {
    Backend backend = Backend.AUTO;
    Algorithm algorithm = Algorithm.AUTO;
    Order order = Order.CANONICAL;
    int threads;
    long maxPairs;
    double[] periodic = new double[3];
    double[][] cellVectors;
    int timeoutSeconds;
    String adapter;
    Interactions interactions;
    Skin skin = Skin.AUTO;

    /** The defaults. */
    public Settings() {}

    /**
     * Sets the backend.
     *
     * @param backend by default {@link Backend#AUTO}
     * @return these settings
     */
    public Settings backend(Backend backend) {
        this.backend = backend;
        return this;
    }

    /**
     * Sets the algorithm.
     *
     * @param algorithm by default {@link Algorithm#AUTO}
     * @return these settings
     */
    public Settings algorithm(Algorithm algorithm) {
        this.algorithm = algorithm;
        return this;
    }

    /**
     * Sets the order of pairs.
     *
     * @param order by default {@link Order#CANONICAL}
     * @return these settings
     */
    public Settings order(Order order) {
        this.order = order;
        return this;
    }

    /**
     * Sets the number of CPU threads.
     *
     * @param threads 0, the default: all, shared by all detectors
     * @return these settings
     */
    public Settings threads(int threads) {
        if (threads < 0) throw new IllegalArgumentException(threads + " threads are less than 0");
        this.threads = threads;
        return this;
    }

    /**
     * Sets the maximum number of pairs in a list, 8 bytes each. Counts and streams have no limit.
     *
     * @param maxPairs 0, the default: 2<sup>29</sup>
     * @return these settings
     */
    public Settings maxPairs(long maxPairs) {
        if (maxPairs < 0) throw new IllegalArgumentException(maxPairs + " pairs are less than 0");
        this.maxPairs = maxPairs;
        return this;
    }

    /**
     * Sets the length of each periodic axis, in the unit of the spheres.
     *
     * @param x along x; 0: unbounded
     * @param y along y; 0: unbounded
     * @param z along z; 0: unbounded
     * @return these settings
     */
    public Settings periodic(double x, double y, double z) {
        this.periodic = new double[] {x, y, z};
        return this;
    }

    /**
     * Sets up to three cell vectors, in place of {@link #periodic}: x, y and z of each, in the unit of the spheres.
     *
     * @param a a cell vector; null: none
     * @param b a cell vector; null: none
     * @param c a cell vector; null: none
     * @return these settings
     * @throws IllegalArgumentException for a vector without exactly three components
     */
    public Settings cellVectors(double[] a, double[] b, double[] c) {
        double[][] vectors = {a, b, c};
        for (int k = 0; k < 3; k++) {
            vectors[k] = vectors[k] == null ? new double[3] : vectors[k].clone();
            if (vectors[k].length != 3) {
                throw new IllegalArgumentException(
                    "a cell vector has " + vectors[k].length + " components; give x, y and z");
            }
        }
        this.cellVectors = vectors;
        return this;
    }

    /**
     * Sets the time limit of each submission to the GPU. A call that is split or repeated has several. Searches on the
     * CPU have no limit: {@link Backend#CPU} refuses one, and with {@link Backend#AUTO} it is unused if no GPU is found.
     *
     * @param timeout above zero, rounded up to whole seconds; by default ten minutes
     * @return these settings
     * @throws IllegalArgumentException for a time that is not above zero, or beyond 2<sup>31</sup> seconds
     */
    public Settings timeout(Duration timeout) {
        long seconds = timeout.toSeconds() + (timeout.getNano() > 0 ? 1 : 0);
        if (seconds < 1 || seconds > Integer.MAX_VALUE) {
            throw new IllegalArgumentException(
                "a timeout of " + timeout + " is out of range; give a time above zero and below 2^31 seconds");
        }
        this.timeoutSeconds = (int) seconds;
        return this;
    }

    /**
     * Sets the GPU.
     *
     * @param adapter its number, or a part of its name that no other has; null, the default: the best one
     * @return these settings
     * @throws IllegalArgumentException for a name with a zero character, which would end it
     */
    public Settings adapter(String adapter) {
        if (adapter != null && adapter.indexOf('\0') >= 0) {
            throw new IllegalArgumentException("the name of an adapter has a zero character; leave it out");
        }
        this.adapter = adapter;
        return this;
    }

    /**
     * Sets the species that pair, and their distances. Spheres must then carry species.
     *
     * @param interactions the table, read by the constructor of a detector; null, the default: all touching spheres
     *     pair
     * @return these settings
     */
    public Settings interactions(Interactions interactions) {
        this.interactions = interactions;
        return this;
    }

    /**
     * Sets the skin of the candidate list kept between calls. Results never depend on it.
     *
     * @param skin by default {@link Skin#AUTO}
     * @return these settings
     */
    public Settings skin(Skin skin) {
        this.skin = skin;
        return this;
    }
}
