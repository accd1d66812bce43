package io.github.lazygrid;

import java.lang.ref.Reference;
import java.nio.Buffer;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.FloatBuffer;
import java.nio.IntBuffer;
import java.util.ArrayList;
import java.util.List;

/**
 * Spheres in direct buffers of the caller, which are read at each search and never copied. Made once, it serves every
 * step of a simulation that writes to the same buffers. What counts is what lies between position and limit when it is
 * made.
 *
 * <p>Lengths are in one unit, the caller's. A radius of 0 is a point.
 */
public final class Spheres {
    /** Size of {@code lazygrid_spheres} on 64-bit machines. */
    private static final int SIZE = 56;
    private static final int SPECIES = 48;

    private final int count;
    /** The buffers, so that they live as long as their addresses are known. */
    private final List<Buffer> buffers;
    private final ByteBuffer structure = ByteBuffer.allocateDirect(SIZE).order(ByteOrder.nativeOrder());

    private Spheres(int count, int first, List<FloatBuffer> values, IntBuffer species) {
        this.count = count;
        structure.putLong(0, count);
        for (int k = 0; k < values.size(); k++) {
            structure.putLong(8 * (first + k), Library.address(values.get(k), Float.BYTES));
        }
        if (species != null) structure.putLong(SPECIES, Library.address(species, Integer.BYTES));
        buffers = new ArrayList<>(values);
        if (species != null) buffers.add(species);
    }

    /**
     * Spheres as rows.
     *
     * @param rows x, y, z and radius of each, one after the other; direct, in native order
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or a number of values that 4 does not divide
     */
    public static Spheres rows(FloatBuffer rows) {
        check(rows, "rows");
        if (rows.remaining() % 4 != 0) {
            throw new IllegalArgumentException("rows have " + rows.remaining() + " values; give 4 for each sphere");
        }
        return new Spheres(rows.remaining() / 4, 1, List.of(rows.duplicate()), null);
    }

    /**
     * Spheres as columns of one length.
     *
     * @param x coordinates of centres along x; direct, in native order, like the others
     * @param y along y
     * @param z along z
     * @param r radii
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or lengths that differ
     */
    public static Spheres columns(FloatBuffer x, FloatBuffer y, FloatBuffer z, FloatBuffer r) {
        List<FloatBuffer> columns = List.of(x.duplicate(), y.duplicate(), z.duplicate(), r.duplicate());
        for (int k = 0; k < 4; k++) {
            String name = "xyzr".substring(k, k + 1);
            check(columns.get(k), name);
            sameLength(name, columns.get(k).remaining(), x.remaining());
        }
        return new Spheres(x.remaining(), 2, columns, null);
    }

    /**
     * The same spheres with a species each.
     *
     * @param species an id for each sphere; direct, in native order
     * @return the spheres, in the same buffers
     * @throws IllegalArgumentException for another kind of buffer, or another number of ids
     */
    public Spheres withSpecies(IntBuffer species) {
        check(species, "species");
        sameLength("species", species.remaining(), count);
        List<FloatBuffer> values =
            buffers.stream().filter(FloatBuffer.class::isInstance).map(FloatBuffer.class::cast).toList();
        return new Spheres(count, values.size() == 1 ? 1 : 2, values, species.duplicate());
    }

    /**
     * A direct buffer as {@link #rows} and {@link #columns} take them.
     *
     * @param length how many values it has
     * @return the buffer, all zeros
     */
    public static FloatBuffer floats(int length) {
        return direct(length).asFloatBuffer();
    }

    /**
     * A direct buffer as {@link #withSpecies} takes them.
     *
     * @param length how many values it has
     * @return the buffer, all zeros
     */
    public static IntBuffer ints(int length) {
        return direct(length).asIntBuffer();
    }

    /**
     * How many spheres there are.
     *
     * @return the number
     */
    public int count() {
        return count;
    }

    /** The address of a {@code lazygrid_spheres}, for as long as this is {@linkplain #keep kept}. */
    long address() {
        return Library.address(structure, 1);
    }

    /** Called behind each use of the address, so that no buffer is freed before. */
    void keep() {
        Reference.reachabilityFence(structure);
        Reference.reachabilityFence(buffers);
    }

    private static ByteBuffer direct(int length) {
        long bytes = 4L * length;
        if (bytes < 0 || bytes > Integer.MAX_VALUE) {
            throw new IllegalArgumentException(length + " values do not fit a buffer of less than 2 GiB");
        }
        return ByteBuffer.allocateDirect((int) bytes).order(ByteOrder.nativeOrder());
    }

    private static void check(Buffer buffer, String name) {
        ByteOrder order = buffer instanceof FloatBuffer floats ? floats.order() : ((IntBuffer) buffer).order();
        if (!buffer.isDirect() || order != ByteOrder.nativeOrder()) {
            throw new IllegalArgumentException(
                name + " must be a direct buffer in native order; Spheres.floats and Spheres.ints make them");
        }
    }

    private static void sameLength(String name, int length, int expected) {
        if (length != expected) {
            throw new IllegalArgumentException(
                name + " has " + length + " values where " + expected + " are needed: one for each sphere");
        }
    }
}
