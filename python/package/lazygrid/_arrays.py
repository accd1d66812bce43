"""Arrays that cannot be read where they lie. Called from Rust, for whatever is no plain array of the right type."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import InputError

SHAPES = {1: "(n,)", 2: "(n, 4)"}


def floats(given: Any, what: str, dimensions: int, cast: bool) -> npt.NDArray[np.float32]:
    """``given`` as float32 in one piece. Values are rounded only if ``cast`` says so."""
    array = np.asarray(given)
    if array.ndim != dimensions:
        raise InputError(f"`{what}` has shape {array.shape} where {SHAPES[dimensions]} is needed")
    if array.dtype.kind not in "iuf":
        raise TypeError(f"`{what}` has values of type {array.dtype}, which are no real numbers")
    if not cast and not np.can_cast(array.dtype, np.float32, "safe"):
        raise TypeError(
            f"`{what}` has values of type {array.dtype}, and lazygrid computes with float32; give "
            "array.astype(numpy.float32), or say cast=True to have it rounded at each call"
        )
    with np.errstate(over="ignore"):
        # What overflows is refused as infinite, by its index.
        return np.require(array, np.float32, ["C", "A"])


def whole(given: Any, what: str) -> npt.NDArray[np.uint32]:
    """``given`` as uint32 in one piece; values that do not fit are refused by index."""
    array = np.asarray(given)
    if array.ndim != 1:
        raise InputError(f"`{what}` has shape {array.shape} where (n,) is needed")
    if array.dtype.kind not in "iu" and array.size > 0:
        raise TypeError(f"`{what}` has values of type {array.dtype} where whole numbers are needed")
    outside = (array < 0) | (array > np.iinfo(np.uint32).max)
    if outside.any():
        index = int(np.argmax(outside))
        refused = InputError(f"`{what}` has {array[index]} at index {index}; ids are from 0 to 2**32 - 1")
        refused.index, refused.value = index, int(array[index])
        raise refused
    return np.require(array, np.uint32, ["C", "A"])
