/** The simulator's interface to a spatial structure: the particles that touch. */
interface NeighborSearch extends AutoCloseable {
    /** Receives two particles that touch, {@code i < j}. */
    interface Touch {
        void meet(int i, int j);
    }

    /** Calls {@code touch} once for each two particles whose spheres touch or overlap. */
    void search(Particles particles, Touch touch);

    @Override
    default void close() {}
}
