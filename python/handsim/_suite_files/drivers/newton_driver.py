"""The suite in Newton on a CPU (pip install newton mujoco mujoco-warp): MJCF, its solver SolverMuJoCo, in single precision."""
from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import newton  # noqa: E402
import numpy as np  # noqa: E402
import warp as wp  # noqa: E402

import suite  # noqa: E402


def simulate(case: suite.Case, results: suite.Results) -> None:
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_mjcf(str(case.folder / "model.xml"), ctrl_direct=True)
    model = builder.finalize(device="cpu")
    bodies = {label.rpartition("/")[2]: index for index, label in enumerate(model.body_label)}
    # Joints of several axes are one there, whose coordinates are in the order of the file.
    q, u, axes = model.joint_q.numpy(), model.joint_qd.numpy(), iter(case.joints)
    for joint, label in enumerate(model.joint_label):
        first, last = model.joint_q_start.numpy()[[joint, joint + 1]]
        speed = model.joint_qd_start.numpy()[joint]
        free = next((row for name, row in case.bodies.items() if label.endswith(f"/{name}/{name}")), None)
        if last - first == 7 and free is not None:
            # The rates of a free joint are those of its body, in the world.
            q[first:last] = free.vector("x", "y", "z", "qx", "qy", "qz", "qw")
            u[speed:speed + 6] = free.vector("vx", "vy", "vz", "wx", "wy", "wz")
            continue
        for place in range(last - first):
            row = case.joints[next(axes)]
            q[first + place], u[speed + place] = row["start"], row["rate"]
    model.joint_q.assign(q)
    model.joint_qd.assign(u)
    solver = newton.solvers.SolverMuJoCo(model)
    now, after, control = model.state(), model.state(), model.control()
    newton.eval_fk(model, model.joint_q, model.joint_qd, now)
    if case.joints:
        control.mujoco.ctrl.assign(np.array([row["target"] if row["gain"] else row["feed"] for row in case.joints.values()], np.float32))
    for step in range(case.steps + 1):
        time = step * case.step
        if step % case.every == 0:
            poses, twists = now.body_q.numpy().astype(float), now.body_qd.numpy().astype(float)
            for name in case.recorded:
                pose, twist = poses[bodies[name]], twists[bodies[name]]
                results.add(time, name, pose[:3], pose[[6, 3, 4, 5]] / np.linalg.norm(pose[3:]), twist[:3], twist[3:])
        if case.spec["shaken"]:
            model.set_gravity(case.gravity(time).tolist())
            solver.notify_model_changed(newton.ModelFlags.MODEL_PROPERTIES)
        solver.step(now, after, control, None, case.step)
        now, after = after, now


if __name__ == "__main__":
    wp.config.quiet = True
    wp.set_device("cpu")
    sys.exit(suite.run("Newton", version("newton"), f"SolverMuJoCo, mujoco-warp {version('mujoco-warp')} on a CPU, as exported", simulate))
