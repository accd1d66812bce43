"""Pairs between two sets, and skins, against the definition and against searches of one set."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pytest
from conftest import Rows, brute_force, scene

import lazygrid
from lazygrid import Detector, Interactions
from lazygrid.types import Skin

Box = tuple[float | None, float | None, float | None]
OPEN: Box = (None, None, None)


def brute_force_between(a: Rows, b: Rows, periodic: Box = OPEN) -> npt.NDArray[np.uint32]:
    """All pairs of one of each by the definition, in float64, in canonical order."""
    first, second = a.astype(np.float64), b.astype(np.float64)
    difference = first[:, None, :3] - second[None, :, :3]
    for axis, length in enumerate(periodic):
        if length is not None:
            difference[..., axis] -= length * np.round(difference[..., axis] / length)
    reach = first[:, None, 3] + second[None, :, 3]
    return np.argwhere((difference**2).sum(axis=2) <= reach**2).astype(np.uint32)


@pytest.mark.parametrize("algorithm", ["auto", "naive", "cell-list"])
@pytest.mark.parametrize("periodic", [OPEN, (4.0, 4.0, None)])
@pytest.mark.parametrize("order", ["canonical", "unordered"])
def test_each_result_is_that_of_the_definition(
    algorithm: Literal["auto", "naive", "cell-list"], periodic: Box, order: Literal["canonical", "unordered"]
) -> None:
    detector = Detector(backend="cpu", algorithm=algorithm, periodic=periodic, order=order)
    for seed, (n, m) in enumerate([(300, 200), (1, 400), (0, 5), (5, 0), (900, 900)]):
        a, b = scene(seed, n, box=4.0), scene(seed + 50, m, box=4.0)
        expected = brute_force_between(a, b, periodic)
        found = detector.between(a, b)
        assert found.dtype == np.uint32 and found.shape == expected.shape
        assert detector.report["spheres"] == n + m and detector.report["pairs"] == len(expected)
        chunks = list(detector.stream_between(a, b, 64))
        assert all(len(chunk) <= 64 for chunk in chunks)
        streamed = np.concatenate([np.empty((0, 2), np.uint32), *chunks])
        if order == "unordered":
            found, streamed = (pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))] for pairs in (found, streamed))
        np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(streamed, expected)
        assert detector.count_between(a, tuple(b.T)) == len(expected)
        offsets, indices = detector.neighbors_between(a, b)
        assert offsets.dtype == np.uint64 and indices.dtype == np.uint32 and len(offsets) == n + 1
        of = np.repeat(np.arange(n), (offsets[1:] - offsets[:-1]).astype(np.int64))
        np.testing.assert_array_equal(np.column_stack([of, indices]), expected)


def test_one_set_of_both_says_the_same() -> None:
    rows, split = scene(3, 1500, box=6.0), 600
    species = np.arange(len(rows), dtype=np.uint32) % 3
    table = Interactions(3, "touch")
    table[0, 0], table[0, 1] = None, 0.4
    detector = Detector(backend="cpu", interactions=table)
    pairs = detector.pairs(rows, species)
    across = pairs[(pairs[:, 0] < split) & (pairs[:, 1] >= split)] - np.array([0, split], np.uint32)
    a, b, of_a, of_b = rows[:split], rows[split:], species[:split], species[split:]
    np.testing.assert_array_equal(detector.between(a, b, of_a, of_b), across)
    assert len(across) > 100
    assert detector.count_between(a, b, of_a, of_b) == len(across)
    assert len(detector.neighbors_between(a, b, of_a, of_b)[1]) == len(across)
    assert sum(map(len, detector.stream_between(a, b, 100, of_a, of_b))) == len(across)
    with pytest.raises(lazygrid.InputError, match="of the second set, .*species_b=") as refused:
        detector.between(a, b, of_a)
    assert refused.value.second
    with pytest.raises(lazygrid.InputError, match="of the second set, species id 7 of sphere 4") as refused:
        of_b[4] = 7
        detector.count_between(a, b, of_a, of_b)
    assert (refused.value.index, refused.value.value, refused.value.second) == (4, 7, True)


def test_errors_name_the_second_set(spheres: Rows) -> None:
    detector = Detector(backend="cpu")
    bad = spheres.copy()
    bad[17, 2] = np.nan
    with pytest.raises(lazygrid.InputError, match="^of the second set, sphere 17") as refused:
        detector.between(spheres, bad)
    assert (refused.value.index, refused.value.count, refused.value.second) == (17, 1, True)
    with pytest.raises(lazygrid.InputError, match="^sphere 17") as refused:
        detector.between(bad, spheres)
    assert not refused.value.second
    with pytest.raises(lazygrid.InputError, match="of the second set, sphere 17"):
        next(detector.stream_between(spheres, bad))
    with pytest.raises(TypeError, match="`b` has values of type float64"):
        detector.count_between(spheres, spheres.astype(np.float64))
    with pytest.raises(TypeError, match=r"`b\[1\]` has values of type float64"):
        detector.count_between(spheres, (bad[:, 0], np.zeros(200), bad[:, 2], bad[:, 3]))
    with pytest.raises(lazygrid.InputError, match="`a` has 3 columns"):
        detector.between(spheres[:, :3], spheres)
    with pytest.raises(lazygrid.InputError, match="of the second set, `z` has 1 values"):
        two = np.zeros(2, np.float32)
        detector.between(spheres, (two, two, two[:1], two))
    with pytest.raises(lazygrid.SettingError, match="chunk = 0"):
        detector.stream_between(spheres, spheres, 0)
    with pytest.raises(lazygrid.SettingError, match="hash-grid"):
        Detector(backend="cpu", algorithm="hash-grid").between(spheres, spheres)


def test_a_gpu_says_the_same() -> None:
    try:
        detector = Detector(backend="gpu", algorithm="cell-list", skin=0.3)
    except lazygrid.Error as error:
        assert "LAZYGRID_REQUIRE_GPU" not in os.environ, error
        pytest.skip(f"no GPU: {error}")
    a, b = scene(11, 900, box=5.0), scene(12, 400, box=5.0)
    expected = brute_force_between(a, b)
    np.testing.assert_array_equal(detector.between(a, b), expected)
    assert detector.count_between(a, b) == len(expected)
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
    expected = brute_force_between(spheres, spheres)
    out = np.full((len(expected) + 5, 2), 7, dtype=np.uint32)
    found = detector.between(spheres, spheres, out=out)
    assert found.base is out and (out[len(expected) :] == 7).all()
    np.testing.assert_array_equal(found, expected)
    points = np.zeros((200, 4), dtype=np.float32)
    with pytest.raises(lazygrid.TooManyPairs) as refused:
        detector.between(points, points)
    assert (refused.value.found, refused.value.limit) == (40_000, 10_000)
    assert detector.count_between(points, points) == 40_000


def test_a_stream_is_of_the_spheres_that_were_given() -> None:
    a, b = np.zeros((300, 4), dtype=np.float32), np.zeros((200, 4), dtype=np.float32)
    detector = Detector(backend="cpu", order="unordered")
    total = 0
    for chunk in detector.stream_between(a, b, 100):
        a[:] = b[:] = np.nan
        total += len(chunk)
    assert total == 60_000


SEARCHES: list[Callable[[Detector, Rows], Any]] = [
    lambda detector, rows: detector.pairs(rows).tobytes(),
    lambda detector, rows: [part.tobytes() for part in detector.neighbors(rows)],
    lambda detector, rows: detector.count(rows),
    lambda detector, rows: [chunk.tobytes() for chunk in detector.stream(rows, 100)],
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
            assert candidates["count"] >= kept.report["pairs"] and 0 <= candidates["moved"] <= 1
        rows[:, :3] += random.uniform(-0.003, 0.003, (len(rows), 3)).astype(np.float32)
    assert served > 0 or skin == "auto"


@pytest.mark.parametrize("skin", [0, -1.0, 1e-20, 1e300, float("nan"), "none", "Auto"])
def test_skins_are_refused_by_value(skin: Any) -> None:
    with pytest.raises(lazygrid.SettingError, match="skin = |unknown skin"):
        Detector(backend="cpu", skin=skin)


@pytest.mark.parametrize("skin", [True, (1.0,), b"off"])
def test_what_is_no_skin_is_a_type_error(skin: Any) -> None:
    with pytest.raises(TypeError, match="a skin is"):
        Detector(backend="cpu", skin=skin)


def test_a_fixed_skin_needs_an_algorithm_that_keeps_candidates() -> None:
    with pytest.raises(lazygrid.SettingError, match="skin = 0.1"):
        Detector(backend="cpu", algorithm="naive", skin=0.1)
