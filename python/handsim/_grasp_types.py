"""The types of grasps of handmodels/grasp_types.yaml, and whether the contacts of a hand are of one."""
from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Mapping, NamedTuple, Optional, Sequence

from ._shipped import data_path
from ._yaml import Document

FINGERS = ("thumb", "index", "middle", "ring", "little")
SEGMENTS = ("palm", "thumb_metacarpal", "thumb_proximal", "thumb_distal",
            *(f"{finger}_{part}" for finger in FINGERS[1:] for part in ("proximal", "middle", "distal")))
SIDES = ("palmar", "radial", "ulnar", "tip")
OBJECTS = ("long across", "long spread", "flat", "round", "any")
KEYS = ("number", "title", "class", "opposition", "thumb", "virtual_fingers", "size", "object", "sites", "about_normal", "open", "closed", "forces", "touches",
        "keeps_off")
TOUCH = 0.02
"""Share of the sum of normal forces from which a part counts as touching."""
LEANS = 0.1
"""Up to it a part that a type keeps off may lean against the object."""

Site = tuple[str, str]
"""A segment and its side."""


class GraspType(NamedTuple):
    """A type of the taxonomy of Feix et al. (2016)."""

    name: str
    number: int
    title: str
    force: str
    """``power``, ``intermediate`` or ``precision``."""
    opposition: str
    """``palm``, ``pad`` or ``side``."""
    thumb: str
    """``abducted`` or ``adducted``."""
    virtual_fingers: list[list[str]]
    """Parts of the hand that act as one."""
    size: tuple[float, float]
    """Of the object between the first two virtual fingers, in hand lengths."""
    object: str
    """How it lies: one of OBJECTS."""
    sites: Optional[tuple[list[Site], list[Site]]]
    """Segments of the first two virtual fingers that oppose each other; None: the palm and what closes on it."""
    about_normal: list[float]
    """Angles of the object about the palm's normal, of palm oppositions [rad]."""
    open: dict[str, list[float]]
    """By finger: flexion and abduction of its root, then the two joints beyond [rad]."""
    closed: dict[str, list[float]]
    forces: dict[str, float]
    """Normal forces that are asked of the reference person [N]."""
    touches: list[list[str]]
    """Of each group a part or segment touches."""
    keeps_off: list[str]

    def faults(self, forces: Mapping[str, float], size: Optional[float] = None) -> list[str]:
        """Why contacts are not of this type; none: they are.

        :param forces: normal force by segment [N]
        :param size: of the object between the virtual fingers, in hand lengths; None: not judged
        """
        total = sum(forces.values())
        if total <= 0:
            return ["nothing touches"]

        def share(part: str) -> float:
            return sum(force for name, force in forces.items() if name == part or name.startswith(part + "_")) / total

        out = [f"{' or '.join(group)} does not touch" for group in self.touches if all(share(part) < TOUCH for part in group)]
        out += [f"{part} bears {share(part):.0%}" for part in self.keeps_off if share(part) > LEANS]
        if size is not None and not self.size[0] <= size <= self.size[1]:
            out.append(f"{size:.2f} hand lengths across")
        return out


def _words(of: Document, key: str, known: Sequence[str], least: int = 1) -> list[str]:
    found = of.get(key)
    if not isinstance(found, list) or len(found) < least:
        of.wrong(key, "nothing" if found is None else repr(found)[:60], f"a list of {least} or more of " + ", ".join(known))
        return []
    return [of.choice(f"{key}.{i}", known) for i in range(len(found))]


def _lists(of: Document, key: str, known: Sequence[str], least: int) -> list[list[str]]:
    found = of.get(key)
    if not isinstance(found, list) or len(found) < least:
        of.wrong(key, "nothing" if found is None else repr(found)[:60], f"a list of {least} or more lists")
        return []
    return [_words(of, f"{key}.{i}", known) for i in range(len(found))]


def _pose(of: Document, key: str, unit: float) -> dict[str, list[float]]:
    of.keys(key, FINGERS)
    return {finger: [unit * angle for angle in of.reals(f"{key}.{finger}", 4)] for finger in FINGERS}


def _type(of: Document, name: str, unit: float) -> GraspType:
    key = f"types.{name}"
    of.keys(key, KEYS)
    low, high = of.reals(f"{key}.size", 2)
    if not 0 <= low < high <= 2:
        of.wrong(f"{key}.size", f"{low:g} to {high:g}", "a range within 0 to 2 hand lengths")
    opposition = of.choice(f"{key}.opposition", ("palm", "pad", "side"))
    sites = None
    if of.get(f"{key}.sites") is not None or opposition != "palm":
        pairs = _lists(of, f"{key}.sites", [f"{segment} {side}" for segment in SEGMENTS[1:] for side in SIDES], 2)
        split = [[(word.partition(" ")[0], word.partition(" ")[2]) for word in side] for side in pairs]
        sites = (split[0], split[1]) if len(split) == 2 else None
        if len(pairs) > 2:
            of.wrong(f"{key}.sites", f"{len(pairs)} lists", "two")
    about = of.get(f"{key}.about_normal", [])
    if not isinstance(about, list):
        of.wrong(f"{key}.about_normal", repr(about)[:60], "a list of angles")
        about = []
    of.keys(f"{key}.forces", FINGERS)
    forces = {finger: of.real(f"{key}.forces.{finger}", None, 0, 1000) for finger in FINGERS if of.get(f"{key}.forces.{finger}") is not None}
    parts = ("palm", *FINGERS, *SEGMENTS[1:])
    number = of.real(f"{key}.number", None, 1, 999)
    if number != int(number):
        of.wrong(f"{key}.number", number, "a whole number")
    title = of.get(f"{key}.title")
    if not isinstance(title, str):
        of.wrong(f"{key}.title", "nothing" if title is None else repr(title)[:60], "a text")
    return GraspType(name, int(number), str(title), of.choice(f"{key}.class", ("power", "intermediate", "precision")), opposition,
                     of.choice(f"{key}.thumb", ("abducted", "adducted")), _lists(of, f"{key}.virtual_fingers", ("palm", *FINGERS), 2), (low, high),
                     of.choice(f"{key}.object", OBJECTS), sites, [unit * of.real(f"{key}.about_normal.{i}", None) for i in range(len(about))] or [0.0],
                     _pose(of, f"{key}.open", unit), _pose(of, f"{key}.closed", unit), forces, _lists(of, f"{key}.touches", parts, 1),
                     _words(of, f"{key}.keeps_off", parts) if of.get(f"{key}.keeps_off") is not None else [])


def read_types(path: Optional[Path] = None) -> dict[str, GraspType]:
    """The types of a file by name, in its order; None: the shipped ones. :raises Error: of kind input with every problem and its place"""
    of = Document(data_path() / "handmodels/grasp_types.yaml" if path is None else path)
    of.keys("", ("title", "source", "unit", "types"))
    unit = {"deg": math.pi / 180, "rad": 1.0}[of.choice("unit", ("deg", "rad"))]
    types: Any = of.get("types")
    if not isinstance(types, dict) or not types:
        of.wrong("types", "nothing" if types is None else repr(types)[:60], "a mapping of names to types")
        types = {}
    out = {}
    for name in types:
        if not isinstance(name, str) or not name.replace("_", "").isalnum():
            of.wrong(f"types.{name}", "this name", "letters, digits and _")
        else:
            out[name] = _type(of, name, unit)
    numbers = [each.number for each in out.values()]
    for name, each in out.items():
        if numbers.count(each.number) > 1:
            of.wrong(f"types.{name}.number", each.number, "another number for each type")
    of.finish()
    return out
