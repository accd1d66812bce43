"""A search without a detector."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._lazygrid import Detector, Exclusions
from .types import Labels, Spheres


def pairs(
    spheres: Spheres,
    second: Spheres | None = None,
    *,
    species: Labels | None = None,
    groups: Labels | None = None,
    exclusions: Exclusions | None = None,
    **settings: Any,
) -> npt.NDArray[np.uint32]:
    """Return all pairs of overlapping spheres, by a new :class:`Detector`. Programs with several calls should keep one.

    >>> lazygrid.pairs((points, 0.5), periodic=(10, 10, None))

    Parameters
    ----------
    spheres, second, species, groups, exclusions
        See :meth:`Detector.pairs`.
    settings
        Keywords of :class:`Detector`.

    Returns
    -------
    numpy.ndarray
        uint32 of shape ``(m, 2)``: indices of spheres.

    Raises
    ------
    InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
        See :meth:`Detector.pairs`.
    SettingError, Error
        As :class:`Detector`.
    """
    detector = Detector(**settings)
    return detector.pairs(spheres, second, species=species, groups=groups, exclusions=exclusions)
