"""The class Simulation, step by step."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import on_gpu

import lazygrid
from lazygrid import Simulation

SCENARIO: dict[str, Any] = {
    "time-step": 0.001,
    "steps": 60,
    "seed": 3,
    "species": [{"name": "a", "diffusion": 100.0, "radius": 0.05}, {"name": "b", "diffusion": 50.0, "radius": 0.1}],
    "reaction": [{"equation": "a + b -> 0", "rate": 500.0}],
    "transmitter": [
        {
            "name": "tx",
            "center": [0, 0, 0],
            "shape": {"kind": "ball", "radius": 1.0},
            "times": [0.0, 0.02],
            "release": [{"species": "a", "count": 400}, {"species": "b", "count": 200}],
        }
    ],
    "receiver": [
        {"name": "rx", "center": [3, 0, 0], "radius": 1.0, "kind": "absorbing"},
        {"name": "eye", "center": [-3, 0, 0], "radius": 2.0, "kind": "transparent"},
    ],
}


def same(a: Simulation, b: Simulation) -> bool:
    """``True`` if two runs have the same particles and counts."""
    left, right = a.particles, b.particles
    order = np.argsort(left.id), np.argsort(right.id)
    columns = ("x", "y", "z", "radius", "species", "id")
    return a.counts == b.counts and all(
        np.array_equal(getattr(left, name)[order[0]], getattr(right, name)[order[1]]) for name in columns
    )


def test_steps_are_those_of_simulate() -> None:
    expected = lazygrid.simulate(SCENARIO, every=1)
    run = Simulation(SCENARIO)
    assert (run.step_count, run.time_step, run.seed, run.species) == (0, 0.001, 3, ["a", "b"])
    assert (run.transmitters, run.receivers) == (["tx"], ["rx", "eye"])
    for step in range(61):
        assert run.counts == {name: column[step] for name, column in expected.series.items() if name not in ("step", "time")}
        run.step()
    again = Simulation(SCENARIO, threads=1)
    again.step(60)
    particles = again.particles
    order = np.argsort(particles.id)
    assert again.time == pytest.approx(0.06) and len(particles) == len(expected.particles)
    assert np.array_equal(particles.position[order], expected.particles.position)
    assert np.array_equal(particles.id[order], expected.particles.id)


def test_particles_are_views_that_never_change() -> None:
    run = Simulation(SCENARIO)
    first, second = run.particles, run.particles
    assert np.shares_memory(first.x, second.x) and not first.x.flags.writeable and not first.x.flags.owndata
    with pytest.raises(ValueError):
        first.x.flags.writeable = True
    copies = [column.copy() for column in (first.x, first.radius, first.id)]
    run.step(5)
    assert all(np.array_equal(a, b) for a, b in zip(copies, (first.x, first.radius, first.id)))
    moved = run.particles
    assert moved.step == 5 and not np.shares_memory(moved.x, first.x)
    address = moved.x.ctypes.data
    del first, second, moved
    # No array is alive, so the memory stays with the simulation.
    run.remove([])
    assert run.particles.x.ctypes.data == address
    kept = run.particles
    del run
    assert np.isfinite(kept.x).all()


def test_views_serve_a_detector() -> None:
    run = Simulation(SCENARIO)
    particles = run.particles
    rows = np.column_stack([particles.position, particles.radius])
    detector = lazygrid.Detector()
    assert np.array_equal(detector.pairs(particles.spheres), detector.pairs(rows)) and len(detector.pairs(rows)) > 0


def test_arrivals_are_those_of_the_last_call() -> None:
    run = Simulation(SCENARIO)
    total = 0
    ids: set[int] = set()
    for _ in range(6):
        run.step(10)
        arrivals = run.arrivals
        total += len(arrivals)
        ids.update(arrivals.id.tolist())
        assert ((arrivals.step > run.step_count - 10) & (arrivals.step <= run.step_count)).all()
        assert (arrivals.receiver == 0).all() and (arrivals.transmitter == 0).all()
        assert np.isin(arrivals.released, [0, 20]).all()
    assert total == len(ids) == run.counts["rx:a"] + run.counts["rx:b"] > 0


def test_inserted_particles_have_new_ids_and_no_transmitter() -> None:
    run = Simulation(SCENARIO)
    ids = run.insert("b", [[3.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    assert ids.tolist() == [600, 601] and run.counts["b"] == 202
    at = run.particles.id.tolist().index(601)
    assert run.particles.x[at] == 50.0 and run.particles.radius[at] == np.float32(0.1)
    run.step()
    at = run.arrivals.id.tolist().index(600)
    assert (run.arrivals.transmitter[at], run.arrivals.released[at]) == (-1, -1)


def test_inserted_positions_of_other_shapes_are_refused() -> None:
    run = Simulation(SCENARIO)
    before = run.counts
    for shape in ((3, 2), (2, 6), (1, 2, 3), (6,), (4,), (0, 4), ()):
        with pytest.raises(lazygrid.InputError, match=r"where \(n, 3\) or \(3,\) is needed"):
            run.insert("a", np.zeros(shape))
    assert run.counts == before


def test_inserted_positions_are_read_by_rows() -> None:
    positions = np.arange(12, dtype=np.float32).reshape(4, 3)
    for given in (np.asfortranarray(positions), positions.tolist(), positions.astype(np.float64)):
        run = Simulation(SCENARIO)
        ids = run.insert("a", given)
        assert (run.particles.position[np.isin(run.particles.id, ids)] == positions).all()
    assert len(run.insert("a", [1.0, 2.0, 3.0])) == 1
    assert len(run.insert("a", [])) == len(run.insert("a", np.zeros((0, 3)))) == 0
    with pytest.raises(lazygrid.InputError, match="C order"):
        run._core.insert(0, np.asfortranarray(positions))


def test_removed_particles_are_gone() -> None:
    run = Simulation(SCENARIO)
    assert run.remove(np.arange(100)) == 100 and run.remove([5, 10_000]) == 0
    assert run.counts["a"] == 300 and run.particles.id.min() == 100
    run.step()


def test_emitted_particles_have_the_shape_of_the_transmitter() -> None:
    run = Simulation(SCENARIO)
    run.step(7)
    ids = run.emit("tx", 1000, "a")
    chosen = np.isin(run.particles.id, ids)
    distance = np.linalg.norm(run.particles.position[chosen], axis=1)
    assert chosen.sum() == 1000 and distance.max() <= 1.0 and distance.mean() == pytest.approx(0.75, abs=0.03)
    assert run.emit(0, 1, 1).tolist() == [1600]
    run.step(1)


def test_changes_that_are_refused_change_nothing() -> None:
    run = Simulation(SCENARIO)
    before = run.counts
    for change, message in (
        (lambda: run.insert("c", [[0, 0, 0]]), "unknown species 'c'; expected one of a, b"),
        (lambda: run.insert("a", [[0, np.inf, 0]]), "finite"),
        (lambda: run.emit("ty", 1, "a"), "unknown transmitter 'ty'"),
        (lambda: run.emit("tx", 1), "2 species; choose one of a, b"),
        (lambda: run.emit(1, 1, 0), "transmitter 1 is out of range"),
        (lambda: run.step(1, callback=print, every=0), "every = 0"),
    ):
        with pytest.raises(lazygrid.Error, match=message):
            change()
    assert run.counts == before and run.step_count == 0


def test_callbacks_see_and_change_the_run() -> None:
    run = Simulation(SCENARIO)
    seen = []

    def callback(simulation: Simulation) -> bool:
        seen.append(simulation.step_count)
        simulation.emit("tx", 1, "a")
        return len(seen) < 4

    run.step(100, callback=callback, every=7)
    assert seen == [7, 14, 21, 28] and run.step_count == 28
    run.step(9, callback=lambda simulation: (simulation.particles.x < -1e9).any())
    run.step(2, callback=lambda _: None)
    run.step(2, callback=lambda _: 0)
    assert run.step_count == 33
    with pytest.raises(ZeroDivisionError):
        run.step(5, callback=lambda _: 1 / 0)
    assert run.step_count == 34


def test_resumed_run_continues_bit_for_bit(tmp_path: Path) -> None:
    run = Simulation(SCENARIO, seed=11)
    run.step(20)
    run.emit("tx", 50, "b")
    run.checkpoint(tmp_path / "here")
    resumed = Simulation.resume(SCENARIO, tmp_path / "here")
    assert (resumed.step_count, resumed.seed) == (20, 11) and same(run, resumed)
    run.step(20)
    resumed.step(20)
    assert same(run, resumed)
    with pytest.raises(lazygrid.Error, match="another scenario"):
        Simulation.resume(SCENARIO | {"steps": 61}, tmp_path / "here")
    with pytest.raises(FileNotFoundError):
        Simulation.resume(SCENARIO, tmp_path / "nowhere")


def test_replicas_have_independent_seeds() -> None:
    def run(simulation: Simulation) -> tuple[int, int]:
        simulation.step(30)
        return simulation.seed, simulation.counts["rx:a"]

    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(run, Simulation.replicas(SCENARIO, 6, threads=1)))
    assert len({seed for seed, _ in results}) == 6
    assert results == [run(simulation) for simulation in Simulation.replicas(SCENARIO, 6)]


def test_simulation_in_use_by_another_thread_is_refused() -> None:
    run = Simulation(SCENARIO)
    ended = threading.Event()

    def work() -> None:
        run.step(20_000)
        ended.set()

    thread = threading.Thread(target=work)
    thread.start()
    refused = 0
    while not ended.is_set():
        try:
            run.counts
        except lazygrid.Error as error:
            refused += "another thread" in str(error)
    thread.join()
    assert refused > 0 and run.step_count == 20_000


def gpu_run() -> Simulation:
    scenario = {name: value for name, value in SCENARIO.items() if name != "reaction"}
    return on_gpu(lambda: Simulation(scenario, backend="gpu"))


def test_algorithms_of_the_cpu_are_refused_on_a_gpu() -> None:
    scenario = {"time-step": 1e-3, "steps": 1, "species": [{"name": "a", "radius": 0.1, "diffusion": 1.0}]}
    with pytest.raises(lazygrid.SettingError, match="hash-grid searches on the CPU and has no effect"):
        lazygrid.simulate(scenario, backend="gpu", algorithm="hash-grid")


def test_gpu_runs_take_changes() -> None:
    run = gpu_run()
    run.step(3)
    ids = run.emit("tx", 10, "a")
    assert run.remove(ids[:4]) == 4
    run.insert("b", [[9.0, 9.0, 9.0]])
    run.step(2)
    assert run.step_count == 5 and np.isin(ids[4:], run.particles.id).any()


def test_gpu_runs_log_the_steps_of_arrivals() -> None:
    at_once, one_by_one = gpu_run(), gpu_run()
    at_once.step(50)
    rows: list[tuple[int, ...]] = []
    for step in range(1, 51):
        one_by_one.step()
        arrivals = one_by_one.arrivals
        assert (arrivals.step == step).all()
        rows += zip(arrivals.step, arrivals.id, arrivals.species, arrivals.released)
    arrivals = at_once.arrivals
    assert rows == list(zip(arrivals.step, arrivals.id, arrivals.species, arrivals.released))
    assert len(np.unique(arrivals.step)) > 5 and set(arrivals.released) == {0, 20}
    assert len(rows) == at_once.counts["rx:a"] + at_once.counts["rx:b"]
    inserted = at_once.insert("a", [3.0, 0.0, 0.0])
    at_once.step(3)
    at = at_once.arrivals.id.tolist().index(inserted[0])
    assert (at_once.arrivals.step[at], at_once.arrivals.transmitter[at]) == (51, -1)


@pytest.mark.parametrize("example", ["relay.py", "feedback.py"])
def test_examples_succeed(example: str) -> None:
    path = Path(__file__).parent.parent / "examples" / example
    subprocess.run([sys.executable, str(path)], check=True, timeout=300)
