"""``handsim grasp`` and `study.grasps`: what was held, how firmly, and the load that a hand carried on a hold.

The core runs the scenes (src/handsim/study/grasp); what the rows show is written here.
"""
from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any, NamedTuple, Optional, Sequence

from . import _core
from ._errors import input_error
from ._files import ended, read_options
from ._overrides import command_overrides
from ._progress import Told, bar
from ._rollouts_command import drawn
from ._shipped import find_file
from ._study_files import csv_text, json_file, number, quoted, real_of, whole_option

USAGE = """handsim grasp SCENES [--out DIR]
handsim grasp plan OBJECT [--person PERSON] [--side SIDE] [--type TYPE ...] [--count N] [--ode] [--threads N] [--out DIR]
                          finds grasps of an object: handsim grasp plan --help

Grasp and climb scenes in one table of each: what was held, how firmly, the least friction that holds, and the load that a hand carried on
a hold (docs/grasping.md, docs/climbing.md). SCENES are files, shipped names, or folders of scenes.

  --out DIR          folder for the runs' files and the tables; out/SCENE
  --side SIDE        hand that grasps: right, left or both; the scene's
  --persons P ...    person files, shipped names, or folders of them, in place of the scenes'
  --set KEY=VALUE    a change of the scenes; may be repeated
  --engine ENGINE    in place of the scenes': ode, dae, articulated or auto
  --friction F       of every surface, in place of the scenes'
  --friction-search  also the smallest friction that still holds (seven more runs of each scene)
  --margin           each grasp again with 5 % more and less friction and mass: marginal if that changes the verdict
  --confirm          each grasp again at half the step: uncertain if that changes the verdict, or by more than its margin
  --uncertain N      draws as many hands within what is uncertain of them: all figures with intervals, and which inputs own their variance
  --on ADDRESS       dask://HOST:PORT of a Dask scheduler, whose workers run these hands
  --report           report.html: tables to sort and a plot, for a browser; and the page of each run
  --pictures         a picture at every phase
  --video FILE       video of each run in its folder: a name without one, .mp4 or .gif (needs ffmpeg)
  --fps N            frames in a second of the video; 30
  --speed X          simulated seconds in a second of the video; 1
  --gl GL            OpenGL without a display: osmesa or egl

Exit status 1: a criterion of a run failed, or a file could not be written.

Example: handsim grasp config --out out/grasps --side both
"""
DEGREES = 180 / math.pi
MOST_SCENES, MOST_HANDS = 10_000, 1_000_000
GRASPS = ("scene,side,stature[m],hand_length[m],grip_strength[N],object,held,outcome,margin,turning,slip[um/s],shaken_shift[mm],shift[mm],turn[deg],"
          "contacts,normal_force[N],friction_used,force_closure,epsilon,wrench_volume,smallest_friction,criteria_held,wall[s],outcome_half_step,"
          "margin_half_step,uncertain")
CLIMBS = ("scene,side,stature[m],hand_length[m],climb,failed,load[N],norm[N],norm_deviation[N],grip_strength[N],load_over_norm,travel_at_load[mm],"
          "contacts,criteria_held,wall[s]")

Row = dict[str, Any]
"""What `rows_text` of src/handsim/study/grasp/grasp_rows.cpp writes: SI, None where it was not measured."""


class Asked(NamedTuple):
    """What the study is of."""

    scenes: list[Path]
    sides: list[str]
    """``right``, ``left`` for the first hand; none: as the scenes have it."""
    persons: list[Path]
    overrides: list[str]
    out: Path

    def command(self, friction: Optional[float] = None) -> str:
        """That repeats the study, without its further runs."""
        words = ["grasp", *map(str, self.scenes)]
        for person in self.persons:
            words += ["--persons", str(person)]
        if self.sides:
            words += ["--side", "both" if len(self.sides) == 2 else self.sides[0]]
        if friction is not None:
            words += ["--friction", number(friction)]
        return _core.command_text(words, self.overrides)


class Field(NamedTuple):
    """A figure of a row, with its place in CSV and in JSON."""

    column: str
    """Of CSV, without its unit; empty: none."""
    key: str
    """Of JSON; empty: none."""
    value: Any
    """None where it was not measured."""
    scale: float = 1.0
    """Of the column's number over the key's."""
    digits: str = ".6g"
    """In CSV."""
    plain: bool = False
    """Text stands without quotes."""

    def cell(self) -> str:
        if self.value is None:
            return ""
        if isinstance(self.value, bool):
            return str(int(self.value))
        if isinstance(self.value, str):
            return self.value if self.plain else quoted(self.value)
        return f"{self.scale * float(self.value):{self.digits}}"


def _run_fields(row: Row) -> list[Field]:
    return [Field("stature", "stature_m", row["stature"]), Field("hand_length", "hand_length_m", row["hand_length"])]


def _fault(row: Row) -> list[Field]:
    return [Field("", "fault", row["fault"])] if row["fault"] else []


def _half_step(half: Row) -> dict[str, Any]:
    return {"outcome": half["told"], "margin": half["margin"], "slip_m_per_s": half["slip"], "shaken_shift_m": half["shaken_shift"],
            "shift_m": half["shift"], "turn_rad": half["turn"]}


def _grasp_fields(row: Row) -> list[Field]:
    f, half = row["figures"], row["half_step"]
    out = [Field("scene", "scene", row["scene"], plain=True), Field("side", "side", row["side"], plain=True), Field("object", "object", f["name"], plain=True),
           Field("held", "held", f["held"]), Field("outcome", "outcome", f["told"]), Field("margin", "margin", f["margin"]),
           Field("", "complete", f["complete"]), Field("criteria_held", "criteria_held", row["passed"]), Field("slip", "slip_m_per_s", f["slip"], 1e6),
           Field("shaken_shift", "shaken_shift_m", f["shaken_shift"], 1e3), Field("shift", "shift_m", f["shift"], 1e3),
           Field("turn", "turn_rad", f["turn"], DEGREES), Field("contacts", "contacts", f["contacts"]),
           Field("normal_force", "normal_force_N", f["normal_force"]), Field("friction_used", "friction_used", f["friction_used"]),
           Field("force_closure", "force_closure", f["force_closure"]), Field("", "force_closure_disagrees", f["disagree"]),
           Field("epsilon", "epsilon", f["epsilon"]), Field("wrench_volume", "wrench_volume", f["wrench_volume"]),
           Field("", "simulated_s", row["simulated"]), Field("wall", "wall_s", row["wall"], digits=".3g"),
           Field("smallest_friction", "smallest_friction", row["smallest_friction"])]
    if row["not_searched"]:
        out.append(Field("", "not_searched", row["not_searched"]))
    out += [Field("", key, f[name]) for name, key in (("lost_time", "lost_time_s"), ("moved_time", "moved_time_s")) if f[name] is not None]
    out.append(Field("turning", "" if row["turning"] is None else "turning", row["turning"] or ""))
    if half is not None:
        out += [Field("uncertain", "uncertain", row["uncertain"]), Field("", "half_step", _half_step(half)),
                Field("outcome_half_step", "", half["told"]), Field("margin_half_step", "", half["margin"])]
    return [*out, *_run_fields(row), Field("grip_strength", "grip_strength_N", row["grip_strength"]), *_fault(row)]


def _climb_fields(row: Row) -> list[Field]:
    return [Field("scene", "scene", row["scene"], plain=True), Field("side", "side", row["side"], plain=True), Field("climb", "climb", row["name"], plain=True),
            Field("failed", "failed", row["failed"]), Field("load", "load_N", row["load"]), Field("norm", "grip_strength_norm_N", row["norm"]),
            Field("norm_deviation", "grip_strength_deviation_N", row["norm_deviation"]), Field("grip_strength", "grip_strength_N", row["own_strength"]),
            Field("load_over_norm", "load_over_norm", row["share"], digits=".4g"), Field("travel_at_load", "travel_at_load_m", row["travel"], 1e3, ".4g"),
            Field("contacts", "contacts", row["contacts"]), Field("criteria_held", "criteria_held", row["passed"]),
            Field("", "simulated_s", row["simulated"]), Field("wall", "wall_s", row["wall"], digits=".3g"), *_run_fields(row), *_fault(row)]


def _write_table(out: Path, name: str, head: str, rows: Sequence[list[Field]], refused: Sequence[Sequence[str]] = ()) -> None:
    content: list[dict[str, Any]] = [{field.key: field.value for field in row if field.key} for row in rows]
    content += [{"scene": scene, "side": side, "refused": why} for scene, side, why in refused]
    cells = [{field.column: field.cell() for field in row if field.column} for row in rows]
    _core.write_file(out / f"{name}.csv", csv_text(head, cells).encode())
    _core.write_file(out / f"{name}.json", json_file(content).encode())


# The screen.

HEAD = (("scene", "", "<24"), ("hand", "", "<6"), ("verdict", "", "<9"), ("criteria", "", ">8"), ("margin", "%", ">7"), ("slip", "um/s", ">8"),
        ("in shake", "mm", ">9"), ("after it", "mm", ">9"), ("turned", "deg", ">8"), ("contacts", "", ">9"), ("grip", "N", ">8"), ("epsilon", "", ">8"),
        ("volume", "", ">9"), ("friction", "least", ">9"))
CLIMB_HEAD = (("scene", "", "<24"), ("hand", "", "<6"), ("verdict", "", "<8"), ("load", "N", ">8"), ("norm", "N", ">9"), ("of norm", "%", ">9"),
              ("moved", "mm", ">8"), ("contacts", "", ">9"), ("criteria", "", ">9"))


def _line(head: Sequence[tuple[str, str, str]], words: Sequence[str]) -> str:
    return " ".join(f"{word:{width}}" for word, (_, _, width) in zip(words, head)) + "\n"


def _heads(head: Sequence[tuple[str, str, str]]) -> str:
    return "".join(_line(head, [each[i] for each in head]) for i in (0, 1))


def _figure(value: Optional[float], scale: float = 1.0, digits: str = ".3g") -> str:
    return "-" if value is None else f"{scale * value:{digits}}"


def _grasp_line(name: str, side: str, verdict: str, criteria: str, f: Row, least: str) -> str:
    return _line(HEAD, [name, side, verdict, criteria, _figure(f["margin"], 100, ".0f"), _figure(f["slip"], 1e6), _figure(f["shaken_shift"], 1e3),
                        _figure(f["shift"], 1e3), _figure(f["turn"], DEGREES), _figure(f["contacts"]), _figure(f["normal_force"]), _figure(f["epsilon"]),
                        _figure(f["wrench_volume"]), least])


def _notes(row: Row) -> str:
    f, out = row["figures"], ""
    if row["uncertain"]:
        out += f"{f['told']}; {row['half_step']['told']} at half the step: the step decides\n"
    if row["turning"]:
        out += f"{f['told']}; {row['turning']} turns it\n"
    elif not row["uncertain"] and f["word"] in ("MOVED", "LOST"):
        out += f"{f['told']}\n"
    if row["not_searched"]:
        out += f"no search for the least friction: {row['not_searched']}\n"
    if f["disagree"]:
        out += f"{'held' if f['held'] else 'not held'}, though the contacts {'have no' if f['held'] else 'have'} force closure\n"
    return "".join(f"  note: {line}\n" for line in out.splitlines())


def grasps_text(rows: Sequence[Row]) -> str:
    out = _heads(HEAD)
    for row in rows:
        verdict = ("diverged" if row["fault"] else "uncertain" if row["uncertain"] else "marginal" if row["turning"] else row["figures"]["word"])
        out += _grasp_line(row["scene"], row["side"], verdict, "held" if row["passed"] else "FAILED", row["figures"], _figure(row["smallest_friction"], 1, ".2g"))
        if row["half_step"]:
            out += _grasp_line("  at half the step", "", row["half_step"]["word"], "", row["half_step"], "-")
        out += _notes(row)
    return out


def climbs_text(rows: Sequence[Row]) -> str:
    out = _heads(CLIMB_HEAD)
    for row in rows:
        verdict = "diverged" if row["fault"] else "failed" if row["failed"] else "holds" if row["complete"] else "cut off"
        criteria = "held" if row["passed"] else "FAILED" if row["complete"] else "NOT MEASURED"
        out += _line(CLIMB_HEAD, [row["scene"], row["side"], verdict, f"{row['load']:.4g}", f"{row['norm']:.4g}", f"{100 * row['share']:.3g}",
                                  f"{1e3 * row['travel']:.2g}", str(row["contacts"]), criteria])
    return out


def study(asked: Asked, friction: Optional[float] = None, *, search: bool = False, margin: bool = False, confirm: bool = False, pictures: bool = False,
          video: Optional[tuple[Path, float, float]] = None, egl: Optional[bool] = None, apart: bool = False, report: bool = False,
          told: Told = None) -> dict[str, list[Any]]:
    """The whole study, with its files: rows of ``grasps`` and ``climbs``, what was ``refused``, and what is ``missing``.

    :param friction: of every surface; None: the scenes'
    :param search: the smallest friction that still holds each grasp
    :param video: name, frames in a second, and simulated seconds in a second of video
    :param egl: draws by EGL, or by OSMesa; None: the default of the build
    :param apart: draws in child processes
    """
    command = asked.command(friction)
    if report:
        asked = asked._replace(overrides=[*asked.overrides, "record.contacts=true"])
    text, folder = _core.grasps(asked, friction, (search, margin, confirm), pictures, video, egl, apart, told)
    found: dict[str, list[Any]] = json.loads(text)
    _write_table(asked.out, "grasps", GRASPS, [_grasp_fields(row) for row in found["grasps"]], found["refused"])
    if found["climbs"]:
        _write_table(asked.out, "climbs", CLIMBS, [_climb_fields(row) for row in found["climbs"]])
    if report:
        found["missing"] += _pages(asked.out, found)
    _core.finish_study(asked.out, command, {}, {}, report)
    del folder  # ends its lock
    return found


def _pages(out: Path, found: dict[str, list[Any]]) -> list[str]:
    """Writes the page of each run. :returns: what hindered it"""
    from ._run_page import page_of_run

    names = {name for row in (*found["grasps"], *found["climbs"]) for name in (f"{row['scene']}_{row['side']}", row["scene"])}
    hindered = [page_of_run(str(out / name)) for name in sorted(names) if (out / name / "trajectory.csv").exists()]
    return [f"report: {why}" for why in hindered if why]


# The command.

def _real(options: dict[str, Any], name: str, least: float, most: float, need: str) -> Optional[float]:
    text = options.get(name)
    return None if text is None else real_of(name, text, least, most, need)


def _video(options: dict[str, Any]) -> Optional[tuple[Path, float, float]]:
    fps = _real(options, "--fps", 0.1, 240, "a number of frames, 0.1 to 240")
    speed = _real(options, "--speed", 1e-4, 1e4, "a factor, 0.0001 to 10000; below 1 it is slow motion")
    if "--video" not in options:
        for name in ("--fps", "--speed"):
            if name in options:
                raise input_error(name, options[name], "--video beside it")
        return None
    file = Path(options["--video"])
    if file.name != str(file):
        raise input_error("--video", str(file), "a name without a folder, such as grasp.mp4")
    return file, 30.0 if fps is None else fps, 1.0 if speed is None else speed


def _word(options: dict[str, Any], name: str, known: Sequence[str]) -> Optional[str]:
    word: Optional[str] = options.get(name)
    if word is not None and word not in known:
        raise input_error(name, word, f"one of {', '.join(known)}")
    return word


def _uncertain(options: dict[str, Any], asked: Asked, count: int, friction: Optional[float]) -> int:
    more = ("--friction-search", "--margin", "--confirm", "--pictures", "--video")
    if friction is not None or any(name in options for name in more):
        raise input_error("--uncertain", "options of one run of each scene", "--out, --side, --persons, --set, --engine, --on and --report alone")
    scenes, sides, persons, overrides, out = asked
    return drawn({"scenes": scenes, "sides": sides, "persons": persons, "overrides": overrides, "count": count, "out": out, "report": "--report" in options,
                  "on": options.get("--on", ""), "command": f"{asked.command()} --uncertain {count}"})


def _work(options: dict[str, Any]) -> int:
    side, gl = _word(options, "--side", ("right", "left", "both")), _word(options, "--gl", ("osmesa", "egl"))
    scenes = [find_file(each) for each in options["SCENES"]]
    persons = [find_file(each, "--persons", "config/persons") for each in options["--persons"]]
    name = scenes[0].stem if len(scenes) == 1 else ""
    asked = Asked(scenes, ["right", "left"] if side == "both" else [side] if side else [], persons, command_overrides(options),
                  Path(options.get("--out") or Path("out") / (name if name.strip(".") else "grasp")))
    friction = _real(options, "--friction", 0, 10, "a coefficient of friction, 0 to 10")
    video, report, count = _video(options), "--report" in options, whole_option(options, "--uncertain", 2, MOST_HANDS, "a whole number of hands")
    if count is not None:
        return _uncertain(options, asked, count, friction)
    if "--on" in options:
        raise input_error("--on", options["--on"], "--uncertain beside it")
    if report:
        _core.require_three()
    with bar(True, "grasp") as told:
        found = study(asked, friction, search="--friction-search" in options, margin="--margin" in options, confirm="--confirm" in options,
                      pictures="--pictures" in options, video=video, egl=None if gl is None else gl == "egl", apart=True, report=report, told=told)
    rows = [*found["grasps"], *found["climbs"]]
    print((grasps_text(found["grasps"]) if found["grasps"] else "") + (climbs_text(found["climbs"]) if found["climbs"] else "")
          + "".join(f"not for this hand: {scene} {side}: {why}\n" for scene, side, why in found["refused"]) + f"files in {asked.out}")
    for text in (*(row["fault"] for row in rows if row["fault"]), *(f"missing: {what}" for what in found["missing"])):
        print(text, file=sys.stderr)
    return 0 if all(row["passed"] for row in rows) and not found["missing"] else 1


FLAGS = ("--friction-search", "--margin", "--confirm", "--report", "--pictures")
VALUES = ("--out", "--side", "--set", "--engine", "--friction", "--uncertain", "--on", "--video", "--fps", "--speed", "--gl")


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if arguments and arguments[0] == "plan":
        from ._grasp_plan_command import main as plan

        return plan(arguments[1:])
    if any(each in ("-h", "--help") for each in arguments):
        print(USAGE, end="")
        return 0
    return ended(lambda: _work(read_options("grasp", arguments, "SCENES", FLAGS, VALUES, (), most=MOST_SCENES, lists=("--persons",))))
