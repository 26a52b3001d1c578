"""What a page or a program may ask of a session, checked before the session sees it."""
from __future__ import annotations

import math
from typing import Any, Callable, Mapping, NamedTuple, Optional

import numpy as np
from numpy.typing import NDArray

from .._errors import input_error
from .._scene import Scene
from .course import Course, Event, spring_row

Array = NDArray[np.float64]
SPRINGS = 8
"""Springs at most, of all pages."""
FORCE = 50.0
"""Largest force of a spring and of a push [N]."""
WRIST_SPEED, ANGLE_SPEED = 0.5, 15.0
"""Of wrists that are dragged [m/s], and of targets that move [rad/s]."""


class Command(NamedTuple):
    name: str
    values: dict[str, Any]
    slot: Optional[str] = None
    """Of a continuous one: a newer one replaces it while it waits."""


class Facts(NamedTuple):
    """Of a compiled scene, that checks and pages need."""

    scene: Scene
    bodies: list[str]
    axes: list[str]
    coordinates: list[str]
    muscles: int
    objects: list[str]
    """That can move."""
    driven: list[int]
    """Bodies of driven wrists."""
    masses: Array
    poses: dict[str, list[float]]
    """Named poses as values of `axes`."""
    numbers: dict[str, Any]
    """What can be changed while it runs, with the scene's own values."""

    @staticmethod
    def of(course: Course) -> "Facts":
        scene = course.scene
        bodies = scene.bodies
        return Facts(scene, bodies, scene.axes, scene.coordinates, len(scene.muscles), scene.objects,
                     [bodies.index(name) for name in scene.wrists], scene.masses, poses_of(scene), course.numbers)


def poses_of(scene: Scene) -> dict[str, list[float]]:
    """Named poses of the scene's control, as values of its axes."""
    joints = [name.rpartition(".")[0] for name in scene.coordinates]
    # Place of each coordinate within its joint.
    place = {name: sum(other == joint for other in joints[:i]) for i, (name, joint) in enumerate(zip(scene.coordinates, joints))}
    out = {}
    for name, pose in scene._core.poses().items():
        values = []
        for axis in scene.axes:
            angles = pose.get(axis.partition(".")[2].rpartition(".")[0], [])
            values.append(angles[place[axis]] if place[axis] < len(angles) else 0.0)
        out[name] = values
    return out


def is_number(value: Any) -> bool:
    """One that is finite as a float."""
    try:
        return type(value) in (int, float) and math.isfinite(value)
    except OverflowError:
        return False


def shown(value: Any) -> str:
    """A value in a message."""
    try:
        return repr(value)[:60]
    except ValueError:
        return "a number of too many digits"


def number(of: Mapping[str, Any], key: str, low: float, high: float, default: Optional[float] = None) -> float:
    value: Any = of.get(key, default)
    if not is_number(value) or not low <= value <= high:
        raise input_error(key, shown(value), f"a number, {low:g} to {high:g}")
    return float(value)


def whole(of: Mapping[str, Any], key: str, low: int, high: int, default: Optional[int] = None) -> int:
    value = of.get(key, default)
    if type(value) is not int or not low <= value <= high:
        raise input_error(key, shown(value), f"a whole number, {low} to {high}")
    return value


def vector(of: Mapping[str, Any], key: str, size: int, low: float, high: float) -> list[float]:
    values = of.get(key)
    if not isinstance(values, list) or len(values) != size:
        raise input_error(key, shown(values), f"a list of {size} numbers")
    return [number({key: value}, key, low, high) for value in values]


def word(of: Mapping[str, Any], key: str, known: list[str]) -> str:
    value = of.get(key)
    if not isinstance(value, str) or value not in known:
        raise input_error(key, shown(value), "one of " + ", ".join(known[:40]))
    return value


def _spring(of: Mapping[str, Any], facts: Facts) -> Command:
    slot = whole(of, "id", 0, SPRINGS - 1)
    if of.get("release") is True:
        return Command("spring", {"id": slot, "row": None}, f"spring {slot}")
    row = [whole(of, "body", 1, len(facts.bodies) - 1), *vector(of, "point", 3, -10, 10), *vector(of, "goal", 3, -100, 100),
           number(of, "stiffness", 0, 1e4, 150.0), number(of, "force", 0, FORCE, 20.0)]
    return Command("spring", {"id": slot, "row": row}, f"spring {slot}")


def _targets(of: Mapping[str, Any], facts: Facts) -> Command:
    if of.get("release") is True:
        return Command("targets", {"values": None}, "targets")
    if not facts.axes:
        raise input_error("targets", "a scene without control", "one whose joints are driven")
    return Command("targets", {"values": vector(of, "values", len(facts.axes), -2 * math.pi, 2 * math.pi),
                               "time": number(of, "time", 0, 10, 0.05)}, "targets")


def _pose(of: Mapping[str, Any], facts: Facts) -> Command:
    name = word(of, "name", list(facts.poses))
    return Command("targets", {"values": facts.poses[name], "time": number(of, "time", 0, 10, 0.6)}, "targets")


def _list(name: str, size: Callable[[Facts], int], low: float, high: float) -> Callable[[Mapping[str, Any], Facts], Command]:
    def read(of: Mapping[str, Any], facts: Facts) -> Command:
        values = None if of.get("release") is True else vector(of, "values", size(facts), low, high)
        return Command(name, {"values": values}, name)
    return read


RANGES = {"mass": (1e-4, 1000.0), "friction": (0.0, 10.0), "gains": (0.01, 10.0), "torque_limits": (0.01, 10.0)}
"""Of numbers, by the last word of their names."""


def _number(of: Mapping[str, Any], facts: Facts) -> Command:
    name = word(of, "name", list(facts.numbers))
    value = vector(of, "value", 3, -100, 100) if name == "gravity" else number(of, "value", *RANGES[name.rpartition(".")[2]])
    return Command("numbers", {name: value}, f"number {name}")


def _push(of: Mapping[str, Any], facts: Facts) -> Command:
    return Command("push", {"body": facts.bodies[whole(of, "body", 1, len(facts.bodies) - 1)],
                            "force": vector(of, "force", 3, -FORCE, FORCE), "time": number(of, "time", 1e-3, 1, 0.05)})


def _scene(of: Mapping[str, Any], facts: Facts) -> Command:
    changes: dict[str, Any] = {}
    if "engine" in of:
        changes["solver.engine"] = word(of, "engine", ["ode", "articulated", "dae"])
    if "step" in of:
        changes["solver.step"] = number(of, "step", 1e-5, 0.02)
    for key, (low, high) in {"stature": (0.3, 3.0), "mass": (1.0, 400.0)}.items():
        if key in of:
            for hand in range(len(facts.scene.hands)):
                changes[f"hands.{hand}.person.{key}"] = number(of, key, low, high)
    if not changes:
        raise input_error("scene", "no change", "engine, step, stature or mass")
    return Command("scene", {"changes": changes})


def _seek(of: Mapping[str, Any], _: Facts) -> Command:
    return Command("seek", {"time": number(of, "time", 0, 1e9)}, "seek")


def _play(of: Mapping[str, Any], _: Facts) -> Command:
    if type(of.get("on")) is not bool:
        raise input_error("on", shown(of.get("on")), "true or false")
    return Command("play", {"on": of["on"]})


READERS: dict[str, Callable[[Mapping[str, Any], Facts], Command]] = {
    "play": _play,
    "step": lambda of, _: Command("step", {"steps": whole(of, "steps", 1, 1000, 1)}),
    "speed": lambda of, _: Command("speed", {"value": number(of, "value", 0.1, 10)}),
    "seek": _seek,
    "present": lambda of, _: Command("present", {}),
    "reset": lambda of, _: Command("reset", {}),
    "spring": _spring, "push": _push, "targets": _targets, "pose": _pose, "number": _number, "scene": _scene,
    "torques": _list("torques", lambda facts: len(facts.coordinates), -20, 20),
    "excitations": _list("excitations", lambda facts: facts.muscles, 0, 1),
}


def read_command(message: Any, facts: Facts) -> Command:
    """:raises Error: of kind input for anything that is not a command of this scene"""
    if not isinstance(message, dict):
        raise input_error("message", type(message).__name__, "an object with a key \"do\"")
    return READERS[word(message, "do", list(READERS))](message, facts)


def event_of(command: Command, course: Course, facts: Facts) -> Event:
    """The event of an input, before the next step."""
    name, values, step = command.name, command.values, course.scene.step
    if name == "reset":
        return {"reset": True}
    if name == "numbers":
        return {"numbers": values}
    if name == "push":
        return {"push": {"body": values["body"], "force": values["force"], "steps": max(1, round(values["time"] / step))}}
    if name == "spring":
        return _spring_event(values, course, facts)
    if name == "tracked":
        return {key: each for of in ("targets", "wrists") if of in values
                for key, each in event_of(Command(of, values[of]), course, facts).items()}
    if values["values"] is None:
        return {name: None}
    if name == "targets":
        now = course.controls["targets"]
        start = course.core.targets() if now is None else now.at(course.tick)
        change = float(np.max(np.abs(np.array(values["values"]) - start), initial=0.0))
        return {name: {"to": values["values"], "steps": max(1, math.ceil(max(values["time"], change / ANGLE_SPEED) / step))}}
    if name == "wrists":
        return {name: {"to": values["values"], "steps": max(1, math.ceil(values["time"] / step))}}
    return {name: values["values"]}


def _spring_event(values: Mapping[str, Any], course: Course, facts: Facts) -> Event:
    springs, row, key = dict(course.controls["springs"]), values["row"], str(values["id"])
    if row is None:
        springs.pop(key, None)
        return {"springs": springs}
    body = row[0]
    if body in facts.driven:
        return _wrist_event(body, row, course, facts)
    springs[key] = spring_row(row, course.mass_of(body), course.scene.step)
    return {"springs": springs}


def _wrist_event(body: int, row: list[float], course: Course, facts: Facts) -> Event:
    """A driven wrist does not feel a force: it is moved."""
    position, quaternion, _, _ = course.core.bodies()
    w, v, point = quaternion[body, 0], quaternion[body, 1:], np.array(row[1:4])
    place = position[body] + point + 2 * np.cross(v, np.cross(v, point) + w * point)
    now = course.controls["wrists"]
    start = course.core.wrists()
    goal = (start if now is None else now.ends[1]).copy()
    index = facts.driven.index(body)
    goal[index] = start[index]
    way = np.array(row[4:7]) - place
    goal[index, :3] += way
    time = max(0.02, float(np.linalg.norm(way)) / WRIST_SPEED)
    return {"wrists": {"to": goal.tolist(), "steps": max(1, math.ceil(time / course.scene.step))}}
