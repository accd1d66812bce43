package io.github.lazygrid;

import java.nio.ByteBuffer;
import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import java.nio.LongBuffer;

/** Read-only buffers over results in a detector's memory, of less than 2 GiB each. */
final class ResultBuffers {
    private ResultBuffers() {}

    static long number(long address) {
        return bytes(address, 1, Long.BYTES).asLongBuffer().get();
    }

    static LongBuffer offsets(long address, Query query) {
        return bytes(address, query.lists() + 1L, Long.BYTES).asLongBuffer().asReadOnlyBuffer();
    }

    static IntBuffer integers(long address, long count) {
        return bytes(address, count, Integer.BYTES).asIntBuffer().asReadOnlyBuffer();
    }

    static DoubleBuffer doubles(long address, long count) {
        return bytes(address, count, Double.BYTES).asDoubleBuffer().asReadOnlyBuffer();
    }

    /** Returns {@code count} values of {@code size} bytes. */
    private static ByteBuffer bytes(long address, long count, int size) {
        if (count > Integer.MAX_VALUE / size) throw tooLarge(count);
        return NativeApi.view(address, (int) count * size);
    }

    private static LazygridException tooLarge(long count) {
        return new LazygridException(
            Status.DEVICE_LIMIT, count + " numbers are more than a buffer of 2 GiB holds; stream the pairs, or count them");
    }
}
