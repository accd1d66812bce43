"""What a call from Python costs beside the same call of the C library, which is the Rust call and nothing else.

    cargo build --release -p lazygrid-capi && python bench/overhead.py target/release/liblazygrid.so

Both search the same float32 rows, equal spheres that fill 5 % of a box, on one thread, anew at each call. They take turns;
the medians of all rounds are compared, of times of the processor, so that others on the machine do not count as much. What
ctypes costs, about a microsecond, is among what C takes. The bar: at most 5 µs for a call, and 1.10 × at a million spheres.
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


class Settings(ctypes.Structure):
    """``lazygrid_settings``."""

    _fields_ = [
        ("size", ctypes.c_size_t),
        ("backend", ctypes.c_int32),
        ("algorithm", ctypes.c_int32),
        ("order", ctypes.c_int32),
        ("threads", ctypes.c_uint32),
        ("max_pairs", ctypes.c_uint64),
        ("periodic", ctypes.c_float * 3),
        ("timeout_seconds", ctypes.c_uint32),
        ("adapter", ctypes.c_char_p),
        ("interactions", ctypes.c_void_p),
        ("skin", ctypes.c_int32),
        ("skin_distance", ctypes.c_float),
        ("edges", ctypes.c_void_p),
    ]


class Spheres(ctypes.Structure):
    """``lazygrid_spheres``: rows, of which all else is left out."""

    _fields_ = [("count", ctypes.c_size_t), ("rows", ctypes.c_void_p), ("others", ctypes.c_void_p * 7)]


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
        """A function that searches these rows and returns how many pairs there are."""
        spheres = Spheres(len(rows), rows.ctypes.data)
        pairs, count = ctypes.c_void_p(), ctypes.c_uint64()
        arguments = (self.detector, ctypes.byref(spheres), ctypes.byref(pairs), ctypes.byref(count))

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
    """Seconds of a call, each the median of rounds in which all take turns."""
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(rounds):
        for taken, call in zip(times, calls):
            began = time.process_time()
            for _ in range(repeat):
                call()
            taken.append((time.process_time() - began) / repeat)
    return [statistics.median(taken) for taken in times]


def main() -> None:
    parser = argparse.ArgumentParser(description="Time a call from Python beside the same call from C.")
    parser.add_argument("library", help="the path of liblazygrid.so")
    parser.add_argument("--spheres", type=int, nargs="+", default=[2, 1000, 100_000, 1_000_000])
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    detector = lazygrid.Detector(backend="cpu", threads=1, skin="off")
    in_c = InC(options.library)
    print("| spheres | pairs | Python, µs | C, µs | Python / C |")
    print("| --- " * 5 + "|")
    for count in options.spheres:
        rows = scene(count)
        from_c = in_c.caller(rows)
        found = len(detector.pairs(rows))
        if from_c() != found:
            raise SystemExit("the two find different pairs")
        calls = [lambda rows=rows: detector.pairs(rows), from_c]
        python, c = medians(calls, options.rounds, max(1, 20_000 // count))
        taken = [f"{1e6 * python:.1f}", f"{1e6 * c:.1f}", f"{python / c:.2f}"]
        print("| " + " | ".join([f"{count:,}".replace(",", " "), str(found), *taken]) + " |", flush=True)


if __name__ == "__main__":
    main()
