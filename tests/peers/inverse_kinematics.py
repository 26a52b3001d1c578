"""Joint angles from 21 keypoints: `handsim track` beside mink, dex-retargeting and OpenSim on the exported hand, for the same points.

    pip install --target out/ik mink daqp dex_retargeting nlopt pin torch opensim    # whatever of it is missing is said and left out
    python3 tests/peers/inverse_kinematics.py build/release/src/handsim --packages out/ik [--out FILE.json] [--frames N]

The points are those of the right hand of config/bench.yaml, exact and with 2 mm of normal noise in every coordinate. All know the hand: handsim has
its person, the others the model that `handsim export` writes of it (MJCF, URDF, OpenSim), its palm free, and the places of the points in it. Each frame
starts from the angles of the frame before, the first one from half bent fingers. Of each program:

- model: largest distance of its points at the true angles from the exact ones, after the rigid motion that fits best [mm]: what the exports differ by
- fingers, all: RMS difference of the flexion axes of the fingers, of all axes, from the true angles [deg]
- points: RMS distance of the fitted points from the given ones [mm]
- time: CPU time of a frame [ms], of this process or of the fits of handsim

mink: FrameTask of each point by position, solved by daqp within the stops (ConfigurationLimit), until no coordinate moves by 1e-6 or 20 times. dex-retargeting:
its PositionOptimizer as it is (Huber loss from 20 mm, weight of the step 4e-3, ends at 1e-5), and without that weight and to 1e-12. OpenSim:
InverseKinematicsSolver as its tool sets it (accuracy 1e-5), and to 1e-9, all markers of weight 1; coordinates of the export have no clamps.
"""
from __future__ import annotations

import argparse
import csv
import json
import os
import re
import site
import subprocess
import sys
import tempfile
import time
from pathlib import Path

if "--packages" in sys.argv[:-1]:  # before NumPy, of the version that they need
    sys.path.insert(0, sys.argv[sys.argv.index("--packages") + 1])
    site.addsitedir(sys.path[0])
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
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


def kabsch(from_, to):
    """Rotation and shift of points (n, 3) to others."""
    a, b = from_.mean(0), to.mean(0)
    u, _, vt = np.linalg.svd((to - b).T @ (from_ - a))
    rotation = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return rotation, b - rotation @ a


class Peer:
    """What a program does. `points(angles)`: of its model at angles by axis (21, 3), the palm anywhere. `solve(given)`: its coordinates in each frame,
    `told(coordinates)`: their angles, and the points there."""

    def __init__(self, folder, exact, truth):
        self.folder, self.exact, self.truth = folder, exact, truth

    def local(self, poses, anchors):
        """Places of the points in their bodies. `poses`: rotation and origin by body, at the first true angles; `anchors`: of points of the palm by index."""
        rotation, shift = kabsch(self.exact[0][list(anchors)], np.array(list(anchors.values())))
        return [poses[body][0].T @ (rotation @ point + shift - poses[body][1]) for body, point in zip(BODIES, self.exact[0])]

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
        for name, body, place in zip(NAMES, BODIES, places):
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
                        f'<origin xyz="{" ".join(map(repr, map(float, place)))}"/></joint>' for name, body, place in zip(NAMES, BODIES, places))
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
        places = Mujoco(self.folder, self.exact, self.truth).load()  # bodies have the same frames; model_difference() tests it
        self.model = opensim.Model(str(self.folder / "hand.osim"))
        for name, body, place in zip(NAMES, BODIES, places):
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


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        sys.exit(f"{' '.join(map(str, words))}: {done.stderr}")
    return done


def ours(program, folder, recording, options):
    """A row of handsim's own."""
    summary = json.loads(run(program, "track", recording, "--truth", folder / "true/trajectory.mot", "--out", folder / "tracked", "--json", *options).stdout)
    hand = summary["hands"][0]
    rows = list(csv.DictReader((folder / "tracked/summary.csv").open()))
    assert hand["missing"] + hand["swapped"] + hand["poor"] == 0
    return {"fingers_deg": hand["finger_flexion_difference_rms_deg"], "all_deg": hand["difference_rms_deg"], "points_mm": float(rows[0]["rms[mm]"]),
            "frame_ms": 1e3 * summary["cpu_s"] / summary["frames"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("program", type=Path, help="handsim")
    parser.add_argument("--packages", type=Path, help="folder of the other programs")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--frames", type=int, default=626, help="of the recording, from its beginning")
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    folder = Path(tempfile.mkdtemp())
    run(options.program, "run", ROOT / "config/bench.yaml", "--out", folder / "true", "--quiet")
    (folder / "hand.yaml").write_text(f"title: the hand\nhands:\n  - {{model: {ROOT}/handmodels/anatomical.yaml, person: {ROOT}/config/persons/median_woman.yaml, side: right,\n"
                                      "     wrist: {mount: free, position: [0, 0, 0.3]}}\neffects: [joint_stops]\nduration: 1\n")
    for kind in ("xml", "urdf", "osim"):
        run(options.program, "export", folder / "hand.yaml", "--out", folder / f"hand.{kind}")
    head, *rows = list(csv.reader((folder / "true/markers.csv").open()))
    columns = [head.index(f"right.{name}.{axis}[m]") for name in NAMES for axis in "xyz"]
    table = np.array(rows, dtype=float)[:options.frames]
    exact = table[:, columns].reshape(len(table), 21, 3)
    lines = (folder / "true/trajectory.mot").read_text().splitlines()
    begin = lines.index("endheader") + 1
    names = lines[begin].split("\t")
    values = np.radians(np.array([line.split("\t") for line in lines[begin + 1:]], dtype=float)[:options.frames])
    truth = {axis: values[:, names.index(f"right.{axis}")] for axis in AXES}
    true = np.column_stack(list(truth.values()))
    fingers = [i for i, axis in enumerate(AXES) if axis.endswith(".flexion") and not axis.startswith("thumb")]
    person = ["--person", ROOT / "config/persons/median_woman.yaml"]
    found, missing = [], []
    for noise in (0.0, 2e-3):
        given = exact + np.random.default_rng(1).normal(0, noise, exact.shape) if noise else exact
        np.savetxt(folder / "points.csv", np.column_stack((table[:, 0], given.reshape(len(given), -1))), "%.17g", ",", comments="",
                   header=",".join(["time[s]", *(head[column] for column in columns)]))
        for name, words in (("handsim, each frame for itself", [*person, "--keep-person", "--no-smoothing"]), ("handsim, smooth in time", [*person, "--keep-person"]),
                            ("handsim, size of the hand unknown", [])):
            found.append({"program": name, "noise_mm": 1e3 * noise, **ours(options.program, folder, folder / "points.csv", words)})
        for kind in (Mink, Dex, DexExactly, OpenSim, OpenSimExactly):
            peer = kind(folder, exact, truth)
            try:
                peer.load()
                version = peer.version()
            except ImportError as error:
                missing.append(f"{kind.name}: {error}")
                continue
            difference = peer.model_difference()
            begin_time = time.process_time()
            solved = peer.solve(given)
            spent = time.process_time() - begin_time
            angles, fitted = (np.array(each) for each in zip(*map(peer.told, solved)))
            error = np.degrees(angles - true)
            found.append({"program": kind.name, "version": version, "noise_mm": 1e3 * noise, "model_mm": difference, "fingers_deg": float(np.sqrt(np.mean(error[:, fingers]**2))),
                          "all_deg": float(np.sqrt(np.mean(error**2))), "points_mm": 1e3 * float(np.sqrt(np.mean(np.sum((fitted - given)**2, axis=2)))),
                          "frame_ms": 1e3 * spent / len(given)})
    print(f"{'program':36}{'noise':>7}{'model':>10}{'fingers':>10}{'all':>10}{'points':>10}{'time':>9}\n{'':36}{'mm':>7}{'mm':>10}{'deg':>10}{'deg':>10}{'mm':>10}{'ms':>9}")
    for row in found:
        name = f"{row['program']} {row.get('version', '')}"
        model = f"{row['model_mm']:.2g}" if "model_mm" in row else ""
        print(f"{name:36}{row['noise_mm']:7g}{model:>10}{row['fingers_deg']:10.3g}{row['all_deg']:10.3g}{row['points_mm']:10.3g}{row['frame_ms']:9.3g}")
    for each in sorted(set(missing)):
        print(f"missing: {each}")
    if options.out:
        options.out.write_text(json.dumps({"frames": len(table), "rows": found, "missing": sorted(set(missing))}, indent=1) + "\n")


if __name__ == "__main__":
    main()
