package io.github.lazygrid;

import static java.lang.foreign.ValueLayout.JAVA_DOUBLE;
import static java.lang.foreign.ValueLayout.JAVA_INT;
import static java.lang.foreign.ValueLayout.JAVA_LONG;

import java.lang.foreign.Arena;
import java.lang.foreign.FunctionDescriptor;
import java.lang.foreign.Linker;
import java.lang.foreign.MemoryLayout;
import java.lang.foreign.MemorySegment;
import java.lang.foreign.SymbolLookup;
import java.lang.invoke.MethodHandle;
import java.lang.invoke.MethodHandles;
import java.lang.invoke.MethodType;
import java.nio.Buffer;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;

/**
 * The functions of {@code lazygrid.h}, called through {@code java.lang.foreign}. Java 22 and later use this class
 * instead of the JNA class. Pointers are numbers, which 64-bit machines pass alike.
 */
final class NativeApi {
    /** Receives the address and the number of pairs; returns 0 to continue. Must not throw. */
    interface Consumer {
        int take(long pairs, long count);
    }

    private static final Linker LINKER = Linker.nativeLinker();
    private static final SymbolLookup SYMBOLS = SymbolLookup.libraryLookup(NativeLoader.LOCATION, Arena.global());

    private static final MethodHandle VERSION = function("version", JAVA_LONG);
    private static final MethodHandle LAST_ERROR = function("last_error", JAVA_LONG, JAVA_LONG);
    private static final MethodHandle SETTINGS_INIT = function("settings_init", JAVA_INT, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle INTERACTIONS_CREATE =
        function("interactions_create", JAVA_INT, JAVA_INT, JAVA_INT, JAVA_DOUBLE, JAVA_LONG);
    private static final MethodHandle INTERACTIONS_SET =
        function("interactions_set", JAVA_INT, JAVA_LONG, JAVA_INT, JAVA_INT, JAVA_INT, JAVA_DOUBLE);
    private static final MethodHandle INTERACTIONS_DESTROY = function("interactions_destroy", null, JAVA_LONG);
    private static final MethodHandle EXCLUSIONS_CREATE =
        function("exclusions_create", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle EXCLUSIONS_ACROSS =
        function("exclusions_across", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle EXCLUSIONS_FROM_CSR =
        function("exclusions_from_csr", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle EXCLUSIONS_DESTROY = function("exclusions_destroy", null, JAVA_LONG);
    private static final MethodHandle CREATE = function("create", JAVA_INT, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle DESTROY = function("destroy", JAVA_INT, JAVA_LONG);
    private static final MethodHandle PAIRS =
        function("pairs", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle COUNT = function("count", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle NEIGHBORS =
        function("neighbors", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle STREAM =
        function("stream", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle NEIGHBOR_LIST =
        function("neighbor_list", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_INT, JAVA_LONG);
    private static final MethodHandle REPORT_JSON = function("report_json", JAVA_INT, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle MEMORY_FOR =
        function("memory_for", JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG);

    /** The callback for a chunk: context, pairs and their number. */
    private static final FunctionDescriptor PAIR_CALLBACK =
        FunctionDescriptor.of(JAVA_INT, JAVA_LONG, JAVA_LONG, JAVA_LONG);
    private static final MethodHandle TAKE;

    static {
        try {
            MethodType type = MethodType.methodType(int.class, Consumer.class, long.class, long.class, long.class);
            TAKE = MethodHandles.lookup().findStatic(NativeApi.class, "take", type);
        } catch (ReflectiveOperationException impossible) {
            throw new ExceptionInInitializerError(impossible);
        }
    }

    private NativeApi() {}

    /** The method by which the library is called. */
    static String callMethod() {
        return "java.lang.foreign";
    }

    private static MethodHandle function(String name, MemoryLayout result, MemoryLayout... arguments) {
        FunctionDescriptor type =
            result == null ? FunctionDescriptor.ofVoid(arguments) : FunctionDescriptor.of(result, arguments);
        MemorySegment symbol = SYMBOLS.find("lazygrid_" + name).orElseThrow(
            () -> new UnsatisfiedLinkError(NativeLoader.LOCATION + " has no function lazygrid_" + name));
        return LINKER.downcallHandle(symbol, type);
    }

    private static int take(Consumer consumer, long context, long pairs, long count) {
        return consumer.take(pairs, count);
    }

    /** The address of the position of a direct buffer; {@code size} is unused. */
    static long address(Buffer buffer, int size) {
        return MemorySegment.ofBuffer(buffer).address();
    }

    /** Throws an {@link IllegalStateException} if the arena of a direct buffer was closed. */
    static void requireAlive(Buffer buffer) {
        if (!MemorySegment.ofBuffer(buffer).scope().isAlive()) {
            throw new IllegalStateException("the arena of a buffer of these spheres was closed");
        }
    }

    /** Memory of the library as a buffer, in native order. */
    static ByteBuffer view(long address, int bytes) {
        return MemorySegment.ofAddress(address).reinterpret(bytes).asByteBuffer().order(ByteOrder.nativeOrder());
    }

    /** The UTF-8 text at an address. */
    static String text(long address) {
        return MemorySegment.ofAddress(address).reinterpret(Long.MAX_VALUE).getString(0);
    }

    /** The functions of C throw nothing, so an exception of a handle is a fault of this class. */
    private static AssertionError fault(Throwable thrown) {
        return new AssertionError("a call of lazygrid failed", thrown);
    }

    static String version() {
        try {
            return text((long) VERSION.invokeExact());
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static String lastError(long detector) {
        try {
            return text((long) LAST_ERROR.invokeExact(detector));
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int settingsInit(long settings, long size) {
        try {
            return (int) SETTINGS_INIT.invokeExact(settings, size);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int interactionsCreate(int species, int kind, double distance, long interactions) {
        try {
            return (int) INTERACTIONS_CREATE.invokeExact(species, kind, distance, interactions);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int interactionsSet(long interactions, int a, int b, int kind, double distance) {
        try {
            return (int) INTERACTIONS_SET.invokeExact(interactions, a, b, kind, distance);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static void interactionsDestroy(long interactions) {
        try {
            INTERACTIONS_DESTROY.invokeExact(interactions);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int exclusionsCreate(long spheres, long pairs, long count, long exclusions) {
        try {
            return (int) EXCLUSIONS_CREATE.invokeExact(spheres, pairs, count, exclusions);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int exclusionsAcross(long first, long second, long pairs, long count, long exclusions) {
        try {
            return (int) EXCLUSIONS_ACROSS.invokeExact(first, second, pairs, count, exclusions);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int exclusionsFromCsr(long spheres, long offsets, long indices, long exclusions) {
        try {
            return (int) EXCLUSIONS_FROM_CSR.invokeExact(spheres, offsets, indices, exclusions);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static void exclusionsDestroy(long exclusions) {
        try {
            EXCLUSIONS_DESTROY.invokeExact(exclusions);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int create(long settings, long detector) {
        try {
            return (int) CREATE.invokeExact(settings, detector);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int destroy(long detector) {
        try {
            return (int) DESTROY.invokeExact(detector);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int pairs(long detector, long query, long pairs, long count) {
        try {
            return (int) PAIRS.invokeExact(detector, query, pairs, count);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int count(long detector, long query, long count) {
        try {
            return (int) COUNT.invokeExact(detector, query, count);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int neighbors(long detector, long query, long offsets, long indices) {
        try {
            return (int) NEIGHBORS.invokeExact(detector, query, offsets, indices);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int stream(long detector, long query, long chunk, Consumer consumer, long delivered) {
        // Closed when C has returned, and with it all threads that call.
        try (Arena arena = Arena.ofConfined()) {
            return (int) STREAM.invokeExact(detector, query, chunk, stub(consumer, arena), 0L, delivered);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int neighborList(long detector, long query, int options, long list) {
        try {
            return (int) NEIGHBOR_LIST.invokeExact(detector, query, options, list);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    /** The address of a C function that calls the consumer, until the arena is closed. */
    private static long stub(Consumer consumer, Arena arena) {
        return LINKER.upcallStub(TAKE.bindTo(consumer), PAIR_CALLBACK, arena).address();
    }

    static int reportJson(long detector, long json) {
        try {
            return (int) REPORT_JSON.invokeExact(detector, json);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }

    static int memoryFor(long detector, long spheres, long bytes) {
        try {
            return (int) MEMORY_FOR.invokeExact(detector, spheres, bytes);
        } catch (Throwable thrown) {
            throw fault(thrown);
        }
    }
}
