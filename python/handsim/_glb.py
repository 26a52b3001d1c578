"""A hand's skin as binary glTF 2.0 (Khronos), with its bodies as a skeleton."""
from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import Error, Problem

if TYPE_CHECKING:
    from ._hand import Hand

_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_VERTICES, _INDICES = 34962, 34963  # targets of buffer views
_INFLUENCES = 4  # of a vertex, by glTF
_SKIN = [0.694, 0.413, 0.296, 1.0]  # linear
_Y_UP = [-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]  # x y z w: the hand's z becomes y


class _Buffer:
    """Accessors and views of one buffer."""

    def __init__(self) -> None:
        self.data = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], kind: int, target: Optional[int] = None, bounds: bool = False) -> int:
        """The accessor of an array, one element a row."""
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.data), "byteLength": values.nbytes}
        if target:
            view["target"] = target
        accessor: dict[str, Any] = {"bufferView": len(self.views), "componentType": kind, "count": len(values),
                                    "type": _TYPES[values[0].size]}
        if bounds:
            rows = values.reshape(len(values), -1)
            accessor.update(min=rows.min(0).tolist(), max=rows.max(0).tolist())
        self.views.append(view)
        self.accessors.append(accessor)
        self.data += values.tobytes() + b"\0" * (-values.nbytes % 4)
        return len(self.accessors) - 1


def _rotation(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix of w x y z."""
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def _normals(points: NDArray[np.float64], faces: NDArray[np.uint32]) -> NDArray[np.float32]:
    a, b, c = (points[faces[:, k]] for k in range(3))
    out = np.zeros_like(points)
    for k in range(3):
        np.add.at(out, faces[:, k], np.cross(b - a, c - a))
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True), dtype=np.float32)


def _strongest(weights: NDArray[np.float64]) -> tuple[NDArray[np.uint16], NDArray[np.float32]]:
    """The bodies of most weight and their shares, which sum to 1."""
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :_INFLUENCES]
    shares = np.take_along_axis(weights, joints, axis=1)
    shares = shares / shares.sum(axis=1, keepdims=True)
    return np.where(shares > 0, joints, 0).astype(np.uint16), np.asarray(shares, dtype=np.float32)


def _mesh(hand: "Hand", out: _Buffer) -> tuple[dict[str, Any], int]:
    """The primitive of the skin with straight fingers, and the accessor of the inverse bind matrices."""
    mesh, poses = hand.mesh(), hand.poses(np.zeros(len(hand.coordinates)))
    joints, shares = _strongest(mesh.weights)
    attributes = {"POSITION": out.add(mesh.vertices.astype(np.float32), _FLOAT, _VERTICES, bounds=True),
                  "NORMAL": out.add(_normals(mesh.vertices, mesh.faces), _FLOAT, _VERTICES),
                  "JOINTS_0": out.add(joints, _UINT16, _VERTICES),
                  "WEIGHTS_0": out.add(shares, _FLOAT, _VERTICES)}
    inverse = np.zeros((len(poses.position), 4, 4), np.float32)
    for matrix, p, q in zip(inverse, poses.position, poses.quaternion):
        matrix[:3, :3], matrix[:3, 3], matrix[3, 3] = _rotation(q).T, -_rotation(q).T @ p, 1
    primitive = {"attributes": attributes, "indices": out.add(mesh.faces.reshape(-1), _UINT32, _INDICES), "material": 0}
    # Matrices are column by column.
    return primitive, out.add(np.ascontiguousarray(inverse.transpose(0, 2, 1)), _FLOAT)


def _animation(hand: "Hand", times: NDArray[np.float32], q: NDArray[np.float64], out: _Buffer) -> dict[str, Any]:
    moments = [hand.poses(each) for each in q]
    clock = out.add(times, _FLOAT, bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for body in range(len(hand.bodies)):
        turns = np.array([moment.quaternion[body][[1, 2, 3, 0]] for moment in moments])
        # Neighbours on one side of the sphere: viewers interpolate.
        turns *= np.cumprod(np.sign([1.0, *np.sum(turns[1:] * turns[:-1], axis=1)]) + 0.0)[:, None]
        places = np.array([moment.position[body] for moment in moments])
        for path, values in (("translation", places), ("rotation", turns)):
            channels.append({"sampler": len(samplers), "target": {"node": body, "path": path}})
            samplers.append({"input": clock, "output": out.add(values.astype(np.float32), _FLOAT)})
    return {"samplers": samplers, "channels": channels}


def glb_of(hand: "Hand", q: Optional[ArrayLike], times: Optional[ArrayLike]) -> bytes:
    """See `Hand.to_glb`. Every body is a node under the root: frames are those of `Hand.poses`."""
    zero = np.zeros(len(hand.coordinates))
    angles = np.asarray(zero if q is None else q, dtype=np.float64)
    clock = None if times is None else np.asarray(times, dtype=np.float32)
    if clock is not None and (clock.ndim != 1 or len(clock) == 0 or np.any(np.diff(clock) <= 0) or clock[0] < 0 or
                              angles.shape != (len(clock), len(zero))):
        got = f"shapes {clock.shape} and {angles.shape}"
        need = f"rising times of 0 or more, shape (times,), and q of shape (times, {len(zero)})"
        raise Error(f"times: got {got}, need {need}", "input", [Problem(None, None, None, "times", got, need)])
    poses = hand.poses(angles if clock is None else angles[0])
    out = _Buffer()
    primitive, binds = _mesh(hand, out)
    count = len(hand.bodies)
    nodes: list[dict[str, Any]] = [
        {"name": name, "translation": p.tolist(), "rotation": r[[1, 2, 3, 0]].tolist()}
        for name, p, r in zip(hand.bodies, poses.position, poses.quaternion)]
    nodes.append({"name": f"{hand.side} hand", "rotation": _Y_UP, "children": list(range(count))})
    nodes.append({"name": "skin", "mesh": 0, "skin": 0})
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "handsim"}, "scene": 0, "scenes": [{"nodes": [count, count + 1]}],
        "nodes": nodes, "meshes": [{"name": "skin", "primitives": [primitive]}],
        "skins": [{"joints": list(range(count)), "skeleton": count, "inverseBindMatrices": binds}],
        "materials": [{"name": "skin", "pbrMetallicRoughness": {"baseColorFactor": _SKIN, "metallicFactor": 0.0,
                                                                "roughnessFactor": 0.6}}]}
    if clock is not None:
        content["animations"] = [_animation(hand, clock, angles, out)]
    content.update(accessors=out.accessors, bufferViews=out.views, buffers=[{"byteLength": len(out.data)}])
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(out.data)
    return (struct.pack("<4sIII4s", b"glTF", 2, total, len(text), b"JSON") + text +
            struct.pack("<I4s", len(out.data), b"BIN\0") + out.data)
