"""``handsim inverse`` and `study.inverse`: the torques that make a motion, and a simulation with them as a check.

The core computes them (src/handsim/study/inverse); tables, plots and text are written here.
"""
from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import input_error
from ._files import NewFolder, ended, read_options
from ._overrides import command_overrides
from ._progress import Told, bar
from ._rollouts_command import drawn
from ._scene import Scene, files_of
from ._shipped import find_file
from ._study_files import csv_text, json_file, number, origin, plain, plot_note, print_files, real_of, study_names, warn, whole_option

Array = NDArray[np.float64]

USAGE = """handsim inverse SCENE [--motion FILE] [--out DIR]

Inverse dynamics: the torques about every axis that make a motion, and a simulation with them as a check (docs/motion.md). SCENE is a file
or a shipped name.

  --motion FILE      joint angles: .csv, .mot or .sto; the programs of the scene
  --out DIR          folder for torques.sto, summary.json and plots; out/SCENE_inverse
  --names FILE       file of the names that the motion's columns have, or the name of a shipped one
  --clamp            moves angles beyond a stop to it, and counts them
  --cutoff F         of the low-pass filter on the motion's angles, such as "6 Hz", or none; 6 Hz
  --loads FILE       forces from outside: a table of loads, or the contacts.csv of a run
  --no-check         does not simulate with the torques
  --muscles          activations of the muscles by static optimisation, and the torques that they leave undone (reserves)
  --co-contraction A least activation of every muscle, 0 to 0.9; 0
  --apart            with --muscles: no contact between bodies in the check, which is no part of the torques
  --set KEY=VALUE    a change of the scene; may be repeated
  --engine ENGINE    in place of the scene's: ode, dae, articulated or auto
  --json             prints summary.json in place of the table
  --uncertain N      draws as many hands within what is uncertain of them: all figures with intervals, and which inputs own their variance
  --on ADDRESS       dask://HOST:PORT of a Dask scheduler, whose workers run these hands
  --report           with --uncertain: report.html: tables to sort and a plot, for a browser

Exit status 1: the check misses the motion, or a file could not be written.

Example: handsim inverse config/every_pose.yaml --motion out/every/trajectory.mot --out out/inverse
"""
DEGREES = 180 / math.pi
MOST_HANDS = 1_000_000
TOUCHES = ("self_contact", "object_contact", "friction")
"""Effects of contact, which is no part of the torques."""
HEAD = "axis,largest_torque[N_m],rms_torque[N_m],rms_error[deg],largest_error[deg],largest_reserve[N_m],rms_reserve[N_m]"
LEAST_SHARE, MOST_MUSCLES = 0.005, 4
"""Of what is left undone: a cause and muscles that are named."""


class Asked(NamedTuple):
    motion: Optional[Path] = None
    """Joint angles; None: the programs of the scene's control."""
    names: Optional[Path] = None
    """File of the names that its columns have."""
    loads: Optional[Path] = None
    cutoff: Optional[float] = None
    """Of the low-pass filter [Hz]; None: no filter."""
    clamp: bool = False
    least: Optional[float] = None
    """Activation of every muscle, at least; None: no activations are asked for."""

    @property
    def files(self) -> list[Path]:
        return [each for each in self[:3] if each is not None]


class Axis(NamedTuple):
    """Torques about one axis [N m], and its error in the check [rad]; None where there is no check, or no activations."""

    name: str
    largest_torque: float
    rms_torque: float
    rms_error: Optional[float]
    largest_error: Optional[float]
    largest_reserve: Optional[float]
    rms_reserve: Optional[float]


class Undone(NamedTuple):
    """Shares of what muscles leave undone, by causes."""

    beyond: dict[str, float]
    """The strength of a muscle."""
    no_balance: float
    late: float
    other: float


class Result:
    """What the core found: rows are steps, columns of angles and torques are `axes`."""

    def __init__(self, scene: Scene, of: dict[str, Any]) -> None:
        self.scene = scene
        self.axes = [Axis(*each) for each in of["axes"]]
        self.times: Array = of["times"]
        """Of the starts of steps [s]."""
        self.q: Array = of["q"]
        """The motion [rad]."""
        self.moment: Array = of["moment"]
        """Net torque that the motion needs [N m]."""
        self.passive: Array = of["passive"]
        """Its part of passive tissue, resting muscles and bands [N m]."""
        self.forward: Array = of["forward"]
        """Angles of the check, up to where it ended [rad]."""
        self.reserve: Array = of["reserve"]
        """With activations: what the muscles leave undone [N m]."""
        self.activation: Array = of["activation"]
        self.excitation: Array = of["excitation"]
        self.cutoff: Optional[float] = of["cutoff"]
        """Of the filter that was used [Hz]."""
        self.rms_error: Optional[float] = of["rms_error"]
        """Of the check over all axes and steps [rad]."""
        self.limit: float = of["limit"]
        """Of this error [rad]."""
        self.window: float = of["window"]
        """Of the check with muscles [s]: it begins anew from the motion after each."""
        self.agrees: bool = of["agrees"]
        self.reserve_share: Optional[float] = of["reserve_share"]
        """RMS of the reserves over that of the active torques."""
        self.undone = None if of["undone"] is None else Undone(*of["undone"])
        self.fault: Optional[str] = of["fault"]
        """Why the check ended early."""
        self.warnings: list[str] = of["warnings"]

    @property
    def has_muscles(self) -> bool:
        return bool(self.axes) and self.axes[0].largest_reserve is not None


def compute(scene: Scene, asked: Asked, check: bool, told: Told = None) -> Result:
    """:raises Error: of kind input for a scene without hands or with free ones, and for files that do not fit"""
    return Result(scene, _core.inverse(scene._core, tuple(asked), check, told))


def muscle_overrides(scene: Scene, apart: bool) -> list[str]:
    """Changes of a scene that put its muscles in effect. :param apart: without contact"""
    if scene.muscles and not apart:
        return []
    others = [effect for effect in scene.effects if effect not in ("muscles", "tendon_coupling") and not (apart and effect in TOUCHES)]
    return [f"effects=[{', '.join(['muscles', 'tendon_coupling', *others])}]"]


# Text.

def _degrees(angle: Optional[float]) -> str:
    return "not checked" if angle is None else f"{DEGREES * angle:.3g}"


def table_text(of: Result) -> str:
    reserves = "  reserve N m, largest and RMS" if of.has_muscles else ""
    out = f"{'axis':<28} {'largest N m':>12} {'RMS N m':>12} {'check RMS deg':>14} {'largest deg':>14}{reserves}\n"
    for axis in of.axes:
        out += f"{axis.name:<28} {axis.largest_torque:>12.4g} {axis.rms_torque:>12.4g} {_degrees(axis.rms_error):>14} {_degrees(axis.largest_error):>14}"
        out += f" {axis.largest_reserve:>14.4g} {axis.rms_reserve:>14.4g}\n" if of.has_muscles else "\n"
    return out


def undone_text(of: Undone) -> str:
    """A sentence of each cause, by their shares."""
    muscles, every = sorted(((share, name) for name, share in of.beyond.items()), reverse=True), 0.0
    for share in of.beyond.values():
        every += share
    names = ", ".join(f"{name} {100 * share:.0f} %" for share, name in muscles[:MOST_MUSCLES]) + (", ..." if len(muscles) > MOST_MUSCLES else "")
    causes = [(every, f"beyond the strength of muscles: {names}"), (of.no_balance, "that no balance of muscles gives, which turn several axes at once"),
              (of.late, "in changes that are faster than muscles follow, as noise of points makes them"),
              (of.other, "in tendons that stretch, bands and fused joints")]
    return "".join(f"  {100 * share:.0f} % of it {text}\n" for share, text in sorted(causes, reverse=True) if share >= LEAST_SHARE)


def screen_text(of: Result) -> str:
    out = f"{of.scene.title}\n{table_text(of)}"
    if of.cutoff is not None:
        out += f"filter: Butterworth, second order, forwards and backwards, cut-off {of.cutoff:g} Hz\n"
    if of.reserve_share is not None:
        out += f"muscles leave {100 * of.reserve_share:.2g} % of the torques undone (RMS over all axes): reserves.sto\n"
        out += undone_text(of.undone) if of.undone else ""
    if of.rms_error is not None:
        by = f"excitations and reserves, from the motion anew each {of.window:g} s" if of.has_muscles else "torques alone"
        out += f"a simulation with these {by}: RMS error {DEGREES * of.rms_error:.3g} deg over all axes\n"
    return out


# Files.

def _axis_json(axis: Axis) -> dict[str, Any]:
    out: dict[str, Any] = {"axis": axis.name, "largest_torque_Nm": axis.largest_torque, "rms_torque_Nm": axis.rms_torque}
    if axis.rms_error is not None and axis.largest_error is not None:
        out.update(forward_rms_error_deg=DEGREES * axis.rms_error, forward_largest_error_deg=DEGREES * axis.largest_error)
    if axis.largest_reserve is not None:
        out.update(largest_reserve_Nm=axis.largest_reserve, rms_reserve_Nm=axis.rms_reserve)
    return out


def summary_text(asked: Asked, of: Result) -> str:
    out: dict[str, Any] = {"title": of.scene.title, "motion": asked.motion.name if asked.motion else "programs of the scene",
                           "step_s": of.scene.step, "steps": len(of.times)}
    if of.cutoff is not None:
        out["filter"] = {"kind": "Butterworth, second order, forwards and backwards", "cutoff_hz": of.cutoff}
    if asked.loads:
        out["loads"] = asked.loads.name
    if of.rms_error is not None:
        out["forward"] = {"engine": of.scene.engine, "rms_error_deg": DEGREES * of.rms_error, "limit_deg": DEGREES * of.limit, "passed": of.agrees}
        if of.fault is not None:
            out["forward"]["fault"] = of.fault
    if asked.least is not None:
        out["least_activation"] = asked.least
    if of.reserve_share is not None:
        out["reserve_share"] = of.reserve_share
        if of.undone:
            out["undone"] = {"beyond_strength": of.undone.beyond, "no_balance": of.undone.no_balance, "faster_than_muscles": of.undone.late,
                             "other": of.undone.other}
    return json_file({**out, **origin(), "axes": [_axis_json(axis) for axis in of.axes], "warnings": of.warnings})


def _axis_row(axis: Axis) -> dict[str, str]:
    told = _axis_json(axis)
    keys = ("axis", "largest_torque_Nm", "rms_torque_Nm", "forward_rms_error_deg", "forward_largest_error_deg", "largest_reserve_Nm", "rms_reserve_Nm")
    columns = (name.partition("[")[0] for name in HEAD.split(","))
    return {column: told[key] if key == "axis" else number(told[key]) for column, key in zip(columns, keys) if key in told}


def _write_tables(of: Result, check: bool, out: Path) -> None:
    title, axes = of.scene.title, [axis.name for axis in of.axes]

    def write(name: str, what: str, names: Sequence[str], values: Array, degrees: bool = False) -> None:
        _core.write_motion(out / name, title + what, names, degrees, len(of.times), of.times[:len(values)], values)

    torques = np.stack([of.moment, of.passive, of.moment - of.passive], axis=2).reshape(len(of.times), -1)
    write("torques.sto", ": torques about the joint axes [N m]", [f"{axis}_{part}" for axis in axes for part in ("total", "passive", "active")], torques)
    # The angles whose torques these are, and those of the check, on the same steps.
    write("motion.mot", "", axes, DEGREES * of.q, True)
    if check:
        write("forward.mot", "", axes, DEGREES * of.forward, True)
    if not len(of.reserve):
        return
    muscles = [muscle[0] for muscle in of.scene._core.muscles()]
    write("activations.sto", ": activations", muscles, of.activation)
    write("excitations.sto", ": excitations", muscles, of.excitation)
    write("reserves.sto", ": torques that the muscles leave undone [N m]", axes, of.reserve)


def _plot(of: Result) -> tuple[str, str, str]:
    """A column of panels for each hand, of active torques in torques.sto, which has three columns for each axis after the time."""
    hands: dict[str, list[tuple[str, int]]] = {}
    for i, axis in enumerate(of.axes):
        hand, _, name = axis.name.partition(".")
        hands.setdefault(hand, []).append((name, 4 + 3 * i))
    panels = {hand: _core.hand_panels([name for name, _ in axes], lambda i, colour, axes=axes:  # type: ignore[misc]
                                      f"data skip 7 using 1:{axes[i][1]} with lines lw 1.4 lc rgb '{colour}' title '{axes[i][0]}'")
              for hand, axes in sorted(hands.items())}
    rows = max((len(each) for each in panels.values()), default=0)
    commands = (f"  set multiplot layout {rows},{len(panels)} columnsfirst downwards title '{plain(of.scene.title)}: torques of inverse dynamics'\n"
                "set autoscale xfix\nset grid lc rgb '#d0d0d0'\nset key outside right top samplen 1.5\nset lmargin 11\n"
                "set rmargin 27\nset ylabel 'torque [N m]'\n")
    for hand, own in panels.items():
        for i in range(rows):
            # A hand with fewer panels than the other leaves places empty.
            commands += (f"set xlabel '{'time [s]' if i + 1 == rows else ''}'\nset title '{hand} {own[i][0]}'\n{own[i][1]}" if i < len(own)
                         else "set multiplot next\n")
    return ("torques", f"noenhanced size {1500 if len(panels) > 1 else 1000},{60 + 180 * rows} font 'DejaVu Sans,10'", commands + "  unset multiplot\n")


def study(scene: Scene, asked: Asked, check: bool, out: Path, told: Told = None) -> tuple[Result, str, bool]:
    """The whole study, with its files. :returns: what was found, summary.json, and False if gnuplot is missing or fails"""
    more = [f"{name}.{kind}" for name, kind in (("torques", "sto"), ("motion", "mot"), ("forward", "mot"), ("activations", "sto"), ("excitations", "sto"),
                                                 ("reserves", "sto"))]
    with NewFolder(out):
        folder = _core.output_folder(out, [*study_names("summary", ["torques"]), *more], [*files_of(scene), *asked.files])
        found = compute(scene, asked, check, told)
        folder.clear()
        _write_tables(found, check, out)
        summary = summary_text(asked, found)
        _core.write_file(out / "summary.csv", csv_text(HEAD, [_axis_row(axis) for axis in found.axes]).encode())
        _core.write_file(out / "summary.json", summary.encode())
        return found, summary, _core.write_plots(out, "summary", "data = 'torques.sto'\nset datafile separator '\\t'\n", [_plot(found)])


# The command.

def _cutoff(text: str) -> Optional[float]:
    if text == "none":
        return None
    try:
        value = _core.parse_quantity(text) if text.rstrip().endswith("Hz") else float(text)
    except ValueError:
        value = None
    if value is None or not 0 < value <= 1e4:
        raise input_error("--cutoff", text, 'a frequency such as "6 Hz", or none')
    return value


def _least(options: dict[str, Any]) -> Optional[float]:
    value = real_of("--co-contraction", options.get("--co-contraction", "0"), 0, 0.9, "an activation, 0 to 0.9")
    for name in ("--co-contraction", "--apart"):
        if name in options and "--muscles" not in options:
            raise input_error(name, "no muscles", "--muscles beside it")
    return value if "--muscles" in options else None


def _uncertain(options: dict[str, Any], file: Path, asked: Asked, overrides: Sequence[str], count: int, out: Path) -> int:
    words = ["inverse", str(file)]
    for name, path in zip(("--motion", "--names", "--loads"), asked[:3]):
        words += [] if path is None else [name, str(path)]
    words += ["--cutoff", "none" if asked.cutoff is None else number(asked.cutoff)] + (["--clamp"] if asked.clamp else [])
    if asked.least is not None:
        words += ["--muscles", "--co-contraction", number(asked.least)]
    return drawn({"file": str(file), "overrides": overrides, "count": count, "out": out, "report": "--report" in options, "on": options.get("--on", ""),
                  "command": _core.command_text([*words, "--uncertain", str(count)], command_overrides(options)), "inverse": tuple(asked)})


def _work(options: dict[str, Any]) -> int:
    file, overrides, count = find_file(options["SCENE"]), command_overrides(options), whole_option(options, "--uncertain", 2, MOST_HANDS, "a whole number of hands")
    motion, loads = (Path(options[name]) if name in options else None for name in ("--motion", "--loads"))
    names = find_file(options["--names"], "--names", "controllers") if "--names" in options else None
    asked = Asked(motion, names, loads, _cutoff(options.get("--cutoff", "6")), "--clamp" in options, _least(options))
    for name in ("--on", "--report"):
        if name in options and count is None:
            raise input_error(name, "no drawn hands", "--uncertain beside it")
    if count is not None and "--json" in options:
        raise input_error("--json", "drawn hands", "no --uncertain beside it")
    out = Path(options.get("--out") or Path("out") / f"{file.stem}_inverse")
    if asked.least is not None:
        overrides = overrides + muscle_overrides(Scene(_core.Scene.load(file, overrides)), "--apart" in options)
    if count is not None:
        return _uncertain(options, file, asked, overrides, count, out)
    scene = Scene(_core.Scene.load(file, overrides))
    warn(scene.warnings)
    with bar(True, "inverse") as told:
        found, summary, plotted = study(scene, asked, "--no-check" not in options, out, told)
    warn(found.warnings)
    if found.fault is not None:
        print(f"the check ended early: {found.fault}", file=sys.stderr)
    elif not found.agrees and found.rms_error is not None:
        print(f"the check misses the motion: RMS error {DEGREES * found.rms_error:.3g} deg, limit {DEGREES * found.limit:g} deg: contacts between bodies are "
              "no part of the torques, and without feedback differences grow", file=sys.stderr)
    if "--json" in options:
        print(summary, end="")
        note, status = plot_note(plotted)
        if status != 0:
            print(f"missing: plots{note}", file=sys.stderr)
    else:
        print(screen_text(found), end="")
        status = print_files(out, plotted)
    return status if found.agrees else 1


FLAGS = ("--clamp", "--no-check", "--muscles", "--apart", "--json", "--report")
VALUES = ("--motion", "--out", "--names", "--cutoff", "--loads", "--co-contraction", "--set", "--engine", "--uncertain", "--on")


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if any(each in ("-h", "--help") for each in arguments):
        print(USAGE, end="")
        return 0
    return ended(lambda: _work(read_options("inverse", arguments, "SCENE", FLAGS, VALUES, ())))
