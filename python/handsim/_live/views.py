"""What pages and trackers see of a session: a view of the moment, and the slow things as JSON."""
from __future__ import annotations

from typing import Any, Container, Mapping, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from .course import Course
from .history import History


class View(NamedTuple):
    """The moment that pages draw."""

    number: int
    tick: int
    time: float
    poses: NDArray[np.float32]
    """x y z, quaternion x y z w of each body, shape (bodies, 7)."""
    contacts: NDArray[np.float32]
    """Place and force, shape (n, 6)."""
    shapes: NDArray[np.uint16]
    """The two of each contact, shape (n, 2)."""
    q: NDArray[np.float32]
    springs: NDArray[np.float32]
    """Body, its point, goal and force of each, shape (n, 10)."""
    targets: NDArray[np.float64]
    """Of the controller's axes [rad]."""
    wrists: NDArray[np.float64]
    """Of driven wrists: x y z, quaternion w x y z, shape (wrists, 7)."""
    touch: frozenset[str]
    """Shapes that touch objects."""
    built: int
    """Counts the scenes that were built: views of another one have other shapes."""


def look(course: Course, number: int, built: int, shape_index: Mapping[str, int], objects: Container[str]) -> View:
    """The view of a course. :param shape_index: numbers of the shapes' names. :param objects: their names"""
    core = course.core
    position, quaternion, _, _ = core.bodies()
    poses = np.concatenate((position, quaternion[:, 1:], quaternion[:, :1]), axis=1, dtype=np.float32)
    a, b, places, _, _, forces = core.contacts()
    shapes = np.array([[shape_index.get(x, 0), shape_index.get(y, 0)] for x, y in zip(a, b)], dtype=np.uint16).reshape(-1, 2)
    springs = np.zeros((0, 10), dtype=np.float32)
    rows = list(course.controls["springs"].values())
    if rows:
        force = course.spring_forces if len(course.spring_forces) == len(rows) else np.zeros((len(rows), 3))
        springs = np.concatenate((np.array(rows)[:, :7], force), axis=1, dtype=np.float32)
    touch = frozenset(of for pair in zip(a, b) for of, on in (pair, pair[::-1]) if on.partition(".")[0] in objects)
    return View(number, course.tick, course.time, poses, np.concatenate((places, forces), axis=1, dtype=np.float32), shapes,
                np.array(core.q, dtype=np.float32), springs, core.targets(), core.wrists(), touch, built)


def tell(course: Course, history: History, lateness: Sequence[NDArray[np.float64]], broken: Optional[str],
         session: Mapping[str, Any]) -> dict[str, Any]:
    """The slow things, as JSON.

    :param lateness: when steps were complete after they were due [s], of groups of steps
    :param broken: why the session has paused by itself
    :param session: numbers and texts of its own
    """
    late = np.concatenate(lateness) if lateness else np.zeros(0)
    controls = course.controls
    ramp = controls["targets"]
    return {
        **session, "lateness_p99_ms": round(1e3 * float(np.percentile(late, 99)), 3) if len(late) else None,
        "tick": course.tick, "time": course.time, "start": history.frames[0][0].snapshot.time,
        "present": history.present.snapshot.time if history.present else course.time, "past": history.present is not None,
        "failed": course.failed or broken, "broken": not course.failed and broken is not None,
        "engine": course.scene.engine, "step": course.scene.step,
        "overrides": course.overrides, "numbers": controls["numbers"],
        "targets": None if ramp is None else np.round(ramp.ends[1], 6).tolist(),
        "torques": None if controls["torques"] is None else controls["torques"].tolist(),
        "excitations": None if controls["excitations"] is None else controls["excitations"].tolist(),
        "verdicts": [{"name": each.name, "held": each.held, "measured": _finite(each.measured), "least": each.least,
                      "limit": _finite(each.limit), "unit": each.unit, "where": each.where}
                     for each in ([] if course.failed else course.verdicts)]}


def _finite(value: Any) -> Optional[float]:
    return float(value) if value is not None and np.isfinite(value) else None
