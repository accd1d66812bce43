package io.github.lazygrid;

/** Why a call gave no result. The message names the value, the limit and the remedy. */
public class LazygridException extends RuntimeException {
    private static final long serialVersionUID = 1;

    /** What became of the call. */
    private final Status status;

    /**
     * An exception with a message.
     *
     * @param status what became of the call
     * @param message why
     */
    public LazygridException(Status status, String message) {
        super(message);
        this.status = status;
    }

    /**
     * What became of the call.
     *
     * @return the status, never {@link Status#OK}
     */
    public Status status() {
        return status;
    }
}
