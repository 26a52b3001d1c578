"""The suite in PyBullet (pip install pybullet): URDF, the drives as torques that are stable in a step (stable PD, Tan et al. 2011)."""
from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import numpy as np  # noqa: E402
import pybullet as p  # noqa: E402

import suite  # noqa: E402

POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
ROUND = [1, 2, 3, 0]  # w x y z to x y z w


def placed(row: suite.Row, prefix: str = "") -> tuple:
    x = row.vector(*(prefix + name for name in POSE))
    return x[:3].tolist(), x[3:][ROUND].tolist()


def simulate(case: suite.Case, results: suite.Results) -> None:
    if not case.spec["urdf"]:
        raise NotImplementedError("no URDF, and a loop")
    p.resetSimulation()
    p.setTimeStep(case.step)
    links, drives = {}, []
    for each in case.spec["urdf"]:
        own = placed(case.bodies[each["root"]]) if each["root"] != "world" else ([0, 0, 0], [0, 0, 0, 1])
        body = p.loadURDF(str(case.folder / "urdf" / each["file"]), *own, useFixedBase=each["fixed"], flags=p.URDF_USE_INERTIA_FROM_FILE)
        links[each["root"]] = (body, -1)
        if each["root"] in case.bodies and not each["fixed"]:
            row = case.bodies[each["root"]]
            p.resetBaseVelocity(body, row.vector("vx", "vy", "vz").tolist(), row.vector("wx", "wy", "wz").tolist())
        moving = []
        for index in range(p.getNumJoints(body)):
            info = p.getJointInfo(body, index)
            links[info[12].decode()] = (body, index)
            if info[2] == p.JOINT_FIXED:
                continue
            joint = case.joints[info[1].decode()]
            p.resetJointState(body, index, joint["start"], joint["rate"])
            p.setJointMotorControl2(body, index, p.VELOCITY_CONTROL, force=0)
            moving.append((index, joint))
        drives.append((body, each["fixed"], [index for index, _ in moving], {key: np.array([joint[key] for _, joint in moving]) for key in (
            "gain", "rate_gain", "target", "feed", "limit", "tissue_stiffness", "tissue_rest")}))
    pairs = {frozenset((row.text("a"), row.text("b"))): row for row in case.pairs}
    for a, (body_a, link_a) in links.items():
        p.changeDynamics(body_a, link_a, linearDamping=0, angularDamping=0, restitution=0)
        for b, (body_b, link_b) in links.items():
            p.setCollisionFilterPair(body_a, body_b, link_a, link_b, int(frozenset((a, b)) in pairs))
    # Two stiffnesses are in series there, two dampings are added.
    for names, row in pairs.items():
        for body, link in (links[name] for name in names):
            # Bullet takes the product of two coefficients of friction.
            p.changeDynamics(body, link, lateralFriction=np.sqrt(row["friction"]), spinningFriction=row["spinning_friction"])
            if np.isfinite(row["stiffness"]):
                p.changeDynamics(body, link, contactStiffness=2 * row["stiffness"], contactDamping=row["damping"] / 2)
    h = case.step
    for step in range(case.steps + 1):
        time = step * h
        if step % case.every == 0:
            report(case, results, links, time)
        p.setGravity(*case.gravity(time))
        for body, fixed, joints, of in drives:
            if not joints:
                continue
            states = p.getJointStates(body, joints)
            q, u = np.array([state[0] for state in states]), np.array([state[1] for state in states])
            springs = -of["tissue_stiffness"] * (q - of["tissue_rest"])
            drive = of["gain"] * (of["target"] - q - h * u) - of["rate_gain"] * u + of["feed"]
            if fixed and of["gain"].any():
                # The torque at the step's end: that of the state less what the acceleration within the step changes. Contacts and gravity,
                # which share in that, are those of the last step.
                mass, damped = np.array(p.calculateMassMatrix(body, q.tolist())), of["rate_gain"] * h + of["gain"] * h * h
                others = mass @ (u - of["u"]) / h - of["torque"] if "u" in of else -(drive + springs)
                drive = drive - damped * np.linalg.solve(mass + np.diag(damped), drive + springs + others)
            torque = np.clip(drive, -of["limit"], of["limit"]) + springs
            of.update(u=u, torque=torque)
            p.setJointMotorControlArray(body, joints, p.TORQUE_CONTROL, forces=torque.tolist())
        p.stepSimulation()


def report(case: suite.Case, results: suite.Results, links: dict, time: float) -> None:
    for name in case.recorded:
        body, link = links[name]
        total, normal = np.zeros(3), 0.0
        if name == case.touched and time:
            for contact in p.getContactPoints():
                if (body, link) in ((contact[1], contact[3]), (contact[2], contact[4])):
                    # Its normal points to the first of the two.
                    sign = 1 if (body, link) == (contact[1], contact[3]) else -1
                    total += sign * (contact[9] * np.array(contact[7]) + contact[10] * np.array(contact[11]) + contact[12] * np.array(contact[13]))
                    normal += contact[9]
        if link < 0:
            # The base's pose is that of its principal axes; a root's link frame is the body's own.
            own, (velocity, spin) = p.getDynamicsInfo(body, -1), p.getBaseVelocity(body)
            place, turn = p.multiplyTransforms(*p.getBasePositionAndOrientation(body), *p.invertTransform(own[3], own[4]))
        else:
            state = p.getLinkState(body, link, computeLinkVelocity=1, computeForwardKinematics=1)
            place, turn = p.multiplyTransforms(state[4], state[5], *placed(case.bodies[name], "link_"))
            velocity, spin = state[6], state[7]
        results.add(time, name, place, np.array(turn)[[3, 0, 1, 2]], velocity, spin, *((total, normal) if name == case.touched and time else ()))


if __name__ == "__main__":
    p.connect(p.DIRECT)
    sys.exit(suite.run("PyBullet", "3.2.7", "stable PD torques; pads by contactStiffness and contactDamping", simulate))
