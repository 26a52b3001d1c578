"""``handsim optimise SCENE --goal GOAL.yaml --out DIR``: goals from files, and what is written."""
from __future__ import annotations

import json
import os
import sys
from fnmatch import fnmatch
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import optimise
from ._core import has_reports
from ._errors import input_error
from ._files import OutputFolder, ended, read_options, usage
from ._derivatives import ACTIONS, exact_step
from ._plot import COLORS, axes, line, sheet_of
from ._scene import Scene, files_of, load, standing_alone
from ._shipped import find_file
from ._simulation import Simulation
from ._yaml import Document, number_of
from .optimise import Optimum, Problem, Term

USAGE = """handsim optimise SCENE --goal GOAL [--out DIR]

Finds torques, targets of the controller or excitations of muscles with which the scene reaches a goal at least cost, through contact
(docs/optimise.md). SCENE is a file or a shipped name, with engine articulated. DIR gets scene.yaml, which handsim run plays,
actions.csv, optimise.json and optimise.svg, and in DIR/run the played run with its report.

  --goal GOAL        costs, limits, actions: a file, or the name of a shipped one in config/goals
  --out DIR          out/SCENE
  --set KEY=VALUE    a change of the scene; may be repeated
  --iterations N     at most; 100
  --no-run           writes no DIR/run
  --quiet            prints no iterations

Exit status 1: iterations ended before the cost did not fall any more, or a contact of `touch` was lost.

Example: handsim optimise reach --goal reach --out out/reach
"""
KEYS = ("title", "actions", "of", "hold", "duration", "effort", "rate", "limits", "first", "window", "costs", "touch", "touch_from")
COSTS: dict[str, tuple[str, ...]] = {"angle": ("is",), "point": ("is", "path", "offset", "relative"), "turn": ("is",), "still": ()}
MOST_KNOTS = 10_000
STIFFNESS = 50.0
"""Of the servos that play torques: the target lies a torque's share of it beside the angle [N m/rad]."""
Array = NDArray[np.float64]


class Goal:
    """A goal's file, as a problem of a scene."""

    def __init__(self, path: Path, scene: Scene) -> None:
        self.file, self.scene = Document(path), scene
        self.paths: dict[str, tuple[int, Array, Array]] = {}
        of = self.file
        of.keys("", KEYS)
        if not isinstance(of.data, dict):
            of.finish()
        self.kind = of.choice("actions", ACTIONS)
        self.step = scene.step
        self.hold = max(1, self._whole("hold", 10 * self.step, self.step))
        self.period = self.hold * self.step
        self.knots = self._knots()
        self.window = self._whole("window", 0, self.period) if of.get("window") is not None else 0
        names = {"torques": scene.coordinates, "targets": scene.axes, "excitations": [each.name for each in scene.muscles]}[self.kind]
        if not names:
            of.wrong("actions", self.kind, {"targets": "a scene with control", "excitations": "a scene with muscles"}.get(self.kind, "joints"))
        self.names = names
        self.columns = self._matching("of", names, ["*"]) if names else []
        if not isinstance(of.get("costs"), list) or not of.get("costs"):
            of.wrong("costs", "nothing" if of.get("costs") is None else repr(of.get("costs"))[:60], "a list of costs")
        touch = of.get("touch", [])
        self.touch = [pair for pair in touch if _is_pair(pair)] if isinstance(touch, list) else []
        self.touch_from = of.real("touch_from", 0, 0, self.knots * self.period * 0.999)
        if not isinstance(touch, list) or len(touch) > len(self.touch):
            of.wrong("touch", "nothing" if touch is None else repr(touch)[:60], "a list of pairs of shapes: [[right.index_distal, ball]]")
        # Without actions and costs nothing else can be read; other problems wait for theirs.
        if of.get("actions") != self.kind or not self.columns or not isinstance(of.get("costs"), list) or not of.get("costs"):
            of.finish()

    def _knots(self) -> int:
        knots = max(1, self._whole("duration", self.scene.duration, self.period))
        if knots > MOST_KNOTS:
            self.file.wrong("duration", f"{knots} times {self.period:g} s", f"at most {MOST_KNOTS} actions: a longer hold")
            return 1
        return knots

    def _whole(self, key: str, default: float, unit: float) -> int:
        value = self.file.real(key, default, unit * (1 - 1e-9), 1e4)
        count = round(value / unit)
        if abs(value - count * unit) > 1e-6 * unit:
            self.file.wrong(key, f"{value:g} s", f"a multiple of {unit:g} s")
        return count

    def _matching(self, key: str, names: Sequence[str], default: list[str]) -> list[int]:
        given = self.file.get(key, default)
        patterns = [str(each) for each in (given if isinstance(given, list) else [given])]
        if not patterns:
            self.file.wrong(key, "an empty list", "a name or pattern of " + ", ".join(names[:6]) + ", ...")
        for pattern in patterns:
            if not any(fnmatch(name, pattern) for name in names):
                self.file.wrong(key, pattern, "a name or pattern of " + ", ".join(names[:6]) + ", ...")
        return [i for i, name in enumerate(names) if any(fnmatch(name, pattern) for pattern in patterns)]

    def _each(self, key: str, default: float, low: float = -np.inf) -> Array:
        """A number for all actions, or numbers by pattern."""
        value = self.file.get(key)
        out = np.full(len(self.columns), float(default))
        if isinstance(value, dict):
            for pattern in value:
                rows = [i for i, column in enumerate(self.columns) if fnmatch(self.names[column], str(pattern))]
                if not rows:
                    self.file.wrong(f"{key}.{pattern}", "no action of this name", "one of " + ", ".join(self.names[c] for c in self.columns[:6]))
                # Names have dots: the value is read from its mapping.
                number = number_of(value[pattern])
                if number is None or number < low:
                    self.file.wrong(f"{key}.{pattern}", repr(value[pattern]), "a number" + ("" if low == -np.inf else f" from {low:g}"))
                else:
                    out[rows] = number
        elif value is not None:
            out[:] = self.file.real(key, None, low)
        return out

    def problem(self, simulation: Simulation) -> Problem:
        """:raises Error: of kind input with all that is wrong"""
        of = self.file
        out = Problem(simulation, self.kind, self.columns, self.knots, self.hold)
        out.effort, out.rate = self._each("effort", 1, 0), self._each("rate", 0, 0)
        others = [self.names[c] for c in self.columns if self.names[c].partition(".")[0] not in self.scene.hands]
        if self.kind == "torques" and (others or self.scene.axes):
            of.wrong("actions", "torques", "a scene without control, so that servos can play them" if not others
                     else "torques of a hand: a scene cannot play those of " + ", ".join(others[:3]))
        if self.kind == "targets":
            limits = self.scene.limits[self.scene.axis_coordinates][self.columns]
            out.low, out.high = limits[:, 0].copy(), limits[:, 1].copy()
        elif self.kind == "excitations":
            out.low[:], out.high[:] = 0, 1
        given = of.get("limits")
        if isinstance(given, list):
            low, high = of.reals("limits", 2)
            out.low, out.high = np.maximum(out.low, low), np.minimum(out.high, high)
            if not low < high:
                of.wrong("limits", given, "the lower one first")
        elif given is not None:
            of.wrong("limits", repr(given), "[low, high]")
        if of.get("first") is not None:
            out.first = np.tile(self._each("first", 0), (self.knots, 1))
        for i in range(len(of.get("costs"))):
            term = self._term(out, f"costs.{i}", i)
            if term is not None:
                out.terms.append(term)
        of.finish()
        return out

    def _term(self, problem: Problem, key: str, number: int) -> Optional[Term]:
        of, scene = self.file, self.scene
        kinds = [kind for kind in COSTS if isinstance(of.get(key), dict) and kind in of.get(key)]
        if len(kinds) != 1:
            of.wrong(key, f"{len(kinds)} of them", "one of " + ", ".join(COSTS))
            return None
        kind, name = kinds[0], str(of.get(f"{key}.{kinds[0]}"))
        of.keys(key, (kind, "at", "weight", *COSTS[kind]))
        weight = self._weights(key)
        label = f"{number}: {kind} {name}"
        if kind == "angle":
            value = of.real(f"{key}.is", None) if of.get(f"{key}.is") is not None else None
            rows = [i for i, each in enumerate(scene.coordinates) if fnmatch(each, name)]
            if not rows:
                of.choice(f"{key}.angle", scene.coordinates)
                return None
            return Term(label, weight, optimise.angle(problem, rows, problem.simulation.q[rows].copy() if value is None else value))
        if kind == "still":
            rows = [i for i, each in enumerate(scene.coordinates) if fnmatch(each, name)]
            for k, body in enumerate(problem.free):
                if fnmatch(scene.bodies[body], name):
                    rows += range(len(scene.coordinates) + 6 * k, len(scene.coordinates) + 6 * k + 6)
            if not rows:
                of.wrong(f"{key}.still", name, "a name or pattern of coordinates or free objects")
            return Term(label, weight, optimise.still(problem, rows))
        if kind == "turn":
            free = [scene.bodies[body] for body in problem.free]
            of.choice(f"{key}.turn", free)
            start = _quaternion(of, f"{key}.is") if of.get(f"{key}.is") is not None else None
            if name not in free:
                return None
            body = scene.bodies.index(name)
            return Term(label, weight, optimise.turn(problem, body, problem.simulation.bodies.quaternion[body] if start is None else start))
        return self._point(problem, key, name, label, weight)

    def _point(self, problem: Problem, key: str, name: str, label: str, weight: Array) -> Optional[Term]:
        of, scene = self.file, self.scene
        tips = {tip: (body, offset) for hand in scene._model.hands for tip, body, offset in hand.tips}
        of.choice(f"{key}.point", [*tips, *scene.bodies[1:]])
        body, offset = tips.get(name) or (scene.bodies.index(name) if name in scene.bodies else 0, np.zeros(3))
        if of.get(f"{key}.offset") is not None:
            offset = offset + np.array(of.reals(f"{key}.offset", 3))
        relative = of.get(f"{key}.relative", False)
        if not isinstance(relative, bool):
            of.wrong(f"{key}.relative", repr(relative), "true or false")
        start = problem.places.point(problem.simulation.bodies, body, offset)[0] if relative is True else np.zeros(3)
        if of.get(f"{key}.path") is None:
            path = np.tile(start + np.array(of.reals(f"{key}.is", 3, free=True)), (self.knots + 1, 1))
        else:
            rows = of.get(f"{key}.path")
            if not isinstance(rows, list) or not rows:
                of.wrong(f"{key}.path", repr(rows), "a list of [time, x, y, z], ~ where it is free")
                return None
            table = np.array([of.reals(f"{key}.path.{i}", 4, free=True) for i in range(len(rows))])
            if not (np.diff(table[:, 0]) > 0).all() or np.isnan(table[:, 0]).any():
                of.wrong(f"{key}.path", "times that do not increase", "times that do")
                return None
            times = self.period * np.arange(self.knots + 1)
            path = start + np.array([np.interp(times, table[:, 0], table[:, k]) for k in (1, 2, 3)]).T
        if np.isnan(path).all(axis=1).any():
            of.wrong(key, "a place of which all axes are free", "a number of one axis at least")
            return None
        self.paths[label] = body, offset, path
        return Term(label, weight, optimise.point(problem, body, offset, path))

    def _weights(self, key: str) -> Array:
        """At one time, or the integral over a time."""
        of, end = self.file, self.knots * self.period
        weight, at = of.real(f"{key}.weight", None, 0), of.get(f"{key}.at", [0, end])
        out = np.zeros(self.knots + 1)
        if isinstance(at, list):
            first, last = of.reals(f"{key}.at", 2) if of.get(f"{key}.at") is not None else (0.0, end)
            if not 0 <= first < last <= end * (1 + 1e-9):
                of.wrong(f"{key}.at", at, f"[from, to] within 0 to {end:g} s")
            times = self.period * np.arange(self.knots + 1)
            out[(times > first + 1e-9) & (times <= last + 1e-9)] = weight * self.period
            return out
        when = of.real(f"{key}.at", None, self.period * (1 - 1e-9), end * (1 + 1e-9))
        knot = round(when / self.period)
        if abs(when - knot * self.period) > 1e-6 * self.period:
            of.wrong(f"{key}.at", f"{when:g} s", f"a multiple of hold, {self.period:g} s")
        out[min(knot, self.knots)] = weight
        return out


def _is_pair(pair: object) -> bool:
    return isinstance(pair, list) and len(pair) == 2 and all(isinstance(each, str) for each in pair)


def _quaternion(of: Document, key: str) -> Array:
    of.keys(key, ("axis", "angle"))
    axis, turn = np.array(of.reals(f"{key}.axis", 3)), of.real(f"{key}.angle", None)
    size = float(np.linalg.norm(axis))
    if size == 0:
        of.wrong(f"{key}.axis", "no direction", "an axis")
        size = 1
    return np.array([np.cos(turn / 2), *(np.sin(turn / 2) * axis / size)])


def table_of(goal: Goal, problem: Problem, found: Optimum) -> str:
    """actions.csv."""
    step, hold = goal.step, goal.hold
    actions = np.repeat(np.array([problem.whole(k, action) for k, action in enumerate(found.trajectory.actions)]), hold, axis=0)
    names, unit, rows = list(goal.names), "" if goal.kind == "excitations" else "[rad]", actions
    if goal.kind == "torques":
        # A servo at the step's end gives K (target - q) - D u: the target for a torque follows from the angle after the step.
        simulation = problem.simulation
        simulation.reset(problem.start)
        rows = np.zeros_like(actions)
        for i, action in enumerate(actions):
            exact_step(simulation, {"torques": action})
            rows[i] = simulation.q + action / STIFFNESS
        rows, names = rows[:, problem.columns], [names[c] for c in problem.columns]
    lines = ["time[s]," + ",".join(name + unit for name in names)]
    lines += [",".join(repr(float(x)) for x in (t, *row)) for t, row in
              [(0.0, rows[0]), *((step * (i + 1), row) for i, row in enumerate(rows))]]
    return "\n".join(lines) + "\n"


def changes_of(goal: Goal, problem: Problem, table: str) -> dict[str, Any]:
    """Of the scene that plays the table."""
    out: dict[str, Any] = {"duration": repr(goal.knots * goal.period)}
    if goal.kind == "excitations":
        return {**out, "excitations": table}
    out.update({"control.program": table, "control.motion.clamp": "true"})
    if goal.kind == "torques":
        joints = [goal.names[column].partition(".")[2] for column in problem.columns]
        out = {"duration": out["duration"], "effects": [*goal.scene.effects, "actuation"],
               "control": {"controller": {"form": "implicit", "gains": [{"joints": joints, "proportional": STIFFNESS, "derivative": 0,
                                                                       "torque_limit": 1000}]}, "program": table, "motion": {"clamp": True}}}
    return out


def _played(goal: Goal, found: Optimum, scene: Scene) -> float:
    """The largest difference of a coordinate [rad] or [m] at the end of the played run."""
    simulation = Simulation(scene)
    simulation.step(substeps=goal.hold * goal.knots)
    return float(np.abs(simulation.q - found.trajectory.ends[-1].joints).max())


def touching(goal: Goal, problem: Problem, found: Optimum) -> dict[str, float]:
    """Share of the steps from `touch_from` on in which each pair of `touch` presses."""
    simulation, out, count = problem.simulation, {" - ".join(pair): 0 for pair in goal.touch}, 0
    simulation.reset(problem.start)
    for k, action in enumerate(found.trajectory.actions[:len(goal.touch) and goal.knots]):
        for _ in range(goal.hold):
            exact_step(simulation, {goal.kind: problem.whole(k, action)})
            if simulation.time <= goal.touch_from:
                continue
            count += 1
            contacts = simulation.contacts
            pressed = [(x, y) for a, b, force in zip(contacts.a, contacts.b, contacts.force) if (force**2).sum() > 0 for x, y in ((a, b), (b, a))]
            for one, other in goal.touch:
                out[f"{one} - {other}"] += any(fnmatch(x, one) and fnmatch(y, other) for x, y in pressed)
    return {name: times / max(count, 1) for name, times in out.items()}


def _path(title: str, times: Array, asked: Array, done: Array) -> str:
    """A path [mm] in the plane in which it is longest; over time where an axis is free."""
    free = np.isnan(asked).any(axis=0)
    shown = np.flatnonzero(~free) if free.any() else np.sort(np.argsort(np.ptp(asked, axis=0))[1:])
    both = np.vstack([asked, done])[:, shown]
    low, high = both.min(axis=0), both.max(axis=0)
    size = max(float((high - low).max()), 0.1)
    ticks = float(10**np.floor(np.log10(size)))
    if free.any():
        limits = (0.0, float(times[-1]) * 10, float(low.min()) - 0.1 * size, float(high.max()) + 0.1 * size)
        lines = [line(np.column_stack([10 * times, rows[:, k]]).tolist(), color, False) for rows, color in ((asked, COLORS[1]), (done, COLORS[0])) for k in shown]
        return axes(title, ("time, 0.1 s", ", ".join("xyz"[k] for k in shown) + ", mm"), limits, "".join(lines), ticks if ticks < size / 4 else ticks / 2, False)
    x, y = (low + high) / 2
    limits = (float(x - 0.6 * size), float(x + 0.6 * size), float(y - 0.6 * size), float(y + 0.6 * size))
    return axes(title, ("xyz"[shown[0]] + ", mm", "xyz"[shown[1]] + ", mm"), limits,
                line(asked[:, shown].tolist(), COLORS[1], False) + line(done[:, shown].tolist(), COLORS[0], False), ticks)


def picture(goal: Goal, problem: Problem, found: Optimum) -> str:
    """SVG: paths of points, asked and found, and the cost of each iteration."""
    drawn, simulation = [], problem.simulation
    places: dict[str, list[Array]] = {name: [] for name in goal.paths}
    for motion in found.trajectory.motions[1:]:
        simulation.reset(motion)
        for name, (body, offset, _) in goal.paths.items():
            places[name].append(problem.places.point(simulation.bodies, body, offset)[0])
    for name, rows in places.items():
        path, term = goal.paths[name][2], next(term for term in problem.terms if term.name == name)
        kept = term.weight > 0
        if kept.sum() > 1:
            drawn.append(_path(name.partition(": ")[2] + ": asked (orange), found (blue)", problem.period * np.flatnonzero(kept),
                               1e3 * path[kept], 1e3 * np.array(rows)[kept[1:]]))
    costs = np.log10(np.maximum(found.history, 1e-300))
    limits = (0.0, max(len(costs) - 1, 1) / 10, float(np.floor(costs.min())), float(np.floor(costs.max()) + 1))
    drawn.append(axes("cost", ("iterations, tens", "cost, powers of ten"), limits,
                      line([(i / 10, cost) for i, cost in enumerate(costs.tolist())], COLORS[0], False), 1.0, False))
    return sheet_of(drawn, len(drawn))


def _options(arguments: Sequence[str]) -> dict[str, Any]:
    out = read_options("optimise", arguments, "SCENE", ("--no-run", "--quiet"), ("--goal", "--out", "--set", "--iterations"), ("--goal",))
    out.setdefault("--iterations", "100")
    out.setdefault("--out", str(Path("out") / Path(out["SCENE"]).stem))
    if not out["--iterations"].isdecimal() or not 0 < int(out["--iterations"][:10]) < 100000:
        raise input_error("--iterations", out["--iterations"], "a whole number from 1")
    return out


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if (status := usage(USAGE, arguments)) is not None:
        return status
    return ended(lambda: _work(_options(arguments)))


def _run_folder(path: Path) -> None:
    """Before the work: where the played run goes."""
    if os.path.lexists(path) and (path.is_symlink() or not path.is_dir() or (any(path.iterdir()) and not (path / "resolved.yaml").is_file())):
        raise input_error("--out", f"{path}, which no run wrote", "another folder, or --no-run")


def _work(options: dict[str, Any]) -> int:
    path = find_file(options["SCENE"])
    changes: dict[str, Any] = dict(each.partition("=")[::2] for each in options["--set"])
    scene = load(path, changes)
    file = find_file(options["--goal"], "--goal", "config/goals")
    goal = Goal(file, scene)
    problem = goal.problem(Simulation(scene))
    names = ["actions.csv", "optimise.svg", "inputs/actions.csv", *standing_alone(scene)]
    with OutputFolder(options["--out"], "optimise.json", b'{\n "cost"', names, [*files_of(scene), file]) as folder:
        if "--no-run" not in options:
            _run_folder(folder.path / "run")
        return _solved(goal, problem, options, changes, folder)


def _solved(goal: Goal, problem: Problem, options: dict[str, Any], changes: dict[str, Any], folder: OutputFolder) -> int:
    quiet = "--quiet" in options
    if goal.window:
        problem.first = optimise.receded(problem, goal.window)
    found = optimise.solve(problem, int(options["--iterations"]), told=None if quiet else lambda i, cost: print(f"{i:4}  {cost:.6g}"))
    text = table_of(goal, problem, found)
    with TemporaryDirectory() as own:
        table = Path(own) / "actions.csv"
        table.write_text(text, encoding="utf-8")
        played = load(find_file(options["SCENE"]), {**changes, **changes_of(goal, problem, str(table))})
    touches = touching(goal, problem, found)
    difference = _played(goal, found, played)
    result = {"cost": found.trajectory.cost, "costs": found.trajectory.costs, "iterations": found.iterations, "seconds": found.seconds,
              "converged": found.converged, "history": found.history, "touch": touches, "played_difference": difference}
    folder.write({"optimise.json": json.dumps(result, indent=1).encode(), "actions.csv": text.encode(), "optimise.svg": picture(goal, problem, found).encode(),
                  **standing_alone(played)})
    print(f"cost {found.trajectory.cost:.6g} after {found.iterations} iterations in {found.seconds:.3g} s, " + ("converged" if found.converged else "not converged"))
    for name, cost in found.trajectory.costs.items():
        print(f"  {name:40} {cost:.4g}")
    for name, share in touches.items():
        print(f"  touch {name:34} {100 * share:.4g} % of the steps")
    print(f"  played by scene.yaml: largest difference of a coordinate at the end {difference:.2g}")
    print(folder.told(["optimise.json", "actions.csv", "optimise.svg", "scene.yaml"]), file=sys.stderr)
    if "--no-run" not in options:
        load(folder.path / "scene.yaml").run(folder.path / "run", report=has_reports, frames=8)
        print(f"wrote {folder.path / 'run' / ('report.html' if has_reports else 'summary.json')}", file=sys.stderr)
    return 0 if found.converged and all(share == 1 for share in touches.values()) else 1
