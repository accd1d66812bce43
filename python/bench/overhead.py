"""Time a call from Python, with float32 and float64 rows, and the same call of the C library.

    python bench/overhead.py [--spheres 2 1000] [--rounds 21]
    cargo build --release -p lazygrid-capi && python bench/overhead.py target/release/liblazygrid.so

All search the same rows, equal spheres that fill 5 % of a box, on one thread, without a skin. They take turns; a table
has the medians of all rounds. Times are processor times. The C library is called by ctypes, which takes about one
microsecond of its time. The bar: at most 3 µs for a call of 2 spheres, and at most 1.10 × the time of the C library at
a million spheres.
"""

from __future__ import annotations

import argparse
import ctypes
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import lazygrid

ON_CPU, SKIN_OFF = 1, 1
F32, F64 = 0, 1


class Settings(ctypes.Structure):
    """``lazygrid_settings``."""

    _fields_ = [
        ("size", ctypes.c_size_t),
        ("backend", ctypes.c_int32),
        ("algorithm", ctypes.c_int32),
        ("order", ctypes.c_int32),
        ("threads", ctypes.c_uint32),
        ("max_pairs", ctypes.c_uint64),
        ("periodic", ctypes.c_double * 3),
        ("timeout_seconds", ctypes.c_uint32),
        ("skin", ctypes.c_int32),
        ("skin_distance", ctypes.c_double),
        ("adapter", ctypes.c_char_p),
        ("interactions", ctypes.c_void_p),
        ("edges", ctypes.c_void_p),
    ]


class Spheres(ctypes.Structure):
    """``lazygrid_spheres``."""

    _fields_ = [
        ("size", ctypes.c_size_t),
        ("count", ctypes.c_size_t),
        ("columns", ctypes.c_void_p * 4),
        ("step", ctypes.c_size_t),
        ("r_step", ctypes.c_size_t),
        ("type", ctypes.c_int32),
        ("zero", ctypes.c_int32),
        ("species", ctypes.c_void_p),
        ("groups", ctypes.c_void_p),
    ]

    @classmethod
    def of_rows(cls, rows: Any) -> Spheres:
        """Rows of float32 or float64."""
        number, step = rows.itemsize, rows.strides[0]
        columns = (ctypes.c_void_p * 4)(*(rows.ctypes.data + number * k for k in range(4)))
        return cls(ctypes.sizeof(cls), len(rows), columns, step, step, F64 if number == 8 else F32)


class Query(ctypes.Structure):
    """``lazygrid_query``."""

    _fields_ = [
        ("size", ctypes.c_size_t),
        ("first", ctypes.POINTER(Spheres)),
        ("second", ctypes.POINTER(Spheres)),
        ("exclusions", ctypes.c_void_p),
    ]


class InC:
    """A detector of the C library."""

    def __init__(self, path: str) -> None:
        self.library = ctypes.CDLL(path)
        self.library.lazygrid_last_error.restype = ctypes.c_char_p
        settings = Settings()
        self.check(self.library.lazygrid_settings_init(ctypes.byref(settings), ctypes.c_size_t(ctypes.sizeof(settings))))
        settings.backend, settings.threads, settings.skin = ON_CPU, 1, SKIN_OFF
        self.detector = ctypes.c_void_p()
        self.check(self.library.lazygrid_create(ctypes.byref(settings), ctypes.byref(self.detector)))

    def check(self, status: int) -> None:
        if status != 0:
            raise RuntimeError(self.library.lazygrid_last_error(None).decode())

    def caller(self, rows: Any) -> Callable[[], int]:
        """Return a function that searches these rows and returns the number of pairs."""
        spheres = Spheres.of_rows(rows)
        query = Query(ctypes.sizeof(Query), ctypes.pointer(spheres))
        pairs, count = ctypes.c_void_p(), ctypes.c_uint64()
        arguments = (self.detector, ctypes.byref(query), ctypes.byref(pairs), ctypes.byref(count))

        def call() -> int:
            self.check(self.library.lazygrid_pairs(*arguments))
            return count.value

        return call


def scene(count: int) -> Any:
    """Rows of equal spheres that fill 5 % of a box."""
    box = (count * 4 / 3 * np.pi * 0.5**3 / 0.05) ** (1 / 3)
    rows = np.full((count, 4), 0.5, dtype=np.float32)
    rows[:, :3] = np.random.default_rng(count).uniform(0, box, (count, 3))
    return rows


def medians(calls: list[Callable[[], Any]], rounds: int, repeat: int) -> list[float]:
    """Seconds per call: medians of rounds in which all take turns."""
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(rounds):
        for taken, call in zip(times, calls):
            began = time.process_time()
            for _ in range(repeat):
                call()
            taken.append((time.process_time() - began) / repeat)
    return [statistics.median(taken) for taken in times]


def main() -> None:
    parser = argparse.ArgumentParser(description="Time a call from Python and the same call from C.")
    parser.add_argument("library", nargs="?", help="the path of liblazygrid.so; without it only Python is timed")
    parser.add_argument("--spheres", type=int, nargs="+", default=[2, 1000, 100_000, 1_000_000])
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    # A detector for each type, so that each keeps its own buffers.
    narrow, wide = (lazygrid.Detector(backend="cpu", threads=1, skin="off") for _ in range(2))
    in_c = InC(options.library) if options.library else None
    print("| spheres | pairs | float32, µs | float64, µs | C, µs | float32 / C |")
    print("| --- " * 6 + "|")
    for count in options.spheres:
        rows = scene(count)
        doubles = rows.astype(np.float64)
        found = len(narrow.pairs(rows))
        calls = [lambda rows=rows: narrow.pairs(rows), lambda rows=doubles: wide.pairs(rows)]
        if in_c:
            from_c = in_c.caller(rows)
            calls.append(from_c)
            if from_c() != found:
                raise SystemExit("Python and C find different pairs")
        times = medians(calls, options.rounds, max(1, 20_000 // count))
        shown = [f"{1e6 * taken:.2f}" for taken in times]
        shown += [f"{times[0] / times[2]:.2f}"] if in_c else ["–", "–"]
        print("| " + " | ".join([f"{count:,}".replace(",", " "), str(found), *shown]) + " |", flush=True)


if __name__ == "__main__":
    main()
