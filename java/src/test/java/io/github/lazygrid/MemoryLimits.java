package io.github.lazygrid;

import static io.github.lazygrid.ContractTest.check;
import static io.github.lazygrid.ContractTest.line;
import static io.github.lazygrid.ContractTest.onCpu;

import java.io.IOException;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;
import java.nio.IntBuffer;
import java.nio.LongBuffer;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Set;

/**
 * Under any limit of the address space that the JVM survives, calls succeed or throw, and never end the process. The
 * limit begins at what the JVM has mapped after a first round of calls, because a JVM that is refused memory of its own
 * ends the process by itself. It does so least with {@code -Xint -XX:+UseSerialGC}. Needs Linux and {@code prlimit}.
 */
public final class MemoryLimits {
    private static final int COUNT = 200_000;
    private static final int SPECIES = 4096;
    private static final int LIMITS = 8;
    /** For messages and exceptions of the JVM. */
    private static final long LEAST = 4L << 20;
    private static final int EXPECTED = COUNT / 2 - 1;

    private static int refused;
    private static long streamed;

    private MemoryLimits() {}

    /** Returns true if the call succeeded. */
    private static boolean succeeds(Runnable call) {
        try {
            call.run();
            return true;
        } catch (LazygridException error) {
            check(error.status() == Status.OUT_OF_MEMORY || error.status() == Status.THREADS, "refused: " + error);
        } catch (OutOfMemoryError error) {
            // A buffer of Java itself.
        }
        refused++;
        return false;
    }

    /** Every second pair is excluded. */
    private static Exclusions exclusions() {
        LongBuffer offsets =
            ByteBuffer.allocateDirect(8 * (COUNT + 1)).order(ByteOrder.nativeOrder()).asLongBuffer();
        IntBuffer indices = Spheres.allocateInts(COUNT / 2);
        for (int k = 0; k < COUNT; k++) {
            offsets.put(k + 1, offsets.get(k) + (k % 2 == 0 ? 1 : 0));
            if (k % 2 == 0) indices.put((int) offsets.get(k), k + 1);
        }
        return Exclusions.fromCsr(offsets, indices);
    }

    private static void search(Settings settings, Query query) {
        try (Detector detector = new Detector(settings)) {
            succeeds(() -> check(detector.pairs(query).remaining() == 2 * EXPECTED, "pairs"));
            streamed = 0;
            succeeds(() -> {
                detector.stream(query, 1000, pairs -> {
                    streamed += pairs.remaining() / 2;
                    return true;
                });
                check(streamed == EXPECTED, "streamed pairs");
            });
            succeeds(() -> check(detector.neighbors(query).offsets().get(COUNT) == 2 * EXPECTED, "neighbors"));
            succeeds(() -> check(detector.neighborList(query, Set.of(ListOption.DISTANCES)).length() > 0, "list"));
        }
    }

    private static void allCalls(Spheres spheres, Spheres mixture, Exclusions exclusions) {
        succeeds(() -> search(onCpu().threads(2), Query.of(spheres).without(exclusions)));
        succeeds(() -> {
            Settings table = onCpu().threads(2).interactions(new Interactions(SPECIES, Interaction.TOUCH));
            search(table, Query.of(mixture).without(exclusions));
        });
        System.gc();
    }

    /** In bytes: {@code /proc/self/statm} counts pages, which are of 4 to 64 KiB. */
    private static long mapped() throws IOException {
        for (String line : Files.readAllLines(Path.of("/proc/self/status"))) {
            if (line.startsWith("VmSize:")) return Long.parseLong(line.replaceAll("[^0-9]", "")) << 10;
        }
        throw new IOException("/proc/self/status has no VmSize");
    }

    private static void limit(String bytes) throws IOException, InterruptedException {
        String pid = Long.toString(ProcessHandle.current().pid());
        Process set = new ProcessBuilder("prlimit", "--pid", pid, "--as=" + bytes + ":").inheritIO().start();
        check(set.waitFor() == 0, "prlimit " + bytes);
    }

    /**
     * Sweeps the limits.
     *
     * @param arguments none
     * @throws IOException without /proc or {@code prlimit}
     * @throws InterruptedException if interrupted
     */
    public static void main(String[] arguments) throws IOException, InterruptedException {
        FloatBuffer rows = line(COUNT);
        IntBuffer species = Spheres.allocateInts(COUNT);
        for (int k = 0; k < COUNT; k++) species.put(k, k % SPECIES);
        Spheres spheres = Spheres.rows(rows);
        Spheres mixture = spheres.withSpecies(species);
        Exclusions exclusions = exclusions();
        allCalls(spheres, mixture, exclusions);
        check(refused == 0, "calls without a limit");
        double more = LEAST;
        for (int k = 0; k < LIMITS; k++, more *= 2.5) {
            refused = 0;
            limit(Long.toString(mapped() + (long) more));
            allCalls(spheres, mixture, exclusions);
            if (k == 0) check(refused > 0, "the least limit refuses");
            if (k == LIMITS - 1) check(refused == 0, "the last limit refuses nothing, not " + refused + " calls");
            refused = 0;
            limit("unlimited");
            allCalls(spheres, mixture, exclusions);
            check(refused == 0, "calls after a limit of " + (long) more + " bytes more");
        }
        ContractTest.finish();
    }
}
