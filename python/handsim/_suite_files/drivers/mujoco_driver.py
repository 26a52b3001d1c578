"""The suite in MuJoCo 3 and newer (pip install mujoco): the model as exported, the palm still, gravity less the palm's acceleration."""
from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import suite  # noqa: E402


def contact_force(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> tuple[np.ndarray, float]:
    """On a body: the sum in world axes, and the sum of the normal parts."""
    total, normal, own = np.zeros(3), 0.0, np.zeros(6)
    for index in range(data.ncon):
        contact = data.contact[index]
        first, second = model.geom_bodyid[contact.geom1], model.geom_bodyid[contact.geom2]
        if body in (first, second):
            mujoco.mj_contactForce(model, data, index, own)
            # The frame's first axis is from the first shape to the second, on which this force acts.
            total += (1 if body == second else -1) * contact.frame.reshape(3, 3).T @ own[:3]
            normal += own[0]
    return total, normal


def simulate(case: suite.Case, results: suite.Results) -> None:
    model = mujoco.MjModel.from_xml_path(str(case.folder / "model.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for name, joint in case.joints.items():
        if joint["gain"] or joint["feed"]:
            data.ctrl[model.actuator(name).id] = joint["target"] if joint["gain"] else joint["feed"]
    ids = {name: model.body(name).id for name in case.recorded}
    twist, warnings = np.zeros(6), (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
    for step in range(case.steps + 1):
        time = step * case.step
        model.opt.gravity[:] = case.gravity(time)
        if step % case.every == 0:
            # Places and contact forces of the state after the last step.
            mujoco.mj_forward(model, data)
            for name, index in ids.items():
                mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, index, twist, 0)
                forces = contact_force(model, data, index) if name == case.touched else (None, None)
                results.add(time, name, data.xpos[index], data.xquat[index], twist[3:], twist[:3], *forces)
        mujoco.mj_step(model, data)
        if any(data.warning[each].number for each in warnings):
            raise FloatingPointError(f"MuJoCo began anew at {time:g} s: the state left its bounds")


if __name__ == "__main__":
    sys.exit(suite.run("MuJoCo", mujoco.__version__, "as exported", simulate))
