"""The exceptions of lazygrid."""

from __future__ import annotations


class Error(Exception):
    """The base of all errors. The message names the value, the limit and the remedy."""


class InputError(Error, ValueError):
    """An invalid input: values that are not finite, negative radii, wrong shapes, unknown species."""

    index: int | None = None
    """The index of the first invalid sphere, if a sphere is at fault."""
    value: list[float] | int | None = None
    """Its ``[x, y, z, r]``, or its species id."""
    count: int | None = None
    """The number of spheres that are not finite or have a negative radius."""
    second: bool = False
    """``True`` if the second of two sets is at fault."""


class SettingError(Error, ValueError):
    """A setting out of range, an unknown name, an invalid scenario."""


class FileError(Error, ValueError):
    """A file that does not follow its format. The message names the line or row and the text."""


class TooManyPairs(Error):
    """More pairs than a list may have, or than ``out`` can hold. Nothing was truncated."""

    found: int
    """The exact number of pairs."""
    limit: int
    """The largest allowed number."""


class OutOfMemory(Error, MemoryError):
    """The system or the GPU is out of memory."""

    bytes: int
    """The number of requested bytes."""
