package io.github.lazygrid;

/** A list would hold more pairs than {@link Settings#maxPairs(long)}. */
public final class TooManyPairsException extends LazygridException {
    private static final long serialVersionUID = 1;

    /** The exact number of pairs. */
    private final long found;

    TooManyPairsException(String message, long found) {
        super(Status.TOO_MANY_PAIRS, message);
        this.found = found;
    }

    /**
     * Returns the exact number of pairs.
     *
     * @return the number
     */
    public long found() {
        return found;
    }
}
