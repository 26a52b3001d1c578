"""A scene as USD's text form, a moment or its motion: UsdGeom, UsdPhysics (bodies, joints, collision shapes), UsdSkel (skin)."""
from __future__ import annotations

import math
import re
from typing import Any, Iterable, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._glb import rig, strongest
from ._model import HandParts, Joint, Model, Shape, SkinParts, compose, inverse, matrices, normals_of, turned

Array = NDArray[np.float64]
_LOCKED = (1.0, -1.0)  # an axis whose lower limit is above its upper one, by UsdPhysics


def _number(x: float) -> str:
    return f"{x:.9g}"


def _tuple(values: Iterable[float]) -> str:
    return "(" + ", ".join(_number(x) for x in values) + ")"


def _tuples(rows: Iterable[Iterable[float]]) -> str:
    return "[" + ", ".join(_tuple(row) for row in rows) + "]"


def _matrix(m: Array) -> str:
    """USD's vectors are rows."""
    return "( " + ", ".join(_tuple(row) for row in m.T) + " )"


def _text(value: str) -> str:
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'


def _name(value: str) -> str:
    out = re.sub(r"\W", "_", value, flags=re.ASCII)
    return out if out and not out[0].isdigit() else "_" + out


class _Prim:
    """A prim of the text: `def TYPE "NAME" (apis) { lines, children }`."""

    def __init__(self, kind: str, name: str, apis: Sequence[str] = (), lines: Sequence[str] = ()) -> None:
        self.kind, self.name, self.apis, self.lines = kind, _name(name), list(apis), list(lines)
        self.children: list[_Prim] = []

    def add(self, child: "_Prim") -> "_Prim":
        taken = {each.name for each in self.children}
        while child.name in taken:
            child.name += "_"
        self.children.append(child)
        return child

    def text(self, indent: str = "") -> str:
        apis = f" (\n{indent}    prepend apiSchemas = [" + ", ".join(f'"{api}"' for api in self.apis) + f"]\n{indent})" if self.apis else ""
        inner = "".join(f"{indent}    {line}\n" for line in self.lines)
        children = "".join("\n" + child.text(indent + "    ") for child in self.children)
        return f'{indent}def {self.kind} "{self.name}"{apis}\n{indent}{{\n{inner}{children}{indent}}}\n'


def _samples(name: str, values: Sequence[str], codes: Optional[Array]) -> list[str]:
    """An attribute: its first value, and its values by time code where it changes."""
    out = [f"{name} = {values[0]}"]
    if codes is not None and len(set(values)) > 1:
        out.append(f"{name}.timeSamples = {{ " + ", ".join(f"{_number(code)}: {value}" for code, value in zip(codes, values)) + " }")
    return out


def _steady(quaternions: Array) -> Array:
    """Of the two quaternions of each rotation the one near that of the row before; rows are times."""
    dots = np.sum(quaternions[1:] * quaternions[:-1], axis=-1, keepdims=True)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([quaternions[:1], signs * quaternions[1:]])


def _placed(poses: Array, codes: Optional[Array] = None) -> list[str]:
    """At poses by time, or at one."""
    rows = np.atleast_2d(poses)
    return [*_samples("double3 xformOp:translate", [_tuple(x[:3]) for x in rows], codes),
            *_samples("quatd xformOp:orient", [_tuple(q) for q in _steady(rows[:, 3:])], codes),
            'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]']


def _axes(x: Array, y: Array) -> Array:
    """Quaternion of the frame whose x axis is x and whose y axis is towards y."""
    z = np.cross(x, y)
    z /= np.linalg.norm(z)
    m = np.stack([x, np.cross(z, x), z], axis=1)
    w = math.sqrt(max(0.0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
    if w > 0.25:
        return np.array([w, (m[2, 1] - m[1, 2]) / (4 * w), (m[0, 2] - m[2, 0]) / (4 * w), (m[1, 0] - m[0, 1]) / (4 * w)])
    # From the largest of x, y and z.
    i = int(np.argmax(np.diag(m)))
    j, k = (i + 1) % 3, (i + 2) % 3
    r = math.sqrt(max(0.0, 1 + m[i, i] - m[j, j] - m[k, k]))
    out = np.zeros(4)
    out[0], out[1 + i], out[1 + j], out[1 + k] = (m[k, j] - m[j, k]) / (2 * r), r / 2, (m[j, i] + m[i, j]) / (2 * r), (m[k, i] + m[i, k]) / (2 * r)
    return out


def _shape(shape: Shape, seen: bool, touches: bool, material: str) -> _Prim:
    kinds = {"box": "Cube", "capsule": "Capsule", "cylinder": "Cylinder", "sphere": "Sphere", "convex_mesh": "Mesh", "plane": "Plane"}
    lines = [f"color3f[] primvars:displayColor = [{_tuple(shape.colour)}]", *_placed(shape.pose)]
    apis = []
    if touches:
        apis = ["PhysicsCollisionAPI", "MaterialBindingAPI"]
        lines.append(f"rel material:binding:physics = <{material}>")
    if not seen:
        lines.append('uniform token purpose = "guide"')
    if shape.kind == "box":
        lines += ["double size = 1", f"float3 xformOp:scale = {_tuple(shape.edges)}"]
        lines[3] = 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient", "xformOp:scale"]'
    elif shape.kind == "convex_mesh":
        apis += ["PhysicsMeshCollisionAPI"] if touches else []
        lines += _mesh(shape.corners, shape.faces) + (['uniform token physics:approximation = "convexHull"'] if touches else [])
    elif shape.kind == "plane":
        lines += ['uniform token axis = "Z"', "double width = 2", "double length = 2"]
    else:
        lines.append(f"double radius = {_number(shape.radius)}")
        if shape.kind != "sphere":
            lines += ['uniform token axis = "Z"', f"double height = {_number(shape.length)}"]
    return _Prim(kinds[shape.kind], shape.name.partition(".")[2] or shape.name, apis, lines)


def _mesh(points: Array, faces: NDArray[Any]) -> list[str]:
    return [f"point3f[] points = {_tuples(points)}", f"float3[] extent = {_tuples([points.min(0), points.max(0)])}",
            f"int[] faceVertexCounts = [{', '.join(['3'] * len(faces))}]",
            f"int[] faceVertexIndices = [{', '.join(str(i) for i in faces.astype(int).ravel())}]", 'uniform token subdivisionScheme = "none"']


def _joint(joint: Joint, paths: Sequence[str]) -> _Prim:
    """Its frame has the first axis as x, and of two axes the second as y, as far as it is normal to the first."""
    kind = {"hinge": "PhysicsRevoluteJoint", "ball": "PhysicsSphericalJoint", "slider": "PhysicsPrismaticJoint"}.get(joint.kind, "PhysicsJoint")
    frame, apis = np.array([1.0, 0, 0, 0]), []
    first = joint.axes[0].axis if joint.axes else np.array([1.0, 0, 0])
    if joint.axes:
        second = joint.axes[1].axis if len(joint.axes) > 1 else np.roll(np.where(np.arange(3) == np.argmax(np.abs(first)), 1.0, 0.0), 1)
        frame = _axes(first / np.linalg.norm(first), second)
    lines = [f"rel physics:body1 = <{paths[joint.child]}>"]
    if joint.parent:
        lines.append(f"rel physics:body0 = <{paths[joint.parent]}>")
    for i, x in enumerate((joint.parent_frame, joint.child_frame)):
        both = compose(x, np.concatenate([[0.0, 0, 0], frame]))
        lines += [f"point3f physics:localPos{i} = {_tuple(both[:3])}", f"quatf physics:localRot{i} = {_tuple(both[3:])}"]
    scales = [1 if slides else 180 / math.pi for slides in joint.slides]
    if len(joint.slides) == 1:
        lines.append('uniform token physics:axis = "X"')
        for word, limit in (("lower", joint.axes[0].low), ("upper", joint.axes[0].high)):
            if math.isfinite(limit):
                lines.append(f"float physics:{word}Limit = {_number(scales[0] * limit)}")
    if kind == "PhysicsJoint":
        words = ["transX"] * sum(joint.slides) + ["rotX", "rotY"]
        own = {word: (scale * axis.low, scale * axis.high) for word, axis, scale in zip(words, joint.axes, scales)}
        limits = {word: _LOCKED for word in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ") if word not in own} | own
        for word, (low, high) in limits.items():
            if math.isfinite(low) and math.isfinite(high):
                apis.append(f"PhysicsLimitAPI:{word}")
                lines += [f"float limit:{word}:physics:low = {_number(low)}", f"float limit:{word}:physics:high = {_number(high)}"]
    lines += [f"custom double3 handsim:axis:{_name(axis.name)} = {_tuple(axis.axis)}" for axis in joint.axes]
    if joint.closes_loop:
        lines.append("bool physics:excludeFromArticulation = 1")
    return _Prim(kind, joint.name, apis, lines)


def _inertia(inertia: Array) -> list[str]:
    moments, axes = np.linalg.eigh((inertia + inertia.T) / 2)
    diagonal = np.diag(inertia)
    if np.abs(inertia - np.diag(diagonal)).max() < 1e-9 * diagonal.max():
        moments, turn = diagonal, np.array([1.0, 0, 0, 0])
    else:
        turn = _axes(axes[:, 0], axes[:, 1])
    return [f"float3 physics:diagonalInertia = {_tuple(moments)}", f"quatf physics:principalAxes = {_tuple(turn)}"]


def _skin(model: Model, skin: SkinParts, hand: HandParts, poses: Array, codes: Optional[Array]) -> _Prim:
    """Mesh, skeleton and the poses by time, in the world."""
    frames, parents = rig(model), {body: model.parent(body) for body in skin.bodies}
    at = compose(poses[0][skin.bodies[0]], hand.wrist)
    points = at[:3] + turned(at[3:], skin.points)
    bind = compose(at, compose(skin.rest, frames[skin.bodies]))
    now = {body: compose(poses[:, body], frames[body]) for body in skin.bodies}
    local = np.stack([compose(inverse(now[parents[b]]), now[b]) if parents[b] in now else now[b] for b in skin.bodies], axis=1)
    turns = _steady(local[:, :, 3:])
    tokens: dict[int, str] = {}
    for body in skin.bodies:
        own = _name(model.bodies[body].name.partition(".")[2])
        tokens[body] = f"{tokens[parents[body]]}/{own}" if parents[body] in tokens else own
    joints = f"uniform token[] joints = [{', '.join(_text(each) for each in tokens.values())}]"
    root = _Prim("SkelRoot", f"{hand.name}_skin")
    path = f"/World/{root.name}"
    root.add(_Prim("Skeleton", "skeleton", ["SkelBindingAPI"], [
        joints, f"uniform matrix4d[] bindTransforms = [{', '.join(_matrix(m) for m in matrices(bind))}]",
        f"uniform matrix4d[] restTransforms = [{', '.join(_matrix(m) for m in matrices(local[0]))}]",
        f"rel skel:animationSource = <{path}/pose>"]))
    root.add(_Prim("SkelAnimation", "pose", (), [
        joints, *_samples("float3[] translations", [_tuples(rows[:, :3]) for rows in local], codes),
        *_samples("quatf[] rotations", [_tuples(rows) for rows in turns], codes),
        f"half3[] scales = {_tuples(np.ones((len(skin.bodies), 3)))}"]))
    indices, shares = strongest(skin.weights)
    root.add(_Prim("Mesh", "skin", ["SkelBindingAPI"], [
        *_mesh(points, skin.faces), f"color3f[] primvars:displayColor = [{_tuple(skin.colour)}]",
        f"normal3f[] normals = {_tuples(normals_of(points, skin.faces.astype(int)))} (\n        interpolation = \"vertex\"\n    )",
        f"int[] primvars:skel:jointIndices = [{', '.join(str(i) for i in indices.ravel())}] (\n        elementSize = 4\n        interpolation = \"vertex\"\n    )",
        f"float[] primvars:skel:jointWeights = [{', '.join(_number(x) for x in shares.ravel())}] (\n        elementSize = 4\n        interpolation = \"vertex\"\n    )",
        "matrix4d primvars:skel:geomBindTransform = ( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )",
        f"rel skel:skeleton = <{path}/skeleton>"]))
    return root


def usda_of(model: Model, skins: Sequence[SkinParts], poses: Array, times: Optional[Array] = None, fps: float = 60.0) -> str:
    """The text of a .usda file: metres, z up. Time codes are frames.

    :param poses: of all bodies, x y z and quaternion w x y z, shape (times, bodies, 7), or of one moment (bodies, 7)
    :param times: of a motion [s]
    """
    poses = poses.reshape(-1, len(model.bodies), 7)
    codes = None if times is None or len(times) < 2 else fps * times
    world = _Prim("Xform", "World")
    size = float(np.linalg.norm(model.gravity))
    down = model.gravity / size if size else np.array([0.0, 0, -1])
    world.add(_Prim("PhysicsScene", "physics", (), [f"vector3f physics:gravityDirection = {_tuple(down)}", f"float physics:gravityMagnitude = {_number(size)}"]))
    materials = world.add(_Prim("Scope", "materials"))
    bound: dict[tuple[float, float], str] = {}

    def material(shape: Shape) -> str:
        key = (shape.friction, shape.restitution)
        if key not in bound:
            prim = materials.add(_Prim("Material", f"surface_{len(bound)}", ["PhysicsMaterialAPI"], [
                *(f"float physics:{word}Friction = {_number(key[0])}" for word in ("static", "dynamic")), f"float physics:restitution = {_number(key[1])}"]))
            bound[key] = f"/World/materials/{prim.name}"
        return bound[key]

    covered = {body for skin in skins for body in skin.bodies}
    prims = [world]
    for body, x in zip(model.bodies[1:], poses.transpose(1, 0, 2)[1:]):
        prims.append(world.add(_Prim("Xform", body.name, ["PhysicsRigidBodyAPI", "PhysicsMassAPI"], [
            *_placed(x, codes), f"float physics:mass = {_number(body.mass)}", "point3f physics:centerOfMass = (0, 0, 0)", *_inertia(body.inertia),
            *(["bool physics:kinematicEnabled = 1"] if body.fixed else [])])))
    for shape in model.shapes:
        prims[shape.body].add(_shape(shape, shape.body not in covered, True, material(shape)))
    for nail in model.nails:
        prims[nail.body].add(_shape(nail, True, False, ""))
    paths = [f"/World/{prim.name}" for prim in prims]
    for joint in model.joints:
        world.add(_joint(joint, paths))
    for skin, hand in zip(skins, model.hands):
        world.add(_skin(model, skin, hand, poses, codes))
    moves = [] if codes is None else [f"    {key} = {_number(value)}" for key, value in (
        ("endTimeCode", codes[-1]), ("framesPerSecond", fps), ("startTimeCode", codes[0]), ("timeCodesPerSecond", fps))]
    head = ['    defaultPrim = "World"', f"    doc = {_text(model.title)}", "    kilogramsPerUnit = 1", "    metersPerUnit = 1", '    upAxis = "Z"', *moves]
    return "#usda 1.0\n(\n" + "\n".join(head) + "\n)\n\n" + world.text()
