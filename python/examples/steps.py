"""Moving spheres: one detector, which reuses its buffers, and one array for the pairs.

python examples/steps.py [SPHERES [STEPS]]
"""

from __future__ import annotations

import sys

import numpy as np

import lazygrid


def main(count: int = 10_000, steps: int = 10) -> None:
    random = np.random.default_rng(1)
    box = 2.0 * count ** (1 / 3)
    spheres = np.empty((count, 4), dtype=np.float32)
    spheres[:, :3] = random.uniform(0, box, (count, 3))
    spheres[:, 3] = random.uniform(0.1, 0.5, count)

    detector = lazygrid.Detector(periodic=(box, box, box))
    room = np.empty((4 * count, 2), dtype=np.uint32)
    for step in range(steps):
        pairs = detector.pairs(spheres, out=room)
        print(f"step {step}: {len(pairs)} pairs of {len(np.unique(pairs))} spheres")
        spheres[:, :3] += random.normal(0, 0.1, (count, 3))
    report = detector.report
    print(f"{report['algorithm']} on {report['backend']}: {report['reason']}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
