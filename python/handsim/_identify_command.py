"""``handsim identify RECORDING``: numbers of a scene from a recording, with intervals."""
from __future__ import annotations

import json
import sys
from contextlib import nullcontext
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._errors import Error, Problem, input_error
from ._files import OutputFolder, ended, path_of, read_options, usage
from ._scene import Scene, files_of, load, standing_alone
from ._shipped import find_file
from ._table import UNIT
from ._table_files import at, read_csv
from ._yaml import number_of, scene_number
from .identify import NO_NUMBERS, Identified, identify

USAGE = """handsim identify RECORDING --scene SCENE --free KEY[=VALUE],... [--out DIR]

Fits numbers of a scene to a recording: the run of the scene, as it is controlled there, comes as near to the recording as it can.
RECORDING is a folder of handsim run (trajectory.csv, contacts.csv) or a CSV file: time[s], and columns with a unit:
  right.index_mcp.flexion[rad]      a joint coordinate; its rate: right.index_mcp.flexion.rate[rad/s]
  card.x[mm]                        a mass centre in the world: of an object, or of a body of a hand
  card.force.x[N]                   sum of the contact forces on a shape, world axes

  --scene SCENE          a scene file or a shipped name; engine articulated
  --free KEY[=VALUE],... numbers to fit, by dotted key as for --set, with the value to start from (SI); else the scene's
  --columns NAME,...     only these of the recording; * stands for anything
  --deviation UNIT=NUMBER,...  standard deviations of the recording: m=1e-3,rad=0.01,N=0.05,m/s=0.02,rad/s=0.1 (the defaults)
  --set KEY=VALUE        a change of the scene; may be repeated
  --out DIR              writes identified.json and scene.yaml, the scene with what was found
  --json                 prints identified.json in place of the table

Example: handsim identify out/run --scene slide.yaml --free objects.0.mass,objects.0.friction=0.4 --out out/found
"""
DEVIATIONS = {"m": 1e-3, "rad": 0.01, "N": 0.05, "m/s": 0.02, "rad/s": 0.1}
BASE = {"mm": "m", "cm": "m", "um": "m", "deg": "rad", "mm/s": "m/s", "deg/s": "rad/s"}
MOST_STEPS = 1_000_000
Array = NDArray[np.float64]


def _numbers(text: str, scene: Scene) -> dict[str, float]:
    """Keys with the values to start from."""
    out, problems = dict[str, float](), list[str]()
    for each in text.split(","):
        key, equals, value = each.strip().partition("=")
        found = number_of(value) if equals else scene_number(scene.resolved, key)
        if key.partition(".")[0] in NO_NUMBERS:
            problems.append(f"--free: got {each.strip()}, which says how the scene is run, need a number of what is in it")
        elif found is None or not np.isfinite(found):
            problems.append(f"--free: got {each.strip()}, need " + (f"{key}=NUMBER" if equals else f"a key with a number in the resolved scene, or {key}=VALUE"))
        else:
            out[key] = found
    if problems:
        raise Error("\n".join(problems), "input", [Problem(None, None, None, "--free", each, "a number") for each in problems])
    return out


def _deviations(text: Optional[str]) -> dict[str, float]:
    out = dict(DEVIATIONS)
    for each in text.split(",") if text else []:
        unit, _, value = each.strip().partition("=")
        try:
            number = float(value)
        except ValueError:
            number = -1
        if unit not in out or not 0 < number < np.inf:
            raise input_error("--deviation", each, "UNIT=NUMBER above 0, UNIT one of " + ", ".join(DEVIATIONS))
        out[unit] = number
    return out


def _read(path: Path) -> tuple[Path, dict[str, Array]]:
    """Columns by their heads; forces of a folder's contacts are summed by shape."""
    file = path / "trajectory.csv" if path.is_dir() else path
    table = read_csv(file)
    columns: dict[str, Any] = {table.with_unit(name): values for name, values in table.items()}
    for name, values in columns.items():
        if not isinstance(values, np.ndarray) or values.dtype.kind != "f":
            raise at(file, 1, name, "texts" if len(values) else "no row", "numbers")
    if path.is_dir() and (path / "contacts.csv").exists():
        columns.update(_forces(path / "contacts.csv", np.asarray(columns.get("time[s]", []), dtype=float)))
    return file, columns


def _seen(file: Path, head: str, values: Array) -> None:
    """:raises Error: of kind input for a column in which nothing was seen, and for a number that is none"""
    infinite = np.flatnonzero(np.isinf(values))
    if len(infinite):
        raise at(file, 2 + int(infinite[0]), head, f"{values[infinite[0]]:g}", "a finite number, or nothing where it was not seen")
    if np.isnan(values).all():
        raise at(file, 1, head, "no number", "one at least: --columns leaves columns out")


def _forces(file: Path, times: Array) -> dict[str, Array]:
    contacts = read_csv(file)
    texts, numbers = ("a", "b"), ("time", "normal_force", *(f"{of}.{axis}" for of in ("normal", "friction") for axis in "xyz"))
    for name in (*texts, *numbers):
        column: Any = contacts.get(name)
        if column is None or isinstance(column, np.ndarray) == (name in texts) and len(column):
            raise at(file, 1, name, "no such column" if column is None else "other values", "the contacts.csv of a run")
    if contacts.rows and not contacts["time"].max() <= times.max(initial=-np.inf) + 1e-9:
        raise at(file, 1, "time[s]", f"contacts until {contacts['time'].max():g} s", "the contacts.csv of the trajectory.csv beside it")
    rows = np.searchsorted(times, contacts["time"] - 1e-9)
    out = {f"{shape}.force.{axis}[N]": np.zeros(len(times)) for shape in {*contacts["a"], *contacts["b"]} for axis in "xyz"}
    for i, (row, a, b) in enumerate(zip(rows, contacts["a"], contacts["b"])):
        for k, axis in enumerate("xyz"):
            force = contacts["normal_force"][i] * contacts[f"normal.{axis}"][i] + contacts[f"friction.{axis}"][i]
            out[f"{a}.force.{axis}[N]"][row] += force
            out[f"{b}.force.{axis}[N]"][row] -= force
    return out


def _name_of(stem: str, scene: Scene) -> Optional[str]:
    """What identify calls it."""
    base, _, last = stem.rpartition(".")
    if stem in scene.coordinates:
        return stem
    if last == "rate" and base in scene.coordinates:
        return f"d({base})/dt"
    if last in ("x", "y", "z") and base.endswith(".force"):
        return stem
    if last in ("x", "y", "z") and base in scene.bodies:
        return f"{base}.shift.{last}" if base in scene.objects else f"{base}.place.{last}"
    return None


def _recorded(file: Path, columns: dict[str, Array], scene: Scene, wanted: Optional[str],
              folder: bool) -> tuple[Array, dict[str, Array], dict[str, str], list[str]]:
    """Times, values and units of the names that are used, and the columns that are not."""
    patterns = [each.strip() for each in wanted.split(",")] if wanted else []
    if "time[s]" not in columns:
        raise at(file, 1, "time[s]", "no such column", "one")
    used, units, left = dict[str, Array](), dict[str, str](), list[str]()
    for head, values in columns.items():
        match = UNIT.fullmatch(head)
        stem, unit = match.groups() if match else (head, "")
        name = _name_of(stem, scene)
        base = BASE.get(unit, unit)
        scale = number_of(f"1 {unit}")
        known = name is not None and scale is not None and base in DEVIATIONS and (".force." in stem) == (base == "N")
        # Of a run's folder: coordinates, objects and forces; all the rest follows from them.
        if known and name and scale and (any(fnmatch(stem, p) or stem == p for p in patterns) if patterns
                               else not folder or ".place." not in name and not name.startswith("d(")):
            _seen(file, head, values)
            used[name], units[name] = values * scale, base
        elif head != "time[s]" and (not folder or patterns):
            left.append(head)
    missing = [p for p in patterns if not any(fnmatch((UNIT.fullmatch(h) or [h, h])[1], p) for h in columns)]
    if missing or not used:
        got = ", ".join(missing) or ", ".join(left[:5]) or "no other one"
        raise at(file, 1, "columns", got, "columns of the scene's coordinates, bodies or forces with their units")
    return columns["time[s]"], used, units, left


def _steps(file: Path, times: Array, scene: Scene) -> int:
    """Of the run that the recording is compared with. :raises Error: of kind input, with the line of a time that is wrong"""
    late = np.flatnonzero(~(times <= scene.duration + scene.step / 2))
    early = np.flatnonzero(np.diff(times) <= 0)
    if len(early):
        raise at(file, 3 + int(early[0]), "time[s]", f"{times[early[0] + 1]:g} after {times[early[0]]:g}", "times that increase")
    if len(late):
        raise at(file, 2 + int(late[0]), "time[s]", f"{times[late[0]]:g} s", f"times to the scene's duration of {scene.duration:g} s (--set duration=T)")
    if not len(times) or not times[-1] > scene.step * (1 - 1e-9):
        raise at(file, 2, "time[s]", f"{len(times)} times", f"one at least from the end of the first step on, {scene.step:g} s")
    steps = int(np.ceil(times[-1] / scene.step - 1e-6))
    if steps > MOST_STEPS:
        raise at(file, 1 + len(times), "time[s]", f"{times[-1]:g} s, {steps} steps of {scene.step:g} s", f"at most {MOST_STEPS} steps")
    return steps


def _work(options: dict[str, Any]) -> int:
    changes = dict(each.partition("=")[::2] for each in options["--set"])
    scene = load(find_file(options["--scene"]), changes)
    numbers = _numbers(options["--free"], scene)
    deviations = _deviations(options.get("--deviation"))
    path = path_of("RECORDING", options["RECORDING"])
    file, columns = _read(path)
    times, used, units, left = _recorded(file, columns, scene, options.get("--columns"), path.is_dir())
    steps, rows = _steps(file, times, scene), times > scene.step * (1 - 1e-9)
    inputs = [*files_of(scene), file, path / "contacts.csv"]
    folder = OutputFolder(options["--out"], "identified.json", b'{\n "values"', standing_alone(scene), inputs) if "--out" in options else None
    with folder or nullcontext():
        found = identify(scene, numbers, np.zeros((steps, len(scene.coordinates))), {name: values[rows] for name, values in used.items()},
                         deviation={name: deviations[unit] for name, unit in units.items()}, kind="torques", times=times[rows])
        values = dict(zip(found.names, found.values.tolist()))
        result = {"values": values, "intervals": {name: value if np.isfinite(value) else None for name, value in zip(found.names, found.interval.tolist())},
                  "residual": found.residual, "iterations": found.iterations, "steps": steps, "columns": list(used),
                  "deviations": {unit: deviations[unit] for unit in sorted(set(units.values()))},
                  "set": " ".join(f"--set {name}={value!r}" for name, value in values.items())}
        if folder is not None:
            fitted = load(find_file(options["--scene"]), {**changes, **{name: repr(value) for name, value in values.items()}})
            files = {"identified.json": json.dumps(result, indent=1).encode(), **standing_alone(fitted)}
            folder.write(files)
    _show(found, result, "--json" in options)
    if left:
        print(f"columns that are not used: {', '.join(left)}", file=sys.stderr)
    if folder is not None:
        print(folder.told(files), file=sys.stderr)
    return 0


def _show(found: Identified, result: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print(json.dumps(result, indent=1))
        return
    print(f"{'number':44}{'value':>12}{'95 %':>12}")
    for name, value, half in zip(found.names, found.values, found.interval):
        print(f"{name:44}{value:12.5g}" + (f"{'+-' + format(half, '.2g'):>12}" if np.isfinite(half) else "  not in the recording"))
    print(f"residual {found.residual:.3g} deviations (near 1 where scene and deviations fit), {found.iterations} iterations\n{result['set']}")


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if (status := usage(USAGE, arguments)) is not None:
        return status
    return ended(lambda: _work(read_options("identify", arguments, "RECORDING", ("--json",), ("--scene", "--free", "--columns", "--deviation", "--set", "--out"),
                                            ("--scene", "--free"))))
