/** What the simulator asks of a structure of space: which particles touch which. */
interface NeighborSearch extends AutoCloseable {
    /** What is done with two particles that touch, {@code i < j}. */
    interface Touch {
        void meet(int i, int j);
    }

    /** Calls {@code touch} once for each two particles whose spheres touch or overlap. */
    void search(Particles particles, Touch touch);

    @Override
    default void close() {}
}
