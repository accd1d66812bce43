package io.github.lazygrid;

/** The failure of a call. The message names the value, the limit and the remedy. */
public class LazygridException extends RuntimeException {
    private static final long serialVersionUID = 1;

    /** The status of the call. */
    private final Status status;

    /**
     * Creates an exception.
     *
     * @param status the status of the call
     * @param message the reason
     */
    public LazygridException(Status status, String message) {
        super(message);
        this.status = status;
    }

    /**
     * Returns the status of the call.
     *
     * @return the status, never {@link Status#OK}
     */
    public Status status() {
        return status;
    }
}
