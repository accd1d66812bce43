"""Time lazygrid and other Python tools, as Markdown tables.

    python bench/compare.py [--spheres 10000 100000 1000000] [--rounds 7] [--install]

Every tool finds all pairs of the same spheres from scratch, so lazygrid's skin is off. The spheres fill 5 % of a
bounded or periodic box: equal ones, which suit tools with one cutoff, and five sizes of equal number, each half as
large as the one before, for which such a tool uses the largest cutoff and a filter. Tools take turns, one call each per
round; a table has the median of all rounds, and its multiple of lazygrid's. A tool with other pairs ends the program.
Everything runs on one thread, as far as the tools allow. Times are processor times of the whole process, so that other
processes count less.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import itertools
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

DENSITY = 0.05
SIZES = {"equal": [0.5], "five sizes": [1.0, 1 / 2, 1 / 4, 1 / 8, 1 / 16]}
Call = Callable[[], Any]
Pairs = np.ndarray[Any, np.dtype[np.int64]]
Tool = tuple[Call, Callable[[Any], Pairs]]


class Scene:
    """Spheres in a box, as float32 for lazygrid and the same values as float64 for the others."""

    def __init__(self, count: int, sizes: list[float], periodic: bool) -> None:
        random = np.random.default_rng(count)
        self.sizes, self.periodic = sizes, periodic
        self.radii = random.permutation(np.resize(sizes, count)).astype(np.float32)
        volume = (4 / 3 * np.pi * self.radii.astype(np.float64) ** 3).sum()
        self.box = float(np.float32((volume / DENSITY) ** (1 / 3)))
        points = random.uniform(0, self.box, (count, 3)).astype(np.float32)
        # No coordinate is on the far face, where a box begins again.
        self.points = np.minimum(points, np.nextafter(np.float32(self.box), np.float32(0)))
        self.spheres = np.column_stack([self.points, self.radii])
        self.wide, self.wide_radii = self.points.astype(np.float64), self.radii.astype(np.float64)
        self.cell = np.eye(3) * self.box
        self.largest = 2 * max(sizes)
        # Pairs at exactly the cutoff count for lazygrid, but not for all tools.
        self.above = float(np.nextafter(self.largest, 2 * self.largest))

    def in_reach(self, i: Any, j: Any) -> Any:
        """The exact filter for tools with one cutoff."""
        difference = self.wide[i] - self.wide[j]
        if self.periodic:
            difference -= self.box * np.round(difference / self.box)
        return np.einsum("nk,nk->n", difference, difference) <= (self.wide_radii[i] + self.wide_radii[j]) ** 2


def of_lazygrid(scene: Scene) -> Tool:
    box = (scene.box,) * 3 if scene.periodic else None
    detector = lazygrid.Detector(backend="cpu", threads=1, periodic=box, skin="off")
    return lambda: detector.pairs(scene.spheres), lambda found: found.astype(np.int64)


def of_neighbor_list(scene: Scene) -> Tool:
    """lazygrid's list in ASE's form, in float64, both ways."""
    from types import SimpleNamespace

    ones = np.ones(len(scene.wide))
    # Moves all atoms in turn, without rounding, so that no candidates of the last call serve.
    atoms = [
        SimpleNamespace(positions=scene.wide + offset, cell=scene.cell, pbc=scene.periodic, numbers=ones)
        for offset in (0.0, 2.0 ** np.floor(np.log2(scene.box / 4)))
    ]
    turns = itertools.cycle(atoms)
    cutoff = scene.above if len(scene.sizes) == 1 else np.nextafter(scene.wide_radii, 2)
    return lambda: lazygrid.neighbor_list("ij", next(turns), cutoff), one_way


def of_scipy(scene: Scene) -> Tool:
    from scipy.spatial import cKDTree

    box = scene.box if scene.periodic else None

    def call() -> Any:
        found = cKDTree(scene.wide, boxsize=box).query_pairs(scene.largest, output_type="ndarray")
        return found if len(scene.sizes) == 1 else found[scene.in_reach(found[:, 0], found[:, 1])]

    return call, lambda found: np.sort(found, axis=1)


def of_matscipy(scene: Scene) -> Tool:
    from matscipy.neighbours import neighbour_list

    cutoff = scene.above if len(scene.sizes) == 1 else np.nextafter(scene.wide_radii, 2)

    def call() -> Any:
        pbc = [scene.periodic] * 3
        return neighbour_list("ij", positions=scene.wide, cell=scene.cell, pbc=pbc, cutoff=cutoff)

    return call, one_way


def of_vesin(scene: Scene) -> Tool:
    from vesin import NeighborList

    neighbors = NeighborList(cutoff=scene.above, full_list=False, n_threads=1)

    def call() -> Any:
        if len(scene.sizes) == 1:
            return neighbors.compute(scene.wide, scene.cell, scene.periodic, "ij")
        i, j, distance = neighbors.compute(scene.wide, scene.cell, scene.periodic, "ijd")
        touch = distance <= scene.wide_radii[i] + scene.wide_radii[j]
        return i[touch], j[touch]

    return call, lambda found: np.sort(np.column_stack(found).astype(np.int64), axis=1)


def of_freud(scene: Scene) -> Tool:
    import freud

    if not scene.periodic:
        raise NotImplementedError("freud has periodic boxes only")
    freud.parallel.set_num_threads(1)
    box = freud.box.Box.cube(scene.box)
    points = scene.points - np.float32(scene.box / 2)

    def call() -> Any:
        query = freud.locality.AABBQuery(box, points).query(points, {"r_max": scene.largest, "exclude_ii": True})
        found = query.toNeighborList()
        i, j = found.query_point_indices, found.point_indices
        if len(scene.sizes) > 1:
            touch = found.distances <= scene.radii[i] + scene.radii[j]
            i, j = i[touch], j[touch]
        return i, j

    return call, one_way


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
# freud shifts the points to the middle of its box and decides in float32, so pairs at the cutoff may differ.
TOLERANT = {"freud AABBQuery"}


def same(name: str, found: Pairs, expected: Pairs) -> None:
    """End the program if pairs differ."""
    found = found[np.lexsort((found[:, 1], found[:, 0]))]
    if name in TOLERANT:
        differing = set(map(tuple, found)) ^ set(map(tuple, expected))
        if len(differing) <= 1e-5 * len(expected) + 1:
            return
    if not np.array_equal(found, expected):
        sys.exit(f"{name} finds {len(found)} pairs and lazygrid {len(expected)}, or others")


def compare(scene: Scene, rounds: int) -> dict[str, float]:
    """Milliseconds of each tool: medians of interleaved rounds, after one that is checked and not counted."""
    calls = {}
    expected = None
    for name, (make, _) in TOOLS.items():
        try:
            call, pairs = make(scene)
        except (ImportError, NotImplementedError) as error:
            print(f"{name} is left out: {error}", file=sys.stderr)
            continue
        found = pairs(call())
        expected = found if expected is None else expected
        same(name, found, expected)
        calls[name] = call
    times: dict[str, list[float]] = {name: [] for name in calls}
    # Faster calls are repeated more often.
    for _ in range(rounds * max(1, 100_000 // len(scene.radii))):
        for name, call in calls.items():
            began = time.process_time()
            call()
            times[name].append(time.process_time() - began)
    return {name: 1e3 * statistics.median(taken) for name, taken in times.items()}


def three_digits(number: float) -> str:
    """A number with three significant digits, without an exponent."""
    return f"{number:.3g}" if number < 1000 else f"{round(number, 2 - int(np.log10(number))):.0f}"


def table(title: str, columns: dict[int, dict[str, float]]) -> str:
    """A Markdown table with a row per tool and a column per number of spheres."""
    lines = [f"| {title} | " + " | ".join(f"{count:,} ms".replace(",", " ") for count in columns) + " |"]
    lines.append("| --- " * (len(columns) + 1) + "|")
    for name, (_, package) in TOOLS.items():
        cells = []
        for times in columns.values():
            if name in times:
                ratio = times[name] / times["lazygrid"]
                said = f" ({ratio:.{1 if ratio < 9.95 else 0}f} ×)"
                cells.append(three_digits(times[name]) + ("" if name == "lazygrid" else said))
        if cells:
            lines.append(f"| {name} {importlib.metadata.version(package or 'lazygrid')} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description="Time lazygrid and its peers.")
    parser.add_argument("--spheres", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--install", action="store_true", help="install the peers by pip first")
    options = parser.parse_args()
    if options.install:
        packages = [package for _, package in TOOLS.values() if package]
        subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", *packages], check=True)
        importlib.invalidate_caches()
    print(f"Python {platform.python_version()}, NumPy {np.__version__}, {platform.machine()}, one thread.\n")
    for size, sizes in SIZES.items():
        for space, periodic in (("unbounded", False), ("periodic", True)):
            counts = options.spheres
            columns = {count: compare(Scene(count, sizes, periodic), options.rounds) for count in counts}
            print(table(f"{size}, {space}", columns), "\n", flush=True)


if __name__ == "__main__":
    main()
