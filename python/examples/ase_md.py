"""Molecular dynamics with ASE: a Lennard-Jones calculator with neighbors from lazygrid.

    python examples/ase_md.py [STEPS]

Compares energy and forces with ASE's own calculator, then runs some steps.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from ase import Atoms, units
from ase.build import bulk
from ase.calculators.calculator import Calculator, all_changes
from ase.calculators.lj import LennardJones
from ase.md.velocitydistribution import MaxwellBoltzmannDistribution
from ase.md.verlet import VelocityVerlet

import lazygrid

ARGON: dict[str, float] = {"epsilon": 0.0103, "sigma": 3.4, "rc": 8.5}


class Calculated(Calculator):
    """Lennard-Jones between all atoms within a cutoff, at which the energy is shifted to zero."""

    implemented_properties = ["energy", "forces"]

    def calculate(
        self, atoms: Atoms | None = None, properties: Any = ("energy",), system_changes: Any = all_changes
    ) -> None:
        super().calculate(atoms, properties, system_changes)
        assert self.atoms is not None
        epsilon, sigma, cutoff = ARGON["epsilon"], ARGON["sigma"], ARGON["rc"]
        i, d, vectors = lazygrid.neighbor_list("idD", self.atoms, cutoff)
        sixth = (sigma / d) ** 6
        shift = 4 * epsilon * ((sigma / cutoff) ** 12 - (sigma / cutoff) ** 6)
        # The list has every pair twice.
        energy = 0.5 * np.sum(4 * epsilon * (sixth**2 - sixth) - shift)
        pull = (-24 * epsilon * (2 * sixth**2 - sixth) / d**2)[:, None] * vectors
        forces = np.column_stack([np.bincount(i, pull[:, axis], len(self.atoms)) for axis in range(3)])
        self.results = {"energy": energy, "forces": forces}


def main(steps: int = 20) -> None:
    atoms = bulk("Ar", "fcc", a=5.4, cubic=True) * 6
    atoms.rattle(0.1, seed=1)
    atoms.calc = LennardJones(**ARGON)
    expected = atoms.get_potential_energy(), atoms.get_forces()
    atoms.calc = Calculated()
    assert np.isclose(atoms.get_potential_energy(), expected[0])
    assert np.allclose(atoms.get_forces(), expected[1])
    MaxwellBoltzmannDistribution(atoms, temperature_K=40, rng=np.random.default_rng(1))
    dynamics = VelocityVerlet(atoms, timestep=2 * units.fs)
    before = atoms.get_total_energy()
    dynamics.run(steps)
    after = atoms.get_total_energy()
    print(f"{len(atoms)} atoms, {steps} steps: total energy {before:.6f} eV, then {after:.6f} eV")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
