"""Runs of the simulator."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _arrays, _lazygrid
from ._errors import SettingError
from ._particles import Arrivals, ParticleColumns, Particles


class Simulation:
    """A run of the simulator that a program drives step by step.

    >>> simulation = lazygrid.Simulation("acid-base.toml", seed=1)
    >>> while simulation.time < 1.0:
    ...     simulation.step(10)
    ...     if simulation.counts["rx:acid"] > 100:
    ...         simulation.emit("tx-base", 500, "base")

    Between two steps the program may read particles, counts and arrivals, insert and remove particles, and let
    transmitters emit. The run depends only on the scenario, the seed and these changes, on the CPU bit for bit.

    Parameters
    ----------
    scenario
        A TOML file; or its text, a string with a line break; or an equal dictionary. Lengths are in µm, times in s. The
        number of ``steps`` of the scenario does not bind the simulation.
    seed
        The seed of the random numbers; by default the scenario's.
    backend
        ``cpu`` or ``gpu``. On a GPU, changes read all particles back and upload them again.
    algorithm
        The search of pairs on the CPU, without effect on the result.
    threads
        CPU threads; by default all.

    Raises
    ------
    SettingError
        For an invalid scenario, with line and key.
    """

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Mapping[str, Any],
        *,
        seed: int | None = None,
        backend: str = "cpu",
        algorithm: str = "auto",
        threads: int | None = None,
    ) -> None:
        self._begin(scenario, seed=seed, backend=backend, algorithm=algorithm, threads=threads)

    def _begin(
        self,
        scenario: str | os.PathLike[str] | Mapping[str, Any],
        *,
        seed: int | None = None,
        replica: int | None = None,
        backend: str = "cpu",
        algorithm: str = "auto",
        threads: int | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
    ) -> None:
        source = dict(scenario) if isinstance(scenario, Mapping) else scenario
        self._core = _lazygrid.SimulationCore(
            source,
            seed=seed,
            replica=replica,
            backend=backend,
            algorithm=algorithm,
            threads=threads,
            checkpoint=checkpoint,
        )
        for message in self._core.warnings:
            warnings.warn(message, stacklevel=3)
        self.species: list[str] = self._core.species
        self.transmitters: list[str] = self._core.transmitters
        self.receivers: list[str] = self._core.receivers

    @classmethod
    def resume(
        cls,
        scenario: str | os.PathLike[str] | Mapping[str, Any],
        checkpoint: str | os.PathLike[str],
        *,
        backend: str = "cpu",
        algorithm: str = "auto",
        threads: int | None = None,
    ) -> Simulation:
        """Return the run of a file by :meth:`checkpoint` or the command line, which continues bit for bit.

        Raises
        ------
        Error
            For a checkpoint of another scenario, and for a damaged one.
        """
        simulation = cls.__new__(cls)
        simulation._begin(scenario, backend=backend, algorithm=algorithm, threads=threads, checkpoint=checkpoint)
        return simulation

    @classmethod
    def replicas(
        cls,
        scenario: str | os.PathLike[str] | Mapping[str, Any],
        count: int,
        *,
        seed: int | None = None,
        backend: str = "cpu",
        algorithm: str = "auto",
        threads: int | None = None,
    ) -> Iterator[Simulation]:
        """Yield ``count`` runs of one scenario with the independent seeds of ``lazygrid simulate --replicas``.

        Each is created on demand. Steps release the interpreter's lock, so threads can run several at once:

        >>> with concurrent.futures.ThreadPoolExecutor() as pool:
        ...     results = list(pool.map(run, lazygrid.Simulation.replicas(scenario, 20, threads=1)))
        """
        for replica in range(count):
            simulation = cls.__new__(cls)
            simulation._begin(
                scenario, seed=seed, replica=replica, backend=backend, algorithm=algorithm, threads=threads
            )
            yield simulation

    def step(
        self, steps: int = 1, *, callback: Callable[[Simulation], object] | None = None, every: int = 1
    ) -> None:
        """Do some steps.

        Parameters
        ----------
        steps
            The number of steps.
        callback
            Called with the simulation after every ``every`` steps and at the end. It may read and change the
            simulation. If it returns ``False``, also of NumPy, the steps end.
        every
            The number of steps between calls of ``callback``.

        Raises
        ------
        KeyboardInterrupt
            After Ctrl-C, at the end of a step; the simulation keeps the step that it has reached.
        """
        if callback is None:
            self._core.step(steps)
            return
        if every < 1:
            raise SettingError(f"every = {every} is out of range; choose at least one step")
        while steps > 0:
            done = min(every, steps)
            self._core.step(done)
            steps -= done
            going_on = callback(self)
            # A condition on arrays is a bool of NumPy.
            if isinstance(going_on, (bool, np.bool_)) and not going_on:
                return

    @property
    def step_count(self) -> int:
        """The number of steps done."""
        return self._core.step_count

    @property
    def time_step(self) -> float:
        """The length of a step in s."""
        return self._core.time_step

    @property
    def time(self) -> float:
        """The simulated time in s."""
        return self.step_count * self.time_step

    @property
    def seed(self) -> int:
        """The seed of the random numbers."""
        return self._core.seed

    @property
    def particles(self) -> ParticleColumns:
        """All particles, on the CPU without a copy."""
        return ParticleColumns(**self._core.particles())

    @property
    def counts(self) -> dict[str, int]:
        """Counts by name, as the columns of ``series.csv``: particles of each species, reactions and decays so far,
        ``receiver:species``, and pairs and resolved contacts of the last step.
        """
        return self._core.counts()

    @property
    def arrivals(self) -> Arrivals:
        """The particles that absorbing receivers took in the last call of :meth:`step`, or since the last callback.

        A GPU logs the arrivals of up to 8,388,606 pairs of a receiver and a species.
        """
        return Arrivals(**self._core.arrivals())

    def insert(self, species: str | int, positions: npt.ArrayLike) -> npt.NDArray[np.uint32]:
        """Insert particles and return their ids.

        Parameters
        ----------
        species
            The name or index of their species.
        positions
            In µm, of shape ``(n, 3)``, or ``(3,)`` for one particle; wrapped or reflected into the boundary.

        Raises
        ------
        InputError, SettingError
            For positions of another shape or not finite, and for an unknown species. Then nothing changes.
        """
        rows = _arrays.points(positions, "positions")
        return self._core.insert(_index(species, self.species, "species"), rows)

    def remove(self, ids: npt.ArrayLike) -> int:
        """Remove particles by id, free or bound, and return their number. Ignores unknown ids."""
        return self._core.remove(_arrays.whole(ids, "ids"))

    def emit(self, transmitter: str | int, count: int, species: str | int | None = None) -> npt.NDArray[np.uint32]:
        """Let a transmitter release particles now, besides its schedule, and return their ids.

        Parameters
        ----------
        transmitter
            The name or index of the transmitter, whose center and shape the particles have.
        count
            The number of particles.
        species
            The name or index of their species; optional for a single species.

        Raises
        ------
        SettingError
            For an unknown transmitter or species. Then nothing changes.
        """
        if species is None:
            if len(self.species) > 1:
                raise SettingError(f"the scenario has {len(self.species)} species; choose one of {', '.join(self.species)}")
            species = 0
        at = _index(transmitter, self.transmitters, "transmitter")
        return self._core.emit(at, _index(species, self.species, "species"), count)

    def checkpoint(self, path: str | os.PathLike[str]) -> None:
        """Write the state to a file for :meth:`resume`. The file appears when it is complete."""
        self._core.checkpoint(path)

    def __repr__(self) -> str:
        particles = sum(self.counts[name] for name in self.species)
        return f"<lazygrid.Simulation: {particles} particles after {self.step_count} steps>"


def _index(given: str | int, names: list[str], what: str) -> int:
    """The index of a name."""
    if isinstance(given, str):
        if given not in names:
            raise SettingError(f"unknown {what} '{given}'; expected one of {', '.join(names)}")
        return names.index(given)
    if not 0 <= given < len(names):
        raise SettingError(f"{what} {given} is out of range; the scenario has {len(names)}")
    return given


@dataclass(frozen=True)
class SimulationResult:
    """The result of :func:`simulate`."""

    series: dict[str, npt.NDArray[Any]]
    """Columns of equal length, like ``series.csv``, for ``pandas.DataFrame(run.series)``: ``step``, ``time`` in s,
    particles by species, reactions and decays so far, counts of receivers as ``receiver:species``, pairs and resolved
    contacts of the last step.
    """
    symbols: dict[str, Any]
    """The sent symbols: columns ``time`` in s, ``transmitter`` and ``symbol``."""
    particles: Particles
    """The particles at the end."""
    frames: list[Particles]
    """The particles at the steps of ``frames_every``."""
    species: list[str]
    """The names of the species, by index."""
    seed: int
    """The seed of the run."""
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
) -> SimulationResult:
    """Run a scenario of particles that diffuse, react, collide and are received.

    The result depends only on the scenario and the seed; on a GPU it has the same statistics. Nothing is written to
    disk. A likely mistake in the scenario is a ``UserWarning``. :class:`Simulation` runs step by step.

    Parameters
    ----------
    scenario
        A TOML file; or its text, a string with a line break; or an equal dictionary. Lengths are in µm, times in s.
    seed, steps, every
        Override the scenario: the seed of the random numbers, the number of steps, the steps between rows of the
        series.
    frames_every
        The steps between frames, which keep all particles. By default only the particles at the end are kept.
    backend
        ``cpu`` or ``gpu``.
    algorithm
        The search of pairs on the CPU, without effect on the result.
    threads
        CPU threads; by default all.

    Raises
    ------
    SettingError
        For an invalid scenario, with line and key.
    KeyboardInterrupt
        After Ctrl-C, at the end of a step; the run is lost.
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
    return SimulationResult(
        series=run["series"],
        symbols=run["symbols"],
        particles=Particles(**run["particles"]),
        frames=[Particles(**frame) for frame in run["frames"]],
        species=run["species"],
        seed=run["seed"],
        time_step=run["time_step"],
    )
