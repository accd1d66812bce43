package io.github.lazygrid;

import java.lang.ref.Reference;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.charset.StandardCharsets;

/** Settings as {@code lazygrid_settings} on 64-bit machines. */
final class NativeSettings implements AutoCloseable {
    private static final int SIZE = 96;
    private static final int BACKEND = 8;
    private static final int ALGORITHM = 12;
    private static final int ORDER = 16;
    private static final int THREADS = 20;
    private static final int MAX_PAIRS = 24;
    private static final int PERIODIC = 32;
    private static final int TIMEOUT = 56;
    private static final int ADAPTER = 72;
    private static final int INTERACTIONS = 80;
    private static final int SKIN = 60;
    private static final int SKIN_DISTANCE = 64;
    private static final int CELL_VECTORS = 88;

    private final ByteBuffer structure = direct(SIZE);
    private final ByteBuffer adapter;
    private final ByteBuffer cellVectors;
    private final long interactions;

    /** Throws {@link LazygridException} for a refused table. */
    NativeSettings(Settings settings) {
        Detector.check(NativeApi.settingsInit(address(), SIZE), 0);
        structure.putInt(BACKEND, settings.backend.ordinal());
        structure.putInt(ALGORITHM, settings.algorithm.ordinal());
        structure.putInt(ORDER, settings.order.ordinal());
        structure.putInt(THREADS, settings.threads);
        structure.putLong(MAX_PAIRS, settings.maxPairs);
        for (int axis = 0; axis < 3; axis++) {
            structure.putDouble(PERIODIC + Double.BYTES * axis, settings.periodic[axis]);
        }
        structure.putInt(TIMEOUT, settings.timeoutSeconds);
        structure.putInt(SKIN, settings.skin.kind().ordinal());
        structure.putDouble(SKIN_DISTANCE, settings.skin.distance());
        cellVectors = settings.cellVectors == null ? null : direct(9 * Double.BYTES);
        if (cellVectors != null) {
            for (int k = 0; k < 9; k++) cellVectors.putDouble(Double.BYTES * k, settings.cellVectors[k / 3][k % 3]);
            structure.putLong(CELL_VECTORS, NativeApi.address(cellVectors, 1));
        }
        adapter = settings.adapter == null ? null : text(settings.adapter);
        if (adapter != null) structure.putLong(ADAPTER, NativeApi.address(adapter, 1));
        interactions = settings.interactions == null ? 0 : table(settings.interactions);
        structure.putLong(INTERACTIONS, interactions);
    }

    /** The structure's address, until this is closed. */
    long address() {
        return NativeApi.address(structure, 1);
    }

    @Override
    public void close() {
        if (interactions != 0) NativeApi.interactionsDestroy(interactions);
        Reference.reachabilityFence(adapter);
        Reference.reachabilityFence(cellVectors);
        Reference.reachabilityFence(structure);
    }

    private static long table(Interactions interactions) {
        ByteBuffer out = direct(Long.BYTES);
        Interaction all = interactions.all();
        int species = interactions.species();
        Detector.check(
            NativeApi.interactionsCreate(species, all.kind().ordinal(), all.distance(), NativeApi.address(out, 1)), 0);
        long table = out.getLong(0);
        try {
            for (Interactions.Entry entry : interactions.entries()) {
                Interaction set = entry.interaction();
                int kind = set.kind().ordinal();
                Detector.check(NativeApi.interactionsSet(table, entry.a(), entry.b(), kind, set.distance()), 0);
            }
        } catch (LazygridException refused) {
            NativeApi.interactionsDestroy(table);
            throw refused;
        }
        return table;
    }

    private static ByteBuffer text(String text) {
        byte[] bytes = text.getBytes(StandardCharsets.UTF_8);
        return direct(bytes.length + 1).put(0, bytes);
    }

    private static ByteBuffer direct(int bytes) {
        return ByteBuffer.allocateDirect(bytes).order(ByteOrder.nativeOrder());
    }
}
