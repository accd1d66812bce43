"""Forms, types and layouts of the arrays of spheres."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from conftest import Doubles, Rows, brute_force, brute_force_across, scene
from hypothesis import given
from hypothesis import strategies as some

import lazygrid
from lazygrid import Detector, Interactions, _arrays
from lazygrid.types import Algorithm, Skin

ALGORITHMS: list[Algorithm] = ["auto", "cell-list"]
SKINS: list[Skin] = ["off", 0.1]
KINDS = [np.float32, np.float64]
COPIES = ["floats", "radii", "widened", "in_one_piece"]


@pytest.fixture
def in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes every conversion fail, so that only arrays that are read in place can be searched."""

    def refuse(*given: Any) -> None:
        raise AssertionError(f"converted: {given[1:]}")

    for name in COPIES:
        monkeypatch.setattr(_arrays, name, refuse)


def doubles(seed: int, count: int, offset: float = 0.0) -> Doubles:
    """Spheres with numbers that float32 does not hold."""
    rows = scene(seed, count, box=4.0).astype(np.float64)
    rows += np.random.default_rng(seed + 1000).uniform(0, 1e-9, rows.shape)
    rows[:, :3] += offset
    return rows


def read_only(array: Any) -> Any:
    array = array.copy()
    array.flags.writeable = False
    return array


def fields(rows: Any) -> Any:
    """A structured array with other values among the spheres."""
    names = [("id", "u8"), *((name, rows.dtype.type) for name in "xyzr"), ("mass", rows.dtype.type)]
    array = np.zeros(len(rows), np.dtype(names, align=True))
    for column, name in enumerate("xyzr"):
        array[name] = rows[:, column]
    return array


def layouts(rows: Any) -> dict[str, Any]:
    """The spheres in all forms and layouts that are read in place."""
    wide = np.full((len(rows), 9), np.nan, rows.dtype)
    wide[:, 2:6] = rows
    apart = np.full((3 * len(rows), 4), np.nan, rows.dtype)
    apart[::3] = rows
    columns = np.full((6, len(rows)), np.nan, rows.dtype)
    columns[1:5] = rows.T
    named = fields(rows)
    return {
        "rows": rows,
        "read-only": read_only(rows),
        "fortran": np.asfortranarray(rows),
        "columns of a larger array": wide[:, 2:6],
        "every third row": apart[::3],
        "transposed": columns[1:5].T,
        "four columns": tuple(columns[1:5]),
        "four strided columns": tuple(wide.T[2:6]),
        "radii with their own stride": (*rows.T[:3], rows[:, 3].copy()),
        "fields": tuple(named[name] for name in "xyzr"),
        "points": (rows[:, :3].copy(), rows[:, 3].copy()),
        "points and radii of rows": (rows[:, :3], rows[:, 3]),
        "fortran points": (np.asfortranarray(rows[:, :3]), rows[:, 3]),
        "read-only points": (read_only(rows[:, :3]), read_only(rows[:, 3])),
    }


@pytest.mark.usefixtures("in_place")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", layouts(np.zeros((1, 4))))
def test_arrays_are_read_where_they_lie(name: str, kind: Any) -> None:
    for count in (0, 1, 2, 300):
        rows = doubles(1, count).astype(kind)
        spheres, expected = layouts(rows)[name], brute_force(rows)
        for algorithm in ALGORITHMS:
            detector = Detector(backend="cpu", algorithm=algorithm)
            np.testing.assert_array_equal(detector.pairs(spheres), expected)
            assert detector.count(spheres) == len(expected)
            assert len(detector.neighbors(spheres)[1]) == 2 * len(expected)
            chunks = list(detector.stream(spheres, chunk=7))
            np.testing.assert_array_equal(
                np.concatenate([np.empty((0, 2), np.uint32), *chunks]), expected
            )
            across = brute_force_across(rows, rows)
            np.testing.assert_array_equal(detector.pairs(spheres, rows), across)
            np.testing.assert_array_equal(detector.pairs(rows, spheres), across)
    assert len(expected) > 20


@pytest.mark.usefixtures("in_place")
@pytest.mark.parametrize("kind", KINDS)
def test_broadcast_arrays_are_read_where_they_lie(kind: Any) -> None:
    one = np.array([1, 2, 3, 0.5], kind)
    assert len(Detector(backend="cpu").pairs(np.broadcast_to(one, (10, 4)))) == 45
    rows = doubles(5, 100).astype(kind)
    rows[:, 3] = 0.3
    radii = np.broadcast_to(kind(0.3), (100,))
    np.testing.assert_array_equal(Detector(backend="cpu").pairs((rows[:, :3], radii)), brute_force(rows))


@pytest.mark.parametrize("kind", KINDS)
def test_other_layouts_are_copied(kind: Any) -> None:
    detector, rows = Detector(backend="cpu"), doubles(2, 300).astype(kind)
    expected = brute_force(rows)
    unaligned = np.frombuffer(b"\0" + rows.tobytes(), dtype=kind, offset=1).reshape(-1, 4)
    packed = np.zeros(300, [("id", "u1"), *((name, kind) for name in "xyzr")])
    for column, name in enumerate("xyzr"):
        packed[name] = rows[:, column]
    x, y, z, r = rows.T
    backwards = rows[::-1].copy()[::-1]
    for spheres in (
        unaligned,
        backwards,
        rows[:, ::-1].copy()[:, ::-1],
        tuple(packed[name] for name in "xyzr"),
        (x.copy(), y, z.copy(), r),
        (backwards[:, :3], backwards[:, 3]),
        (x, y, z, r.tolist()),
        rows.tolist() if kind is np.float64 else rows,
        memoryview(rows),  # type: ignore[arg-type]
    ):
        np.testing.assert_array_equal(detector.pairs(spheres), expected)


def test_of_two_types_float32_is_widened() -> None:
    rows = doubles(3, 300)
    narrow = rows.astype(np.float32)
    detector = Detector(backend="cpu")
    mixed = narrow.astype(np.float64)
    mixed[:, 1] = rows[:, 1]
    columns = (narrow[:, 0], rows[:, 1], narrow[:, 2], narrow[:, 3])
    np.testing.assert_array_equal(detector.pairs(columns), brute_force(mixed))
    mixed = narrow.astype(np.float64)
    mixed[:, 3] = rows[:, 3]
    np.testing.assert_array_equal(detector.pairs((narrow[:, :3], rows[:, 3])), brute_force(mixed))
    np.testing.assert_array_equal(detector.pairs(rows, narrow), brute_force_across(rows, narrow))
    np.testing.assert_array_equal(detector.pairs(narrow, rows), brute_force_across(narrow, rows))


def test_points_may_have_one_radius() -> None:
    detector, rows = Detector(backend="cpu"), scene(4, 500)
    for radius in (0.25, 0.1, 0, 1, np.float32(0.1), np.float64(0.1), np.int64(1), np.array(0.1), math.inf):
        for points in (rows[:, :3], rows[:, :3].astype(np.float64)):
            if radius == math.inf:
                with pytest.raises(lazygrid.InputError, match="radius inf"):
                    detector.pairs((points, radius))
                continue
            wide = rows.astype(np.float64)
            wide[:, 3] = radius
            np.testing.assert_array_equal(detector.pairs((points, radius)), brute_force(wide))
    # One number of float64 is not rounded to the type of the points.
    apart = np.array([[0, 0, 0], [2 * 0.1, 0, 0]])
    assert float(np.float32(0.2)) > 0.2 and detector.count((apart, 0.1)) == 1
    assert detector.count((apart.astype(np.float32), 0.1)) == 0
    assert detector.count((apart.astype(np.float32), np.float32(0.1))) == 1
    np.testing.assert_array_equal(
        lazygrid.pairs((rows[:, :3], rows[:, 3]), backend="cpu"), brute_force(rows)
    )


@pytest.mark.parametrize("offset", [0.0, 1e9, -1e12])
def test_no_number_is_rounded(offset: float) -> None:
    rows = doubles(6, 400, offset)
    detector = Detector(backend="cpu")
    np.testing.assert_array_equal(detector.pairs(rows), brute_force(rows))
    assert 20 < len(brute_force(rows)) < 5000
    # One unit in the last place apart, which float32 does not hold.
    two = np.array([[0.0, 0, 0, 0.5], [1.0, 0, 0, 0.5]])
    assert detector.count(two) == 1
    two[1, 0] = np.nextafter(1.0, 2.0)
    assert detector.count(two) == detector.count(two[:1], two[1:]) == 0
    two[1, 3] += 2.0**-52
    assert detector.count(two) == detector.count(two[:1], two[1:]) == len(list(detector.stream(two))) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_lengths_and_distances_are_not_rounded(kind: Any) -> None:
    length = 10.1
    assert float(np.float32(length)) != length
    two = np.array([[0.05, 0, 0, 0], [length - 0.05, 0, 0, 0]])
    away = Detector(backend="cpu", periodic=(length, None, None))
    exact = (two[1, 0] - two[0, 0]) - length
    for distance, pairs in ((-exact, 1), (np.nextafter(-exact, 0), 0)):
        table = Interactions(1, distance)
        assert table[0, 0] == distance
        detector = Detector(backend="cpu", interactions=table, periodic=(length, None, None))
        assert detector.count(two, species=[0, 0]) == pairs
    rows = scene(7, 400, box=length).astype(kind)
    box = (length, length, 7.7)
    expected = brute_force(rows, box)
    for skin in SKINS:
        detector = Detector(backend="cpu", periodic=box, skin=skin)
        np.testing.assert_array_equal(detector.pairs(rows), expected)
    assert away.count(two) == 0 and len(expected) > 20


@given(
    seed=some.integers(0, 1 << 30),
    count=some.integers(0, 60),
    exponent=some.integers(-200, 200),
    offset=some.sampled_from([0.0, 1.0, -1e7]),
    lengths=some.tuples(*[some.none() | some.floats(2, 20)] * 3),
)
def test_any_doubles(
    seed: int, count: int, exponent: int, offset: float, lengths: tuple[float | None, ...]
) -> None:
    random = np.random.default_rng(seed)
    rows = random.uniform(0, 4, (count, 4))
    # Half of them on a raster, so that some touch exactly.
    rows[::2] = np.round(rows[::2] * 4) / 4
    rows[:, 3] *= 0.2
    rows[:, :3] += offset
    scale = 2.0**exponent
    box: Any = tuple(None if length is None else length * scale for length in lengths)
    expected = brute_force(rows, lengths)
    found = Detector(backend="cpu", periodic=box).pairs(rows * scale)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("kind", "remedy"),
    [
        ("int64", r"numpy\.float64"),
        ("uint8", r"numpy\.float64"),
        ("float16", r"numpy\.float64"),
        ("longdouble", "which rounds"),
        (">f4", r"numpy\.float32"),
        (">f8", r"numpy\.float64"),
        ("complex128", "real numbers"),
        ("bool", "real numbers"),
        ("object", "real numbers"),
        ("U3", "real numbers"),
    ],
)
def test_other_types_are_refused_with_a_remedy(spheres: Rows, kind: str, remedy: str) -> None:
    detector, rows = Detector(backend="cpu"), np.round(spheres).astype(kind)
    name = np.dtype(kind).str if kind == "U3" else str(np.dtype(kind))
    said = f"has values of type {name}, and lazygrid reads float32 and float64.*{remedy}"
    with pytest.raises(TypeError, match=f"`spheres` {said}"):
        detector.pairs(rows)
    with pytest.raises(TypeError, match=rf"`spheres\[2\]` {said}"):
        detector.count((spheres[:, 0], spheres[:, 1], rows[:, 2], spheres[:, 3]))
    with pytest.raises(TypeError, match=rf"`spheres\[0\]` {said}"):
        detector.neighbors((rows[:, :3], 0.5))
    with pytest.raises(TypeError, match=rf"`second\[1\]` {said}"):
        detector.stream(spheres, (spheres[:, :3], rows[:, 3]))


def test_other_forms_are_refused(spheres: Rows) -> None:
    detector = Detector(backend="cpu")
    with pytest.raises(lazygrid.InputError, match=r"`spheres\[0\]` has shape \(2, 4\) where \(n,\)"):
        detector.pairs((np.zeros((2, 4), np.float32),) * 4)
    with pytest.raises(lazygrid.InputError, match=r"\(200, 3\) where \(n, 4\) .*\(positions, radii\)"):
        detector.pairs(spheres[:, :3])
    with pytest.raises(lazygrid.InputError, match=r"`spheres\[0\]` has shape \(200, 4\) where \(n, 3\)"):
        detector.pairs((spheres, 0.5))
    with pytest.raises(lazygrid.InputError, match=r"`spheres\[1\]` has shape \(200, 1\) where \(n,\)"):
        detector.pairs((spheres[:, :3], spheres[:, 3:]))
    with pytest.raises(lazygrid.InputError, match="`radii` has 199 values where 200 are needed"):
        detector.pairs((spheres[:, :3], spheres[1:, 3]))
    with pytest.raises(lazygrid.InputError, match="`z` has 1 values where 2 are needed"):
        one, two = np.zeros(1, np.float32), np.zeros(2, np.float32)
        detector.pairs((two, two, one, two))
    for wrong in ((), (spheres,), (spheres[:, 0],) * 3, (spheres[:, 0],) * 5):
        with pytest.raises(TypeError, match=r"tuple of \d; give four columns"):
            detector.pairs(wrong)
    for radius in (None, "1", True, 1j, np.nextafter(np.longdouble(1), 2), 2**53 + 1):
        with pytest.raises(TypeError, match=r"`spheres\[1\]` (is|has)"):
            detector.pairs((spheres[:, :3], radius))  # type: ignore[arg-type]
    with pytest.raises(lazygrid.InputError, match="`spheres` is not an array"):
        detector.pairs([[1.0, 2.0], [1.0]])
    with pytest.raises(TypeError, match="cast"):
        detector.pairs(spheres, cast=True)  # type: ignore[call-arg]


class OnGpu:
    """As arrays of libraries that offer no copy to the host."""

    __cuda_array_interface__ = {"shape": (2, 4), "typestr": "<f4", "data": (4096, False), "version": 3}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (None, "`spheres` is of type NoneType where an array of shape (n, 4) is needed; give an array of NumPy"),
        ({}, "`spheres` is of type dict where"),
        (OnGpu(), "is of type OnGpu where an array of shape (n, 4) is needed; copy it from the GPU to the host"),
        (np.array(1.0), "`spheres` has shape () where (n, 4) is needed"),
        (fields(np.zeros((3, 4))), "has shape (3,) where (n, 4) is needed; give the fields of a structured array a as"),
    ],
)
def test_what_is_no_array_is_named(given: Any, message: str) -> None:
    with pytest.raises(lazygrid.InputError) as refused:
        Detector(backend="cpu").pairs(given)
    assert message in str(refused.value)


def test_numbers_out_of_range_are_refused_by_name() -> None:
    detector, rows = Detector(backend="cpu"), doubles(2, 10)
    with pytest.raises(TypeError, match=r"`spheres\[1\]` is a whole number of 1329 bits, which float64 cannot hold"):
        detector.pairs((rows[:, :3], 10**400))
    for chunk in (-1, 0, 2**70):
        with pytest.raises(lazygrid.SettingError, match=f"chunk = {chunk} is out of range; choose at least one"):
            detector.stream(rows, chunk=chunk)
    with pytest.raises(TypeError, match="argument 'chunk': 'float' object"):
        detector.stream(rows, chunk=1.5)  # type: ignore[arg-type]
    with pytest.raises(lazygrid.SettingError, match="spheres = -1 is out of range"):
        detector.memory_for(-1)
    for out, found in (
        (np.zeros((9, 2), np.int64), r"this is int64 of shape \[9, 2\]"),
        (np.zeros((9, 3), np.uint32), r"this is uint32 of shape \[9, 3\]"),
        ([[0, 0]], "this is <class 'list'>"),
    ):
        with pytest.raises(lazygrid.InputError, match=f"`out` must be a writable array of numpy.uint32.*{found}"):
            detector.pairs(rows, out=out)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", KINDS)
def test_masked_values_are_refused(kind: Any) -> None:
    detector, rows = Detector(backend="cpu"), doubles(9, 100).astype(kind)
    masked = np.ma.masked_array(rows, mask=False)
    np.testing.assert_array_equal(detector.pairs(masked), brute_force(rows))
    masked[17, 3] = np.ma.masked
    for spheres in (masked, (masked[:, :3].data, masked[:, 3]), tuple(masked.T)):
        with pytest.raises(lazygrid.InputError, match=r"`spheres.*` has masked values; give array.compressed"):
            detector.pairs(spheres)
    species = np.ma.masked_array(np.zeros(100, np.uint32), mask=np.arange(100) == 5)
    reacting = Detector(backend="cpu", interactions=Interactions(1, 0.5))
    with pytest.raises(lazygrid.InputError, match="`species` has masked values"):
        reacting.pairs(rows, species=species)


def test_files_in_memory_are_read(tmp_path: Any) -> None:
    rows = doubles(10, 100)
    np.save(tmp_path / "rows.npy", rows)
    mapped = np.load(tmp_path / "rows.npy", mmap_mode="r")
    assert type(mapped) is np.memmap
    np.testing.assert_array_equal(Detector(backend="cpu").pairs(mapped), brute_force(rows))


def test_errors_have_the_numbers_as_given() -> None:
    rows = doubles(8, 10, 1e9)
    rows[3, 3] = -0.1
    with pytest.raises(lazygrid.InputError, match="sphere 3 .* radius -0.1: 1 of 10") as refused:
        Detector(backend="cpu").pairs(rows)
    assert refused.value.value == rows[3].tolist()


def test_a_stream_of_doubles_is_of_the_spheres_that_were_given() -> None:
    rows = np.full((300, 4), 1e9)
    rows[:, 3] = 1e-9
    detector, total = Detector(backend="cpu", order="unordered"), 0
    for chunk in detector.stream((rows[:, :3], rows[:, 3]), chunk=100):
        rows[:] = np.nan
        total += len(chunk)
    assert total == 300 * 299 // 2
