"""What a step costs with a cylinder in the hand, and with hulls of its form.

    export PYTHONPATH=build/release/python
    python3 tests/study/mesh_cost.py --out out/mesh_cost

The grip of config/grasp_cylinder_50mm.yaml, on the articulated engine (--engine ode: on ODE by world_step) while the cylinder is held: as a cylinder, as a prism of 30 sides (60 corners)
and of 216 (432), and as a compound of eight slices of 30 sides. Of each the least CPU time of 25 turns, of all by turns, so that a busy machine
counts for all alike.
"""
import argparse
import math
import time
from pathlib import Path

import numpy as np
import yaml

import handsim as hs

RADIUS, LENGTH = 0.025, 0.15
HELD, TURNS, STEPS = 3000, 25, 40


def prism(path, sides, low, high):
    ring = [(RADIUS * math.cos(2 * math.pi * k / sides), RADIUS * math.sin(2 * math.pi * k / sides)) for k in range(sides)]
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for z in (low, high) for x, y in ring]
    for k in range(sides):
        after = (k + 1) % sides
        lines += [f"f {k + 1} {after + 1} {sides + after + 1} {sides + k + 1}"]
    lines += ["f " + " ".join(str(k + 1) for k in reversed(range(sides))), "f " + " ".join(str(sides + k + 1) for k in range(sides))]
    path.write_text("\n".join([*lines, ""]))
    return {"shape": "convex_mesh", "mesh": str(path.resolve())}


def shapes(out):
    """Keys of the object by name."""
    slices = LENGTH * (np.arange(9) / 8 - 0.5)
    return {"cylinder": {"shape": "cylinder", "radius": RADIUS, "length": LENGTH},
            "hull of 60 corners": prism(out / "60.obj", 30, -LENGTH / 2, LENGTH / 2),
            "hull of 432 corners": prism(out / "432.obj", 216, -LENGTH / 2, LENGTH / 2),
            "compound of eight hulls": {"parts": [prism(out / f"slice_{k}.obj", 30, low, high) for k, (low, high) in enumerate(zip(slices, slices[1:]))]}}


def scene_with(keys, engine):
    path = hs.data_path() / "config/grasp_cylinder_50mm.yaml"
    content = yaml.safe_load(path.read_text())
    content["objects"] = [{"name": "cylinder", "mass": "300 g", **keys}]
    if engine != "ode":
        content["solver"] = {"engine": engine, "step": "1 ms"}

    def absolute(value):
        if isinstance(value, dict):
            return {key: absolute(of) for key, of in value.items()}
        if isinstance(value, list):
            return [absolute(each) for each in value]
        return str((path.parent / value).resolve()) if isinstance(value, str) and value.endswith(".yaml") else value

    return hs.load(absolute(content))


def main(out, engine):
    out.mkdir(parents=True, exist_ok=True)
    held, fits = {}, {}
    for name, keys in shapes(out).items():
        start = time.process_time()
        scene = scene_with(keys, engine)
        fits[name] = time.process_time() - start
        held[name] = hs.Simulation(scene)
        held[name].step(substeps=HELD)
    least = dict.fromkeys(held, math.inf)
    for _ in range(TURNS):
        for name, simulation in held.items():
            start = time.process_time()
            simulation.step(substeps=STEPS)
            least[name] = min(least[name], (time.process_time() - start) / STEPS)
    print("| | contacts | CPU time of a step [us] | over the cylinder's | fit of the grip [s] |\n| --- | --- | --- | --- | --- |")
    for name, seconds in least.items():
        print(f"| {name} | {len(held[name].contacts.a)} | {1e6 * seconds:.0f} | {seconds / least['cylinder']:.2f} | {fits[name]:.1f} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/mesh_cost"))
    parser.add_argument("--engine", choices=("articulated", "ode"), default="articulated")
    asked = parser.parse_args()
    main(asked.out, asked.engine)
