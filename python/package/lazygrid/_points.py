"""Points of one radius, or of a radius each."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _arrays
from ._errors import InputError
from ._lazygrid import Detector


def pairs(
    points: npt.ArrayLike, radius: npt.ArrayLike, *, cast: bool = False, **settings: Any
) -> npt.NDArray[np.uint32]:
    """Return all pairs of overlapping spheres around points.

    Two spheres overlap where their centres are at most the sum of their radii apart; touching counts. For all pairs
    of points within a distance ``d``, give ``d / 2`` as radius.

    Parameters
    ----------
    points
        Centres, float32 of shape ``(n, 3)``, in any length unit.
    radius
        The radius of all spheres, or one for each, of shape ``(n,)``, in the same unit.
    cast
        Whether points of another type, such as float64, may be rounded to float32.
    settings
        Keywords of :class:`Detector`, such as ``periodic=(10, 10, None)``.

    Returns
    -------
    numpy.ndarray
        uint32 of shape ``(m, 2)``: ``i < j``, sorted by ``i``, then ``j``.

    Raises
    ------
    InputError
        For another shape, values that are not finite, a negative radius.
    TypeError
        For points that are not float32 where ``cast`` is not set.
    """
    given = np.asarray(points)
    if given.ndim != 2 or given.shape[1] != 3:
        raise InputError(f"`points` has shape {given.shape} where (n, 3) is needed")
    rows = np.empty((len(given), 4), dtype=np.float32)
    rows[:, :3] = _arrays.floats(given, "points", 2, cast)
    radii = np.asarray(radius, dtype=np.float32)
    if radii.shape not in ((), (len(given),)):
        raise InputError(f"`radius` has shape {radii.shape} where () or ({len(given)},) is needed")
    rows[:, 3] = radii
    return Detector(**settings).pairs(rows)
