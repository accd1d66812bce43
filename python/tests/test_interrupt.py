"""Ctrl-C in calls that would take minutes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import scene

import lazygrid

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")

# All pairs of a million spheres are 5e11 comparisons.
ROWS = scene(1, 1_000_000, box=1e4)


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """Background processes of a shell ignore Ctrl-C, and so does their Python."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupted(call: Callable[[], Any], seconds: float = 20) -> None:
    """Python raises the same error after a call that was not interrupted, which uses more ``seconds`` of processors."""
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    began = time.process_time()
    with pytest.raises(KeyboardInterrupt):
        timer.start()
        call()
    timer.join()
    assert time.process_time() - began < seconds


def others_run_during(call: Callable[[], Any]) -> bool:
    """Another thread runs in the middle of a call: at its ends the interpreter's lock may change hands anyway."""
    ticks: list[float] = []
    done = threading.Event()

    def tick() -> None:
        while not done.wait(0.001):
            ticks.append(time.monotonic())

    worker = threading.Thread(target=tick)
    worker.start()
    began = time.monotonic()
    call()
    taken = time.monotonic() - began
    done.set()
    worker.join()
    return any(0.3 < (at - began) / taken < 0.7 for at in ticks)


# On a busy machine the other thread may not run in a short call.
TRIES = 10


def test_a_search_ends_and_the_detector_can_be_used_again() -> None:
    detector = lazygrid.Detector(backend="cpu", algorithm="naive", threads=2)
    interrupted(lambda: detector.count(ROWS))
    interrupted(lambda: detector.pairs(ROWS))
    interrupted(lambda: detector.count(ROWS, ROWS))
    assert detector.count(np.zeros((2, 4), dtype=np.float32)) == 1


def test_a_stream_can_be_waited_for_and_left() -> None:
    detector = lazygrid.Detector(backend="cpu", algorithm="naive", order="unordered", threads=2)
    chunks = detector.stream(ROWS)
    interrupted(lambda: next(chunks))
    chunks.close()
    assert detector.count(np.zeros((2, 4), dtype=np.float32)) == 1


def test_a_run_ends() -> None:
    species = {"name": "a", "radius": 0.1, "diffusion": 1.0}
    burst = {"name": "t", "center": [0, 0, 0], "shape": {"kind": "point"}, "release": [{"species": "a", "count": 9}]}
    scenario = {"time-step": 1e-3, "steps": 1_000_000_000, "species": [species], "transmitter": [burst]}
    interrupted(lambda: lazygrid.simulate(scenario, every=1_000_000, threads=2))


def test_other_threads_go_on_meanwhile() -> None:
    detector = lazygrid.Detector(backend="cpu", algorithm="naive")
    assert any(others_run_during(lambda: detector.count(ROWS[:60_000])) for _ in range(TRIES))


OPEN_STREAMS = """
import numpy as np
import lazygrid

rows = np.zeros((3000, 4), dtype=np.float32)
line = np.zeros((100_000, 4), dtype=np.float32)
line[:, 0], line[:, 3] = np.arange(len(line)), 0.5
for order in ("unordered", "canonical"):
    detector = lazygrid.Detector(backend="cpu", order=order, max_pairs=100_000)
    streams = [detector.stream(rows, chunk=1000) for _ in range(3)]
    for stream in streams:
        assert len(next(stream)) == 1000
    assert detector.count(line) == lazygrid.Detector(backend="cpu").count(line) == len(line) - 1
    assert detector.report["pairs"] == len(line) - 1
    for stream in streams:
        stream.close()
first = next(iter(detector.stream(line)))
assert first[0].tolist() == [0, 1]
"""


def test_open_streams_block_no_other_call() -> None:
    run = [sys.executable, "-c", OPEN_STREAMS]
    done = subprocess.run(run, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr


CLOSED_STREAMS = """
import os, time
import numpy as np
import lazygrid

def threads():
    return len(os.listdir("/proc/self/task"))

# NumPy may have a thread per core.
before = threads()
rows = np.zeros((3000, 4), dtype=np.float32)
detector = lazygrid.Detector(backend="cpu")
streams = [detector.stream(rows, chunk=1000) for _ in range(8)]
for stream in streams:
    next(stream)
assert threads() > before + 31
for stream in streams:
    stream.close()
until = time.monotonic() + 100
while threads() > before + 14 and time.monotonic() < until:
    time.sleep(0.01)
print(threads() - before)
assert len(next(iter(detector.stream(rows)))) == 65536
"""


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted on Linux")
def test_threads_of_closed_streams_end() -> None:
    done = subprocess.run(
        [sys.executable, "-c", CLOSED_STREAMS],
        capture_output=True, text=True, check=False, timeout=600, env={**os.environ, "RAYON_NUM_THREADS": "4"},
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) <= 14, done.stdout


def test_list_of_few_atoms_with_many_images_can_be_interrupted() -> None:
    class Atoms:
        positions, cell, pbc, numbers = np.random.default_rng(1).uniform(size=(2000, 3)), np.eye(3), True, np.ones(2000)

    # Uninterrupted, 1e9 pairs are TooManyPairs. All processors search.
    interrupted(lambda: lazygrid.neighbor_list("i", Atoms(), 4.0), seconds=float("inf"))


def test_waiting_for_a_pipe_ends(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    interrupted(lambda: lazygrid.read(pipe))
    end = os.open(pipe, os.O_RDWR)
    os.write(end, b"x,y,z,r\n1,2,3,4\n")
    interrupted(lambda: lazygrid.read(pipe))
    os.close(end)


def test_reading_a_pipe_that_is_never_empty_ends(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    # 100 GB, which take minutes to read.
    rows = f"(echo x,y,z,r,rest; yes 1,2,3,4,{'a' * 10_000} | head -c 100000000000) > '{pipe}'"
    writer = subprocess.Popen(["sh", "-c", rows], stderr=subprocess.DEVNULL)
    interrupted(lambda: lazygrid.read(pipe))
    writer.wait()


def test_a_pipe_is_read_to_its_end(tmp_path: Path) -> None:
    pipe, rows = tmp_path / "pipe.csv", "1,2,3,4\n" * 100_000
    os.mkfifo(pipe)
    writer = threading.Thread(target=lambda: pipe.write_text("x,y,z,r\n" + rows))
    writer.start()
    frame = lazygrid.read(pipe)
    writer.join()
    assert frame.spheres.shape == (100_000, 4) and (frame.spheres == [1, 2, 3, 4]).all()


def test_reading_a_long_file_ends(tmp_path: Path) -> None:
    path, row = tmp_path / "long.npy", np.dtype([(name, "<f4") for name in "xyzr"] + [("rest", "<f4", 200_000)])
    rows = 500_000
    with open(path, "wb") as file:
        header = {"descr": np.lib.format.dtype_to_descr(row), "fortran_order": False, "shape": (rows,)}
        np.lib.format.write_array_header_1_0(file, header)
        # A hole of 400 GB, which takes minutes to read.
        file.truncate(file.tell() + rows * row.itemsize)
    interrupted(lambda: lazygrid.read(path))


def test_copying_for_a_stream_lets_other_threads_go_on() -> None:
    columns = tuple(np.zeros((6_000_000, 2))[:, 0] for _ in range(4))
    detector = lazygrid.Detector(backend="cpu", order="unordered")

    def lets_others_run() -> bool:
        streams: list[Any] = []
        others_ran = others_run_during(lambda: streams.append(detector.stream(columns)))
        streams[0].close()
        return others_ran

    assert any(lets_others_run() for _ in range(TRIES))


def child_succeeds(use: Callable[[], bool]) -> bool:
    """``use`` returns true in a copied process, and does not wait for threads that the copy does not have."""
    child = os.fork()
    if child == 0:
        signal.alarm(200)
        try:
            os._exit(0 if use() else 1)
        except BaseException:
            os._exit(2)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def refuses(use: Callable[[], Any]) -> bool:
    """``use`` raises the error about copied processes."""
    try:
        use()
    except lazygrid.Error as refused:
        return "spawn" in str(refused)
    return False


def child_refuses(use: Callable[[], Any]) -> bool:
    return child_succeeds(lambda: refuses(use))


COPIED = """
import os, sys, tempfile
import numpy as np
import lazygrid
from test_interrupt import child_refuses, child_succeeds

line = np.zeros((100_000, 4), dtype=np.float32)
line[:, 0], line[:, 3] = np.arange(len(line)), 0.5
"""
COPIED_READER = """
with tempfile.TemporaryDirectory() as folder:
    path = folder + "/a.csv"
    with open(path, "w") as file:
        file.write("x,y,z,r\\n1,2,3,4\\n")
    frames = lazygrid.Frames(path)
    next(frames)
    detector = lazygrid.Detector(backend="cpu")
    assert child_refuses(lambda: detector.count(line))
    for use in (lambda: lazygrid.read(path), lambda: next(frames), frames.at_end):
        assert child_refuses(use)
    assert len(lazygrid.read(path).spheres) == 1
"""
COPIED_USER_OF_A_DETECTOR = """
with tempfile.TemporaryDirectory() as folder:
    path = folder + "/a.csv"
    with open(path, "w") as file:
        file.write("x,y,z,r\\n1,2,3,4\\n")
    lazygrid.Detector(backend="cpu").count(line)
    assert child_refuses(lambda: lazygrid.read(path))
"""
COPIED_DETECTOR = """
detector, alone = lazygrid.Detector(backend="cpu", threads=2), lazygrid.Detector(backend="cpu", threads=1)
assert child_refuses(lambda: detector.count(line))
assert child_succeeds(lambda: alone.count(line) == len(line) - 1)
assert detector.count(line) == len(line) - 1
"""
COPIED_UNUSED_DETECTOR = """
detector = lazygrid.Detector(backend="cpu")
assert child_succeeds(lambda: detector.count(line) == len(line) - 1)
"""
COPIED_LIST = """
alone = lazygrid.Detector(backend="cpu", threads=1)
assert len(alone.neighbor_list("ij", line)[0]) == 2 * len(line) - 2
assert child_succeeds(lambda: lazygrid.Detector(backend="cpu").count(line) == len(line) - 1)
lazygrid.Detector(backend="cpu").count(line)
assert child_succeeds(lambda: len(alone.neighbor_list("i", line)) == 2 * len(line) - 2)
"""
COPIED_SIMULATION = """
species = {"name": "a", "radius": 0.1, "diffusion": 1.0}
burst = {"name": "t", "center": [0, 0, 0], "shape": {"kind": "point"}}
burst["release"] = [{"species": "a", "count": 100_000}]
scenario = {"time-step": 1e-3, "steps": 9, "species": [species], "transmitter": [burst]}
for threads in (None, 1, 2):
    run = lazygrid.Simulation(scenario, threads=threads)
    run.step()
    assert child_refuses(lambda: run.step(2))
    assert child_refuses(lambda: run.insert("a", [0, 0, 0]))
    run.step()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not copied here")
@pytest.mark.parametrize(
    "use",
    [COPIED_DETECTOR, COPIED_UNUSED_DETECTOR, COPIED_LIST, COPIED_SIMULATION, COPIED_READER, COPIED_USER_OF_A_DETECTOR],
)
def test_inherited_objects_do_not_wait_for_threads_of_the_parent(use: str) -> None:
    # A process of its own, in which no other test has started threads.
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", COPIED + use],
        capture_output=True, text=True, check=False, timeout=600, cwd=os.path.dirname(__file__),
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not copied here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork")
def test_a_copied_process_does_not_wait_for_threads_that_it_does_not_have() -> None:
    rows = scene(1, 100)
    lazygrid.Detector(backend="cpu").count(rows)
    assert child_succeeds(lambda: lazygrid.Detector(backend="cpu", threads=1).count(rows) > 0)
    assert child_refuses(lambda: lazygrid.Detector(backend="cpu").count(rows))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not copied here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork")
def test_a_stream_in_a_copied_process_refuses_to_wait_for_its_thread() -> None:
    rows = scene(1, 3000)
    for threads in (1, 2):
        stream = lazygrid.Detector(backend="cpu", threads=threads).stream(rows, chunk=10)
        next(stream)

        def is_refused_and_closes() -> bool:
            is_refused = refuses(lambda: next(stream))
            stream.close()
            return is_refused

        assert child_succeeds(is_refused_and_closes)
        assert len(next(stream)) > 0
        stream.close()
