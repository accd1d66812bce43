"""The class Detector against the definition of pairs, and its errors."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
import pytest
from conftest import Rows, brute_force, brute_force_of_edges, scene
from hypothesis import given
from hypothesis import strategies as some
from hypothesis.extra.numpy import arrays
from scipy.spatial import cKDTree

import lazygrid
from lazygrid import Detector, Interactions

CPU = ["naive", "hash-grid", "array-grid", "recursive-grid", "cell-list"]

COORDINATES = some.floats(-8, 8, width=32)
ROWS = some.integers(0, 24).flatmap(
    lambda n: arrays(np.float32, (n, 4), elements=COORDINATES).map(
        lambda rows: np.abs(rows) * [1, 1, 1, 0.2] * [1, -1, 1, 1]
    )
).map(lambda rows: np.ascontiguousarray(rows, dtype=np.float32))


@pytest.mark.parametrize("algorithm", CPU)
def test_pairs_are_those_of_the_definition(spheres: Rows, algorithm: str) -> None:
    detector = Detector(backend="cpu", algorithm=algorithm)  # type: ignore[arg-type]
    found = detector.pairs(spheres)
    assert found.dtype == np.uint32 and found.shape[1] == 2
    assert len(found) > 20
    np.testing.assert_array_equal(found, brute_force(spheres))
    assert detector.report["algorithm"] == algorithm
    assert detector.report["pairs"] == len(found)


@given(rows=ROWS)
def test_any_spheres(rows: Rows) -> None:
    detector = Detector(backend="cpu")
    expected = brute_force(rows)
    np.testing.assert_array_equal(detector.pairs(rows), expected)
    np.testing.assert_array_equal(detector.pairs(tuple(rows.T.copy())), expected)
    assert detector.count(rows) == len(expected)


@given(rows=ROWS, lengths=some.tuples(*[some.none() | some.floats(0.5, 20, width=32)] * 3))
def test_any_periodic_box(rows: Rows, lengths: tuple[float | None, float | None, float | None]) -> None:
    found = Detector(backend="cpu", periodic=lengths).pairs(rows)
    np.testing.assert_array_equal(found, brute_force(rows, lengths))


def test_subnormal_gaps_across_a_boundary_count() -> None:
    for z, touches in (1.0, False), (1e-45, True):
        rows = np.array([[0, 0, z, 0], [0, 0, 1e-45, 0]], dtype=np.float32)
        found = Detector(backend="cpu", periodic=(None, None, 1)).pairs(rows)
        assert len(found) == len(brute_force(rows, (None, None, 1.0))) == touches


def test_boxes_that_lean() -> None:
    rows = scene(4, 300, box=5.0)
    edges = np.array([[5.0, 0.0, 0.0], [2.0, 5.0, 0.0], [-1.5, 2.5, 4.0]])
    expected = brute_force_of_edges(rows, edges)
    assert len(expected) != len(brute_force(rows, (5.0, 5.0, 4.0)))
    np.testing.assert_array_equal(Detector(backend="cpu", periodic=edges).pairs(rows), expected)
    np.testing.assert_array_equal(Detector(backend="cpu", periodic=edges.tolist()).pairs(rows), expected)
    slab = Detector(backend="cpu", periodic=((5.0, 0.0, 0.0), (2.0, 5.0, 0.0), None)).pairs(rows)
    flat = brute_force_of_edges(rows, edges * [[1], [1], [1e6]])
    np.testing.assert_array_equal(slab, flat)
    with pytest.raises(lazygrid.InputError, match="cell vectors .*must be finite and independent"):
        Detector(periodic=((1.0, 1.0, 0.0), (2.0, 2.0, 0.0), None))


class ByDlpack:
    """An array of another library, with DLPack and without NumPy's protocols."""

    def __init__(self, array: npt.NDArray[np.float32]) -> None:
        self.array = array

    def __dlpack__(self, **how: object) -> object:
        return self.array.__dlpack__()

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.array.__dlpack_device__()


def test_arrays_by_dlpack_are_read_where_they_lie(spheres: Rows) -> None:
    from lazygrid import _arrays

    given = ByDlpack(spheres)
    assert np.shares_memory(_arrays.floats(given, "spheres", 4), spheres)
    found = Detector(backend="cpu").pairs(given)  # type: ignore[arg-type]
    np.testing.assert_array_equal(found, brute_force(spheres))


@pytest.mark.parametrize("seed", range(3))
def test_the_tree_of_scipy_finds_the_same(seed: int) -> None:
    points = scene(seed, 5000)[:, :3]
    pairs = cKDTree(points.astype(np.float64)).query_pairs(0.25, output_type="ndarray")
    pairs = np.sort(pairs, axis=1)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    np.testing.assert_array_equal(lazygrid.pairs((points, 0.125), backend="cpu"), pairs)


def test_neighbors_have_every_pair_twice(spheres: Rows) -> None:
    detector = Detector(backend="cpu")
    offsets, indices = detector.neighbors(spheres)
    assert offsets.dtype == np.uint64 and indices.dtype == np.uint32
    of = np.repeat(np.arange(len(spheres)), (offsets[1:] - offsets[:-1]).astype(np.int64))
    both = np.column_stack([of, indices])
    np.testing.assert_array_equal(both[both[:, 0] < both[:, 1]], brute_force(spheres))
    assert len(both) == 2 * len(brute_force(spheres))


def test_no_sphere_and_one() -> None:
    detector = Detector(backend="cpu")
    for count in (0, 1):
        rows = np.zeros((count, 4), dtype=np.float32)
        assert detector.pairs(rows).shape == (0, 2)
        assert detector.neighbors(rows)[0].tolist() == [0] * (count + 1)
        assert detector.count(rows) == 0
        assert list(detector.stream(rows)) == []


def test_out_is_written_and_never_overrun(spheres: Rows) -> None:
    detector = Detector(backend="cpu")
    expected = brute_force(spheres)
    out = np.full((len(expected) + 5, 2), 7, dtype=np.uint32)
    found = detector.pairs(spheres, out=out)
    assert found.base is out
    np.testing.assert_array_equal(found, expected)
    assert (out[len(expected) :] == 7).all()
    small = np.full((3, 2), 7, dtype=np.uint32)
    with pytest.raises(lazygrid.TooManyPairs, match="room for 3 pairs") as refused:
        detector.pairs(spheres, out=small)
    assert (refused.value.found, refused.value.limit) == (len(expected), 3)
    assert (small == 7).all()
    out.flags.writeable = False
    for wrong in (out, out.astype(np.int64), np.zeros(8, np.uint32), np.zeros((9, 3), np.uint32)):
        with pytest.raises(lazygrid.InputError, match="`out` must be"):
            detector.pairs(spheres, out=wrong)  # type: ignore[arg-type]


def test_errors_name_index_and_value(spheres: Rows) -> None:
    detector = Detector(backend="cpu")
    spheres[17, 2], spheres[30, 3] = np.nan, -1
    with pytest.raises(lazygrid.InputError, match="sphere 17 .* 2 of 200") as refused:
        detector.pairs(spheres)
    assert isinstance(refused.value, ValueError) and isinstance(refused.value, lazygrid.Error)
    assert (refused.value.index, refused.value.count) == (17, 2)
    assert isinstance(refused.value.value, list) and np.isnan(refused.value.value[2])


def test_too_many_pairs_are_an_error_with_their_number() -> None:
    rows = np.zeros((100, 4), dtype=np.float32)
    detector = Detector(backend="cpu", max_pairs=10)
    with pytest.raises(lazygrid.TooManyPairs) as refused:
        detector.pairs(rows)
    assert (refused.value.found, refused.value.limit) == (4950, 10)
    assert detector.count(rows) == 4950
    assert sum(map(len, detector.stream(rows, chunk=7))) == 4950


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"backend": "CPU"}, "unknown backend 'CPU'; expected one of auto, cpu, gpu"),
        ({"algorithm": "octree"}, "unknown algorithm 'octree'"),
        ({"order": "sorted"}, "unknown order 'sorted'"),
        ({"threads": 0}, "threads = 0 is out of range"),
        ({"threads": -1}, "threads = -1 is out of range; choose at least one, or leave it unset"),
        ({"max_pairs": -1}, "max_pairs = -1 is out of range"),
        ({"max_pairs": 2**64}, "max_pairs = 18446744073709551616 is out of range"),
        ({"periodic": (1.0, -2.0, None)}, "length -2 of the periodic axis y"),
        ({"periodic": (1, 10**400, 1)}, "a number along y that exceeds float64"),
        ({"periodic": ((1, 0, 0), (0, 10**400, 0), None)}, "a number along y that exceeds float64"),
        ({"periodic": ((1, 0), (0, 1), None)}, r"has \(1, 0\) along x; a cell vector has three numbers"),
        ({"adapter": -1}, "adapter = -1 is out of range; give an index"),
        ({"skin": 0.0}, "skin = 0 is out of range; choose auto, off, or a distance"),
        ({"skin": 1.0, "algorithm": "naive"}, "skin = 1 is out of range; only the algorithms auto and cell-list"),
        ({"skin": 1.0, "algorithm": "array-grid", "backend": "auto"}, "only the algorithms auto and cell-list"),
        ({"backend": "cpu", "algorithm": "lazy-grid"}, "lazy-grid does not run on the cpu backend"),
        ({"backend": "cpu", "adapter": "nvidia"}, "omit one of them"),
        ({"backend": "cpu", "timeout": 1.0}, "timeout limits searches on a GPU.*omit one of them"),
        ({"timeout": 0}, "timeout = 0 is out of range"),
        ({"timeout": -1.5}, "timeout = -1.5 is out of range"),
        ({"timeout": float("nan")}, "timeout = NaN is out of range"),
    ],
)
def test_settings_are_refused_by_value(keywords: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message) as refused:
        Detector(**keywords)  # type: ignore[arg-type]
    assert isinstance(refused.value, lazygrid.Error)


REENTRANT = """
import lazygrid

table = lazygrid.Interactions(2)

class InputError(lazygrid.InputError):
    def __init__(self, message):
        super().__init__(message)
        table[0, 1] = 0.5

lazygrid._errors.InputError = InputError
for use in (lambda: table[0, 2], lambda: table.__setitem__((0, 2), 1.0)):
    try:
        use()
    except InputError:
        pass
assert table[0, 1] == 0.5
"""


def test_exceptions_of_interactions_may_use_the_table() -> None:
    # With the table locked it would wait for ever.
    subprocess.run([sys.executable, "-c", REENTRANT], check=True, timeout=600)


def test_interactions_say_which_species_pair(spheres: Rows) -> None:
    table = Interactions(3)
    table[0, 1] = 0.5
    table[2, 2] = "touch"
    assert (table[1, 0], table[2, 2], table[0, 0], table.species) == (0.5, "touch", None, 3)
    species = np.arange(len(spheres), dtype=np.uint32) % 3
    found = Detector(backend="cpu", interactions=table).pairs(spheres, species=species)
    points = spheres.copy()
    points[:, 3] = 0.25
    within = brute_force(points)
    kinds = np.sort(species[within], axis=1)
    touching = brute_force(spheres)
    both = np.concatenate([within[(kinds == [0, 1]).all(axis=1)], touching[(species[touching] == 2).all(axis=1)]])
    np.testing.assert_array_equal(found, both[np.lexsort((both[:, 1], both[:, 0]))])
    with pytest.raises(lazygrid.InputError, match="species="):
        Detector(backend="cpu", interactions=table).pairs(spheres)
    with pytest.raises(lazygrid.InputError, match="species id 3 of sphere 5") as refused:
        species[5] = 3
        Detector(backend="cpu", interactions=table).pairs(spheres, species=species)
    assert (refused.value.index, refused.value.value) == (5, 3)
    with pytest.raises(lazygrid.InputError, match="-1 at index 1"):
        Detector(backend="cpu", interactions=table).pairs(spheres[:2], species=[0, -1])
    with pytest.raises(lazygrid.InputError):
        table[0, 3] = None
    with pytest.raises(lazygrid.InputError, match="finite and not negative"):
        table[0, 0] = -1.0


def test_a_stream_has_all_pairs_in_chunks() -> None:
    rows = scene(4, 3000, largest=1.0)
    expected = Detector(backend="cpu").pairs(rows)
    chunks = list(Detector(backend="cpu").stream(rows, chunk=1000))
    assert all(len(chunk) == 1000 for chunk in chunks[:-1])
    np.testing.assert_array_equal(np.concatenate(chunks), expected)
    unordered = np.concatenate(list(Detector(backend="cpu", order="unordered").stream(rows, chunk=1000)))
    np.testing.assert_array_equal(unordered[np.lexsort((unordered[:, 1], unordered[:, 0]))], expected)


def test_a_stream_is_of_the_spheres_that_were_given() -> None:
    rows = np.zeros((300, 4), dtype=np.float32)
    detector = Detector(backend="cpu", order="unordered")
    total = 0
    for chunk in detector.stream(rows, chunk=100):
        rows[:] = np.nan
        total += len(chunk)
        # The detector may be called meanwhile.
        assert detector.count(np.zeros((2, 4), dtype=np.float32)) == 1
    assert total == 300 * 299 // 2


def test_a_stream_may_be_left() -> None:
    rows = np.zeros((3000, 4), dtype=np.float32)
    detector = Detector(backend="cpu")
    with detector.stream(rows, chunk=10) as chunks:
        assert len(next(chunks)) == 10
    assert list(chunks) == []
    left = detector.stream(rows, chunk=10)
    next(left)
    del left
    assert detector.count(rows) == 3000 * 2999 // 2
    with pytest.raises(lazygrid.SettingError, match="chunk = 0"):
        detector.stream(rows, chunk=0)
    with pytest.raises(lazygrid.InputError, match="sphere 0"):
        next(detector.stream(np.full((1, 4), np.nan, dtype=np.float32)))


def test_threads_share_a_detector() -> None:
    detector = Detector(backend="cpu")
    scenes = [scene(seed, 2000) for seed in range(8)]
    barrier = threading.Barrier(4)

    def count(rows: Rows) -> int:
        barrier.wait()
        return len(detector.pairs(rows))

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(count, scenes))
    assert found == [detector.count(rows) for rows in scenes]


def test_threads_do_not_change_the_bytes() -> None:
    rows = scene(9, 40_000, box=30.0)
    one = Detector(backend="cpu", threads=1).pairs(rows)
    two = Detector(backend="cpu", threads=2).pairs(rows)
    assert one.tobytes() == two.tobytes()


def test_report_during_a_search_is_that_of_the_last_finished_call() -> None:
    detector = lazygrid.Detector(backend="cpu", algorithm="naive", threads=1)
    assert detector.count(scene(1, 50)) == detector.report["pairs"]
    worker = threading.Thread(target=detector.count, args=(scene(2, 60_000, box=1e3),))
    worker.start()
    seen = set()
    while worker.is_alive():
        seen.add(detector.report["spheres"])
    worker.join()
    assert 50 in seen and seen <= {50, 60_000}
    assert detector.report["spheres"] == 60_000
    detector.memory_for(10)
    assert detector.report["spheres"] == 60_000


def test_report_and_memory() -> None:
    detector = Detector(backend="cpu")
    assert detector.report["spheres"] == 0
    assert detector.memory_for(1_000_000) > 16_000_000
    detector.count(scene(2, 100))
    report = detector.report
    assert (report["spheres"], report["backend"], report["adapter"], report["gpu"]) == (100, "cpu", None, None)
    assert "search" in report["phases"] and all(seconds >= 0 for seconds in report["phases"].values())
    assert repr(detector) == "<lazygrid.Detector: naive on cpu>"
