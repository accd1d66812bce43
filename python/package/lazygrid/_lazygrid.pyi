"""The part of lazygrid that is written in Rust."""

import os
from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import Any, Literal, final

import numpy as np
import numpy.typing as npt
from typing_extensions import Self

from .types import Algorithm, Backend, Labels, Order, Periodic, Report, Skin, Spheres

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
    "SimulationCore",
    "VERSION",
]

NO_GROUP: int
VERSION: str

_Edge = float | tuple[float, float, float]

@final
class Detector:
    """Finds all pairs of overlapping spheres, call after call, and reuses its buffers.

    Two spheres are a pair if their centers are at most ``ri + rj`` apart; touching counts. A set of spheres is

    - an array of shape ``(n, 4)`` with rows ``x, y, z, r``; or
    - a tuple of four arrays of shape ``(n,)``: ``(x, y, z, r)``; or
    - a tuple ``(positions, radii)`` of an array of shape ``(n, 3)``, and an array of shape ``(n,)`` or one number. For all
      pairs of points within a distance ``d``, give the radius ``d / 2``.

    Arrays are float32 or float64, in one length unit, anywhere in space. No number is rounded. Arrays in native byte order
    with strides that are multiples of the item size are read in place, such as columns of a larger array; others are
    copied. Of two types in one set, float32 values are copied to float64. float32 is faster. Other types are a
    ``TypeError``.

    Any number of threads may use one detector at a time: a call releases the interpreter's lock while it runs. The arrays
    of a call must not be written to before it returns. Ctrl-C ends a long call on the CPU.

    Parameters
    ----------
    backend
        The backend. ``"auto"`` takes a GPU if there is one and a call has enough spheres; ``"cpu"`` and
        ``"gpu"`` never fall back.
    algorithm
        How to search; all algorithms find the same pairs.
    threads
        The number of CPU threads; by default all.
    periodic
        The length of each periodic axis, in the unit of the spheres, as float64; ``None`` for an unbounded axis:
        ``(10.0, 10.0, None)``. Coordinates need not lie in the box. For a triclinic box, its cell vectors:
        ``((10.0, 0.0, 0.0), (4.0, 10.0, 0.0), None)``, or the cell of ASE if it is periodic along all vectors.
    order
        ``"canonical"``: by ``i``, then ``j``. ``"unordered"`` omits the sort.
    interactions
        Which species pair, and at which distance; spheres then need species ids.
    max_pairs
        The most pairs a list may hold, by default 2**29 (4 GiB). More are an error with the exact number.
    adapter
        The GPU: its index, or a part of its name, as ``python -m lazygrid devices`` lists them.
    skin
        Whether a candidate list is kept from call to call; no answer depends on it. ``"auto"`` keeps one if spheres move
        so little that this is expected to take less time; ``"off"`` never does. A number keeps the pairs that are up to
        this distance, float64, too far apart, until a sphere has moved by half of it.

    Raises
    ------
    SettingError
        For a setting out of range, and for an algorithm that does not run on the backend.
    Error
        If ``backend="gpu"`` and no GPU can be used.
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
        second: Spheres | None = None,
        *,
        species: Labels | None = None,
        groups: Labels | None = None,
        exclusions: Exclusions | None = None,
        out: npt.NDArray[np.uint32] | None = None,
    ) -> npt.NDArray[np.uint32]:
        """Return the overlapping pairs, each once, in the order of the detector.

        Among one set ``i < j``. Of two sets ``i`` is an index in the first and ``j`` one in the second, and only pairs of one
        sphere of each count.

        >>> detector.pairs(spheres)
        >>> detector.pairs(carriers, receivers, species=(of_carriers, None))

        Parameters
        ----------
        spheres
            The spheres, or the first of two sets; see the class for their forms.
        second
            The second of two sets.
        species
            If the detector has interactions: a species id per sphere, whole numbers of shape ``(n,)``. For two sets a tuple of
            two such arrays.
        groups
            A number per sphere, such as that of its molecule: two spheres of one group are never a pair, unless the group is
            ``lazygrid.NO_GROUP``. Whole numbers of shape ``(n,)``. For two sets a tuple of two, either of which may be
            ``None``; equal numbers are one group.
        exclusions
            Pairs that are never reported, such as bonds; for two sets from :meth:`Exclusions.across`.
        out
            Where to write the pairs: a contiguous uint32 array of shape ``(k, 2)`` with ``k`` at least the number of pairs.

        Returns
        -------
        numpy.ndarray
            uint32 of shape ``(m, 2)``: indices of spheres. With ``out`` a view of its first ``m`` rows.

        Raises
        ------
        InputError
            For values that are not finite and for negative radii, with ``index``, ``value`` and ``count``; for other shapes
            and unknown species. ``second`` is set if the second set is at fault.
        TypeError
            For arrays that are neither float32 nor float64, and for labels that are not whole numbers.
        TooManyPairs
            For more than ``max_pairs`` pairs, or more than ``out`` holds, with the exact number as ``found``.
        OutOfMemory, MemoryError
            If memory is refused.
        KeyboardInterrupt
            After Ctrl-C.
        """

    def neighbors(
        self,
        spheres: Spheres,
        second: Spheres | None = None,
        *,
        species: Labels | None = None,
        groups: Labels | None = None,
        exclusions: Exclusions | None = None,
    ) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.uint32]]:
        """Return neighbor lists: for every sphere all that it overlaps, ascending; each pair is in both lists.

        For two sets, only the spheres of the first have a list, with indices in the second.

        Parameters
        ----------
        spheres, second, species, groups, exclusions
            As in :meth:`pairs`.

        Returns
        -------
        offsets
            uint64 of shape ``(n + 1,)``.
        indices
            uint32. The neighbors of sphere ``k`` are ``indices[offsets[k]:offsets[k + 1]]``.

        Raises
        ------
        InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
            As :meth:`pairs`.
        """

    def count(
        self,
        spheres: Spheres,
        second: Spheres | None = None,
        *,
        species: Labels | None = None,
        groups: Labels | None = None,
        exclusions: Exclusions | None = None,
    ) -> int:
        """Return the number of pairs. The memory it takes does not depend on that number.

        Parameters
        ----------
        spheres, second, species, groups, exclusions
            As in :meth:`pairs`.

        Raises
        ------
        InputError, TypeError, OutOfMemory, KeyboardInterrupt
            As :meth:`pairs`.
        """

    def stream(
        self,
        spheres: Spheres,
        second: Spheres | None = None,
        *,
        chunk: int = 65536,
        species: Labels | None = None,
        groups: Labels | None = None,
        exclusions: Exclusions | None = None,
    ) -> Chunks:
        """Iterate over the pairs in arrays of at most ``chunk`` pairs, however many there are.

        The spheres are copied first, so that you may move them meanwhile, and call the detector. In canonical order the
        detector holds up to ``max_pairs`` pairs, and searches again for every further ``max_pairs``. Unordered chunks come as
        they are found, with at most four in memory.

        >>> detector = lazygrid.Detector(order="unordered")
        >>> for pairs in detector.stream(spheres, chunk=1_000_000):
        ...     histogram += numpy.bincount(pairs[:, 0], minlength=n)

        Parameters
        ----------
        chunk
            The most pairs per array.
        spheres, second, species, groups, exclusions
            As in :meth:`pairs`.

        Raises
        ------
        InputError, TypeError, OutOfMemory, KeyboardInterrupt
            As :meth:`pairs`. The first ``next`` raises errors about values.
        """

    def memory_for(self, spheres: int) -> int:
        """Return an estimate of the bytes that the detector holds for this number of spheres, besides the result."""

    @property
    def report(self) -> Report:
        """The report of the call that ended last; before the first call, of the detector. Times are in seconds."""

@final
class Chunks:
    """An iterator over chunks of pairs, uint32 of shape ``(k, 2)``, from :meth:`Detector.stream`.

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
    """Pairs that a search never reports, such as bonds.

    Pass them to a search, ``detector.pairs(spheres, exclusions=bonds)``. They serve all calls with the same number of
    spheres; make new ones when the number changes. To exclude whole molecules, ``groups`` cost less.

    >>> bonds = lazygrid.Exclusions(len(spheres), [(0, 1), (1, 2)])

    Parameters
    ----------
    spheres
        The number of spheres.
    pairs
        Indices of spheres, whole numbers of shape ``(m, 2)``, in any order. A pair may repeat.

    Raises
    ------
    InputError
        For an index out of range, and for another shape.
    """

    def __new__(cls, spheres: int, pairs: npt.ArrayLike) -> Self: ...
    @staticmethod
    def across(first: int, second: int, pairs: npt.ArrayLike) -> Exclusions:
        """Return exclusions for searches of two sets: pairs of one sphere of each.

        Parameters
        ----------
        first, second
            The numbers of spheres of the two sets.
        pairs
            An index in the first set and one in the second, whole numbers of shape ``(m, 2)``.

        Raises
        ------
        InputError
            As the class.
        """

    @staticmethod
    def from_csr(offsets: npt.ArrayLike, indices: npt.ArrayLike) -> Exclusions:
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

    ``None``: never; ``"touch"``: within ``ri + rj``; a number: within this distance, for any radii.

    >>> reactions = lazygrid.Interactions(2)
    >>> reactions[0, 1] = 0.2
    >>> lazygrid.Detector(interactions=reactions)

    Parameters
    ----------
    species
        The number of species, at most 4096; ids begin at 0.
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
        """The number of species."""

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
        """The length of each periodic axis, or the cell vectors of a triclinic box, for :class:`Detector`; ``None`` in
        unbounded space."""

def neighbors_within(
    quantities: str,
    positions: npt.NDArray[np.float64],
    cutoffs: float | npt.NDArray[np.float64] | tuple[npt.NDArray[np.uint32], npt.NDArray[np.float64]],
    *,
    cell: list[list[float]],
    with_itself: bool,
) -> dict[str, npt.NDArray[Any]]:
    """Return the neighbors of atoms by quantity. See :func:`lazygrid.neighbor_list`."""

@final
class SimulationCore:
    """A run, step by step. See :class:`lazygrid.Simulation`."""

    def __new__(
        cls,
        source: Any,
        *,
        seed: int | None,
        replica: int | None,
        backend: str,
        algorithm: str,
        threads: int | None,
        checkpoint: str | os.PathLike[str] | None,
    ) -> Self: ...
    def step(self, steps: int) -> None: ...
    def insert(self, species: int, positions: npt.NDArray[np.float32]) -> npt.NDArray[np.uint32]: ...
    def remove(self, ids: npt.NDArray[np.uint32]) -> int: ...
    def emit(self, transmitter: int, species: int, count: int) -> npt.NDArray[np.uint32]: ...
    def particles(self) -> dict[str, Any]: ...
    def counts(self) -> dict[str, int]: ...
    def arrivals(self) -> dict[str, Any]: ...
    def checkpoint(self, path: str | os.PathLike[str]) -> None: ...
    @property
    def step_count(self) -> int: ...
    @property
    def time_step(self) -> float: ...
    @property
    def seed(self) -> int: ...
    @property
    def species(self) -> list[str]: ...
    @property
    def transmitters(self) -> list[str]: ...
    @property
    def receivers(self) -> list[str]: ...
    @property
    def warnings(self) -> list[str]: ...

def simulate(source: Any, options: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Return the results of a run, and warnings. See :func:`lazygrid.simulate`."""

def command(arguments: list[str]) -> int:
    """Do what the arguments say, of which the first is the program's name, and return the exit code."""
