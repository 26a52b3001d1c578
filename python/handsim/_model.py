"""What a scene's model is made of: bodies, joints, shapes and the skins of hands; and triangles of shapes."""
from __future__ import annotations

import json
import math
from typing import Any, NamedTuple, Optional

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
    """Of the stop; infinite without one."""
    stiffness: float
    damping: float
    rest: float
    """Of the tissue; zeros without one."""
    has_tissue: bool


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
    first: int
    """Its first coordinate."""

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
    rolling_friction: float
    spinning_friction: float
    restitution: float
    group: int
    """For the rules of contact."""
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


class Touch(NamedTuple):
    """The surface between two shapes that may touch."""

    friction: float
    rolling_friction: float
    spinning_friction: float
    """[m]"""
    spring: Optional[list[float]]
    """Stiffness [N/m] and damping [N s/m]; None: rigid."""
    stiffens: bool
    """Of pads that stiffen or spin by their area: all numbers are those of a lasting press of `Model.lasting_load`."""


class Path(NamedTuple):
    """Of a tendon: its excursion is the sum of the polynomials' integrals and the products."""

    dofs: list[int]
    """Coordinates that it crosses."""
    polynomials: list[list[float]]
    """Moment arm about each, coefficients of rising powers."""
    products: list[tuple[int, int, int, int, float]]
    """Two places in `dofs`, the powers of both angles, and a factor."""
    excursion: float
    """At the start [m]."""
    arms: list[float]
    """At the start [m]."""


class Muscle(NamedTuple):
    name: str
    path: Path
    force: float
    fibre_length: float
    slack_length: float
    length: float
    """Of muscle and tendon at zero coordinates [m]."""
    pennation: float
    activation_time: float
    deactivation_time: float
    max_speed: float
    """[optimal fibre lengths/s]"""
    excitable: float
    """Share of its excitation that reaches its fibres."""
    spills: list[tuple[int, float]]
    """Muscles, and the share of each one's activation that this one has at least where activations are chosen."""
    common_drive: float
    """Least activation as a share of that of every other muscle of the common drive, while several of its fingers press; 0: it has none."""
    effort: float
    """Largest activation, of muscles of a finger that is numb less than 1."""
    elastic: bool
    """Whether its tendon is."""
    short_range: bool
    """Whether its fibres have a short-range stiffness."""
    isometric: float
    """Force that full activation adds at the start [N]."""
    passive: float
    """Force at the start without activation [N]."""


class Band(NamedTuple):
    """Its tension is stiffness (x - rest) + damping dx/dt, x less the excursion; slack ones only pull."""

    name: str
    path: Path
    stiffness: float
    damping: float
    rest: float
    both_ways: bool


class Drive(NamedTuple):
    """Of a fixed body that follows a motion."""

    body: int
    frame: Array
    """The frame that the motion is of, in the body's."""
    times: list[float]
    poses: Array
    """Shape (times, 7)."""


class Servo(NamedTuple):
    """A drive of a coordinate at the start: a spring and a damper to a target, with a torque limit."""

    dof: int
    stiffness: float
    damping: float
    error: float
    """Target less coordinate."""
    feed: float
    """Torque added to them."""
    limit: float


class Start(NamedTuple):
    """The state at the start."""

    time: float
    q: list[float]
    u: list[float]
    poses: Array
    """Of all bodies, shape (bodies, 7)."""
    velocities: Array
    turning: Array
    """Angular velocities, world axes."""


def _axis(of: dict[str, Any]) -> Axis:
    low, high = of["stop"] or (None, None)
    stiffness, damping, rest = of["tissue"] or (0.0, 0.0, 0.0)
    return Axis(of["name"], np.array(of["axis"]), -math.inf if low is None else low, math.inf if high is None else high,
                stiffness, damping, rest, of["tissue"] is not None)


def _filled(kind: Any, of: dict[str, Any], **more: Any) -> Any:
    """A tuple of the fields in the description, of which some are other objects here."""
    return kind(**{**of, **more})


def _arrays(of: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: np.array(of[key], float) for key in keys}


def _shape(of: dict[str, Any]) -> Shape:
    shape: Shape = _filled(Shape, of, **_arrays(of, "pose", "edges"), corners=np.array(of["corners"], float).reshape(-1, 3),
                           faces=np.array(of["faces"], float).reshape(-1, 3))
    return shape


class Model:
    """All of a scene's model that files for other programs need: what src/handsim/output/description/description.h says."""

    def __init__(self, description: str, title: str = "") -> None:
        of: dict[str, Any] = json.loads(description)
        self.title = title
        self.gravity: Array = np.array(of["gravity"])
        self.step: float = of["step"]
        self.effects = frozenset(of["effects"])
        self.bodies: list[Body] = [_filled(Body, each, **_arrays(each, "inertia", "zero")) for each in of["bodies"]]
        self.joints: list[Joint] = [_filled(Joint, each, **_arrays(each, "parent_frame", "child_frame"),
                                            axes=[_axis(axis) for axis in each["axes"]]) for each in of["joints"]]
        self.shapes, self.nails = ([_shape(each) for each in of[key]] for key in ("shapes", "nails"))
        self.hands: list[HandParts] = [
            _filled(HandParts, each, **_arrays(each, "wrist"), tips=[(tip, body, np.array(point)) for tip, body, point in each["tips"]])
            for each in of["hands"]]
        self.markers = [(name, body, np.array(point)) for name, body, point in of["markers"]]
        self.drives = [Drive(each["body"], np.array(each["frame"]), each["times"], np.array(each["poses"])) for each in of["drives"]]
        self.muscles: list[Muscle] = [_filled(Muscle, each, path=Path(**each["path"])) for each in of["muscles"]]
        self.bands: list[Band] = [_filled(Band, each, path=Path(**each["path"])) for each in of["bands"]]
        self.curves: dict[str, float] = of["curves"]
        """Numbers of the muscles' curves: src/handsim/model/muscle_curves.h."""
        self.servos = {each["dof"]: Servo(**each) for each in of["servos"]}
        self.implicit: bool = of["implicit"]
        """Whether the drives act implicitly."""
        self.start: Start = _filled(Start, of["start"], **_arrays(of["start"], "poses", "velocities", "turning"))
        self.groups: int = of["groups"]
        self.rules: list[tuple[int, int]] = of["rules"]
        """Groups of shapes that touch each other."""
        self.pairs: list[tuple[int, int, int]] = of["pairs"]
        """Two shapes that may touch, and the place of their surface in `touches`."""
        self.touches = [Touch(**each) for each in of["surfaces"]]
        self.lasting_load: float = of["lasting_load"]
        """[N]"""
        self.mobilities: Optional[list[float]] = of["mobilities"]
        """How fast a force at the centre of mass of each body accelerates it, the mean over three directions, at zero coordinates [1/kg];
        None without soft surfaces."""

    def parent(self, body: int) -> int:
        """The body that carries it; 0: the world."""
        return next((joint.parent for joint in self.joints if joint.child == body and not joint.closes_loop), 0)

    def roots(self) -> list[int]:
        """Bodies without a joint that holds them."""
        held = {joint.child for joint in self.joints if not joint.closes_loop}
        return [body for body in range(1, len(self.bodies)) if body not in held]

    def drive(self, body: int) -> Optional[Drive]:
        """That moves a fixed body; None where none does."""
        if not self.bodies[body].fixed or "wrist_motion" not in self.effects:
            return None
        return next((drive for drive in self.drives if drive.body == body), None)

    def stopped(self, axis: Axis) -> bool:
        """Whether its limits act."""
        return "joint_stops" in self.effects and math.isfinite(axis.low) and math.isfinite(axis.high)

    def passive(self, axis: Axis) -> bool:
        """Whether its tissue acts."""
        return axis.has_tissue and "passive_tissue" in self.effects

    def pull(self) -> Array:
        """Gravity, where it acts."""
        return self.gravity if "gravity" in self.effects else np.zeros(3)


def skins_of(scene: _core.Scene) -> list[SkinParts]:
    return [SkinParts(*each) for each in _core.skins(scene)]


# Poses are rows of x y z and a quaternion w x y z.

IDENTITY = np.array([0.0, 0, 0, 1, 0, 0, 0])


def posed(place: ArrayLike = (0, 0, 0), turn: ArrayLike = (1, 0, 0, 0)) -> Array:
    """A pose of its place and its quaternion."""
    return np.concatenate([np.asarray(place, float), np.asarray(turn, float)])


def quaternion_of(axes: Array) -> Array:
    """Of a rotation matrix."""
    trace = np.trace(axes)
    if trace > 0:
        s = 2 * math.sqrt(trace + 1)
        v = [axes[2, 1] - axes[1, 2], axes[0, 2] - axes[2, 0], axes[1, 0] - axes[0, 1]]
        return np.array([s / 4, *(x / s for x in v)])
    i = int(np.argmax(np.diag(axes)))
    j, k = (i + 1) % 3, (i + 2) % 3
    s = 2 * math.sqrt(axes[i, i] - axes[j, j] - axes[k, k] + 1)
    out = np.zeros(4)
    out[0], out[1 + i] = (axes[k, j] - axes[j, k]) / s, s / 4
    out[1 + j], out[1 + k] = (axes[j, i] + axes[i, j]) / s, (axes[k, i] + axes[i, k]) / s
    return out


def turn_of(rotation_vector: ArrayLike) -> Array:
    """The quaternion of a rotation vector [rad]."""
    r = np.asarray(rotation_vector, float)
    angle = float(np.linalg.norm(r))
    if angle < 1e-12:
        near = np.array([1.0, *(0.5 * r)])
        return np.asarray(near / np.linalg.norm(near))
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) / angle * r)])


def product(a: ArrayLike, b: ArrayLike) -> Array:
    """Of quaternions w x y z, shape (..., 4)."""
    (aw, ax, ay, az), (bw, bx, by, bz) = (np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0) for q in (a, b))
    return np.stack([aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
                     aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw], axis=-1)


def cross(a: Array, b: Array) -> Array:
    """As numpy.cross of vectors of three, which takes five times as long for few of them."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    ax, ay, az, bx, by, bz = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    out[..., 0], out[..., 1], out[..., 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return out


def turned(q: Array, v: ArrayLike) -> Array:
    """Vectors in the axes that a quaternion leads to."""
    w, r = q[..., :1], q[..., 1:]
    v = np.asarray(v, dtype=np.float64)
    # With one cross product inside the other, mypy tries all pairs of their overloads.
    across: Array = cross(r, v) + w * v
    return np.asarray(v + 2 * cross(r, across))


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
