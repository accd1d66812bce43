"""Reading simulators' files."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping

import numpy.typing as npt

from ._errors import FileError
from ._lazygrid import Frame, Frames
from .types import Periodic


def read(
    path: str | os.PathLike[str],
    frame: int | None = None,
    *,
    format: str | None = None,
    radii: Mapping[str, float] | None = None,
    periodic: Periodic | str | None = None,
    ids: bool = False,
    groups: bool = False,
    dtype: npt.DTypeLike = "float32",
) -> Frame:
    """Read the spheres of one frame of a file.

    Formats: CSV, NPY, extended XYZ, LAMMPS dumps and Smoldyn's output, also compressed by gzip or Zstandard.
    :class:`Frames` iterates over the frames of a file, with the same keywords.

    Parameters
    ----------
    path
        The file.
    frame
        The index of the frame, from 0. May be omitted for a file with one frame.
    format
        ``csv``, ``npy``, ``xyz``, ``lammps`` or ``smoldyn``; by default by extension, then by content.
    radii
        Radii by species, in the file's length unit, which override the file's. An unused one is a ``UserWarning``.
    periodic
        The lengths of the periodic axes, ``None`` for an unbounded axis; or ``"none"`` for unbounded space. By default
        the file's box.
    ids
        If true, also reads ids.
    groups
        If true, also reads groups, from a column ``group``, ``molecule`` or ``mol``.
    dtype
        With ``float32``, numbers are rounded, and the first that loses digits is a ``UserWarning``. With ``float64``,
        searches find the pairs of the file's own numbers.

    Raises
    ------
    FileError
        For a file that does not follow its format, with line or row and text; for a missing frame, or several and no
        choice.
    SettingError
        For an unknown format, another ``dtype``, and for radii that are negative or not finite.
    OSError
        If the system refuses the file.
    """
    frames = Frames(path, format=format, radii=radii, periodic=periodic, ids=ids, groups=groups, dtype=dtype)
    for number, found in enumerate(frames):
        if frame is None and not frames.at_end():
            raise FileError(f"{os.fspath(path)}: the file has several frames; choose one with frame=, or use Frames")
        if frame is None or frame == number:
            for message in frames._unused_radius_warnings():
                warnings.warn(message, stacklevel=2)
            return found
    wanted = "no frame" if frame is None else f"no frame {frame}; frames are counted from 0"
    raise FileError(f"{os.fspath(path)}: there is {wanted}")
