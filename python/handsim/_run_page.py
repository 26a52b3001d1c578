"""The page of finished runs: what it shows, from their files. resolved.yaml is compiled again, nothing is simulated.

Arrays of numbers are base64 of little-endian float32 or uint16, thinned to what a screen can show.
"""
from __future__ import annotations

import json
import os
import shlex
from base64 import b64encode
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Error, input_error
from ._files import check_target, write_file
from ._model import Array, Model, SkinParts, skins_of, turned
from ._table_files import at

POSE_TOLERANCE = 1e-4  # on any point of a body [m]
CURVE_TOLERANCE = 1 / 500  # of a curve's range: half a pixel of a plot of this height
POSE_BYTES, CONTACT_BYTES, CURVE_BYTES = 0.9e6, 0.45e6, 0.4e6  # before base64
TEXT_BYTES = 64 << 20
HAND_PARTS = ("palm", "thumb", "index", "middle", "ring", "little")
SUMMARY = json.loads("""{
  "title": "", "verdict": "", "state_hash?": "", "missing?": [""], "warnings?": [""],
  "criteria": [{"name": "", "verdict": "", "unit": "", "measured?": 0, "limit?": 0, "limit_is?": "", "where?": "", "time_s?": 0}],
  "solver": {"engine": "", "method": "", "step_s": 0}, "versions": {"handsim": ""},
  "time?": {"simulated_s": 0, "loop_wall_s": 0}, "convergence?": {"warnings?": [""]},
  "fault?": {"time_s": 0, "where": "", "quantity": "", "detail": ""},
  "climbs?": [{"name": "", "failure_time_s?": 0}], "grasps?": [{"name": "", "lost_time_s?": 0}]}""")
"""What the page reads of a summary, by example; a key with ``?`` may be absent or null."""


class RunTitle(NamedTuple):
    """What a page calls its run, and the command that repeats it, where its folder does not last."""

    name: str
    command: str


def _floats(values: Any) -> str:
    return b64encode(np.asarray(values, dtype="<f4").tobytes()).decode()


def _shorts(values: Any) -> str:
    return b64encode(np.asarray(values, dtype="<u2").tobytes()).decode()


def _rounded(values: Any) -> Array:
    """Of numbers from 0; halves up."""
    out: Array = np.floor(np.asarray(values, dtype=np.float64) + 0.5)
    return out


def _pose(x: Any) -> list[float]:
    """x y z and the quaternion x y z w, of one with w first."""
    return [float(x[i]) for i in (0, 1, 2, 4, 5, 6, 3)]


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _unlike(value: Any, example: Any, key: str) -> str:
    """The key of the first value that is not as in the example; empty if there is none."""
    if not _number(value) if _number(example) else type(value) is not type(example):
        return key
    out = ""
    if isinstance(example, list):
        return next(filter(None, (_unlike(each, example[0], f"{key}.{i}") for i, each in enumerate(value))), "")
    for name, of in example.items() if isinstance(example, dict) else ():
        plain = name.rstrip("?")
        inner: str = f"{key}.{plain}" if key else plain
        absent = value.get(plain) is None
        if absent and plain == name:
            return inner
        if not out and not absent:
            out = _unlike(value[plain], of, inner)
    return out


def _no_constant(text: str) -> None:
    raise ValueError(text)


def _read_summary(path: Path) -> dict[str, Any]:
    try:
        out = json.loads(_core.read_file(path, "a run's summary.json", TEXT_BYTES).decode(), parse_constant=_no_constant)
        json.dumps(out, ensure_ascii=False, allow_nan=False).encode()  # neither half of a letter nor a number beyond all limits
    except (ValueError, RecursionError):
        out = None
    key = _unlike(out, SUMMARY, "") if isinstance(out, dict) else "a JSON object"
    if key:
        raise input_error(str(path), f"no summary of a run: {key} is missing or wrong", "summary.json of handsim run")
    return dict(out)


class _Curves:
    """Collects curves; each is thinned on its own."""

    def __init__(self, count: int) -> None:
        self._most = max(int(CURVE_BYTES / 8 / max(1, count)), 16)
        self._curves: list[dict[str, Any]] = []
        self._groups: dict[str, bool] = {}  # whether all of its values are 0

    def add(self, group: str, unit: str, name: str, kind: str, times: Array, values: Any) -> None:
        """
        :param kind: ``value``, ``target``: dashed, in the colour of the value of its name, or the part of a hand that a muscle moves
        """
        if len(times) == 0:
            return
        values = np.ascontiguousarray(values, dtype=np.float32)
        low, high = values.min(), values.max()
        self._groups[group] = self._groups.get(group, True) and low == 0 and high == 0
        rows, _ = _core.thinned(times, values, [max(float(high - low) * CURVE_TOLERANCE, 1e-30)], self._most)
        self._curves.append({"group": group, "unit": unit, "name": name, "kind": kind, "times": _floats(times[rows]), "values": _floats(values[rows])})

    def shown(self) -> list[dict[str, Any]]:
        return [each for each in self._curves if not self._groups[each["group"]]]

    def zero(self) -> list[str]:
        """Groups that are zero all the time."""
        return sorted(name for name, zero in self._groups.items() if zero)


class _Contacts(NamedTuple):
    rows: Array
    """Of contacts.csv: time, indices of two shapes, position, normal, depth, normal force, friction."""
    first: NDArray[np.intp]
    """Row of each time of the trajectory, and the end."""
    forces: Array
    """On the first shape [N]."""


class _Run:
    """A run that is read back."""

    def __init__(self, folder: Path) -> None:
        """:raises Error: of kind input if the folder has no run of its scene"""
        self.folder = folder
        table = folder / "trajectory.csv"
        if not is_run(folder):
            raise input_error(str(folder), "a folder without trajectory.csv", "the folder of a run")
        text = _core.read_file(folder / "resolved.yaml", "a run's resolved.yaml", TEXT_BYTES)
        self.resolved = text.decode(errors="replace")
        self.core = _core.Scene.load(folder / "resolved.yaml", [])
        self.summary = _read_summary(folder / "summary.json")
        self.names, self.rows = _core.read_numbers(table, True)
        self.columns: dict[str, Any] = _core.table_columns(self.core)
        if self.names != self.columns["trajectory"]:
            raise input_error(str(table), "columns of another scene", "the table of the run beside it")
        if len(self.rows) == 0:
            raise input_error(str(table), "no rows", "a run that has started")
        self.times: Array = np.ascontiguousarray(self.rows[:, 0])
        self.model = Model(_core.description(self.core), self.core.title)
        self.drawn: dict[str, Any] = _core.drawn(self.core)
        self.dofs = len(self.core.coordinates())
        self.recorded = self.rows[:, 1 + 2 * self.dofs:].reshape(len(self.rows), -1, 7)
        """Poses of all bodies but the world, x y z and quaternion w x y z."""
        lengths = np.sqrt(np.sum(self.recorded[:, :, 3:] ** 2, axis=2))
        wrong = np.argwhere(~(np.abs(lengths**2 - 1) < 1e-3))
        if len(wrong):
            row, body = wrong[0]
            raise at(table, int(row) + 2, "", f"{self.names[1 + 2 * self.dofs + 7 * int(body) + 3]} to .qz of length {lengths[row, body]:g}",
                     "a unit quaternion")
        self.poses = np.concatenate([self.recorded[:, :, :3], self.recorded[:, :, 3:] / lengths[:, :, None]], axis=2)

    def hand_of(self, body: int) -> Optional[str]:
        return next((hand.name for hand in self.model.hands if body in hand.bodies), None)

    @cached_property
    def contacts(self) -> Optional[_Contacts]:
        """Nothing if the run recorded none."""
        path = self.folder / "contacts.csv"
        if not os.path.lexists(path):
            return None
        rows = _core.read_contacts(self.core, path)
        # Both tables have rows at the same times.
        index = np.searchsorted(self.times, rows[:, 0] - 1e-9)
        near = self.times[np.minimum(index, len(self.times) - 1)]
        order = np.concatenate([[False], index[1:] < index[:-1]])[:len(index)]
        wrong = np.flatnonzero((np.abs(near - rows[:, 0]) > 1e-9 * np.maximum(1, rows[:, 0])) | order)
        if len(wrong):
            raise at(path, int(wrong[0]) + 2, "", f"the time {rows[wrong[0], 0]:g}", "times of trajectory.csv that increase")
        first = np.searchsorted(index, np.arange(len(self.times) + 1))
        return _Contacts(rows, first, rows[:, 10:11] * rows[:, 6:9] + rows[:, 11:14])


def _shapes(run: _Run) -> list[dict[str, Any]]:
    """As pictures show them, each in its body's frame; marks are nails and stumps of wrists."""
    out = []
    for index, core, half, rounding, pose, colour, mark in run.drawn["shapes"]:
        of = run.model.shapes[index]
        entry = {"core": core, "half": half, "round": rounding, "name": of.name, "body": of.body, "part": of.part, "hand": run.hand_of(of.body),
                 "pose": _pose(pose), "colour": colour}
        if core == "hull":
            entry["corners"] = _floats(of.corners[of.faces.astype(int)])
        out.append({**entry, "mark": True} if mark else entry)
    return out


def _skin_mesh(skin: SkinParts) -> dict[str, Any]:
    """Points in steps of their box, triangles, and the four strongest bodies of each point as 1024 times the body and 1023 times its share."""
    low = skin.points.min(axis=0)
    step = (skin.points.max(axis=0) - low) / 65535
    bodies = np.argsort(-skin.weights, axis=1, kind="stable")[:, :4]
    shares = np.take_along_axis(skin.weights, bodies, axis=1).astype(np.float32)
    return {"low": low.tolist(), "step": step.tolist(), "points": _shorts(_rounded((skin.points - low) / step)), "faces": _shorts(skin.faces),
            "influences": _shorts(np.where(shares > 0, 1024 * bodies, 0) + _rounded(np.float32(1023) * shares))}


def _skins(run: _Run) -> list[dict[str, Any]]:
    """The mesh of a hand that is the mirror image of an earlier one is written once."""
    out: list[dict[str, Any]] = []
    skins = skins_of(run.core) if run.drawn["look"] != "shapes" else []
    for i, skin in enumerate(skins):
        like = next((k for k in range(i) if np.array_equal(skin.points, skins[k].points * [-1, 1, 1])), None)
        out.append({"bodies": skin.bodies, "rest": [_pose(x) for x in skin.rest], "tone": list(skin.colour), "hand": run.hand_of(skin.bodies[0]),
                    **(_skin_mesh(skin) if like is None else {"mirror_of": like})})
    return out


def _moments(run: _Run, most: int) -> NDArray[np.intp]:
    """Rows over the run."""
    rows = len(run.times)
    count = min(most, rows)
    return np.arange(count) * (rows - 1) // max(1, count - 1)


def _camera(run: _Run, fixed: Array) -> dict[str, Any]:
    """The camera of the start, and how it follows the hand as in a video."""
    rows = _moments(run, 400)  # as many as follow every motion of an arm
    spacing = (run.times[-1] - run.times[0]) / max(1, len(rows) - 1)
    reach = int(_rounded(0.5 / spacing)) if spacing > 0 else 0  # it looks 0.5 s ahead and back
    contacts, first = np.zeros((0, 14)), []
    if run.contacts:
        parts = [run.contacts.rows[run.contacts.first[row]:run.contacts.first[row + 1]] for row in rows]
        contacts, first = np.concatenate(parts), np.cumsum([0, *map(len, parts)]).tolist()
    along = _core.cameras(run.core, run.poses[rows], contacts, first, reach)
    moves = bool(np.any(along[:, :6] != along[0, :6]))
    path = None
    if moves:
        distances = np.linalg.norm(along[:, :3] - along[:, 3:6], axis=1)
        path = {"times": _floats(run.times[rows]), "values": _floats(np.column_stack([along[:, 3:6], distances]))}
    camera = along[0] if moves else fixed
    width, height = run.drawn["size"]
    return {"position": camera[:3].tolist(), "target": camera[3:6].tolist(), "up": camera[6:9].tolist(), "field_of_view": float(camera[9]),
            "aspect": width / height, "path": path}


def _scene(run: _Run) -> dict[str, Any]:
    """Bodies, shapes in the colours of the pictures, joint axes, fingertips, camera and floor."""
    drawn, model = run.drawn, run.model
    ground, camera = _core.stage(run.core, run.poses[_moments(run, 24)])  # as many as a contact sheet shows
    return {
        "bodies": [{"name": of.name if i else "world", "mass": None if of.fixed or i == 0 else of.mass} for i, of in enumerate(model.bodies)],
        "shapes": _shapes(run),
        "axes": [dict(zip(("name", "body", "from", "to", "radius", "colour"), each)) for each in drawn["arrows"]],
        "tips": [{"body": body, "hand": hand.name, "part": name.rpartition(".")[2].partition("_")[0], "point": point.tolist()}
                 for hand in model.hands for name, body, point in hand.tips],
        "skins": _skins(run), "look": drawn["look"], "finger_colours": drawn["finger_colours"],
        "meshes": {name: {"vertices": _floats(drawn[name][0]), "indices": _shorts(drawn[name][1])} for name in ("capsule", "box", "cylinder")},
        "ground": ground, "floor_is_drawn_only": not drawn["ground"], "camera": _camera(run, camera[0])}


def _poses(run: _Run) -> dict[str, Any]:
    moves = [False, *np.any(run.recorded != run.recorded[0], axis=(0, 2)).tolist()]
    moving = [body for body, each in enumerate(moves) if each]
    still = [[0, 0, 0, 1, 0, 0, 0], *run.poses[0]]
    values = run.recorded[:, [body - 1 for body in moving]].astype(np.float32)[:, :, [0, 1, 2, 4, 5, 6, 3]]
    # A rotation has two quaternions: takes the one near the row before.
    sides = np.where(np.sum(values[1:, :, 3:] * values[:-1, :, 3:], axis=2) < 0, np.float32(-1), np.float32(1))
    values[1:, :, 3:] *= np.cumprod(sides, axis=0)[:, :, None]
    # A change of a quaternion's components by e turns by about 2 e.
    reaches = dict.fromkeys(moving, 0.01)
    for index, reach in run.drawn["reaches"]:
        shape = run.model.shapes[index]
        reaches[shape.body] = max(reaches.get(shape.body, 0), float(np.linalg.norm(shape.pose[:3])) + reach)
    tolerances = [each for body in moving for each in (*[POSE_TOLERANCE / 2] * 3, *[POSE_TOLERANCE / 4 / reaches[body]] * 4)]
    rows, factor = _core.thinned(run.times, values, tolerances, int(POSE_BYTES / (4 * (len(tolerances) + 1))))
    return {"moving": moving, "fixed": [None if each else _pose(x) for each, x in zip(moves, still)], "times": _floats(run.times[rows]),
            "values": _floats(values[rows]), "recorded": len(run.times), "every": run.core.record_every, "tolerance": POSE_TOLERANCE * factor}


def _contacts(run: _Run) -> Optional[dict[str, Any]]:
    """Contact points and forces; nothing if the run recorded none."""
    if run.contacts is None:
        return None
    rows, first, forces = run.contacts
    shapes = run.model.shapes
    # Position and force of each contact, and its two shapes.
    stride = max(1, int(np.ceil((6 * 4 + 2 * 2) * len(rows) / CONTACT_BYTES)))
    kept = np.arange(0, len(run.times), stride)
    counts = first[kept + 1] - first[kept]
    shown = np.concatenate([np.arange(first[row], first[row + 1]) for row in kept])
    of = rows[shown, 1:3].astype(int)
    # The force on the one of the two that is free, or on the object that a hand touches.
    is_object = np.array([each.part == "object" for each in shapes], dtype=bool)
    in_world = np.array([each.body == 0 for each in shapes], dtype=bool)
    a, b = of[:, 0], of[:, 1]
    on_b = (~in_world[b] & is_object[b] & ~is_object[a]) | in_world[a] if len(of) else np.zeros(0, dtype=bool)
    arrows = np.where(on_b[:, None], -1.0, 1.0) * forces[shown]
    return {"times": _floats(run.times[kept]), "starts": _floats([0, *np.cumsum(counts)]),
            "values": _floats(np.concatenate([rows[shown, 3:6], arrows], axis=1)), "shapes": _shorts(of),
            "names": [{"name": each.name, "body": each.body} for each in shapes],
            "largest": float(np.linalg.norm(arrows, axis=1).max(initial=0)), "stride": stride}


def _part_sums(run: _Run) -> list[tuple[str, Array]]:
    """Normal forces of the parts of hands that touch anything [N], at the times of the run."""
    if run.contacts is None:
        return []
    rows, first, forces = run.contacts
    normal = np.sum(forces * rows[:, 6:9], axis=1)
    index = np.repeat(np.arange(len(run.times)), np.diff(first))
    shapes = rows[:, 1:3].astype(int)
    out = []
    for hand in run.model.hands:
        for part in HAND_PARTS:
            on = np.array([each.part == part and each.body in hand.bodies for each in run.model.shapes], dtype=bool)
            touches = on[shapes]
            if touches.any():
                sides = np.repeat(index, 2).reshape(-1, 2)[touches], np.repeat(normal, 2).reshape(-1, 2)[touches]
                out.append((f"{hand.name}.{part}", np.bincount(sides[0], sides[1], len(run.times)).astype(np.float64)))
    return out


def _parted(column: str) -> tuple[str, str]:
    """The name of a column without its unit, and the unit."""
    name, _, unit = column.partition("[")
    return name, unit[:-1]


def _table(run: _Run, name: str) -> tuple[Array, Array]:
    """Times and columns of a table beside the trajectory, in the precision of the page."""
    path = run.folder / f"{name}.sto"
    columns, rows = _core.read_numbers(path, True)
    if columns != run.columns[name]:
        raise input_error(str(path), "columns of another scene", "the table of the run beside it")
    return rows[:, 0].astype(np.float32).astype(np.float64), rows.T


def _add_coordinates(run: _Run, curves: _Curves) -> None:
    for column, values in zip(run.names[1:1 + run.dofs], run.rows[:, 1:].T):
        name, unit = _parted(column)
        angle = unit == "rad"
        curves.add("Angles" if angle else "Sliders", "deg" if angle else "mm", name, "value", run.times,
                   (180 / np.pi if angle else 1e3) * values)


def _add_gaps(run: _Run, curves: _Curves) -> None:
    """The largest gap of a hand's joints, or of all others."""
    joints = run.model.joints
    poses = np.concatenate([np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(run.times), 1, 1)), run.poses], axis=1)
    gaps = np.zeros((len(run.times), len(joints)), dtype=np.float32)
    for i, joint in enumerate(joints):
        parent, child = poses[:, joint.parent], poses[:, joint.child]
        gap = child[:, :3] + turned(child[:, 3:], joint.child_frame[:3]) - parent[:, :3] - turned(parent[:, 3:], joint.parent_frame[:3])
        if any(joint.slides):
            axis = turned(parent[:, 3:], turned(joint.parent_frame[3:], joint.axes[0].axis))
            gap -= np.sum(gap * axis, axis=1, keepdims=True) * axis
        gaps[:, i] = 1e6 * np.linalg.norm(gap, axis=1)
    gaps[gaps < 1e-6] = 0  # rounding, of an engine without gaps
    of_hands = {joint for hand in run.model.hands for joint in hand.joints}
    owners = [("joints", [i for i in range(len(joints)) if i not in of_hands]), *((hand.name, hand.joints) for hand in run.model.hands)]
    for name, own in owners:
        if own:
            curves.add("Joint gaps", "um", name, "value", run.times, gaps[:, own].max(axis=1))


def _add_monitor(run: _Run, path: Path, curves: _Curves) -> None:
    """Columns of monitor.csv: energies and residuals. A residual is measured in some steps only."""
    columns, rows = _core.read_numbers(path, False)
    if ",".join(columns) != run.columns["monitor"]:
        raise input_error(str(path), "other columns", "monitor.csv of a run")
    groups = {"J": "Energies", "rad/s": "Residuals of rotations"}
    with np.errstate(over="ignore"):
        numbers = rows.astype(np.float32)
    for c, column in enumerate(columns[1:], 1):
        name, unit = _parted(column)
        measured = np.isfinite(numbers[:, c])
        curves.add(groups.get(unit, "Residuals of velocities"), unit, name, "value", np.ascontiguousarray(rows[measured, 0]), numbers[measured, c])


def _curves(run: _Run) -> _Curves:
    axes, muscles, sums = run.columns["control"][1:], run.core.muscles(), _part_sums(run)
    curves = _Curves((len(axes) or run.dofs) + 2 * len(muscles) + len(sums) + 8)
    if axes and os.path.lexists(run.folder / "control.sto"):
        times, columns = _table(run, "control")
        for c in range(1, len(columns), 3):
            name = axes[c - 1].rpartition(".")[0]
            curves.add("Angles", "deg", name, "target", times, columns[c])
            curves.add("Angles", "deg", name, "value", times, columns[c + 1])
            curves.add("Torques", "N m", name, "value", times, columns[c + 2])
    else:
        _add_coordinates(run, curves)
    if os.path.lexists(run.folder / "muscles.sto"):
        times, columns = _table(run, "muscles")
        width = (len(columns) - 1) // max(1, len(muscles))
        for c, (name, part, *_) in zip(range(1, len(columns), width or 1), muscles):
            curves.add(f"Activations, {part}", "", name, part, times, columns[c + 1])
            curves.add(f"Tensions, {part}", "N", name, part, times, columns[c + 2])
    for name, values in sums:
        curves.add("Contact forces", "N", name, "value", run.times, values)
    if run.model.joints:
        _add_gaps(run, curves)
    monitor = run.folder / "monitor.csv"
    if os.path.lexists(monitor):
        _add_monitor(run, monitor, curves)
    return curves


def _marks(run: _Run) -> list[dict[str, Any]]:
    """Phases of tasks, and events: times of figures, verdicts and faults."""
    out = [{"kind": "phase", "name": name, "time": start, "end": end} for name, start, end in run.drawn["phases"]]
    failed = [(f"climb {each['name']} fails", each.get("failure_time_s")) for each in run.summary.get("climbs") or []]
    for each in run.summary.get("grasps") or []:
        outcome = each.get("outcome")
        failed.append((f"{each['name']} {outcome if isinstance(outcome, str) else 'lost'}", each.get("lost_time_s")))
    fault = run.summary.get("fault")
    if fault:
        failed.append((f"diverged: {fault['where']}, {fault['quantity']} {fault['detail']}", fault["time_s"]))
    return out + [{"kind": "failed", "name": name, "time": time} for name, time in failed if time is not None]


def _command(run: _Run) -> str:
    out = f"handsim run {shlex.quote(str(run.folder / 'resolved.yaml'))} --out again"
    if "continued_from_s" in run.summary:
        out += " --from-snapshot snapshot.bin"
    state_hash = run.summary.get("state_hash")
    return f"{out} --expect-hash {state_hash}" if state_hash else out


def _run_data(folder: Path) -> dict[str, Any]:
    run = _Run(folder)
    contacts = _contacts(run)
    curves = _curves(run)
    return {"name": os.path.normpath(folder), "title": run.summary["title"], "command": _command(run), "resolved": run.resolved, "summary": run.summary,
            "scene": _scene(run), "poses": _poses(run), "contacts": contacts, "curves": curves.shown(), "zero": curves.zero(), "marks": _marks(run)}


def run_page(folders: Sequence[Path], title: Optional[RunTitle] = None) -> str:
    """Text of the page. A second run is drawn over the first one as a ghost.

    :param title: None: of the first folder
    :raises Error: of kind input for no run, other tables, a build without three.js
    """
    _core.require_three()
    runs = [_run_data(folder) for folder in folders]
    if len(runs) > 1 and runs[1]["scene"]["skins"] == runs[0]["scene"]["skins"]:
        del runs[1]["scene"]["skins"]
    if title is not None:
        runs[0].update(title._asdict())
    return _core.page(True, runs[0]["title"], json.dumps({"kind": "run", "handsim": f"{_core.version} ({_core.commit})", "runs": runs}, separators=(",", ":")))


def is_run(folder: Path) -> bool:
    return os.path.lexists(folder / "trajectory.csv")


def write_page(folders: Sequence[Path], out: Optional[Path] = None) -> Path:
    """The page of a run or study, or of two runs in comparison.

    :param out: None: report.html in the first folder
    :returns: its path
    :raises Error: of kind input for other folders, and for more than two
    """
    for folder in folders:
        if not os.path.isdir(folder):
            raise input_error("report", str(folder), "the folder of a run or study")
    if len(folders) not in (1, 2):
        raise input_error("report", "more than two folders" if folders else "no folder", "one run or study, or two runs to compare")
    for folder in folders if len(folders) == 2 else ():
        if not is_run(folder):
            raise input_error("report", f"{folder}, no folder of a run", "two runs")
    page = folders[0] / "report.html" if out is None else out
    if page.suffix.lower() != ".html":
        raise input_error("--out", str(page), "a name that ends in .html")
    check_target("report" if out is None else "--out", page, "html")
    text = run_page(folders) if is_run(folders[0]) else _core.study_page(folders[0])
    write_file(page, text.encode())
    return page


def page_of_run(folder: Union[str, "PathLike[str]"]) -> str:
    """What a run of the program calls at its end: writes its page. :returns: what hindered it; empty if nothing did"""
    try:
        write_page([Path(folder)])
    except Error as error:
        return str(error)
    except (MemoryError, OSError) as error:
        return str(error) or "not enough memory"
    return ""
