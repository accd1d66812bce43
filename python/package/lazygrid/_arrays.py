"""Arrays that cannot be read where they lie. Called from Rust, for whatever is no plain array of the right type."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import InputError

SHAPES = {1: "(n,)", 2: "(n, 4)"}


def _array(given: Any) -> npt.NDArray[Any]:
    """``given`` as an array, without a copy where its memory can be shared: by NumPy's protocols, else by DLPack."""
    if not hasattr(given, "__array__") and hasattr(given, "__dlpack__"):
        return np.from_dlpack(given)
    return np.asarray(given)


def floats(given: Any, what: str, dimensions: int, cast: bool) -> npt.NDArray[np.float32]:
    """``given`` as float32 in one piece. Values are rounded only if ``cast`` says so."""
    array = _array(given)
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
    array = _array(given)
    if array.ndim != 1:
        raise InputError(f"`{what}` has shape {array.shape} where (n,) is needed")
    return np.require(_within(array, what, np.uint32), np.uint32, ["C", "A"])


def pairs(given: Any, what: str) -> npt.NDArray[np.uint32]:
    """``given`` as uint32 of shape ``(m, 2)``, in one piece; values that do not fit are refused by index."""
    array = _array(given)
    if array.size == 0:
        array = array.reshape(0, 2)
    if array.ndim != 2 or array.shape[1] != 2:
        raise InputError(f"`{what}` has shape {array.shape} where (m, 2) is needed")
    return np.require(_within(array, what, np.uint32), np.uint32, ["C", "A"])


def offsets(given: Any, what: str) -> npt.NDArray[np.uint64]:
    """``given`` as uint64 in one piece; values that do not fit are refused by index."""
    array = _array(given)
    if array.ndim != 1:
        raise InputError(f"`{what}` has shape {array.shape} where (n + 1,) is needed")
    return np.require(_within(array, what, np.uint64), np.uint64, ["C", "A"])


def _within(array: npt.NDArray[Any], what: str, into: type[np.unsignedinteger[Any]]) -> npt.NDArray[Any]:
    """``array``, if it has whole numbers that ``into`` can hold."""
    if array.dtype.kind not in "iu" and array.size > 0:
        raise TypeError(f"`{what}` has values of type {array.dtype} where whole numbers are needed")
    most = np.iinfo(into).max
    outside = (array < 0) | (array > most)
    if outside.any():
        first = tuple(int(at) for at in np.argwhere(outside)[0])
        index = first[0]
        refused = InputError(
            f"`{what}` has {array[first]} at index {index}; whole numbers from 0 to {most} are needed"
        )
        refused.index, refused.value = index, int(array[first])
        raise refused
    return array
