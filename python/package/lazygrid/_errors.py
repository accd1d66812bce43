"""The exceptions of lazygrid."""

from __future__ import annotations


class Error(Exception):
    """The base of all errors. Messages name the value, the limit and the remedy."""


class InputError(Error, ValueError):
    """An invalid input: values that are not finite, negative radii, wrong shapes, unknown species."""

    index: int | None = None
    """The index of the first invalid sphere."""
    value: list[float] | int | None = None
    """Its ``[x, y, z, r]``, or its species id."""
    count: int | None = None
    """The number of spheres that are not finite or have a negative radius."""
    second: bool = False
    """``True`` for the second of two sets."""


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
    """The requested bytes."""
