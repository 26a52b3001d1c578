"""The moment of a session as files of other commands."""
from __future__ import annotations

from typing import Any

import numpy as np

from .._errors import input_error
from .session import Session


def save(session: Session, what: str) -> tuple[str, bytes]:
    """:returns: name and content of the file: ``recording``, ``snapshot`` or ``scene``. In the session's thread"""
    if what == "recording":
        return "live.jsonl", session.history.recording()
    if what == "snapshot":
        text: bytes = session.course.core.snapshot().__reduce__()[1][0]
        return "snapshot.bin", text
    if what == "scene":
        return "scene.yaml", scene_text(session).encode()
    raise input_error("save", what, "recording, snapshot or scene")


def scene_text(session: Session) -> str:
    """The scene with the values that were changed, hands and objects where they are, at rest.

    :raises Error: of kind input where the scene cannot start there
    """
    course = session.course
    scene, changes = course.scene, dict(course.overrides)
    for name, value in course.controls["numbers"].items():
        if name == "gravity":
            changes[name] = value
        elif name.startswith("objects."):
            changes[name] = value
    joints: dict[str, dict[str, list[float]]] = {}
    limits, q = scene.limits, np.array(course.core.q)
    for name, value, (low, high) in zip(scene.coordinates, q, limits):
        hand, _, joint = name.rpartition(".")[0].partition(".")
        if hand in scene.hands:
            joints.setdefault(hand, {}).setdefault(joint, []).append(float(np.clip(value, low, high)))
    for i, hand in enumerate(scene.hands):
        if joints.get(hand):
            changes[f"hands.{i}.pose"] = joints[hand]
    bodies = scene.bodies
    position, quaternion, _, _ = course.core.bodies()
    for i, (name, moves) in enumerate(scene._core.all_objects()):
        if moves:
            body = bodies.index(name)
            changes.update(object_place(i, position[body], quaternion[body]))
    return course.files.compile(changes).resolved


def object_place(index: int, position: Any, quaternion: Any) -> dict[str, Any]:
    angle = 2 * float(np.arctan2(np.linalg.norm(quaternion[1:]), quaternion[0]))
    axis = quaternion[1:] if np.linalg.norm(quaternion[1:]) > 1e-9 else np.array([0.0, 0.0, 1.0])
    return {f"objects.{index}.position": position.tolist(),
            f"objects.{index}.rotation": {"axis": axis.tolist(), "angle": angle}}
