"""Runs of the simulator."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _lazygrid


@dataclass(frozen=True)
class Particles:
    """All particles at one moment, in the order of their ids."""

    step: int
    """How many steps were done."""
    position: npt.NDArray[np.float32]
    """In µm, of shape ``(n, 3)``."""
    velocity: npt.NDArray[np.float32] | None
    """In µm/s, of shape ``(n, 3)``; ``None`` in a model without velocities."""
    radius: npt.NDArray[np.float32]
    """In µm, of shape ``(n,)``."""
    species: npt.NDArray[np.uint32]
    """By their order in the scenario, of shape ``(n,)``."""
    id: npt.NDArray[np.uint32]
    """The same for as long as a particle exists, of shape ``(n,)``."""

    def __len__(self) -> int:
        return len(self.id)

    @property
    def spheres(self) -> npt.NDArray[np.float32]:
        """As :class:`Detector` takes them: a new array of shape ``(n, 4)``, in µm."""
        return np.column_stack([self.position, self.radius])


@dataclass(frozen=True)
class Simulation:
    """What came of a run."""

    series: dict[str, npt.NDArray[Any]]
    """Columns of equal length, as of ``series.csv`` of the command line, for ``pandas.DataFrame(run.series)``:
    ``step``, ``time`` in s, particles by species, reactions and decays so far, what receivers say of each species as
    ``receiver:species``, pairs and settled contacts of the last step."""
    symbols: dict[str, Any]
    """What transmitters sent: columns ``time`` in s, ``transmitter`` and ``symbol``."""
    particles: Particles
    """The particles at the end."""
    frames: list[Particles]
    """The particles after every so many steps, where ``frames_every`` was given."""
    species: list[str]
    """The names of the species, by id."""
    seed: int
    """The seed that was used."""
    time_step: float
    """In s."""


def simulate(
    scenario: str | os.PathLike[str] | Mapping[str, Any],
    *,
    seed: int | None = None,
    steps: int | None = None,
    every: int | None = None,
    frames_every: int | None = None,
    backend: str = "cpu",
    algorithm: str = "auto",
    threads: int | None = None,
) -> Simulation:
    """Run a scenario of particles that diffuse, react, collide and are received.

    The result depends on the scenario and the seed alone; on a GPU it has the same statistics. Nothing is written to
    the disk. What the scenario probably does not mean is a ``UserWarning``.

    Parameters
    ----------
    scenario
        A TOML file; or its text, which a string with a line break is; or the same as a dictionary. Lengths are in µm,
        times in s.
    seed, steps, every
        Win over the scenario's: the seed of the random numbers, the steps in all, the steps between rows of the series.
    frames_every
        Keep all particles after every so many steps. By default only those at the end are kept.
    backend
        ``cpu`` or ``gpu``.
    algorithm
        How pairs are found, on the CPU; it does not change the result.
    threads
        Threads of the CPU; by default all.

    Raises
    ------
    SettingError
        With line and key of what is wrong in the scenario.
    KeyboardInterrupt
        After Ctrl-C; the run is lost.
    """
    source = dict(scenario) if isinstance(scenario, Mapping) else scenario
    options = {
        "seed": seed,
        "steps": steps,
        "every": every,
        "frames_every": frames_every,
        "backend": backend,
        "algorithm": algorithm,
        "threads": threads,
    }
    run, advice = _lazygrid.simulate(source, options)
    for message in advice:
        warnings.warn(message, stacklevel=2)
    return Simulation(
        series=run["series"],
        symbols=run["symbols"],
        particles=Particles(**run["particles"]),
        frames=[Particles(**frame) for frame in run["frames"]],
        species=run["species"],
        seed=run["seed"],
        time_step=run["time_step"],
    )
