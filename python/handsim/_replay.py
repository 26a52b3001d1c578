"""Whether found forces hold the object: each lift of a recording as a scene in which the object is free and driven hands press as hard as was found.

A hand that holds is steady, seen from the object, and it is moved within its noise: pads that press are as deep in the object as their load asks, and
others are not inside it. Targets of the joints lie beyond the surface by torque over stiffness, and ahead by damping over stiffness times the rate. Then
the object is carried along the recording in a simulation, in which the hands are moved and their targets are changed until they bear it (`_carried`).
"""
from __future__ import annotations

import json
import math
import os
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Error
from ._carried import Guided, alike, carried
from ._forces import MARGIN, SPIN, Result
from ._forces_frames import BEGINS, FURTHEST, NEAR, Solver, smooth_rows
from ._model import compose, inverse, matrices, turned
from ._objects import Thing, hull_text, of_hulls
from ._progress import Told
from ._scene import load
from ._sharing import Places, share
from ._shipped import data_path
from ._simulation import Simulation
from ._study_files import number
from ._touch import Surface, contact_jacobians, touches
from ._yaml import parser

Array = NDArray[np.float64]
SHORTEST = 0.2
"""Of a lift [s]."""
FAR, TURNED = 0.010, math.radians(10)
"""How far from the recording an object is still held [m], [rad]."""
TIGHT = 3e-4
"""Deviation of a gap from the one that is asked for [m]: chosen."""
LEVER = 0.04
"""From a joint to the pads it moves: the deviation of a point over it is that of an angle [m]. Chosen."""
PASSES = 3
STOP = 1e-3
"""How far within its stops a joint starts [rad]."""
STILL = 0.2
"""Within which a hand goes from one grip to the next [s]: chosen."""
PRICE = 1000.0
"""Of a piece, for each of its coordinates: chosen."""
HOLDS = 0.25
"""Part of the frames of a piece in which a hand bears a force, for it to hold there: chosen."""
BREADTH = 0.08
"""From a wrist to the pads that it turns: the deviation of a point over it is that of an angle [m]. Chosen."""
REST = 1.0
"""Before a lift, in which hands come to bear the object that is at rest [s]: chosen."""
OUT_OF_REACH = -1000.0
"""Height of the ground where it supports nothing [m]."""
BORNE = 0.2
"""From the beginning of a lift on, in which is told whether hands bear the object [s]."""
SLIDE = 1e-3
"""How far a centre of pressure in a simulation is moved by a change of its force, at most [m]: chosen."""
LOST = 0.1
"""Share of its force below which a finger has lost the object."""
KINDS = ("forces", "angles")


class Lift(NamedTuple):
    """Rows of the recording."""

    first: int
    """From which the object is lifted."""
    last: int
    """Beyond it it is not."""


class Drive(NamedTuple):
    """How a hand is driven in a lift."""

    hand: int
    rows: NDArray[np.intp]
    """Of the recording, in which it is tracked."""
    start: Array
    """Its angles at the start [rad]."""
    targets: Array
    """Of the joints [rad], a row for each of the rows."""
    wrist: Array
    """Poses of the hand frame."""


class Replayed(NamedTuple):
    """Of a lift."""

    begin: float
    end: float
    """Of the time in which it is lifted [s]."""
    held: dict[str, float]
    """By kind: for how long the object stays within FAR and TURNED of the recording [s]."""
    lost: dict[str, str]
    """By kind: the finger that lost it first; empty where none did."""
    problem: dict[str, str]
    """By kind: why it could not be simulated to its end."""
    spring: float = math.nan
    """Force of the spring that carries the object in the run before, over the weight, in the mean of the lift's first BORNE."""

    @property
    def whole(self) -> bool:
        """Held with the forces for as long as the recording does."""
        return self.held["forces"] >= self.end - self.begin - 1e-6


def lifts(of: Result) -> list[Lift]:
    interval = float(np.median(np.diff(of.times)))
    free = np.concatenate([[False], of.lifted, [False]])
    begins, ends = np.flatnonzero(free[1:] & ~free[:-1]), np.flatnonzero(free[:-1] & ~free[1:])
    return [Lift(int(first), int(last)) for first, last in zip(begins, ends) if (last - first) * interval >= SHORTEST]


def stiffness(joints: Sequence[str]) -> tuple[Array, Array]:
    """Of the controller of grasps, by coordinate [N m/rad], and damping over it [s]."""
    rows = parser().safe_load((data_path() / "controllers/grasp.yaml").read_text(encoding="utf-8"))["gains"]
    gains, lags = np.full(len(joints), np.inf), np.zeros(len(joints))
    for row in rows:
        words = row["joints"] if isinstance(row["joints"], list) else [row["joints"]]
        for i, name in enumerate(joints):
            if "proportional" in row and any(word == "all" or fnmatch(name, word) or fnmatch(name.partition(".")[0], word) for word in words):
                gains[i], lags[i] = float(row["proportional"]), float(row.get("derivative", 0)) / float(row["proportional"])
    return gains, lags


def pad_stiffness() -> float:
    """[N/m]"""
    return float(parser().safe_load((data_path() / "handmodels/finger_pad.yaml").read_text(encoding="utf-8"))["stiffness"])


def pieces(values: Array, noise: float, price: float) -> list[tuple[int, int]]:
    """Rows between which values are constant within their noise: least squares, at a price for each piece, by dynamic programming."""
    count = len(values)
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    squares = np.concatenate([[0.0], np.cumsum((values**2).sum(axis=1))])
    best, before = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=np.intp)
    best[0] = -price
    for end in range(1, count + 1):
        begins = np.arange(end)
        left = squares[end] - squares[begins] - ((sums[end] - sums[begins])**2).sum(axis=1) / (end - begins)
        costs = best[begins] + left / noise**2 + price
        before[end] = int(np.argmin(costs))
        best[end] = costs[before[end]]
    out, end = [], count
    while end > 0:
        out.append((int(before[end]), end))
        end = int(before[end])
    return out[::-1]


def steadied(of: Solver, k: int, rows: NDArray[np.intp], holds: NDArray[np.bool_], width: int) -> tuple[Array, Array, list[tuple[int, int]]]:
    """Angles, wrist, and pieces in which a hand holds the object: seen from it, both are constant there, as pads that bear it do not slide to and fro.

    :param holds: by row: it bears a force
    :param width: rows over which a hand goes from one piece to the next
    """
    motion, poses = of.motions[k], of.of.motion.poses[rows]
    wrist, q = alike(compose(inverse(poses), motion.wrist[rows])), motion.q[rows].copy()
    noise = max(of.noises[k], 1e-4)
    values = np.hstack([wrist[:, :3], 2 * BREADTH * wrist[:, 3:], LEVER * q])
    found = [(first, last) for first, last in pieces(values, noise, PRICE * values.shape[1]) if holds[first:last].mean() > HOLDS and last - first >= width]
    for first, last in found:
        wrist[first:last], q[first:last] = wrist[first:last].mean(axis=0), q[first:last].mean(axis=0)
    wrist, q = smooth_rows(wrist, width), smooth_rows(q, width)
    wrist[:, 3:] /= np.linalg.norm(wrist[:, 3:], axis=1, keepdims=True)
    return q, compose(poses, wrist), found


def moved(of: Solver, found: Result, surfaces: Sequence[Surface], k: int, row: int, pad: float, q: Array, wrist: Array) -> tuple[Array, Array]:
    """Angles and wrist place by which a hand is moved within its noise, for pads to be as deep as their load asks."""
    motion, shapes = of.motions[k], of.hands.shapes[k]
    count, noise = len(q), max(of.noises[k], 1e-4)
    turn = np.array([0.0 if name.startswith("wrist") else 1.0 for name in motion.hand.coordinates])
    prior = np.concatenate([np.full(count, LEVER / noise), np.full(3, 1 / noise)])
    change = np.zeros(count + 3)
    for _ in range(PASSES):
        places = touches(shapes, k, shapes.bodies(q, wrist), surfaces, of.of.places[row], NEAR + (FURTHEST + BEGINS) * noise)
        wanted = np.array([found.normal[row, of.column[k, shapes.names[touch.shape]]] / pad for touch in places])
        gaps = np.array([touch.gap for touch in places])
        used = (wanted > 1e-6) | (gaps < 0)
        if not used.any():
            break
        normals = np.array([touch.normal for touch in places])[used]
        jacobian = contact_jacobians(shapes, q, wrist, [touch for touch, own in zip(places, used) if own])
        rows = np.hstack([np.einsum("nk,nkc->nc", normals, jacobian) * turn, normals])
        short = -wanted[used] - gaps[used]
        # The change from here, with the prior on all of it.
        matrix = np.vstack([rows / TIGHT, np.diag(prior)])
        step = np.linalg.lstsq(matrix, np.concatenate([short / TIGHT, -prior * change]), rcond=None)[0]
        change += step
        q, wrist = q + step[:count], np.concatenate([wrist[:3] + step[count:], wrist[3:]])
    return change[:count], change[count:]


class Writer:
    """Scenes of a recording's lifts."""

    def __init__(self, thing: Thing, of: Solver, found: Result, model: Path, folder: Path) -> None:
        self.thing, self.of, self.found, self.model, self.folder = thing, of, found, model, folder
        self.pad = pad_stiffness()
        self.width = max(1, int(round(STILL / of.interval)) | 1)
        self.meshes = thing.file.suffix.lower() == ".urdf"
        # Meshes are simulated as their convex hulls: the hands are moved to these.
        self.surfaces = [Surface(of_hulls(link)) for link in thing.links] if self.meshes else of.surfaces

    def drives(self, lift: Lift, kind: str) -> list[Drive]:
        """Of the hands that were tracked in the lift."""
        return [drive for k in range(len(self.of.motions)) if (drive := self._drive(k, lift, kind)) is not None]

    def _drive(self, k: int, lift: Lift, kind: str) -> Optional[Drive]:
        motion, of = self.of.motions[k], self.of
        rows = np.flatnonzero(of.hands.tracked[k][lift.first:lift.last]) + lift.first
        if len(rows) < 2:
            return None
        gains, lags = stiffness(list(motion.hand.coordinates))
        gains = gains + of.hands.stiffness[k]  # Tissue is compensated at the targets: its stiffness adds to the controller's.
        q, wrist = of.hands.smooth[k][rows].copy(), motion.wrist[rows].copy()
        targets = q + lags * of.hands.rates[k][rows]
        if kind == "forces":
            holds = (self.found.normal[rows][:, [i for i, (hand, _) in enumerate(of.bones) if hand == k]] > 1e-3).any(axis=1)
            q, wrist, held = steadied(of, k, rows, holds, self.width)
            changes = [moved(of, self.found, self.surfaces, k, int(row), self.pad, *each) for row, *each in zip(rows, q, wrist)]
            angles, places = (np.array([each[part] for each in changes]) for part in (0, 1))
            for first, last in held:
                for values in (angles, places):
                    values[first:last] = values[first:last].mean(axis=0)
            angles, places = (smooth_rows(values, self.width) for values in (angles, places))
            q += angles
            targets = q + lags * np.gradient(q, of.interval, axis=0) + self.found.pressing[rows, int(of.hands.starts[k]):int(of.hands.starts[k + 1])] / gains
            wrist[:, :3] += places
        return Drive(k, rows, q[0], targets, wrist)

    def _hand(self, drive: Drive, lift: Lift, name: str) -> tuple[str, str]:
        """Name of the tables, which are written, and the text of the hand."""
        motion, of = self.of.motions[drive.hand], self.of
        joints = list(motion.hand.coordinates)
        times = of.times[drive.rows] - of.times[lift.first]
        driven = [i for i, gain in enumerate(stiffness(joints)[0]) if math.isfinite(gain)]
        stem = f"{name}_{motion.name}"
        head = "\t".join(["time", *(f"{motion.name}.{joints[i]}" for i in driven)])
        lines = [f"{motion.name} hand, targets\nversion=1\nnRows={len(times)}\nnColumns={len(driven) + 1}\ninDegrees=yes\nendheader", head]
        lines += ["\t".join([f"{time:.9g}", *map(number, row)]) for time, row in zip(times, np.degrees(drive.targets[:, driven]).tolist())]
        _core.write_file(self.folder / f"{stem}.mot", ("\n".join(lines) + "\n").encode())
        lines = [",".join(["time[s]", *(f"{motion.name}.wrist.{part}" for part in ("x[m]", "y[m]", "z[m]", "qw", "qx", "qy", "qz"))])]
        lines += [",".join([f"{time:.9g}", *map(number, row)]) for time, row in zip(times, drive.wrist.tolist())]
        _core.write_file(self.folder / f"{stem}_wrist.csv", ("\n".join(lines) + "\n").encode())
        pose: dict[str, list[str]] = {}
        stops = motion.hand.joints
        inside = np.clip(drive.start, np.asarray(stops["low"]) + STOP, np.asarray(stops["high"]) - STOP)
        for joint, angle in zip(joints, inside):
            if not joint.startswith("wrist"):
                pose.setdefault(joint.partition(".")[0], []).append(f"{angle:.9g}")
        angles = ", ".join(f"{joint}: [{', '.join(each)}]" for joint, each in pose.items())
        return stem, (f'  - model: "{os.path.abspath(self.model)}"\n    person: ../person.yaml\n    side: {motion.name}\n'
                      f"    wrist: {{mount: driven, motion: {{table: {stem}_wrist.csv}}}}\n    pose: {{{angles}}}\n")

    def _object(self, lift: Lift) -> str:
        """Free, with the place and the velocity that it had; a hinge is stuck at the angle of the middle of the lift."""
        of, row = self.of.of, lift.first
        pose, turning = of.motion.poses[row], of.motion.turning[row]
        velocity = of.motion.velocity[row] + np.cross(turning, of.centre[row] - pose[:3])
        place = (f"    position: {json.dumps(pose[:3].tolist())}\n    rotation: {rotation(pose[3:])}\n    velocity: {json.dumps(velocity.tolist())}\n"
                 f"    angular_velocity: {json.dumps(turning.tolist())}\n    overlap: allowed\n")
        if not self.meshes:
            return f'  - name: {self.thing.name}\n    file: "{os.path.abspath(self.thing.file)}"\n{place}'
        middle = (lift.first + lift.last) // 2
        back = compose(inverse(of.motion.poses[middle]), of.places[middle])
        out = f"  - name: {self.thing.name}\n{place}    parts:\n"
        for link, own in zip(self.thing.links, back):
            for i, corners in enumerate(link.corners):
                mesh = f"{self.thing.name}_{link.name}_{i}.obj"
                _core.write_file(self.folder / mesh, hull_text(corners).encode())
                out += (f"      - {{shape: convex_mesh, mesh: {mesh}, mass: {link.mass / len(link.corners):.9g}, position: {json.dumps(own[:3].tolist())}, "
                        f"rotation: {rotation(own[3:])}}}\n")
        return out

    def write(self, lift: Lift, name: str, kind: str, drives: Sequence[Drive]) -> Path:
        seen = [(*self._hand(drive, lift, f"{name}_{kind}"), self.of.motions[drive.hand]) for drive in drives]
        programs = ", ".join(f"{motion.name}: {stem}.mot" for stem, _, motion in seen)
        ground = self.found.ground
        floor = "" if math.isnan(ground) else f"ground: {{height: {ground:.9g}}}\n"
        rules = "{between: [hands, objects], material: pad}" + ("" if math.isnan(ground) else ", {between: [objects, ground]}")
        text = (f"# Written by handsim track: {'found forces' if kind == 'forces' else 'tracked angles alone'}, from {self.of.times[lift.first]:.6g} s on.\n"
                f"title: lift of {self.thing.name}\nhands:\n{''.join(text for _, text, _ in seen)}objects:\n{self._object(lift)}{floor}"
                f'control:\n  controller: "{data_path() / "controllers/grasp.yaml"}"\n  program: {{{programs}}}\n  motion: {{clamp: true}}\n'
                f'contacts:\n  materials: [{{name: pad, file: "{data_path() / "handmodels/finger_pad.yaml"}", friction: {self.of.asked.friction:g}}}]\n'
                f"  rules: [{rules}]\n"
                f"effects: [gravity, object_contact, {'' if not floor else 'ground_contact, '}friction, joint_stops, passive_tissue, actuation, wrist_motion]\n"
                'solver: {engine: articulated, step: "1 ms"}\n'
                f'duration: {number(max(0.01, float(self.of.times[lift.last - 1] - self.of.times[lift.first])))}\nrecord: {{every: "10 ms"}}\n')
        path = self.folder / f"{name}_{kind}.yaml"
        _core.write_file(path, text.encode())
        return path

    def pressed(self, path: Path, lift: Lift, drives: Sequence[Drive]) -> tuple[list[Drive], float]:
        """Driven so that pads press as was found, in a simulation in which the object is carried along the recording, and `Replayed.spring`."""
        of = self.of
        # A lifted object does not stand on the ground, which must not bear it here.
        scene = load(path, None if math.isnan(self.found.ground) else {"ground.height": OUT_OF_REACH})
        names = list(scene.axes)
        count = lift.last - lift.first
        guided = []
        for drive in drives:
            motion, shapes = of.motions[drive.hand], of.hands.shapes[drive.hand]
            joints = [f"{motion.name}.{name}" for name in motion.hand.coordinates]
            stiff = stiffness(list(motion.hand.coordinates))[0] + of.hands.stiffness[drive.hand]
            segments = np.array([i for i, (hand, _) in enumerate(of.bones) if hand == drive.hand])
            at = np.clip(np.searchsorted(drive.rows, np.arange(lift.first, lift.last)), 0, len(drive.rows) - 1)

            def torques(q: Array, wrist: Array, places: Array, forces: Array, shapes: Any = shapes, segments: Any = segments) -> Array:
                bodies, out = shapes.bodies(q, wrist), np.zeros(len(q))
                for i, where, each in zip(segments, places, forces):
                    if each.any() and np.isfinite(where).all():
                        body = shapes.place(of.bones[i][1])
                        offset = turned(bodies[body, 3:] * [1, -1, -1, -1], where - bodies[body, :3])
                        out += (matrices(wrist)[:3, :3] @ _core.hand_jacobian(shapes.hand.scene._core, q, body, offset)[:3]).T @ each
                return out

            guided.append(Guided(drive.wrist[at], drive.targets[at], np.array([names.index(each) if each in names else -1 for each in joints]),
                                 np.array([scene.coordinates.index(each) for each in joints]), segments, stiff, torques))

        def wanted(row: int, places: Array, outward: Array, touching: Any) -> tuple[Array, Array]:
            return self._wanted(lift.first + row, places, outward, touching), self.found.centre[lift.first + row]

        now = carried(scene, self.thing.name, of.segments, of.times[lift.first:lift.last] - of.times[lift.first], of.of.motion.poses[lift.first:lift.last],
                      guided, wanted, int(round(REST / of.interval)))
        out = []
        for drive, hand, wrist, targets in zip(drives, guided, now.wrists, now.targets):
            own = drive.rows - lift.first
            out.append(drive._replace(start=now.start[hand.coordinates] if own[0] == 0 else now.q[own[0], hand.coordinates], targets=targets[own], wrist=wrist[own]))
        begins = now.help[:max(1, int(round(BORNE / of.interval))), :3]
        return out, float(np.linalg.norm(begins, axis=1).mean()) / of.weight

    def _wanted(self, row: int, places: Array, outward: Array, touching: NDArray[np.bool_]) -> Array:
        """Forces on the object by segment, of the places that touch in the simulation: as found, and such that they give the wrench it needs."""
        of, found = self.of, self.found
        out = np.where(touching[:, None], 0.0, found.force[row])
        on = np.flatnonzero(touching)
        rest = of.of.wrench[row] - np.concatenate([out.sum(axis=0), np.cross(np.nan_to_num(found.centre[row]) - of.of.centre[row], out).sum(axis=0)])
        normal = found.normal[row, on]
        at = Places(places[on], outward[on], np.ones(len(on)), np.full(len(on), -1), np.ones(len(on)), 0.0, SLIDE)
        friction = of.asked.friction / MARGIN
        shared = share(at, rest, of.of.centre[row], of.weight, friction, SPIN * friction, float(normal.sum()), normal, routines=of.lapack)
        out[on] = shared.force
        return out

    def run(self, path: Path, lift: Lift) -> tuple[float, str, str]:
        """For how long the object stays with the recording, the finger that lost it, and what ended the simulation."""
        scene = load(path)
        simulation = Simulation(scene)
        body = next(i for i, each in enumerate(scene._model.bodies) if each.name == self.thing.name)
        of, begin = self.of.of, float(self.of.times[lift.first])
        frame = compose(inverse(scene._model.bodies[body].zero), of.motion.poses[lift.first])
        for row in range(lift.first, lift.last):
            steps = int(round((float(self.of.times[row]) - begin - simulation.time) / scene.step))
            try:
                if steps > 0:
                    simulation.step(substeps=steps)
            except Error as error:
                return self._since(row, lift), "", str(error).splitlines()[0]
            bodies = simulation.bodies
            now = compose(np.concatenate([bodies.position[body], bodies.quaternion[body]]), frame)
            expected = of.motion.poses[row]
            away = float(np.linalg.norm(now[:3] - expected[:3]))
            angle = 2 * math.acos(min(1.0, abs(float(now[3:] @ expected[3:]))))
            if away > FAR or angle > TURNED:
                return self._since(row, lift), self._lost(simulation, row), ""
        return float(self.of.times[lift.last - 1] - self.of.times[lift.first]), "", ""

    def _since(self, row: int, lift: Lift) -> float:
        return float(self.of.times[max(row - 1, lift.first)] - self.of.times[lift.first])

    def _lost(self, simulation: Simulation, row: int) -> str:
        """The finger that bears the least of what it should."""
        model = simulation.scene._model
        bodies = {shape.name: model.bodies[shape.body].name for shape in model.shapes}
        pressed = dict.fromkeys(self.found.fingers, 0.0)
        contacts = simulation.contacts
        for a, b, direction, force in zip(contacts.a, contacts.b, contacts.normal, contacts.force):
            for name in (bodies.get(a, ""), bodies.get(b, "")):
                finger = name.partition("_")[0]
                if finger in pressed:
                    pressed[finger] += abs(float(force @ direction))
        shares = {finger: float(pressed[finger] / force) for finger, force in zip(self.found.fingers, self.found.by_finger[row]) if force > 1e-3}
        least = min(shares, key=shares.__getitem__, default="")
        return least if least and shares[least] < LOST else "it slips" if least else ""


def rotation(quaternion: Array) -> str:
    """As scenes have it."""
    w, axis = (quaternion[0], quaternion[1:]) if quaternion[0] >= 0 else (-quaternion[0], -quaternion[1:])
    long = float(np.linalg.norm(axis))
    return f"{{axis: {json.dumps((axis / long).tolist()) if long > 1e-9 else '[0, 0, 1]'}, angle: {2 * math.atan2(long, float(w)):.12g}}}"


def replay(thing: Thing, of: Solver, found: Result, model: Path, folder: Path, told: Told = None) -> list[Replayed]:
    """Writes and simulates every lift."""
    writer, out, every = Writer(thing, of, found, model, folder), [], lifts(found)
    for i, lift in enumerate(every):
        held, lost, problem, spring = {}, {}, {}, math.nan
        for j, kind in enumerate(KINDS):
            try:
                drives = writer.drives(lift, kind)
                if not drives:
                    held[kind], lost[kind], problem[kind] = 0.0, "", "no hand is tracked"
                    continue
                path = writer.write(lift, f"lift_{i + 1}", kind, drives)
                if kind == "forces":
                    drives, spring = writer.pressed(path, lift, drives)
                    path = writer.write(lift, f"lift_{i + 1}", kind, drives)
                held[kind], lost[kind], problem[kind] = writer.run(path, lift)
            except Error as error:
                held[kind], lost[kind], problem[kind] = 0.0, "", str(error).splitlines()[0]
            if told is not None:
                told((2 * i + j + 1) / (2 * len(every)))
        out.append(Replayed(float(found.times[lift.first]), float(found.times[lift.last - 1]), held, lost, problem, spring))
    return out


def text(every: Sequence[Replayed]) -> str:
    out = ""
    for i, each in enumerate(every, 1):
        words = []
        for kind, title in zip(KINDS, ("with the forces", "with angles alone")):
            why = each.problem[kind] or (f"lost by {each.lost[kind]}" if each.lost[kind] else "")
            words.append(f"{title} {each.held[kind]:.2f} s{f' ({why})' if why else ''}")
        out += f"  lift {i}, {each.begin:.2f} to {each.end:.2f} s: a simulated hand holds it {', '.join(words)} of {each.end - each.begin:.2f} s\n"
    return out


def figures(every: Sequence[Replayed]) -> list[dict[str, Any]]:
    return [{"begin_s": each.begin, "end_s": each.end, "held_s": each.held, "lost_by": each.lost, "problem": each.problem, "held_to_the_end": each.whole,
             "spring_share": None if math.isnan(each.spring) else each.spring}
            for each in every]
