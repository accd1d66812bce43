"""PyTorch on the CPU: spheres that overlap push each other apart, by the gradient of an energy of their overlaps.

The detector reads the tensor where it lies, and the indices that it found become a tensor without a copy. Where PyTorch is
not installed this says so and ends.
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
    """Indices of the spheres that overlap, int32 of shape ``(m, 2)``."""
    # A tensor that needs no gradient shares its memory with NumPy. Not every PyTorch knows uint32, and these are small.
    return torch.from_numpy(detector.pairs(rows.detach()).view(np.int32))


def energy(rows: torch.Tensor, pairs: torch.Tensor) -> torch.Tensor:
    """Half the squares of all overlaps."""
    # PyTorch wants 64 bits of an index: this is the one copy.
    i, j = pairs.long().unbind(1)
    distance = (rows[i, :3] - rows[j, :3]).norm(dim=1)
    return 0.5 * ((rows[i, 3] + rows[j, 3] - distance).clamp(min=0) ** 2).sum()


def main() -> None:
    torch.manual_seed(1)
    rows = torch.rand(SPHERES, 4) * BOX
    rows[:, 3] = 0.3 + 0.3 * torch.rand(SPHERES)
    # What lies in the tensor is what is read: nothing was copied, neither in nor out.
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
