"""``handsim object MESH``: an object of scenes from a mesh."""
from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any, Optional, Sequence

from ._errors import Error, Problem
from ._files import check_target, ended, path_of, read_options
from ._object import Object
from ._object_mesh import mm
from ._yaml import number_of

USAGE = """handsim object MESH --unit UNIT (--mass MASS | --density DENSITY) [--out OBJECT.yaml]

Makes an object of scenes of a mesh: reads STL, OBJ, PLY or glTF (.glb, .gltf), repairs what is certain and says it in mm, cuts what is not
convex into convex hulls within a stated error, which is measured, and finds mass, centre, inertia and principal axes of the mesh.
Needs trimesh, CoACD and fast-simplification: pip install "handsim[object]"

  --unit UNIT            of the file: um, mm, cm, m or in; glTF is in m
  --mass MASS            such as 200g
  --density DENSITY      in its place, such as "1000 kg/m3"
  --error LENGTH         largest distance between mesh and hulls; without it 1 % of the longest edge
  --hulls N              at most so many, to 200; without it 64
  --fill LENGTH          holes up to this size are filled; without it 2 % of the longest edge
  --drop LENGTH          separate parts up to this size are left out
  --largest              only the largest part is kept
  --material NAME        friction of foam, metal, plastic or wood
  --friction NUMBER      in its place
  --color RRGGBB         in pictures
  --sizes FACTOR ...     also writes the object thinner or thicker across its longest axis, of the same length and density: OBJECT_080.yaml is 0.8
                         times as thick
  --out OBJECT.yaml      writes the object file, and its hulls in OBJECT_hulls/ beside it
  --json                 prints what was found in SI

Example: handsim object handle.stl --unit mm --mass 200g --error 0.5mm --sizes 0.8 1.25 --out handle.yaml
"""
NUMBERS = {"--mass": "kg", "--density": "kg/m3", "--error": "m", "--fill": "m", "--drop": "m", "--friction": "", "--hulls": ""}
WORDS = ("--unit", "--material", "--color", "--out")


def _number(text: str, unit: str) -> Optional[float]:
    """SI of a number with a unit of the same dimension, with or without a blank between."""
    match = re.fullmatch(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*)", text.strip())
    value, given = (number_of(match[1]), match[2]) if match else (None, "")
    known = {"kg": ("kg", "g", "mg"), "m": ("m", "cm", "mm", "um"), "kg/m3": ("kg/m3", "g/cm3"), "": ()}[unit]
    if value is None or given and given not in known:
        return None
    return value if not given else number_of(f"{value!r} {given}")


def _work(options: dict[str, Any]) -> int:
    problems = list[Problem]()
    values: dict[str, Any] = {}
    for name, unit in NUMBERS.items():
        if name in options:
            value = _number(options[name], unit)
            if value is None or name == "--hulls" and value != int(value):
                problems.append(Problem(None, None, None, name, options[name], f"a number in {unit or '1'}" if name != "--hulls" else "a whole number"))
            else:
                values[name[2:]] = int(value) if name == "--hulls" else value
    sizes = list[float]()
    for text in options["--sizes"]:
        factor = number_of(text)
        if factor is None or not 0.1 <= factor <= 10:
            problems.append(Problem(None, None, None, "--sizes", text, "factors, 0.1 to 10"))
        else:
            sizes.append(factor)
    if options["--sizes"] and "--out" not in options:
        problems.append(Problem(None, None, None, "--sizes", "no --out", "--out beside it"))
    if problems:
        raise Error("\n".join(f"{each.key}: got {each.got}, need {each.need}" for each in problems), "input", problems)
    for name in ("--unit", "--material"):
        if name in options:
            values[name[2:]] = options[name]
    if "--color" in options:
        values["color"] = "#" + options["--color"].lstrip("#")
    source = path_of("MESH", options["MESH"])
    if "--out" in options:
        out: Path = check_target("--out", options["--out"], "object", [source])
        if out.suffix != ".yaml":
            raise Error(f"--out: got {out}, need a name that ends in .yaml", "input", [Problem(None, None, None, "--out", str(out), "a name that ends in .yaml")])
        others = {factor: check_target("--out", out.with_name(f"{out.stem}_{round(100 * factor):03d}.yaml"), "object", [source]) for factor in sizes}
    found = Object(source, largest="--largest" in options, **values)
    if "--json" in options:
        print(json.dumps(found.summary(), indent=1))
    else:
        _show(found)
    if "--out" in options:
        print(f"wrote {found.write(out)}", file=sys.stderr)
        for factor, path in others.items():
            print(f"wrote {found.thicker(factor).write(path)}", file=sys.stderr)
    return 0


def _show(found: Object) -> None:
    for note in found.notes:
        print(note)
    told = found.summary()
    print(f"mesh      {told['triangles']} triangles, {mm(told['size'])}, {1e6 * found.volume:.4g} cm3\n"
          f"mass      {1e3 * found.mass:.5g} g, centre at {', '.join(f'{round(1e3 * each, 9) + 0.0:.4g}' for each in found.centre)} mm")
    for moment, axis in zip(found.moments, found.axes.T):
        print(f"inertia   {1e7 * moment:.5g} g cm2 about {', '.join(f'{round(each, 9) + 0.0:.4f}' for each in axis)}")
    print(f"friction  {'0.8, that of scenes' if found.friction is None else f'{found.friction:g}'}\n"
          f"hulls     {told['hulls']} with {told['corners']} corners\n"
          f"error     {mm(found.error)}: the mesh stands out by {mm(told['uncovered'])}, the hulls by {mm(told['added'])} at most, at {found.samples} points")


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if not arguments or any(each in ("-h", "--help") for each in arguments):
        print(USAGE, end="")
        return 0 if arguments else 2
    return ended(lambda: _work(read_options("object", arguments, "MESH", ("--json", "--largest"), (*NUMBERS, *WORDS), (), lists=("--sizes",))))
