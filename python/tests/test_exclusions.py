"""Groups, excluded pairs, and triclinic boxes, against the definition."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import Rows, brute_force, brute_force_of_edges, scene
from hypothesis import given
from hypothesis import strategies as some

import lazygrid
from lazygrid import NO_GROUP, Detector, Exclusions

EDGES = np.array([[5.0, 0.0, 0.0], [3.0, 5.0, 0.0], [-1.5, 2.5, 4.0]])
Pairs = npt.NDArray[np.uint32]


def apart(pairs: Pairs, first: npt.NDArray[Any], second: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """The pairs of different groups."""
    of_i, of_j = first[pairs[:, 0]], second[pairs[:, 1]]
    return np.asarray((of_i != of_j) | (of_i == NO_GROUP), np.bool_)


def without(pairs: Pairs, listed: set[tuple[int, int]]) -> Pairs:
    return np.array([pair for pair in pairs.tolist() if tuple(pair) not in listed], np.uint32).reshape(-1, 2)


def each_result_is(detector: Detector, rows: Rows, expected: Pairs, **said: Any) -> None:
    np.testing.assert_array_equal(detector.pairs(rows, **said), expected)
    np.testing.assert_array_equal(detector.pairs(tuple(rows.T), **said), expected)
    assert detector.count(rows, **said) == len(expected)
    assert len(detector.neighbors(rows, **said)[1]) == 2 * len(expected)
    chunks = list(detector.stream(rows, chunk=16, **said))
    np.testing.assert_array_equal(np.concatenate([np.empty((0, 2), np.uint32), *chunks]), expected)


@pytest.mark.parametrize("algorithm", ["auto", "naive", "hash-grid", "cell-list"])
@pytest.mark.parametrize("periodic", [None, EDGES])
def test_excluded_pairs_are_not_reported(algorithm: Any, periodic: Any) -> None:
    rows = scene(7, 250, box=5.0)
    random = np.random.default_rng(8)
    detector = Detector(backend="cpu", algorithm=algorithm, periodic=periodic)
    all_pairs = brute_force(rows) if periodic is None else brute_force_of_edges(rows, EDGES)
    groups = random.integers(0, 5, len(rows)).astype(np.uint32)
    groups[::7] = NO_GROUP
    grouped = all_pairs[apart(all_pairs, groups, groups)]
    listed = all_pairs[::3]
    bonds = Exclusions(len(rows), np.concatenate([listed[:, ::-1], listed[:2]]))
    assert len(bonds) == len(listed) > 10 and len(listed) < len(grouped) < len(all_pairs)
    gone = set(map(tuple, listed.tolist()))
    each_result_is(detector, rows, grouped, groups=groups)
    each_result_is(detector, rows, grouped, groups=groups.astype(np.int64).tolist())
    each_result_is(detector, rows, without(all_pairs, gone), exclusions=bonds)
    each_result_is(detector, rows, without(grouped, gone), groups=groups, exclusions=bonds)
    every = Exclusions.from_csr(*detector.neighbors(rows))
    each_result_is(detector, rows, all_pairs[:0], exclusions=every)
    each_result_is(detector, rows, all_pairs)


@pytest.mark.parametrize("periodic", [None, EDGES])
def test_two_sets_leave_out_groups_and_lists(periodic: Any) -> None:
    rows, split = scene(9, 250, box=5.0), 100
    groups = np.arange(len(rows), dtype=np.uint32) % 4
    groups[groups == 3] = NO_GROUP
    found = brute_force(rows) if periodic is None else brute_force_of_edges(rows, EDGES)
    across = found[(found[:, 0] < split) & (found[:, 1] >= split)] - np.array([0, split], np.uint32)
    listed = across[::4]
    expected = without(across[apart(across, groups[:split], groups[split:])], set(map(tuple, listed.tolist())))
    a, b = rows[:split], rows[split:]
    said: dict[str, Any] = {
        "groups": (groups[:split], groups[split:]),
        "exclusions": Exclusions.across(split, len(b), listed),
    }
    detector = Detector(backend="cpu", periodic=periodic)
    assert 10 < len(expected) < len(across)
    for sets in ((a, b), (a.astype(np.float64), (b[:, :3], b[:, 3]))):
        np.testing.assert_array_equal(detector.pairs(*sets, **said), expected)
        assert detector.count(*sets, **said) == len(expected)
        assert len(detector.neighbors(*sets, **said)[1]) == len(expected)
        np.testing.assert_array_equal(np.concatenate(list(detector.stream(*sets, chunk=9, **said))), expected)
    detector.count(a, b, groups=(None, groups[split:]))


@given(
    count=some.integers(0, 30),
    seed=some.integers(0, 1 << 30),
    kinds=some.integers(1, 6),
    share=some.floats(0, 1),
)
def test_any_groups_and_lists(count: int, seed: int, kinds: int, share: float) -> None:
    rows, random = scene(seed, count, box=2.0), np.random.default_rng(seed)
    groups = random.choice([*range(kinds), NO_GROUP], count).astype(np.uint32)
    every = np.argwhere(random.uniform(size=(count, count)) < share)
    listed = {(min(i, j), max(i, j)) for i, j in every.tolist()}
    pairs = brute_force(rows)
    expected = without(pairs[apart(pairs, groups, groups)], listed)
    each_result_is(
        Detector(backend="cpu"), rows, expected, groups=groups, exclusions=Exclusions(count, every)
    )


def test_kept_candidates_serve_changing_exclusions() -> None:
    rows = scene(3, 2000, box=10.0)
    detector = Detector(backend="cpu", skin=0.2)
    pairs = brute_force(rows)
    for step in range(4):
        groups = (np.arange(len(rows)) % (step + 2)).astype(np.uint32)
        np.testing.assert_array_equal(detector.pairs(rows, groups=groups), pairs[apart(pairs, groups, groups)])
        candidates = detector.report["candidates"]
        assert candidates is not None and candidates["age"] == step


def test_a_stream_keeps_its_own() -> None:
    rows = np.zeros((200, 4), dtype=np.float32)
    groups = np.arange(200, dtype=np.uint32) % 2
    chunks = Detector(backend="cpu", order="unordered").stream(
        rows, chunk=100, groups=groups, exclusions=Exclusions(200, [(0, 1)])
    )
    groups[:] = 0
    assert sum(map(len, chunks)) == 100 * 100 - 1


def test_errors_name_the_argument(spheres: Rows) -> None:
    detector, count = Detector(backend="cpu"), len(spheres)
    with pytest.raises(lazygrid.InputError, match=r"\(3, 200\).* 200 "):
        Exclusions(count, [(0, 1), (3, 200)])
    with pytest.raises(lazygrid.InputError, match="`pairs` has -1 at index 1"):
        Exclusions(count, [(0, 1), (3, -1)])
    with pytest.raises(lazygrid.InputError, match=r"shape \(3,\) where \(m, 2\)"):
        Exclusions(count, [0, 1, 2])
    with pytest.raises(TypeError, match="whole numbers"):
        Exclusions(count, [(0.5, 1.0)])
    with pytest.raises(lazygrid.InputError, match="offset 2 .* is 1"):
        Exclusions.from_csr([0, 2, 1, 2], [1, 2])
    with pytest.raises(lazygrid.InputError, match=r"where \(n \+ 1,\)"):
        Exclusions.from_csr([[0]], [])
    assert len(Exclusions(count, [])) == 0 and repr(Exclusions(count, [])).endswith("0 pairs of 200 spheres>")
    bonds = Exclusions(count - 1, [(0, 1)])
    with pytest.raises(lazygrid.InputError, match="199"):
        detector.pairs(spheres, exclusions=bonds)
    with pytest.raises(lazygrid.InputError, match="199"):
        detector.pairs(spheres, spheres, exclusions=bonds)
    with pytest.raises(lazygrid.InputError, match="`groups` has 2 values|groups"):
        detector.count(spheres, groups=[1, 2])
    with pytest.raises(lazygrid.InputError, match="in the second set, .*groups"):
        detector.count(spheres, spheres, groups=(None, [1, 2]))
