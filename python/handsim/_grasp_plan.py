"""Grasps of an object by a person's hand, planned: `handsim grasp plan` and `handsim.grasps`.

Places of _grasp_places.py are tried from the one of least cost on, of all types by turns: the grip is fitted to the hand when the scene is
compiled, which refuses most; the others are run on the articulated engine, closed, lifted, held and shaken, those that are held again at half the
step. What is held is judged by its contacts: are they those of the type? Nothing is random, and rounds have the same places whatever the number
of threads, so that the list is the same on every machine.
"""
from __future__ import annotations

import math
import os
import re
from concurrent.futures import ThreadPoolExecutor
from os import PathLike
from pathlib import Path
from typing import Any, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Error, input_error
from ._grasp_places import LEFT_OUT, Place, Posed, Search, Solid
from ._grasp_types import FINGERS, GraspType, read_types
from ._hand import Hand
from ._object import axis_and_angle
from ._objects import of_scene
from ._progress import Told
from ._scene import Scene, load
from ._shipped import data_path, find_file
from ._simulation import Simulation

Array = NDArray[np.float64]
ROUND = 8
"""Places that are tried before the next are chosen."""
EACH = 10
"""Places of a type, at most."""
SPARE = 1.5
"""Grasps that are found for each that is asked for, so that the best can be chosen."""
TRIES = 12
"""Places that are tried for each grasp that is asked for, at most, and at least LEAST_TRIES."""
LEAST_TRIES = 60
APART, TURNED = 0.02, math.radians(25)
"""Two grasps of a type are different from this distance [m] or this angle on."""
NEXT = 0.01
"""So far apart are places of a type that are tried [m]: a fingertip touches with another segment."""
HEIGHT = 0.35
"""Of the object's centre in the scenes [m]."""
WAY = 0.1
"""Of the approach [m]."""
HOLD = 0.6
"""[s]"""
SHAKE = {"acceleration": "19.6 m/s2", "frequency": "5 Hz"}
RESERVES = (1.25, 1.6)
"""Times the load that forces are raised to hold where a grasp gives way in the simulation."""
SHARES = (0.25, 0.5, 0.75)
"""Of the forces of a type that are tried for the least effort: the fit raises them to what weight and shake need."""
STRAIN = math.radians(45)
"""Distance from the shipped poses' synergies that counts as much as all of the margin, or of the strength."""
SYNERGIES = 3
"""Of the shipped poses (controllers/grasp_poses.yaml), beside their mean."""
CLOSED = ("wrap", "fist", "cracker_box", "cylinder_50mm", "hook_bar", "pinch_card", "power_can", "sphere_35mm", "sphere_70mm", "tripod")
"""These poses."""
LIGHT = 0.01
"""[kg]"""
TOO_HEAVY = ("too_heavy", "too heavy: the hand is too weak for weight and shake")
REASONS = (("cannot open round", "too_large", "too large: the hand cannot open round it"), ("does not reach it", "out_of_reach", "out of reach: a finger does not reach it"),
           ("do not balance", "no_opposition", "no opposition: forces do not balance"),
           ("does not press", "no_opposition", "no opposition: it lies against a part that does not press"),
           ("in sum", *TOO_HEAVY), ("stops", "out_of_reach", "out of reach: beyond the joints' stops"),
           ("at the start", "hand_in_way", "the hand is in its way where it begins its approach"))
"""What the fit says, by a part of its words: code and reason."""
NOT_HELD = {"MOVED": ("moved", "not held: it is moved by the shake"), "LOST": ("lost", "not held: it is lost"),
            "diverged": ("diverged", "not held: the simulation diverged")}
"""Code and reason by the outcome of a run."""


class Grasp(NamedTuple):
    """A place that was tried."""

    place: Place
    content: dict[str, Any]
    """Of the scene."""
    reason: str
    """Why it is no grasp; empty: it is held, at half the step, too, and of its type."""
    type: GraspType
    code: str = ""
    """Of the reason, for programs: ``too_large``, ``out_of_reach``, ``no_opposition``, ``too_heavy``, ``moved``, ``lost``, ``diverged``, ``uncertain``,
    ``other_type``, ``refused``."""
    lacking: Optional[float] = None
    """Where it is too heavy, the force that weight and shake need over that of the hand."""
    outcome: str = ""
    """On the articulated engine: ``held``, ``MOVED``, ``LOST``; empty: not run."""
    margin: Optional[float] = None
    """What is left of the nearest limit, as a share."""
    outcome_half: str = ""
    """At half the step."""
    margin_half: Optional[float] = None
    forces: dict[str, float] = {}
    """Normal forces at the end of the hold by segment [N]."""
    effort: Optional[float] = None
    """Sum of the fingers' normal forces over the person's grip strength."""
    least_effort: Optional[float] = None
    """The same, of the smallest forces that are still held."""
    unnatural: Optional[float] = None
    """Distance of the joint angles from the synergies of the shipped poses, root of the mean square [rad]."""
    outcome_ode: str = ""
    margin_ode: Optional[float] = None
    frame: Any = None
    """At the end of the hold."""

    @property
    def held(self) -> bool:
        """At half the step, too, and as its type is."""
        return not self.reason

    @property
    def score(self) -> float:
        """Margin less effort less unnaturalness."""
        return min(self.margin or 0.0, self.margin_half or 0.0) - (self.least_effort or self.effort or 0.0) - (self.unnatural or 0.0) / STRAIN

    def scene(self, overrides: Optional[Mapping[str, Any]] = None) -> Scene:
        """The scene: close, lift, hold and shake."""
        return load(self.content, overrides)


class Refusal(NamedTuple):
    """Places that are no grasp for one reason."""

    type: str
    tried: bool
    """By fit and simulation; else geometry alone left them out."""
    code: str
    """Of the reason, for programs: those of `Grasp.code`; of places that were not tried ``too_large``, ``too_small``, ``other_shape``, ``nothing_there``,
    ``hand_in_way``."""
    why: str
    places: int


class Plan(NamedTuple):
    """What was found, and what was not."""

    object: Path
    person: str
    grasps: list[Grasp]
    """Those that are held, the best first."""
    tried: list[Grasp]
    """All places that were tried, in this order."""
    left_out: dict[str, dict[str, int]]
    """By type, places that were not tried, by reason."""
    hand_length: float
    grip_strength: float
    others: list[Path] = []
    """Objects that the study has in place of this one, too."""

    def refusals(self) -> list[Refusal]:
        """Why there are no more grasps, by type: those that were tried first, the most frequent reason first."""
        counts: dict[tuple[str, bool, str, str], int] = {}
        for grasp in self.tried:
            if grasp.reason:
                key = (grasp.place.type.name, True, grasp.code, grasp.reason)
                counts[key] = counts.get(key, 0) + 1
        for name, reasons in self.left_out.items():
            for why, n in reasons.items():
                counts[name, False, LEFT_OUT[why], why] = n
        return sorted((Refusal(*key, n) for key, n in counts.items()), key=lambda each: (not each.tried, -each.places, each.type, each.why))

    def why(self) -> list[str]:
        """The same of all types together, a line each."""
        counts: dict[tuple[bool, str], int] = {}
        for each in self.refusals():
            counts[not each.tried, each.why] = counts.get((not each.tried, each.why), 0) + each.places
        return [f"{n} places not tried: {why}" if left_out else f"{n} of {len(self.tried)} places that were tried: {why}"
                for (left_out, why), n in sorted(counts.items(), key=lambda each: (each[0][0], -each[1], each[0][1]))]

    def nearest(self) -> Optional[Grasp]:
        """Of those that failed, the one that was the nearest to being held: of those that were shaken, or else of those that are too heavy."""
        failed = [grasp for grasp in self.tried if grasp.reason and (grasp.margin is not None or grasp.lacking is not None)]
        failed.sort(key=lambda grasp: (grasp.margin is None, -(grasp.margin or 0.0), grasp.lacking or 0.0))
        return failed[0] if failed else None


def _rotation(turn: Array) -> dict[str, Any]:
    axis, angle = axis_and_angle(turn)
    return {"axis": [round(x, 6) for x in axis], "angle": f"{angle:.4f} deg"}


def _pose(of: dict[str, list[float]]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for finger, (flexion, abduction, second, third) in of.items():
        names = ("cmc", "mcp", "ip") if finger == "thumb" else ("mcp", "pip", "dip")
        angles = [round(math.degrees(angle), 3) for angle in (flexion, abduction, second, third)]
        out.update({f"{finger}_{names[0]}": angles[:2], f"{finger}_{names[1]}": angles[2], f"{finger}_{names[2]}": angles[3]})
    return out


def named(file: Path, folder: str) -> str:
    """The name of a shipped file, which stands in scenes wherever they are; else the absolute path. :param folder: below the shipped data"""
    path, shipped = file.resolve(), (data_path() / folder).resolve()
    return str(path.relative_to(shipped).with_suffix("")) if path.is_relative_to(shipped) else str(path)


def scene_of(place: Place, solid: Solid, file: Path, person: Union[str, Mapping[str, Any]], side: str, length: float, share: float = 1.0,
             reserve: float = 1.0) -> dict[str, Any]:
    """The scene of a grasp. :param share: of the type's forces. :param reserve: the fit raises them to what holds so many times the load"""
    of = place.type
    # The person stands at -y: the forearm comes from there.
    forearm = (place.rest @ place.turn.T)[:, 1]
    yaw = math.pi / 2 - math.atan2(forearm[1], forearm[0]) if math.hypot(forearm[0], forearm[1]) > 0.2 else 0.0
    about = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    turn = about @ place.rest  # R_WO
    wrist = turn @ place.turn.T
    at = np.array([0, 0, HEIGHT]) - turn @ solid.centre
    name = re.sub(r"[^a-z0-9_]+", "_", file.stem.lower()).strip("_") or "object"
    name = name if name[0].isalpha() else f"object_{name}"
    several = of.opposition == "palm" or len(of.touches) > 2
    return {
        "title": f"{of.name} of {name}",
        "hands": [{"model": "anatomical", "person": person, "side": side, "wrist": {"mount": "driven"}}],
        "objects": [{"name": name, "file": named(file, "config/objects")}],
        "control": {"controller": "grasp",
                    "poses": {"title": f"poses of {of.name}", "unit": "deg", "poses": {"open": _pose(of.open), "closed": _pose(of.closed)}}},
        "grasps": [{
            "object": name,
            "wrist": {"position": [round(float(x), 6) for x in at - wrist @ place.position], "rotation": _rotation(wrist)},
            "at": {"position": [round(float(x), 6) for x in place.position], "rotation": _rotation(place.turn), "hand_length": f"{1e3 * length:.4f} mm",
                   "touches": "palm" if of.sites is None else "nothing"},
            "support": {"radius": f"{1e3 * place.post:.2f} mm"}, "open": "open", "closed": "closed",
            "grip": {"forces": {finger: f"{share * force:.3f} N" for finger, force in of.forces.items()}, "strength": "grip_strength",
                     **({"reserve": reserve} if reserve > 1 else {})},
            "approach": {"from": [round(float(WAY * x), 5) for x in place.approach], "time": "0.5 s"},
            "close": "0.6 s", "lift": {"height": "0.25 m", "time": "0.6 s"}, "hold": f"{HOLD} s", "shake": {"levels": [SHAKE]}}],
        "contacts": {"materials": [{"name": "pad", "file": "finger_pad", **({"spinning_friction": 0} if several else {})}],
                     "rules": [{"between": ["hands", "objects"], "material": "pad"}, {"between": ["objects", "objects"]}]},
        "effects": ["gravity", "object_contact", "friction", "joint_stops", "passive_tissue", "actuation", "wrist_motion"],
        "solver": {"engine": "articulated", "step": "1 ms"},
        "record": {"every": "20 ms"}, "pictures": {"size": [480, 360]},
        "criteria": {"joint_gap": "1 mm"}}


FORCES = re.compile(r"presses with ([0-9.e+-]+) N in sum.* need ([0-9.e+-]+) N")
"""The fit's word of a hand that is too weak."""


def _refused(grasp: Grasp, error: Error) -> Grasp:
    text = str(error)
    code, reason = next(((code, reason) for words, code, reason in REASONS if words in text), ("refused", text.splitlines()[0][:200]))
    forces = FORCES.search(text)
    return grasp._replace(code=code, reason=reason, lacking=float(forces[2]) / float(forces[1]) if forces else None)


class _Run(NamedTuple):
    outcome: str
    margin: Optional[float]


def _run(scene: Scene) -> _Run:
    result = scene.run(frames=0, stop_lost=True, progress=False)
    if result.fault is not None:
        return _Run("diverged", None)
    outcome = str(result.figures["outcome"]).split(" ")[0].rstrip(",")
    margin = result.figures["margin"]
    return _Run(outcome, None if margin is None else float(margin))


def _held_until(scene: Scene) -> Simulation:
    """At the end of the hold."""
    simulation = Simulation(scene)
    end = next(end for name, _, end in _core.drawn(scene._core)["phases"] if name == "hold")
    simulation.step(substeps=round(end / scene.step))
    return simulation


def _segment_forces(simulation: Simulation, side: str, name: str) -> dict[str, float]:
    """Normal forces on an object by segment of the hand [N]; pads of the palm that a segment carries are the palm's."""
    contacts = simulation.contacts
    palm = {shape.name for shape in simulation.scene._model.shapes if shape.part == "palm"}
    out: dict[str, float] = {}
    for a, b, normal, force in zip(contacts.a, contacts.b, contacts.normal, contacts.force):
        one, other = (a, b) if a.startswith(f"{side}.") else (b, a)
        if not one.startswith(f"{side}.") or not other.startswith(name) or other.startswith(f"{name}_post"):
            continue
        segment = "palm" if one in palm else one.split(".")[1]
        out[segment] = out.get(segment, 0.0) + abs(float(force @ normal))
    return out


class Planner:
    """Of one object and one hand."""

    def __init__(self, file: Path, person: Union[str, Mapping[str, Any]], side: str, types: Mapping[str, GraspType], free: bool, threads: int) -> None:
        """:param free: what is held in another way than its type's counts as the type that it is"""
        self.file, self.person, self.side, self.types, self.free = file, person, side, types, free
        self.hand = Hand(person=person)
        self.solid = Solid(of_scene(file.stem, file))
        self.posed = Posed(self.hand)
        self.search = Search(self.solid, self.posed)
        self.strength = float(self.hand.dimensions["grip_strength"])
        self.threads = threads
        self._synergies: Optional[tuple[Array, Array]] = None

    def content(self, place: Place, share: float = 1.0, reserve: float = 1.0) -> dict[str, Any]:
        return scene_of(place, self.solid, self.file, self.person, self.side, self.posed.length, share, reserve)

    def queue(self) -> list[Place]:
        """Different places, of all types by turns."""
        by_type = list[list[Place]]()
        for of in self.types.values():
            chosen: list[Place] = []
            for place in self.search.places(of):
                if len(chosen) < EACH and not any(alike(place, other, NEXT) for other in chosen):
                    chosen.append(place)
            by_type.append(chosen)
        by_type.sort(key=lambda places: places[0].cost if places else math.inf)
        return [places[k] for k in range(EACH) for places in by_type if k < len(places)]

    def judged(self, place: Place) -> Grasp:
        """What gives way when it is shaken is pressed harder, as people do, as far as the hand's strength goes."""
        best = self.pressed(place, 1.0)
        for reserve in RESERVES:
            if best.code not in ("moved", "uncertain"):
                break
            harder = self.pressed(place, reserve)
            if not harder.outcome:
                break
            if harder.held or (harder.margin or -math.inf) > (best.margin or -math.inf):
                best = harder
        return best

    def pressed(self, place: Place, reserve: float) -> Grasp:
        """Fits, runs and judges."""
        content = self.content(place, reserve=reserve)
        grasp = Grasp(place, content, "", place.type)
        try:
            scene = load(content)
            run = _run(scene)
        except Error as error:
            return _refused(grasp, error)
        grasp = grasp._replace(outcome=run.outcome, margin=run.margin)
        if run.outcome != "held":
            code, reason = NOT_HELD.get(run.outcome, ("refused", f"not held: {run.outcome}"))
            return grasp._replace(code=code, reason=reason)
        half = _run(load(content, {"solver.step": scene.step / 2}))
        simulation = _held_until(scene)
        forces = _segment_forces(simulation, self.side, content["objects"][0]["name"])
        q = np.array([simulation.q[scene.coordinates.index(f"{self.side}.{name}")] for name in self.hand.coordinates])
        grasp = grasp._replace(outcome_half=half.outcome, margin_half=half.margin, forces=forces, frame=simulation.frame(), unnatural=self.unnatural(q),
                               effort=sum(force for segment, force in forces.items() if segment != "palm") / self.strength)
        if half.outcome != "held":
            return grasp._replace(code="uncertain", reason="uncertain: not held at half the step")
        if min(run.margin or 0.0, half.margin or 0.0) <= abs((run.margin or 0.0) - (half.margin or 0.0)):
            return grasp._replace(code="uncertain", reason="uncertain: the margin is within the error of the step")
        size = place.thickness / self.posed.length
        faults = place.type.faults(forces, size)
        if not faults:
            return grasp
        if self.free:
            for other in sorted(self.types.values(), key=lambda each: each.opposition != place.type.opposition):
                if not other.faults(forces, size):
                    return grasp._replace(type=other)
        return grasp._replace(code="other_type", reason=f"held, but not as {place.type.name}: {faults[0]}")

    def weighed(self, grasp: Grasp) -> Grasp:
        """With the reason that it is too heavy, where a light object of the same shape fits."""
        if grasp.outcome or grasp.code == "too_heavy":
            return grasp
        try:
            load(grasp.content, {"objects.0.mass": LIGHT})
        except Error:
            return grasp
        return grasp._replace(code=TOO_HEAVY[0], reason=TOO_HEAVY[1])

    def unnatural(self, q: Array) -> float:
        if self._synergies is None:
            poses = load("grasp_pinch", {"solver.engine": "articulated"})._core.poses()
            rows = np.array([[angle for finger in FINGERS for joint in (("cmc", "mcp", "ip") if finger == "thumb" else ("mcp", "pip", "dip"))
                              for angle in poses[name][f"{finger}_{joint}"]] for name in CLOSED])
            mean = rows.mean(axis=0)
            self._synergies = mean, np.linalg.svd(rows - mean)[2][:SYNERGIES]
        mean, axes = self._synergies
        off = q - mean
        return float(np.sqrt(np.mean((off - (off @ axes.T) @ axes)**2)))

    def finished(self, grasp: Grasp, ode: bool) -> Grasp:
        """With the least effort, and the verdict of ODE."""
        least = grasp.effort
        for share in SHARES:
            try:
                scene = load(self.content(grasp.place, share))
            except Error:
                continue
            if _run(scene).outcome == "held":
                forces = _segment_forces(_held_until(scene), self.side, grasp.content["objects"][0]["name"])
                least = min(least or math.inf, sum(force for segment, force in forces.items() if segment != "palm") / self.strength)
                break
        grasp = grasp._replace(least_effort=least)
        if ode:
            run = _run(load(grasp.content, {"solver": ODE}))
            grasp = grasp._replace(outcome_ode=run.outcome, margin_ode=run.margin)
        return grasp

    def plan(self, count: int, ode: bool, told: Told) -> Plan:
        queue, tried, found = self.queue(), list[Grasp](), list[Grasp]()
        most = min(len(queue), max(LEAST_TRIES, TRIES * count))
        enough = math.ceil(SPARE * count)
        with ThreadPoolExecutor(self.threads) as pool:
            while len(tried) < most and len(found) < enough:
                batch = queue[len(tried):min(most, len(tried) + ROUND)]
                tried += pool.map(self.judged, batch)
                found = self.different([grasp for grasp in tried if not grasp.reason])
                if told:
                    told(0.8 * min(1.0, max(len(tried) / most, len(found) / enough)))
            if not found:
                tried = list(pool.map(self.weighed, tried))
            best = found[:count]
            done = [pool.submit(self.finished, grasp, ode) for grasp in best]
            best = []
            for each in done:
                best.append(each.result())
                if told:
                    told(0.8 + 0.2 * len(best) / len(done))
        best.sort(key=lambda grasp: -grasp.score)
        return Plan(self.file, self.person if isinstance(self.person, str) else "", best, tried, self.search.why, self.posed.length, self.strength)

    @staticmethod
    def different(grasps: Sequence[Grasp]) -> list[Grasp]:
        """The best of each kind: first the best of every type, then others."""
        out: list[Grasp] = []
        for grasp in sorted(grasps, key=lambda each: -each.score):
            if not any(grasp.type == other.type and alike(grasp.place, other.place) for other in out):
                out.append(grasp)
        seen: dict[str, int] = {}
        order = list[tuple[int, Grasp]]()
        for grasp in out:
            order.append((seen.get(grasp.type.name, 0), grasp))
            seen[grasp.type.name] = seen.get(grasp.type.name, 0) + 1
        return [grasp for _, grasp in sorted(order, key=lambda each: each[0])]


ODE = {"engine": "ode", "method": "world_step", "step": "1 ms", "erp": 0.2, "cfm": 1e-8, "seed": 1}


def alike(a: Place, b: Place, apart: float = APART) -> bool:
    """Of nearly the same place in the hand."""
    if a.part != b.part:
        return False
    angle = math.acos(float(np.clip((np.trace(a.turn @ b.turn.T) - 1) / 2, -1, 1)))
    return bool(angle < TURNED and np.linalg.norm(a.position - b.position) < apart)


def object_file(object: Union[str, "PathLike[str]"]) -> Path:
    """:raises Error: of kind input for what is no object file"""
    file = find_file(object, "object", "config/objects")
    if file.suffix != ".yaml":
        raise input_error("object", file, f"an object file: handsim object {file.name} makes one of a mesh")
    return file


def planned(object: Union[str, "PathLike[str]"], *, person: Union[str, "PathLike[str]", Mapping[str, Any]], side: str, types: Sequence[str], count: int,
            ode: bool, threads: int, others: Sequence[Union[str, "PathLike[str]"]] = (), told: Told = None) -> Plan:
    """:raises Error: of kind input for what is no object that moves, no person, no type"""
    known = read_types()
    for name in types:
        if name not in known:
            raise input_error("type", name, _core.need_word(str(name), list(known)))
    if side not in ("right", "left"):
        raise input_error("side", side, "right or left")
    who: Union[str, Mapping[str, Any]] = person if isinstance(person, Mapping) else named(find_file(person, "person", "config/persons"), "config/persons")
    asked = {name: of for name, of in known.items() if not types or name in types}
    files = [object_file(each) for each in (object, *others)]
    planner = Planner(files[0], who, side, asked, not types, threads or os.cpu_count() or 1)
    return planner.plan(count, ode, told)._replace(others=[each for each in files[1:] if each.resolve() != files[0].resolve()])
