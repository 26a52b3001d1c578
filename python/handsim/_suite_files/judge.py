"""Judges what an engine wrote of the suite's cases; needs numpy alone.

python3 judge.py RESULTS [--suite DIR] [--only CASE ...] [--json FILE]

RESULTS has run.json and a table CASE.csv for each case; README.md says what is in them. A line for each case: its verdict, and every
figure with its limit. Exit status 0: all are held; 1: some are not; 2: a table is wrong, which a line on stderr says for each problem.
"""
from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from pathlib import Path
from typing import Any, Callable, NamedTuple, NoReturn, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
FORCE = ("fx", "fy", "fz")
OPTIONAL = (*TWIST, *FORCE, "normal")
START_PLACE, START_TURN, START_RATE = 1e-3, 1e-2, 1e-2
"""Of the first row from the case's start [m], [rad], [m/s] or [rad/s]: more is another unit, frame or order of the quaternion."""
UNIT_QUATERNION = 1e-3
MOST_PROBLEMS = 20


class Wrong(Exception):
    """A table that cannot be judged: a line for each problem."""


# Quaternions are w x y z; arrays have them in the last axis.


def turned(q: Array, v: ArrayLike) -> Array:
    """Vectors in the axes that a quaternion leads to."""
    w, r, v = q[..., :1], q[..., 1:], np.asarray(v, float)
    # With one cross product inside the other, mypy tries all pairs of their overloads, for half a minute.
    across: Array = np.cross(r, v) + w * v
    return np.asarray(v + 2 * np.cross(r, across))


def turned_back(q: Array, v: ArrayLike) -> Array:
    return turned(q * [1, -1, -1, -1], v)


def product(a: Array, b: Array) -> Array:
    aw, ar, bw, br = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    return np.concatenate([aw * bw - np.sum(ar * br, -1, keepdims=True), aw * br + bw * ar + np.cross(ar, br)], -1)


def angle(q: Array) -> Array:
    """Of a rotation [rad], 0 to pi."""
    return np.asarray(2 * np.arctan2(np.linalg.norm(q[..., 1:], axis=-1), np.abs(q[..., 0])))


def within(frame: Array, pose: Array) -> Array:
    """Poses (x y z, quaternion) in a frame."""
    back = frame[..., 3:] * [1, -1, -1, -1]
    return np.concatenate([turned(back, pose[..., :3] - frame[..., :3]), product(back, pose[..., 3:])], -1)


# Cases and tables.


def _rows(path: Path) -> list[dict[str, str]]:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


class Case:
    """What a folder of the suite says."""

    def __init__(self, folder: Path) -> None:
        self.name = folder.name
        self.spec: dict[str, Any] = json.loads((folder / "case.json").read_text(encoding="utf-8"))
        self.bodies = {row["body"]: row for row in _rows(folder / "bodies.csv")}
        self.joints = _rows(folder / "joints.csv")
        self.shapes = _rows(folder / "shapes.csv")
        self.gravity = np.array(self.spec["gravity"], float)

    def start(self, body: str) -> Array:
        return np.array([float(self.bodies[body][key]) for key in POSE])

    def twist(self, body: str) -> Array:
        return np.array([float(self.bodies[body][key]) for key in TWIST])

    def mass(self, body: str) -> float:
        return float(self.bodies[body]["mass"])

    def inertia(self, body: str) -> Array:
        """In body axes, shape (3, 3)."""
        xx, yy, zz, xy, xz, yz = (float(self.bodies[body][key]) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class Motion:
    """A table: poses, shape (times, 7), and what else it has, by body."""

    def __init__(self, times: Array, poses: dict[str, Array], twists: dict[str, Array], forces: dict[str, Array],
                 normals: dict[str, Array]) -> None:
        self.times, self.poses, self.twists, self.forces, self.normals = times, poses, twists, forces, normals

    def span(self, first: float, last: float) -> NDArray[np.bool_]:
        return np.asarray((self.times >= first - 1e-6) & (self.times <= last + 1e-6))

    def row(self, time: float) -> int:
        """Of the time next to it."""
        return int(np.argmin(np.abs(self.times - time)))


class _Reader:
    """Reads one table, and collects all that is wrong with it."""

    def __init__(self, path: Path, case: Case) -> None:
        self.path, self.case, self.problems = path, case, [""][:0]
        self.bodies: list[str] = case.spec["record"]["bodies"]
        self.first: dict[str, int] = {}
        """Line of each body's first row."""

    def say(self, line: int, column: int, key: str, got: object, need: str) -> None:
        if len(self.problems) < MOST_PROBLEMS:
            self.problems.append(f"{self.path}:{line}:{column}: {key}: got {got}, need {need}")

    def stop(self) -> NoReturn:
        raise Wrong("\n".join(self.problems))

    def read(self) -> Motion:
        try:
            lines = self.path.read_text(encoding="utf-8-sig").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            self.say(1, 1, "table", getattr(error, "strerror", None) or "no text", "a table as README.md says")
            self.stop()
        head = [name.strip() for name in lines[0].split(",")] if lines else []
        for name in ("time", "body", *POSE):
            if name not in head:
                self.say(1, 1, name, "no such column", f"the columns time,body,{','.join(POSE)}")
        for place, name in enumerate(head):
            if name not in ("time", "body", *POSE, *OPTIONAL) or name in head[:place]:
                self.say(1, 1 + sum(len(each) + 1 for each in lines[0].split(",")[:place]), name or '""',
                         "a column twice" if name in head[:place] else "an unknown column", f"one of {', '.join(OPTIONAL)}, or none")
        for group in (TWIST, FORCE):
            if 0 < sum(name in head for name in group) < len(group):
                self.say(1, 1, group[0], "a part of the columns", f"all of {','.join(group)}, or none")
        if self.problems:
            self.stop()
        times: list[float] = []
        found: dict[str, list[list[float]]] = {body: [] for body in self.bodies}
        lines_of: list[int] = []
        for index, text in enumerate(lines[1:], 2):
            if text.strip() and not self._row(index, text, head, times, lines_of, found):
                break
        if not self.problems:
            self._whole(len(lines), times, lines_of, found)
        if self.problems:
            self.stop()
        every = {body: np.array(rows) for body, rows in found.items()}

        def take(names: Sequence[str]) -> dict[str, Array]:
            return {body: rows[:, [head.index(name) for name in names]] for body, rows in every.items() if all(name in head for name in names)}

        self._start(take(POSE), take(TWIST))
        return Motion(np.array(times), take(POSE), take(TWIST), take(FORCE),
                      {body: rows[:, 0] for body, rows in take(("normal",)).items()})

    def _row(self, line: int, text: str, head: list[str], times: list[float], lines_of: list[int],
             found: dict[str, list[list[float]]]) -> bool:
        """One line of the table. :returns: whether to go on"""
        cells = text.split(",")

        def at(place: int) -> int:
            return 1 + sum(len(each) + 1 for each in cells[:place])

        if len(cells) != len(head):
            self.say(line, 1, "row", f"{len(cells)} fields", f"{len(head)}, as in the head")
            return False
        values: list[float] = []
        for place, (name, cell) in enumerate(zip(head, cells)):
            if name == "body":
                values.append(math.nan)
                continue
            try:
                value = float(cell) if cell.strip() or name not in OPTIONAL else math.nan
            except ValueError:
                value = math.inf
            if not math.isfinite(value) and not (name in OPTIONAL and not cell.strip()):
                self.say(line, at(place), name, cell.strip() or "nothing", "a finite number")
            values.append(value)
        body, time = cells[head.index("body")].strip(), values[head.index("time")]
        if body not in found:
            return True  # the others are the driver's own matter
        if not times or time > times[-1]:
            self._complete(line - 1, times, found)
            times.append(time)
            lines_of.append(line)
        elif time < times[-1]:
            self.say(line, at(head.index("time")), "time", f"{time:g} after {times[-1]:g}", "times that rise")
            return False
        if len(found[body]) >= len(times):
            self.say(line, at(head.index("body")), "body", f"{body} twice at {time:g} s", "one row for each body and time")
        norm = math.sqrt(sum(values[head.index(name)] ** 2 for name in POSE[3:]))
        if abs(norm - 1) > UNIT_QUATERNION:
            self.say(line, at(head.index("qw")), "qw", f"a quaternion of length {norm:g}", "a unit quaternion w x y z")
        self.first.setdefault(body, line)
        found[body].append(values)
        return len(self.problems) < MOST_PROBLEMS

    def _complete(self, line: int, times: list[float], found: dict[str, list[list[float]]]) -> None:
        for body, rows in found.items():
            if len(rows) < len(times):
                self.say(line, 1, "body", f"no {body} at {times[-1]:g} s", f"each of {', '.join(found)} at every time")

    def _whole(self, last: int, times: list[float], lines_of: list[int], found: dict[str, list[list[float]]]) -> None:
        spec = self.case.spec
        every, duration = spec["record"]["every"], spec["duration"]
        if not times:
            self.say(max(1, last), 1, "table", "no row", f"rows from 0 to {duration:g} s")
            return
        self._complete(last, times, found)
        if abs(times[0]) > 1e-9:
            self.say(lines_of[0], 1, "time", f"{times[0]:g} s first", "the start, at 0 s")
        for before, time, line in zip(times, times[1:], lines_of[1:]):
            if time - before > 1.5 * every:
                self.say(line, 1, "time", f"{time:g} s after {before:g} s", f"a row every {every:g} s")
        if times[-1] < duration - 0.5 * every:
            self.say(last, 1, "time", f"an end at {times[-1]:g} s", f"rows to {duration:g} s, or the case under failed in run.json")

    def _start(self, poses: dict[str, Array], twists: dict[str, Array]) -> None:
        for body, rows in poses.items():
            own = self.case.start(body)
            far, turn = float(np.linalg.norm(rows[0, :3] - own[:3])), float(angle(product(rows[0, 3:], own[3:] * [1, -1, -1, -1])))
            if far > START_PLACE:
                self.say(self.first[body], 1, body, f"{', '.join(f'{x:.6g}' for x in rows[0, :3])} first",
                         f"{', '.join(f'{x:.6g}' for x in own[:3])}: metres, of the centre of mass, as in bodies.csv")
            if turn > START_TURN:
                self.say(self.first[body], 1, body, f"a first quaternion {', '.join(f'{x:.4g}' for x in rows[0, 3:])}",
                         f"{', '.join(f'{x:.4g}' for x in own[3:])}: w x y z of the body's axes in the world, as in bodies.csv")
            off = float(np.abs(twists[body][0] - self.case.twist(body)).max()) if body in twists else 0.0
            if off > START_RATE:
                self.say(self.first[body], 1, body, f"a first twist {', '.join(f'{x:.4g}' for x in twists[body][0])}",
                         f"{', '.join(f'{x:.4g}' for x in self.case.twist(body))}: of the centre of mass, in world axes, as in bodies.csv")
        if self.problems:
            self.stop()


# Figures.


class Figure(NamedTuple):
    name: str
    value: Optional[float]
    """SI; None: not measured."""
    unit: str
    limit: Optional[float]
    note: str = ""

    @property
    def held(self) -> Optional[bool]:
        if self.limit is None:
            return True
        return None if self.value is None else bool(self.value <= self.limit)

    def told(self) -> str:
        scale, unit = SCALES.get(self.unit, (1.0, self.unit)) if (self.limit or 0) < 1 else (1.0, self.unit)
        text = f"{self.name} " + ("-" if self.value is None else f"{scale * self.value:.3g}") + (f" {unit}" if unit else "")
        limit = "" if self.limit is None else f" ({'at most ' if self.held is not False else 'ABOVE '}{scale * self.limit:.3g})"
        return text + limit + (f" [{self.note}]" if self.note else "")


SCALES = {"m": (1e3, "mm"), "rad": (180 / math.pi, "deg"), "m/s": (1e6, "um/s")}
Measure = Callable[[Case, Motion, dict[str, Any]], list[Figure]]


def _missing(spec: dict[str, Any], unit: str, columns: str) -> list[Figure]:
    return [Figure(spec["measure"], None, unit, spec.get("limit"), f"no {columns}")]


def grasp(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """Motion of the object in the palm from the end of the hold on."""
    path = within(motion.poses[spec["palm"]], motion.poses[spec["body"]])
    hold = motion.row(spec["hold_end"])
    away = np.linalg.norm(path[:, :3] - path[hold, :3], axis=1)
    turn = float(angle(product(path[-1, 3:], path[hold, 3:] * [1, -1, -1, -1])))
    from_start = np.linalg.norm(path[:, :3] - path[0, :3], axis=1)
    return [Figure("shift", float(away[-1]), "m", spec["shift"]), Figure("turn", turn, "rad", spec["turn"]),
            Figure("shaken", float(away[hold:].max()), "m", spec["shaken"]), Figure("farthest", float(from_start.max()), "m", None)]


def creep(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """Distance over time between two times, without vibration."""
    path = motion.poses[spec["body"]]
    if "in" in spec:
        path = within(motion.poses[spec["in"]], path)
    first, last = motion.row(spec["from"]), motion.row(spec["to"])
    far = float(np.linalg.norm(path[last, :3] - path[first, :3]))
    return [Figure("creep", far / float(motion.times[last] - motion.times[first]), "m/s", spec["limit"])]


def drift(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """Farthest from the start, of any body."""
    far = max(float(np.linalg.norm(motion.poses[body][:, :3] - motion.poses[body][0, :3], axis=1).max()) for body in spec["bodies"])
    return [Figure("drift", far, "m", spec["limit"])]


def turn(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    path = motion.poses[spec["body"]][:, 3:]
    return [Figure("turn", float(angle(product(path, path[:1] * [1, -1, -1, -1])).max()), "rad", spec["limit"])]


def weight(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """Mean of the contact forces on a body at rest, against its weight."""
    name = spec["body"]
    rows = motion.span(spec["from"], spec["to"])
    if name not in motion.forces or not np.isfinite(motion.forces[name][rows]).all():
        return _missing(spec, "", "fx,fy,fz")
    need = -case.mass(name) * case.gravity
    return [Figure("weight", float(np.linalg.norm(motion.forces[name][rows].mean(0) - need) / np.linalg.norm(need)), "", spec["limit"])]


def grip(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """Mean sum of the normal forces on a body, over that of the case."""
    name = spec["body"]
    rows = motion.span(spec["from"], spec["to"])
    if name not in motion.normals or not np.isfinite(motion.normals[name][rows]).all():
        return _missing(spec, "", "normal")
    return [Figure("grip", float(motion.normals[name][rows].mean()) / spec["of"], "", None, f"of {spec['of']:.3g} N")]


def _energies(case: Case, motion: Motion) -> tuple[Array, Array]:
    """Kinetic energy, and the whole with that of gravity, at each time [J]."""
    kinetic, all_of_it = np.zeros(len(motion.times)), np.zeros(len(motion.times))
    for body, twist in motion.twists.items():
        mass, spin = case.mass(body), turned_back(motion.poses[body][:, 3:], twist[:, 3:])
        kinetic += 0.5 * mass * np.sum(twist[:, :3] ** 2, 1) + 0.5 * np.einsum("ti,ij,tj->t", spin, case.inertia(body), spin)
        all_of_it -= mass * motion.poses[body][:, :3] @ case.gravity
    return kinetic, kinetic + all_of_it


def _with_twists(motion: Motion, bodies: list[str]) -> bool:
    return all(body in motion.twists and np.isfinite(motion.twists[body]).all() for body in bodies)


def energy(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """Largest rise over the start (energy_gain), over what it was before (energy_rise), or change (energy_error), over the largest
    kinetic energy."""
    if not _with_twists(motion, case.spec["record"]["bodies"]):
        return _missing(spec, "", ",".join(TWIST))
    kinetic, whole = _energies(case, motion)
    before = {"energy_gain": whole[0], "energy_rise": np.minimum.accumulate(whole), "energy_error": whole[0]}[spec["measure"]]
    change = whole - before
    most = float(np.abs(change).max() if spec["measure"] == "energy_error" else change.max())
    return [Figure(spec["measure"], most / max(float(kinetic.max()), 1e-300), "", spec["limit"])]


def momentum(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """Change of the linear momentum less gravity's, and of the angular one in the frame that flies on as the common mass centre did at
    the start; each over the largest sum of amounts."""
    bodies = case.spec["record"]["bodies"]
    if not _with_twists(motion, bodies):
        return _missing(spec, "", ",".join(TWIST))
    masses = {body: case.mass(body) for body in bodies}
    whole = sum(masses.values())
    centre = sum(masses[body] * motion.poses[body][0, :3] for body in bodies) / whole
    speed = sum(masses[body] * motion.twists[body][0, :3] for body in bodies) / whole
    point = centre + np.outer(motion.times, speed)
    linear, angular = np.zeros((len(motion.times), 3)), np.zeros((len(motion.times), 3))
    shifts, turns = np.zeros(len(motion.times)), np.zeros(len(motion.times))
    for body in bodies:
        pose, twist = motion.poses[body], motion.twists[body]
        push = masses[body] * twist[:, :3]
        arm = masses[body] * np.cross(pose[:, :3] - point, twist[:, :3] - speed)
        spin = turned(pose[:, 3:], turned_back(pose[:, 3:], twist[:, 3:]) @ case.inertia(body))
        linear += push
        angular += arm + spin
        shifts += np.linalg.norm(push, axis=1)
        turns += np.linalg.norm(arm, axis=1) + np.linalg.norm(spin, axis=1)
    pulled = whole * np.outer(motion.times, case.gravity)
    off = float(np.linalg.norm(linear - linear[0] - pulled, axis=1).max()) / max(float(shifts.max()), 1e-300)
    turned_off = float(np.linalg.norm(angular - angular[0], axis=1).max()) / max(float(turns.max()), 1e-300)
    return [Figure("momentum_error", max(off, turned_off), "", spec["limit"], "linear" if off > turned_off else "angular")]


def speed(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """At the end, against the closed form; or the largest of any body; or its root mean square."""
    bodies = [spec["body"]] if "body" in spec else case.spec["record"]["bodies"]
    unit = "" if spec["measure"] == "speed_error" else "m/s"
    if not _with_twists(motion, bodies):
        return _missing(spec, unit, "vx,vy,vz")
    speeds = np.stack([np.linalg.norm(motion.twists[body][:, :3], axis=1) for body in bodies])
    if spec["measure"] == "speed_error":
        value = abs(float(speeds[0, -1]) - spec["expected"]) / spec["expected"]
    elif spec["measure"] == "rms_speed":
        value = float(np.sqrt(np.mean(speeds[0, motion.times >= spec["from"] - 1e-6] ** 2)))
    else:
        value = float(speeds.max())
    return [Figure(spec["measure"], value, unit, spec["limit"])]


def joint_gap(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """Distance of the two bodies' points of each joint; of a slider across its axis."""
    worst, where = 0.0, ""
    still = np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(motion.times), 1))
    for joint in case.joints:
        at = []
        for side, key in (("parent", "p"), ("child", "c")):
            pose = motion.poses.get(joint[side], still)
            at.append(pose[:, :3] + turned(pose[:, 3:], [float(joint[key + axis]) for axis in "xyz"]))
        apart = at[1] - at[0]
        if joint["kind"] == "slider":
            along = turned(motion.poses.get(joint["parent"], still)[:, 3:], [float(joint["a" + axis]) for axis in "xyz"])
            apart = apart - along * np.sum(apart * along, 1, keepdims=True)
        far = float(np.linalg.norm(apart, axis=1).max())
        if far > worst:
            worst, where = far, joint["joint"]
    return [Figure("joint_gap", worst, "m", spec["limit"], where)]


# Depth of two shapes. Shapes have their axis along z; a pose is (times, 7).


class Solid(NamedTuple):
    kind: str
    pose: Array
    radius: float
    length: float
    half: Array


def _signed(solid: Solid, points: Array) -> Array:
    """Distance of points, shape (times, 3), to a convex solid; negative inside. It is convex in the point."""
    p = turned_back(solid.pose[:, 3:], points - solid.pose[:, :3])
    if solid.kind == "plane":
        return np.asarray(p[:, 2])
    if solid.kind == "box":
        q = np.abs(p) - solid.half
        return np.asarray(np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0))
    along = np.clip(p[:, 2], -solid.length / 2, solid.length / 2)
    if solid.kind in ("sphere", "capsule"):
        p[:, 2] -= along if solid.kind == "capsule" else 0
        return np.asarray(np.linalg.norm(p, axis=1) - solid.radius)
    flat = np.stack([np.hypot(p[:, 0], p[:, 1]) - solid.radius, np.abs(p[:, 2]) - solid.length / 2], 1)
    return np.asarray(np.linalg.norm(np.maximum(flat, 0), axis=1) + np.minimum(flat.max(1), 0))


def _round_depth(ball: Solid, other: Solid) -> Array:
    """Of a sphere or capsule: the distance along its axis is convex, so that three points tell where it is least."""
    axis = turned(ball.pose[:, 3:], [0, 0, ball.length / 2 if ball.kind == "capsule" else 0.0])
    low, high = -np.ones((len(axis), 1)), np.ones((len(axis), 1))
    for _ in range(80 if ball.kind == "capsule" else 1):
        a, b = low + (high - low) / 3, high - (high - low) / 3
        less = (_signed(other, ball.pose[:, :3] + a * axis) < _signed(other, ball.pose[:, :3] + b * axis))[:, None]
        low, high = np.where(less, low, a), np.where(less, b, high)
    return np.asarray(ball.radius - _signed(other, ball.pose[:, :3] + (low + high) / 2 * axis))


def _corners(solid: Solid) -> Array:
    """Of a box, shape (times, 8, 3)."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return np.stack([solid.pose[:, :3] + turned(solid.pose[:, 3:], corner * solid.half) for corner in signs], 1)


def _box_depth(a: Solid, b: Solid) -> Array:
    """The least overlap along the 15 axes that can part two boxes."""
    own = [[turned(each.pose[:, 3:], np.eye(3)[k]) for k in range(3)] for each in (a, b)]
    axes = [*own[0], *own[1], *(np.cross(x, y) for x in own[0] for y in own[1])]
    apart, least = b.pose[:, :3] - a.pose[:, :3], np.full(len(a.pose), np.inf)
    for axis in axes:
        size = np.linalg.norm(axis, axis=1)
        unit = axis / np.maximum(size, 1e-9)[:, None]
        reach = sum(each.half[k] * np.abs(np.sum(unit * own[i][k], 1)) for i, each in enumerate((a, b)) for k in range(3))
        least = np.where(size > 1e-6, np.minimum(least, reach - np.abs(np.sum(unit * apart, 1))), least)
    return least


def depth(a: Solid, b: Solid) -> Optional[Array]:
    """Of one shape in another at each time [m]; None for two kinds that this does not know."""
    if b.kind in ("sphere", "capsule") or a.kind == "plane":
        a, b = b, a
    if a.kind in ("sphere", "capsule"):
        return _round_depth(a, b)
    if a.kind == "box" and b.kind == "plane":
        return np.asarray(-np.min([_signed(b, corner) for corner in np.moveaxis(_corners(a), 1, 0)], 0))
    if a.kind == b.kind == "box":
        return _box_depth(a, b)
    if a.kind == "cylinder" and b.kind == "plane":
        up = turned(b.pose[:, 3:], [0, 0, 1])
        axis = turned(a.pose[:, 3:], [0, 0, 1])
        cosine = np.sum(up * axis, 1)
        return np.asarray(a.length / 2 * np.abs(cosine) + a.radius * np.sqrt(np.maximum(0, 1 - cosine ** 2)) - _signed(b, a.pose[:, :3]))
    return None


def penetration(case: Case, motion: Motion, spec: dict[str, Any]) -> list[Figure]:
    """The deepest of all shapes of the named pairs of bodies, found from their poses."""
    still = np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(motion.times), 1))
    rows = motion.times >= spec["from"] - 1e-6
    solids: dict[str, list[Solid]] = {}
    for shape in case.shapes:
        frame, own = motion.poses.get(shape["body"], still)[rows], np.array([float(shape[key]) for key in POSE])
        pose = np.concatenate([frame[:, :3] + turned(frame[:, 3:], own[:3]), product(frame[:, 3:], np.tile(own[3:], (len(frame), 1)))], 1)
        solids.setdefault(shape["body"], []).append(Solid(shape["kind"], pose, float(shape["radius"]), float(shape["length"]),
                                                          np.array([float(shape[key]) for key in ("ex", "ey", "ez")]) / 2))
    worst, where = 0.0, ""
    for a, b in spec["pairs"]:
        for one in solids.get(a, []):
            for other in solids.get(b, []):
                found = depth(one, other)
                if found is None:
                    return _missing(spec, "m", f"depth of a {one.kind} in a {other.kind}")
                if float(found.max()) > worst:
                    worst, where = float(found.max()), f"{a} in {b}"
    return [Figure("penetration", worst, "m", spec["limit"], where)]


MEASURES: dict[str, Measure] = {
    "grasp": grasp, "creep": creep, "drift": drift, "turn": turn, "weight": weight, "grip": grip, "energy_gain": energy,
    "energy_rise": energy, "energy_error": energy, "momentum_error": momentum, "speed_error": speed, "rms_speed": speed,
    "top_speed": speed, "joint_gap": joint_gap, "penetration": penetration}


def judged(case: Case, motion: Motion) -> tuple[str, list[Figure]]:
    """The verdict of a case, and its figures."""
    figures = [figure for spec in case.spec["judge"] for figure in MEASURES[spec["measure"]](case, motion, spec)]
    of_grasp = next((spec for spec in case.spec["judge"] if spec["measure"] == "grasp"), None)
    if of_grasp is None:
        # Not every engine tells contact forces: what is not told is not judged.
        held = [figure.held for figure in figures if figure.name != "weight" or figure.value is not None]
        return "falls short" if False in held else "not measured" if None in held else "held", figures
    by = {figure.name: figure for figure in figures}
    if (by["farthest"].value or 0) > of_grasp["lost"]:
        return "lost", figures
    return "held" if all(by[name].held for name in ("shift", "turn", "shaken")) else "moved", figures


# The command.


def read_run(results: Path) -> dict[str, Any]:
    try:
        run = json.loads((results / "run.json").read_text(encoding="utf-8"))
        named = [str(run[key]) for key in ("engine", "version", "options")]
        if not all(named) or not all(isinstance(each, dict) for each in run["cases"].values()):
            raise ValueError
    except (OSError, ValueError, KeyError, AttributeError, TypeError):
        raise Wrong(f"{results / 'run.json'}:1:1: run: got no such file, or another, need engine, version, options and cases, as in README.md") from None
    return dict(run)


def judge(results: Path, suite: Path, only: list[str]) -> list[dict[str, Any]]:
    """A row for each case. :raises Wrong: with a line for each problem of any table"""
    run, out, problems = read_run(results), [], [""][:0]
    known = sorted(path.parent.name for path in suite.glob("*/case.json"))
    for name in [*only, *run["cases"]]:
        if name not in known:
            problems.append(f"{results / 'run.json'}:1:1: {name}: got no case of this name, need one of the suite's folders")
    for name in known:
        if only and name not in only:
            continue
        told = run["cases"].get(name)
        row: dict[str, Any] = {"case": name, "verdict": "not run", "figures": [], "cpu_s": None if told is None else told.get("cpu_s")}
        out.append(row)
        if told is None:
            continue
        if told.get("failed"):
            row.update(verdict="broke off", why=str(told["failed"]))
            continue
        case = Case(suite / name)
        try:
            row["verdict"], row["figures"] = judged(case, _Reader(results / f"{name}.csv", case).read())
        except Wrong as wrong:
            problems.append(str(wrong))
    if problems:
        raise Wrong("\n".join(problems))
    return out


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path, help="folder of run.json and the tables")
    parser.add_argument("--suite", type=Path, default=Path(__file__).resolve().parent, help="the suite's folder; default: where judge.py is")
    parser.add_argument("--only", nargs="*", default=[], metavar="CASE")
    parser.add_argument("--json", type=Path, help="writes verdicts and figures there, too")
    options = parser.parse_args()
    try:
        rows = judge(options.results, options.suite, options.only)
        run = read_run(options.results)
    except Wrong as wrong:
        print(wrong, file=sys.stderr)
        return 2
    width = max(len(row["case"]) for row in rows) if rows else 0
    for row in rows:
        print(f"{row['case']:{width}}  {row['verdict']:12} " + (row.get("why") or "; ".join(figure.told() for figure in row["figures"])))
    held = sum(row["verdict"] == "held" for row in rows)
    print(f"{run['engine']} {run['version']} ({run['options']}): {held} of {len(rows)} held")
    if options.json:
        content = [{**row, "figures": [{**each._asdict(), "held": each.held} for each in row["figures"]]} for row in rows]
        options.json.write_text(json.dumps({**{key: run[key] for key in ("engine", "version", "options")}, "cases": content}, indent=1) + "\n",
                                encoding="utf-8")
    return 0 if held == len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
