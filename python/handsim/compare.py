"""``handsim compare A B``: strength, reach and tenodesis of two hands side by side."""
from __future__ import annotations

import html
import importlib.util
import json
import os
import re
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import input_error
from ._files import OutputFolder, ended
from ._grip import GripRun
from ._hand import WHAT_IF, Hand
from ._plot import COLORS, axes, line, sheet_of
from ._scene import Scene, files_of
from ._shipped import data_path, find_file
from ._statics import FINGERS, FRICTION, NotHeld, Statics, key_pinch, polytope, slack_pose, thumb_workspace, tip_pinch
from ._yaml import parser

USAGE = """handsim compare A [B] [--set KEY=VALUE] [--out DIR]

Two hands side by side: strength of grip and pinches, largest forces of index and thumb in all directions beside people's, reach of the
thumb, and where fingers rest at each angle of the wrist (tenodesis). A and B are persons or scenes, by file or shipped name, or folders
of runs; the first hand of each counts, at rest and as it is built, with its wrist. Without B, B is A with what is set. Where people were
measured, their values stand beside, and a row that lies outside of them is marked.

  --set KEY=VALUE   a change of B, such as hands.0.without=[ulnar_nerve_at_wrist]; may be repeated
  --out DIR   also writes compare.html, a page with pictures, compare.svg, the pictures alone, and compare.json

Example: handsim compare median_man median_woman --out out/compare
         handsim compare median_man --set "hands.0.without=[ulnar_nerve_at_wrist]" --out out/compare
"""
PRESS = {"index_mcp.flexion": 45.0, "index_pip.flexion": 45.0, "index_dip.flexion": 10.0}
THUMB = {"thumb_mcp.flexion": 15.0, "thumb_ip.flexion": -15.0}
PLANES: list[dict[str, Any]] = [
    # Points: people's largest forces in the plane and their standard deviations [N].
    {"title": "index fingertip, from its side", "finger": "index", "point": "index_tip", "body": "index_distal", "pose": PRESS, "across": 1,
     "labels": ("distal", "palmar"), "source": "Valero-Cuevas 1998, 8 people", "points": [(0, 27.9, 4.1), (0, -7.5, 1.5), (24, 0, 8)]},
    {"title": "index fingertip, from its end", "finger": "index", "point": "index_tip", "body": "index_distal", "pose": PRESS, "across": 0,
     "labels": ("ulnar", "palmar"), "source": "Valero-Cuevas 1998, 8 people", "points": [(0, 27.9, 4.1), (0, -7.5, 1.5), (22.9, 0, 7.8)]},
    {"title": "thumb, middle of its proximal phalanx, from its end", "finger": "thumb", "point": "thumb_proximal", "body": "thumb_proximal",
     "pose": THUMB, "across": 0, "labels": ("ulnar", "palmar"), "source": "Li & Harkness 2004",
     "points": [(0, 104.1, 13.7), (0, -69.4, 9.2), (-57.7, 0, 7.6), (67.4, 0, 8.9)]}]
WRIST = (-60, -40, -20, 0, 20, 40, 60)
GRIP = (-35, -7)
"""Flexion and deviation of the wrist in which people grip [deg] (O'Driscoll 1992)."""
EFFECTS = ["joint_stops", "passive_tissue", "muscles", "tendon_coupling"]
JOINTS = ("index_mcp", "index_pip", "middle_mcp", "middle_pip", "thumb_mcp", "thumb_ip")


def hand_of(source: str, changes: Sequence[str] = ()) -> Hand:
    """The first hand of a scene or of a run's folder, or a person's right one, with muscles and a wrist that turns.

    :param changes: as ``--set``
    :raises Error: of kind input for another source, and for a hand without muscles
    """
    path = file_of(source)
    if _is_person(path):
        hand = {"model": str(data_path() / "handmodels/anatomical.yaml"), "person": str(path.resolve()), "side": "right"}
        text = json.dumps({"title": "a person", "hands": [hand], "effects": EFFECTS, "duration": 1})
        return _alone(Scene(_core.Scene.parse(text, source, list(changes))), source)
    scene = Scene(_core.Scene.load(path, [each for each in changes if not each.startswith("hands.0.")]))
    missing = [each for each in ("muscles", "tendon_coupling") if each not in scene.effects]
    effects = [f"effects=[{', '.join([*scene.effects, *missing])}]"] if missing else []
    scene = Scene(_core.Scene.load(path, [*effects, *changes]))
    if not scene.hands:
        raise input_error(source, "a scene without hands", "one with a hand")
    return _alone(scene, source)


def file_of(source: str) -> Path:
    run, person = Path(source) / "resolved.yaml", data_path() / "config/persons" / f"{source}.yaml"
    if not os.path.lexists(source) and person.is_file():
        return person
    return run if run.is_file() else find_file(source)


def _is_person(path: Path) -> bool:
    try:
        text = path.read_text(encoding="utf-8-sig") if path.is_file() else ""
    except (OSError, UnicodeDecodeError):
        return False  # what reads scenes says what is wrong
    keys = set(re.findall(r"""^[\s{]*["']?(\w+)["']?\s*:""", text, re.MULTILINE))
    return bool(keys & {"stature", "mass", "sex", "hand_length"}) and not keys & {"hands", "objects", "bodies", "effects"}


def _alone(scene: Scene, source: str) -> Hand:
    """A hand built from the resolved scene's first one alone."""
    lines = scene.resolved.splitlines()
    first = lines.index("hands:") + 1
    end = next((i for i in range(first + 1, len(lines)) if not lines[i].startswith("   ")), len(lines))
    text = "\n".join(["title: a hand", "hands:", *lines[first:end],
                      f"effects: [{', '.join(EFFECTS)}]", "duration: 1"])
    hand = Hand.__new__(Hand)
    hand.scene = Scene(_core.Scene.parse(text, source, ["hands.0.wrist={mount: universal}", "hands.0.pose={}"]))
    hand.side = "left" if hand.scene.hands[0].startswith("left") else "right"
    return hand


def _grips(hand: Hand) -> dict[str, float]:
    """The largest grip on a dynamometer that is set to 48 mm, as the rows of config/validate.yaml have it, and each finger's [N]; 0 where the hand holds none."""
    grip, own = (Scene(of).resolved.splitlines() for of in (_core.Scene.load(find_file("muscle_grip"), []), hand.scene._core))
    starts = [next(i for i, line in enumerate(lines) if i > lines.index("hands:") and not line.startswith(" ")) for lines in (grip, own)]
    text = "\n".join([*own[:starts[1]], *grip[starts[0]:]])
    fused = {key.strip(): angle.strip() for key, _, angle in (line.partition(":") for line in _block(own, "    fused:"))}
    length = hand.dimensions["length"]
    place = [f"objects.0.position=[0, {0.0311 + 0.233 * length}, {-0.0218 - 0.0854 * length}]", "hands.0.side=right", "hands.0.wrist={mount: fixed}",
             "hands.0.pose={thumb_cmc: [-35 deg, -20 deg]}"]

    def largest(flexion: float, deviation: float, balanced: bool) -> tuple[float, dict[str, float]]:
        wrist = {"wrist.flexion": float(np.radians(flexion)), "wrist.deviation": float(np.radians(deviation))}
        run = GripRun(lambda changes: Scene(_core.Scene.parse(text, str(find_file("muscle_grip")), [*place, *changes])), wrist, [float(np.radians(55))], FRICTION,
                      list(wrist) if balanced else [], fused)
        try:
            return run.force(), run.by_finger()
        except NotHeld:
            return 0.0, dict.fromkeys(FINGERS, 0.0)

    whole, fingers = largest(*GRIP, True)
    return {"grip": whole, **{f"grip, {finger}": force for finger, force in fingers.items()}, "grip, wrist in a splint": largest(*GRIP, False)[0],
            **{f"grip, wrist at {angle} deg": largest(angle, 0, True)[0] for angle in (-30, 0, 30)}}


def _block(lines: Sequence[str], key: str) -> list[str]:
    """The lines under a key."""
    if key not in lines:
        return []
    start, indent = lines.index(key) + 1, len(key) - len(key.lstrip())
    end = next(i for i in [*range(start, len(lines)), len(lines)] if i == len(lines) or not lines[i].startswith(" " * (indent + 1)))
    return list(lines[start:end])


def measure(hand: Hand) -> dict[str, Any]:
    """All that the table and the pictures show. Forces in N, angles in degrees, volumes in cm^3."""
    of = Statics(hand)
    mirror = -1 if hand.side == "left" else 1
    volume, points = thumb_workspace(of)
    out: dict[str, Any] = {"strength": {**_grips(hand), "key pinch": key_pinch(of), "tip pinch": tip_pinch(of)},
                           "planes": [polytope(of, mirror=mirror, **_place(each)).tolist() for each in PLANES],
                           "workspace_cm3": 1e6 * volume, "workspace": _outline(points, mirror),
                           "tenodesis": {}}
    rests = [slack_pose(of, {"wrist.flexion": float(angle)}) for angle in WRIST]
    for joint in JOINTS:
        column = of.names.index(joint + ".flexion")
        out["tenodesis"][joint] = [float(np.degrees(q[column])) for q in rests]
    return out


def _place(plane: dict[str, Any]) -> dict[str, Any]:
    return {key: plane[key] for key in ("finger", "point", "body", "pose", "across")}


def _outline(points: NDArray[np.float64], mirror: int) -> list[list[list[float]]]:
    """Cells of 3 mm that the points cover, from the palm (ulnar, distal) and from the end (ulnar, dorsal) [mm]."""
    cells = []
    for axes in ((0, 1), (0, 2)):
        flat = 1e3 * points[:, axes] * [mirror, 1]
        cells.append((3 * np.unique(np.round(flat / 3).astype(int), axis=0)).tolist())
    return cells


def table(names: Sequence[str], both: Sequence[dict[str, Any]]) -> list[tuple[str, str, float, float]]:
    """Rows: quantity, unit, of A, of B."""
    a, b = both
    rows = [(name, "N", a["strength"][name], b["strength"][name]) for name in a["strength"]]
    for plane, first, second in zip(PLANES, a["planes"], b["planes"]):
        for turn, label in ((0, plane["labels"][0]), (1, plane["labels"][1]), (3, "dorsal")):
            at = turn * len(first) // 4
            rows.append((f"{plane['title'].split(',')[0]}, {label}", "N", float(np.hypot(*first[at])), float(np.hypot(*second[at]))))
    rows.append(("reach of the thumb's tip", "cm3", a["workspace_cm3"], b["workspace_cm3"]))
    for joint in JOINTS:
        for i in (1, len(WRIST) - 2):
            rows.append((f"rest of {joint}, wrist at {WRIST[i]} deg", "deg", a["tenodesis"][joint][i], b["tenodesis"][joint][i]))
    unique: dict[str, tuple[str, str, float, float]] = {}
    for row in rows:
        unique.setdefault(row[0], row)
    return list(unique.values())


class Measured(NamedTuple):
    """What people had, beside a row."""

    text: str
    outside: bool
    """A or B lies outside of all of it by more than its spread."""
    source: str


def measured(hands: Sequence[Hand], rows: Sequence[tuple[str, str, float, float]]) -> dict[str, Measured]:
    """People's values by the name of a row: forces of whole hands, and shares where B has lost what theirs had (config/clinic.yaml)."""
    of_rows, out = {row[0]: row[2:] for row in rows}, dict[str, Measured]()
    if importlib.util.find_spec("yaml") is None:
        print("without PyYAML (pip install pyyaml) nothing is said of people's values, and no row is marked", file=sys.stderr)
        return {}
    specs = [_hand_spec(hand) for hand in hands]
    changes = [{key: spec.pop(key) for key in WHAT_IF if key in spec} for spec in specs]
    for plane in PLANES:
        for x, y, spread in plane["points"]:
            label = plane["labels"][0] if x > 0 else plane["labels"][1] if y > 0 else "dorsal" if y < 0 else ""
            name, value = f"{plane['title'].split(',')[0]}, {label}", abs(x + y)
            ours = [force for force, lost in zip(of_rows.get(name, ()), changes) if not lost]
            if ours:
                out[name] = Measured(f"{value:g} ± {spread:g} N", any(abs(force - value) > spread for force in ours), plane["source"])
    if specs[0] == specs[1] and not changes[0] and changes[1]:
        for name, people in _shares(changes[1]).items():
            share = of_rows[name][1] / of_rows[name][0]
            outside = all(abs(share - value) > spread for value, spread, _ in people)
            out[name] = Measured(", ".join(f"{value:.2f} ± {spread:.2f}" for value, spread, _ in people), outside, "; ".join(source for _, _, source in people))
    return out


def _hand_spec(hand: Hand) -> dict[str, Any]:
    out: dict[str, Any] = parser().safe_load(hand.scene.resolved)["hands"][0]
    return out


def _shares(change: dict[str, Any]) -> dict[str, list[tuple[float, float, str]]]:
    """Of whole people's forces that people with this change have: value, spread and source, by the name of a row."""
    clinic, out = parser().safe_load((data_path() / "config/clinic.yaml").read_text(encoding="utf-8")), dict[str, list[tuple[float, float, str]]]()
    for row in clinic["measurements"]:
        pairs = [each.partition("=")[::2] for each in row.get("set", [])]
        of = {key.replace("hands.0.", ""): parser().safe_load(value) for key, value in pairs} or clinic["variants"].get(row.get("hand"), {})
        if row.get("relative_to") in ("grip", "key pinch", "tip pinch") and of == change:
            out.setdefault(row["relative_to"], []).append((row["measured"], row["spread"], row["source"]))
    return out


def _runs(cells: Sequence[Sequence[float]]) -> list[list[float]]:
    """Neighbouring cells of 3 mm as one: x of the first, y, and width."""
    out: list[list[float]] = []
    for x, y in sorted(cells, key=lambda cell: (cell[1], cell[0])):
        if out and out[-1][1] == y and out[-1][0] + out[-1][2] == x:
            out[-1][2] += 3
        else:
            out.append([x, y, 3])
    return out


def _limits(points: NDArray[np.float64]) -> tuple[float, float, float, float]:
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.08 * max(high - low)
    return float(low[0] - room), float(high[0] + room), float(low[1] - room), float(high[1] + room)


def pictures(both: Sequence[dict[str, Any]]) -> list[str]:
    """SVG of all pictures."""
    out = []
    for k, plane in enumerate(PLANES):
        lines = [np.array(hand["planes"][k]) for hand in both]
        people = np.array(plane["points"])
        drawn = "".join(line(each.tolist(), color, True) for each, color in zip(lines, COLORS))
        for x, y, spread in plane["points"]:
            ends = [(x - spread * (x != 0), y - spread * (x == 0)), (x + spread * (x != 0), y + spread * (x == 0))]
            drawn += line(ends, "#222", False) + line([(x, y), (x, y)], "#222", False).replace('stroke-width="2"',
                                                                                               'stroke-width="8" stroke-linecap="round"')
        spread = np.array([[x + s * (x != 0) * np.sign(x), y + s * (x == 0) * np.sign(y)] for x, y, s in people])
        limits = _limits(np.vstack([*lines, spread, np.zeros((1, 2))]))
        labels = (plane["labels"][0] + ", N", plane["labels"][1] + ", N")
        out.append(axes(plane["title"], labels, limits, drawn, 20 if max(np.abs(limits)) < 100 else 50))
    for view, (title, labels) in enumerate((("reach of the thumb's tip, from the palm", ("ulnar, mm", "distal, mm")),
                                            ("reach of the thumb's tip, from the end", ("ulnar, mm", "dorsal, mm")))):
        drawn = ""
        for each, color in zip(both, COLORS):
            cells = "".join(f'<rect x="{x - 1.5}" y="{y - 1.5}" width="{width}" height="3"/>' for x, y, width in _runs(each["workspace"][view]))
            drawn += f'<g fill="{color}" fill-opacity="0.35">{cells}</g>'
        limits = _limits(np.vstack([np.array(each["workspace"][view], dtype=float) for each in both]))
        out.append(axes(title, labels, limits, drawn, 20))
    for joint in JOINTS[:4]:
        drawn = "".join(line(list(zip(WRIST, each["tenodesis"][joint])), color, False) for each, color in zip(both, COLORS))
        out.append(axes(f"rest of {joint}, muscles at rest", ("wrist flexion, deg", joint + " flexion, deg"), (-65, 65, -20, 105), drawn, 20, False))
    return out


def page(names: Sequence[str], both: Sequence[dict[str, Any]], people: dict[str, Measured]) -> str:
    """The whole page."""
    def cell(name: str) -> str:
        of = people.get(name, Measured("", False, ""))
        return f'<td title="{html.escape(of.source)}">{html.escape(of.text)}{", outside" if of.outside else ""}</td>'
    cells = "".join(f"<tr{' class=outside' if name in people and people[name].outside else ''}><td>{html.escape(name)}</td><td>{a:.1f}</td><td>{b:.1f}</td>"
                    f"<td>{_share(a, b)}</td><td>{unit}</td>{cell(name)}</tr>" for name, unit, a, b in table(names, both))
    legend = " ".join(f'<b style="color:{color}">{letter}: {html.escape(name)}</b>' for letter, name, color in zip("AB", names, COLORS))
    return ('<!doctype html><html lang="en"><meta charset="utf-8"><title>handsim compare</title><style>body{font:14px sans-serif;margin:2em;'
            "max-width:1320px}svg{font:11px sans-serif;margin:6px}td,th{padding:2px 10px;text-align:right}td:first-child{text-align:left}"
            "tr.outside{background:#fde2e2;color:#9b1c1c;font-weight:bold}"
            f"</style><h1>Two hands</h1><p>{legend}. Black: people, with one standard deviation.</p>{''.join(pictures(both))}"
            f"<table><tr><th></th><th>A</th><th>B</th><th>B over A</th><th></th><th>people</th></tr>{cells}</table>"
            "<p>Red rows lie outside the values of people by more than the spread of each: do not rely on them. People's values are forces of whole hands, "
            "or shares of them where B has lost what theirs had; the mouse on one shows its source (config/clinic.yaml).</p><p>Largest forces: nothing moves, each muscle gives 0 to all of its isometric force, moments of the fingers that press balance; "
            "the wrist is held, or balances, too. handsim is a research tool and gives no medical advice.</p></html>")


def sheet(names: Sequence[str], both: Sequence[dict[str, Any]], columns: int = 3) -> str:
    """All pictures in one SVG."""
    legend = "".join(f'<text x="{20 + 430 * k}" y="20" fill="{color}" font-weight="bold" font-size="14">{letter}: {html.escape(name)}</text>'
                     for k, (letter, name, color) in enumerate(zip("AB", names, COLORS)))
    return sheet_of(pictures(both), columns, legend)


def _share(a: float, b: float) -> str:
    return f"{b / a:.2f}" if abs(a) > 1e-9 else ""


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE, end="")
        return 0 if arguments else 2
    return ended(lambda: _work(arguments))


def _work(arguments: Sequence[str]) -> int:
    given, changes, out = _options(arguments)
    hands = [hand_of(given[0]), hand_of(given[-1], changes)]
    inputs = [*map(file_of, given), *(file for hand in hands for file in files_of(hand.scene))]
    names = [given[0], " ".join([*given[1:], *changes])]
    folder = None if out is None else OutputFolder(out, "compare.json", b'{"A": {"strength"', ["compare.html", "compare.svg"], inputs)
    with folder or nullcontext():
        both = [measure(hand) for hand in hands]
        people = measured(hands, table(names, both))
        if folder is not None:  # before the table, whose reader may close the pipe
            files = {"compare.json": json.dumps(dict(zip("AB", both))), "compare.html": page(names, both, people), "compare.svg": sheet(names, both)}
            folder.write({name: text.encode() for name, text in files.items()})
    print(f"A  {names[0]}\nB  {names[1]}\n\n{'':42}{'A':>9}{'B':>9}{'B/A':>8}")
    for name, unit, a, b in table(names, both):
        of = people.get(name)
        print(f"{name:42}{a:9.1f}{b:9.1f}{_share(a, b):>8}  {unit:3}" + (f"  people {of.text}{': OUTSIDE' if of.outside else ''}" if of else "").rstrip())
    if folder is not None:
        print(f"\n{folder.told(files)}")
    return 0


def _options(arguments: Sequence[str]) -> tuple[list[str], list[str], Optional[str]]:
    given, changes, out, rest = list[str](), list[str](), None, iter(arguments)
    for each in rest:
        name, equals, value = each.partition("=") if each.startswith("--") else (each, "", "")
        if name in ("--out", "--set"):
            value = value if equals else next(rest, "")
            if not value:
                raise input_error(name, "nothing", "a folder" if name == "--out" else "KEY=VALUE")
            if name == "--out":
                out = value
            else:
                changes.append(value)
        elif each.startswith("-"):
            raise input_error(each, "an unknown option", "--set KEY=VALUE or --out DIR")
        else:
            given.append(each)
    if len(given) not in (1, 2) or len(given) == 1 and not changes:
        raise input_error("compare", f"{len(given)} hands and {len(changes)} changes", "two persons or scenes, or one and --set KEY=VALUE")
    return given, changes, out
