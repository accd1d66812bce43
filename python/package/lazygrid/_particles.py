"""Particles and arrivals of a run, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Particles:
    """All particles at one moment, in the order of their ids."""

    step: int
    """The number of steps done."""
    position: npt.NDArray[np.float32]
    """In µm, of shape ``(n, 3)``."""
    velocity: npt.NDArray[np.float32] | None
    """In µm/s, of shape ``(n, 3)``; ``None`` in a model without velocities."""
    radius: npt.NDArray[np.float32]
    """In µm, of shape ``(n,)``."""
    species: npt.NDArray[np.uint32]
    """Indices of species, of shape ``(n,)``."""
    id: npt.NDArray[np.uint32]
    """Ids, of shape ``(n,)``. A particle keeps its id."""

    def __len__(self) -> int:
        return len(self.id)

    @property
    def spheres(self) -> npt.NDArray[np.float32]:
        """Rows ``x, y, z, r`` in µm for :class:`Detector`: a new array of shape ``(n, 4)``."""
        return np.column_stack([self.position, self.radius])


@dataclass(frozen=True)
class ParticleColumns:
    """All particles of a :class:`Simulation`, a read-only array per quantity, in no particular order.

    On the CPU the arrays view the memory of the simulation without a copy, and never change: if they are still in use,
    the next step continues on a copy.
    """

    step: int
    """The number of steps done."""
    x: npt.NDArray[np.float32]
    """Coordinates in µm, of shape ``(n,)``."""
    y: npt.NDArray[np.float32]
    z: npt.NDArray[np.float32]
    vx: npt.NDArray[np.float32] | None
    """Velocities in µm/s, of shape ``(n,)``; ``None`` in a model without velocities."""
    vy: npt.NDArray[np.float32] | None
    vz: npt.NDArray[np.float32] | None
    radius: npt.NDArray[np.float32]
    """Radii in µm, of shape ``(n,)``."""
    species: npt.NDArray[np.uint32]
    """Indices of species in :attr:`Simulation.species`, of shape ``(n,)``."""
    id: npt.NDArray[np.uint32]
    """Ids, of shape ``(n,)``. A particle keeps its id, and no id is used twice."""

    def __len__(self) -> int:
        return len(self.id)

    @property
    def position(self) -> npt.NDArray[np.float32]:
        """Positions in µm: a new array of shape ``(n, 3)``."""
        return np.column_stack([self.x, self.y, self.z])

    @property
    def spheres(self) -> tuple[npt.NDArray[np.float32], ...]:
        """The columns ``(x, y, z, radius)`` for :class:`Detector`, without a copy."""
        return self.x, self.y, self.z, self.radius


@dataclass(frozen=True)
class Arrivals:
    """Particles that receivers absorbed, in the order of their arrival: columns of shape ``(m,)``."""

    step: npt.NDArray[np.uint32]
    """The number of steps done on arrival."""
    receiver: npt.NDArray[np.uint32]
    """The index of the receiver in :attr:`Simulation.receivers`."""
    species: npt.NDArray[np.uint32]
    """The index of the species on arrival."""
    id: npt.NDArray[np.uint32]
    """The id of the particle."""
    transmitter: npt.NDArray[np.int64]
    """The index of the particle's transmitter, or -1 for an inserted one."""
    released: npt.NDArray[np.int64]
    """The step at whose beginning the particle was released, or -1."""

    def __len__(self) -> int:
        return len(self.id)
