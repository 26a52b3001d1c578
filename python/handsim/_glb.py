"""Binary glTF 2.0 (Khronos): skins with their skeletons, shapes, and a motion."""
from __future__ import annotations

import json
import struct
from typing import Any, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._model import Model, Shape, SkinParts, compose, inverse, matrices, normals_of, surface

Array = NDArray[np.float64]
_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_VERTICES, _INDICES = 34962, 34963  # targets of buffer views
_INFLUENCES = 4  # of a vertex, by glTF
Y_UP = np.array([0, 0, 0, np.sqrt(0.5), -np.sqrt(0.5), 0, 0])
"""The world's z becomes y."""
# A body that moves less in its parent has no track [m] [1].
_STILL = 2e-5, 1e-6


class _Buffer:
    """Accessors and views of one buffer."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], kind: int, target: Optional[int] = None, bounds: bool = False) -> int:
        """The accessor of an array, one element a row."""
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": values.nbytes}
        if target:
            view["target"] = target
        accessor: dict[str, Any] = {"bufferView": len(self.views), "componentType": kind, "count": len(values),
                                    "type": _TYPES[values[0].size]}
        if bounds:
            rows = values.reshape(len(values), -1)
            accessor.update(min=rows.min(0).tolist(), max=rows.max(0).tolist())
        self.views.append(view)
        self.accessors.append(accessor)
        self.parts.append(values.tobytes() + b"\0" * (-values.nbytes % 4))
        self.size += len(self.parts[-1])
        return len(self.accessors) - 1


def strongest(weights: Array) -> tuple[NDArray[np.uint16], NDArray[np.float32]]:
    """The bodies of most weight and their shares, which sum to 1."""
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :_INFLUENCES]
    shares = np.take_along_axis(weights, joints, axis=1)
    parts: NDArray[np.float32] = (shares / shares.sum(axis=1, keepdims=True)).astype(np.float32)
    return np.where(parts > 0, joints, 0).astype(np.uint16), parts


def rig(model: Model) -> Array:
    """Where the node of each body is in the body: at the joint that carries it, a palm's at its wrist."""
    out = np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(model.bodies), 1))
    for joint in model.joints:
        if not joint.closes_loop:
            out[joint.child, :3] = joint.child_frame[:3]
    for hand in model.hands:
        out[hand.palm, :3] = hand.wrist[:3]
    return out


def shown_shapes(model: Model, skins: Sequence[SkinParts], hands: str) -> list[Shape]:
    """Shapes that are seen, nails included; what skin covers has none in ``skin``. A forearm has the skin's colour."""
    covered = {body for skin in skins for body in skin.bodies}
    of_hands = {body for hand in model.hands for body in hand.bodies}
    out = [shape for shape in model.shapes if hands != "skin" or shape.body not in covered]
    if skins and hands == "skin":
        out = [shape._replace(colour=skins[0].colour) if shape.body in of_hands else shape for shape in out]
        tone = 0.8 * np.array(skins[0].colour) + 0.2
        return out + [nail._replace(colour=tone.tolist()) for nail in model.nails if nail.body in covered]
    return out + model.nails


class _Writer:
    def __init__(self, model: Model, names: Sequence[str], poses: Array) -> None:
        self.model, self.out = model, _Buffer()
        self.frames = rig(model)
        self.world = compose(poses, self.frames[None])
        parents = [model.parent(body) for body in range(len(model.bodies))]
        self.local = np.stack([self.world[:, b] if p == 0 else compose(inverse(self.world[:, p]), self.world[:, b])
                               for b, p in enumerate(parents)], axis=1)
        # Node b is body b, node 0 the world.
        self.nodes: list[dict[str, Any]] = []
        for body, name in enumerate(names):
            self.nodes.append({"name": name, **self.placed(self.local[0, body] if body else Y_UP)})
        for body, parent in enumerate(parents):
            if body:
                self.nodes[parent].setdefault("children", []).append(body)
        self.meshes: list[dict[str, Any]] = []
        self.materials: dict[tuple[float, ...], int] = {}
        self.skins: list[dict[str, Any]] = []
        self.roots = [0]

    @staticmethod
    def placed(x: Array) -> dict[str, Any]:
        return {"translation": x[:3].tolist(), "rotation": np.clip(x[[4, 5, 6, 3]], -1, 1).tolist()}

    def material(self, colour: Sequence[float]) -> int:
        return self.materials.setdefault(tuple(colour), len(self.materials))

    def primitive(self, points: Array, normals: Array, faces: NDArray[Any], colour: Sequence[float]) -> dict[str, Any]:
        attributes = {"POSITION": self.out.add(points.astype(np.float32), _FLOAT, _VERTICES, bounds=True),
                      "NORMAL": self.out.add(normals.astype(np.float32), _FLOAT, _VERTICES)}
        return {"attributes": attributes, "indices": self.out.add(faces.astype(np.uint32).reshape(-1), _UINT32, _INDICES),
                "material": self.material(colour)}

    def mesh(self, name: str, primitive: dict[str, Any]) -> int:
        self.meshes.append({"name": name, "primitives": [primitive]})
        return len(self.meshes) - 1

    def add_shape(self, shape: Shape) -> None:
        of = surface(shape)
        mesh = self.mesh(shape.name, self.primitive(of.points, of.normals, of.faces, shape.colour))
        place = compose(inverse(self.frames[shape.body]), shape.pose)
        self.nodes[shape.body].setdefault("children", []).append(len(self.nodes))
        self.nodes.append({"name": shape.name, "mesh": mesh, **self.placed(place)})

    def add_skin(self, skin: SkinParts, palm_in_hand: Array, name: str) -> None:
        """With its points where the hand is at the start, so that a viewer frames it."""
        body = skin.bodies[0]
        at = compose(compose(Y_UP, self.world[0, body]), inverse(compose(palm_in_hand, self.frames[body])))
        points = (matrices(at) @ np.concatenate([skin.points, np.ones((len(skin.points), 1))], axis=1)[..., None])[:, :3, 0]
        primitive = self.primitive(points, normals_of(points, skin.faces.astype(int)), skin.faces, skin.colour)
        joints, shares = strongest(skin.weights)
        primitive["attributes"].update(JOINTS_0=self.out.add(joints, _UINT16, _VERTICES), WEIGHTS_0=self.out.add(shares, _FLOAT, _VERTICES))
        bind = matrices(inverse(compose(at, compose(skin.rest, self.frames[skin.bodies]))))
        # Matrices are column by column.
        inverses = self.out.add(np.ascontiguousarray(bind.transpose(0, 2, 1), dtype=np.float32), _FLOAT)
        self.skins.append({"name": name, "joints": skin.bodies, "skeleton": 0, "inverseBindMatrices": inverses})
        self.roots.append(len(self.nodes))
        self.nodes.append({"name": name, "mesh": self.mesh(name, primitive), "skin": len(self.skins) - 1})

    def animation(self, times: Array) -> dict[str, Any]:
        """Tracks of the bodies that move in their parents."""
        clock = self.out.add(times.astype(np.float32), _FLOAT, bounds=True)
        samplers: list[dict[str, Any]] = []
        channels: list[dict[str, Any]] = []
        for body in range(1, len(self.model.bodies)):
            turns = _continuous(self.local[:, body][:, [4, 5, 6, 3]])
            for path, values, still in (("translation", self.local[:, body, :3], _STILL[0]), ("rotation", turns, _STILL[1])):
                if np.abs(values - values[0]).max() <= still:
                    continue
                channels.append({"sampler": len(samplers), "target": {"node": body, "path": path}})
                samplers.append({"input": clock, "output": self.out.add(values.astype(np.float32), _FLOAT)})
        return {"name": "motion", "samplers": samplers, "channels": channels}

    def content(self, times: Optional[Array]) -> bytes:
        content: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "handsim"}, "scene": 0,
            "scenes": [{"name": self.model.title, "nodes": self.roots}], "nodes": self.nodes}
        if times is not None and len(times) > 1:
            moving = self.animation(times)
            if moving["channels"]:
                content["animations"] = [moving]
        if self.skins:
            content["skins"] = self.skins
        content["meshes"] = self.meshes
        content["materials"] = [{"name": f"colour {i}", "pbrMetallicRoughness": {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0,
                                 "roughnessFactor": 0.6}} for i, colour in enumerate(self.materials)]
        content.update(accessors=self.out.accessors, bufferViews=self.out.views, buffers=[{"byteLength": self.out.size}])
        text = json.dumps({key: value for key, value in content.items() if value != []}).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self.out.size
        return b"".join([struct.pack("<4sIII4s", b"glTF", 2, total, len(text), b"JSON"), text,
                         struct.pack("<I4s", self.out.size, b"BIN\0"), *self.out.parts])


def _continuous(turns: Array) -> Array:
    """The quaternion or its opposite, on the side of the row before: viewers interpolate."""
    sides = np.where(np.sum(turns[1:] * turns[:-1], axis=1) < 0, -1.0, 1.0)
    return np.asarray(turns * np.cumprod([1.0, *sides])[:, None])


def glb_of_model(model: Model, skins: Sequence[SkinParts], poses: Array, times: Optional[Array], *, hands: str = "skin",
                 names: Optional[Sequence[str]] = None) -> bytes:
    """A scene with the bodies at these poses.

    :param poses: of all bodies, x y z and quaternion w x y z, shape (times, bodies, 7)
    :param times: of an animation [s]; None: the first pose alone
    :param hands: ``skin``, ``shapes`` or ``both``
    :param names: of the nodes, by body
    """
    out = _Writer(model, names or [model.title, *(body.name for body in model.bodies[1:])], poses)
    for skin, hand in zip(skins, model.hands) if hands != "shapes" else ():
        out.add_skin(skin, inverse(hand.wrist), f"{hand.name} skin" if names is None else "skin")
    for shape in shown_shapes(model, skins, hands):
        out.add_shape(shape)
    return out.content(times)
