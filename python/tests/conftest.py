"""Shared functions."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TypeVar, Union

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, settings

import lazygrid

# A busy machine is no fault.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")

Rows = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Box = tuple[Union[float, None], ...]
OPEN: Box = (None, None, None)
Made = TypeVar("Made")


def on_gpu(make: Callable[[], Made]) -> Made:
    """The result of ``make`` on a GPU. Without one the test is skipped, or fails if ``LAZYGRID_REQUIRE_GPU`` is set."""
    try:
        return make()
    except lazygrid.Error as error:
        is_missing = any(why in str(error) for why in ("no GPU adapter", "without its feature `gpu`"))
        assert is_missing and "LAZYGRID_REQUIRE_GPU" not in os.environ, error
        pytest.skip(str(error))


def brute_force(rows: Rows | Doubles, periodic: Box = OPEN) -> npt.NDArray[np.uint32]:
    """All pairs by the definition, in float64, in canonical order."""
    found = brute_force_across(rows, rows, periodic)
    return found[found[:, 0] < found[:, 1]]


def brute_force_across(a: Rows | Doubles, b: Rows | Doubles, periodic: Box = OPEN) -> npt.NDArray[np.uint32]:
    """All pairs of one sphere of each set by the definition, in float64, in canonical order."""
    first, second = wrapped(a, periodic), wrapped(b, periodic)
    difference = second[None, :, :3] - first[:, None, :3]
    for axis, length in enumerate(periodic):
        if length is not None:
            difference[..., axis] -= length * np.round(difference[..., axis] / length)
    x, y, z = np.moveaxis(difference, 2, 0)
    reach = first[:, None, 3] + second[None, :, 3]
    return np.argwhere(x * x + y * y + z * z <= reach * reach).astype(np.uint32)


def wrapped(rows: Rows | Doubles, periodic: Box) -> Doubles:
    """Float32 spheres within half a length of the origin, without rounding: differences of distant ones would round."""
    wide = rows.astype(np.float64)
    for axis, length in enumerate(periodic):
        if length is not None and rows.dtype == np.float32:
            wide[:, axis] -= length * np.round(wide[:, axis] / length)
    return wide


def brute_force_of_edges(rows: Rows | Doubles, edges: npt.NDArray[np.float64]) -> npt.NDArray[np.uint32]:
    """All pairs of spheres with images in reach, up to three edges away; in canonical order."""
    wide = rows.astype(np.float64)
    turns = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 3), axis=-1).reshape(-1, 3)
    difference = wide[:, None, :3] - wide[None, :, :3]
    nearest = np.min([((difference + turn @ edges) ** 2).sum(axis=2) for turn in turns], axis=0)
    reach = wide[:, None, 3] + wide[None, :, 3]
    found = np.argwhere(nearest <= reach**2)
    return found[found[:, 0] < found[:, 1]].astype(np.uint32)


def scene(seed: int, count: int, box: float = 10.0, largest: float = 0.6) -> Rows:
    """Spheres in a box, of radii over two orders of magnitude."""
    random = np.random.default_rng(seed)
    rows = np.empty((count, 4), dtype=np.float32)
    rows[:, :3] = random.uniform(0, box, (count, 3))
    rows[:, 3] = largest * 10.0 ** random.uniform(-2, 0, count)
    return rows


@pytest.fixture
def spheres() -> Rows:
    """Two hundred spheres, some of which overlap."""
    return scene(1, 200, box=4.0)
