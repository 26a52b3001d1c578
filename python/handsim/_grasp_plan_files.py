"""Files of a plan of grasps: a table of all that was tried, a scene of each grasp, a sheet of pictures; and what the command prints."""
from __future__ import annotations

import json
import math
from typing import Any, Mapping, Optional, Sequence

import numpy as np

from . import _core
from ._files import OutputFolder, PathText
from ._grasp_plan import Grasp, Plan
from ._grasp_types import FINGERS
from ._model import quaternion_of
from ._pictures import contact_sheet, png
from ._study_files import number, quoted

MOST = 99
"""Grasps of a plan."""
PARTS = ("palm", *FINGERS)
HEAD = ("rank,scene,type,number,held,why,outcome,margin,outcome_half_step,margin_half_step,outcome_ode,margin_ode,effort,least_effort,unnatural[deg],"
        "thickness[mm]," + ",".join(f"{part}[N]" for part in PARTS) + ",x[m],y[m],z[m],qw,qx,qy,qz")
SIZE = (480, 360)


def scene_text(content: Mapping[str, Any]) -> str:
    """A scene's content as YAML: a line for each item."""
    lines = []
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
        "" if rank is None else str(rank), "" if rank is None else scene_name(rank), of.name, str(of.number), str(int(grasp.held)), quoted(grasp.reason) if grasp.reason else "",
        grasp.outcome, _cell(grasp.margin), grasp.outcome_half, _cell(grasp.margin_half), grasp.outcome_ode, _cell(grasp.margin_ode), _cell(grasp.effort),
        _cell(grasp.least_effort), _cell(grasp.unnatural, 180 / math.pi), _cell(place.thickness, 1e3), *(_cell(forces.get(part)) for part in PARTS),
        *(number(round(float(x), 6)) for x in (*place.position, *turn))])


def table_text(plan: Plan) -> str:
    """Grasps by rank, then all others in the order in which they were tried."""
    places = [id(grasp.place) for grasp in plan.grasps]
    rows = [_row(grasp, rank + 1) for rank, grasp in enumerate(plan.grasps)]
    rows += [_row(grasp, None) for grasp in plan.tried if id(grasp.place) not in places]
    return "\n".join([HEAD, *rows]) + "\n"


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
    told = ""
    if nearest is not None and nearest.margin is not None:
        told = f"; nearest: {nearest.type.name}, {nearest.reason}, {-100 * nearest.margin:.0f} % beyond the limit" if nearest.margin < 0 else (
            f"; nearest: {nearest.type.name}, {nearest.reason}")
    return f"no grasp of {plan.object.name} by a hand of {1e3 * plan.hand_length:.0f} mm and {plan.grip_strength:.0f} N{told}\n"


def folder_of(out: PathText, inputs: Sequence[PathText]) -> OutputFolder:
    """Of a plan, before it is made. :raises Error: of kind input where it cannot be written"""
    return OutputFolder(out, "grasps.csv", HEAD.encode(), ["contact_sheet.png", *(scene_name(rank) for rank in range(1, MOST + 1))], inputs)


def write(plan: Plan, folder: OutputFolder) -> list[str]:
    """Writes the files of a plan. :returns: what could not be made"""
    missing = list[str]()
    files = {"grasps.csv": table_text(plan).encode()}
    files.update({scene_name(rank + 1): scene_text(grasp.content).encode() for rank, grasp in enumerate(plan.grasps)})
    if plan.grasps and _core.has_pictures():
        files["contact_sheet.png"] = png(sheet(plan, f"grasps of {plan.object.stem}"))
    elif plan.grasps:
        missing.append("contact_sheet.png: a build without pictures")
    folder.write(files)
    return missing
