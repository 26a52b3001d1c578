"""mink, dex-retargeting and OpenSim's inverse kinematics on an exported hand, for inverse_kinematics.py."""
from __future__ import annotations

import re
import time
from typing import NamedTuple, Optional

import numpy as np

FINGERS = ("index", "middle", "ring", "little")
NAMES = ["wrist", *(f"thumb_{joint}" for joint in ("cmc", "mcp", "ip", "tip")), *(f"{f}_{joint}" for f in FINGERS for joint in ("mcp", "pip", "dip", "tip"))]
AXES = ["thumb_cmc.flexion", "thumb_cmc.abduction", "thumb_mcp.flexion", "thumb_ip.flexion",
        *(f"{f}_{axis}" for f in FINGERS for axis in ("mcp.flexion", "mcp.abduction", "pip.flexion", "dip.flexion"))]
BODIES = ["palm", "thumb_metacarpal", "thumb_proximal", "thumb_distal", "thumb_distal",
          *(f"{f}_{part}" for f in FINGERS for part in ("proximal", "middle", "distal", "distal"))]
PALM = [0, 1, 5, 9, 13, 17]
"""Points of the palm, which the joints beside it do not move."""
MOST = 20
START = {axis: 0.5 if axis.endswith("flexion") and not axis.startswith("thumb") else 0.1 for axis in AXES}
"""Angles from which the first frame starts [rad]."""


class Points(NamedTuple):
    """Of a hand."""

    exact: np.ndarray
    """At the true angles (frames, 21, 3)."""
    truth: dict[str, np.ndarray]
    """These, by axis [rad]."""
    bodies: list[str] = BODIES
    """On which they lie."""
    joints: Optional[dict[int, np.ndarray]] = None
    """Centres of the palm's joints in the first frame, by the points of PALM; None: the points."""


def kabsch(from_, to):
    """Rotation and shift of points (n, 3) to others."""
    a, b = from_.mean(0), to.mean(0)
    u, _, vt = np.linalg.svd((to - b).T @ (from_ - a))
    rotation = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return rotation, b - rotation @ a


class Peer:
    """What a program does. `points(angles)`: of its model at angles by axis (21, 3), the palm anywhere. `solve(given)`: its coordinates in each frame,
    `told(coordinates)`: their angles, and the points there."""

    def __init__(self, folder, points):
        self.folder, self.given, self.exact, self.truth, self.bodies = folder, points, points.exact, points.truth, points.bodies
        self.joints = points.joints or {i: points.exact[0][i] for i in PALM if i}

    def local(self, poses, anchors):
        """Places of the points in their bodies. `poses`: rotation and origin by body, at the first true angles; `anchors`: of the palm's joints by index."""
        rotation, shift = kabsch(np.array([self.joints[i] for i in anchors]), np.array(list(anchors.values())))
        return [poses[body][0].T @ (rotation @ point + shift - poses[body][1]) for body, point in zip(self.bodies, self.exact[0])]

    def model_difference(self):
        worst = 0.0
        for k in range(0, len(self.exact), 25):
            own = self.points({axis: values[k] for axis, values in self.truth.items()})
            rotation, shift = kabsch(own, self.exact[k])
            worst = max(worst, np.linalg.norm(own @ rotation.T + shift - self.exact[k], axis=1).max())
        return 1e3 * worst


class Mujoco(Peer):
    def load(self):
        import mujoco

        spec = mujoco.MjSpec.from_file(str(self.folder / "hand.xml"))
        model = spec.compile()
        data = mujoco.MjData(model)
        self.model, self.data = model, data
        self.at = {axis: model.jnt_qposadr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"right.{axis}")] for axis in AXES}
        self.place({axis: values[0] for axis, values in self.truth.items()})
        poses = {name: (data.body(f"right.{name}").xmat.reshape(3, 3).copy(), data.body(f"right.{name}").xpos.copy()) for name in BODIES}
        anchor = {f"{name}": data.joint(f"right.{name}.flexion").xanchor.copy() for name in ("thumb_cmc", *(f"{f}_mcp" for f in FINGERS))}
        places = self.local(poses, {NAMES.index(name): place for name, place in anchor.items()})
        for name, body, place in zip(NAMES, self.bodies, places):
            spec.body(f"right.{body}").add_site(name=name, pos=place)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        return places

    def place(self, angles):
        import mujoco

        for axis, angle in angles.items():
            self.data.qpos[self.at[axis]] = angle
        mujoco.mj_forward(self.model, self.data)

    def points(self, angles):
        self.place(angles)
        return np.array([self.data.site(name).xpos.copy() for name in NAMES])


class Mink(Mujoco):
    name = "mink"

    def version(self):
        import mink

        return mink.__version__ if hasattr(mink, "__version__") else package_version("mink")

    def solve(self, given):
        import mink
        import mujoco

        configuration = mink.Configuration(self.model)
        tasks = [mink.FrameTask(name, "site", position_cost=1.0, orientation_cost=0.0) for name in NAMES]
        limits = [mink.ConfigurationLimit(self.model)]
        own = self.points(START)
        rotation, shift = kabsch(own[PALM], given[0][PALM])
        q = self.data.qpos.copy()
        quat, turn = np.zeros(4), np.zeros(9)
        mujoco.mju_quat2Mat(turn, q[3:7])
        mujoco.mju_mat2Quat(quat, (rotation @ turn.reshape(3, 3)).ravel())
        q[:3], q[3:7] = rotation @ q[:3] + shift, quat
        configuration.update(q)
        found = []
        for k, points in enumerate(given):
            for task, point in zip(tasks, points):
                task.set_target(mink.SE3.from_translation(point))
            for _ in range(MOST if k else 10 * MOST):
                velocity = mink.solve_ik(configuration, tasks, 1.0, "daqp", limits=limits)
                configuration.integrate_inplace(velocity, 1.0)
                if np.abs(velocity).max() < 1e-6:
                    break
            found.append(configuration.q.copy())
        return found

    def told(self, q):
        self.data.qpos[:] = q
        return [q[self.at[axis]] for axis in AXES], self.points({})


class Dex(Peer):
    name = "dex-retargeting, as it is"
    exactly = False
    DUMMY = [f"dummy_{kind}_{axis}" for kind in ("shift", "turn") for axis in "xyz"]

    def version(self):
        return package_version("dex_retargeting")

    def load(self):
        import pinocchio
        from dex_retargeting.optimizer import PositionOptimizer
        from dex_retargeting.robot_wrapper import RobotWrapper

        text = (self.folder / "hand.urdf").read_text()
        links = ["world", *(f"{name}_link" for name in self.DUMMY[:-1]), "right.palm"]
        chain = "".join(f'<joint name="{name}" type="{"prismatic" if "shift" in name else "revolute"}"><parent link="{a}"/><child link="{b}"/>'
                        f'<axis xyz="{" ".join(str(int(name[-1] == axis)) for axis in "xyz")}"/><limit lower="-10" upper="10" effort="1" velocity="1"/></joint>'
                        for name, a, b in zip(self.DUMMY, links, links[1:])) + "".join(f'<link name="{link}"/>' for link in links[1:-1])
        text, count = re.subn(r'<joint name="right\.palm\.world" type="floating">.*?</joint>', chain, text, flags=re.S)
        assert count == 1
        (self.folder / "first.urdf").write_text(text)
        model = pinocchio.buildModelFromUrdf(str(self.folder / "first.urdf"))
        data = model.createData()
        q = np.zeros(model.nq)
        for axis, values in self.truth.items():
            q[model.joints[model.getJointId(f"right.{axis}")].idx_q] = values[0]
        pinocchio.framesForwardKinematics(model, data, q)
        poses = {}
        for body in BODIES:
            of = data.oMf[model.getFrameId(f"right.{body}", pinocchio.BODY)]
            poses[body] = (of.rotation.copy(), of.translation.copy())
        places = self.local(poses, {i: poses[BODIES[i]][1] for i in PALM if i})
        sites = "".join(f'<link name="{name}"/><joint name="{name}.fixed" type="fixed"><parent link="right.{body}"/><child link="{name}"/>'
                        f'<origin xyz="{" ".join(map(repr, map(float, place)))}"/></joint>' for name, body, place in zip(NAMES, self.bodies, places))
        (self.folder / "dummy.urdf").write_text(text.replace("</robot>", sites + "</robot>"))
        self.robot = RobotWrapper(str(self.folder / "dummy.urdf"))
        names = [*self.DUMMY, *(f"right.{axis}" for axis in AXES)]
        self.optimizer = PositionOptimizer(self.robot, names, NAMES, np.arange(21), **({"norm_delta": 0.0} if self.exactly else {}))
        if self.exactly:
            self.optimizer.opt.set_ftol_abs(1e-12)
        limits = self.robot.joint_limits[[self.robot.get_joint_index(name) for name in names]]
        self.optimizer.set_joint_limit(limits)
        self.order = [self.robot.get_joint_index(name) for name in names]

    def full(self, x):
        q = np.zeros(self.robot.dof)
        q[self.order] = x
        return q

    def at(self, x):
        self.robot.compute_forward_kinematics(self.full(x))
        return np.array([self.robot.get_link_pose(self.robot.get_link_index(name))[:3, 3] for name in NAMES])

    def points(self, angles):
        return self.at([*np.zeros(6), *(angles[axis] for axis in AXES)])

    def solve(self, given):
        x = np.array([*np.zeros(6), *(START[axis] for axis in AXES)])
        rotation, shift = kabsch(self.at(x)[PALM], given[0][PALM])
        # The chain of dummy joints turns about x, y, then z.
        x[3:6] = np.arctan2(-rotation[1, 2], rotation[2, 2]), np.arcsin(np.clip(rotation[0, 2], -1, 1)), np.arctan2(-rotation[0, 1], rotation[0, 0])
        x[:3] += given[0][PALM].mean(0) - self.at(x)[PALM].mean(0)
        found = []
        for k, points in enumerate(given):
            for _ in range(1 if k else 20):
                x = self.optimizer.retarget(points.astype(np.float32) if not self.exactly else points, np.zeros(0), np.clip(x, *self.bounds()))
            found.append(x)
        return found

    def told(self, x):
        return x[6:], self.at(x)

    def bounds(self):
        return np.array(self.optimizer.opt.get_lower_bounds()), np.array(self.optimizer.opt.get_upper_bounds())


class DexExactly(Dex):
    name = "dex-retargeting, to 1e-12"
    exactly = True


class OpenSim(Peer):
    name = "OpenSim, as it is"
    accuracy = 1e-5

    def version(self):
        import opensim

        return opensim.GetVersion().partition("-")[0]

    def load(self):
        import opensim

        opensim.Logger.setLevelString("Off")
        places = Mujoco(self.folder, self.given).load()  # bodies have the same frames; model_difference() tests it
        self.model = opensim.Model(str(self.folder / "hand.osim"))
        for name, body, place in zip(NAMES, self.bodies, places):
            self.model.addMarker(opensim.Marker(name, self.model.getBodySet().get(f"right.{body}"), opensim.Vec3(*map(float, place))))
        self.model.finalizeConnections()
        self.state = self.model.initSystem()

    def place(self, angles):
        for axis, angle in angles.items():
            self.model.getCoordinateSet().get(f"right.{axis}").setValue(self.state, float(angle), False)
        self.model.realizePosition(self.state)

    def now(self):
        places = [self.model.getMarkerSet().get(name).getLocationInGround(self.state) for name in NAMES]
        return np.array([[each[i] for i in range(3)] for each in places])

    def points(self, angles):
        self.place(angles)
        return self.now()

    def solve(self, given):
        import opensim

        table = opensim.TimeSeriesTableVec3()
        table.setColumnLabels(NAMES)
        for k, points in enumerate(given):
            table.appendRow(0.008 * k, opensim.RowVectorVec3([opensim.Vec3(*map(float, point)) for point in points]))
        weights = opensim.SetMarkerWeights()
        for name in NAMES:
            weights.cloneAndAppend(opensim.MarkerWeight(name, 1.0))
        self.place(START)
        solver = opensim.InverseKinematicsSolver(self.model, opensim.MarkersReference(table, weights), opensim.SimTKArrayCoordinateReference(), float("inf"))
        solver.setAccuracy(self.accuracy)
        found = []
        coordinates = [each for each in self.model.getCoordinateSet()]
        for k in range(len(given)):
            self.state.setTime(0.008 * k)
            solver.track(self.state) if k else solver.assemble(self.state)
            found.append({coordinate.getName(): coordinate.getValue(self.state) for coordinate in coordinates})
        return found

    def told(self, values):
        self.place({name.removeprefix("right."): value for name, value in values.items()})
        return [values[f"right.{axis}"] for axis in AXES], self.now()


class OpenSimExactly(OpenSim):
    name = "OpenSim, to 1e-9"
    accuracy = 1e-9


def package_version(name):
    from importlib.metadata import version

    return version(name)


def peers(folder, points, given, missing):
    """Each program's name, version and difference of its model [mm]; its angles and points in the given frames, and the CPU time of a frame [s]."""
    for kind in (Mink, Dex, DexExactly, OpenSim, OpenSimExactly):
        peer = kind(folder, points)
        try:
            peer.load()
            version = peer.version()
        except ImportError as error:
            missing.append(f"{kind.name}: {error}")
            continue
        difference = peer.model_difference()
        begin = time.process_time()
        solved = peer.solve(given)
        spent = time.process_time() - begin
        yield {"program": kind.name, "version": version}, difference, *(np.array(each) for each in zip(*map(peer.told, solved))), spent / len(given)
