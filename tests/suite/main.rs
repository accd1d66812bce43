//! All combinations of detector, scenario, threads and order against the oracle.

mod bad_input;
mod cell_reuse;
mod doubles;
mod exclusions;
mod expected;
mod far_spheres;
mod files;
mod interactions;
mod language;
mod lazy_grid;
mod limits;
mod magnitudes;
mod modules;
mod neighbor_lists;
mod periodic;
mod properties;
mod results;
mod reuse;
mod scenes;
mod sequences;
mod skin;
mod streams;
mod triclinic;
mod two_sets;
mod workspace;
