"""What a scene's model is made of: bodies, joints, shapes and the skins of hands; and triangles of shapes."""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core

Array = NDArray[np.float64]
SIDES = 32  # of round shapes
PLANE = 1.0  # half the edge of a drawn plane [m]


class Body(NamedTuple):
    """Its frame has its origin at the centre of mass."""

    name: str
    mass: float
    inertia: Array
    """In body axes, shape (3, 3)."""
    zero: Array
    """Pose in the world with all coordinates at zero: x y z and quaternion w x y z."""
    fixed: bool
    """Is driven or stands still."""


class Axis(NamedTuple):
    name: str
    axis: Array
    """The first in the frame of the parent, the second in that of the child; at zero both frames coincide."""
    low: float
    high: float
    stiffness: float
    damping: float
    rest: float


class Joint(NamedTuple):
    name: str
    kind: str
    """hinge, universal, ball or slider."""
    slides: list[bool]
    """Of each coordinate: whether it is a length along an axis rather than an angle."""
    parent: int
    child: int
    parent_frame: Array
    child_frame: Array
    axes: list[Axis]
    closes_loop: bool

    @property
    def spherical(self) -> bool:
        """Whether the child turns freely: the last three coordinates are a rotation vector, without axes."""
        return len(self.slides) == len(self.axes) + 3


class Shape(NamedTuple):
    name: str
    kind: str
    """box, capsule, cylinder, sphere, convex_mesh or plane; along z."""
    body: int
    pose: Array
    radius: float
    length: float
    edges: Array
    part: str
    colour: list[float]
    """Linear red, green, blue."""
    friction: float
    restitution: float
    corners: Array
    """Of a mesh, shape (n, 3)."""
    faces: Array
    """Rows of three corners."""


class HandParts(NamedTuple):
    name: str
    bodies: list[int]
    palm: int
    wrist: Array
    """Pose of the hand frame in the palm."""
    joints: list[int]
    tips: list[tuple[str, int, Array]]
    """Name, body and place in it of each fingertip."""


class SkinParts(NamedTuple):
    bodies: list[int]
    rest: Array
    """Poses of the bodies in the hand frame for which points are given; fingers are spread."""
    points: Array
    faces: Array
    weights: Array
    """Columns as bodies."""
    colour: list[float]


class Surface(NamedTuple):
    points: Array
    normals: Array
    faces: NDArray[np.uint32]


def _joint(of: Any) -> Joint:
    name, kind, slides, parent, child, first, second, axes, loop = of
    return Joint(name, kind, slides, parent, child, np.array(first), np.array(second),
                 [Axis(word, axis.ravel(), *rest) for word, axis, *rest in axes], loop)


def _shape(of: Any) -> Shape:
    fields: list[Any] = list(of)
    fields[3], fields[6] = np.array(fields[3]), fields[6].ravel()
    return Shape(*fields)


def _hand(of: Any) -> HandParts:
    name, bodies, palm, wrist, joints, tips = of
    return HandParts(name, bodies, palm, np.array(wrist), joints, [(tip, body, point.ravel()) for tip, body, point in tips])


class Model:
    """All of a scene's model that files for other programs need."""

    def __init__(self, scene: _core.Scene) -> None:
        of: dict[str, Any] = _core.description(scene)
        self.title = scene.title
        self.gravity: Array = of["gravity"].ravel()
        self.bodies = [Body(name, mass, inertia, np.array(zero), fixed) for name, mass, inertia, zero, fixed in of["bodies"]]
        self.joints = [_joint(each) for each in of["joints"]]
        self.shapes, self.nails = ([_shape(each) for each in of[key]] for key in ("shapes", "nails"))
        self.hands = [_hand(each) for each in of["hands"]]

    def parent(self, body: int) -> int:
        """The body that carries it; 0: the world."""
        return next((joint.parent for joint in self.joints if joint.child == body and not joint.closes_loop), 0)


def skins_of(scene: _core.Scene) -> list[SkinParts]:
    return [SkinParts(*each) for each in _core.skins(scene)]


# Poses are rows of x y z and a quaternion w x y z.


def product(a: ArrayLike, b: ArrayLike) -> Array:
    """Of quaternions w x y z, shape (..., 4)."""
    (aw, ax, ay, az), (bw, bx, by, bz) = (np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0) for q in (a, b))
    return np.stack([aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
                     aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw], axis=-1)


def turned(q: Array, v: ArrayLike) -> Array:
    """Vectors in the axes that a quaternion leads to."""
    w, r = q[..., :1], q[..., 1:]
    v = np.asarray(v, dtype=np.float64)
    return np.asarray(v + 2 * np.cross(r, np.cross(r, v) + w * v))


def compose(a: Array, b: Array) -> Array:
    """The pose b in the frame of pose a."""
    return np.concatenate([a[..., :3] + turned(a[..., 3:], b[..., :3]), product(a[..., 3:], b[..., 3:])], axis=-1)


def inverse(x: Array) -> Array:
    back = x[..., 3:] * [1, -1, -1, -1]
    return np.concatenate([-turned(back, x[..., :3]), back], axis=-1)


def matrices(x: Array) -> Array:
    """Of poses, shape (..., 4, 4)."""
    out = np.zeros((*x.shape[:-1], 4, 4))
    for k in range(3):
        out[..., :3, k] = turned(x[..., 3:], np.eye(3)[k])
    out[..., :3, 3], out[..., 3, 3] = x[..., :3], 1
    return out


def bent(skin: SkinParts, poses: Array) -> Array:
    """Points of a skin whose bodies have these poses: dual quaternions, as in pictures (Kavan et al. 2008)."""
    motion = compose(poses, inverse(skin.rest))
    half = np.concatenate([np.zeros((len(motion), 1)), motion[:, :3] / 2], axis=1)
    both = np.concatenate([motion[:, 3:], product(half, motion[:, 3:])], axis=1)
    # q and -q are one rotation: the side of each point's strongest body.
    strongest = both[np.argmax(skin.weights, axis=1), :4]
    total = (skin.weights * np.where(strongest @ both[:, :4].T < 0, -1, 1)) @ both
    total /= np.linalg.norm(total[:, :4], axis=1, keepdims=True)
    back = total[:, :4] * [1, -1, -1, -1]
    return np.asarray(turned(total[:, :4], skin.points) + 2 * product(total[:, 4:], back)[:, 1:])


def normals_of(points: Array, faces: NDArray[Any]) -> Array:
    """Of points: of the faces about each, by area."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    out = np.zeros_like(points)
    for k in range(3):
        np.add.at(out, faces[:, k], np.cross(b - a, c - a))
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-30))


def _rings(outline: Array, normals: Array) -> Surface:
    """Turns an outline of (radius, z) about z."""
    angle = 2 * np.pi * np.arange(SIDES + 1) / SIDES
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def turn(rows: Array) -> Array:
        flat = rows[:, None, :1] * around[None]
        return np.asarray(np.concatenate([flat, np.broadcast_to(rows[:, None, 1:], (len(rows), SIDES + 1, 1))], axis=2).reshape(-1, 3))

    i, k = (each.ravel() for each in np.meshgrid(np.arange(len(outline) - 1), np.arange(SIDES), indexing="ij"))
    first = i * (SIDES + 1) + k
    above = first + SIDES + 1
    faces = np.concatenate([np.stack([first, first + 1, above + 1], 1), np.stack([first, above + 1, above], 1)])
    points = turn(outline)
    a, b, c = (points[faces[:, j]] for j in range(3))
    whole = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-14
    return Surface(points, turn(normals), faces[whole].astype(np.uint32))


def _flat(corners: Array, faces: NDArray[Any]) -> Surface:
    """Each face with corners of its own."""
    points = corners[faces.astype(int)].reshape(-1, 3)
    own = np.arange(len(points), dtype=np.uint32).reshape(-1, 3)
    return Surface(points, normals_of(points, own), own)


_CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_CUBE_FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
                        [1, 5, 7], [1, 7, 3]])


def surface(shape: Shape) -> Surface:
    """Triangles of a shape in its frame, counter-clockwise seen from outside."""
    if shape.kind == "convex_mesh":
        return _flat(shape.corners, shape.faces)
    if shape.kind == "box":
        return _flat(_CUBE * shape.edges, _CUBE_FACES)
    if shape.kind == "plane":
        return _flat(np.array([[-PLANE, -PLANE, 0], [PLANE, -PLANE, 0], [PLANE, PLANE, 0], [-PLANE, PLANE, 0]]),
                     np.array([[0, 1, 2], [0, 2, 3]]))
    half = shape.length / 2
    if shape.kind == "cylinder":
        r = shape.radius
        return _rings(np.array([[0, -half], [r, -half], [r, -half], [r, half], [r, half], [0, half]]),
                      np.array([[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]], dtype=np.float64))
    quarter = np.pi / 2 * np.arange(9) / 8
    latitude = np.concatenate([quarter - np.pi / 2, quarter])
    normals = np.stack([np.cos(latitude), np.sin(latitude)], axis=1)
    middle = np.repeat([-half, half], 9) if shape.kind == "capsule" else np.zeros(18)
    return _rings(shape.radius * normals + np.stack([np.zeros(18), middle], axis=1), normals)
