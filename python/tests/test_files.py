"""Files, scenarios and the command line: the same results as from the command."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import scene

import lazygrid

# The scenario has few steps, and warns.
pytestmark = pytest.mark.filterwarnings("ignore:.*is long compared")

ROOT = Path(__file__).parents[2]
SCENARIO = """
time-step = 0.001
steps = 50
seed = 3

[[species]]
name = "acid"
radius = 0.1
diffusion = 10.0

[[species]]
name = "base"
radius = 0.1
diffusion = 10.0

[[reaction]]
equation = "acid + base ->"
rate = 20.0

[[transmitter]]
name = "burst"
center = [0, 0, 0]
shape = { kind = "ball", radius = 1.0 }
release = [{ species = "acid", count = 200 }, { species = "base", count = 200 }]

[[receiver]]
name = "rx"
center = [2, 0, 0]
radius = 1
kind = "transparent"
"""
SAME: dict[str, Any] = {
    "time-step": 0.001,
    "steps": 50,
    "seed": 3,
    "species": [
        {"name": "acid", "radius": np.float32(0.1), "diffusion": 10.0},
        {"name": "base", "radius": np.float32(0.1), "diffusion": 10},
    ],
    "reaction": [{"equation": "acid + base ->", "rate": 20.0}],
    "transmitter": [
        {
            "name": "burst",
            "center": np.zeros(3),
            "shape": {"kind": "ball", "radius": 1.0},
            "release": [{"species": "acid", "count": 200}, {"species": "base", "count": np.int64(200)}],
        }
    ],
    "receiver": [{"name": "rx", "center": (2, 0, 0), "radius": 1, "kind": "transparent", "species": None}],
}


def command(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command line of the package or, where it is told by LAZYGRID, the Rust one."""
    rust = os.environ.get("LAZYGRID")
    program = [rust] if rust else [sys.executable, "-m", "lazygrid"]
    return subprocess.run([*program, *map(str, arguments)], cwd=cwd, capture_output=True, text=True)


@pytest.mark.parametrize("periodic", [None, (9.0, 9.0, None)])
def test_the_command_line_writes_the_same_bytes(tmp_path: Path, periodic: Any) -> None:
    rows = scene(5, 3000)
    np.save(tmp_path / "rows.npy", rows)
    box = ["--periodic", "9,9,-"] if periodic else []
    done = command("detect", tmp_path / "rows.npy", "-o", tmp_path / "pairs.npy", *box)
    assert done.returncode == 0, done.stderr
    detector = lazygrid.Detector(periodic=periodic)
    found = detector.pairs(rows)
    np.save(tmp_path / "own.npy", found)
    assert found.tobytes() == np.load(tmp_path / "pairs.npy").tobytes()
    near = tmp_path / "near.npy"
    assert command("detect", tmp_path / "rows.npy", "--neighbors", "-o", near, *box).returncode == 0
    offsets, indices = detector.neighbors(rows)
    assert offsets.tobytes() == np.load(tmp_path / "near.offsets.npy").tobytes()
    assert indices.tobytes() == np.load(tmp_path / "near.indices.npy").tobytes()


def test_the_command_line_says_how_it_ended(tmp_path: Path) -> None:
    said = command("--version")
    assert (said.returncode, said.stdout) == (0, f"lazygrid {lazygrid.__version__}\n")
    assert command("detect").returncode == 2
    missing = command("detect", tmp_path / "missing.csv")
    assert missing.returncode == 1 and missing.stderr.startswith("error: ")


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX shell")
def test_a_closed_standard_output_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x,y,z,r\n0,0,0,1\n1,0,0,1\n")
    program = [sys.executable, "-m", "lazygrid", "detect", str(tmp_path / "a.csv"), "-o", "-"]
    closed = subprocess.run(["sh", "-c", 'exec "$@" >&-', "sh", *program], capture_output=True, text=True)
    assert closed.returncode == 1 and "standard output: it is closed" in closed.stderr, closed.stderr


def test_a_file_is_read_as_arrays() -> None:
    frame = lazygrid.read(ROOT / "tests/data/lammps-pour.dump", frame=0)
    assert frame.spheres.shape == (15208, 4) and frame.spheres.dtype == np.float32
    assert frame.species is not None and frame.species.shape == (15208,)
    assert len(frame.names) == 3 and frame.step == 3000 and frame.ids is None
    assert lazygrid.Detector().count(frame.spheres) == 3072
    frames = lazygrid.Frames(ROOT / "tests/data/lammps-pour.dump", ids=True)
    first = next(frames)
    assert frames.format == "lammps" and first.ids is not None and first.ids.dtype == np.int64


def test_files_of_several_frames(tmp_path: Path) -> None:
    path = tmp_path / "two.xyz"
    frame = '1\nLattice="9 0 0 0 9 0 0 0 9" pbc="T T F" Properties=species:S:1:pos:R:3:radius:R:1\nH 1 2 3 0.5\n'
    path.write_text(frame + frame.replace("0.5", "0.25"))
    with pytest.raises(lazygrid.FileError, match="several frames.*frame="):
        lazygrid.read(path)
    assert lazygrid.read(path, 1).spheres.tolist() == [[1, 2, 3, 0.25]]
    assert lazygrid.read(path, 0).periodic == (9.0, 9.0, None)
    assert lazygrid.read(path, 0, periodic="none").periodic is None
    assert lazygrid.read(path, 0, periodic=(5, None, None)).periodic == (5.0, None, None)
    assert lazygrid.read(path, 0, radii={"H": 2.0}).spheres[0, 3] == 2.0
    assert [frame.spheres[0, 3] for frame in lazygrid.Frames(path)] == [0.5, 0.25]
    with pytest.raises(lazygrid.FileError, match="no frame 2"):
        lazygrid.read(path, 2)


@pytest.mark.parametrize("kind", ["csv", "npy"])
def test_rounding_is_warned_of_once(tmp_path: Path, kind: str) -> None:
    rows, path = np.ones((3, 4)), tmp_path / f"rows.{kind}"
    rows[1, 0] = rows[2, 1] = 16777217
    if kind == "npy":
        np.save(path, rows)
    else:
        np.savetxt(path, rows, header="x,y,z,r", comments="", delimiter=",", fmt="%.0f")
    with pytest.warns(UserWarning, match=f"rows.{kind}, {'row 1' if kind == 'npy' else 'line 3'}: x is 16777217") as said:
        assert lazygrid.read(path).spheres[1, 0] == 16777216
    assert len(said) == 1
    with pytest.warns(UserWarning, match="x is 16777217") as said:
        assert len(list(lazygrid.Frames(path))) == 1
    assert len(said) == 1


@pytest.mark.filterwarnings("error")
def test_frame_whose_warning_is_raised_is_returned_next(tmp_path: Path) -> None:
    path = tmp_path / "two.xyz"
    path.write_text("1\n\nH 16777217 2 3\n1\n\nH 4 5 6\n")
    frames = lazygrid.Frames(path, radii={"H": 1.0})
    with pytest.raises(UserWarning, match="x is 16777217"):
        next(frames)
    assert not frames.at_end()
    assert [frame.spheres[0, 0] for frame in frames] == [16777216, 4] and frames.at_end()


def test_unused_radii_are_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "two.xyz"
    path.write_text("1\n\nH 1 2 3\n1\n\nO 1 2 3\n")
    radii = {"H": 1.0, "O": 2.0, "h": 3.0}
    with pytest.warns(UserWarning, match="no sphere is of species 'h'") as said:
        assert lazygrid.read(path, 1, radii=radii).spheres[0, 3] == 2.0
    assert len(said) == 1 and said[0].filename == __file__
    frames = lazygrid.Frames(path, radii=radii)
    next(frames)
    assert frames.unused_radii() == ["O", "h"]
    with pytest.warns(UserWarning, match="no sphere is of species 'h'") as said:
        assert len(list(frames)) == 1 and next(frames, None) is None
    assert len(said) == 1


@pytest.mark.parametrize("radius", [float("nan"), float("inf"), -0.5, 1e39])
def test_radii_that_no_sphere_can_have_are_refused(tmp_path: Path, radius: float) -> None:
    path = tmp_path / "a.xyz"
    path.write_text("1\n\nH 1 2 3\n")
    with pytest.raises(lazygrid.SettingError, match="the radius of species 'H' is .* finite"):
        lazygrid.read(path, radii={"O": 1.0, "H": radius})


def test_groups_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("x,y,z,r,mol\n0,0,0,1,7\n1,0,0,1,7\n2,0,0,1,0\n")
    frame = lazygrid.read(path, groups=True)
    assert lazygrid.read(path).groups is None and frame.groups is not None
    assert frame.groups.tolist() == [7, 7, lazygrid.NO_GROUP]
    assert lazygrid.Detector().pairs(frame.spheres, groups=frame.groups).tolist() == [[0, 2], [1, 2]]
    path.write_text("x,y,z,r\n0,0,0,1\n")
    with pytest.raises(lazygrid.FileError, match="groups=True"):
        lazygrid.read(path, groups=True)
    with pytest.raises(lazygrid.FileError, match="ids=True"):
        lazygrid.read(path, ids=True)


def test_a_box_that_leans(tmp_path: Path) -> None:
    path = tmp_path / "tilted.xyz"
    path.write_text('1\nLattice="9 0 0 3 8 0 0 0 7" pbc="T T F" Properties=pos:R:3:radius:R:1\n1 2 3 0.5\n')
    frame = lazygrid.read(path)
    assert frame.periodic == ((9.0, 0.0, 0.0), (3.0, 8.0, 0.0), None)
    assert lazygrid.Detector(periodic=frame.periodic).count(frame.spheres) == 0


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"missing\.csv"):
        lazygrid.read(tmp_path / "missing.csv")
    bad = tmp_path / "bad.csv"
    bad.write_text("x,y,z,r\n1,2,3,0.5\n1,2,three,0.5\n")
    with pytest.raises(lazygrid.FileError, match="line 3.*three"):
        lazygrid.read(bad)
    bare = tmp_path / "bare.xyz"
    bare.write_text("1\n\nH 0 0 0\n")
    with pytest.raises(lazygrid.FileError, match="radii="):
        lazygrid.read(bare)
    with pytest.raises(lazygrid.SettingError, match="unknown format"):
        lazygrid.read(bad, format="pdb")


def test_a_run_has_the_series_of_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "burst.toml"
    path.write_text(SCENARIO)
    assert command("simulate", path, "-o", tmp_path / "run", cwd=tmp_path).returncode == 0
    run = lazygrid.simulate(path)
    with open(tmp_path / "run" / "series.csv") as file:
        names, *rows = csv.reader(file)
    assert list(run.series) == names
    written = np.array(rows, dtype=np.float64).T
    for name, column in zip(names, written):
        np.testing.assert_array_equal(run.series[name], column)
    assert len(run.series["step"]) == 51 and run.series["acid"][-1] < 200


def test_a_file_its_text_and_a_dictionary_are_the_same(tmp_path: Path) -> None:
    path = tmp_path / "burst.toml"
    path.write_text(SCENARIO)
    runs = [lazygrid.simulate(source) for source in (path, str(path), SCENARIO, SAME)]
    for run in runs[1:]:
        assert run.particles.position.tobytes() == runs[0].particles.position.tobytes()
    other = lazygrid.simulate(SAME, seed=4, steps=10, every=5, frames_every=10, threads=1)
    assert other.series["step"].tolist() == [0, 5, 10] and other.seed == 4
    assert [frame.step for frame in other.frames] == [0, 10] and len(other.frames[0]) == 400
    assert other.particles.spheres.shape == (len(other.particles), 4)
    assert (np.diff(other.particles.id.astype(np.int64)) > 0).all()
    assert other.species == ["acid", "base"] and other.particles.velocity is None


def test_series_make_a_data_frame() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(lazygrid.simulate(SAME).series)
    assert list(frame.columns)[:4] == ["step", "time", "acid", "base"] and len(frame) == 51


def test_scenarios_that_make_no_sense() -> None:
    with pytest.raises(lazygrid.SettingError, match="line 3, `steps`|steps"):
        lazygrid.simulate("time-step = 1\n\nsteps = -1\n")
    with pytest.raises(TypeError, match="cannot hold"):
        lazygrid.simulate({"steps": object()})
    with pytest.raises(lazygrid.SettingError, match="^every = 0"):
        lazygrid.simulate(SAME, every=0)
    with pytest.raises(lazygrid.SettingError, match="^frames_every = 0"):
        lazygrid.simulate(SAME, frames_every=0)
    with pytest.raises(lazygrid.SettingError, match=r"^steps = -1 is out of range; .* 2\*\*32 - 1"):
        lazygrid.simulate(SAME, steps=-1)
    with pytest.raises(FileNotFoundError):
        lazygrid.simulate(Path("no such scenario.toml"))
    late = SAME | {"transmitter": [SAME["transmitter"][0] | {"times": [0.0, 99.0]}]}
    with pytest.warns(UserWarning, match="99"):
        lazygrid.simulate(late)


def test_symbols_are_those_sent() -> None:
    bits = SAME["transmitter"][0] | {"bits": "0110", "symbol-time": 0.01}
    run = lazygrid.simulate(SAME | {"transmitter": [bits]})
    assert run.symbols["symbol"].tolist() == [0, 1, 1, 0]
    assert run.symbols["transmitter"] == ["burst"] * 4
    np.testing.assert_allclose(run.symbols["time"], [0.0, 0.01, 0.02, 0.03])


@pytest.mark.parametrize("kind", ["npy", "csv"])
def test_float64_is_read_as_it_is(tmp_path: Path, kind: str) -> None:
    rows = np.array([[0.0, 0.0, 0.0, 0.5], [1.0 + 2.0**-30, 1e-300, 0.1, 0.5]])
    path = tmp_path / f"rows.{kind}"
    if kind == "npy":
        np.save(path, rows)
    else:
        path.write_text("x,y,z,r\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()))
    for dtype in ("float64", np.float64, np.dtype(float)):
        found = lazygrid.read(path, dtype=dtype).spheres
        assert found.dtype == np.float64 and found.tobytes() == rows.tobytes()
        (frame,) = lazygrid.Frames(path, dtype=dtype)
        assert frame.spheres.tobytes() == rows.tobytes()
    with pytest.warns(UserWarning, match="it is rounded"):
        single = lazygrid.read(path, dtype=np.float32).spheres
    assert single.dtype == np.float32 and (single == rows.astype(np.float32)).all()
    for wrong in ("int32", "float16", ">f8", "none"):
        with pytest.raises(lazygrid.SettingError, match="float32 or float64"):
            lazygrid.read(path, dtype=wrong)


def test_radii_by_species_are_float64_too(tmp_path: Path) -> None:
    path = tmp_path / "molecules.csv"
    path.write_text("species,x,y,z\nA,0,0,0\n")
    radius = 0.1
    assert lazygrid.read(path, radii={"A": radius}, dtype=float).spheres[0, 3] == radius
    assert lazygrid.read(path, radii={"A": radius}).spheres[0, 3] == np.float32(radius)
