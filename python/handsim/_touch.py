"""Where recorded hands and objects touch: the gap between the shapes of a hand and the surface of an object, frame by frame."""
from __future__ import annotations

from typing import Any, NamedTuple, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import input_error
from ._hand import Hand
from ._model import compose, inverse, matrices, turned
from ._inside import Inside
from ._objects import Link, spacing_of

Array = NDArray[np.float64]
ALONG = 4e-3
"""Between the places of a shape that are tested [m], at most."""
FAR = 0.03
"""A gap that is measured, at most [m]."""
SECOND = 1e-3
"""How much wider the gap at a second place of a shape may be, for two places to touch [m]."""
CORNER, TIE = 6, 3e-4
"""Points of a surface that are looked at, and how much further one may be to count as near as the nearest [m]."""
BESIDE = 1e-3
"""Between points of a surface and the foot of the perpendicular of a place, at most, for the plane of the point to count [m]."""
APART = 6e-3
"""Between two places of one shape that touch, at least [m]."""


class Touch(NamedTuple):
    """A place of a hand that touches, or may; world axes."""

    hand: int
    shape: int
    """Row of `HandShapes.names`."""
    link: int
    """Of the object."""
    place: Array
    """On the object's surface [m]."""
    normal: Array
    """Out of the object."""
    gap: float
    """[m]; below 0: inside."""
    offset: Array
    """The place in the frame of the hand's body [m]."""


class HandShapes:
    """The shapes of a hand as round places: centres in frames of bodies, with radii."""

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        shapes = hand.shapes
        self.names: list[str] = []
        """Of the body of each shape, such as index_distal."""
        bodies = {name: i for i, name in enumerate(hand.bodies)}
        centres, radii, of = [], [], []
        for i in range(len(shapes["name"])):
            row = shapes.row(i)
            pose = np.concatenate([row["position"], row["quaternion"]])
            edges = np.asarray(row["edges"], dtype=float)
            if row["kind"] == "box":
                # Balls along the longest edge, as thick as the shortest.
                radius = float(edges.min()) / 2
                along = np.eye(3)[int(np.argmax(edges))] * max(float(edges.max()) / 2 - radius, 0)
                wide = np.eye(3)[int(np.argsort(edges)[1])] * max(float(np.sort(edges)[1]) / 2 - radius, 0)
                grid = [u * along + v * wide for u in np.linspace(-1, 1, 9) for v in np.linspace(-1, 1, 9)]
            else:
                radius, half = float(row["radius"]), 0.0 if row["kind"] == "sphere" else float(row["length"]) / 2
                grid = [np.array([0, 0, z]) for z in np.linspace(-half, half, max(2, int(np.ceil(2 * half / ALONG)) + 1) if half else 1)]
            centres += list(turned(pose[3:], np.array(grid)) + pose[:3])
            radii += [radius] * len(grid)
            of += [(len(self.names), bodies[row["body"]])] * len(grid)
            self.names.append(row["body"])
        self.centres, self.radii = np.array(centres), np.array(radii)
        self.shape, self.body = np.array(of).T
        self.first = np.flatnonzero(np.diff(self.shape, prepend=-1))

    def place(self, name: str) -> int:
        """Of a body among those of the hand."""
        return list(self.hand.bodies).index(name)

    def bodies(self, q: Array, wrist: Array) -> Array:
        """Poses of the bodies in the world, shape (bodies, 7)."""
        position, quaternion = _core.hand_poses(self.hand.scene._core, q)
        return compose(np.broadcast_to(wrist, (len(position), 7)), np.concatenate([position, quaternion], axis=1))

    def balls(self, bodies: Array) -> Array:
        """Centres of the places in the world, shape (places, 3)."""
        poses = bodies[self.body]
        return np.asarray(turned(poses[:, 3:], self.centres) + poses[:, :3])


class Surface:
    """Of a link: distances from it."""

    def __init__(self, link: Link) -> None:
        try:
            from scipy.spatial import cKDTree
        except ImportError:
            raise input_error("SciPy", "no Python module of this name", "it, for forces on objects: pip install scipy") from None
        self.link = link
        self.tree: Any = cKDTree(link.points)
        self.low, self.high = link.points.min(axis=0), link.points.max(axis=0)
        self.inside = Inside(link.triangles, self.tree, spacing_of(link.triangles))

    def distances(self, places: Array, reach: float, radii: Array) -> tuple[Array, Array]:
        """Signed distances of balls' centres in the link's frame from its surface [m], inf where a ball is farther than reach, and the outward normals of its
        nearest places."""
        out = np.full(len(places), np.inf)
        normals = np.zeros((len(places), 3))
        bounds = (reach + radii)[:, None]
        near = np.flatnonzero(((places > self.low - bounds) & (places < self.high + bounds)).all(axis=1))
        if not len(near):
            return out, normals
        # The nearest point alone says which balls are too far: one that is inside by it is looked at in any case.
        away, at = self.tree.query(places[near], distance_upper_bound=reach + float(radii.max()))
        found = np.isfinite(away)
        near, at, away = near[found], at[found], away[found]
        inside = self.inside.of(places[near])
        kept = inside | (away < reach + radii[near] + BESIDE)
        near, inside = near[kept], inside[kept]
        if not len(near):
            return out, normals
        away, at = self.tree.query(places[near], k=CORNER)
        # At an edge several points are as near, of different faces: a place is outside where it is outside of one of them.
        alike = away < away[:, :1] + TIE
        at = np.where(alike, at, at[:, :1])
        from_ = places[near, None] - self.link.points[at]
        heights = np.where(alike, (from_ * self.link.normals[at]).sum(axis=2), -np.inf)
        best = np.argmax(heights, axis=1)
        rows = np.arange(len(near))
        height, distance = heights[rows, best], away[:, 0]
        # A place within the spacing of the foot of the perpendicular: the plane there is nearer than the point. Where no plane is on the side on which the
        # place is, the point is nearest.
        sign, agrees = np.where(inside, -1.0, 1.0), (height < 0) == inside
        beside = np.sqrt(np.maximum(distance**2 - height**2, 0))
        out[near] = np.where((beside < BESIDE) & agrees, height, sign * distance)
        away_from = sign[:, None] * from_[:, 0] / np.maximum(distance, 1e-12)[:, None]
        normals[near] = np.where(agrees[:, None], self.link.normals[at[rows, best]], away_from)
        return out, normals


def touches(shapes: HandShapes, hand: int, bodies: Array, surfaces: Sequence[Surface], places: Array, reach: float) -> list[Touch]:
    """Of a hand and an object, nearest places of shapes within a gap.

    :param bodies: poses of the hand's bodies
    :param places: poses of the object's links
    """
    balls = shapes.balls(bodies)
    out: list[Touch] = []
    for k, surface in enumerate(surfaces):
        back = inverse(places[k])
        distance, outward = surface.distances(turned(back[3:], balls) + back[:3], reach + SECOND, shapes.radii)
        gaps = distance - shapes.radii
        every: list[tuple[int, int, int]] = []
        least = np.minimum.reduceat(gaps, shapes.first)
        for shape in np.flatnonzero(least < reach):
            own = np.arange(shapes.first[shape], shapes.first[shape + 1] if shape + 1 < len(shapes.first) else len(gaps))
            chosen = [int(own[np.argmin(gaps[own])])]
            others = own[(gaps[own] < gaps[chosen[0]] + SECOND) & (np.linalg.norm(balls[own] - balls[chosen[0]], axis=1) > APART)]
            if len(others):
                chosen.append(int(others[np.argmax(np.linalg.norm(balls[others] - balls[chosen[0]], axis=1))]))
            every += [(int(shape), k, i) for i in chosen]
        if not every:
            continue
        rows = np.array([i for _, _, i in every])
        normals = turned(places[k, 3:], outward[rows])
        points = balls[rows] - (shapes.radii[rows] + gaps[rows])[:, None] * normals
        own_bodies = bodies[shapes.body[rows]]
        offsets = turned(own_bodies[:, 3:] * [1, -1, -1, -1], points - own_bodies[:, :3])
        out += [Touch(hand, shape, link, point, normal, float(gap), offset)
                for (shape, link, _), point, normal, gap, offset in zip(every, points, normals, gaps[rows], offsets)]
    return out


def contact_jacobians(shapes: HandShapes, q: Array, wrist: Array, found: Sequence[Touch]) -> Array:
    """Velocities of places on the hand by the rates of the coordinates, world axes, shape (places, 3, coordinates)."""
    bodies = {name: i for i, name in enumerate(shapes.hand.bodies)}
    core = shapes.hand.scene._core
    own = np.array([_core.hand_jacobian(core, q, bodies[shapes.names[touch.shape]], touch.offset)[:3] for touch in found]).reshape(-1, 3, len(q))
    return np.asarray(matrices(wrist)[:3, :3] @ own)


def segment(name: str) -> tuple[str, str]:
    """Finger and segment of a body's name: index_distal, palm."""
    finger, _, part = name.partition("_")
    return (finger, part) if part else (name, name)


