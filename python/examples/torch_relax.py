"""PyTorch on the CPU: overlapping spheres push each other apart, by the gradient of an overlap energy.

The detector reads the tensor in place, and its indices become a tensor without a copy. Without PyTorch the program says
so and ends.
"""

from __future__ import annotations

import numpy as np

import lazygrid

try:
    import torch
except ImportError:
    raise SystemExit(print("skipped: PyTorch is not installed (pip install torch)")) from None

SPHERES, STEPS, BOX, RATE = 2000, 20, 16.0, 0.25


def pairs_of(detector: lazygrid.Detector, rows: torch.Tensor) -> torch.Tensor:
    """Indices of overlapping spheres, int32 of shape ``(m, 2)``."""
    # A tensor without gradient shares its memory with NumPy. Not every PyTorch knows uint32, and these are small.
    return torch.from_numpy(detector.pairs(rows.detach()).view(np.int32))


def energy(rows: torch.Tensor, pairs: torch.Tensor) -> torch.Tensor:
    """Half the squares of all overlaps."""
    # PyTorch indexing needs 64 bits: this is the only copy.
    i, j = pairs.long().unbind(1)
    distance = (rows[i, :3] - rows[j, :3]).norm(dim=1)
    return 0.5 * ((rows[i, 3] + rows[j, 3] - distance).clamp(min=0) ** 2).sum()


def main() -> None:
    torch.manual_seed(1)
    rows = torch.rand(SPHERES, 4) * BOX
    rows[:, 3] = 0.3 + 0.3 * torch.rand(SPHERES)
    # The detector has read the tensor's own memory.
    assert np.asarray(rows).ctypes.data == rows.data_ptr()
    detector = lazygrid.Detector(backend="cpu")
    pairs = pairs_of(detector, rows)
    wide = rows.double()
    distances = torch.cdist(wide[:, :3], wide[:, :3], compute_mode="donot_use_mm_for_euclid_dist")
    in_reach = distances <= wide[:, 3, None] + wide[:, 3]
    assert torch.equal(pairs.long(), in_reach.triu(1).nonzero()), "others than by all distances"

    first = energy(rows, pairs).item()
    for _ in range(STEPS):
        rows.requires_grad_(True)
        left = energy(rows, pairs_of(detector, rows))
        (gradient,) = torch.autograd.grad(left, rows)
        rows = rows.detach()
        rows[:, :3] -= RATE * gradient[:, :3]
    print(f"{SPHERES} spheres, {len(pairs)} pairs at first; energy {first:.1f}, after {STEPS} steps {left.item():.1f}")
    assert left.item() < 0.2 * first


if __name__ == "__main__":
    main()
