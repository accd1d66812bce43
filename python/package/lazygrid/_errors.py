"""What lazygrid raises."""

from __future__ import annotations


class Error(Exception):
    """Whatever lazygrid refuses or fails at. The message names the value, the limit and the remedy."""


class InputError(Error, ValueError):
    """An input that is refused: values that are not finite, negative radii, wrong shapes, unknown species."""

    index: int | None = None
    """The first sphere with a value that is refused, where it is one sphere's."""
    value: list[float] | int | None = None
    """Its ``[x, y, z, r]``, or its species id."""
    count: int | None = None
    """How many spheres are not finite or have a negative radius."""
    second: bool = False
    """Whether it is of the second of two sets."""


class SettingError(Error, ValueError):
    """A setting outside its range, a name that is none, a scenario that makes no sense."""


class FileError(Error, ValueError):
    """A file that does not hold what its format asks for. The message names the line or row and the text."""


class TooManyPairs(Error):
    """More pairs than a list may hold, or than ``out`` has room for. Nothing was truncated."""

    found: int
    """How many pairs there are."""
    limit: int
    """How many there may be."""


class OutOfMemory(Error, MemoryError):
    """Memory that the system or the GPU refused."""

    bytes: int
    """How many bytes were asked for."""
