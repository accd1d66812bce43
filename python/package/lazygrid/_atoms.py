"""Neighbor lists of atoms in the form of ASE and matscipy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ._errors import InputError
from ._lazygrid import neighbors_within

AXES = "xyz"

Vectors = npt.NDArray[np.float64]
Cutoff = float | Mapping[tuple[int | str, int | str], float] | npt.ArrayLike


class Atoms(Protocol):
    """The used part of ``ase.Atoms``: positions and cell in one length unit, and the periodic axes."""

    @property
    def positions(self) -> Any: ...
    @property
    def cell(self) -> Any: ...
    @property
    def pbc(self) -> Any: ...
    @property
    def numbers(self) -> Any: ...


def neighbor_list(quantities: str, a: Atoms, cutoff: Cutoff, self_interaction: bool = False) -> Any:
    """Return the neighbors of atoms, like ``ase.neighborlist.neighbor_list``, to the last bit.

    Atoms are neighbors if they are nearer to each other than the cutoff, with all their periodic images, also in small
    cells. The list has every pair as ``(i, j)`` and as ``(j, i)``, sorted by ``i``, then ``j``, then ``S``.

    Vectors are ``(a.positions[j] - a.positions[i]) + ((S[0] * cell[0] + S[1] * cell[1]) + S[2] * cell[2])``, each
    operation rounded by itself. ASE leaves the products to NumPy's BLAS, which fuses a multiplication and an addition on
    most processors, for some lengths of the list. Vectors to images three or more cells away in a triclinic cell may thus
    differ from ASE's by a rounding error of the largest product, and are equal without fused operations
    (``OPENBLAS_CORETYPE=Nehalem``).

    Parameters
    ----------
    quantities
        The returned arrays, in this order: ``i`` and ``j``, indices of the atoms, int64 of shape ``(m,)``; ``d``,
        distances, float64 of shape ``(m,)``; ``D``, vectors from ``i`` to ``j``, float64 of shape ``(m, 3)``; ``S``,
        the numbers of cell vectors between them, int64 of shape ``(m, 3)``, so that ``D = a.positions[j] -
        a.positions[i] + S @ a.cell``.
    a
        ``ase.Atoms``, or any object with ``positions``, ``cell``, ``pbc`` and ``numbers``. Distances are decided in
        float64.
    cutoff
        A distance; or a dictionary of distances by two symbols or atomic numbers, ``{("H", "O"): 1.2}``, whose missing
        pairs are not neighbors; or a radius per atom: the cutoff is the sum of both radii.
    self_interaction
        If true, every atom is its own neighbor at distance zero.

    Returns
    -------
    numpy.ndarray or tuple of numpy.ndarray
        One array if ``quantities`` is one letter.

    Raises
    ------
    InputError
        For positions or cutoffs that are not finite, cell vectors in one plane, and unknown quantities.
    """
    positions = np.require(a.positions, np.float64, ["C", "A"])
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise InputError(f"positions have shape {positions.shape} where (n, 3) is needed")
    cutoffs, largest = _cutoffs(cutoff, a, len(positions))
    periodic = [bool(axis) for axis in np.broadcast_to(np.asarray(a.pbc), 3)]
    cell = _cell(a.cell, periodic)
    if largest <= 0:
        # Nothing is nearer than that, not even an atom to itself.
        positions, cutoffs = positions[:0], 0.0
    return neighbors_within(quantities, positions, cutoffs, cell=cell.tolist(), with_itself=self_interaction)


def _cell(given: Any, periodic: list[bool]) -> Vectors:
    """The cell as a matrix of its vectors."""
    cell = np.array(given, dtype=np.float64)
    if cell.shape == (3,):
        cell = np.diag(cell)
    if cell.shape != (3, 3):
        raise InputError(f"the cell has shape {cell.shape} where (3, 3) is needed")
    for axis in range(3):
        if not periodic[axis]:
            # No bond crosses the cell here, so its vector does not matter.
            cell[axis] = 0.0
        elif not np.isfinite(cell[axis]).all() or not cell[axis].any():
            raise InputError(f"the cell is periodic along {AXES[axis]} and its vector there is {cell[axis].tolist()}")
    return cell


def _cutoffs(cutoff: Cutoff, a: Atoms, atoms: int) -> tuple[Any, float]:
    """The cutoffs of the search, and the largest of any two atoms."""
    if isinstance(cutoff, Mapping):
        return _by_kind(cutoff, np.asarray(a.numbers))
    given = np.asarray(cutoff, dtype=np.float64)
    _check(given)
    if given.ndim == 0:
        return float(given), float(given)
    if given.shape != (atoms,):
        raise InputError(f"the cutoffs have shape {given.shape} where () or ({atoms},) is needed: one per atom")
    if given.size > 0 and given.min() < 0.0:
        index = int(np.argmax(given < 0.0))
        raise InputError(f"the cutoff of atom {index} is {given[index]}; a radius must not be negative")
    two = np.sort(given)[-2:]
    return np.require(given, requirements=["C", "A"]), float(two.sum())


def _by_kind(cutoff: Mapping[Any, float], numbers: npt.NDArray[Any]) -> tuple[Any, float]:
    """A kind for each atom and a table of cutoffs for two kinds, from a dictionary by atomic numbers or symbols."""
    kinds, of = np.unique(numbers, return_inverse=True)
    place = {int(number): kind for kind, number in enumerate(kinds)}
    table = np.zeros((len(kinds), len(kinds)))
    # In ASE, the last of two entries for one pair counts.
    for pair, distance in cutoff.items():
        first, second = (place.get(_number(element), -1) for element in pair)
        if first >= 0 and second >= 0:
            table[first, second] = table[second, first] = distance
    _check(table)
    largest = float(table.max(initial=0.0))
    return (np.ascontiguousarray(of.ravel(), dtype=np.uint32), table), largest


def _number(element: int | str) -> int:
    """The atomic number of an element."""
    if not isinstance(element, str):
        return int(element)
    try:
        from ase.data import atomic_numbers
    except ImportError:
        raise InputError(f"the cutoff names {element!r}, and ase is not installed; give atomic numbers") from None
    if element not in atomic_numbers:
        raise InputError(f"the cutoff names {element!r}, which is no element")
    return int(atomic_numbers[element])


def _check(cutoffs: npt.NDArray[np.float64]) -> None:
    if not np.isfinite(cutoffs).all():
        raise InputError(f"a cutoff is {cutoffs[~np.isfinite(cutoffs)].flat[0]}; it must be finite")
