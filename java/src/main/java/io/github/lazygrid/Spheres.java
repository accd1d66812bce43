package io.github.lazygrid;

import java.nio.Buffer;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.DoubleBuffer;
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
    /** The group of spheres that are in none. */
    public static final int NO_GROUP = -1;

    /** Layout of {@code lazygrid_spheres} on 64-bit machines. */
    private static final int SIZE = 88;
    private static final int COUNT = 8;
    private static final int X = 16;
    private static final int Y = 24;
    private static final int Z = 32;
    private static final int R = 40;
    private static final int STEP = 48;
    private static final int R_STEP = 56;
    private static final int TYPE = 64;
    private static final int SPECIES = 72;
    private static final int GROUPS = 80;
    /** Values of the type. */
    private static final int F32 = 0;
    private static final int F64 = 1;

    private final int count;
    /** Buffers that live as long as their addresses are known. */
    private final List<Buffer> kept;
    private final ByteBuffer structure = ByteBuffer.allocateDirect(SIZE).order(ByteOrder.nativeOrder());
    private final long address = Library.address(structure, 1);
    private final Query query;

    /** Spheres of four columns of one type, of which the first three have one step. */
    private Spheres(int count, Column x, Column y, Column z, Column r) {
        this.count = count;
        structure.putLong(0, SIZE).putLong(COUNT, count);
        structure.putLong(X, x.address()).putLong(Y, y.address()).putLong(Z, z.address()).putLong(R, r.address());
        structure.putLong(STEP, x.step()).putLong(R_STEP, r.step());
        structure.putInt(TYPE, x.values instanceof DoubleBuffer ? F64 : F32);
        kept = List.of(x.values, y.values, z.values, r.values);
        query = new Query(this, null, null);
    }

    /** The same spheres with other values in one place of the structure. */
    private Spheres(Spheres same, int place, IntBuffer values) {
        count = same.count;
        structure.put(0, same.structure, 0, SIZE).putLong(place, Library.address(values, Integer.BYTES));
        List<Buffer> all = new ArrayList<>(same.kept);
        all.add(values);
        kept = List.copyOf(all);
        query = new Query(this, null, null);
    }

    /**
     * Numbers of spheres: every {@code stride}-th value of a buffer, beginning {@code first} values after its position.
     *
     * @param values the buffer, of floats or doubles
     * @param first the first value
     * @param stride the number of values from one sphere to the next; 0: one value for all
     */
    private record Column(Buffer values, int first, int stride) {
        long address() {
            long at = Library.address(values, size(values));
            return at == 0 ? 0 : at + (long) first * size(values);
        }

        long step() {
            return (long) stride * size(values);
        }
    }

    /**
     * Spheres as rows.
     *
     * @param rows x, y, z and radius of each, one after the other; direct, in native order
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or a number of values that 4 does not divide
     */
    public static Spheres rows(FloatBuffer rows) {
        return ofRows(rows.duplicate());
    }

    /**
     * Spheres as rows, in double precision. No number is rounded.
     *
     * @param rows x, y, z and radius of each, one after the other; direct, in native order
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or a number of values that 4 does not divide
     */
    public static Spheres rows(DoubleBuffer rows) {
        return ofRows(rows.duplicate());
    }

    private static Spheres ofRows(Buffer rows) {
        int count = rowsOf(rows, 4, "rows");
        return new Spheres(count, new Column(rows, 0, 4), new Column(rows, 1, 4), new Column(rows, 2, 4),
            new Column(rows, 3, 4));
    }

    /**
     * Spheres as columns of one length.
     *
     * @param x coordinates of centers along x; direct, in native order, like the others
     * @param y along y
     * @param z along z
     * @param r radii
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or lengths that differ
     */
    public static Spheres columns(FloatBuffer x, FloatBuffer y, FloatBuffer z, FloatBuffer r) {
        return ofColumns(x.duplicate(), y.duplicate(), z.duplicate(), r.duplicate());
    }

    /**
     * Spheres as columns of one length, in double precision. No number is rounded.
     *
     * @param x coordinates of centers along x; direct, in native order, like the others
     * @param y along y
     * @param z along z
     * @param r radii
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or lengths that differ
     */
    public static Spheres columns(DoubleBuffer x, DoubleBuffer y, DoubleBuffer z, DoubleBuffer r) {
        return ofColumns(x.duplicate(), y.duplicate(), z.duplicate(), r.duplicate());
    }

    private static Spheres ofColumns(Buffer... columns) {
        for (int k = 0; k < 4; k++) {
            String name = "xyzr".substring(k, k + 1);
            check(columns[k], name);
            sameLength(name, columns[k].remaining(), columns[0].remaining());
        }
        return new Spheres(columns[0].remaining(), new Column(columns[0], 0, 1), new Column(columns[1], 0, 1),
            new Column(columns[2], 0, 1), new Column(columns[3], 0, 1));
    }

    /**
     * Points of one radius. Half a cutoff makes pairs of points that are within the cutoff.
     *
     * @param centers x, y and z of each, one after the other; direct, in native order
     * @param radius the radius of all
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or a number of values that 3 does not divide
     */
    public static Spheres points(FloatBuffer centers, float radius) {
        return ofPoints(centers.duplicate(), floats(1).put(0, radius), 0);
    }

    /**
     * Points of one radius, in double precision. No number is rounded.
     *
     * @param centers x, y and z of each, one after the other; direct, in native order
     * @param radius the radius of all
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or a number of values that 3 does not divide
     */
    public static Spheres points(DoubleBuffer centers, double radius) {
        return ofPoints(centers.duplicate(), doubles(1).put(0, radius), 0);
    }

    /**
     * Points with a radius each.
     *
     * @param centers x, y and z of each, one after the other; direct, in native order
     * @param radii the radius of each; direct, in native order
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or other numbers of values
     */
    public static Spheres points(FloatBuffer centers, FloatBuffer radii) {
        return ofPoints(centers.duplicate(), radii.duplicate(), 1);
    }

    /**
     * Points with a radius each, in double precision. No number is rounded.
     *
     * @param centers x, y and z of each, one after the other; direct, in native order
     * @param radii the radius of each; direct, in native order
     * @return the spheres
     * @throws IllegalArgumentException for another kind of buffer, or other numbers of values
     */
    public static Spheres points(DoubleBuffer centers, DoubleBuffer radii) {
        return ofPoints(centers.duplicate(), radii.duplicate(), 1);
    }

    private static Spheres ofPoints(Buffer centers, Buffer radii, int stride) {
        int count = rowsOf(centers, 3, "centers");
        check(radii, "radii");
        if (stride != 0) sameLength("radii", radii.remaining(), count);
        return new Spheres(count, new Column(centers, 0, 3), new Column(centers, 1, 3), new Column(centers, 2, 3),
            new Column(radii, 0, stride));
    }

    /** The number of rows of {@code width} values in a buffer. */
    private static int rowsOf(Buffer buffer, int width, String name) {
        check(buffer, name);
        if (buffer.remaining() % width != 0) {
            throw new IllegalArgumentException(
                name + " have " + buffer.remaining() + " values; give " + width + " for each sphere");
        }
        return buffer.remaining() / width;
    }

    /**
     * The same spheres with a species each.
     *
     * @param species an id for each sphere; direct, in native order
     * @return the spheres, in the same buffers
     * @throws IllegalArgumentException for another kind of buffer, or another number of ids
     */
    public Spheres withSpecies(IntBuffer species) {
        return withOneEach(species, SPECIES, "species");
    }

    /**
     * The same spheres with a group each, as a molecule or a rigid body: two spheres of one group are never a pair, except
     * those of {@link #NO_GROUP}. Two spheres of two sets are of one group if their numbers are equal.
     *
     * @param groups a number for each sphere, of which all 32 bits count; direct, in native order
     * @return the spheres, in the same buffers
     * @throws IllegalArgumentException for another kind of buffer, or another number of groups
     */
    public Spheres withGroups(IntBuffer groups) {
        return withOneEach(groups, GROUPS, "groups");
    }

    private Spheres withOneEach(IntBuffer values, int place, String name) {
        check(values, name);
        sameLength(name, values.remaining(), count);
        return new Spheres(this, place, values.duplicate());
    }

    /**
     * A direct buffer as {@link #rows(FloatBuffer)} and its like take them.
     *
     * @param length how many values it has
     * @return the buffer, all zeros
     */
    public static FloatBuffer floats(int length) {
        return direct(length, Float.BYTES).asFloatBuffer();
    }

    /**
     * A direct buffer as {@link #rows(DoubleBuffer)} and its like take them.
     *
     * @param length how many values it has
     * @return the buffer, all zeros
     */
    public static DoubleBuffer doubles(int length) {
        return direct(length, Double.BYTES).asDoubleBuffer();
    }

    /**
     * A direct buffer as {@link #withSpecies} and {@link #withGroups} take them.
     *
     * @param length how many values it has
     * @return the buffer, all zeros
     */
    public static IntBuffer ints(int length) {
        return direct(length, Integer.BYTES).asIntBuffer();
    }

    /**
     * How many spheres there are.
     *
     * @return the number
     */
    public int count() {
        return count;
    }

    /** The query for the pairs among these spheres, made once. */
    Query query() {
        return query;
    }

    /** The address of a {@code lazygrid_spheres}, for as long as this is reachable. */
    long address() {
        return address;
    }

    private static ByteBuffer direct(int length, int size) {
        long bytes = (long) size * length;
        if (bytes < 0 || bytes > Integer.MAX_VALUE) {
            throw new IllegalArgumentException(length + " values do not fit a buffer of less than 2 GiB");
        }
        return ByteBuffer.allocateDirect((int) bytes).order(ByteOrder.nativeOrder());
    }

    static void check(Buffer buffer, String name) {
        if (!buffer.isDirect() || order(buffer) != ByteOrder.nativeOrder()) {
            throw new IllegalArgumentException(
                name + " must be a direct buffer in native order; Spheres.floats, Spheres.doubles and Spheres.ints make them");
        }
    }

    private static ByteOrder order(Buffer buffer) {
        if (buffer instanceof FloatBuffer floats) return floats.order();
        return buffer instanceof DoubleBuffer doubles ? doubles.order() : ((IntBuffer) buffer).order();
    }

    /** The bytes of a number in a buffer of floats or doubles. */
    private static int size(Buffer buffer) {
        return buffer instanceof FloatBuffer ? Float.BYTES : Double.BYTES;
    }

    private static void sameLength(String name, int length, int expected) {
        if (length != expected) {
            throw new IllegalArgumentException(
                name + " has " + length + " values where " + expected + " are needed: one for each sphere");
        }
    }
}
