"""Time lazygrid, Smoldyn 2.74 and ReaDDy 2.0.14 on scenes in which most species never react with each other.

    python3 -m venv venv && venv/bin/pip install smoldyn==2.74 readdy==2.0.14 numpy maturin
    (cd python && ../venv/bin/maturin develop --release)
    venv/bin/python simulator/compare/species.py [--rounds 5] [--scene NAME...]

All run on one thread, in turn, from the same initial positions. A table has the median processor time of the first steps in
milliseconds, without setup (except ReaDDy's, whose runs cannot continue), its ratio to lazygrid's, round by round, and the
numbers of reactions, which differ by chance.

The last scene is `simulator/scenarios/acid-base.toml` with 50 000 molecules per burst. Reactions there have a rate, from
which each simulator takes its own binding radius; ReaDDy has the radius of lazygrid's, and reacts for certain.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import statistics
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import lazygrid

Run = Callable[[], tuple[float, int]]


@dataclass
class Scene:
    """Species with initial positions, and reactions of two that leave nothing."""

    name: str
    time_step: float
    steps: int
    half: float
    """Half the edge of the periodic box."""
    diffusion: float
    radius: float
    """The binding radius of reactions, if they have no rate."""
    positions: dict[str, Any]
    reactions: list[tuple[str, str]]
    rate: float | None = None
    random: Any = field(default_factory=lambda: np.random.default_rng(1))

    @property
    def molecules(self) -> int:
        return sum(len(rows) for rows in self.positions.values())


def ball(count: int, radius: float, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """Positions that are uniform in a ball."""
    random = np.random.default_rng(count)
    direction = random.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * radius * random.random((count, 1)) ** (1 / 3) + center


def scenes() -> list[Scene]:
    ring = ["A", "B", "C", "D"]
    half = 0.5 * (100_000 * np.pi / 6 / 0.05) ** (1 / 3)
    uniform = np.random.default_rng(1).uniform(-half, half, (100_000, 3))
    return [
        Scene(
            "burst of one species, a rare partner",
            2e-5,
            5,
            12.0,
            100.0,
            0.1,
            {"A": ball(50_000, 0.5), "B": ball(50, 10.0)},
            [("A", "B")],
        ),
        Scene(
            "enzymes and substrate at a point",
            1e-6,
            5,
            1.0,
            10.0,
            0.01,
            {"E": ball(2_000, 0.02), "S": ball(50_000, 0.02)},
            [("E", "S")],
        ),
        Scene(
            "one target in a crowd, 50 000", 1e-4, 5, 10.0, 50.0, 1.0, {"T": np.zeros((1, 3)), "A": ball(50_000, 7.0)}, [("T", "A")]
        ),
        Scene(
            "one target in a crowd, 200 000", 1e-4, 5, 10.0, 50.0, 1.0, {"T": np.zeros((1, 3)), "A": ball(200_000, 7.0)}, [("T", "A")]
        ),
        Scene(
            "ring of four species",
            1.25e-3,
            5,
            half,
            1.0,
            1.0,
            {name: uniform[k::4] for k, name in enumerate(ring)},
            [(a, b) for a, b in zip(ring, ring[1:] + ring[:1])],
        ),
        Scene(
            "acid-base burst, first step", 5e-4, 1, 20.0, 100.0, 0.17, {"A": ball(50_000, 0.5), "B": np.empty((0, 3))}, [("A", "B")], 2000.0
        ),
        Scene(
            "acid-base burst, first five steps",
            5e-4,
            5,
            20.0,
            100.0,
            0.17,
            {"A": ball(50_000, 0.5), "B": np.empty((0, 3))},
            [("A", "B")],
            2000.0,
        ),
    ]


def timed(work: Callable[[], Any]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Discard what a library prints by itself."""
    sys.stdout.flush()
    kept, null = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(null)


def of_lazygrid(scene: Scene) -> Run:
    box = [scene.half] * 3
    reaction = {"rate": scene.rate} if scene.rate else {"binding-radius": scene.radius}
    scenario = {
        "time-step": scene.time_step,
        "steps": scene.steps,
        "boundary": {"kind": "periodic", "low": [-x for x in box], "high": box},
        "species": [{"name": name, "diffusion": scene.diffusion} for name in scene.positions],
        "reaction": [{"equation": f"{a} + {b} -> 0", **reaction} for a, b in scene.reactions],
    }

    def run() -> tuple[float, int]:
        simulation = lazygrid.Simulation(scenario, threads=1)
        for name, rows in scene.positions.items():
            simulation.insert(name, rows)
        taken = timed(lambda: simulation.step(scene.steps))
        return taken, (scene.molecules - len(simulation.particles)) // 2

    return run


def of_smoldyn(scene: Scene) -> Run:
    import smoldyn
    from smoldyn._smoldyn import MolecState

    lines = ["dim 3", *(f"boundaries {axis} {-scene.half} {scene.half} p" for axis in "xyz")]
    lines += [f"species {' '.join(scene.positions)}", f"difc all {scene.diffusion}"]
    lines += [f"molecule_lists {' '.join('list' + name for name in scene.positions)}"]
    lines += [f"mol_list {name} list{name}" for name in scene.positions]
    lines += [f"max_mol {scene.molecules + 10}", "molperbox 0.5" if scene.rate is None else "molperbox 4", "accuracy 10"]
    lines += ["random_seed 1", "time_start 0", f"time_stop {(scene.steps + 1) * scene.time_step}", f"time_step {scene.time_step}"]
    for name, rows in scene.positions.items():
        lines += [f"mol 1 {name} {x} {y} {z}" for x, y, z in rows]
    for k, (a, b) in enumerate(scene.reactions):
        lines += [f"reaction r{k} {a} + {b} -> 0" + (f" {scene.rate}" if scene.rate else "")]
        lines += [] if scene.rate else [f"binding_radius r{k} {scene.radius}"]
    text = "\n".join([*lines, "end_file", ""])

    def run() -> tuple[float, int]:
        with tempfile.NamedTemporaryFile("w", suffix=".txt", delete=False) as file:
            file.write(text)
        try:
            with quiet():
                simulation = smoldyn.Simulation.fromFile(file.name, "q")
                simulation.updateSim()
                taken = timed(lambda: simulation.runUntil(scene.steps * scene.time_step, dt=scene.time_step))
                left = sum(simulation.getMoleculeCount(name, MolecState.all) for name in scene.positions)
            return taken, (scene.molecules - left) // 2
        finally:
            os.unlink(file.name)

    return run


def of_readdy(scene: Scene) -> Run:
    import readdy

    def run() -> tuple[float, int]:
        system = readdy.ReactionDiffusionSystem([2 * scene.half] * 3, temperature=None, unit_system=None)
        for name in [*scene.positions, "gone"]:
            system.add_species(name, scene.diffusion)
        # ReaDDy requires a product of each reaction; it decays in the next step. Both reactions have probability 1.
        for k, (a, b) in enumerate(scene.reactions):
            system.reactions.add(f"r{k}: {a} +({scene.radius}) {b} -> gone", rate=1e12)
        system.reactions.add("end: gone ->", rate=1e12)
        simulation = system.simulation(kernel="SingleCPU")
        simulation.show_progress = False
        for name, rows in scene.positions.items():
            if len(rows) > 0:
                simulation.add_particles(name, rows)
        counts: list[Any] = []
        simulation.observe.number_of_particles(scene.steps, types=list(scene.positions), callback=counts.append)
        taken = timed(lambda: simulation.run(scene.steps, scene.time_step, show_summary=False))
        return taken, (scene.molecules - sum(counts[-1])) // 2

    return run


PEERS = {"lazygrid": of_lazygrid, "Smoldyn": of_smoldyn, "ReaDDy": of_readdy}


def main() -> None:
    parser = argparse.ArgumentParser(description="Time lazygrid against Smoldyn and ReaDDy.")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--scene", nargs="+", help="parts of the names of scenes")
    parser.add_argument("--without", nargs="+", default=[], choices=list(PEERS))
    options = parser.parse_args()
    # The simulator warns of these long steps.
    warnings.simplefilter("ignore", UserWarning)
    names = [name for name in PEERS if name not in options.without]
    print("| scene | " + " | ".join(f"{name}, ms" for name in names) + " | reactions |")
    print("| --- " * (len(names) + 2) + "|")
    for scene in scenes():
        if options.scene and not any(part in scene.name for part in options.scene):
            continue
        runs = {name: PEERS[name](scene) for name in names}
        times: dict[str, list[float]] = {name: [] for name in names}
        reactions: dict[str, int] = {}
        for round_number in range(options.rounds + 1):
            for name, run in runs.items():
                taken, reactions[name] = run()
                # The first round warms up.
                if round_number > 0:
                    times[name].append(taken)
        cells = []
        for name in names:
            ratio = statistics.median(a / b for a, b in zip(times[name], times["lazygrid"]))
            shown = f"{1e3 * statistics.median(times[name]):.3g}"
            cells.append(shown if name == "lazygrid" else f"{shown} ({ratio:.2g} ×)")
        counted = ", ".join(str(reactions[name]) for name in names)
        print(f"| {scene.name} | " + " | ".join(cells) + f" | {counted} |", flush=True)


if __name__ == "__main__":
    main()
