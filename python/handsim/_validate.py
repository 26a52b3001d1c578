"""Hands beside people's measured values: the rows of a file such as config/validate.yaml, each computed of a hand."""
from __future__ import annotations

import json
import os
import re
from functools import cached_property
from pathlib import Path
from typing import Any, Callable, Iterable, Mapping, NamedTuple, Optional

import numpy as np

from . import _core
from ._errors import Error, input_error
from ._grip import GripRun
from ._rollouts import Executor, Threads, map_units
from ._scene import Scene
from ._statics import AT_STOP, DIRECTIONS, Array, NotHeld, Statics, alone, enslaving, fault, pinch, strongest, tip_force
from ._statistics import Uncertainty, uncertainty_of

Row = dict[str, Any]
"""Of a file, as src/handsim/study/validate/validate.h says."""
Angles = Mapping[str, float]
"""By axis [rad]."""
Told = Optional[Callable[[float], object]]
OF_SCENES = ("simulation", "grip_force")
"""Kinds of rows whose hand is a scene's, not one of the file's people."""
POSTURE = np.radians(5)
"""One standard deviation between a joint's angle and the one that a source states, of living people [rad]: standard errors of goniometers at finger
joints are 2.4 to 4.9 deg (Macionis 2013, BMC Musculoskelet Disord 14:17) and 4 to 11 deg (Reissner 2019, J Orthop Surg Res 14:173)."""
POSED = ("tip_force", "enslaving", "pinch_force", "joint_moment", "passive_moment", "excursion")
"""Kinds of rows that people were in a posture for."""


class Measured:
    """A row with the hand's value."""

    def __init__(self, row: Row, ours: float, deviation: float, measured: bool, note: str = "") -> None:
        self.row, self.ours = row, ours
        self.note = note
        """What is to be said of the value."""
        self.deviation = deviation
        """Over the spread; of moment_arms: root mean square over the angles."""
        self.measured = measured
        """False: a simulation that was not run."""
        self.weight = 1.0
        """One over the rows that this value serves."""
        self.uncertainty: Optional[Uncertainty] = None
        self.score = 0.0
        """Of a row with drawn hands: how far the measured value is from the middle of the middle 90 % of drawn hands, its spread added, over half of its
        width: up to 1 it is inside."""
        self.widened = 1.0
        """By how much that interval has to be wider for nine in ten predictions of other sources (`calibrate`)."""

    @property
    def within(self) -> bool:
        return self.measured and self.deviation <= 1

    @property
    def inside(self) -> bool:
        """The measured value is within the middle 90 % of drawn hands, its spread added."""
        return self.uncertainty is not None and self.score <= 1


class Tally(NamedTuple):
    """How many measured values there are, and how many of them are within. A value that serves several rows counts once, within by
    the part of these rows that it is within."""

    within: float
    values: float

    @property
    def share(self) -> float:
        return self.within / self.values if self.values else 0.0


Filter = Callable[[Row], bool]


def every(_: Row) -> bool:
    return True


def of_people(row: Row) -> bool:
    """Of people, with the spread and the conditions of the source."""
    return bool(row["of"] == "people" and row["spread_is"] == "source" and not row["chosen"])


def predicted(row: Row) -> bool:
    return bool(row["value_is"] == "predicted")


def _sum(of: Iterable[float]) -> float:
    """In their order: `sum` of newer Pythons rounds otherwise."""
    out = 0.0
    for each in of:
        out += each
    return out


class Result(NamedTuple):
    title: str
    goal: float
    """Share of values within one spread."""
    rows: list[Measured]

    def within(self, of: Filter = every) -> Tally:
        """Values within one spread, of measured rows."""
        rows = [row for row in self.rows if row.measured and of(row.row)]
        return Tally(_sum(row.weight for row in rows if row.within), _sum(row.weight for row in rows))

    def covered(self, of: Filter = every, calibrated: bool = False) -> Tally:
        """Rows with drawn hands whose measured value is inside, or within the calibrated interval."""
        rows = [row for row in self.rows if row.uncertainty and of(row.row)]
        return Tally(float(sum(row.score <= (row.widened if calibrated else 1) for row in rows)), float(len(rows)))

    @property
    def widened(self) -> float:
        """By how much intervals of drawn hands have to be wider for nine in ten predictions, of all sources."""
        return _nine_in_ten([row.score for row in self.rows if row.uncertainty and predicted(row.row)])

    @property
    def passed(self) -> bool:
        """Every required row that was measured is within its spread."""
        return all(row.within or not row.measured or not row.row["required"] for row in self.rows)


# Rows of a person's hand.

def _arms(of: Statics, row: Row) -> Array:
    """A muscle's arm at each angle [m]."""
    muscle, axis = of.hand.muscles.index(row["muscle"]), of.names.index(row["axis"])
    return _scale(of, row) * np.array([of.muscles(of.at({**row["pose"], row["axis"]: angle}))[0][muscle, axis] for angle in row["angles"]])


def _scale(of: Statics, row: Row) -> float:
    """To the length of the measured hand."""
    return float(row["hand_length"] / _core.whole_hand(of.hand.scene._core)["length"]) if "hand_length" in row else 1.0


def _muscles(of: Statics, row: Row) -> list[int]:
    return [of.hand.muscles.index(name) for name in row["muscles"]]


def _excursion(of: Statics, row: Row) -> float:
    """Of tendons from one pose to another [m]."""
    ends = [of.muscles(of.at(row.get(key, {})))[1][_muscles(of, row)] for key in ("pose", "from")]
    return _scale(of, row) * float(np.mean(ends[0] - ends[1]))


def _tip_share(of: Statics, row: Row) -> float:
    """Force on what holds the tip in force and moment, per tension: joint moments r T = J^T (force, moment), of the finger's flexion
    axes, with forces in the plane of flexion."""
    q, finger = of.at(row["pose"]), row["finger"]
    body = finger + "_distal"
    turn = of.axes(q, body).T
    J = of.hand.jacobian(q, (body, np.array([0, of.tip(finger), 0])))
    planar = [of.names.index(finger + joint) for joint in ("_mcp.flexion", "_pip.flexion", "_dip.flexion")]
    arms = of.muscles(q)[0][_muscles(of, row)].sum(axis=0)
    force = np.linalg.solve(np.vstack([(turn @ J[:3])[1:], (turn @ J[3:])[:1]]).T[planar], arms[planar])
    if row["direction"] == "any":
        return float(np.hypot(force[0], force[1]))
    return float(force[:2] @ np.array(DIRECTIONS[row["direction"]], dtype=float)[1:])


def _joint_moment(of: Statics, row: Row) -> float:
    """Largest isometric moment about an axis [N m]: of muscles that turn it that way, or where other axes balance, too."""
    q, axis, sign = of.at(row["pose"]), of.names.index(row["axis"]), -1.0 if row["direction"] == "negative" else 1.0
    if "balanced" in row:
        outside = np.zeros((len(q), 1))
        outside[axis] = sign
        return of.press(q, [axis, *_balanced(of, row)], outside).sum
    arms, _, active, rest, _ = of.muscles(q)
    chosen = _muscles(of, row)
    return float(np.maximum(sign * arms[chosen, axis], 0) @ (active + rest)[chosen])


def _balanced(of: Statics, row: Row) -> list[int]:
    return [of.names.index(axis) for axis in row.get("balanced", [])]


def _rotation(of: Statics, row: Row) -> float:
    """From rest to where a loaded tendon, tissue and resting muscles balance [rad]."""
    free, muscle = of.rows(row["finger"] + "_"), of.hand.muscles.index(row["muscle"])
    rest = of.balance(of.at(row["pose"], rest=True), free)
    tension = row["load"] * of.hand.scene.muscles[muscle].force
    return float((of.balance(rest, free, {muscle: tension}) - rest)[of.names.index(row["axis"])])


def _coupled(of: Statics, row: Row) -> float:
    """Where tissue, bands and resting muscles balance, other axes held [rad]; with a finger all its axes may turn."""
    axis = of.names.index(row["axis"])
    return float(of.balance(of.at(row["pose"], rest=True), of.rows(row["finger"] + "_") if "finger" in row else [axis])[axis])


def _pulley(_: Statics, row: Row) -> float:
    return float(_core.pulley_forces(row["tension"], row["pip"])[row.get("pulley") == "A4"])


def _whole(key: str) -> Callable[[Statics, Row], float]:
    return lambda of, row: float(_core.whole_hand(of.hand.scene._core)[key or row["direction"]])


KINDS: dict[str, Callable[[Statics, Row], float]] = {
    "moment_arms": lambda of, row: float(_arms(of, row).mean()), "excursion": _excursion, "tip_force_share": _tip_share,
    "tip_force": lambda of, row: tip_force(of, of.at(row["pose"]), row["finger"], row["direction"], row["friction"], row.get("segment"), _balanced(of, row)),
    "enslaving": lambda of, row: enslaving(of, of.at(row["pose"]), row["finger"], row["by"]),
    "pinch_force": lambda of, row: pinch(of, of.at(row["pose"]), row["finger"], row["friction"], _balanced(of, row)),
    "joint_moment": _joint_moment, "loaded_rotation": _rotation, "coupled_angle": _coupled, "pulley_force": _pulley,
    "passive_moment": lambda of, row: float(of.passive(of.at(row["pose"], rest=True))[of.names.index(row["axis"])]),
    "sheath_friction": lambda of, row: 1 - float(_core.sheath_gain(row["pip"])) ** -2,
    "hand_mass": _whole("mass"), "centre_of_mass": _whole("centre_of_mass"), "gyration": _whole("")}
"""Kinds of rows of a person's hand, in SI."""


def measure(row: Row, in_pose: Callable[[Row], float]) -> float:
    """A row's value in SI: the largest over its poses, over that of another one.

    :param in_pose: the value of a row in its one pose
    :raises NotHeld: where the hand does not hold any of the poses
    :raises Error: of kind physics, with the row's name, where there is none
    """
    try:
        value: float = strongest(lambda pose: in_pose({**row, "pose": pose}), [row["pose"], *row.get("or_poses", [])])
        return value / in_pose({**row, "pose": row["over_pose"]}) if "over_pose" in row else value
    except NotHeld:
        raise NotHeld(row["name"]) from None
    except Error as error:
        if error.fault is None:
            raise
        raise fault(row["name"], error.fault.quantity, error.fault.detail) from None


# Rows of scenes.

def grip_run(row: Row) -> GripRun:
    return GripRun(lambda changes: Scene(_core.Scene.load(row["scene"], [*row.get("set", []), *changes])), row["pose"], row["tilts"], row["friction"],
                   row.get("balanced", []))


def found_at(summary: Any, path: str) -> Any:
    """What stands at a path of keys, of indices of lists, and of `name`s of a list's entries, with or without their hand:
    ``contact_forces.fingers.index.force_at_end_N``; None: there is nothing."""
    now = summary
    for key in path.split("."):
        if isinstance(now, dict):
            now = now.get(key)
        elif isinstance(now, list) and key.isascii() and key.isdigit():
            now = now[int(key)] if int(key) < len(now) else None
        elif isinstance(now, list):
            names = [(str(each.get("name", "")) if isinstance(each, dict) else "", each) for each in now]
            now = next((each for name, each in reversed(names) if name == key or name.endswith("." + key)), None)
        else:
            return None
    return now


class SimulatedScenes:
    """Runs scenes, each once for all rows that ask for it."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self._summaries: dict[tuple[str, tuple[str, ...]], Any] = {}

    def figure(self, row: Row) -> float:
        """The row's number. :raises Error: of kind input if the summary does not have it"""
        summary = self._summary(row)

        def total(figures: list[str]) -> float:
            out: list[Array] = []
            for figure in figures:
                found = np.atleast_1d(np.array([each if _is_number(each) else np.nan for each in _list(found_at(summary, figure))], dtype=float))
                if found.shape not in ((1,), (3,)) or np.isnan(found).any() or (out and out[0].shape != found.shape):
                    raise input_error(row["name"], f"no number {figure} in the summary of {row['scene']}",
                                      "figures such as climbs.0.load_N, all numbers or all vectors")
                out.append(found)
            whole = np.sum(out, axis=0)
            return float(whole[0] if len(whole) == 1 else np.linalg.norm(whole))

        return total(row["figure"]) / total(row["over"]) if "over" in row else total(row["figure"])

    def _summary(self, row: Row) -> Any:
        key = row["scene"], tuple(row.get("set", []))
        if key not in self._summaries:
            scene = Scene(_core.Scene.load(row["scene"], list(key[1])))
            self._summaries[key] = scene.run(self.out / f"run_{len(self._summaries) + 1}", frames=0, progress=False).summary
        return self._summaries[key]


def _list(of: Any) -> list[Any]:
    return of if isinstance(of, list) and len(of) == 3 else [of]


def _is_number(of: Any) -> bool:
    return isinstance(of, (int, float)) and not isinstance(of, bool)


# A file.

class Measurements:
    """A file of measurements."""

    def __init__(self, path: Path) -> None:
        """:raises Error: of kind input with every problem of the file, and of the files that it names"""
        self._read(path, os.getcwd(), {})

    def _read(self, path: Path, folder: str, files: dict[str, bytes]) -> None:
        """:param files: that are carried, from `folder`; none: those of the disk"""
        self.path, self._folder = path, folder
        self.core, self._files = _core.measurements(path, folder, files)
        content = json.loads(self.core.text)
        self.title: str = content["title"]
        self.goal: float = content["goal"]
        self.rows: list[Row] = content["rows"]

    def __getstate__(self) -> tuple[Path, str, dict[str, bytes]]:
        """It travels to any machine with all that it has read."""
        return self.path, self._folder, self._files

    def __setstate__(self, state: tuple[Path, str, dict[str, bytes]]) -> None:
        self._read(*state)

    def run(self, runs: Optional[Path] = None, uncertain: Optional[int] = None, told: Told = None,
            executor: Optional[Executor] = None) -> Result:
        """The hands' values of all rows.

        :param runs: folder for the files of simulations; None: these rows are not measured
        :param uncertain: hands drawn of each person, for rows that are no simulations
        :param executor: measures the drawn hands; None: this process, one after the other
        :raises Error: of kind physics, with its name, for a row that has no value
        """
        subjects = _Subjects(self.core)
        scenes = None if runs is None else SimulatedScenes(runs)
        rows: list[Measured] = []
        for row in self.rows:
            measured, ours, note = row["kind"] != "simulation" or scenes is not None, 0.0, ""
            try:
                if row["kind"] == "grip_force":
                    ours = measure(row, lambda one: grip_run(one).force())
                elif row["kind"] != "simulation":
                    ours = subjects.measure(row)
                elif scenes is not None:
                    ours = scenes.figure(row)
            except NotHeld as error:
                assert error.fault
                note = f"no force: {error.fault.detail}"
            if "over_row" in row and measured:
                ours /= rows[row["over_row"]].ours
            away = (float(np.sqrt(np.mean((_arms(subjects.of(row), row) - row["arms"]) ** 2))) if row["kind"] == "moment_arms" else
                    abs(ours - row["measured"]))
            rows.append(Measured(row, ours, away / row["spread"], measured, note))
        _weigh(rows)
        if uncertain is not None:
            if executor is not None:
                self._draw(rows, uncertain, told, executor)
            else:
                with Threads(1) as own:
                    self._draw(rows, uncertain, told, own)
        return Result(self.title, self.goal, rows)

    @cached_property
    def _uncertain(self) -> dict[str, list[str]]:
        """Names of what is uncertain of each person."""
        return {row["person"]: self.core.uncertain(row["person"]) for row in self.rows if "person" in row}

    def drawn_values(self, hand: int) -> Array:
        """The values of all rows that are no simulations, on one drawn hand of each person, in a posture that is not quite the stated one; NaN:
        none."""
        plain = _Subjects(self.core)
        subjects = _Subjects(self.core, {person: {name: _core.normal(1, hand, name) for name in of} for person, of in self._uncertain.items()})
        out = np.full(len(self.rows), np.nan)

        def value(row: Row) -> float:
            if row["of"] != "people" or row["kind"] not in POSED:
                return subjects.measure(row)

            def normal(axis: str) -> float:
                return float(_core.normal(3, hand, f"{row['name']}: {axis}"))

            return subjects.measure(row, lambda one: _posture(plain.of(row), subjects.of(row), one, normal))

        for r, row in enumerate(self.rows):
            if "person" in row:
                try:
                    out[r] = value(row)
                except NotHeld:
                    out[r] = 0
                except Error as error:
                    if error.fault is None:
                        raise
                    continue  # such a hand has no posture in which moments balance
                if "over_row" in row:
                    out[r] /= out[row["over_row"]]
        return out

    def _draw(self, rows: list[Measured], count: int, told: Told, executor: Executor) -> None:
        """Draws hands of each person, and measures all rows that are no simulations on them."""
        ours = np.array(map_units(executor, Measurements.drawn_values, self, count, told=told)).T
        for measured, values in zip(rows, ours):
            row = measured.row
            if "person" not in row:
                continue
            inputs = [(name, np.array([_core.normal(1, i, name) for i in range(count)])) for name in self._uncertain[row["person"]]]
            measured.uncertainty = uncertainty_of(inputs, values)
            both = uncertainty_of([], values + row["spread"] * np.array([_core.normal(2, i, row["name"]) for i in range(count)]))
            half = max((both.high - both.low) / 2, 1e-300)
            measured.score = abs(row["measured"] - (both.low + both.high) / 2) / half
        calibrate(rows)


def source_of(row: Row) -> str:
    """Author and year, or what the row's source begins with."""
    first = re.split(r"[,;:(]", row["source"])[0].strip()
    year = re.match(r".*?\b(19|20)\d\d\b", first)
    return year.group() if year else first


def calibrate(rows: list[Measured]) -> None:
    """How much wider the interval of drawn hands has to be: for each row by predictions of other sources than its own. So no row is judged by what
    has seen it, or another row of its source (split conformal prediction: Lei et al. 2018, J Am Stat Assoc 113:1094). Rows that are scaled by a norm
    of the person's strength know more than a prediction and do not count."""
    seen = [row for row in rows if row.uncertainty and predicted(row.row)]
    for row in rows:
        row.widened = _nine_in_ten([other.score for other in seen if source_of(other.row) != source_of(row.row)])


def _nine_in_ten(scores: list[float]) -> float:
    """What nine in ten further scores are at most, if they are like these; at least 1. Of fewer than nine, the largest."""
    place = min(len(scores), int(np.ceil(0.9 * (len(scores) + 1))))
    return max(1.0, sorted(scores)[place - 1]) if scores else 1.0


class _Subjects:
    """The hands that rows measure, each built once."""

    def __init__(self, core: Any, deviations: Optional[Mapping[str, dict[str, float]]] = None) -> None:
        self._core, self._deviations = core, deviations or {}
        self._built: dict[tuple[str, str], Statics] = {}

    def of(self, row: Row) -> Statics:
        key = row["person"], row.get("hand", "")
        if key not in self._built:
            self._built[key] = alone(self._core.hand(*key, self._deviations.get(key[0], {})))
        return self._built[key]

    def measure(self, row: Row, posed: Callable[[Row], Row] = lambda row: row) -> float:
        """:param posed: the row in the posture in which it is measured"""
        return measure(row, lambda one: KINDS[row["kind"]](self.of(row), posed(one)))


def _posture(plain: Statics, drawn: Statics, row: Row, normal: Callable[[str], float]) -> Row:
    """A row whose stated angles are off by `POSTURE`, within the range of a drawn hand. What lies on the end of the plain hand's range lies on
    the drawn one's."""
    pose = dict(row["pose"])
    for axis, angle in pose.items():
        i = plain.names.index(axis)
        if angle >= plain.high[i] - AT_STOP:
            pose[axis] = float(drawn.high[i])
        elif angle <= plain.low[i] + AT_STOP:
            pose[axis] = float(drawn.low[i])
        else:
            pose[axis] = float(np.clip(angle + POSTURE * normal(axis), drawn.low[i], drawn.high[i]))
    return {**row, "pose": pose}


def _weigh(rows: list[Measured]) -> None:
    """Rows of one kind with the same bits have one value."""
    served: dict[tuple[str, float], int] = {}
    for row in rows:
        if row.measured:
            key = row.row["kind"], row.ours
            served[key] = served.get(key, 0) + 1
    for row in rows:
        if row.measured and row.ours != 0:
            row.weight = 1 / served[row.row["kind"], row.ours]
