package io.github.lazygrid;

import java.util.ArrayList;
import java.util.List;

/** A symmetric table of the condition for any two species to pair, checked by the constructor of a detector. */
public final class Interactions {
    /** A call of {@link #set}. */
    record Entry(int a, int b, Interaction interaction) {}

    private final int species;
    private final Interaction all;
    private final List<Entry> entries = new ArrayList<>();

    /**
     * Creates a table with one interaction for all species.
     *
     * @param species the number of species, at most 4096; ids start at 0
     * @param all the interaction of all
     */
    public Interactions(int species, Interaction all) {
        this.species = species;
        this.all = all;
    }

    /**
     * Sets the interaction of two species, in both orders. The last call counts.
     *
     * @param a one species
     * @param b the other, or the same
     * @param interaction the condition
     * @return this table
     */
    public Interactions set(int a, int b, Interaction interaction) {
        entries.add(new Entry(a, b, interaction));
        return this;
    }

    int species() {
        return species;
    }

    Interaction all() {
        return all;
    }

    List<Entry> entries() {
        return entries;
    }
}
