"""A feedback transmitter, which adapts its emission so that a receiver sees a constant number of molecules.

    python examples/feedback.py

Every 10 steps the transmitter learns the number of molecules inside the receiver, and corrects its rate by the
difference from the target, as an integral controller. Halfway, the program begins to remove some molecules at each
control step, like an enzyme, and the transmitter compensates.
"""

from __future__ import annotations

import numpy as np

import lazygrid

TARGET = 200
EVERY = 10  # steps between two control steps
STEPS = 3000

SCENARIO = {
    "time-step": 1e-3,
    "steps": STEPS,
    "seed": 1,
    "boundary": {"kind": "reflecting", "low": [-5, -5, -5], "high": [5, 5, 5]},
    "species": [{"name": "A", "diffusion": 50.0}],
    "decay": [{"equation": "A ->", "rate": 2.0}],
    "transmitter": [{"name": "tx", "center": [0, 0, 0], "times": [], "release": [{"species": "A", "count": 1}]}],
    "receiver": [{"name": "rx", "center": [3, 0, 0], "radius": 1.5, "kind": "transparent", "species": ["A"]}],
}


def control(seed: int) -> tuple[list[int], list[int]]:
    """The molecules inside the receiver and the emitted molecules, by control step."""
    simulation = lazygrid.Simulation(SCENARIO, seed=seed)
    random = np.random.default_rng(seed)
    inside: list[int] = []
    emitted: list[int] = []
    rate = 0.0

    def correct(run: lazygrid.Simulation) -> None:
        nonlocal rate
        inside.append(run.counts["rx:A"])
        rate = max(0.0, rate + 0.05 * (TARGET - inside[-1]))
        emitted.append(round(rate))
        run.emit("tx", emitted[-1])
        if run.step_count > STEPS // 2:
            ids = run.particles.id
            run.remove(ids[random.random(len(ids)) < 0.02])

    simulation.step(STEPS, callback=correct, every=EVERY)
    return inside, emitted


def main() -> None:
    inside, emitted = control(seed=1)
    quarter = len(inside) // 4
    for name, part in (("before", slice(quarter, 2 * quarter)), ("after", slice(3 * quarter, None))):
        print(
            f"{name} the change: {np.mean(inside[part]):.0f} molecules inside (target {TARGET}), "
            f"{np.mean(emitted[part]):.0f} emitted per control step"
        )
    if abs(np.mean(inside[3 * quarter :]) - TARGET) > 0.1 * TARGET:
        raise SystemExit("the target is missed by more than 10 %")


if __name__ == "__main__":
    main()
