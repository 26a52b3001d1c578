"""Model predictive control of a held ball: three fingers keep it in place and level under pushes, 100 times in a second.

    PYTHONPATH=build/release/python OPENBLAS_NUM_THREADS=1 python3 python/examples/mpc.py --out out/mpc

The hand grasps and lifts the ball of `grasp_tripod`. Then every 10 ms one iteration of differential dynamic programming over the next knots
(`handsim.optimise.Receding`) finds targets of the fingers' controller. The same pushes without it are the comparison. Prints simulated
seconds over the CPU seconds of the one thread; writes mpc.json, mpc.svg and, with --video, mpc.mp4.
"""
import argparse
import json
import time
from pathlib import Path

import numpy as np

import handsim as hs
from handsim import optimise
from handsim._derivatives import rotation_vector
from handsim._plot import COLORS, axes, line, sheet_of

HOLD = 2  # steps of a knot: 10 ms


def prepared(scene, begin):
    """A simulation in which the ball is held, at rest."""
    simulation = hs.Simulation(scene)
    simulation.step(substeps=round(begin / simulation.scene.step))
    return simulation


def problem_of(simulation, body, knots):
    out = optimise.Problem(simulation, "targets", range(len(simulation.scene.axes)), knots, HOLD)
    out.base[:] = out.base[0]  # the scene's shaking is not asked for
    out.first, out.about = out.base.copy(), out.base.copy()
    limits = simulation.scene.limits[simulation.scene.axis_coordinates]
    out.low, out.high = np.minimum(limits[:, 0], out.base.min(0)), np.maximum(limits[:, 1], out.base.max(0))
    out.effort[:], out.rate[:] = 1e-3, 1e-5
    place, turn, always = simulation.bodies.position[body], simulation.bodies.quaternion[body], np.full(knots + 1, 0.01)
    free = len(simulation.scene.coordinates) + 6 * out.free.index(body)
    out.terms = [optimise.Term("place", 1e4 * always, optimise.point(out, body, np.zeros(3), np.tile(place, (knots + 1, 1)))),
                 optimise.Term("turn", 5 * always, optimise.turn(out, body, turn)),
                 optimise.Term("still", 1e-1 * always, optimise.still(out, range(free + 3, free + 6)))]
    return out


def pushes(seconds, seed=1, largest=1.0):
    """Force of each knot [N]: pushes of 0.1 s in any direction, 0.1 s between them."""
    random, out = np.random.default_rng(seed), np.zeros((round(100 * seconds), 3))
    for first in range(20, len(out), 20):
        way = random.normal(size=3)
        out[first:first + 10] = largest * way / np.linalg.norm(way)
    return out


def run(scene, begin, window, forces, name, controlled, frames=None):
    """Distances [mm] and turns [deg] of each knot, and CPU seconds of each."""
    simulation, model = prepared(scene, begin), prepared(scene, begin)
    body = simulation.scene.bodies.index(name)
    problem = problem_of(model, body, len(forces) + window)
    # The wrist stands still from here on.
    place, turn = simulation.bodies.position[body], simulation.bodies.quaternion[body]
    control, out, times = optimise.Receding(problem, window), [], []
    for k, force in enumerate(forces):
        before = time.thread_time()
        action = control.action(simulation.motion()) if controlled else problem.base[0]
        for _ in range(HOLD):
            simulation.step(targets=action, forces={name: force})
        times.append(time.thread_time() - before)
        bodies = simulation.bodies
        out.append((1e3 * np.linalg.norm(bodies.position[body] - place), np.degrees(np.linalg.norm(rotation_vector(bodies.quaternion[body], turn)))))
        if frames is not None and k % 4 == 0:
            frames.append(simulation.frame())
    return np.array(out), np.array(times)


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scene", default="grasp_tripod")
    options.add_argument("--body", default="ball")
    options.add_argument("--begin", type=float, default=2.4)
    options.add_argument("--seconds", type=float, default=4)
    options.add_argument("--push", type=float, default=1.0)
    options.add_argument("--window", type=int, default=8)
    options.add_argument("--out", type=Path, default=Path("out/mpc"))
    options.add_argument("--video", action="store_true")
    given = options.parse_args()
    scene = hs.load(given.scene, {"solver": "{engine: articulated, step: 5 ms}"})
    forces, frames, result = pushes(given.seconds, largest=given.push), [], {}
    for name, controlled in (("springs alone", False), ("predictive control", True)):
        off, times = run(scene, given.begin, given.window, forces, given.body, controlled, frames if controlled else None)
        result[name] = {"distance_mm": off[:, 0].tolist(), "turn_deg": off[:, 1].tolist(), "simulated_over_cpu": 0.01 * len(times) / times.sum(),
                        "late_knots": float((times > 0.01).mean())}
        print(f"{name:20} distance: rms {np.sqrt((off[:, 0]**2).mean()):.3f}, largest {off[:, 0].max():.3f} mm; turn: rms {np.sqrt((off[:, 1]**2).mean()):.2f}, "
              f"largest {off[:, 1].max():.2f} deg; simulated s / CPU s {result[name]['simulated_over_cpu']:.2f}, late knots {100 * (times > 0.01).mean():.0f} %")
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "mpc.json").write_text(json.dumps(result))
    drawn = []
    for key, unit in (("distance_mm", "mm"), ("turn_deg", "deg")):
        lines = [result[name][key] for name in result]
        top = max(map(max, lines)) * 1.1
        drawn.append(axes(f"{key.split('_')[0]} (orange: springs alone, blue: controlled)", ("time, s", f"off, {unit}"), (0, given.seconds, 0, top),
                          "".join(line([(0.01 * i, y) for i, y in enumerate(each)], color, False) for each, color in zip(lines, COLORS[::-1])), 0.5 if top < 5 else 5, False))
    (given.out / "mpc.svg").write_text(sheet_of(drawn, 2))
    if given.video:
        pictures = scene.draw_frames(frames, size=(320, 240))
        film = hs._core.video(given.out / "mpc.mp4", 320, 240, 25)
        for each in pictures:
            film.add(each)
        film.finish()


if __name__ == "__main__":
    main()
