"""Time lazygrid beside what Python programmers take today, as a Markdown table.

    python bench/compare.py [--spheres 10000 100000 1000000] [--rounds 7] [--install]

Every tool finds all pairs of the same spheres from scratch: equal ones that fill 5 % of a box, so that a tool with one
cutoff serves. Tools take turns, one call each per round; the table has the median of all rounds, and how many times
lazygrid's that is. A tool whose pairs are not the same ends the program. Everything runs on one thread, as far as the
tools let themselves be told.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

# Before any of them is imported.
os.environ.update(OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")

import numpy as np

import lazygrid

RADIUS = 0.5
DENSITY = 0.05
Call = Callable[[], Any]
Pairs = np.ndarray[Any, np.dtype[np.int64]]


class Scene:
    """Points in a box, as float32 for lazygrid and the same values as float64 for the others."""

    def __init__(self, count: int) -> None:
        self.box = float(np.float32((count * 4 / 3 * np.pi * RADIUS**3 / DENSITY) ** (1 / 3)))
        points = np.random.default_rng(count).uniform(0, self.box, (count, 3)).astype(np.float32)
        # No coordinate on the far face, where a box begins again.
        self.points = np.minimum(points, np.nextafter(np.float32(self.box), np.float32(0)))
        self.spheres = np.column_stack([self.points, np.full(count, RADIUS, dtype=np.float32)])
        self.wide = self.points.astype(np.float64)


def of_lazygrid(scene: Scene, periodic: bool) -> tuple[Call, Callable[[Any], Pairs]]:
    box = (scene.box,) * 3 if periodic else None
    detector = lazygrid.Detector(backend="cpu", threads=1, periodic=box)
    return lambda: detector.pairs(scene.spheres), lambda found: found.astype(np.int64)


def of_scipy(scene: Scene, periodic: bool) -> tuple[Call, Callable[[Any], Pairs]]:
    from scipy.spatial import cKDTree

    box = scene.box if periodic else None

    def call() -> Any:
        return cKDTree(scene.wide, boxsize=box).query_pairs(2 * RADIUS, output_type="ndarray")

    return call, lambda found: np.sort(found, axis=1)


def of_matscipy(scene: Scene, periodic: bool) -> tuple[Call, Callable[[Any], Pairs]]:
    from matscipy.neighbours import neighbour_list

    cell = np.eye(3) * scene.box
    # What touches at exactly the cutoff is a pair for lazygrid only.
    cutoff = np.nextafter(2 * RADIUS, 2.0)

    def call() -> Any:
        return neighbour_list("ij", positions=scene.wide, cell=cell, pbc=[periodic] * 3, cutoff=cutoff)

    return call, one_way


def of_vesin(scene: Scene, periodic: bool) -> tuple[Call, Callable[[Any], Pairs]]:
    from vesin import NeighborList

    neighbors = NeighborList(cutoff=float(np.nextafter(2 * RADIUS, 2.0)), full_list=False, n_threads=1)
    box = np.eye(3) * scene.box

    def call() -> Any:
        return neighbors.compute(scene.wide, box, periodic, "ij")

    return call, lambda found: np.sort(np.column_stack(found).astype(np.int64), axis=1)


def of_freud(scene: Scene, periodic: bool) -> tuple[Call, Callable[[Any], Pairs]]:
    import freud

    if not periodic:
        raise NotImplementedError("freud has periodic boxes only")
    freud.parallel.set_num_threads(1)
    box = freud.box.Box.cube(scene.box)
    points = scene.points - np.float32(scene.box / 2)

    def call() -> Any:
        query = freud.locality.AABBQuery(box, points).query(points, {"r_max": 2 * RADIUS, "exclude_ii": True})
        return query.toNeighborList()

    return call, lambda found: one_way((found.query_point_indices, found.point_indices))


def of_neighbor_list(scene: Scene, periodic: bool) -> tuple[Call, Callable[[Any], Pairs]]:
    """lazygrid's list as ASE has it, in float64, both ways."""
    from types import SimpleNamespace

    atoms = SimpleNamespace(
        positions=scene.wide, cell=np.eye(3) * scene.box, pbc=periodic, numbers=np.ones(len(scene.wide))
    )
    cutoff = float(np.nextafter(2 * RADIUS, 2.0))
    return lambda: lazygrid.neighbor_list("ij", atoms, cutoff), one_way


def one_way(found: Any) -> Pairs:
    both = np.column_stack(found).astype(np.int64)
    return both[both[:, 0] < both[:, 1]]


TOOLS = {
    "lazygrid": (of_lazygrid, None),
    "lazygrid, neighbor_list": (of_neighbor_list, None),
    "scipy cKDTree": (of_scipy, "scipy"),
    "matscipy": (of_matscipy, "matscipy"),
    "vesin": (of_vesin, "vesin"),
    "freud AABBQuery": (of_freud, "freud-analysis"),
}
# freud shifts the points to the middle of its box, in float32: of pairs at the cutoff it may see some differently.
TOLERANT = {"freud AABBQuery"}


def same(name: str, found: Pairs, expected: Pairs) -> None:
    """End the program where pairs differ."""
    found = found[np.lexsort((found[:, 1], found[:, 0]))]
    if name in TOLERANT:
        differing = set(map(tuple, found)) ^ set(map(tuple, expected))
        if len(differing) <= 1e-5 * len(expected) + 1:
            return
    if not np.array_equal(found, expected):
        sys.exit(f"{name} finds {len(found)} pairs and lazygrid {len(expected)}, or others")


def compare(count: int, periodic: bool, rounds: int) -> dict[str, float]:
    """Milliseconds of each tool: medians of interleaved rounds, after one that is checked and not counted."""
    scene, calls = Scene(count), {}
    expected = None
    for name, (make, package) in TOOLS.items():
        try:
            call, pairs = make(scene, periodic)
        except (ImportError, NotImplementedError) as error:
            print(f"{name} is left out: {error}", file=sys.stderr)
            continue
        found = pairs(call())
        expected = found if expected is None else expected
        same(name, found, expected)
        calls[name] = call
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            began = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - began)
    return {name: 1e3 * statistics.median(taken) for name, taken in times.items()}


def overhead() -> float:
    """Microseconds of a call on two spheres: the median of batches."""
    detector = lazygrid.Detector(backend="cpu")
    spheres = np.zeros((2, 4), dtype=np.float32)
    batches = []
    for _ in range(200):
        began = time.perf_counter()
        for _ in range(200):
            detector.pairs(spheres)
        batches.append((time.perf_counter() - began) / 200)
    return 1e6 * statistics.median(batches)


def table(title: str, columns: dict[int, dict[str, float]]) -> str:
    """A Markdown table: a row for each tool, a column for each number of spheres."""
    counts = list(columns)
    lines = [f"| {title} | " + " | ".join(f"{count:,} ms".replace(",", " ") for count in counts) + " |"]
    lines.append("| --- " * (len(counts) + 1) + "|")
    for name, (_, package) in TOOLS.items():
        if not any(name in columns[count] for count in counts):
            continue
        version = importlib.metadata.version(package) if package else lazygrid.__version__
        cells = []
        for count in counts:
            mine, own = columns[count]["lazygrid"], columns[count][name]
            cells.append(f"{own:.3g}" + ("" if name == "lazygrid" else f" ({own / mine:.2g} ×)"))
        lines.append(f"| {name} {version} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description="Time lazygrid beside its peers.")
    parser.add_argument("--spheres", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--install", action="store_true", help="install the peers by pip first")
    options = parser.parse_args()
    if options.install:
        packages = [package for _, package in TOOLS.values() if package]
        subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", *packages], check=True)
        importlib.invalidate_caches()
    print(f"Python {platform.python_version()}, NumPy {np.__version__}, {platform.machine()}, one thread;", end=" ")
    print(f"a call on two spheres takes {overhead():.2f} µs.\n")
    for title, periodic in (("unbounded", False), ("periodic", True)):
        print(table(title, {count: compare(count, periodic, options.rounds) for count in options.spheres}), "\n")


if __name__ == "__main__":
    main()
