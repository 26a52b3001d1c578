"""How a wrist swings that its muscles hold: prints the table of docs/muscles.md, "Short-range stiffness".

    PYTHONPATH=build/release/python python3 tests/muscles/kicked_wrist.py

The flexors of the wrist have a tone, its extensors the multiple of it that holds the hand straight; fingers rest, without gravity. A kick is 0.02 N m of flexion for
10 ms. The frequency is that of the half period between the first two turning points.
"""

from __future__ import annotations

import numpy as np

import handsim as hs

FLEXORS, EXTENSORS = ("FCR", "FCU", "PL"), ("ECRL", "ECRB", "ECU")
STEP = 0.0005
"""[s]"""


def scene_of(**keys: float) -> hs.Scene:
    """A hand without gravity."""
    hand = {"model": "anatomical", "person": "median_man", "side": "right", "wrist": {"mount": "universal", "position": [0, 0, 0.2]}, **keys}
    return hs.load({"title": "a kicked wrist", "hands": [hand], "effects": ["joint_stops", "passive_tissue", "muscles", "tendon_coupling"],
                    "solver": {"engine": "articulated", "method": "semi_implicit_euler", "step": f"{STEP} s"}, "duration": "1 s"})


def held(scene: hs.Scene, tone: float, factor: float) -> tuple[hs.Simulation, np.ndarray, int]:
    """A hand that has come to rest, its excitations, and the coordinate of flexion."""
    names = [muscle.name.split(".")[1] for muscle in scene.muscles]
    excitations = np.array([tone if name in FLEXORS else factor * tone if name in EXTENSORS else 0.0 for name in names])
    simulation = hs.Simulation(scene)
    simulation.step(excitations=excitations, substeps=round(3 / STEP))
    return simulation, excitations, scene.coordinates.index("right.wrist.flexion")


def frequency(tone: float, **keys: float) -> str:
    """Of the swing after a kick [Hz], or that there is none."""
    scene = scene_of(**keys)
    low, high = 0.1, 12.0
    for _ in range(12 if tone else 1):
        simulation, excitations, wrist = held(scene, tone, (low + high) / 2)
        if simulation.q[wrist] > 0:
            low = (low + high) / 2
        else:
            high = (low + high) / 2
    kick = np.zeros(len(scene.coordinates))
    kick[wrist] = 0.02
    simulation.step(kick, excitations=excitations, substeps=round(0.01 / STEP))
    rates = []
    for _ in range(round(0.8 / STEP)):
        simulation.step(excitations=excitations)
        rates.append(simulation.u[wrist])
    turns = np.flatnonzero(np.array(rates[1:]) * np.array(rates[:-1]) < 0)
    return f"{1 / (2 * STEP * (turns[1] - turns[0])):.1f}" if len(turns) > 1 else "creeps back"


def main() -> None:
    """Prints the table."""
    tones = (0.0, 0.02, 0.04, 0.06, 0.08)
    print("| Hz, with a tone of the flexors of | " + " | ".join(f"{100 * tone:g} %" for tone in tones) + " |")
    print("| --- " * (1 + len(tones)) + "|")
    for text, keys in (("without", {}), ("`short_range_stiffness: 23.4`", {"short_range_stiffness": 23.4}),
                       ("the same and `tendon_strain: 0.049`", {"short_range_stiffness": 23.4, "tendon_strain": 0.049})):
        print(f"| {text} | " + " | ".join(frequency(tone, **keys) for tone in tones) + " |")


if __name__ == "__main__":
    main()
