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
    /** The group of spheres that are in none. */
    public static final int NO_GROUP = -1;

    /** Size of {@code lazygrid_spheres} on 64-bit machines. */
    private static final int SIZE = 72;
    private static final int SPECIES = 48;
    private static final int GROUPS = 56;
    private static final int EXCLUSIONS = 64;

    private final int count;
    /** Buffers and lists, so that they live as long as their addresses are known. */
    private final List<Object> kept;
    private final ByteBuffer structure = ByteBuffer.allocateDirect(SIZE).order(ByteOrder.nativeOrder());

    private Spheres(int count, int first, List<FloatBuffer> values) {
        this.count = count;
        structure.putLong(0, count);
        for (int k = 0; k < values.size(); k++) {
            structure.putLong(8 * (first + k), Library.address(values.get(k), Float.BYTES));
        }
        kept = List.copyOf(values);
    }

    /** The same spheres with something else in one place of the structure. */
    private Spheres(Spheres same, int place, long address, Object owner) {
        count = same.count;
        structure.put(0, same.structure, 0, SIZE).putLong(place, address);
        kept = new ArrayList<>(same.kept);
        kept.add(owner);
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
        return new Spheres(rows.remaining() / 4, 1, List.of(rows.duplicate()));
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
        return new Spheres(x.remaining(), 2, columns);
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
     * The same spheres with a group each, as a molecule or a rigid body: two spheres of one group are never a pair, but
     * for those of {@link #NO_GROUP}. Between two sets groups of both are the same where their numbers are.
     *
     * @param groups a number for each sphere, of which all 32 bits count; direct, in native order
     * @return the spheres, in the same buffers
     * @throws IllegalArgumentException for another kind of buffer, or another number of groups
     */
    public Spheres withGroups(IntBuffer groups) {
        return withOneEach(groups, GROUPS, "groups");
    }

    /**
     * The same spheres, of which some pairs are never reported. Between two sets they come with the first one, and are
     * made by {@link Exclusions#between}.
     *
     * @param exclusions these pairs; a list for another number of spheres is refused by the search
     * @return the spheres, in the same buffers
     */
    public Spheres withExclusions(Exclusions exclusions) {
        return new Spheres(this, EXCLUSIONS, exclusions.address(), exclusions);
    }

    private Spheres withOneEach(IntBuffer values, int place, String name) {
        check(values, name);
        sameLength(name, values.remaining(), count);
        IntBuffer own = values.duplicate();
        return new Spheres(this, place, Library.address(own, Integer.BYTES), own);
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
     * A direct buffer as {@link #withSpecies} and {@link #withGroups} take them.
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

    /** Called behind each use of the address, so that nothing is freed before that it names. */
    void keep() {
        Reference.reachabilityFence(structure);
        Reference.reachabilityFence(kept);
    }

    private static ByteBuffer direct(int length) {
        long bytes = 4L * length;
        if (bytes < 0 || bytes > Integer.MAX_VALUE) {
            throw new IllegalArgumentException(length + " values do not fit a buffer of less than 2 GiB");
        }
        return ByteBuffer.allocateDirect((int) bytes).order(ByteOrder.nativeOrder());
    }

    static void check(Buffer buffer, String name) {
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
