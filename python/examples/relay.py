"""A relay node, which counts the molecules of a far transmitter and forwards each bit with its own molecules.

    python examples/relay.py

The transmitter sends the bits with molecules A. The relay, halfway, counts A inside its sphere at the end of each
symbol and emits molecules B above a threshold. The receiver, too far for A, counts the arrivals of B.
"""

from __future__ import annotations

import lazygrid

SYMBOL = 200  # steps
BITS = [1, 0, 1, 1, 0, 0, 1, 0]
THRESHOLD = 25  # molecules A inside the relay
BURST = 20_000

SCENARIO = {
    "time-step": 1e-3,
    "steps": SYMBOL * (len(BITS) + 1),
    "seed": 4,
    "species": [{"name": "A", "diffusion": 100.0}, {"name": "B", "diffusion": 100.0}],
    # Remaining molecules would disturb later symbols.
    "decay": [{"equation": "A ->", "rate": 10.0}, {"equation": "B ->", "rate": 10.0}],
    "transmitter": [
        {"name": "source", "center": [0, 0, 0], "times": [], "release": [{"species": "A", "count": BURST}]},
        {"name": "relay", "center": [7, 0, 0], "times": [], "release": [{"species": "B", "count": BURST}]},
    ],
    "receiver": [
        {"name": "listens", "center": [7, 0, 0], "radius": 2.0, "kind": "transparent", "species": ["A"]},
        {"name": "end", "center": [14, 0, 0], "radius": 2.0, "kind": "absorbing", "species": ["B"]},
    ],
}


def transmit(bits: list[int], seed: int) -> list[int]:
    """The arrivals of molecules B per symbol period, the first of which has no bit yet."""
    simulation = lazygrid.Simulation(SCENARIO, seed=seed)
    received = []
    for bit in [*bits, 0]:
        if bit:
            simulation.emit("source", BURST, "A")
        arrived = 0
        # The concentration at the relay is highest after about r²/6D = 80 ms.
        peak = 0
        for _ in range(SYMBOL // 20):
            simulation.step(20)
            peak = max(peak, simulation.counts["listens:A"])
            arrived += len(simulation.arrivals)
        received.append(arrived)
        if peak > THRESHOLD:
            simulation.emit("relay", BURST, "B")
    return received


def main() -> None:
    received = transmit(BITS, seed=4)
    level = max(received) / 2
    decoded = [int(count > level) for count in received[1:]]
    print("sent    ", BITS)
    print("received", decoded, "from", received[1:], "arrivals")
    if decoded != BITS:
        raise SystemExit("the bits differ")


if __name__ == "__main__":
    main()
