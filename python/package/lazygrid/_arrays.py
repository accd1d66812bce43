"""Conversion of arrays that Rust cannot read in place."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import InputError

Floats = npt.NDArray[Any]
"""An array of float32 or float64."""


def _array(argument: Any, what: str) -> npt.NDArray[Any]:
    """``argument`` as an array, without a copy if its memory can be shared, by NumPy's protocols or DLPack."""
    if not hasattr(argument, "__array__") and hasattr(argument, "__dlpack__"):
        return np.from_dlpack(argument)
    if isinstance(argument, np.ma.MaskedArray) and np.ma.is_masked(argument):
        raise InputError(f"`{what}` has masked values; give array.compressed(), or array.filled() with a value")
    try:
        return np.asarray(argument)
    except ValueError as error:
        raise InputError(f"`{what}` is not an array: {error}") from None


def floats(argument: Any, what: str, width: int) -> Floats:
    """``argument``, of shape ``(n, width)`` or, if the width is 0, ``(n,)``, in a layout for Rust. Rounds nothing."""
    array = _array(argument, what)
    shape = f"(n, {width})" if width else "(n,)"
    if array.ndim == 0 and not isinstance(argument, (np.ndarray, np.generic)):
        on_gpu = hasattr(argument, "__cuda_array_interface__")
        remedy = "copy it from the GPU to the host" if on_gpu else "give an array of NumPy, or what NumPy reads as one"
        kind = type(argument).__name__
        raise InputError(f"`{what}` is of type {kind} where an array of shape {shape} is needed; {remedy}")
    if array.ndim != (2 if width else 1) or (width and array.shape[1] != width):
        remedy = ""
        if width == 4 and array.ndim == 2 and array.shape[1] == 3:
            remedy = "; give points as a tuple (positions, radii)"
        elif array.dtype.names:
            fields = ", ".join(f"a[{name!r}]" for name in array.dtype.names[:8])
            remedy = f"; give the fields of a structured array a as a tuple of four columns, of {fields}"
        raise InputError(f"`{what}` has shape {array.shape} where {shape} is needed{remedy}")
    _check_type(array.dtype, what)
    size = array.dtype.itemsize
    if array.flags.aligned and all(stride >= 0 and stride % size == 0 for stride in array.strides):
        return array
    return np.array(array, order="C")


def _check_type(dtype: np.dtype[Any], what: str) -> None:
    """Refuse all types but float32 and float64."""
    if dtype in (np.float32, np.float64):
        return
    if dtype.kind not in "iuf":
        remedy = "give real numbers"
    elif dtype.newbyteorder("=") in (np.float32, np.float64):
        remedy = f"give array.astype(numpy.{dtype.newbyteorder('=')})"
    elif dtype.itemsize > 8:
        remedy = "give array.astype(numpy.float64), which rounds"
    else:
        remedy = "give array.astype(numpy.float64)"
    raise TypeError(
        f"`{what}` has values of type {dtype}, and lazygrid reads float32 and float64 in native byte order; {remedy}"
    )


def radii(argument: Any, what: str) -> float | Floats:
    """``argument`` as one number, or as ``floats`` of shape ``(n,)``."""
    array = _array(argument, what)
    if array.ndim > 0:
        return floats(array, what, 0)
    if isinstance(argument, int) and array.dtype.kind == "O":
        raise TypeError(f"`{what}` is a whole number of {argument.bit_length()} bits, which float64 cannot hold")
    if array.dtype.kind not in "iuf":
        raise TypeError(f"`{what}` is {argument!r}; give a number, or an array of shape (n,)")
    number = float(array)
    # Python compares whole numbers exactly.
    if number != array.item() and not np.isnan(number):
        raise TypeError(f"`{what}` is {argument!r}, which float64 cannot hold; give float({what})")
    return number


def widened(array: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    """The values as contiguous float64."""
    return np.ascontiguousarray(array, dtype=np.float64)


def in_one_piece(array: Floats) -> Floats:
    """The values as a contiguous array."""
    return np.ascontiguousarray(array)


def points(argument: Any, what: str) -> npt.NDArray[np.float32]:
    """``argument``, of shape ``(n, 3)``, ``(3,)`` or ``(0,)``, as contiguous float32 of shape ``(n, 3)``."""
    array = _array(argument, what)
    if array.shape in ((3,), (0,)):
        array = array.reshape(-1, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"`{what}` has shape {array.shape} where (n, 3) or (3,) is needed")
    return np.require(array, np.float32, ["C", "A"])


def whole(argument: Any, what: str) -> npt.NDArray[np.uint32]:
    """``argument`` as contiguous uint32; refuses values out of range by index."""
    array = _array(argument, what)
    if array.ndim != 1:
        raise InputError(f"`{what}` has shape {array.shape} where (n,) is needed")
    return np.require(_within(array, what, np.uint32), np.uint32, ["C", "A"])


def pairs(argument: Any, what: str) -> npt.NDArray[np.uint32]:
    """``argument`` as contiguous uint32 of shape ``(m, 2)``; refuses values out of range by index."""
    array = _array(argument, what)
    if array.size == 0:
        array = array.reshape(0, 2)
    if array.ndim != 2 or array.shape[1] != 2:
        raise InputError(f"`{what}` has shape {array.shape} where (m, 2) is needed")
    return np.require(_within(array, what, np.uint32), np.uint32, ["C", "A"])


def offsets(argument: Any, what: str) -> npt.NDArray[np.uint64]:
    """``argument`` as contiguous uint64; refuses values out of range by index."""
    array = _array(argument, what)
    if array.ndim != 1:
        raise InputError(f"`{what}` has shape {array.shape} where (n + 1,) is needed")
    return np.require(_within(array, what, np.uint64), np.uint64, ["C", "A"])


def _within(array: npt.NDArray[Any], what: str, into: type[np.unsignedinteger[Any]]) -> npt.NDArray[Any]:
    """``array``, if it has whole numbers in the range of ``into``."""
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
