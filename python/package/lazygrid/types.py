"""Types for annotations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypedDict, Union

import numpy as np
import numpy.typing as npt

Columns = tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]
"""``x``, ``y``, ``z`` and ``r``, each of shape ``(n,)``."""
Points = tuple[npt.ArrayLike, npt.ArrayLike]
"""Positions of shape ``(n, 3)``, and radii: an array of shape ``(n,)`` or one number."""
Spheres = Union[npt.ArrayLike, Columns, Points]
"""Rows ``x, y, z, r`` of shape ``(n, 4)``, columns, or points with radii; float32 or float64."""
Labels = Union[npt.ArrayLike, tuple[Union[npt.ArrayLike, None], Union[npt.ArrayLike, None]]]
"""A whole number per sphere, of shape ``(n,)``; for two sets a tuple of two, either of which may be ``None``."""
Periodic = Union[Sequence[Union[float, Sequence[float], None]], npt.NDArray[np.floating[Any]]]
"""The length of each of three axes, or three cell vectors of a triclinic box; ``None`` for an unbounded axis."""
Backend = Literal["auto", "cpu", "gpu"]
"""The backend."""
Algorithm = Literal[
    "auto", "naive", "hash-grid", "array-grid", "recursive-grid", "cell-list", "eager-grid", "lazy-grid"
]
"""The algorithm."""
Order = Literal["canonical", "unordered"]
"""By ``i``, then ``j``, or as they are found."""
Skin = Union[Literal["auto", "off"], float]
"""The skin of the candidate list: pairs with gaps up to this distance are kept between calls."""


class Cost(TypedDict):
    """The cost of a call on a GPU."""

    dispatches: int
    working_bytes: int
    pair_bytes: int
    traffic_bytes: int | None


class Candidates(TypedDict):
    """The candidate list that answered a call."""

    count: int
    age: int
    """The age of the list in calls."""
    displacement_fraction: float
    """The largest used fraction of a displacement limit, from 0 to 1."""
    rebuilt: str | None
    """The reason of a rebuild in this call; ``None`` if the list was reused."""


class Report(TypedDict):
    """The report of a call. Times of phases are in seconds."""

    spheres: int
    pairs: int
    backend: str
    adapter: str | None
    algorithm: str
    reason: str
    gpu: Cost | None
    candidates: Candidates | None
    phases: dict[str, float]
