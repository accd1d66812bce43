"""The part of lazygrid in Rust."""

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
    """Finds all pairs of overlapping spheres and reuses its buffers between calls.

    Two spheres are a pair if their centers are at most ``ri + rj`` apart. A set of spheres is

    - an array of shape ``(n, 4)`` with rows ``x, y, z, r``; or
    - a tuple of four arrays of shape ``(n,)``: ``(x, y, z, r)``; or
    - a tuple ``(positions, radii)`` of an array of shape ``(n, 3)``, and an array of shape ``(n,)`` or one number. The
      radius ``d / 2`` finds all points within a distance ``d``.

    Arrays are float32 (faster) or float64 in native byte order, in one length unit; other types are a ``TypeError``. No
    number is rounded. Arrays are read in place if their strides are multiples of the item size, as in columns of a
    larger array; others are copied. With both types in one set, float32 values are copied to float64.

    A call of 64 spheres or more releases the interpreter's lock, and any threads may use one detector at once. Its
    arrays must not change before it returns. Ctrl-C ends a long call on the CPU.

    Parameters
    ----------
    backend
        ``"auto"`` uses a GPU if one exists and a call has enough spheres; ``"cpu"`` and ``"gpu"`` never fall back.
    algorithm
        The algorithm; all find the same pairs.
    threads
        The number of CPU threads; by default all.
    periodic
        The length of each periodic axis, as float64; ``None`` for an unbounded axis: ``(10.0, 10.0, None)``.
        Coordinates need not lie in the box. For a triclinic box, its cell vectors: ``((10.0, 0.0, 0.0), (4.0, 10.0,
        0.0), None)``, or the cell of ASE if it is periodic along all vectors.
    order
        ``"canonical"``: by ``i``, then ``j``. ``"unordered"`` omits the sort.
    interactions
        The species that pair, and their distances; spheres then need species ids.
    max_pairs
        The maximum number of pairs in a list, by default 2**29 (4 GiB).
    adapter
        The GPU: its index, or a part of its name, as listed by ``python -m lazygrid devices``.
    skin
        The skin of the candidate list kept between calls; no answer depends on it. ``"auto"`` keeps a list if spheres
        move so little that it should save time; ``"off"`` never does. A number keeps the pairs with gaps up to this
        distance, until a sphere has moved by half of it; only with the algorithms ``"auto"`` and ``"cell-list"``.
    timeout
        The time limit of each submission to the GPU in seconds; by default ten minutes. A call that is divided or
        repeated has several submissions. Searches on the CPU have no limit: ``backend="cpu"`` refuses one, and with
        ``backend="auto"`` it is unused if no GPU is found.

    Raises
    ------
    SettingError
        For a setting out of range, and for an algorithm that the backend lacks.
    InputError
        For lengths or cell vectors that no periodic box has.
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
        timeout: float | None = None,
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
        """Return the overlapping pairs, each once, in the detector's order.

        For one set, ``i < j``. For two sets only pairs across them count, ``i`` in the first and ``j`` in the second.

        >>> detector.pairs(spheres)
        >>> detector.pairs(carriers, receivers, species=(of_carriers, None))

        Parameters
        ----------
        spheres
            The spheres, or the first of two sets; see the class.
        second
            The second of two sets.
        species
            With interactions: a species id per sphere, whole numbers of shape ``(n,)``; for two sets a tuple of two
            arrays.
        groups
            A group per sphere, such as its molecule, whole numbers of shape ``(n,)``: spheres of one group never pair,
            unless it is ``lazygrid.NO_GROUP``. For two sets a tuple of two arrays or ``None``; equal numbers are one
            group.
        exclusions
            Pairs that are never reported, such as bonds; for two sets from :meth:`Exclusions.across`.
        out
            The output: a contiguous uint32 array of shape ``(k, 2)`` with ``k`` at least the number of pairs.

        Returns
        -------
        numpy.ndarray
            uint32 of shape ``(m, 2)``: indices of spheres. With ``out`` a view of its first ``m`` rows.

        Raises
        ------
        InputError
            For values that are not finite and negative radii, with ``index``, ``value``, ``count`` and ``second``; for
            wrong shapes and unknown species.
        TypeError
            For arrays that are neither float32 nor float64, and labels that are not whole numbers.
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
        """Return neighbor lists: the neighbors of every sphere, ascending; each pair is in both lists.

        For two sets, spheres of the first list indices in the second.

        Parameters
        ----------
        spheres, second, species, groups, exclusions
            See :meth:`pairs`.

        Returns
        -------
        offsets
            uint64 of shape ``(n + 1,)``.
        indices
            uint32. The neighbors of sphere ``k`` are ``indices[offsets[k]:offsets[k + 1]]``.

        Raises
        ------
        InputError, TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
            See :meth:`pairs`.
        """

    def neighbor_list(
        self,
        quantities: str,
        spheres: Spheres,
        second: Spheres | None = None,
        *,
        half: bool = False,
        open: bool = False,
        with_self: bool = False,
        species: Labels | None = None,
        groups: Labels | None = None,
        exclusions: Exclusions | None = None,
    ) -> Any:
        """Return neighbors by quantity, with all periodic images within the cutoff, in a small box also a sphere's own.

        Exclusions apply to all images. The order is by ``i``, then ``j``, then ``S``. Geometry is computed in float64,
        also for a GPU's pairs. :func:`lazygrid.neighbor_list` has the same quantities for atoms of ASE.

        >>> i, j, d = detector.neighbor_list("ijd", spheres)

        Parameters
        ----------
        quantities
            The returned arrays, in this order: ``i`` and ``j``, indices of the spheres, int64 of shape ``(m,)``; ``d``,
            distances, float64 of shape ``(m,)``; ``D``, vectors from ``i`` to ``j``, float64 of shape ``(m, 3)``; ``S``,
            the numbers of cell vectors between them, int64 of shape ``(m, 3)``.
        spheres, second, species, groups, exclusions
            See :meth:`pairs`.
        half
            If true, lists every pair once, ``i < j``, and of two opposite images of a sphere the one whose first nonzero
            shift is positive; else also ``(j, i)``. Without effect on two sets.
        open
            If true, only distances below the cutoff count, as in ASE; else touching counts.
        with_self
            If true, every sphere is its own neighbor at distance zero. Without effect on two sets.

        Returns
        -------
        numpy.ndarray or tuple of numpy.ndarray
            One array if ``quantities`` is one letter.

        Raises
        ------
        InputError
            See :meth:`pairs`; also for unknown quantities, and for cutoffs or coordinates too large for the box.
        TypeError, TooManyPairs, OutOfMemory, MemoryError, KeyboardInterrupt
            See :meth:`pairs`; ``max_pairs`` also limits the examined pairs of a sphere and an image.
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
        """Return the number of pairs, in memory independent of that number.

        Parameters
        ----------
        spheres, second, species, groups, exclusions
            See :meth:`pairs`.

        Raises
        ------
        InputError, TypeError, OutOfMemory, KeyboardInterrupt
            See :meth:`pairs`.
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
        """Iterate over the pairs in arrays of at most ``chunk`` pairs.

        The spheres are copied, and a stream has threads of its own, so you may move the spheres and call the detector
        meanwhile. In canonical order the detector holds up to ``max_pairs`` pairs, and searches again for every further
        ``max_pairs``; if that would be more than 16 searches, it holds more, up to a quarter of the number of spheres.
        Unordered chunks arrive as they are found, at most four in memory.

        >>> detector = lazygrid.Detector(order="unordered")
        >>> for pairs in detector.stream(spheres, chunk=1_000_000):
        ...     histogram += numpy.bincount(pairs[:, 0], minlength=n)

        Parameters
        ----------
        chunk
            The maximum number of pairs per array.
        spheres, second, species, groups, exclusions
            See :meth:`pairs`.

        Raises
        ------
        InputError, TypeError, OutOfMemory, KeyboardInterrupt
            See :meth:`pairs`; errors about values at the first ``next``.
        """

    def memory_for(self, spheres: int) -> int:
        """Estimate the bytes that the detector holds for this number of spheres, without the result."""

    @property
    def report(self) -> Report:
        """The report of the last finished call; before the first call, of the detector. Times are in seconds."""

@final
class Chunks:
    """An iterator over chunks of pairs, uint32 of shape ``(k, 2)``, from :meth:`Detector.stream`.

    A thread searches some chunks ahead. ``close``, the end of a ``with`` block, and dropping the iterator end it.
    """

    def __iter__(self) -> Iterator[npt.NDArray[np.uint32]]: ...
    def __next__(self) -> npt.NDArray[np.uint32]: ...
    def close(self) -> None:
        """End the search and the iteration."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        *_raised: type[BaseException] | BaseException | TracebackType | None,
    ) -> None: ...

@final
class Exclusions:
    """Pairs that a search never reports, such as bonds.

    They are for one number of spheres. To exclude whole molecules, ``groups`` cost less.

    >>> bonds = lazygrid.Exclusions(len(spheres), [(0, 1), (1, 2)])
    >>> detector.pairs(spheres, exclusions=bonds)

    Parameters
    ----------
    spheres
        The number of spheres.
    pairs
        Indices of spheres, whole numbers of shape ``(m, 2)``, in any order and possibly repeated.

    Raises
    ------
    InputError
        For an index out of range, and for a wrong shape.
    """

    def __new__(cls, spheres: int, pairs: npt.ArrayLike) -> Self: ...
    @staticmethod
    def across(first: int, second: int, pairs: npt.ArrayLike) -> Exclusions:
        """Return exclusions for two sets: pairs of one sphere of each.

        Parameters
        ----------
        first, second
            The numbers of spheres.
        pairs
            An index in the first set and one in the second, whole numbers of shape ``(m, 2)``.

        Raises
        ------
        InputError
            See the class.
        """

    @staticmethod
    def from_csr(offsets: npt.ArrayLike, indices: npt.ArrayLike) -> Exclusions:
        """Return the pairs of compressed rows, such as from :meth:`Detector.neighbors`.

        Parameters
        ----------
        offsets
            Whole numbers of shape ``(n + 1,)`` for ``n`` spheres.
        indices
            Whole numbers of shape ``(k,)``. Sphere ``i`` never pairs with ``indices[offsets[i]:offsets[i + 1]]``;
            one of the two rows of a pair suffices.

        Raises
        ------
        InputError
            See the class; also for offsets that do not begin with 0, decrease, or do not end with the number of indices.
        """

    def __len__(self) -> int: ...

@final
class Interactions:
    """A symmetric table of the condition for any two species to pair.

    ``None``: never; ``"touch"``: within ``ri + rj``; a number: within this distance, for any radii.

    >>> reactions = lazygrid.Interactions(2)
    >>> reactions[0, 1] = 0.2
    >>> lazygrid.Detector(interactions=reactions)

    Parameters
    ----------
    species
        The number of species, at most 4096; ids begin at 0.
    default
        The initial interaction of all species.

    Raises
    ------
    InputError
        For an unknown species, or a distance that is negative or not finite.
    """

    def __new__(cls, species: int, default: Literal["touch"] | float | None = None) -> Self: ...
    @property
    def species(self) -> int:
        """The number of species."""

    def __getitem__(self, of: tuple[int, int], /) -> Literal["touch"] | float | None: ...
    def __setitem__(self, of: tuple[int, int], value: Literal["touch"] | float | None, /) -> None: ...

@final
class Frames:
    """An iterator over the frames of a file, with one in memory. :func:`lazygrid.read` reads one frame.

    Numbers are rounded to float32, and the first that loses digits is a ``UserWarning``, unless ``dtype`` is float64. A
    species of ``radii`` that no sphere has is a ``UserWarning`` at the end. If a filter turns a warning into an
    exception, the next ``next`` returns the frame. Ctrl-C ends the iteration.

    Raises
    ------
    FileError
        For a file that does not follow its format, with line or row and text.
    SettingError
        For an unknown format, another ``dtype`` than float32 and float64, and for radii that are negative or not finite.
    OSError
        If the system refuses the file.
    """

    def __new__(
        cls,
        path: str | os.PathLike[str],
        *,
        format: str | None = None,
        radii: Mapping[str, float] | None = None,
        periodic: Periodic | str | None = None,
        ids: bool = False,
        groups: bool = False,
        dtype: npt.DTypeLike = "float32",
    ) -> Self: ...
    def __iter__(self) -> Iterator[Frame]: ...
    def __next__(self) -> Frame: ...
    def at_end(self) -> bool:
        """Return ``True`` after the last frame."""

    def _unused_radius_warnings(self) -> list[str]: ...
    def unused_radii(self) -> list[str]:
        """Return the species of ``radii`` that no frame so far has, probably misspelled."""

    @property
    def format(self) -> str:
        """The format of the file."""

    @property
    def path(self) -> Any:
        """The file, a ``pathlib.Path``."""

@final
class Frame:
    """The spheres of one moment of a file, in the file's length unit."""

    @property
    def spheres(self) -> npt.NDArray[np.float32 | np.float64]:
        """Rows ``x, y, z, r``, of shape ``(n, 4)``, of the requested ``dtype``."""

    @property
    def species(self) -> npt.NDArray[np.uint32] | None:
        """A species id per sphere, of shape ``(n,)``, if the file has species."""

    @property
    def names(self) -> list[str]:
        """The names of the species, by id."""

    @property
    def ids(self) -> npt.NDArray[np.int64] | None:
        """An id per sphere, of shape ``(n,)``, if ids were requested."""

    @property
    def groups(self) -> npt.NDArray[np.uint32] | None:
        """A group per sphere, of shape ``(n,)``, for :meth:`Detector.pairs`, if groups were requested."""

    @property
    def step(self) -> int | None:
        """The simulator's time step, if the file has one."""

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
) -> Any:
    """Return the neighbors of atoms by quantity: an array, or a tuple of arrays. See :func:`lazygrid.neighbor_list`."""

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

def command(arguments: list[str], *, closed: bool = False) -> int:
    """Run the command line, which begins with the program's name, and return the exit code.

    ``closed`` tells that the program began without standard output, so that writing to it fails.
    """
