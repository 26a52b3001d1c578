"""The suite in handsim: `--engine ode` or `articulated`. The scene that a case was made of, with the case's start, targets and motion."""
from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import numpy as np  # noqa: E402

import handsim  # noqa: E402
import suite  # noqa: E402

ENGINE = sys.argv.pop(sys.argv.index("--engine") + 1) if "--engine" in sys.argv else "articulated"
sys.argv = [word for word in sys.argv if word != "--engine"]


def contact_force(simulation: handsim.Simulation, shapes: set[str]) -> tuple[np.ndarray, float]:
    """On the body of these shapes: the sum in world axes, and the sum of the normal parts."""
    found = simulation.contacts
    sign = np.array([(a in shapes) - (b in shapes) for a, b in zip(found.a, found.b)], float)
    return sign @ found.force, float(np.sum(np.abs(sign) * np.sum(found.force * found.normal, axis=1)))


def simulate(case: suite.Case, results: suite.Results) -> None:
    of = case.spec["handsim"]
    scene = handsim.load(of["scene"], of["set"], engine=ENGINE)
    simulation = handsim.Simulation(scene)
    names = {row.text("shape") for row in suite.read_table(case.folder / "shapes.csv") if row.text("body") == case.touched}
    away, targets, wrist = np.zeros(3), None, None
    if of["base"]:
        # The scene's palm starts elsewhere, with the same rotation: all is moved there, and back in the results.
        away = simulation.bodies.position[scene.bodies.index(of["base"])] - case.bodies[of["base"]].vector("x", "y", "z")
        start = [case.bodies[name].vector("x", "y", "z", "qw", "qx", "qy", "qz") for name in scene.objects]
        simulation.reset(q=[case.joints[name]["start"] for name in scene.coordinates], objects=np.array(start) + [*away, 0, 0, 0, 0])
        targets = np.array([case.joints[name]["target"] for name in scene.axes])
        wrist = np.array(of["wrist"]) + [*away, 0, 0, 0, 0]
    index = {name: scene.bodies.index(name) for name in case.recorded}
    for step in range(case.steps + 1):
        time = step * case.step
        if step % case.every == 0:
            at = simulation.bodies
            for name, i in index.items():
                forces = contact_force(simulation, names) if name == case.touched and step else (None, None)
                results.add(time, name, at.position[i] - away, at.quaternion[i], at.velocity[i], at.angular_velocity[i], *forces)
        moved = None if wrist is None else np.array([wrist + [*case.moved(time + case.step), 0, 0, 0, 0]])
        simulation.step(targets=targets, wrists=moved)


if __name__ == "__main__":
    sys.exit(suite.run(f"handsim {ENGINE}", handsim.__version__, "scenes' own", simulate))
