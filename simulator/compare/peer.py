"""Run another simulator; print the seconds from the first step to the last, by the clock and of processor time.

Usage: peer.py smoldyn|readdy MOLECULES WARM STEPS RECEIVERS

Half A and half B at 5 % density (of spheres with the binding radius of 1 as diameter) in a periodic box, D = 1, a step of
0.05 along each axis, A + B -> 0. WARM steps run before the clock starts. Receivers are absorbing spheres of
radius 0.5 on a lattice; ReaDDy has none.
"""

import os
import random
import sys
import tempfile
import time

peer, molecules, warm, steps, receivers = sys.argv[1], *map(int, sys.argv[2:])
edge = (molecules * 3.141592653589793 / 6 / 0.05) ** (1 / 3)
time_step = 0.00125


def now():
    """Seconds by the clock and of processor time."""
    return time.perf_counter(), time.process_time()


def since(start):
    return [end - begun for begun, end in zip(start, now())]


def surface():
    """The receivers as a surface of Smoldyn."""
    if receivers == 0:
        return ""
    side = next(k for k in range(1, 100) if k**3 >= receivers)
    panels = []
    for k in range(receivers):
        x, y, z = ((c + 0.5) * edge / side for c in (k % side, k // side % side, k // side // side))
        panels.append(f"panel sphere {x} {y} {z} 0.5 10 10")
    text = "\n".join(panels)
    return f"start_surface receivers\naction all both absorb\nmax_panels sphere {receivers}\n{text}\nend_surface"


def run_smoldyn():
    import smoldyn

    text = f"""
dim 3
boundaries x 0 {edge} p
boundaries y 0 {edge} p
boundaries z 0 {edge} p
species A B
difc all 1
molecule_lists listA listB
mol_list A listA
mol_list B listB
max_mol {molecules + 10}
molperbox 0.5
accuracy 10
random_seed 1
time_start 0
time_stop {(warm + steps + 1) * time_step}
time_step {time_step}
mol {molecules // 2} A u u u
mol {molecules // 2} B u u u
reaction r1 A + B -> 0
binding_radius r1 1
{surface()}
end_file
"""
    with tempfile.NamedTemporaryFile("w", suffix=".txt", delete=False) as file:
        file.write(text)
    try:
        simulation = smoldyn.Simulation.fromFile(file.name, "q")
        simulation.runUntil(warm * time_step, dt=time_step)
        start = now()
        simulation.runUntil((warm + steps) * time_step, dt=time_step)
        return since(start)
    finally:
        os.unlink(file.name)


def run_readdy():
    import numpy
    import readdy

    def elapsed(count):
        system = readdy.ReactionDiffusionSystem([edge] * 3, temperature=None, unit_system=None)
        for name in "ABC":
            system.add_species(name, 1.0)
        # ReaDDy requires a product of a reaction of two particles, so C is a placeholder that decays in the next step. Both
        # reactions have probability 1.
        system.reactions.add("r1: A +(1) B -> C", rate=1e9)
        system.reactions.add("r2: C ->", rate=1e9)
        simulation = system.simulation(kernel="SingleCPU")
        simulation.show_progress = False
        positions = numpy.random.default_rng(1).uniform(-edge / 2, edge / 2, (molecules, 3))
        simulation.add_particles("A", positions[: molecules // 2])
        simulation.add_particles("B", positions[molecules // 2 :])
        start = now()
        simulation.run(count, time_step, show_summary=False)
        return since(start)

    # A run cannot continue, so the time of its first steps is subtracted.
    return [longer - shorter for longer, shorter in zip(elapsed(warm + steps), elapsed(warm))]


seconds = {"smoldyn": run_smoldyn, "readdy": run_readdy}[peer]()
print("SECONDS", *seconds)
