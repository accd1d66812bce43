"""Pairs between two sets, and skins, against the definition and against searches of one set."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pytest
from conftest import OPEN, Box, Rows, brute_force, brute_force_across, on_gpu, scene

import lazygrid
from lazygrid import Detector, Interactions
from lazygrid.types import Skin


@pytest.mark.parametrize("algorithm", ["auto", "naive", "cell-list", "hash-grid"])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("periodic", [OPEN, (4.0, 4.1, None)])
@pytest.mark.parametrize("order", ["canonical", "unordered"])
def test_each_result_is_that_of_the_definition(
    algorithm: Literal["auto", "naive", "cell-list", "hash-grid"],
    kind: type[np.float32] | type[np.float64],
    periodic: Any,
    order: Literal["canonical", "unordered"],
) -> None:
    detector = Detector(backend="cpu", algorithm=algorithm, periodic=periodic, order=order)
    for seed, (n, m) in enumerate([(300, 200), (1, 400), (0, 5), (5, 0), (900, 900)]):
        a: Any = scene(seed, n, box=4.0).astype(kind)
        b: Any = scene(seed + 50, m, box=4.0).astype(kind)
        expected = brute_force_across(a, b, periodic)
        found = detector.pairs(a, b)
        assert found.dtype == np.uint32 and found.shape == expected.shape
        assert detector.report["spheres"] == n + m and detector.report["pairs"] == len(expected)
        chunks = list(detector.stream(a, b, chunk=64))
        assert all(len(chunk) <= 64 for chunk in chunks)
        streamed = np.concatenate([np.empty((0, 2), np.uint32), *chunks])
        if order == "unordered":
            found, streamed = (pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))] for pairs in (found, streamed))
        np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(streamed, expected)
        assert detector.count(a, tuple(b.T)) == len(expected)
        offsets, indices = detector.neighbors(a, b)
        assert offsets.dtype == np.uint64 and indices.dtype == np.uint32 and len(offsets) == n + 1
        of = np.repeat(np.arange(n), (offsets[1:] - offsets[:-1]).astype(np.int64))
        np.testing.assert_array_equal(np.column_stack([of, indices]), expected)


def test_one_set_of_both_says_the_same() -> None:
    rows, split = scene(3, 1500, box=6.0), 600
    species = np.arange(len(rows), dtype=np.uint32) % 3
    table = Interactions(3, "touch")
    table[0, 0], table[0, 1] = None, 0.4
    detector = Detector(backend="cpu", interactions=table)
    pairs = detector.pairs(rows, species=species)
    across = pairs[(pairs[:, 0] < split) & (pairs[:, 1] >= split)] - np.array([0, split], np.uint32)
    a, b, of_a, of_b = rows[:split], rows[split:], species[:split], species[split:]
    both = (of_a, of_b)
    np.testing.assert_array_equal(detector.pairs(a, b, species=both), across)
    assert len(across) > 100
    assert detector.count(a, b, species=both) == len(across)
    assert len(detector.neighbors(a, b, species=both)[1]) == len(across)
    assert sum(map(len, detector.stream(a, b, chunk=100, species=both))) == len(across)
    np.testing.assert_array_equal(
        lazygrid.pairs(a, b, species=both, interactions=table, backend="cpu"), across
    )
    with pytest.raises(lazygrid.InputError, match=r"in the second set, .*species=\(") as refused:
        detector.pairs(a, b, species=(of_a, None))
    assert refused.value.second
    with pytest.raises(lazygrid.InputError, match="in the second set, species id 7 of sphere 4") as refused:
        of_b[4] = 7
        detector.count(a, b, species=both)
    assert (refused.value.index, refused.value.value, refused.value.second) == (4, 7, True)


def test_errors_name_the_second_set(spheres: Rows) -> None:
    detector = Detector(backend="cpu")
    bad = spheres.copy()
    bad[17, 2] = np.nan
    with pytest.raises(lazygrid.InputError, match="^in the second set, sphere 17") as refused:
        detector.pairs(spheres, bad)
    assert (refused.value.index, refused.value.count, refused.value.second) == (17, 1, True)
    with pytest.raises(lazygrid.InputError, match="^sphere 17") as refused:
        detector.pairs(bad, spheres)
    assert not refused.value.second
    with pytest.raises(lazygrid.InputError, match="in the second set, sphere 17"):
        next(detector.stream(spheres, bad))
    with pytest.raises(TypeError, match="`second` has values of type int64"):
        detector.count(spheres, spheres.astype(np.int64))
    with pytest.raises(TypeError, match=r"`second\[1\]` has values of type float16"):
        detector.count(spheres, (bad[:, 0], np.zeros(200, np.float16), bad[:, 2], bad[:, 3]))
    with pytest.raises(lazygrid.InputError, match=r"`spheres` has shape \(200, 3\) where \(n, 4\)"):
        detector.pairs(spheres[:, :3], spheres)
    with pytest.raises(lazygrid.InputError, match="in the second set, `z` has 1 values"):
        two = np.zeros(2, np.float32)
        detector.pairs(spheres, (two, two, two[:1], two))
    with pytest.raises(lazygrid.SettingError, match="chunk = 0"):
        detector.stream(spheres, spheres, chunk=0)


def test_labels_of_two_sets_are_a_tuple_of_two(spheres: Rows) -> None:
    detector, ids = Detector(backend="cpu"), np.zeros(200, np.uint32)
    for wrong in (ids, [ids, ids], (ids,), (ids, ids, ids)):
        with pytest.raises(TypeError, match="`groups` must be a tuple of two, one for each set"):
            detector.pairs(spheres, spheres, groups=wrong)
    with pytest.raises(lazygrid.InputError, match=r"`groups\[1\]` has shape \(1, 2\)"):
        detector.count(spheres, spheres, groups=(None, [[1, 2]]))
    with pytest.raises(lazygrid.InputError, match=r"`groups\[1\]` has -3 at index 0"):
        detector.count(spheres, spheres, groups=(None, [-3] * 200))
    with pytest.raises(lazygrid.InputError, match=r"`groups` has shape \(2, 200\) where \(n,\)"):
        detector.count(spheres, groups=(ids, ids))
    with pytest.raises(lazygrid.InputError, match="`groups` is not an array"):
        detector.count(spheres, groups=(ids, ids[:3]))
    # The second and third arguments of other searches.
    with pytest.raises(lazygrid.InputError, match=r"`second` has shape \(200,\) where \(n, 4\)"):
        detector.pairs(spheres, ids)
    with pytest.raises(TypeError, match="positional"):
        detector.stream(spheres, spheres, 100)  # type: ignore[call-arg]


def test_a_gpu_says_the_same() -> None:
    detector = on_gpu(lambda: Detector(backend="gpu", algorithm="cell-list", skin=0.3))
    hasty, many = Detector(backend="gpu", timeout=1e-9), scene(1, 100_000)
    with pytest.raises(lazygrid.Error, match="did not finish within 0.000000001 seconds"):
        # On a busy machine a search may end before the wait for it begins.
        for _ in range(20):
            hasty.count(many)
    a, b = scene(11, 900, box=5.0), scene(12, 400, box=5.0)
    expected = brute_force_across(a, b)
    np.testing.assert_array_equal(detector.pairs(a, b), expected)
    assert detector.count(a, b) == len(expected)
    ages = []
    for _ in range(4):
        np.testing.assert_array_equal(detector.pairs(a), brute_force(a))
        candidates = detector.report["candidates"]
        assert candidates is not None
        ages.append(candidates["age"])
        a[:, :3] += np.float32(0.01)
    assert ages == [0, 1, 2, 3]


def test_out_and_limits(spheres: Rows) -> None:
    detector = Detector(backend="cpu", max_pairs=10_000)
    expected = brute_force_across(spheres, spheres)
    out = np.full((len(expected) + 5, 2), 7, dtype=np.uint32)
    found = detector.pairs(spheres, spheres, out=out)
    assert found.base is out and (out[len(expected) :] == 7).all()
    np.testing.assert_array_equal(found, expected)
    points = np.zeros((200, 4), dtype=np.float32)
    with pytest.raises(lazygrid.TooManyPairs) as refused:
        detector.pairs(points, points)
    assert (refused.value.found, refused.value.limit) == (40_000, 10_000)
    assert detector.count(points, points) == 40_000


def test_a_stream_is_of_the_spheres_that_were_given() -> None:
    a, b = np.zeros((300, 4), dtype=np.float32), np.zeros((200, 4), dtype=np.float32)
    detector = Detector(backend="cpu", order="unordered")
    total = 0
    for chunk in detector.stream(a, b, chunk=100):
        a[:] = b[:] = np.nan
        total += len(chunk)
    assert total == 60_000


SEARCHES: list[Callable[[Detector, Rows], Any]] = [
    lambda detector, rows: detector.pairs(rows).tobytes(),
    lambda detector, rows: [part.tobytes() for part in detector.neighbors(rows)],
    lambda detector, rows: detector.count(rows),
    lambda detector, rows: [chunk.tobytes() for chunk in detector.stream(rows, chunk=100)],
]


@pytest.mark.parametrize("skin", ["auto", 0.1])
def test_a_skin_never_changes_an_answer(skin: Skin) -> None:
    kept, plain = Detector(backend="cpu", skin=skin), Detector(backend="cpu", skin="off")
    rows, random, served = scene(5, 3000, box=12.0), np.random.default_rng(6), 0
    for step in range(16):
        search = SEARCHES[step % len(SEARCHES)]
        assert search(kept, rows) == search(plain, rows)
        assert plain.report["candidates"] is None
        candidates = kept.report["candidates"]
        if candidates is not None:
            served += candidates["rebuilt"] is None
            assert candidates["count"] >= kept.report["pairs"] and 0 <= candidates["displacement_fraction"] <= 1
        rows[:, :3] += random.uniform(-0.003, 0.003, (len(rows), 3)).astype(np.float32)
    assert served > 0 or skin == "auto"


@pytest.mark.parametrize("skin", [0, -1.0, 1e-20, 1e300, float("nan"), "none", "Auto"])
def test_skins_are_refused_by_value(skin: Any) -> None:
    with pytest.raises(lazygrid.SettingError, match="skin = |unknown skin"):
        Detector(backend="cpu", skin=skin)


@pytest.mark.parametrize("skin", [True, (1.0,), b"off"])
def test_an_invalid_skin_is_a_type_error(skin: Any) -> None:
    with pytest.raises(TypeError, match="a skin is"):
        Detector(backend="cpu", skin=skin)


def test_a_fixed_skin_needs_an_algorithm_that_keeps_candidates() -> None:
    with pytest.raises(lazygrid.SettingError, match="skin = 0.1"):
        Detector(backend="cpu", algorithm="naive", skin=0.1)
