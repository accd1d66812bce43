"""All pairs of overlapping spheres, at every step of a simulation.

>>> import numpy, lazygrid
>>> spheres = numpy.array([[0, 0, 0, 1], [1.5, 0, 0, 1], [9, 0, 0, 0.1]])
>>> lazygrid.Detector().pairs(spheres).tolist()
[[0, 1]]

A simulation keeps one :class:`Detector`, which reuses its buffers. Lengths are in any one unit.
"""

from ._atoms import neighbor_list
from ._errors import Error, FileError, InputError, OutOfMemory, SettingError, TooManyPairs
from ._files import read
from ._lazygrid import NO_GROUP, Chunks, Detector, Exclusions, Frame, Frames, Interactions
from ._lazygrid import VERSION as __version__
from ._once import pairs
from ._particles import Arrivals, ParticleColumns, Particles
from ._simulation import Simulation, SimulationResult, simulate

__all__ = [
    "NO_GROUP",
    "Arrivals",
    "Chunks",
    "Detector",
    "Error",
    "Exclusions",
    "FileError",
    "Frame",
    "Frames",
    "InputError",
    "Interactions",
    "OutOfMemory",
    "ParticleColumns",
    "Particles",
    "SettingError",
    "Simulation",
    "SimulationResult",
    "TooManyPairs",
    "__version__",
    "neighbor_list",
    "pairs",
    "read",
    "simulate",
]
