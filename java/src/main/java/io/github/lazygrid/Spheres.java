package io.github.lazygrid;

import java.lang.ref.Reference;
import java.nio.Buffer;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.DoubleBuffer;
import java.nio.FloatBuffer;
import java.nio.IntBuffer;
import java.nio.LongBuffer;
import java.util.ArrayList;
import java.util.List;

/**
 * Spheres in direct buffers of the caller, in single or double precision, which each search reads and a simulation may
 * write between searches. No number is rounded. The values between position and limit at construction count.
 *
 * <p>Lengths have one unit, the caller's. A radius of 0 is a point. Searches read rows and columns of floats in place
 * and copy other layouts.
 */
public final class Spheres {
    /** The group number of spheres without a group. */
    public static final int NO_GROUP = -1;

    /** Size of {@code lazygrid_spheres} on 64-bit machines. */
    private static final int SIZE = 88;
    private static final int COUNT = 8;
    private static final int X = 16;
    private static final int STEP = 48;
    private static final int R_STEP = 56;
    private static final int PRECISION = 64;
    private static final int SPECIES = 72;
    private static final int GROUPS = 80;

    /** The type of numbers, in the order of {@code lazygrid.h}. */
    enum Precision {
        F32(Float.BYTES),
        F64(Double.BYTES);

        /** Bytes of a number. */
        final int size;

        Precision(int size) {
            this.size = size;
        }

        private static Precision of(Buffer numbers) {
            return numbers instanceof FloatBuffer ? F32 : F64;
        }
    }

    private final int count;
    /** The caller's buffers, retained while their addresses are in use. */
    private final List<Buffer> buffers;
    private final ByteBuffer structure = ByteBuffer.allocateDirect(SIZE).order(ByteOrder.nativeOrder());
    private final long address = NativeApi.address(structure, 1);

    /** Steps are in numbers. */
    private Spheres(int count, Precision precision, long[] xyzr, int step, int radiusStep, List<Buffer> buffers) {
        this.count = count;
        this.buffers = buffers;
        structure.putLong(0, SIZE).putLong(COUNT, count).putInt(PRECISION, precision.ordinal());
        for (int k = 0; k < 4; k++) structure.putLong(X + Long.BYTES * k, xyzr[k]);
        structure.putLong(STEP, (long) precision.size * step).putLong(R_STEP, (long) precision.size * radiusStep);
    }

    /** These spheres with a further buffer at an offset of the structure. */
    private Spheres(Spheres same, int offset, IntBuffer values) {
        count = same.count;
        structure.put(0, same.structure, 0, SIZE).putLong(offset, NativeApi.address(values, Integer.BYTES));
        buffers = new ArrayList<>(same.buffers);
        buffers.add(values);
    }

    /**
     * Creates spheres from rows in single precision.
     *
     * @param rows consecutive x, y, z and radius; direct, in native order
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or a number of values that 4 does not divide
     */
    public static Spheres rows(FloatBuffer rows) {
        return fromRows(rows);
    }

    /**
     * Creates spheres from rows in double precision.
     *
     * @param rows as {@link #rows(FloatBuffer)}
     * @return the spheres
     * @throws IllegalArgumentException as {@link #rows(FloatBuffer)}
     */
    public static Spheres rows(DoubleBuffer rows) {
        return fromRows(rows);
    }

    private static Spheres fromRows(Buffer source) {
        Buffer rows = interleaved(source, "rows", 4);
        Precision precision = Precision.of(rows);
        long x = NativeApi.address(rows, precision.size);
        long[] xyzr = {x, x + precision.size, x + 2L * precision.size, x + 3L * precision.size};
        return new Spheres(rows.remaining() / 4, precision, xyzr, 4, 4, List.of(rows));
    }

    /**
     * Creates spheres from columns of one length in single precision.
     *
     * @param x coordinates along x; direct, in native order, like the others
     * @param y along y
     * @param z along z
     * @param r radii
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or different lengths
     */
    public static Spheres columns(FloatBuffer x, FloatBuffer y, FloatBuffer z, FloatBuffer r) {
        return fromColumns(x, y, z, r);
    }

    /**
     * Creates spheres from columns of one length in double precision.
     *
     * @param x coordinates along x; direct, in native order, like the others
     * @param y along y
     * @param z along z
     * @param r radii
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or different lengths
     */
    public static Spheres columns(DoubleBuffer x, DoubleBuffer y, DoubleBuffer z, DoubleBuffer r) {
        return fromColumns(x, y, z, r);
    }

    private static Spheres fromColumns(Buffer... source) {
        Precision precision = Precision.of(source[0]);
        Buffer[] columns = new Buffer[4];
        long[] xyzr = new long[4];
        for (int k = 0; k < 4; k++) {
            String name = "xyzr".substring(k, k + 1);
            check(source[k], name);
            sameLength(name, source[k].remaining(), source[0].remaining());
            columns[k] = source[k].duplicate();
            xyzr[k] = NativeApi.address(columns[k], precision.size);
        }
        return new Spheres(source[0].remaining(), precision, xyzr, 1, 1, List.of(columns));
    }

    /**
     * Creates spheres of one radius in single precision. Half a cutoff as the radius finds the points within the
     * cutoff.
     *
     * @param centers consecutive x, y and z; direct, in native order
     * @param radius the radius of all
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or a number of values that 3 does not divide
     */
    public static Spheres points(FloatBuffer centers, float radius) {
        return fromPoints(centers, allocateFloats(1).put(0, radius));
    }

    /**
     * Creates spheres of one radius in double precision.
     *
     * @param centers as {@link #points(FloatBuffer, float)}
     * @param radius the radius of all
     * @return the spheres
     * @throws IllegalArgumentException as {@link #points(FloatBuffer, float)}
     */
    public static Spheres points(DoubleBuffer centers, double radius) {
        return fromPoints(centers, allocateDoubles(1).put(0, radius));
    }

    private static Spheres fromPoints(Buffer source, Buffer radius) {
        Buffer centers = interleaved(source, "centers", 3);
        Precision precision = Precision.of(centers);
        long x = NativeApi.address(centers, precision.size);
        long[] xyzr = {x, x + precision.size, x + 2L * precision.size, NativeApi.address(radius, precision.size)};
        return new Spheres(centers.remaining() / 3, precision, xyzr, 3, 0, List.of(centers, radius));
    }

    /** A duplicate of a buffer with {@code each} values per sphere. */
    private static Buffer interleaved(Buffer source, String name, int each) {
        check(source, name);
        if (source.remaining() % each != 0) {
            throw new IllegalArgumentException(
                name + " have " + source.remaining() + " values; give " + each + " for each sphere");
        }
        return source.duplicate();
    }

    /**
     * Returns these spheres with a species each.
     *
     * @param species an id per sphere; direct, in native order
     * @return the spheres, in the same buffers
     * @throws IllegalArgumentException for another kind of buffer, or another number of ids
     */
    public Spheres withSpecies(IntBuffer species) {
        return withOneEach(species, SPECIES, "species");
    }

    /**
     * Returns these spheres with a group each, such as a molecule or a rigid body: spheres of one group never pair,
     * except in {@link #NO_GROUP}. In two sets equal numbers are one group.
     *
     * @param groups a number per sphere, of 32 bits; direct, in native order
     * @return the spheres, in the same buffers
     * @throws IllegalArgumentException for another kind of buffer, or another number of groups
     */
    public Spheres withGroups(IntBuffer groups) {
        return withOneEach(groups, GROUPS, "groups");
    }

    private Spheres withOneEach(IntBuffer values, int offset, String name) {
        check(values, name);
        sameLength(name, values.remaining(), count);
        return new Spheres(this, offset, values.duplicate());
    }

    /**
     * Allocates a buffer for {@link #rows(FloatBuffer)}.
     *
     * @param length the number of values
     * @return the buffer, all zeros
     */
    public static FloatBuffer allocateFloats(int length) {
        return direct(length, Float.BYTES).asFloatBuffer();
    }

    /**
     * Allocates a buffer for {@link #rows(DoubleBuffer)}.
     *
     * @param length the number of values
     * @return the buffer, all zeros
     */
    public static DoubleBuffer allocateDoubles(int length) {
        return direct(length, Double.BYTES).asDoubleBuffer();
    }

    /**
     * Allocates a buffer for {@link #withSpecies} and {@link #withGroups}.
     *
     * @param length the number of values
     * @return the buffer, all zeros
     */
    public static IntBuffer allocateInts(int length) {
        return direct(length, Integer.BYTES).asIntBuffer();
    }

    /**
     * Returns the number of spheres.
     *
     * @return the number
     */
    public int count() {
        return count;
    }

    /** The address of a {@code lazygrid_spheres}, valid until this is {@linkplain #keep kept}. */
    long address() {
        buffers.forEach(NativeApi::requireAlive);
        return address;
    }

    /** Called after each use of the address, so that the memory of the structure is not freed before. */
    void keep() {
        Reference.reachabilityFence(structure);
        Reference.reachabilityFence(buffers);
    }

    private static ByteBuffer direct(int length, int size) {
        long bytes = (long) size * length;
        if (length < 0) throw new IllegalArgumentException(length + " values are less than 0");
        if (bytes > Integer.MAX_VALUE) {
            throw new IllegalArgumentException(length + " values do not fit a buffer of less than 2 GiB");
        }
        return ByteBuffer.allocateDirect((int) bytes).order(ByteOrder.nativeOrder());
    }

    static void check(Buffer buffer, String name) {
        if (!buffer.isDirect() || order(buffer) != ByteOrder.nativeOrder()) {
            throw new IllegalArgumentException(name + " must be a direct buffer in native order; "
                + "Spheres.allocateFloats, Spheres.allocateDoubles and Spheres.allocateInts make them");
        }
    }

    private static ByteOrder order(Buffer buffer) {
        if (buffer instanceof FloatBuffer floats) return floats.order();
        if (buffer instanceof DoubleBuffer doubles) return doubles.order();
        return buffer instanceof LongBuffer longs ? longs.order() : ((IntBuffer) buffer).order();
    }

    private static void sameLength(String name, int length, int expected) {
        if (length != expected) {
            throw new IllegalArgumentException(
                name + " has " + length + " values where " + expected + " are needed: one for each sphere");
        }
    }
}
