"""``handsim hand``: what a person's hands are like, as a table, YAML and a picture; drawn hands, and percentiles of a population."""
from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np

from . import _core
from ._errors import Error, input_error
from ._files import ended, read_options
from ._model import Array, HandParts, Joint, Model, Shape, product
from ._pictures import png
from ._scene import Scene, files_of
from ._shipped import find_file
from ._statistics import owners_text, quantile, uncertainty_of
from ._study_files import number, real_of, warn, whole_option

USAGE = """handsim hand [--stature H --mass M --sex SEX]

Hands of a person: dimensions, masses, joints (docs/persons.md).

  --stature H                    body height: 1.75, "175 cm"
  --mass M                       of the body [kg]
  --sex SEX                      male, female or unknown
  --age YEARS                    without it a body of a child's size has a child's hand
  --hand-length L                measured: wrist crease to middle fingertip [m]
  --hand-breadth B               measured: across the knuckles [m]
  --hand-circumference C         measured: around the knuckles [m]
  --hand-mass M                  measured [kg]
  --hand-length-percentile P     among people of this stature, mass and sex, 0.01 to 99.99
  --person PERSON                person file, or the name of a shipped one, in place of all these
  --model MODEL                  hand model file, or the name of a shipped one; the anatomical hand
  --side SIDE                    right, left or both; both
  --uncertain N                  draws as many hands within what is uncertain of this one: all figures with intervals, and which inputs own
                                 their variance
  --population POPULATION        ansur2, in place of a person: percentiles of its hands; with --sex of men or women alone
  --percentile P ...             these percentiles; 5, 50 and 95
  --out DIR                      writes hand.yaml and hand.png

Example: handsim hand --stature 1.75 --mass 72 --sex male --side both --out out/hand
"""
MEASURES = ("--stature", "--mass", "--sex", "--age", "--hand-length", "--hand-breadth", "--hand-circumference", "--hand-mass", "--hand-length-percentile")
"""Keys of a person file."""
DEGREES = 180 / math.pi
MOST_HANDS, PEOPLE = 1_000_000, 4000
"""Drawn with --uncertain at most, and of a population."""
SIZES = ("length", "breadth", "palm length", "circumference", "thickness")
HEAD = """# SI units; positions in the hand frame (origin at the wrist joint centre, y distal, z dorsal), fingers
# straight; inertias about the centre of mass along the segment's x, y (distal) and z axes.
"""


class JointFacts(NamedTuple):
    name: str
    type: str
    axes: list[tuple[str, Optional[float], Optional[float]]]
    """Name and stop [rad] of each; None: it has none."""

    def ranges(self) -> str:
        ends = [(name, -180.0 if low is None else low * DEGREES, 180.0 if high is None else high * DEGREES) for name, low, high in self.axes]
        return ", ".join(f"{name} {low:.0f}..{high:.0f}" for name, low, high in ends) + " deg"


class Segment(NamedTuple):
    """A row of the hand model."""

    name: str
    carrier: bool
    """Has no size: a body between two joints of a joint of three axes."""
    length: float
    """m"""
    radius: float
    """m"""
    body: int
    joint: Optional[JointFacts]
    """None: it is a part of its parent's body."""


class Facts:
    """Of the first hand of a scene, right, and of its person: src/handsim/python/hand.cpp gives them."""

    def __init__(self, scene: Scene) -> None:
        of = _core.hand_facts(scene._core)
        self.size: dict[str, float] = {name.partition("[")[0]: value for name, value in _core.hand_dimensions(scene._core).items()}
        self.shares: dict[str, float] = _core.whole_hand(scene._core)
        self.stature: float = of["stature"]
        self.mass: float = of["mass"]
        self.sex: str = of["sex"]
        self.age: Optional[float] = of["age"]
        self.weighed: bool = of["weighed"]
        """The hand's mass is measured."""
        self.measured: list[bool] = of["measured"]
        """Of the first SIZES."""
        self.fingers: dict[str, float] = of["fingers"]
        """Measured lengths [m]."""
        self.rule: tuple[str, float, float, str] = of["rule"]
        """The hand model's for the mass: kind, share of body mass, density [kg/m^3] and source."""
        self.survey: str = of["survey"]
        self.palm: tuple[list[float], float, int] = of["palm"]
        """Edges of the box about it [m], its volume [m^3], and how many shapes it has."""
        self.bodies: list[tuple[str, float, list[float]]] = of["bodies"]
        """Name, mass [kg] and moments of inertia [kg m^2]; the palm first."""
        self.segments = [Segment(name, carrier, length, radius, body, None if joint is None else JointFacts(*joint))
                         for name, carrier, length, radius, body, joint in of["segments"]]
        self.wrist = JointFacts(*of["wrist"])
        self.reference: tuple[str, float, float, float, float] = of["reference"]
        """Source; centre of mass and radii of gyration, in shares of hand length."""
        self.title: str = of["title"]
        self.sources: dict[str, str] = of["sources"]
        self.uncertain: list[str] = of["uncertain"]
        """Names of the deviations that change this hand."""


def _origin(measured: bool) -> str:
    return "measured" if measured else "predicted"


def _mass_rule(of: Facts) -> str:
    """With its source."""
    kind, share, density, source = of.rule
    source = f": {source}" if source else ""
    if kind == "share":
        whom = {"male": "men", "female": "women"}.get(of.sex, "people of unknown sex")
        return f"{100 * share:g} % of body mass, as of {whom}{source}"
    return f"{'its volume ' if kind == 'tissue' else ''}at {density:g} kg/m3{source}"


def size_text(of: Facts) -> str:
    def row(name: str, value: float, origin: str) -> str:
        return f"  {name:<18} {1e3 * value:7.1f} mm  {origin}\n"

    out = f"person   {of.stature:.3f} m, {of.mass:.1f} kg, {of.sex}{'' if of.age is None else f', {of.age:g} years'}\n"
    for i, name in enumerate(SIZES):
        slab = "of a slab with half-round edges of that breadth and circumference"
        out += row(f"hand {name}" if name != "palm length" else name, of.size[name.replace(" ", "_")],
                   slab if name == "thickness" else _origin(name != "palm length" and of.measured[i]))
    for finger in sorted(name.removesuffix("_length") for name in of.size if name in ("thumb_length", "index_length", "middle_length")):
        out += row(f"{finger} length", of.size[f"{finger}_length"], f"{_origin(finger in of.fingers)}, crease at the base to tip")
    return (f"{out}  {'hand mass':<18} {1e3 * of.size['mass']:7.1f} g   {100 * of.size['mass'] / of.mass:.2f} % of body mass; "
            f"{'measured' if of.weighed else _mass_rule(of)}\n  predicted from: {of.survey}\n")


def _moments(inertia: Sequence[float]) -> str:
    return ", ".join(f"{1e6 * each:9.4g}" for each in inertia)


def _palm_text(of: Facts) -> str:
    (name, mass, inertia), (edges, volume, shapes) = of.bodies[0], of.palm
    x, y, z = (1e3 * each for each in edges)
    return (f"{name:<18} {f'{x:.1f} x {y:.1f} x {z:.1f}':>21} {1e3 * mass:8.2f}  {_moments(inertia)}  {'box' if shapes == 1 else f'{shapes} shapes'} "
            f"(breadth, length, thickness), {1e6 * volume:.0f} cm3, {mass / volume:.0f} kg/m3\n")


def parts_text(of: Facts) -> str:
    out = f"\n{'segment':<18} {'length mm':>10} {'radius mm':>10} {'mass g':>8}  {'inertia kg mm2 (x, y, z)':>31}  joint\n{_palm_text(of)}"
    for each in of.segments:
        name, mass, inertia = of.bodies[each.body]
        # The mass of a fixed segment is in that of its parent's body.
        joint = f"{each.joint.name} ({each.joint.type}: {each.joint.ranges()})" if each.joint else f"fixed to {name}"
        out += (f"{each.name:<18} {1e3 * each.length:10.2f} {1e3 * each.radius:10.2f} {f'{1e3 * mass:.2f}' if each.joint else '':>8}  "
                f"{_moments(inertia) if each.joint else '':>31}  {joint}\n")
    return f"{out}wrist: {len(of.wrist.axes)} axes ({of.wrist.ranges()})\n"


def whole_text(of: Facts) -> str:
    source, *reference = of.reference
    rows = zip(("centre of mass from the wrist", *(f"radius of gyration, {axis} axis" for axis in ("sagittal", "transverse", "longitudinal"))),
               (of.shares[name] for name in ("centre_of_mass", "sagittal", "transverse", "longitudinal")), reference)
    return (f"\nwhole hand, fingers straight, in shares of hand length (reference: {source}, {'women' if of.sex == 'female' else 'men'})\n"
            + "".join(f"  {name:<42} {ours:.4f}  reference {theirs:.4f}\n" for name, ours, theirs in rows))


def sources_text(of: Facts) -> str:
    return (f"\nsources ({of.title})\n" if of.sources else "") + "".join(f"  {key}: {text}\n" for key, text in of.sources.items())


# Drawn hands.

def figures_of(scene: Scene, of: Facts, persons: Sequence[Optional[tuple[float, float, str]]]) -> tuple[dict[str, Array], list[tuple[str, Array]]]:
    """Figures of drawn hands, by name with unit: one of each person, within what is uncertain. And the inputs' deviations.

    :param persons: stature [m], mass [kg] and sex; None: the scene's
    """
    deviations = [{name: _core.normal(1, i, name) for name in of.uncertain} for i in range(len(persons))]
    names = [(f"hand {name} [mm]" if name != "palm length" else f"{name} [mm]", 1e3) for name in SIZES] + [("hand mass [g]", 1e3)]
    names += [(f"{each.name} [mm]", 1e3) for each in of.segments if not each.carrier]
    names += [(f"{each.joint.name}.{axis} to [deg]", DEGREES) for each in of.segments if each.joint for axis, _, high in each.joint.axes if high is not None]
    values = _core.hand_figures(scene._core, list(zip(persons, deviations)))
    return ({name: scale * column for (name, scale), column in zip(names, values.T)},
            [(name, np.array([each[name] for each in deviations])) for name in of.uncertain])


def uncertain_text(scene: Scene, of: Facts, count: int) -> str:
    figures, inputs = figures_of(scene, of, [None] * count)
    out = f"\n{count} hands within what is uncertain of this person\n  {'figure':<32} {'mean':>8}  {'nine in ten':<18} variance of\n"
    for name, values in figures.items():
        found = uncertainty_of(inputs, values)
        out += f"  {name:<32} {found.mean:>8.4g}  {f'{found.low:.4g} to {found.high:.4g}':<18} {owners_text(found.variance)}\n"
    return out


def population_text(scene: Scene, population: str, sex: str, percentiles: Sequence[float]) -> str:
    """Percentiles of every figure over people of a population, each with a hand within what is uncertain of it.

    :param scene: with a hand of the model
    :param sex: unknown: women and men with equal chances
    """
    people = _core.draw_persons(population, PEOPLE, 1, None if sex == "unknown" else sex == "male")
    figures, _ = figures_of(scene, Facts(scene), people)
    whom = {"male": "men", "female": "women"}.get(sex, "men and women in equal numbers")
    out = f"{population}, {whom}: percentiles of the hands of {PEOPLE} drawn people\n  {'figure':<32}"
    out += "".join(f" {f'{each:g} %':>8}" for each in percentiles) + "\n"
    for name, values in figures.items():
        ordered = np.sort(values)
        out += f"  {name:<32}" + "".join(f" {quantile(ordered, 0.01 * each):>8.4g}" for each in percentiles) + "\n"
    return out


# hand.yaml.

def _turned(q: Array, v: Array) -> Array:
    """In the program's own order of operations: the same digits."""
    across = np.cross(q[1:], v)
    across += across
    out: Array = v + q[0] * across + np.cross(q[1:], across)
    return out


def _at(x: Array, point: Array) -> Array:
    """A point of a frame with pose x in the outer frame."""
    out: Array = x[:3] + _turned(x[3:], point)
    return out


def _to_hand(model: Model, hand: HandParts) -> Array:
    """Pose of the world in the hand frame."""
    palm = model.bodies[hand.palm].zero
    back = product(palm[3:], hand.wrist[3:]) * [1, -1, -1, -1]
    back /= np.sqrt(np.sum(back * back))
    return np.concatenate([-_turned(back, _at(palm, hand.wrist[:3])), back])


def _vector(values: Any) -> str:
    return f"[{', '.join(number(each) for each in values)}]"


def _joint_lines(joint: Joint) -> list[str]:
    out = ["joint:", f"  name: {joint.name}", f"  type: {joint.kind}", "  axes:"]
    for axis in joint.axes:
        out += [f"    - name: {axis.name}", f"      axis: {_vector(axis.axis)}"]
        if math.isfinite(axis.low) and math.isfinite(axis.high):
            out.append(f"      range: {_vector((axis.low, axis.high))}")
    return out


def _shape_lines(shape: Shape) -> list[str]:
    """In the body's frame: a capsule by its ends, a box by its edges."""
    if shape.kind == "box":
        return [f"  - name: {shape.name}", f"    centre: {_vector(shape.pose[:3])}", f"    edges: {_vector(shape.edges)}"]
    half = 0.5 * shape.length * _turned(shape.pose[3:], np.array([0.0, 0, 1]))
    return [f"  - name: {shape.name}", f"    from: {_vector(shape.pose[:3] - half)}", f"    to: {_vector(shape.pose[:3] + half)}",
            f"    radius: {number(shape.radius)}"]


def _body_lines(of: Facts, model: Model, hand: HandParts, index: int) -> list[str]:
    body, to_hand = model.bodies[hand.bodies[index]], _to_hand(model, hand)
    out = [f"name: {body.name}", f"mass: {number(body.mass)}", f"inertia: {_vector(np.diagonal(body.inertia))}",
           f"centre_of_mass: {_vector(_at(to_hand, body.zero[:3]))}"]
    if index == 0:
        out.append(f"edges: {_vector(of.palm[0])}")
    for segment in (each for each in of.segments if each.joint and each.body == index):
        joint = next(joint for joint in (model.joints[i] for i in hand.joints) if joint.child == hand.bodies[index])
        centre = _at(to_hand, _at(body.zero, joint.child_frame[:3]))
        out += [f"length: {number(segment.length)}", f"radius: {number(segment.radius)}", f"joint_centre: {_vector(centre)}", *_joint_lines(joint)]
    shapes = [line for shape in model.shapes if shape.body == hand.bodies[index] for line in _shape_lines(shape)]
    return [*out, "shapes:", *shapes] if shapes else [*out, "shapes: []"]


def yaml_text(scene: Scene, of: Facts) -> str:
    """Bodies of each hand in its hand frame, SI."""
    person = {"stature": number(of.stature), "mass": number(of.mass), "sex": of.sex}
    sizes = {name: number(of.size[name]) for name in ("length", "breadth", "palm_length", "circumference", "thickness", "mass")}
    lines = [f"title: {json.dumps(of.title, ensure_ascii=False)}"]
    for key, values in (("person", person), ("hand", sizes)):
        lines += [f"{key}:", *(f"  {name}: {value}" for name, value in values.items())]
    for hand in scene._model.hands:
        lines.append(f"{hand.name}:")
        for index in range(len(hand.bodies)):
            lines += [f"{'    ' if i else '  - '}{line}" for i, line in enumerate(_body_lines(of, scene._model, hand, index))]
    return HEAD + "\n".join(lines) + "\n"


# The command.

def _percentiles(texts: Sequence[str]) -> list[float]:
    return [real_of("--percentile", text, 0, 100, "a percentile, 0 to 100") for text in texts] or [5.0, 50.0, 95.0]


def _hands(person: Optional[Path], measures: dict[str, str], model: Optional[Path], side: str) -> Scene:
    core, warnings = _core.person_hands(person, {key[2:].replace("-", "_"): value for key, value in measures.items()}, model, side, "fixed", False)
    warn(warnings)
    return Scene(core)


def _of_population(options: dict[str, Any], measures: dict[str, str], model: Optional[Path]) -> int:
    for name in ("--person", "--out", "--uncertain"):
        if name in options:
            raise input_error("--population", "a population beside --person, --out or --uncertain", "one of them")
    for name in measures:
        if name != "--sex":
            raise input_error(name, "a value beside --population", "one of the two")
    sex = measures.get("--sex", "unknown")
    scene = _hands(None, {"--stature": "1.75", "--mass": "72", "--sex": sex}, model, "right")
    print(population_text(scene, options["--population"], sex, _percentiles(options["--percentile"])), end="")
    return 0


def _write(scene: Scene, of: Facts, out: Path, folder: _core.OutputFolder) -> int:
    folder.clear()
    _core.write_file(out / "hand.yaml", yaml_text(scene, of).encode())
    missing = ""
    try:
        _core.write_file(out / "hand.png", png(scene.draw()))
    except Error as error:
        missing = str(error)
        print(f"missing: hand.png: {missing}", file=sys.stderr)
    print(f"\nwritten: {out / 'hand.yaml'}{'' if missing else ' and hand.png'}")
    return 1 if missing else 0


def _work(options: dict[str, Any]) -> int:
    count = whole_option(options, "--uncertain", 2, MOST_HANDS, "a whole number of hands")
    side = options.get("--side", "both")
    if side not in ("right", "left", "both"):
        raise input_error("--side", side, "one of right, left, both")
    person = find_file(options["--person"], "--person", "config/persons") if "--person" in options else None
    model = find_file(options["--model"], "--model", "handmodels") if "--model" in options else None
    measures = {name: options[name] for name in MEASURES if name in options}
    if "--population" in options:
        return _of_population(options, measures, model)
    if options["--percentile"]:
        raise input_error("--percentile", "a percentile of one person", "--population beside it")
    scene = _hands(person, measures, model, side)
    out = Path(options["--out"]) if "--out" in options else None
    folder = None if out is None else _core.output_folder(out, ["hand.yaml", "hand.png"], files_of(scene))
    of = Facts(scene)
    print(size_text(of) + parts_text(of) + whole_text(of) + "".join(line + "\n" for line in _core.overlap_texts(scene._core)), end="", flush=True)
    if count is not None:
        print(uncertain_text(scene, of, count), end="")
    print(sources_text(of), end="")
    return 0 if out is None or folder is None else _write(scene, of, out, folder)


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if any(each in ("-h", "--help") for each in arguments):
        print(USAGE, end="")
        return 0
    values = (*MEASURES, "--person", "--model", "--side", "--uncertain", "--population", "--out")
    return ended(lambda: _work(read_options("hand", arguments, "", (), values, (), 0, 0, lists=("--percentile",))))
