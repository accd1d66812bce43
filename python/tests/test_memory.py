"""Calls under any limit of the address space raise an error or succeed, and never end the process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

# Each limit has a process of its own, copied before lazygrid has started threads.
SCRIPT = """
import os, resource, sys
import numpy as np
import lazygrid

rows = np.zeros((200_000, 4), dtype=np.float32)
rows[:, 0], rows[:, 3] = 0.5 * np.arange(len(rows)), 0.3
first = np.arange(0, len(rows) - 1, 2, dtype=np.uint32)
bonds = np.stack([first, first + 1], axis=1)
species = [{"name": "a", "radius": 0.1, "diffusion": 1.0}]
burst = {"name": "t", "center": [0, 0, 0], "shape": {"kind": "gaussian", "width": 40.0}}
burst["release"] = [{"species": "a", "count": 100_000}]
scenario = {"time-step": 1e-3, "steps": 2, "contact": "count", "species": species, "transmitter": [burst]}

def detector(**settings):
    return lazygrid.Detector(backend="cpu", threads=2, **settings)

CALLS = [
    lambda: detector(interactions=lazygrid.Interactions(4096, "touch")),
    lambda: detector().pairs(rows, exclusions=lazygrid.Exclusions(len(rows), bonds)),
    lambda: detector().neighbors(rows.astype(np.float64)),
    lambda: sum(map(len, detector().stream(rows))),
    lambda: lazygrid.simulate(scenario, threads=2),
]

def refused():
    count = 0
    for call in CALLS:
        try:
            call()
        except (lazygrid.Error, MemoryError, OSError):
            count += 1
    return count

def under(more):
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    before = resource.getrlimit(resource.RLIMIT_AS)
    mapped = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (mapped + more, before[1]))
    few = refused()
    resource.setrlimit(resource.RLIMIT_AS, before)
    os._exit(1 if refused() else 2 if few else 0)

# Limits of many sizes, and some with little more than the stack of a thread.
limits = [2**20 * 1.35**k for k in range(22)]
stacks = [2**21 + 2**15 * k for k in range(16)]
codes = [under(int(limit)) for limit in stacks + limits]
print(codes)
sys.exit(not (set(codes) == {0, 2} and codes[-1] == 0))
"""


# A table of 4096 species has 256 MiB.
TABLE = """
import resource
import lazygrid

small = lazygrid.Interactions(2)
mapped = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (mapped + 2**26, resource.RLIM_INFINITY))
try:
    lazygrid.Interactions(4096, "touch")
except MemoryError as refused:
    assert isinstance(refused, lazygrid.OutOfMemory) and refused.bytes > 2**26
else:
    raise AssertionError("no error")
try:
    small[0, 2] = 1.0
except lazygrid.InputError as refused:
    assert "species id 2" in str(refused)
"""


# Each thread of the pool maps 2 MiB for its stack.
THREADS = """
import os, resource, sys, tempfile
os.environ["RAYON_NUM_THREADS"] = "2000"
import numpy as np
import lazygrid

class Atoms:
    positions, cell, pbc, numbers = np.zeros((3, 3)), np.zeros((3, 3)), False, np.ones(3)

species = [{"name": "a", "radius": 0.1, "diffusion": 1.0}]
burst = {"name": "t", "center": [0, 0, 0], "shape": {"kind": "point"}, "release": [{"species": "a", "count": 9}]}
scenario = {"time-step": 1e-3, "steps": 2, "species": species, "transmitter": [burst]}
path = sys.argv[1]
CALLS = [
    lambda: lazygrid.read(path),
    lambda: lazygrid.neighbor_list("ij", Atoms(), 1.0),
    lambda: lazygrid.simulate(scenario),
    lambda: lazygrid.Simulation(scenario).step(),
]
for call in CALLS:
    child = os.fork()
    if child == 0:
        mapped = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (mapped + 2**29, resource.RLIM_INFINITY))
        # The second call is refused as the first.
        for _ in range(2):
            try:
                call()
            except lazygrid.Error as refused:
                assert "threads" in str(refused), refused
            else:
                os._exit(2)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, CALLS.index(call)
"""


# A burst in the second step, one by hand, and frames that fill the memory.
RUNS = """
import os, resource
import lazygrid

species = [{"name": "a", "radius": 0.1, "diffusion": 1.0}]
burst = {"name": "t", "center": [0, 0, 0], "shape": {"kind": "point"}, "times": [1e-3]}
burst["release"] = [{"species": "a", "count": 0x7FFFFFFF}]
scenario = {"time-step": 1e-3, "steps": 2, "species": species, "transmitter": [burst]}
crowd = burst | {"times": [0], "release": [{"species": "a", "count": 100_000}]}
frames = scenario | {"steps": 10_000, "transmitter": [crowd]}
rest = scenario | {"transmitter": [burst | {"times": [1.0]}]}
long = scenario | {"steps": 2**32 - 1}
CALLS = [
    lambda: lazygrid.simulate(scenario, threads=1),
    lambda: lazygrid.Simulation(scenario, threads=1).step(2),
    lambda: lazygrid.Simulation(rest, threads=1).emit("t", 0x7FFFFFFF),
    lambda: lazygrid.simulate(frames, frames_every=1, threads=1),
    lambda: lazygrid.simulate(long, every=1, threads=1),
]
for call in CALLS:
    child = os.fork()
    if child == 0:
        mapped = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (mapped + 2**28, resource.RLIM_INFINITY))
        try:
            call()
        except lazygrid.OutOfMemory as refused:
            assert refused.bytes > 2**20, refused
            os._exit(0)
        os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, CALLS.index(call)
"""


# In a process of its own, whose stack may overflow.
NESTED = """
import lazygrid

def nested(depth):
    return [nested(depth - 1)] if depth else 1

itself = []
itself.append(itself)
table = {}
table["x"] = table
for value in (itself, table, nested(81)):
    try:
        lazygrid.simulate({"x": value})
    except lazygrid.SettingError as refused:
        assert "80 levels" in str(refused), refused
    else:
        raise AssertionError("no error")
try:
    lazygrid.simulate({"x": nested(79)})
except lazygrid.SettingError as refused:
    assert "80 levels" not in str(refused), refused
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits and the mapped memory are told by Linux")
def test_memory_refused_within_a_run_is_an_error() -> None:
    run = [sys.executable, "-c", RUNS]
    done = subprocess.run(run, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr


def test_scenario_that_contains_itself_is_refused() -> None:
    done = subprocess.run([sys.executable, "-c", NESTED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="limits and the mapped memory are told by Linux")
def test_refused_threads_are_an_error(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("x,y,z,r\n1,2,3,4\n")
    run = [sys.executable, "-c", THREADS, str(path)]
    done = subprocess.run(run, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="limits and the mapped memory are told by Linux")
def test_refused_table_is_a_memory_error() -> None:
    done = subprocess.run([sys.executable, "-c", TABLE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="limits and the mapped memory are told by Linux")
def test_no_limit_ends_the_process() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
