"""Largest forces of a hand with muscles at a posture, and postures in which it rests: what `handsim compare` puts side by side."""
from __future__ import annotations

from typing import Any, Mapping, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._hand import Hand

Array = NDArray[np.float64]
FUSED = 2.1e-3
"""A joint of a smaller range is fused [rad]: bone holds its moment."""
GIVES = np.radians(20)
"""A posture is one within this angle of each joint [rad]: passive tissue holds moments of up to this times its stiffness."""
PINCH_FRICTION = 0.6
"""Of skin on aluminium (Seo 2009), as in the rows of pinches of `handsim validate`."""


def largest(gain: Array, equal: Array, to: Array, most: Array) -> tuple[float, Array]:
    """The largest ``gain @ x`` with ``equal @ x == to`` and ``0 <= x <= most``, and x, by Mehrotra's interior points (1992).

    :return: NaN where no x is within the bounds
    """
    finite = np.isfinite(most)
    # Rows of one size; bounds x + s = most with slacks s.
    scale = np.maximum(np.abs(equal).max(axis=1), 1e-12)
    n, k = len(gain), int(finite.sum())
    A = np.zeros((len(to) + k, n + k))
    A[:len(to), :n] = equal / scale[:, None]
    A[len(to) + np.arange(k), np.flatnonzero(finite)] = 1
    A[len(to) + np.arange(k), n + np.arange(k)] = 1
    b = np.concatenate([to / scale, most[finite]])
    c = np.concatenate([-gain, np.zeros(k)])
    x = np.ones(n + k)
    s = np.ones(n + k)
    y = np.zeros(len(b))
    for _ in range(80):
        primal, dual, gap = b - A @ x, c - A.T @ y - s, float(x @ s) / len(x)
        size = 1 + np.abs(c @ x)
        if np.abs(primal).max() < 1e-9 and np.abs(dual).max() < 1e-7 and gap * len(x) < 1e-7 * size:
            return float(gain @ x[:n]), np.asarray(x[:n])
        normal = (A * (x / s)) @ A.T + 1e-13 * np.eye(len(b))

        def step(target: Array) -> tuple[Array, Array, Array]:
            dy = np.linalg.solve(normal, primal + A @ ((x * dual - target) / s))
            ds = dual - A.T @ dy
            return (target - x * ds) / s, dy, ds

        def room(of: Array, by: Array) -> float:
            return min(1.0, float(np.min(np.divide(-of, by, out=np.full(len(of), np.inf), where=by < 0))))

        dx, dy, ds = step(-x * s)
        ahead = float((x + room(x, dx) * dx) @ (s + room(s, ds) * ds)) / len(x)
        dx, dy, ds = step((ahead / gap) ** 3 * gap - x * s - dx * ds)
        x = x + 0.99 * room(x, dx) * dx
        y, s = y + 0.99 * room(s, ds) * dy, s + 0.99 * room(s, ds) * ds
        if not np.isfinite(x).all() or x.max() > 1e12:
            break
    return float("nan"), x[:n]


class Statics:
    """A hand at rest at coordinates. Moments of muscles, passive tissue, bands and forces on the skin balance at every joint that
    counts; joints that are fused do not."""

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        self.names = hand.coordinates
        self.low, self.high = hand.joints["low[rad]"], hand.joints["high[rad]"]
        self.moves = [high - low > FUSED for low, high in zip(self.low, self.high)]
        self.stiffness = np.asarray(hand.joints["stiffness[N m/rad]"])
        self.gives = GIVES * self.stiffness
        self.rest = np.clip(hand.joints["rest[rad]"], self.low, self.high)

    def at(self, pose: Mapping[str, float], rest: bool = False) -> Array:
        """Coordinates [rad] of a pose in degrees, within the joints' ranges; others at 0 or at rest."""
        q = self.rest.copy() if rest else np.zeros(len(self.names))
        for name, angle in pose.items():
            if name in self.names:
                q[self.names.index(name)] = np.radians(angle)
        return np.asarray(np.clip(q, self.low, self.high), dtype=np.float64)

    def rows(self, *starts: str) -> list[int]:
        """Coordinates of joints that move and whose names start so."""
        return [i for i, name in enumerate(self.names) if self.moves[i] and name.startswith(tuple(starts))]

    def torques(self, q: Array) -> tuple[Array, Array]:
        """Torque of each muscle at full activation, shape (coordinates, muscles), and of all that pulls at rest [N m]."""
        arms = _core.hand_moment_arms(self.hand.scene._core, q)
        active, passive, bands = _core.hand_muscle_forces(self.hand.scene._core, q)
        tissue = self.stiffness * (np.asarray(self.hand.joints["rest[rad]"]) - q)
        return np.asarray(arms.T * active, dtype=np.float64), np.asarray(arms.T @ passive + bands + tissue, dtype=np.float64)

    def press(self, q: Array, fingers: Sequence[str], forces: Array, gain: ArrayLike) -> tuple[float, Array]:
        """The largest sum of forces that a hand exerts while nothing moves.

        :param fingers: their joints have to balance; ``wrist``: the wrist, too, else it is held
        :param forces: torques [N m] of a newton of each force on the outside, shape (coordinates, forces)
        :param gain: of each force
        :return: the sum, and the forces [N]
        """
        muscles, rest = self.torques(q)
        rows = self.rows(*fingers)
        count = forces.shape[1]
        # What tissue holds: from -gives to gives, and what a stop holds that the joint lies on.
        low, high = (np.abs(q - stops)[rows] < 1e-6 for stops in (np.asarray(self.low), np.asarray(self.high)))
        side = np.where(high, -1.0, 1.0)
        equal = np.hstack([np.hstack([forces, -muscles])[rows], -np.diag(side)])
        held = np.where(low | high, np.inf, 2 * self.gives[rows])
        most = np.concatenate([np.full(count, np.inf), np.ones(muscles.shape[1]), held])
        gains = np.concatenate([np.asarray(gain, dtype=float), np.zeros(len(most) - count)])
        value, x = largest(gains, equal, rest[rows] - side * self.gives[rows], most)
        return value, x[:count]

    def torque_of(self, q: Array, point: Any, direction: ArrayLike) -> Array:
        """Torques with which joints press a newton at a point along a direction in the hand's frame; a wrist has none of it: what is
        held is held by the palm, too."""
        out = self.hand.jacobian(q, point)[:3].T @ np.asarray(direction, dtype=float)
        out[[i for i, name in enumerate(self.names) if name.startswith("wrist")]] = 0
        return np.asarray(out)

    def axes(self, q: Array, body: str) -> Array:
        """Columns: ulnar (right hand), distal and dorsal axis of a body in the hand's frame."""
        w, x, y, z = self.hand.poses(q).quaternion[self.hand.bodies.index(body)]
        return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                         [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                         [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])

    def cone(self, q: Array, point: Any, normal: Array, friction: float = 0.8,
             sides: int = 8) -> list[tuple[Array, Array]]:
        """Torques of the edges of a cone of friction, each of a newton along the normal, and their forces."""
        first = np.cross(normal, [1.0, 0, 0] if abs(normal[0]) < 0.7 else [0, 1.0, 0])
        first /= np.linalg.norm(first)
        second = np.cross(normal, first)
        turns = 2 * np.pi * np.arange(sides) / sides
        edges = [normal + friction * (np.cos(t) * first + np.sin(t) * second) for t in turns]
        return [(self.torque_of(q, point, edge), edge) for edge in edges]

    def slack_pose(self, pose: Mapping[str, float]) -> Array:
        """Where fingers rest with all muscles at rest, their pose's coordinates held. Joints creep along their moments."""
        q = self.at(pose, rest=True)
        free = [i for i in self.rows("thumb", "index", "middle", "ring", "little") if self.names[i] not in pose]
        step = np.full(len(free), 1.0)
        before = np.zeros(len(free))
        for _ in range(20000):
            moment = self.torques(q)[1][free]
            at_stop = ((q[free] <= self.low[free]) & (moment < 0)) | ((q[free] >= self.high[free]) & (moment > 0))
            if np.abs(np.where(at_stop, 0, moment)).max(initial=0) < 1e-6:
                break
            step = np.where(moment * before < 0, 0.5 * step, np.minimum(1.05 * step, 20))
            before = moment
            q[free] = np.clip(q[free] + np.clip(step * moment, -0.05, 0.05), self.low[free], self.high[free])
        return q


def polytope(of: Statics, finger: str, point: str, body: str, pose: Mapping[str, float], across: int, mirror: int = 1,
             count: int = 48) -> Array:
    """Largest forces at a point of a finger in a plane of a body, shape (count, 2) [N]: along its axis `across` (0: ulnar, with
    mirror -1 on a left hand; 1: distal) and palmar, the first one along `across`, the others turned towards palmar."""
    q = of.at(pose)
    axes = of.axes(q, body)
    first = axes[:, across] * (mirror if across == 0 else 1)
    out = []
    for turn in 2 * np.pi * np.arange(count) / count:
        along = np.array([np.cos(turn), np.sin(turn)])
        force = of.torque_of(q, point, along[0] * first - along[1] * axes[:, 2])
        value, _ = of.press(q, [finger], force[:, None], [1.0])
        out.append(value * along if np.isfinite(value) else 0 * along)
    return np.array(out)


GRIP = {"mcp.flexion": 45.0, "pip.flexion": 60.0, "dip.flexion": 30.0}
"""Of all fingers on the bar of a dynamometer [deg]: chosen."""
KEY = {"thumb_mcp.flexion": 20.0, "thumb_ip.flexion": 20.0}
TIP = {"thumb_cmc.flexion": 14.0, "thumb_cmc.abduction": -4.0, "thumb_mcp.flexion": 16.0, "thumb_ip.flexion": 20.0, "index_mcp.flexion": 49.0,
       "index_mcp.abduction": 5.0, "index_pip.flexion": 42.0, "index_dip.flexion": 32.0}
"""As rows of config/validate.yaml [deg]."""


def grip(of: Statics, wrist: Optional[float] = None) -> tuple[float, dict[str, float]]:
    """Largest sum of forces on a bar towards the palm by the pads of middle and distal phalanges, and each finger's [N].

    :param wrist: flexion at which muscles balance the wrist, too [deg]; None: it is held at 0
    """
    fingers = ["index", "middle", "ring", "little"]
    q = of.at({"wrist.flexion": wrist or 0.0, **{f"{f}_{joint}": angle for f in fingers for joint, angle in GRIP.items()}})
    columns, gain, owner = [], [], []
    for finger in fingers:
        for segment in ("middle", "distal"):
            body = f"{finger}_{segment}"
            palmar = -of.axes(q, body)[:, 2]
            for torque, force in of.cone(q, body, palmar):
                columns.append(torque)
                # Of what presses the bar to the palm: it is dorsal of the bar.
                gain.append(float(force @ np.array([0, -0.35, 0.94])))
                owner.append(finger)
    value, forces = of.press(q, fingers if wrist is None else [*fingers, "wrist"], np.array(columns).T, gain)
    return value, {f: float(sum(g * n for g, n, o in zip(gain, forces, owner) if o == f)) for f in fingers}


def key_pinch(of: Statics) -> float:
    """Of the thumb's pad against what does not move [N]."""
    q = of.at(KEY)
    normal = -of.axes(q, "thumb_distal")[:, 2]
    thumb = np.array([torque for torque, _ in of.cone(q, "thumb_distal", normal, PINCH_FRICTION)]).T
    return of.press(q, ["thumb"], thumb, np.ones(thumb.shape[1]))[0]


def tip_pinch(of: Statics) -> float:
    """Of the round ends of thumb and index against each other [N]."""
    q = of.at(TIP)
    ends = [_round_end(of, finger) for finger in ("thumb", "index")]
    normal = of.hand.position(q, ends[1]) - of.hand.position(q, ends[0])
    normal = normal / np.linalg.norm(normal)
    thumb, index = (np.array([torque for torque, _ in of.cone(q, end, normal, PINCH_FRICTION)]).T for end in ends)
    # The index presses back with the same force.
    return of.press(q, ["thumb", "index"], thumb - index, np.ones(thumb.shape[1]))[0]


def _round_end(of: Statics, finger: str) -> tuple[str, Array]:
    """The centre of a fingertip's round end."""
    tip = of.hand.tips.row(of.hand.tips["name"].index(finger + "_tip"))
    radius = of.hand.segments["radius[m]"][of.hand.bodies.index(tip["body"])]
    return tip["body"], np.asarray(tip["position"]) - [0, radius, 0]


def thumb_workspace(of: Statics, voxel: float = 4e-3, steps: Optional[Sequence[int]] = None) -> tuple[float, Array]:
    """Volume that the thumb's tip reaches [m^3], counted in cubes, and the points [m] in the hand's frame."""
    rows = [i for i, name in enumerate(of.names) if name.startswith("thumb_")]
    counts = steps or [25, 25, *([11] * (len(rows) - 2))]
    grids = np.meshgrid(*(np.linspace(of.low[i], of.high[i], n) if of.moves[i] else of.rest[i:i + 1] for i, n in zip(rows, counts)))
    q = np.zeros(len(of.names))
    points = []
    for angles in np.stack([each.ravel() for each in grids], axis=1):
        q[rows] = angles
        points.append(of.hand.position(q, "thumb_tip"))
    cubes = np.unique(np.floor(np.array(points) / voxel).astype(int), axis=0)
    return len(cubes) * voxel ** 3, np.array(points)
