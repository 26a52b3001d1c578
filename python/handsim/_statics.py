"""Forces and postures of a hand with muscles that is still: the largest forces on its skin, and where its joints rest. Rows of
`handsim validate` are computed so, and what `handsim compare` puts side by side."""
from __future__ import annotations

from contextlib import suppress
from itertools import permutations
from typing import Any, Callable, Iterable, Mapping, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._errors import Error, Fault, input_error
from ._hand import Hand
from ._scene import Scene

Array = NDArray[np.float64]
FUSED = 2.02e-3
"""A joint of a smaller range is fused [rad]: bone holds its moment."""
GIVES = np.radians(20)
"""A posture is one within this angle of each joint: over it tissue, resting muscles and ligaments hold moments, too. Chosen; docs/muscles.md says which
rows it moves."""
AT_STOP = 1e-6
"""An axis this near to its stop lies on it [rad]."""
INWARDS = -0.5
"""Cosine beyond which the other end lies inside the finger's shaft."""
EDGES = 8
"""Of a cone of friction."""
FRICTION = 0.6
"""Of skin on aluminium (Seo 2009), as in the rows of pinches and grips of `handsim validate`."""
FINGERS = ("index", "middle", "ring", "little")
DIRECTIONS = {"palmar": (0, 0, -1), "dorsal": (0, 0, 1), "distal": (0, 1, 0), "proximal": (0, -1, 0), "ulnar": (1, 0, 0), "radial": (-1, 0, 0)}
"""In the frame of a right hand's segment."""


def fault(where: str, quantity: str, detail: str) -> Error:
    """An error of the physics of a hand that is still."""
    return Error(f"{where}: {quantity}: {detail}", "physics", fault=Fault(0.0, where, quantity, detail))


class NotHeld(Error):
    """Muscles, tissue, stops and the forces that may press do not hold a posture: there is no force in it."""

    def __init__(self, where: str = "the hand") -> None:
        detail = "muscles and tissue do not hold this posture"
        super().__init__(f"{where}: largest force: {detail}", "physics", fault=Fault(0.0, where, "largest force", detail))


def largest(gain: Array, equal: Array, to: Array, most: Array, less: Optional[Array] = None, than: Optional[Array] = None) -> Array:
    """The x of the largest ``gain @ x`` with ``equal @ x == to``, ``less @ x <= than`` (0 without it) and ``0 <= x <= most``: a linear program, by HiGHS.

    :param most: inf: no bound
    :raises NotHeld: where no x is within the bounds
    :raises Error: of kind physics where the gain has no bound, or HiGHS no result; of kind input without SciPy
    """
    try:
        from scipy.optimize import linprog
    except ImportError:
        raise input_error("SciPy", "no Python module of this name", "it, for largest forces: pip install scipy") from None
    found = linprog(-gain, less, than if than is not None or less is None else np.zeros(len(less)), equal, to, np.stack([np.zeros(len(most)), most], axis=1), method="highs")
    if found.status == 2:
        raise NotHeld
    if not found.success:
        raise fault("the hand", "largest force", "it has no limit: stops hold all of it" if found.status == 3 else f"no result: {found.message}")
    return np.asarray(found.x)


def cone(normal: Array, friction: float) -> Array:
    """Edges of a cone of friction, each of a newton along its normal, shape (edges, 3); without friction the normal."""
    if friction == 0:
        return normal[None]
    x, y, z = normal
    first = np.array([-y, x, 0]) if np.hypot(x, y) > 1e-12 * abs(z) else np.array([0, -z, y])
    first = first / np.linalg.norm(first)
    turns = 2 * np.pi * np.arange(EDGES)[:, None] / EDGES
    return np.asarray(normal + friction * (np.cos(turns) * first + np.sin(turns) * np.cross(normal, first)))


def matrix_of(quaternion: ArrayLike) -> Array:
    """Of w x y z: columns are the axes of the turned frame."""
    w, x, y, z = np.asarray(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def alone(core: _core.Scene) -> Statics:
    """Of the right hand that is alone in its scene."""
    hand = Hand.__new__(Hand)
    hand.scene, hand.side = Scene(core), "right"
    return Statics(hand)


def strongest(find: Callable[[Any], Any], ways: Iterable[Any]) -> Any:
    """The largest that is found of ways. :raises NotHeld: where the hand does not hold any of them"""
    found = []
    for way in ways:
        with suppress(NotHeld):
            found.append(find(way))
    if not found:
        raise NotHeld
    return max(found)


class Pressed(NamedTuple):
    """What a hand holds while nothing moves."""

    sum: float
    """Of forces times their gains."""
    forces: Array
    """[N]"""
    activations: Array
    """Of the muscles, 0 to 1."""


class Statics:
    """A hand at coordinates q [rad], shape (coordinates,). Moments of muscles, passive tissue, bands, stops and forces on the skin
    balance at every joint that counts; joints that are fused do not."""

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        model = hand.scene._model
        joints = [(joint, axis) for joint in (model.joints[i] for i in model.hands[0].joints) for axis in joint.axes]
        self.names = [f"{joint.name.partition('.')[2]}.{axis.name}" for joint, axis in joints]
        self.low, self.high, self.rest, self.stiffness = np.array([(axis.low, axis.high, axis.rest, axis.stiffness) for _, axis in joints]).T
        self.moves = ~(self.high - self.low < FUSED)
        spills = [(i, from_, share) for i, muscle in enumerate(model.muscles) for from_, share in muscle.spills]
        self.spills = np.zeros((len(spills), len(model.muscles)))
        """What reaches a muscle of another one's effort, less what it has itself: not above 0 in activations that a person chooses. Shape
        (spills, muscles)."""
        for row, (muscle, other, share) in enumerate(spills):
            self.spills[row, [other, muscle]] = share, -1
        self.efforts = np.array([muscle.effort for muscle in model.muscles])
        """Largest activation of each muscle."""
        turns = self.muscles(self.rest)[0] != 0
        self.driven = [(i, muscle.common_drive, {finger for finger in FINGERS if turns[i, self.rows(finger + "_")].any()})
                       for i, muscle in enumerate(model.muscles) if muscle.common_drive > 0]
        """Muscles of the common drive, with their share and their fingers."""

    def at(self, pose: Mapping[str, float], rest: bool = False) -> Array:
        """Coordinates of a pose [rad]; others at 0, or with ``rest`` at their tissue's rest."""
        q = self.rest.copy() if rest else np.zeros(len(self.names))
        for name, angle in pose.items():
            if name in self.names:
                q[self.names.index(name)] = angle
        return np.asarray(q, dtype=np.float64)

    def within(self, pose: Mapping[str, float], rest: bool = False) -> Array:
        """As `at`, of a pose in degrees, within the joints' ranges."""
        return np.asarray(np.clip(self.at({name: np.radians(angle) for name, angle in pose.items()}, rest), self.low, self.high))

    def rows(self, *starts: str) -> list[int]:
        """Coordinates whose names start so."""
        return [i for i, name in enumerate(self.names) if name.startswith(starts)]

    def muscles(self, q: Array) -> tuple[Array, Array, Array, Array, Array]:
        """By muscle: moment arms [m], shape (muscles, coordinates), excursion [m], and the forces that full activation adds, and at rest [N].
        By coordinate: the moment of bands [N m]."""
        return _core.hand_muscles(self.hand.scene._core, q)

    def passive(self, q: Array) -> Array:
        """Moments of tissue, and of muscles without activation [N m]."""
        arms, _, _, rest, _ = self.muscles(q)
        return np.asarray(rest @ arms + self.stiffness * (self.rest - q))

    def _gives(self, q: Array, row: int) -> tuple[float, float]:
        """The least and the largest moment that tissue, resting muscles and bands, such as ligaments, have more than in the posture, within it [N m]. A
        ligament helps only against a load that turns the joint where it is taut."""
        away = np.zeros(len(q))
        away[row] = GIVES
        here, *turned = (float(self.moments(at)[1][row]) for at in (q, q + away, q - away))
        return min(0.0, *(each - here for each in turned)), max(0.0, *(each - here for each in turned))

    def moments(self, q: Array) -> tuple[Array, Array]:
        """Moment of each muscle's full activation, shape (coordinates, muscles), and of all that pulls at rest [N m]."""
        arms, _, active, rest, bands = self.muscles(q)
        return np.asarray(arms.T * active), np.asarray(rest @ arms + self.stiffness * (self.rest - q) + bands)

    def _together(self, forces: Array) -> Array:
        """What muscles of the common drive lack of one another's activation, where fingers press together: not above 0. Shape (pairs, muscles).

        :param forces: as of `press`
        """
        pressing = {finger for finger in FINGERS if forces[self.rows(finger + "_")].any()}
        drive = [(i, share) for i, share, fingers in self.driven if fingers & pressing] if len(pressing) > 1 else []
        out = np.zeros((len(drive) * max(0, len(drive) - 1), self.spills.shape[1]))
        for row, ((muscle, share), (other, _)) in enumerate(permutations(drive, 2)):
            out[row, [other, muscle]] = share, -1
        return out

    def press(self, q: Array, rows: Sequence[int], forces: Array, gain: Optional[ArrayLike] = None, less: Optional[Array] = None,
              least: bool = False) -> Pressed:
        """The largest sum of forces that a hand exerts while nothing moves. Activations are those that a person can choose: where a muscle
        is active, its neighbours are, too (`spills`), and fingers that press together have one drive (`driven`).

        :param rows: coordinates that have to balance; others are held
        :param forces: torques [N m] of a newton of each force on the outside, shape (coordinates, forces)
        :param gain: of each force; 1 without it
        :param less: sums of forces that stay below 0, shape (sums, forces)
        :param least: of all activations that press so, those of the smallest sum
        :raises NotHeld: where the hand does not hold the posture
        """
        held = [i for i in sorted(set(rows)) if self.moves[i]]
        active, outside = self.moments(q)
        least_gives, most_gives = np.array([self._gives(q, i) for i in held]).reshape(-1, 2).T
        # What tissue holds within the posture, and what a stop holds that the joint lies on.
        high = (q >= self.high - AT_STOP)[held]
        on_stop, side = high | (q <= self.low + AT_STOP)[held], np.where(high, -1.0, 1.0)
        count, muscles = forces.shape[1], active.shape[1]
        equal = np.hstack([np.hstack([forces, -active])[held], -np.diag(side)])
        most = np.concatenate([np.full(count, np.inf), self.efforts, np.where(on_stop, np.inf, most_gives - least_gives)])
        gains = np.zeros(len(most))
        gains[:count] = 1 if gain is None else gain
        chosen = np.vstack([self.spills, self._together(forces)])
        limits = np.zeros((len(chosen) + (0 if less is None else len(less)), len(most)))
        limits[:len(chosen), count:count + muscles] = chosen
        if less is not None:
            limits[len(chosen):, :count] = less
        to = outside[held] + np.where(high, most_gives, least_gives)
        x = largest(gains, equal, to, most, limits)
        if least:  # the smallest sum of activations that press so
            lazy = np.zeros(len(most))
            lazy[count:count + muscles] = -1
            x = largest(lazy, equal, to, most, np.vstack([limits, -gains]), np.append(np.zeros(len(limits)), -(1 - 1e-9) * (gains @ x)))
        return Pressed(max(0.0, float(gains @ x)), x[:count], np.clip(x[count:count + muscles], 0, 1))

    def axes(self, q: Array, body: str) -> Array:
        """Columns: ulnar (right hand), distal and dorsal axis of a body in the hand's frame."""
        return matrix_of(self.hand.poses(q).quaternion[self.hand.bodies.index(body)])

    def torques(self, q: Array, point: Any, forces: Array) -> Array:
        """Torques with which the joints of its finger press a newton at a point, shape (coordinates, forces). What the wrist would have
        to hold, is held by the palm, too.

        :param forces: in the hand's frame, shape (forces, 3)
        """
        out = np.asarray(self.hand.jacobian(q, point)[:3].T @ forces.T)
        out[self.rows("wrist")] = 0
        return out

    def tip(self, finger: str) -> float:
        """y [m] of the fingertip in the last segment's frame."""
        return float(self.hand.tips.row(self.hand.tips["name"].index(finger + "_tip"))["position"][1])

    def _shape(self, segment: str) -> dict[str, Any]:
        return self.hand.shapes.row(self.hand.shapes["body"].index(segment))

    def middle(self, segment: str) -> float:
        """y [m] of the middle of a segment: between its joints, or its joint and the fingertip."""
        shape = self._shape(segment)
        # Only a fingertip's round end is beyond the ends.
        return float(shape["position"][1] + (0.5 * shape["radius"] if segment.endswith("_distal") else 0))

    def radius(self, segment: str) -> float:
        """Of a segment's capsule [m]."""
        return float(self._shape(segment)["radius"])

    def within_body(self, q: Array, body: str, place: Array) -> Array:
        """A place in the hand's frame [m], in a body's."""
        position, quaternion = self.hand.poses(q)
        i = self.hand.bodies.index(body)
        return np.asarray(matrix_of(quaternion[i]).T @ (place - position[i]))

    def round_end(self, finger: str) -> tuple[str, Array]:
        """The centre of a fingertip's round end."""
        shape = self._shape(finger + "_distal")
        return finger + "_distal", np.array([0, shape["position"][1] + 0.5 * shape["length"], 0])

    def balance(self, q: Array, free: Sequence[int], tensions: Mapping[int, float] = {}) -> Array:
        """Coordinates where those that may turn balance: passive moments, bands and the tensions [N] of muscles.

        :param free: coordinates that may turn
        :param tensions: by row of `Hand.muscles`; the muscle's passive force is part of it
        :raises Error: of kind physics where none is found
        """
        turning = np.asarray(free, dtype=int)
        low, high = self.low[turning], self.high[turning]
        low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)

        def moments(at: Array) -> Array:
            arms, _, _, force, bands = self.muscles(at)
            for muscle, tension in tensions.items():
                force[muscle] = tension
            return np.asarray((force @ arms + self.stiffness * (self.rest - at) + bands)[turning])

        # Pseudo-transient: steps along the moments, as damped joints turn, until only stops hold them.
        q, step = q.copy(), 1.0
        now = moments(q)
        for _ in range(200_000):
            x = q[turning]
            left = np.abs(now[~(((x <= low) & (now < 0)) | ((x >= high) & (now > 0)))]).max(initial=0)
            if left < 1e-8:
                return q
            following = q.copy()
            following[turning] = np.minimum(np.maximum(x + np.minimum(np.maximum(step * now, -0.05), 0.05), low), high)
            then = moments(following)
            # Small components do not count: a nearly balanced one changes its sign with every step of the others.
            if ((then * now < -0.25 * now * now) & (np.abs(then) > 0.1 * left)).any():
                step *= 0.5
                continue
            step = min(step * 1.1, 50.0)
            q, now = following, then
        raise fault("the hand", "balance", "no posture was found in which moments balance")


def pinch(of: Statics, q: Array, finger: str, friction: float, balanced: Sequence[int] = ()) -> float:
    """The largest force between the round ends of the thumb and of a finger, along the line of their centres [N].

    :param balanced: more coordinates that have to balance
    :raises Error: of kind physics where the ends do not face each other
    """
    ends = [of.round_end("thumb"), of.round_end(finger)]
    places = [of.hand.position(q, end) for end in ends]
    normal = (places[1] - places[0]) / np.linalg.norm(places[1] - places[0])
    outwards = [of.axes(q, body)[:, 1] for body, _ in ends]
    if normal @ outwards[0] < INWARDS or -normal @ outwards[1] < INWARDS:
        raise fault("the hand", "pinch", "the round ends do not face each other in this pose")
    edges = cone(normal, friction)
    # The thumb presses towards the finger, the finger with the opposite force, both where their skins meet: a force that leans has no couple.
    skins = [place + side * of.radius(body) * normal for place, (body, _), side in zip(places, ends, (1, -1))]
    points = [(body, of.within_body(q, body, 0.5 * (skins[0] + skins[1]))) for body, _ in ends]
    forces = of.torques(q, points[0], edges) - of.torques(q, points[1], edges)
    return of.press(q, [*of.rows("thumb_", finger + "_"), *balanced], forces).sum


def tip_force(of: Statics, q: Array, finger: str, direction: str, friction: float, segment: Optional[str] = None, balanced: Sequence[int] = ()) -> float:
    """The largest force along a direction at a fingertip, without a moment [N]. Joints beyond the pressed segment bear none of it: they are in
    the posture, or where their muscles pull them, on an end of their range.

    :param direction: one of DIRECTIONS, from which friction lets the force lean
    :param segment: whose middle is pressed instead
    """
    body = segment or finger + "_distal"
    point = body, np.array([0, of.middle(segment) if segment else of.tip(finger), 0])
    edges = cone(np.array(DIRECTIONS[direction], dtype=float), friction) @ of.axes(q, body).T
    torques, rows, moves = of.torques(q, point, edges), of.rows(finger + "_"), of.hand.jacobian(q, point)
    beyond = [i for i in rows if not moves[:, i].any()]
    ends = [np.where(np.isin(np.arange(len(q)), beyond), end, q) for end in (of.low, of.high)] if beyond else []
    return float(strongest(lambda at: of.press(at, [*rows, *balanced], torques).sum, [q, *ends]))


def enslaving(of: Statics, q: Array, finger: str, by: str) -> float:
    """What a fingertip presses in the palmar direction on a surface that does not move while another finger presses as much as it can, over
    the finger's own largest force. No more muscles are active than that needs, and those that its effort reaches (`Statics.spills`): they turn
    the finger, whose joints give as their tissue and resting muscles do. Zeroed at rest.

    :param by: the finger that presses
    """
    def largest_of(tip: str) -> tuple[Array, Pressed]:
        body = tip + "_distal"
        newton = of.torques(q, (body, np.array([0, of.tip(tip), 0])), -of.axes(q, body)[:, 2][None])
        return newton[:, 0], of.press(q, of.rows(tip + "_"), newton, least=True)

    newton, own = largest_of(finger)
    rows = [i for i in of.rows(finger + "_") if of.moves[i]]
    moment = (of.moments(q)[0] @ largest_of(by)[1].activations)[rows]
    newton, gives = newton[rows], np.array([np.ptp(of._gives(q, i)) for i in rows])
    return max(0.0, float((newton * moment / gives).sum() / (newton * newton / gives).sum())) / own.sum


def polytope(of: Statics, finger: str, point: str, body: str, pose: Mapping[str, float], across: int, mirror: int = 1,
             count: int = 48) -> Array:
    """Largest forces at a point of a finger in a plane of a body, shape (count, 2) [N]: along its axis `across` (0: ulnar, with
    mirror -1 on a left hand; 1: distal) and palmar, the first one along `across`, the others turned towards palmar."""
    q = of.within(pose)
    axes = of.axes(q, body)
    turns = 2 * np.pi * np.arange(count) / count
    along = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    plane = np.stack([axes[:, across] * (mirror if across == 0 else 1), -axes[:, 2]])
    torques = of.torques(q, point, along @ plane)
    return np.array([of.press(q, of.rows(finger + "_"), torques[:, i:i + 1]).sum * along[i] for i in range(count)])


KEY = {"thumb_mcp.flexion": 20.0, "thumb_ip.flexion": 20.0}
TIP = {"thumb_cmc.flexion": 11.0, "thumb_cmc.abduction": -1.0, "thumb_mcp.flexion": 20.0, "thumb_ip.flexion": 25.0, "index_mcp.flexion": 54.0,
       "index_pip.flexion": 47.0, "index_dip.flexion": 27.0}
"""As rows of config/validate.yaml [deg]."""


def key_pinch(of: Statics) -> float:
    """Of the thumb's pad against what does not move [N]."""
    q = of.within(KEY)
    edges = cone(-of.axes(q, "thumb_distal")[:, 2], FRICTION)
    return of.press(q, of.rows("thumb_"), of.torques(q, "thumb_distal", edges)).sum


def tip_pinch(of: Statics) -> float:
    """Of the round ends of thumb and index against each other [N]."""
    return pinch(of, of.within(TIP), "index", FRICTION)


def slack_pose(of: Statics, pose: Mapping[str, float]) -> Array:
    """Where fingers rest with all muscles at rest, their pose's coordinates held [deg]."""
    free = [i for i in of.rows("thumb_", *(finger + "_" for finger in FINGERS)) if of.moves[i] and of.names[i] not in pose]
    return of.balance(of.within(pose, rest=True), free)


def thumb_workspace(of: Statics, voxel: float = 4e-3, steps: Optional[Sequence[int]] = None) -> tuple[float, Array]:
    """Volume that the thumb's tip reaches [m^3], counted in cubes, and the points [m] in the hand's frame."""
    rows = [i for i, name in enumerate(of.names) if name.startswith("thumb_")]
    counts = steps or [25, 25, *([11] * (len(rows) - 2))]
    grids = np.meshgrid(*(np.linspace(of.low[i], of.high[i], n) if of.moves[i] else of.rest[i:i + 1] for i, n in zip(rows, counts)))
    body, offset = of.hand.bodies.index("thumb_distal"), np.array([0, of.tip("thumb"), 0])
    q = np.zeros(len(of.names))
    poses = []
    for angles in np.stack([each.ravel() for each in grids], axis=1):
        q[rows] = angles
        position, quaternion = of.hand.poses(q)
        poses.append(np.concatenate([position[body], quaternion[body]]))
    place, w, v = np.array(poses)[:, :3], np.array(poses)[:, 3:4], np.array(poses)[:, 4:]
    points = place + offset + 2 * np.cross(v, np.cross(v, offset) + w * offset)
    cubes = np.unique(np.floor(points / voxel).astype(int), axis=0)
    return len(cubes) * voxel ** 3, points
