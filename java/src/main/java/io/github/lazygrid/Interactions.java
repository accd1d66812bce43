package io.github.lazygrid;

import java.util.ArrayList;
import java.util.List;

/** A symmetric table: for any two species, the condition for a pair. The constructor of a detector checks it. */
public final class Interactions {
    /** One call of {@link #set}. */
    record Entry(int a, int b, Interaction interaction) {}

    private final int species;
    private final Interaction all;
    private final List<Entry> entries = new ArrayList<>();

    /**
     * A table in which every two species have the same interaction.
     *
     * @param species the number of species, at most 4096; ids start at 0
     * @param all the interaction of all
     */
    public Interactions(int species, Interaction all) {
        this.species = species;
        this.all = all;
    }

    /**
     * Sets the interaction of two species, in both directions. The last one counts.
     *
     * @param a one species
     * @param b the other, or the same
     * @param interaction the condition for a pair
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
