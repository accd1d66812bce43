"""The part of lazygrid that is written in Rust."""

import os
from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import Any, Literal, final

import numpy as np
import numpy.typing as npt
from typing_extensions import Self

from .types import Algorithm, Backend, Order, Periodic, Report, Skin, Spheres

__all__ = [
    "Chunks",
    "command",
    "Detector",
    "Exclusions",
    "Interactions",
    "neighbors_within",
    "Frame",
    "Frames",
    "NO_GROUP",
    "simulate",
    "VERSION",
]

NO_GROUP: int
VERSION: str

_Edge = float | tuple[float, float, float]

@final
class Detector:
    """Finds all pairs of overlapping spheres, call after call, reusing its buffers.

    Two spheres are a pair where their centres are at most ``ri + rj`` apart; touching counts. Spheres are

    - an array of float32 and of shape ``(n, 4)``, with rows ``x, y, z, r``; or
    - a tuple of four arrays of float32, of shape ``(n,)``: ``x``, ``y``, ``z`` and ``r``,

    all in one length unit, anywhere in space. Arrays in one piece are read where they lie; others are copied first.
    Whatever float32 cannot hold, such as float64, is a ``TypeError``, unless ``cast=True`` has it rounded.

    Any number of threads may use one detector at a time: while a call runs the interpreter's lock is released. The
    arrays of a call must not be written to before it returns. Ctrl-C ends a long call on the CPU.

    Parameters
    ----------
    backend
        Where to run. ``"auto"`` takes a GPU where there is one; ``"cpu"`` and ``"gpu"`` never fall back.
    algorithm
        How to search; all find the same pairs.
    threads
        Threads of the CPU; by default all.
    periodic
        The length of each periodic axis, in the unit of the spheres, as float32; ``None`` for one that is unbounded:
        ``(10.0, 10.0, None)``. Coordinates need not lie in the box. Of a box that leans, the edges:
        ``((10.0, 0.0, 0.0), (4.0, 10.0, 0.0), None)``, or the cell of ASE as it is where it is periodic along all edges.
    order
        ``"canonical"``: by ``i``, then ``j``. ``"unordered"`` spares the ordering.
    interactions
        Which species pair, and at which distance; spheres then need species ids.
    max_pairs
        The most pairs a list may hold, by default 2**29 (4 GiB); more are an error with the exact number.
    adapter
        On which GPU: its index, or a part of its name, as ``python -m lazygrid devices`` lists them.
    skin
        Whether candidates, pairs that may soon overlap, are kept from call to call; an answer never depends
        on it. ``"auto"`` keeps them where spheres move so little that it is expected to take less time;
        ``"off"`` never. A number keeps the pairs that are up to this distance too far apart, until some sphere has
        moved by half of it.

    Raises
    ------
    SettingError
        For a setting outside its range; for an algorithm that does not run on the backend.
    Error
        Where a GPU is asked for and cannot be used.
    """

    def __new__(
        cls,
        *,
        backend: Backend = "auto",
        algorithm: Algorithm = "auto",
        threads: int | None = None,
        periodic: Periodic | None = None,
        order: Order = "canonical",
        interactions: Interactions | None = None,
        max_pairs: int | None = None,
        adapter: int | str | None = None,
        skin: Skin = "auto",
    ) -> Self: ...
    def pairs(
        self,
        spheres: Spheres,
        species: npt.ArrayLike | None = None,
        out: npt.NDArray[np.uint32] | None = None,
        *,
        groups: npt.ArrayLike | None = None,
        exclusions: Exclusions | None = None,
        cast: bool = False,
    ) -> npt.NDArray[np.uint32]:
        """Return the overlapping pairs, each once, ``i < j``, in the order that was asked for.

        Parameters
        ----------
        spheres
            Rows of shape ``(n, 4)``, or four columns; see the class.
        species
            Where the detector has interactions: a species id per sphere, uint32 of shape ``(n,)``.
        out
            Where to write the pairs: uint32 in one piece, of shape ``(k, 2)``, with room for all of them.
        groups
            A number per sphere, uint32 of shape ``(n,)``, such as that of its molecule: two spheres of one group are
            never a pair, but for those of ``lazygrid.NO_GROUP``.
        exclusions
            Pairs that are never reported, such as bonds.
        cast
            Whether values of another type may be rounded to float32.

        Returns
        -------
        numpy.ndarray
            uint32 of shape ``(m, 2)``: indices of spheres. With ``out`` a view of its first ``m`` rows.

        Raises
        ------
        InputError
            For values that are not finite and negative radii, with the ``index``, ``value`` and ``count``; for other
            shapes and unknown species.
        TypeError
            For values that are not float32 where ``cast`` is not set.
        TooManyPairs
            For more than ``max_pairs``, or than ``out`` has room for, with the exact number as ``found``.
        OutOfMemory, MemoryError
            Where memory is refused.
        KeyboardInterrupt
            After Ctrl-C.
        """

    def neighbors(
        self,
        spheres: Spheres,
        species: npt.ArrayLike | None = None,
        *,
        groups: npt.ArrayLike | None = None,
        exclusions: Exclusions | None = None,
        cast: bool = False,
    ) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.uint32]]:
        """Return neighbour lists: for every sphere all that it overlaps, ascending; each pair stands in both lists.

        Returns
        -------
        offsets
            uint64 of shape ``(n + 1,)``.
        indices
            uint32 of shape ``(2 * m,)``. The neighbours of sphere ``k`` are ``indices[offsets[k]:offsets[k + 1]]``.

        Raises
        ------
        InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
            As :meth:`pairs`.
        """

    def count(
        self,
        spheres: Spheres,
        species: npt.ArrayLike | None = None,
        *,
        groups: npt.ArrayLike | None = None,
        exclusions: Exclusions | None = None,
        cast: bool = False,
    ) -> int:
        """Return how many pairs there are, in memory that does not depend on their number.

        Raises
        ------
        InputError, TypeError, OutOfMemory, KeyboardInterrupt
            As :meth:`pairs`.
        """

    def stream(
        self,
        spheres: Spheres,
        chunk: int = 65536,
        species: npt.ArrayLike | None = None,
        *,
        groups: npt.ArrayLike | None = None,
        exclusions: Exclusions | None = None,
        cast: bool = False,
    ) -> Chunks:
        """Iterate over the pairs in arrays of at most ``chunk`` pairs, however many there are.

        The spheres are copied first, so that they may be moved meanwhile, and the detector may be called. In canonical
        order the detector holds up to ``max_pairs`` pairs, and searches once more for every so many; unordered chunks
        come as they are found, and no more than four are in memory.

        >>> detector = lazygrid.Detector(order="unordered")
        >>> for pairs in detector.stream(spheres, 1_000_000):
        ...     histogram += numpy.bincount(pairs[:, 0], minlength=n)

        Raises
        ------
        InputError, TypeError, OutOfMemory, KeyboardInterrupt
            As :meth:`pairs`; what is wrong with values is raised by the first ``next``.
        """

    def between(
        self,
        a: Spheres,
        b: Spheres,
        species_a: npt.ArrayLike | None = None,
        species_b: npt.ArrayLike | None = None,
        out: npt.NDArray[np.uint32] | None = None,
        *,
        groups_a: npt.ArrayLike | None = None,
        groups_b: npt.ArrayLike | None = None,
        exclusions: Exclusions | None = None,
        cast: bool = False,
    ) -> npt.NDArray[np.uint32]:
        """Return the pairs of one sphere of ``a`` and one of ``b``, in the order that was asked for.

        No two spheres of one set are ever compared: particles against receivers, say. On the CPU only with
        the algorithms ``"auto"``, ``"cell-list"`` and ``"naive"``.

        Parameters
        ----------
        a, b
            The two sets, each as the spheres of :meth:`pairs`.
        species_a, species_b
            Where the detector has interactions: a species id per sphere of each set.
        groups_a, groups_b
            A group per sphere of each set; the groups of both are the same where their numbers are.
        exclusions
            Pairs that are never reported, made by :meth:`Exclusions.between`.
        out, cast
            As in :meth:`pairs`.

        Returns
        -------
        numpy.ndarray
            uint32 of shape ``(m, 2)``: an index in ``a`` and one in ``b``. With ``out`` a view of its first ``m`` rows.

        Raises
        ------
        InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
            As :meth:`pairs`; an ``InputError`` about values of ``b`` has ``second`` set.
        SettingError
            On the CPU for another algorithm.
        """

    def neighbors_between(
        self,
        a: Spheres,
        b: Spheres,
        species_a: npt.ArrayLike | None = None,
        species_b: npt.ArrayLike | None = None,
        *,
        groups_a: npt.ArrayLike | None = None,
        groups_b: npt.ArrayLike | None = None,
        exclusions: Exclusions | None = None,
        cast: bool = False,
    ) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.uint32]]:
        """Return for every sphere of ``a`` those of ``b`` that it overlaps, ascending.

        Returns
        -------
        offsets
            uint64 of shape ``(len(a) + 1,)``.
        indices
            uint32 of shape ``(m,)``. The neighbours of sphere ``k`` are ``indices[offsets[k]:offsets[k + 1]]``.

        Raises
        ------
        InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt, SettingError
            As :meth:`between`.
        """

    def count_between(
        self,
        a: Spheres,
        b: Spheres,
        species_a: npt.ArrayLike | None = None,
        species_b: npt.ArrayLike | None = None,
        *,
        groups_a: npt.ArrayLike | None = None,
        groups_b: npt.ArrayLike | None = None,
        exclusions: Exclusions | None = None,
        cast: bool = False,
    ) -> int:
        """Return how many pairs of one sphere of ``a`` and one of ``b`` there are.

        Raises
        ------
        InputError, TypeError, OutOfMemory, KeyboardInterrupt, SettingError
            As :meth:`between`.
        """

    def stream_between(
        self,
        a: Spheres,
        b: Spheres,
        chunk: int = 65536,
        species_a: npt.ArrayLike | None = None,
        species_b: npt.ArrayLike | None = None,
        *,
        groups_a: npt.ArrayLike | None = None,
        groups_b: npt.ArrayLike | None = None,
        exclusions: Exclusions | None = None,
        cast: bool = False,
    ) -> Chunks:
        """Iterate over the pairs of one sphere of ``a`` and one of ``b``, as :meth:`stream` does. Both are copied.

        Raises
        ------
        InputError, TypeError, OutOfMemory, KeyboardInterrupt, SettingError
            As :meth:`between`; what is wrong with values or the algorithm is raised by the first ``next``.
        """

    def memory_for(self, spheres: int) -> int:
        """Return an estimate of the bytes that the detector holds for so many spheres, besides the result."""

    @property
    def report(self) -> Report:
        """What the call that ended last did and why; before the first, what is known by then. Times in seconds."""

@final
class Chunks:
    """An iterator over chunks of pairs, uint32 of shape ``(k, 2)``, from :meth:`Detector.stream` and its like.

    A thread searches ahead by some chunks. ``close``, the end of a ``with`` block, and dropping the iterator end it.
    """

    def __iter__(self) -> Iterator[npt.NDArray[np.uint32]]: ...
    def __next__(self) -> npt.NDArray[np.uint32]: ...
    def close(self) -> None:
        """End the search. There are no more chunks."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        *_raised: type[BaseException] | BaseException | TracebackType | None,
    ) -> None: ...

@final
class Exclusions:
    """Pairs that are never reported, whatever their spheres: bonds, say.

    They are given with the spheres, ``detector.pairs(spheres, exclusions=bonds)``, and serve all calls with as many of
    them; when spheres come or go, make them anew. Where whole molecules are left out, ``groups`` cost less.

    >>> bonds = lazygrid.Exclusions(len(spheres), [(0, 1), (1, 2)])

    Parameters
    ----------
    spheres
        How many spheres there are.
    pairs
        Indices of spheres, whole numbers of shape ``(m, 2)``; in either order, or both, and more than once.

    Raises
    ------
    InputError
        For an index that is of no sphere, and another shape.
    """

    def __new__(cls, spheres: int, pairs: npt.ArrayLike) -> Self: ...
    @staticmethod
    def between(first: int, second: int, pairs: npt.ArrayLike) -> Exclusions:
        """Return pairs of one sphere of each of two sets, for :meth:`Detector.between` and its like.

        Parameters
        ----------
        first, second
            How many spheres the two sets have.
        pairs
            An index in the first and one in the second, whole numbers of shape ``(m, 2)``.

        Raises
        ------
        InputError
            As the class.
        """

    @staticmethod
    def rows(offsets: npt.ArrayLike, indices: npt.ArrayLike) -> Exclusions:
        """Return the pairs of compressed rows, as :meth:`Detector.neighbors` returns them.

        Parameters
        ----------
        offsets
            Whole numbers of shape ``(n + 1,)`` for ``n`` spheres.
        indices
            Whole numbers of shape ``(k,)``. Sphere ``i`` is never a pair with ``indices[offsets[i]:offsets[i + 1]]``; it
            is enough that one of two spheres names the other.

        Raises
        ------
        InputError
            As the class, and for offsets that do not begin with 0, fall, or do not end with the number of indices.
        """

    def __len__(self) -> int: ...

@final
class Interactions:
    """A symmetric table: for any two species, what makes them a pair.

    ``None``: never; ``"touch"``: within ``ri + rj``; a number: within this distance, whatever the radii.

    >>> reactions = lazygrid.Interactions(2)
    >>> reactions[0, 1] = 0.2
    >>> lazygrid.Detector(interactions=reactions)

    Parameters
    ----------
    species
        How many species there are, at most 4096; their ids are from 0 on.
    default
        What is between two species of which nothing else is said.

    Raises
    ------
    InputError
        For a species that is not in the table, a distance that is negative or not finite.
    """

    def __new__(cls, species: int, default: Literal["touch"] | float | None = None) -> Self: ...
    @property
    def species(self) -> int:
        """How many species there are."""

    def __getitem__(self, of: tuple[int, int], /) -> Literal["touch"] | float | None: ...
    def __setitem__(self, of: tuple[int, int], value: Literal["touch"] | float | None, /) -> None: ...

@final
class Frames:
    """An iterator over the frames of a file, one in memory at a time. See :func:`lazygrid.read`, which reads one.

    Raises
    ------
    FileError
        With line or row and text, where something else stands than the format asks for.
    OSError
        Where the system refuses the file.
    """

    def __new__(
        cls,
        path: str | os.PathLike[str],
        *,
        format: str | None = None,
        radii: Mapping[str, float] | None = None,
        periodic: Periodic | str | None = None,
        ids: bool = False,
    ) -> Self: ...
    def __iter__(self) -> Iterator[Frame]: ...
    def __next__(self) -> Frame: ...
    def at_end(self) -> bool:
        """Return whether there is no further frame."""

    @property
    def format(self) -> str:
        """The format that is read."""

    @property
    def path(self) -> Any:
        """The file, a ``pathlib.Path``."""

@final
class Frame:
    """The spheres of one moment of a file, in the file's length unit."""

    @property
    def spheres(self) -> npt.NDArray[np.float32]:
        """Rows ``x, y, z, r``, of shape ``(n, 4)``."""

    @property
    def species(self) -> npt.NDArray[np.uint32] | None:
        """A species id per sphere, of shape ``(n,)``, where the file has species."""

    @property
    def names(self) -> list[str]:
        """The names of the species, by id."""

    @property
    def ids(self) -> npt.NDArray[np.int64] | None:
        """An id per sphere, of shape ``(n,)``, where ids were asked for."""

    @property
    def step(self) -> int | None:
        """The simulator's number of the time step, where the file has one."""

    @property
    def periodic(self) -> tuple[_Edge | None, _Edge | None, _Edge | None] | None:
        """The length of each periodic axis, or the edges of a box that leans, for :class:`Detector`; ``None`` in
        unbounded space."""

def neighbors_within(
    quantities: str,
    positions: npt.NDArray[np.float64],
    cutoffs: float | npt.NDArray[np.float64] | tuple[npt.NDArray[np.uint32], npt.NDArray[np.float64]],
    *,
    cell: list[list[float]],
    edges: list[tuple[tuple[int, ...], tuple[float, ...], tuple[float, ...]]],
    with_itself: bool,
) -> dict[str, npt.NDArray[Any]]:
    """Return the neighbours of atoms by quantity. See :func:`lazygrid.neighbor_list`."""

def simulate(source: Any, options: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Return what came of a run, and advice. See :func:`lazygrid.simulate`."""

def command(arguments: list[str]) -> int:
    """Do what the arguments say, of which the first is the program's name, and return the exit code."""
