"""Detector.neighbor_list against NumPy, neighbor_list and the detector's own pairs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import lazygrid

BOX = (10.0, 11.0, 12.0)


def cloud(n: int, seed: int, dtype: Any = np.float64) -> Any:
    """Rows x, y, z, r in a box, of radii up to 1."""
    random = np.random.default_rng(seed)
    return (random.random((n, 4)) * [*BOX, 1.0]).astype(dtype)


def all_pairs(a: Any, b: Any) -> tuple[Any, Any, Any]:
    """Pairs of two sets with their vectors, by the documented expression."""
    vectors = b[None, :, :3].astype(float) - a[:, None, :3].astype(float)
    squares = vectors * vectors
    squared = (squares[..., 0] + squares[..., 1]) + squares[..., 2]
    radii = a[:, None, 3].astype(float) + b[None, :, 3].astype(float)
    i, j = np.nonzero(squared <= radii * radii)
    return np.stack([i, j], axis=1), vectors[i, j], np.sqrt(squared[i, j])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lists_of_spheres(dtype: Any) -> None:
    spheres = cloud(400, 1, dtype)
    detector = lazygrid.Detector(backend="cpu")
    both, vectors, distances = all_pairs(spheres, spheres)
    i, j, d, found, shifts = detector.neighbor_list("ijdDS", spheres, with_self=True)
    np.testing.assert_array_equal(np.stack([i, j], axis=1), both)
    np.testing.assert_array_equal(found, vectors)
    np.testing.assert_array_equal(d, distances)
    assert shifts.shape == (len(i), 3) and not shifts.any()
    assert [array.dtype for array in (i, j, d, found, shifts)] == [int, int, float, float, int]
    others = both[:, 0] != both[:, 1]
    np.testing.assert_array_equal(detector.neighbor_list("j", spheres), both[others, 1])
    half = np.stack(detector.neighbor_list("ij", spheres, half=True), axis=1)
    np.testing.assert_array_equal(half, detector.pairs(spheres))


def test_lists_of_two_sets_with_exclusions_and_species() -> None:
    a, b = cloud(300, 2), cloud(200, 3)
    detector = lazygrid.Detector(backend="cpu")
    both, vectors, _ = all_pairs(a, b)
    assert len(both) > 100
    i, j, found = detector.neighbor_list("ijD", a, b)
    np.testing.assert_array_equal(np.stack([i, j], axis=1), both)
    np.testing.assert_array_equal(found, vectors)
    bonds = lazygrid.Exclusions.across(300, 200, both[::2])
    np.testing.assert_array_equal(detector.neighbor_list("j", a, b, exclusions=bonds), both[1::2, 1])
    groups = (np.zeros(300, int), np.arange(200) % 2)
    odd = both[:, 1] % 2 == 1
    np.testing.assert_array_equal(detector.neighbor_list("i", a, b, groups=groups), both[odd, 0])
    table = lazygrid.Interactions(2)
    table[0, 1] = 2.0
    by_species = lazygrid.Detector(backend="cpu", interactions=table)
    kinds = np.arange(300) % 2
    i, j, d = by_species.neighbor_list("ijd", a, species=kinds)
    pairs = by_species.pairs(a, species=kinds)
    assert len(pairs) > 50 and len(i) == 2 * len(pairs) and d.max() <= 2.0
    assert (kinds[i] != kinds[j]).all()


def test_images_are_those_of_atoms() -> None:
    cell = np.array([[4.0, 0.0, 0.0], [1.5, 5.0, 0.0], [-1.0, 2.0, 6.0]])
    positions = np.random.default_rng(4).random((30, 3)) @ cell
    atoms = SimpleNamespace(positions=positions, cell=cell, pbc=True, numbers=np.ones(30))
    detector = lazygrid.Detector(backend="cpu", periodic=tuple(map(tuple, cell)))
    for cutoff in (1.5, 9.0):
        for with_self in (False, True):
            expected = lazygrid.neighbor_list("ijdDS", atoms, cutoff, self_interaction=with_self)
            found = detector.neighbor_list(
                "ijdDS", (positions, cutoff / 2), open=True, with_self=with_self
            )
            for mine, theirs in zip(found, expected):
                assert mine.tobytes() == theirs.tobytes()


def test_touching_spheres_are_neighbors_unless_open() -> None:
    spheres = np.array([[0.0, 0.0, 0.0, 1.0], [2.0, 0.0, 0.0, 1.0]])
    detector = lazygrid.Detector(backend="cpu")
    assert detector.neighbor_list("i", spheres).tolist() == [0, 1]
    assert detector.neighbor_list("i", spheres, open=True).tolist() == []
    distance, first, again = detector.neighbor_list("did", spheres)
    assert again is distance and first.tolist() == [0, 1] and distance.tolist() == [2.0, 2.0]


def test_wrong_arguments_are_refused() -> None:
    detector = lazygrid.Detector(backend="cpu", max_pairs=3)
    spheres = cloud(100, 5)
    for wrong in ("", "ijx"):
        with pytest.raises(lazygrid.InputError, match=f"'{wrong}'.*ijdDS"):
            detector.neighbor_list(wrong, spheres)
    with pytest.raises(lazygrid.TooManyPairs):
        detector.neighbor_list("ij", spheres)
    spheres[7, 0] = np.nan
    with pytest.raises(lazygrid.InputError, match="sphere 7 "):
        detector.neighbor_list("ij", spheres)
