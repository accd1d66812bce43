"""neighbor_list against ASE and matscipy, bit for bit, and its errors."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

import lazygrid

ase = pytest.importorskip("ase")
from ase import Atoms  # noqa: E402
from ase import build  # noqa: E402
from ase.build import bulk, molecule  # noqa: E402
from ase.data import chemical_symbols, reference_states  # noqa: E402
from ase.neighborlist import natural_cutoffs, neighbor_list  # noqa: E402


def ordered(lists: tuple[Any, ...]) -> tuple[Any, ...]:
    """The lists sorted by i, then j, then S: ASE leaves the order of j open."""
    i, j, _, _, shift = lists
    order = np.lexsort((shift[:, 2], shift[:, 1], shift[:, 0], j, i))
    return tuple(array[order] for array in lists)


def same(atoms: Any, cutoff: Any, self_interaction: bool = False) -> int:
    expected = ordered(neighbor_list("ijdDS", atoms, cutoff, self_interaction=self_interaction))
    found = lazygrid.neighbor_list("ijdDS", atoms, cutoff, self_interaction=self_interaction)
    for mine, theirs in zip(found, expected):
        assert mine.dtype == theirs.dtype and mine.shape == theirs.shape
        assert mine.tobytes() == np.ascontiguousarray(theirs + 0).tobytes() or (mine == theirs).all()
    return len(found[0])


def copper(repeat: int, rattled: float, seed: int = 42) -> Any:
    atoms = bulk("Cu", cubic=True) * repeat
    atoms.rattle(rattled, rng=np.random.default_rng(seed))
    return atoms


def test_one_cutoff() -> None:
    for pbc in (True, False, (True, False, True)):
        atoms = copper(4, 0.5)
        atoms.pbc = pbc
        assert same(atoms, 5.0) > 4000


def test_lattices_at_exactly_the_cutoff() -> None:
    side = 3.61
    for atoms in (copper(4, 0.0), bulk("NaCl", "rocksalt", a=4.0, cubic=True) * 3):
        for cutoff in (2.0, 4.0, side, side / np.sqrt(2), 5.0):
            same(atoms, cutoff)


def test_atoms_outside_the_cell() -> None:
    atoms = copper(4, 0.3)
    atoms.positions += np.random.default_rng(1).integers(-3, 4, (len(atoms), 3)) * atoms.cell.lengths()
    assert same(atoms, 4.0) > 1000
    atoms.pbc = False
    same(atoms, 4.0)


def test_cutoffs_by_element_and_by_atom() -> None:
    atoms = molecule("isobutane")
    assert same(atoms, 1.85) > 20
    assert same(atoms, {("H", "H"): 1.1, ("C", "H"): 1.3, ("C", "C"): 1.85}) > 20
    assert same(atoms, {(1, 6): 1.3, ("C", "C"): 1.85, ("O", "O"): 9.0}) > 20
    assert same(atoms, natural_cutoffs(atoms, mult=1.2)) > 20
    assert same(copper(4, 0.2), np.full(256, 1.4)) > 1000
    assert same(atoms, {("O", "O"): 9.0}) == 0


def test_every_atom_its_own_neighbor() -> None:
    assert same(copper(4, 0.2), 3.0, self_interaction=True) > 256
    assert same(Atoms("H", positions=[(1, 2, 3)]), 1.0, self_interaction=True) == 1
    assert same(Atoms("H2", positions=[(1, 2, 3)] * 2), 1.0) == 2


@given(
    count=some.integers(1, 40),
    cutoff=some.floats(0.1, 2.5),
    pbc=some.tuples(some.booleans(), some.booleans(), some.booleans()),
    lengths=some.tuples(*[some.floats(5, 12)] * 3),
    seed=some.integers(0, 1 << 30),
)
def test_any_atoms(
    count: int, cutoff: float, pbc: tuple[bool, ...], lengths: tuple[float, ...], seed: int
) -> None:
    random = np.random.default_rng(seed)
    positions = random.uniform(-1.5, 2.5, (count, 3)) * lengths
    # Half of them on a raster, so that distances repeat exactly.
    positions[::2] = np.round(positions[::2] * 2) / 2
    atoms = Atoms(random.choice(["H", "O"], count), positions=positions, cell=lengths, pbc=pbc)
    same(atoms, cutoff)
    same(atoms, {("H", "O"): cutoff, ("H", "H"): cutoff / 2})
    same(atoms, random.uniform(0, cutoff / 2, count))


def test_matscipy_finds_the_same() -> None:
    matscipy = pytest.importorskip("matscipy.neighbours")
    atoms = copper(5, 0.4)
    expected = ordered(matscipy.neighbour_list("ijdDS", atoms, 4.5))
    for mine, theirs in zip(lazygrid.neighbor_list("ijdDS", atoms, 4.5), expected):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-12)


def test_far_from_the_origin_nothing_is_lost() -> None:
    atoms = copper(4, 0.3)
    atoms.pbc = False
    atoms.positions += 1e6
    same(atoms, 3.0)
    half = len(atoms) // 2
    atoms.positions[half:] += 1e5
    same(atoms, 3.0)


def test_quantities_come_as_they_are_asked_for() -> None:
    atoms = copper(3, 0.1)
    alone = lazygrid.neighbor_list("d", atoms, 3.0)
    distance, first, again = lazygrid.neighbor_list("did", atoms, 3.0)
    np.testing.assert_array_equal(alone, distance)
    assert again is distance and first.dtype == np.int64
    none = Atoms()
    assert [array.shape for array in lazygrid.neighbor_list("ijdDS", none, 3.0)] == [(0,)] * 3 + [(0, 3)] * 2
    with pytest.raises(lazygrid.InputError, match="'ijx'.*ijdDS"):
        lazygrid.neighbor_list("ijx", atoms, 3.0)


def test_bad_cells_cutoffs_and_positions_are_refused() -> None:
    with pytest.raises(lazygrid.InputError, match="must be finite and independent"):
        lazygrid.neighbor_list("ij", Atoms("H", cell=[[9, 0, 0], [3, 9, 0], [6, 9, 0]], pbc=True), 3.0)
    with pytest.raises(lazygrid.InputError, match="periodic along x"):
        lazygrid.neighbor_list("ij", Atoms("H", pbc=True), 3.0)
    atoms = copper(3, 0.1)
    for wrong in (np.nan, np.inf):
        with pytest.raises(lazygrid.InputError, match="must be finite"):
            lazygrid.neighbor_list("ij", atoms, wrong)
    with pytest.raises(lazygrid.InputError, match="atom 1 is -1"):
        lazygrid.neighbor_list("ij", atoms, [1.0, -1.0] * 54)
    with pytest.raises(lazygrid.InputError, match="one per atom"):
        lazygrid.neighbor_list("ij", atoms, [1.0, 1.0])
    with pytest.raises(lazygrid.InputError, match="no element"):
        lazygrid.neighbor_list("ij", atoms, {("Cu", "Xx1"): 1.0})
    for wrong in (np.nan, np.inf):
        with pytest.raises(lazygrid.InputError, match="sphere 5 "):
            atoms.positions[5] = wrong
            lazygrid.neighbor_list("ij", atoms, 3.0)


def test_anything_with_positions_will_do() -> None:
    positions = np.random.default_rng(3).uniform(0, 10, (100, 3))
    plain = SimpleNamespace(positions=positions, cell=(10, 10, 10), pbc=True, numbers=np.ones(100))
    atoms = Atoms("H100", positions=positions, cell=(10, 10, 10), pbc=True)
    np.testing.assert_array_equal(
        lazygrid.neighbor_list("d", plain, 2.0), lazygrid.neighbor_list("d", atoms, 2.0)
    )


def tilted(atoms: Any, cutoff: Any, self_interaction: bool = False) -> int:
    """As `same`, except for the rounding of distances in triclinic cells."""
    expected = ordered(neighbor_list("ijdDS", atoms, cutoff, self_interaction=self_interaction))
    found = lazygrid.neighbor_list("ijdDS", atoms, cutoff, self_interaction=self_interaction)
    for k, (mine, theirs) in enumerate(zip(found, expected)):
        assert mine.dtype == theirs.dtype and mine.shape == theirs.shape
        if k in (0, 1, 4):
            np.testing.assert_array_equal(mine, theirs)
        else:
            np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-12 * (1 + np.abs(atoms.positions).max()))
    i, j, distances, vectors, shift = found
    # Products by BLAS may be fused.
    products = [shift[:, axis, None] * atoms.cell[axis] for axis in range(3)]
    expected_vectors = (atoms.positions[j] - atoms.positions[i]) + ((products[0] + products[1]) + products[2])
    np.testing.assert_array_equal(vectors, expected_vectors)
    squares = vectors * vectors
    np.testing.assert_array_equal(distances, np.sqrt((squares[:, 0] + squares[:, 1]) + squares[:, 2]))
    opposite = np.lexsort((-shift[:, 2], -shift[:, 1], -shift[:, 0], i, j))
    np.testing.assert_array_equal(vectors[opposite], -vectors)
    return len(found[0])


def test_cell_vectors_along_the_axes_in_any_order_and_direction() -> None:
    positions = np.random.default_rng(3).random((40, 3)) * [10, 11, 12]
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            cell = np.diag([10.0, 11.0, 12.0])[list(order)] * np.array(signs)[:, None]
            for pbc in (True, (True, False, True)):
                assert tilted(Atoms("H40", positions=positions, cell=cell, pbc=pbc), 3.0) > 50
    assert tilted(Atoms("H40", positions=positions, cell=cell, pbc=True), 25.0) > 10_000


def test_cells_that_lean() -> None:
    atoms = bulk("Cu") * 5
    atoms.rattle(0.3, rng=np.random.default_rng(2))
    for pbc in (True, (True, True, False), (False, True, False), False):
        atoms.pbc = pbc
        assert tilted(atoms, 4.0, self_interaction=pbc is not True) > 1000
    # The same crystal, with cell vectors far from the shortest.
    atoms.pbc = True
    atoms.set_cell(np.array([[1, 0, 0], [3, 1, 0], [-2, 2, 1]]) @ atoms.cell[:])
    atoms.positions += np.random.default_rng(3).integers(-3, 4, (len(atoms), 3)) @ atoms.cell[:]
    assert tilted(atoms, {("Cu", "Cu"): 3.0}) > 500
    assert tilted(atoms, np.linspace(0.5, 2.0, len(atoms))) > 500


@given(
    count=some.integers(1, 30),
    tilts=some.tuples(*[some.floats(-1.5, 1.5)] * 3),
    lengths=some.tuples(*[some.floats(3, 9)] * 3),
    pbc=some.tuples(some.booleans(), some.booleans(), some.booleans()),
    seed=some.integers(0, 1 << 30),
)
@settings(max_examples=30)
def test_any_cell(
    count: int,
    tilts: tuple[float, ...],
    lengths: tuple[float, ...],
    pbc: tuple[bool, ...],
    seed: int,
) -> None:
    random = np.random.default_rng(seed)
    (a, b, c), (xy, xz, yz) = lengths, tilts
    cell = np.array([[a, 0, 0], [xy * a, b, 0], [xz * a, yz * b, c]])
    # In any direction, not with the first vector along x only.
    cell = cell @ np.linalg.qr(random.normal(size=(3, 3)))[0]
    positions = random.uniform(-1, 2, (count, 3)) @ cell
    atoms = Atoms(random.choice(["H", "O"], count), positions=positions, cell=cell, pbc=pbc)
    for cutoff in (0.3, 2.0, 7.0):
        tilted(atoms, cutoff)
        tilted(atoms, {("H", "O"): 0.8 * cutoff, ("H", "H"): 0.4 * cutoff})
        tilted(atoms, random.uniform(0, cutoff / 2, count))


def crystals() -> list[Any]:
    """The element crystals, bulk cells and slabs of ASE."""
    atoms = []
    for number, state in enumerate(reference_states):
        if number > 0 and state is not None:
            is_cubic = state["symmetry"] in ("sc", "fcc", "bcc", "diamond")
            for cubic in (False, True) if is_cubic else (False,):
                try:
                    atoms.append(bulk(chemical_symbols[number], cubic=cubic))
                except (ValueError, RuntimeError, NotImplementedError, KeyError):
                    # ASE has no lattice for it.
                    continue
    for name, structure, a in (("NaCl", "rocksalt", 5.64), ("GaAs", "zincblende", 5.65), ("CsCl", "cesiumchloride", 4.12)):
        atoms.append(bulk(name, structure, a=a))
    atoms.append(bulk("ZnO", "wurtzite", a=3.25, c=5.2))
    atoms.append(bulk("CaF2", "fluorite", a=5.46))
    surfaces: tuple[Any, ...] = (build.fcc111, build.fcc100, build.fcc110)
    for make in surfaces:
        atoms.append(make("Pt", (1, 1, 3), vacuum=8.0))
        atoms.append(make("Pt", (2, 2, 3), vacuum=8.0))
    atoms += [build.bcc110("Fe", (1, 1, 4), vacuum=7.0), build.hcp0001("Ru", (1, 1, 4), vacuum=7.0)]
    atoms += [build.graphene(vacuum=6.0), build.mx2(vacuum=6.0), build.nanotube(3, 0, length=1)]
    return atoms


def test_cells_smaller_than_the_cutoff() -> None:
    found = 0
    all_crystals = crystals()
    assert len(all_crystals) > 100
    for atoms in all_crystals:
        for cutoff in (3.0, 5.0, 6.0):
            found += tilted(atoms, cutoff)
        symbols = sorted(set(atoms.symbols))
        tilted(atoms, {(a, b): 3.1 + 0.4 * k for k, a in enumerate(symbols) for b in symbols})
        tilted(atoms, natural_cutoffs(atoms, mult=1.3), self_interaction=True)
    assert found > 20_000
    assert tilted(Atoms("H", cell=(0.5, 0.6, 30), pbc=(True, True, False)), 4.0, self_interaction=True) > 150


def test_molecules() -> None:
    for name in ("H2O", "C60", "CH3CH2OH", "C6H6"):
        for cutoff in (3.0, 5.0, 6.0):
            assert same(molecule(name), cutoff) > 0
