"""The cost and the influence of each effect of a scene: ``handsim effects``, and `study.effects`.

The scene runs complete, without each of its effects in turn, and without some settings of its solver.
"""
from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Error, input_error
from ._files import ended, read_options, usage
from ._overrides import command_overrides
from ._progress import Told, bar
from ._scene import Scene, files_of
from ._shipped import find_file
from ._simulation import Simulation
from ._study_files import csv_text, json_file, number, origin, plain, plot_note, print_files, quoted, study_names, warn, whole_option

Array = NDArray[np.float64]

USAGE = """handsim effects SCENE [--out DIR]

CPU time and influence of each effect of a scene: table, CSV, JSON and a plot of the scene without each effect in turn, and without some
settings of its solver (docs/effects.md). SCENE is a file or a shipped name.

  --out DIR          out/SCENE_effects
  --set KEY=VALUE    a change of the scene; may be repeated
  --engine ENGINE    in place of the scene's: ode, dae, articulated or auto
  --repeats N        timed rounds, for the median; 7
  --report           report.html: tables to sort and a plot, for a browser
  --json             prints effects.json in place of the table

Example: handsim effects config/dropped_hand.yaml --out out/effects --set duration="1 s"
"""
HEAD = ("effect_taken_away,cpu_per_step[ns],saved_per_step[ns],noise[ns],angle_largest[deg],angle_rms[deg],displacement_largest[mm],angle_where,"
        "displacement_where,note")
CHUNK = 200
"""Steps whose states are compared at once."""
DEGREES = 180 / math.pi


class Peak(NamedTuple):
    """The largest value over a run, with the first time and the place of it."""

    value: float = 0.0
    time: float = 0.0
    """s"""
    place: str = ""

    def raised(self, values: Array, times: Array, places: Sequence[str]) -> Peak:
        """:param values: rows as times, columns as places"""
        if values.size == 0:
            return self
        row, column = divmod(int(np.argmax(values)), values.shape[1])
        value = float(values[row, column])
        return Peak(value, float(times[row]), places[column]) if value > self.value else self

    def where(self) -> str:
        return f"{self.place} at {self.time:.3g} s" if self.value > 0 else ""

    def json(self, scale: float) -> dict[str, Any]:
        return {"value": scale * self.value, **({"where": self.place, "time_s": self.time} if self.value > 0 else {})}


@dataclass
class Row:
    """The scene without one effect, or without a setting of its solver, beside the complete scene."""

    name: str
    scene: Optional[Scene] = None
    """None: the scene needs the effect."""
    fault: Optional[str] = None
    """Why the row has no figures."""
    left: list[str] = field(default_factory=list)
    without: list[str] = field(default_factory=list)
    """Effects that were removed with it because they need it, as friction with the last contact effect."""
    ns_per_step: float = 0.0
    saved_ns: float = 0.0
    """Median over the rounds; negative if the step is slower without the effect."""
    noise_ns: float = 0.0
    """Half the interquartile range of the rounds."""
    angle: Peak = Peak()
    """rad, 0 to pi"""
    angle_rms: float = 0.0
    """Of all joint angles over the run [rad]."""
    displacement: Peak = Peak()
    """Between the two positions of a body [m]."""

    @property
    def label(self) -> str:
        """``object_contact with friction``."""
        return self.name + "".join(f" with {name}" for name in self.without)

    @property
    def is_setting(self) -> bool:
        return self.name.startswith("solver.")


class Effects(NamedTuple):
    scene: Scene
    steps: int
    repeats: int
    has_angles: bool
    ns_per_step: float
    """CPU time of a step of the complete scene."""
    rows: list[Row]


def _rows(scene: Scene) -> list[Row]:
    out = []
    for name, found in _core.variants(scene._core):
        if isinstance(found, str):
            out.append(Row(name, fault=found))
            continue
        one = Scene(found)
        row = Row(name, one, left=one.effects)
        row.without = [each for each in scene.effects if each not in row.left and each != name]
        out.append(row)
    return out


def _norms(vectors: Array) -> Array:
    x, y, z = np.moveaxis(vectors * vectors, -1, 0)
    out: Array = np.sqrt(x + y + z)
    return out


def _rotation(vector: Sequence[float]) -> tuple[float, ...]:
    """The quaternion w x y z of a rotation vector."""
    angle = math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    scale = 0.5 if angle < 1e-12 else math.sin(0.5 * angle) / angle
    return (math.cos(0.5 * angle), *(scale * each for each in vector))


def _ball_angle(a: Sequence[float], b: Sequence[float]) -> float:
    """The angle between the rotations of two rotation vectors."""
    (aw, ax, ay, az), (bw, bx, by, bz) = _rotation(a), _rotation(b)
    w = aw * bw + ax * bx + ay * by + az * bz
    x, y, z = aw * bx - ax * bw - ay * bz + az * by, aw * by - ay * bw - az * bx + ax * bz, aw * bz - az * bw - ax * by + ay * bx
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-12 else 2 * math.atan2(sine, abs(w)) / sine
    return math.sqrt((scale * x) ** 2 + (scale * y) ** 2 + (scale * z) ** 2)


class _Motion(NamedTuple):
    times: Array
    q: Array
    places: Array
    """Of all bodies but the world, shape (times, bodies, 3)."""


def _moved(simulation: Simulation, steps: int) -> _Motion:
    times, q, places = [], [], []
    for _ in range(steps):
        simulation.step()
        times.append(simulation.time)
        q.append(simulation.q.copy())
        places.append(simulation._core.bodies()[0][1:])
    return _Motion(np.array(times), np.array(q), np.array(places))


class _Comparison:
    """Accumulates the differences between two runs of one model."""

    def __init__(self, row: Row, scene: Scene) -> None:
        self.row = row
        self.simulation = Simulation(scene, watch=True)
        self.bodies = scene.bodies[1:]
        self.sum, self.count = 0.0, 0
        self.names: list[str] = []
        self.columns: list[tuple[bool, int]] = []
        """Of each angle: whether it is a ball joint's, and its first coordinate."""
        first = 0
        for joint in scene._model.joints:
            if joint.spherical:
                self.names.append(joint.name)
                self.columns.append((True, first + sum(joint.slides)))
            turning = [k for k in range(len(joint.axes)) if not joint.slides[k]]
            self.names += [f"{joint.name}.{joint.axes[k].name}" for k in turning]
            self.columns += [(False, first + k) for k in turning]
            first += len(joint.slides)

    def update(self, whole: _Motion) -> None:
        own = _moved(self.simulation, len(whole.times))
        row, difference = self.row, own.places - whole.places
        row.displacement = row.displacement.raised(_norms(difference), whole.times, self.bodies)
        if not self.columns:
            return
        angles = np.empty((len(whole.times), len(self.columns)))
        for k, (ball, i) in enumerate(self.columns):
            if ball:
                angles[:, k] = [_ball_angle(a, b) for a, b in zip(whole.q[:, i:i + 3].tolist(), own.q[:, i:i + 3].tolist())]
            else:
                turned = np.fmod(np.abs(own.q[:, i] - whole.q[:, i]), 2 * np.pi)
                angles[:, k] = np.minimum(turned, 2 * np.pi - turned)
        row.angle = row.angle.raised(angles, whole.times, self.names)
        # One after the other, so that the last digits do not depend on the size of a chunk.
        self.sum = float(np.cumsum(np.concatenate([[self.sum], (angles * angles).ravel()]))[-1])
        self.count += angles.size
        row.angle_rms = math.sqrt(self.sum / self.count)


def _attempt(row: Row, work: Callable[[], None]) -> None:
    """The row's fault is the first error of its runs."""
    try:
        if row.fault is None:
            work()
    except Error as error:
        row.fault = str(error)


def _compare(scene: Scene, rows: list[Row], steps: int, done: Callable[[int], None]) -> None:
    """The motion without each effect beside that of the complete scene, each until it fails."""
    whole, comparisons = Simulation(scene, watch=True), list[_Comparison]()
    for row in rows:
        of = row.scene
        if of is not None:
            _attempt(row, lambda row=row, of=of: comparisons.append(_Comparison(row, of)))  # type: ignore[misc]
    for first in range(0, steps, CHUNK):
        motion = _moved(whole, min(CHUNK, steps - first))
        for each in comparisons:
            _attempt(each.row, lambda each=each: each.update(motion))  # type: ignore[misc]
        done(len(motion.times) * (1 + len(comparisons)))


def _median(values: Sequence[float]) -> float:
    """Of an even number, the upper middle value."""
    return sorted(values)[len(values) // 2]


def _time(scene: Scene, rows: list[Row], steps: int, repeats: int, done: Callable[[int], None]) -> float:
    """Times the scene and its rows in turn, so that a slower machine affects all; the first round warms up.

    :returns: the median of the complete scene [ns]
    """
    def one(of: Scene) -> float:
        taken = _core.cpu_seconds(of._core, 0, steps)
        done(steps)
        return 1e9 * taken / steps

    timed = [(row, row.scene, list[float]()) for row in rows if row.fault is None and row.scene is not None]
    whole = list[float]()
    for _ in range(repeats + 1):
        whole.append(one(scene))
        for _, of, times in timed:
            times.append(one(of))
    whole = whole[1:]
    for row, _, times in timed:
        saved = sorted(all_of_it - without for all_of_it, without in zip(whole, times[1:]))
        row.ns_per_step, row.saved_ns = _median(times[1:]), _median(saved)
        row.noise_ns = 0.5 * (saved[len(saved) * 3 // 4] - saved[len(saved) // 4])
    return _median(whole)


def measure(scene: Scene, repeats: int, told: Told = None) -> Effects:
    """:param repeats: timed rounds, each with one run of the complete scene and of each row; one more round warms up

    :raises Error: of kind input for a scene without effects, of kind physics if the complete scene fails
    """
    rows = _rows(scene)
    steps = max(1, math.floor(scene.duration / scene.step + 0.5))
    if not rows or rows[0].is_setting:
        raise input_error("effects", "no effect", "a scene with at least one effect")
    total, spent = steps * (2 + repeats) * (1 + sum(row.fault is None for row in rows)), 0

    def done(of: int) -> None:
        nonlocal spent
        spent += of
        if told is not None:
            told(min(1.0, spent / total))

    _compare(scene, rows, steps, done)
    ns_per_step = _time(scene, rows, steps, repeats, done)
    return Effects(scene, steps, repeats, any(not all(joint.slides) for joint in scene._model.joints), ns_per_step, rows)


def _json_row(row: Row, has_angles: bool) -> dict[str, Any]:
    out: dict[str, Any] = {"effect": row.name, "with": row.without}
    if row.fault is not None:
        return {**out, "fault": row.fault}
    out.update(cpu_ns_per_step=row.ns_per_step, saved_ns_per_step=row.saved_ns, noise_ns=row.noise_ns)
    if has_angles:
        out.update(angle_largest_deg=row.angle.json(DEGREES), angle_rms_deg=DEGREES * row.angle_rms)
    return {**out, "displacement_largest_mm": row.displacement.json(1e3)}


def _csv_row(row: Row, has_angles: bool) -> dict[str, str]:
    out = {"effect_taken_away": quoted(row.label)}
    if row.fault is not None:
        return {**out, "note": quoted(row.fault)}
    out.update(cpu_per_step=number(row.ns_per_step), saved_per_step=number(row.saved_ns), noise=number(row.noise_ns))
    if has_angles:
        out.update(angle_largest=number(DEGREES * row.angle.value), angle_rms=number(DEGREES * row.angle_rms))
    return {**out, "displacement_largest": number(1e3 * row.displacement.value), "angle_where": quoted(row.angle.where()),
            "displacement_where": quoted(row.displacement.where())}


def _figure(value: float) -> str:
    """Three significant digits, without an exponent below 1e6."""
    return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"


def _decades(values: Sequence[float]) -> tuple[float, float]:
    """Range of a logarithmic axis; its lower end is so low that the smallest bar is visible."""
    some = [value for value in values if value > 0]
    if not some:
        return 0.1, 1.0
    return 10.0 ** math.floor(math.log10(min(some)) - 0.3), 10.0 ** math.ceil(math.log10(max(some)) + 0.3)


def _bar(value: float, low: float) -> str:
    """Height of a bar, position of its label, and the label; a logarithmic axis cannot show 0."""
    return f'{number(value)} {number(value)} "{_figure(value)}"' if value > 0 else f'NaN {number(low)} "0"'


def _panel(title: str, unit: str, column: int, axis: tuple[float, float]) -> str:
    """A panel of bars for differences, with a logarithmic axis."""
    return (f"set title '{title}'\nset ylabel '{unit}'\nset logscale y\nset format y '%g'\nset yrange [{number(axis[0])}:{number(axis[1])}]\n"
            f"plot $rows using 0:{column}:xtic(1) with boxes linecolor rgb '#c8553d' notitle, '' using 0:{column + 1}:{column + 2} with "
            "labels offset 0,0.7 notitle\n")


def _plot(of: Effects) -> tuple[str, list[tuple[str, str, str]]]:
    """Bars of cost and difference, one for each effect: data and plots."""
    rows = [row for row in of.rows if row.fault is None]
    if not rows:
        return "", []
    angles, displacements = [DEGREES * row.angle.value for row in rows], [1e3 * row.displacement.value for row in rows]
    of_angles, of_displacements = _decades(angles), _decades(displacements)
    top = max(0.0, *(1e-3 * (row.saved_ns + row.noise_ns) for row in rows))
    bottom = min(0.0, *(1e-3 * (row.saved_ns - row.noise_ns) for row in rows))
    data = "$rows << EOD\n"
    for row, angle, displacement in zip(rows, angles, displacements):
        name, saved = row.label.replace(" with ", "\\nwith ", 1), 1e-3 * row.saved_ns
        data += (f'"{name}" {number(saved)} {number(1e-3 * row.noise_ns)} {number(max(0.0, saved + 1e-3 * row.noise_ns))} "{saved:.3g}" '
                 f"{_bar(angle, of_angles[0])} {_bar(displacement, of_displacements[0])}\n")
    room = max(1e-3, top - bottom)
    panels = [f"set title 'cost: CPU time of a step, of {1e-3 * of.ns_per_step:.3g} µs in all'\nset ylabel 'saved without it [µs]'\n"
              f"unset logscale\nset format y '%g'\nset yrange [{number(bottom - 0.05 * room)}:{number(top + 0.15 * room)}]\nset xtics font ',9'\n"
              "plot $rows using 0:2:3:xtic(1) with boxerrorbars linecolor rgb '#1b6ca8' notitle, '' using 0:4:5 with labels offset 0,0.7 notitle\n"]
    if of.has_angles:
        panels.append(_panel("influence: largest difference of a joint angle", "without it [deg]", 6, of_angles))
    panels.append(_panel("influence: largest difference of a position", "without it [mm]", 9, of_displacements))
    return data + "EOD\n", [("effects", f"noenhanced size 1000,{60 + 300 * len(panels)} font 'DejaVu Sans,10'",
                             f"  set multiplot layout {len(panels)},1 title '{plain(of.scene.title)}: without each effect in turn'\n"
                             "set style fill solid 0.8 border linecolor 'black'\nset boxwidth 0.6\nset grid y\n"
                             f"set xrange [-0.6:{number(len(rows) - 0.4)}]\nset lmargin 12\n{''.join(panels)}  unset multiplot\n")]


def _table(of: Effects) -> str:
    out = (f"{'without effect':<30} {'ns per step':>11} {'saved ns':>11} {'+-':>9} {'saved':>7} {'angle deg':>11} {'RMS deg':>9} {'position mm':>12}  "
           f"largest differences at\n{'none':<30} {of.ns_per_step:>11.0f}\n")
    for row in of.rows:
        if row.fault is not None:
            out += f"{row.label:<30} {row.fault}\n"
            continue
        angle, rms = (f"{DEGREES * each:.3g}" if of.has_angles else "-" for each in (row.angle.value, row.angle_rms))
        places = "; ".join(filter(None, (row.angle.where(), row.displacement.where()))) or "identical motion"
        out += (f"{row.label:<30} {row.ns_per_step:>11.0f} {row.saved_ns:>11.0f} {row.noise_ns:>9.0f} {100 * row.saved_ns / of.ns_per_step:>6.1f}% "
                f"{angle:>11} {rms:>9} {_figure(1e3 * row.displacement.value):>12}  {places}\n")
    return out


def _commands(file: Path, overrides: Sequence[str], of: Effects) -> list[str]:
    """What repeats each row of the table."""
    words = ["run", str(file)]
    return [_core.command_text(words, overrides),
            *("" if row.is_setting or row.fault is not None else _core.command_text(words, [*overrides, f"effects=[{', '.join(row.left)}]"])
              for row in of.rows)]


class Finished(NamedTuple):
    text: str
    json: str
    plotted: bool


def study(scene: Scene, file: Optional[Path], overrides: Sequence[str], repeats: int, out: Path, told: Told = None, report: bool = False) -> Finished:
    """The whole study, with its files.

    :param file: of the scene, for the commands that repeat rows; None: there are none
    :param overrides: which the scene has already
    """
    folder = _core.output_folder(out, study_names("effects", ["effects"]), files_of(scene))
    of = measure(scene, repeats, told)
    folder.clear()
    text = (f"{scene.title}\nWithout each effect in turn: CPU time of a step, and change of the motion over {scene.duration:g} s. Median of {repeats} "
            f"rounds; +-: half their interquartile range.\n\n{_table(of)}\n")
    whole = {"effect_taken_away": "none", "cpu_per_step": number(of.ns_per_step)}
    json = json_file({"title": scene.title, "cpu_ns_per_step": of.ns_per_step, "steps": of.steps, "step_s": scene.step, "repeats": repeats, **origin(),
                      "rows": [_json_row(row, of.has_angles) for row in of.rows]})
    _core.write_file(out / "effects.csv", csv_text(HEAD, [whole, *(_csv_row(row, of.has_angles) for row in of.rows)]).encode())
    _core.write_file(out / "effects.json", json.encode())
    plotted = _core.write_plots(out, "effects", *_plot(of))
    if file is not None:
        _core.finish_study(out, _core.command_text(["effects", str(file)], overrides), {"effects.csv": _commands(file, overrides, of)}, {}, report)
    return Finished(text, json, plotted)


def _work(options: dict[str, Any]) -> int:
    file, overrides = find_file(options["SCENE"]), tuple(command_overrides(options))
    repeats = whole_option(options, "--repeats", 1, 1000, "a whole number of timed rounds")
    scene = Scene(_core.Scene.load(file, overrides))
    warn(scene.warnings)
    out = Path(options.get("--out") or Path("out") / f"{file.stem}_effects")
    with bar(True, "effects") as shown:
        finished = study(scene, file, overrides, 7 if repeats is None else repeats, out, shown, "--report" in options)
    if "--json" not in options:
        print(finished.text, end="")
        return print_files(out, finished.plotted)
    print(finished.json, end="")
    note, status = plot_note(finished.plotted)
    if status != 0:
        print(f"missing: plots{note}", file=sys.stderr)
    return status


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if (status := usage(USAGE, arguments)) is not None:
        return status
    return ended(lambda: _work(read_options("effects", arguments, "SCENE", ("--report", "--json"), ("--out", "--set", "--engine", "--repeats"), ())))
