"""Files of a plan of grasps: a table of all that was tried, a scene of each grasp, a sheet of pictures; and what the command prints."""
from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any, Mapping, Optional, Sequence

import numpy as np

from . import _core
from ._files import OutputFolder, PathText
from ._grasp_plan import Grasp, Plan, named
from ._grasp_types import FINGERS
from ._model import quaternion_of
from ._pictures import contact_sheet, png
from ._study_files import number, quoted

MOST = 99
"""Grasps of a plan."""
PARTS = ("palm", *FINGERS)
HEAD = ("rank,scene,type,number,held,code,why,lacking,outcome,margin,outcome_half_step,margin_half_step,outcome_ode,margin_ode,effort,least_effort,unnatural[deg],"
        "thickness[mm]," + ",".join(f"{part}[N]" for part in PARTS) + ",x[m],y[m],z[m],qw,qx,qy,qz")
SIZE = (480, 360)
STUDY, PAGE, REFUSALS = "who.yaml", "best.html", "refusals.csv"
PERSONS = ("small_woman", "median_woman", "small_man", "median_man", "large_woman", "large_man")
"""Of the study: from the 5th percentile of women to the 95th of men."""
FRICTION = (0.4, 1.0)
"""Of the study: of skin from moist to dry on smooth and rough surfaces, drawn evenly."""
DRAWS = 5
"""Of friction for each person and object."""


def scene_text(content: Mapping[str, Any], folder: Path) -> str:
    """A scene's content as YAML: a line for each item. Object and person are named relative to the folder in which it will lie."""
    def relative(of: Mapping[str, Any], key: str) -> dict[str, Any]:
        value = of[key]
        return {**of, key: os.path.relpath(value, folder.resolve()) if isinstance(value, str) and os.path.isabs(value) else value}

    lines = []
    content = {**content, "hands": [relative(each, "person") for each in content["hands"]], "objects": [relative(each, "file") for each in content["objects"]]}
    for key, value in content.items():
        if not isinstance(value, list) or not value or not isinstance(value[0], dict):
            lines.append(f"{key}: {json.dumps(value)}")
            continue
        lines.append(f"{key}:")
        for each in value:
            if key == "grasps":
                lines += [f"  {'- ' if i == 0 else '  '}{name}: {json.dumps(of)}" for i, (name, of) in enumerate(each.items())]
            else:
                lines.append(f"  - {json.dumps(each)}")
    return "\n".join(lines) + "\n"


def study_text(plan: Plan, folder: Path) -> str:
    """Who can hold it? A study of rollouts: the best grasp, fitted to persons, on the objects."""
    vary: dict[str, Any] = {"hands.0.person": {"each": list(PERSONS)}}
    if plan.others:
        files = [named(each, "config/objects") for each in (plan.object, *plan.others)]
        vary["objects.0.file"] = {"each": [os.path.relpath(each, folder.resolve()) if os.path.isabs(each) else each for each in files]}
    vary["contacts.materials.0.friction"] = {"uniform": list(FRICTION)}
    forces = [f"force.{part}" for part in (*FINGERS, "palm")]
    content = {"title": f"who can hold {plan.object.stem} so: {plan.grasps[0].type.name}", "scene": scene_name(1), "count": DRAWS, "seed": 1, "vary": vary,
               "outcome": ["margin", *forces[:-1]], "stop": {"lost": True},
               "record": {"figures": ["margin", "outcome", "friction_used", "normal_force[N]", *(f"{force}[N]" for force in forces)]}}
    lines = ["# Who can hold it? handsim rollouts who.yaml --report"]
    for key, value in content.items():
        lines += [f"{key}:", *(f"  {name}: {json.dumps(of)}" for name, of in vary.items())] if key == "vary" else [f"{key}: {json.dumps(value)}"]
    return "\n".join(lines) + "\n"


def scene_name(rank: int) -> str:
    return f"grasp_{rank:02d}.yaml"


def forces_by_part(grasp: Grasp) -> dict[str, float]:
    """Normal forces of the palm and of each finger [N]; the metacarpal is the thumb's."""
    return {part: sum(force for segment, force in grasp.forces.items() if segment == part or segment.startswith(part + "_")) for part in PARTS}


def _cell(value: Optional[float], scale: float = 1.0) -> str:
    return "" if value is None else f"{scale * value:.5g}"


def _row(grasp: Grasp, rank: Optional[int]) -> str:
    of, place = grasp.type, grasp.place
    forces = forces_by_part(grasp) if grasp.forces else dict[str, float]()
    turn = quaternion_of(place.turn)
    return ",".join([
        "" if rank is None else str(rank), "" if rank is None else scene_name(rank), of.name, str(of.number), str(int(grasp.held)), grasp.code, quoted(grasp.reason) if grasp.reason else "",
        _cell(grasp.lacking),
        grasp.outcome, _cell(grasp.margin), grasp.outcome_half, _cell(grasp.margin_half), grasp.outcome_ode, _cell(grasp.margin_ode), _cell(grasp.effort),
        _cell(grasp.least_effort), _cell(grasp.unnatural, 180 / math.pi), _cell(place.thickness, 1e3), *(_cell(forces.get(part)) for part in PARTS),
        *(number(round(float(x), 6)) for x in (*place.position, *turn))])


def table_text(plan: Plan) -> str:
    """Grasps by rank, then all others in the order in which they were tried."""
    places = [id(grasp.place) for grasp in plan.grasps]
    rows = [_row(grasp, rank + 1) for rank, grasp in enumerate(plan.grasps)]
    rows += [_row(grasp, None) for grasp in plan.tried if id(grasp.place) not in places]
    return "\n".join([HEAD, *rows]) + "\n"


def refusals_text(plan: Plan) -> str:
    """How many places of a type are no grasp for one reason."""
    return "type,tried,code,places,why\n" + "".join(f"{each.type},{int(each.tried)},{each.code},{each.places},{quoted(each.why)}\n" for each in plan.refusals())


def sheet(plan: Plan, title: str) -> "np.ndarray[Any, np.dtype[np.uint8]]":
    """A picture of each grasp at the end of its hold. :raises Error: of kind input in a build without pictures"""
    pictures = [grasp.scene().draw_frames([grasp.frame], size=SIZE)[0] for grasp in plan.grasps]
    captions = [f"{rank + 1}: {grasp.type.name}, margin {100 * (grasp.margin or 0):.0f} %" for rank, grasp in enumerate(plan.grasps)]
    return contact_sheet(pictures, captions, title, 4 * SIZE[0])


def screen_text(plan: Plan) -> str:
    """What the command prints."""
    line = "{:>4} {:<24} {:>8} {:>9} {:>8} {:>8} {:>9}  {}\n".format
    out = line("rank", "type", "margin", "half step", "effort", "least", "unnatural", "ODE") + line("", "", "%", "%", "%", "%", "deg", "")
    for rank, grasp in enumerate(plan.grasps):
        figures = [f"{scale * value:.0f}" if value is not None else "-" for value, scale in (
            (grasp.margin, 100), (grasp.margin_half, 100), (grasp.effort, 100), (grasp.least_effort, 100), (grasp.unnatural, 180 / math.pi))]
        out += line(rank + 1, grasp.type.name, *figures, grasp.outcome_ode or "-")
    return (out if plan.grasps else no_grasp_text(plan)) + "".join(f"  {why}\n" for why in plan.why())


def no_grasp_text(plan: Plan) -> str:
    nearest = plan.nearest()
    told = "" if nearest is None else f"; nearest: {nearest.type.name}, {nearest.reason}"
    if nearest is not None and nearest.margin is not None and nearest.margin < 0:
        told += f", {-100 * nearest.margin:.0f} % beyond the limit"
    if nearest is not None and nearest.lacking is not None:
        told += f", which need {nearest.lacking:.2g} times its force"
    return f"no grasp of {plan.object.name} by a hand of {1e3 * plan.hand_length:.0f} mm and {plan.grip_strength:.0f} N{told}\n"


def folder_of(out: PathText, inputs: Sequence[PathText]) -> OutputFolder:
    """Of a plan, before it is made. :raises Error: of kind input where it cannot be written"""
    return OutputFolder(out, "grasps.csv", HEAD.encode(), ["contact_sheet.png", STUDY, PAGE, REFUSALS, *(scene_name(rank) for rank in range(1, MOST + 1))], inputs)


def write(plan: Plan, folder: OutputFolder, report: bool) -> list[str]:
    """Writes the files of a plan. :param report: the page of the best grasp, too. :returns: what could not be made"""
    missing = list[str]()
    files = {"grasps.csv": table_text(plan).encode(), REFUSALS: refusals_text(plan).encode()}
    files.update({scene_name(rank + 1): scene_text(grasp.content, folder.path).encode() for rank, grasp in enumerate(plan.grasps)})
    if plan.grasps:
        files[STUDY] = study_text(plan, folder.path).encode()
    if plan.grasps and report:
        files[PAGE] = plan.grasps[0].scene().run(frames=0, progress=False).report().encode()
    if plan.grasps and _core.has_pictures():
        files["contact_sheet.png"] = png(sheet(plan, f"grasps of {plan.object.stem}"))
    elif plan.grasps:
        missing.append("contact_sheet.png: a build without pictures")
    folder.write(files)
    return missing
