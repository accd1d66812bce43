"""More pairs than fit in memory: the number of neighbors of each sphere of a crowd, chunk by chunk.

python examples/stream.py [SPHERES]
"""

from __future__ import annotations

import sys

import numpy as np

import lazygrid


def main(count: int = 3_000) -> None:
    spheres = np.zeros((count, 4), dtype=np.float32)
    spheres[:, :3] = np.random.default_rng(1).normal(0, 1, (count, 3))
    spheres[:, 3] = 0.5
    neighbors = np.zeros(count, dtype=np.int64)
    detector = lazygrid.Detector(order="unordered")
    for pairs in detector.stream(spheres, chunk=100_000):
        neighbors += np.bincount(pairs.ravel(), minlength=count)
    print(f"{neighbors.sum() // 2} pairs; {neighbors.min()} to {neighbors.max()} neighbors")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
