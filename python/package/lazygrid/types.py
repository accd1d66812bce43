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
"""Where to run."""
Algorithm = Literal[
    "auto", "naive", "hash-grid", "array-grid", "recursive-grid", "cell-list", "eager-grid", "lazy-grid"
]
"""How to search."""
Order = Literal["canonical", "unordered"]
"""By ``i``, then ``j``, or as they are found."""
Skin = Union[Literal["auto", "off"], float]
"""Whether candidates are kept from call to call; a number: those up to this distance too far apart."""


class Cost(TypedDict):
    """What a call costs a GPU."""

    dispatches: int
    working_bytes: int
    pair_bytes: int
    traffic_bytes: int | None


class Candidates(TypedDict):
    """The candidates that a call was answered from."""

    count: int
    age: int
    """How many calls ago they were found."""
    displacement_fraction: float
    """The part, from 0 to 1, of what a sphere may move that one has moved."""
    rebuilt: str | None
    """The reason of a rebuild in this call; ``None`` if the list was reused."""


class Report(TypedDict):
    """What a call did and why. Times of phases are in seconds."""

    spheres: int
    pairs: int
    backend: str
    adapter: str | None
    algorithm: str
    reason: str
    gpu: Cost | None
    candidates: Candidates | None
    phases: dict[str, float]
