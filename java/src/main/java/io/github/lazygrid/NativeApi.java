package io.github.lazygrid;

import com.sun.jna.Callback;
import com.sun.jna.Native;
import com.sun.jna.NativeLibrary;
import com.sun.jna.Pointer;
import java.lang.ref.Reference;
import java.nio.Buffer;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;

/**
 * The functions of {@code lazygrid.h}, called through JNA. Java 22 and later use another class of this name. Pointers
 * are numbers, which 64-bit machines pass alike.
 */
final class NativeApi {
    /** Receives the address and the number of pairs; returns 0 to continue. Must not throw. */
    interface Consumer {
        int take(long pairs, long count);
    }

    /** The callback in C. */
    interface PairCallback extends Callback {
        int take(Pointer context, Pointer pairs, long count);
    }

    /** For views without values, which need no address. */
    private static final ByteBuffer EMPTY = ByteBuffer.allocateDirect(0);

    private NativeApi() {}

    /** The method by which the library is called. */
    static String callMethod() {
        return "JNA";
    }

    /** The functions themselves; separate, so that {@link #ensureJna} runs first. */
    private static final class Functions {
        static {
            Native.register(Functions.class, NativeLibrary.getInstance(NativeLoader.LOCATION));
        }

        static native long lazygrid_version();

        static native long lazygrid_last_error(long detector);

        static native int lazygrid_settings_init(long settings, long size);

        static native int lazygrid_interactions_create(int species, int kind, double distance, long interactions);

        static native int lazygrid_interactions_set(long interactions, int a, int b, int kind, double distance);

        static native void lazygrid_interactions_destroy(long interactions);

        static native int lazygrid_exclusions_create(long spheres, long pairs, long count, long exclusions);

        static native int lazygrid_exclusions_across(
            long first, long second, long pairs, long count, long exclusions);

        static native int lazygrid_exclusions_from_csr(long spheres, long offsets, long indices, long exclusions);

        static native void lazygrid_exclusions_destroy(long exclusions);

        static native int lazygrid_create(long settings, long detector);

        static native int lazygrid_destroy(long detector);

        static native int lazygrid_pairs(long detector, long query, long pairs, long count);

        static native int lazygrid_count(long detector, long query, long count);

        static native int lazygrid_neighbors(long detector, long query, long offsets, long indices);

        static native int lazygrid_stream(
            long detector, long query, long chunk, PairCallback consume, long context, long delivered);

        static native int lazygrid_neighbor_list(long detector, long query, int options, long list);

        static native int lazygrid_report_json(long detector, long json);

        static native int lazygrid_memory_for(long detector, long spheres, long bytes);
    }

    static {
        ensureJna();
    }

    /** Names the remedy if JNA is missing; otherwise the error would be a missing class. */
    private static void ensureJna() {
        try {
            Class.forName("com.sun.jna.Native");
        } catch (ClassNotFoundException | LinkageError missing) {
            throw new UnsatisfiedLinkError(
                "before Java 22 lazygrid needs JNA 5 on the class path (net.java.dev.jna:jna): " + missing);
        }
    }

    /** The address of the position of a direct buffer of values of {@code size} bytes. */
    static long address(Buffer buffer, int size) {
        if (buffer.capacity() == 0) return 0;
        return Pointer.nativeValue(Native.getDirectBufferPointer(buffer)) + (long) buffer.position() * size;
    }

    /** Does nothing: JNA serves versions of Java without arenas. */
    static void requireAlive(Buffer buffer) {}

    /** Memory of the library as a buffer, in native order. */
    static ByteBuffer view(long address, int bytes) {
        if (bytes == 0) return EMPTY.duplicate().order(ByteOrder.nativeOrder());
        return new Pointer(address).getByteBuffer(0, bytes).order(ByteOrder.nativeOrder());
    }

    /** The UTF-8 text at an address. */
    static String text(long address) {
        return new Pointer(address).getString(0, "UTF-8");
    }

    static String version() {
        return text(Functions.lazygrid_version());
    }

    static String lastError(long detector) {
        return text(Functions.lazygrid_last_error(detector));
    }

    static int settingsInit(long settings, long size) {
        return Functions.lazygrid_settings_init(settings, size);
    }

    static int interactionsCreate(int species, int kind, double distance, long interactions) {
        return Functions.lazygrid_interactions_create(species, kind, distance, interactions);
    }

    static int interactionsSet(long interactions, int a, int b, int kind, double distance) {
        return Functions.lazygrid_interactions_set(interactions, a, b, kind, distance);
    }

    static void interactionsDestroy(long interactions) {
        Functions.lazygrid_interactions_destroy(interactions);
    }

    static int exclusionsCreate(long spheres, long pairs, long count, long exclusions) {
        return Functions.lazygrid_exclusions_create(spheres, pairs, count, exclusions);
    }

    static int exclusionsAcross(long first, long second, long pairs, long count, long exclusions) {
        return Functions.lazygrid_exclusions_across(first, second, pairs, count, exclusions);
    }

    static int exclusionsFromCsr(long spheres, long offsets, long indices, long exclusions) {
        return Functions.lazygrid_exclusions_from_csr(spheres, offsets, indices, exclusions);
    }

    static void exclusionsDestroy(long exclusions) {
        Functions.lazygrid_exclusions_destroy(exclusions);
    }

    static int create(long settings, long detector) {
        return Functions.lazygrid_create(settings, detector);
    }

    static int destroy(long detector) {
        return Functions.lazygrid_destroy(detector);
    }

    static int pairs(long detector, long query, long pairs, long count) {
        return Functions.lazygrid_pairs(detector, query, pairs, count);
    }

    static int count(long detector, long query, long count) {
        return Functions.lazygrid_count(detector, query, count);
    }

    static int neighbors(long detector, long query, long offsets, long indices) {
        return Functions.lazygrid_neighbors(detector, query, offsets, indices);
    }

    static int stream(long detector, long query, long chunk, Consumer consumer, long delivered) {
        PairCallback consume = consume(consumer);
        int status = Functions.lazygrid_stream(detector, query, chunk, consume, 0, delivered);
        Reference.reachabilityFence(consume);
        return status;
    }

    static int neighborList(long detector, long query, int options, long list) {
        return Functions.lazygrid_neighbor_list(detector, query, options, list);
    }

    private static PairCallback consume(Consumer consumer) {
        return (context, pairs, count) -> consumer.take(Pointer.nativeValue(pairs), count);
    }

    static int reportJson(long detector, long json) {
        return Functions.lazygrid_report_json(detector, json);
    }

    static int memoryFor(long detector, long spheres, long bytes) {
        return Functions.lazygrid_memory_for(detector, spheres, bytes);
    }
}
