"""Where an object may lie in a hand so that a type of grasp could hold it: geometry alone, nothing is closed.

Of a pad or side opposition the hand is posed so that the segments of its two virtual fingers are as far apart as the object is thick between
them; of a palm opposition the object lies on the palm. Axes of a place: `across` from the first virtual finger to the second, `along` the row of
fingers (the palm's width), `beyond` away from the wrist. Axes of the object are those of its file and of each of its convex parts. All frames
of right hands.
"""
from __future__ import annotations

import math
from functools import cached_property
from itertools import permutations, product
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._errors import input_error
from ._grasp_types import FINGERS, GraspType, Site
from ._hand import Hand
from ._model import matrices, turned
from ._objects import Thing

Array = NDArray[np.float64]
ALIKE = 0.03
"""Extents that differ by this share of the size are the same: an object is symmetric, or as long as wide."""
FLAT, ROUND = 0.6, 1.35
"""Of a flat object the thinnest extent over the next; of a round one the largest over the smallest, at most."""
PAD = 0.05
"""Width of a pad on the object, in hand lengths: the thickness between two pads is that of what lies between them."""
OVERLAP = 6e-3
"""Depth up to which a place may have the object within the hand; the fit moves it by as much [m]."""
GAP = 4e-3
"""Of hand and post [m]."""
SHARES = np.linspace(-0.5, 1.0, 61)
"""Of the way from a type's open pose to its closed one, at which opposing segments are looked up."""
SAMPLES = 12_000
"""Points of a surface."""
TRIED = 40
"""Places of a type, those of least cost, for which the object's stand is sought."""
PARTS = 6
"""Convex parts of an object that are grasped by themselves, at most: of parts of one shape the first."""
LEFT_OUT = {"its shape is another": "other_shape", "nothing lies between the fingers": "nothing_there", "nothing lies in the palm": "nothing_there",
            "too thick": "too_large", "too thin": "too_small", "the hand is in its way": "hand_in_way"}
"""Codes of the reasons why a place is not tried."""
POST = (3e-3, 15e-3)
"""Least and largest radius of a post under an object [m]."""


class Place(NamedTuple):
    """An object in a right hand."""

    type: GraspType
    part: int
    """Convex part that is grasped; -1: all of the object."""
    turn: Array
    """R_HO, shape (3, 3)."""
    position: Array
    """p_HO [m]."""
    thickness: float
    """Between the virtual fingers [m]."""
    q: Array
    """Of the hand, about [rad]."""
    approach: Array
    """Unit, in the hand frame: from where the hand comes to the object."""
    rest: Array
    """R_WO: how the object stands on its post."""
    post: float
    """Radius of the post [m]."""
    cost: float
    """The less, the earlier it is tried."""


class Rest(NamedTuple):
    turn: Array
    """R_WO"""
    angle: float
    """By which it may be tilted before it falls over [rad]."""
    reach: float
    """Distance of the face's edge from below the centre of mass [m]."""


def support(points: Array, directions: Array) -> Array:
    return np.asarray((points @ directions.T).max(axis=0))


class Solid:
    """An object's points."""

    def __init__(self, thing: Thing) -> None:
        """:raises Error: of kind input for an object with hinges"""
        if len(thing.links) != 1:
            raise input_error(str(thing.file), f"an object of {len(thing.links)} parts that move", "one rigid object")
        link = thing.links[0]
        self.centre: Array = np.asarray(link.centre)
        self.mass: float = link.mass
        self.points: Array = np.asarray(link.points)[::max(1, len(link.points) // SAMPLES)]
        self.corners: list[Array] = [np.asarray(each) for each in link.corners]
        self.hull: Array = np.concatenate(self.corners)
        self.inertia: Array = np.asarray(link.inertia)
        self._surfaces: dict[int, Array] = {}
        self.size = float(np.ptp(self.hull, axis=0).max())

    @cached_property
    def frames(self) -> list[Array]:
        """Axes, as columns: of the file, and the principal ones where they are others."""
        out = [np.eye(3)]
        moments, axes = np.linalg.eigh(self.inertia)
        if min(moments[1] - moments[0], moments[2] - moments[1]) > 0.05 * moments[2]:
            axes[:, 2] *= np.sign(np.linalg.det(axes))
            if np.abs(axes).max(axis=0).min() < math.cos(math.radians(10)):
                out.append(axes)
        return out

    def parts(self) -> list[int]:
        """-1 for the whole, and convex parts, of each shape one."""
        seen: list[Array] = []
        out = [-1]
        if len(self.corners) < 2:
            return out
        for i, corners in enumerate(self.corners):
            shape = np.sort(np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)) / math.sqrt(len(corners))
            if len(out) <= PARTS and not any(np.allclose(shape, other, rtol=0.05) for other in seen):
                seen.append(shape)
                out.append(i)
        return out

    def axes_of(self, part: int) -> list[Array]:
        if part < 0:
            return self.frames
        corners = self.corners[part]
        _, _, rows = np.linalg.svd(corners - corners.mean(axis=0))
        axes = rows.T.copy()
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        return [axes]

    def orientations(self, part: int) -> list[Array]:
        """Ways to name the axes (across, along, beyond), as columns; of those that symmetry makes the same, the first."""
        corners = self.hull if part < 0 else self.corners[part]
        directions = _directions()
        out: list[Array] = []
        for frame in self.axes_of(part):
            kept: list[tuple[Array, Array]] = []
            for order in permutations(range(3)):
                for signs in product((1, -1), repeat=3):
                    axes = frame[:, list(order)] * np.array(signs)
                    if np.linalg.det(axes) < 0:
                        continue
                    shape = support((corners - self.centre) @ axes, directions)
                    if not any(np.abs(shape - other).max() < ALIKE * self.size for _, other in kept):
                        kept.append((axes, shape))
            out += [axes for axes, _ in kept]
        return out

    @cached_property
    def rests(self) -> list[Rest]:
        """Faces of the hull on which the object stands, the most stable first."""
        from scipy.spatial import ConvexHull

        hull = ConvexHull(self.hull)
        out: list[Rest] = []
        for normal, offset in {(*np.round(row[:3], 4), round(float(row[3]), 6)): (row[:3], row[3]) for row in hull.equations}.values():
            flat = self.hull[hull.vertices]
            face = flat[flat @ normal + offset > -1e-3 * self.size]
            height = -float(normal @ self.centre + offset)
            to = _turn_to(normal, np.array([0.0, 0.0, -1.0]))
            level = (face - self.centre) @ to.T
            reach = _inside(level[:, :2])
            if reach <= 0:
                continue
            out.append(Rest(to, math.atan2(reach, height), reach))
        # What rolls stands anywhere: a few faces of it are enough.
        chosen: list[Rest] = []
        for rest in sorted(out, key=lambda each: -each.angle):
            if not any(np.degrees(np.arccos(np.clip(rest.turn[2] @ other.turn[2], -1, 1))) < 30 for other in chosen):
                chosen.append(rest)
        return chosen[:8] or [Rest(np.eye(3), 0.0, 0.0)]

    def between(self, part: int, axes: Array, middle: Array, width: float, row: float) -> Optional[tuple[float, float]]:
        """The object's extent along `across` near a point: from, to.

        :param axes: across, along, beyond, as columns
        :param width: beyond, :param row: along [m]
        """
        if part not in self._surfaces:
            self._surfaces[part] = self.points if part < 0 else np.concatenate([self.corners[part], _filled(self.corners[part])])
        points = self._surfaces[part]
        local = (points - middle) @ axes
        near = (np.abs(local[:, 1]) <= row / 2) & (np.abs(local[:, 2]) <= width / 2)
        if not near.any():
            return None
        return float(local[near, 0].min()), float(local[near, 0].max())


def _filled(corners: Array) -> Array:
    """Points on a hull's faces."""
    from scipy.spatial import ConvexHull

    from ._objects import sampled

    hull = ConvexHull(corners)
    return sampled(corners, hull.simplices, max(1e-3, float(np.ptp(corners, axis=0).max()) / 20))[0]


def _directions() -> Array:
    """Some 100 directions, evenly."""
    k = np.arange(96) + 0.5
    polar, around = np.arccos(1 - 2 * k / 96), math.pi * (1 + math.sqrt(5)) * k
    return np.stack([np.cos(around) * np.sin(polar), np.sin(around) * np.sin(polar), np.cos(polar)], axis=1)


def _turn_to(a: Array, b: Array) -> Array:
    """The smallest rotation from a to b."""
    v, c = np.cross(a, b), float(a @ b)
    if c < -1 + 1e-9:
        other = np.eye(3)[int(np.argmin(np.abs(a)))]
        v = np.cross(a, other)
        v /= np.linalg.norm(v)
        return np.asarray(2 * np.outer(v, v) - np.eye(3))
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + k + k @ k / (1 + c))


def _inside(points: Array) -> float:
    """Distance of the origin from the edge of the points' hull in a plane; 0 outside."""
    from scipy.spatial import ConvexHull, QhullError

    if len(points) < 3:
        return 0.0
    try:
        return float(max(0.0, -ConvexHull(points).equations[:, 2].max()))
    except QhullError:  # a line
        return 0.0


class Sites(NamedTuple):
    """Two virtual fingers that oppose each other."""

    middle: Array
    axes: Array
    """Across, along, beyond, as columns, in the hand frame."""
    gap: float
    """Between the surfaces [m]."""
    q: Array


class Posed:
    """A person's right hand in the poses of types."""

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        self.length = float(hand.dimensions["length"])
        shapes = hand.shapes
        self.names = list(hand.bodies)
        self._body = np.array([self.names.index(each) for each in shapes["body"]])
        self._radius, self._half = np.asarray(shapes["radius"]), np.asarray(shapes["length"]) / 2
        self._place, self._quaternion = np.asarray(shapes["position"]), np.asarray(shapes["quaternion"])
        self._axis: Array = matrices(np.hstack([self._place, self._quaternion]))[:, :3, 2]
        self._capsules: dict[bytes, tuple[Array, Array]] = {}
        self._opened: dict[str, list[Sites]] = {}
        # Its capsule: the first of its shapes.
        self._of_body = {name: i for i, name in reversed(list(enumerate(shapes["body"]))) if name != "palm"}
        self.limits: Array = hand.scene.limits[-len(hand.coordinates):]

    def angles(self, pose: dict[str, list[float]]) -> Array:
        out = np.array([angle for finger in FINGERS for angle in pose[finger]])
        return np.asarray(np.clip(out, self.limits[:, 0], self.limits[:, 1]))

    def capsules(self, q: Array) -> tuple[Array, Array, Array]:
        """Ends of the cores, shapes (n, 3), and radii [m], in the hand frame."""
        key = q.tobytes()
        if key not in self._capsules:
            poses = self.hand.poses(q)
            turns = matrices(np.hstack([poses.position, poses.quaternion]))[self._body, :3, :3]
            middles = poses.position[self._body] + np.einsum("nij,nj->ni", turns, self._place)
            halves = np.einsum("nij,nj->ni", turns, self._axis) * self._half[:, None]
            self._capsules[key] = middles - halves, middles + halves
        return (*self._capsules[key], self._radius)

    def _core(self, site: Site, poses: Any) -> tuple[Array, float, Array]:
        """Place of the core of a segment, its radius, and its direction to the tip."""
        segment, side = site
        i, shape = self.names.index(segment), self._of_body[segment]
        end = self._half[shape] * (1.0 if side == "tip" else 0.5 if segment.endswith("distal") else 0.0)
        local = self._place[shape] + np.array([0.0, end, 0.0])
        turn = poses.quaternion[i]
        return poses.position[i] + turned(turn, local), float(self._radius[shape]), turned(turn, np.array([0.0, 1.0, 0.0]))

    def sites(self, of: GraspType, share: float) -> Sites:
        """:param share: of the way from the type's open pose to its closed one"""
        assert of.sites is not None
        low, high = self.angles(of.open), self.angles(of.closed)
        q = np.clip(low + share * (high - low), self.limits[:, 0], self.limits[:, 1])
        poses = self.hand.poses(q)
        first, second = ([self._core(site, poses) for site in side] for side in of.sites)
        a, b = (np.mean([each[0] for each in side], axis=0) for side in (first, second))
        radii = [float(np.mean([each[1] for each in side])) for side in (first, second)]
        way = b - a
        apart = float(np.linalg.norm(way))
        across = way / apart
        beyond = np.mean([each[2] for each in (*first, *second)], axis=0)
        beyond -= (beyond @ across) * across
        if len(second) > 1:
            row = second[-1][0] - second[0][0]
            beyond = np.cross(row, across) * np.sign(np.cross(row, across) @ beyond)
        beyond /= np.linalg.norm(beyond)
        return Sites(a + (radii[0] + (apart - sum(radii)) / 2) * across, np.stack([across, np.cross(beyond, across), beyond], axis=1), apart - sum(radii), q)

    def opened(self, of: GraspType) -> list[Sites]:
        """From wide open to closed."""
        if of.name not in self._opened:
            self._opened[of.name] = [self.sites(of, float(share)) for share in SHARES]
        return self._opened[of.name]

    def sites_at(self, of: GraspType, gap: float) -> Optional[Sites]:
        """With about this gap, a little less; None: the hand does not open or close so far."""
        for sites in self.opened(of):
            if sites.gap <= gap:
                return sites if sites.gap <= gap <= self.opened(of)[0].gap else None
        return self.opened(of)[-1] if gap > self.opened(of)[-1].gap - 2e-3 else None

    def depth(self, points: Array, q: Array, skip: Sequence[str] = ()) -> float:
        """How deep points lie within the hand [m]."""
        a, b, radius = self.capsules(q)
        counts = np.array([self.names[body] not in skip for body in self._body])
        a, way, radius = a[counts], (b - a)[counts], radius[counts]
        t = np.clip(((points @ way.T) - (a * way).sum(axis=1)) / (way * way).sum(axis=1), 0, 1)
        apart = np.linalg.norm(points[:, None] - a - t[:, :, None] * way, axis=2)
        return float(max(0.0, (radius - apart).max()))


def fits_kind(kind: str, extents: Array, palm: bool) -> bool:
    """Whether an object of these extents (across, along, beyond) lies as a type has it."""
    across, along, beyond = extents
    if kind == "round":
        return bool(extents.max() <= ROUND * extents.min())
    if kind == "flat":
        thin, others = (across, (along, beyond)) if palm else (min(across, beyond), (along, max(across, beyond)))
        return bool(thin <= FLAT * min(others))
    if kind.startswith("long"):
        return bool(along >= (1 - ALIKE) * max(across, beyond))
    return True


class Search:
    """All places of one object in one hand."""

    def __init__(self, solid: Solid, posed: Posed) -> None:
        self.solid, self.posed = solid, posed
        step = max(1, len(solid.points) // 1500)
        self._thin = solid.points[::step]
        self.why: dict[str, dict[str, int]] = {}
        """Of each type, how many places were left out for a reason."""

    def _left_out(self, of: GraspType, why: str) -> None:
        assert why in LEFT_OUT
        counts = self.why.setdefault(of.name, {})
        counts[why] = counts.get(why, 0) + 1

    def places(self, of: GraspType) -> list[Place]:
        """Of a type, the least cost first."""
        out: list[Place] = []
        for part in self.solid.parts():
            corners = self.solid.hull if part < 0 else self.solid.corners[part]
            for axes in self.solid.orientations(part):
                local = (corners - self.solid.centre) @ axes
                low, high = local.min(axis=0), local.max(axis=0)
                if not fits_kind(of.object, high - low, of.opposition == "palm"):
                    self._left_out(of, "its shape is another")
                    continue
                out += (self._on_palm if of.sites is None else self._between)(of, part, axes, low, high)
        first = sorted(out, key=lambda place: place.cost)[:TRIED]
        return sorted((self._stood(place) for place in first), key=lambda place: place.cost)

    def _middles(self, low: Array, high: Array, reach: float) -> list[tuple[float, float]]:
        """Offsets along and beyond from the centre of mass, such that what is held lies within the object."""
        ends = [(float(a) + reach, float(b) - reach) for a, b in zip(low[1:], high[1:])]
        mid = [(a + b) / 2 for a, b in ends]
        along = sorted({0.0 if a <= 0 <= b else m for (a, b), m in [(ends[0], mid[0])]}
                       | ({ends[0][0], ends[0][1], ends[0][0] / 2, ends[0][1] / 2} if ends[0][0] < ends[0][1] else set()), key=abs)
        beyond = sorted({0.0 if ends[1][0] <= 0 <= ends[1][1] else mid[1]} | ({ends[1][0], ends[1][0] / 2} if ends[1][0] < 0 else set()), key=abs)
        return list(product(along, beyond))

    def _thickness(self, of: GraspType, part: int, axes: Array, middle: Array, width: float, row: float, nothing: str) -> Optional[tuple[float, float, float]]:
        """Where the object begins and ends across, and its thickness [m], if a hand of the type spans it.

        :param nothing: the reason where there is no object
        """
        length = self.posed.length
        found = self.solid.between(part, axes, middle, width, row)
        if found is None:
            self._left_out(of, nothing)
            return None
        thickness = found[1] - found[0]
        if not of.size[0] * length <= thickness <= of.size[1] * length:
            self._left_out(of, "too thick" if thickness > of.size[1] * length else "too thin")
            return None
        return (*found, thickness)

    def _between(self, of: GraspType, part: int, axes: Array, low: Array, high: Array) -> list[Place]:
        assert of.sites is not None
        length, out = self.posed.length, list[Place]()
        row = PAD * length * max(len(of.sites[0]), len(of.sites[1]))
        for along, beyond in self._middles(low, high, PAD * length / 2):
            middle = self.solid.centre + axes @ np.array([0.0, along, beyond])
            found = self._thickness(of, part, axes, middle, PAD * length, row, "nothing lies between the fingers")
            if found is None:
                continue
            thickness = found[2]
            sites = self.posed.sites_at(of, thickness)
            if sites is None:
                self._left_out(of, "too thick" if thickness > self.posed.opened(of)[0].gap else "too thin")
                continue
            turn = sites.axes @ axes.T
            position = sites.middle - turn @ (middle + 0.5 * (found[0] + found[1]) * axes[:, 0])
            skip = [segment for side in of.sites for segment, _ in side]
            if self.posed.depth(self._thin @ turn.T + position, sites.q, skip) > OVERLAP:
                self._left_out(of, "the hand is in its way")
                continue
            out.append(self._placed(of, part, turn, position, thickness, sites.q, -sites.axes[:, 2], abs(along) + abs(beyond)))
        return out

    def _on_palm(self, of: GraspType, part: int, axes: Array, low: Array, high: Array) -> list[Place]:
        """The object's `across` is the palm's normal, out of the palm."""
        length, out = self.posed.length, list[Place]()
        q = self.posed.angles(of.open)
        breadth = 0.4 * length
        # Fingers bend round the side that is away from the wrist: the wider the object is there, the nearer to the fingertips its middle lies.
        wide = 0.45 * float(high[2] - low[2]) / length
        spots = {0.0} if low[1] <= 0 <= high[1] else {float(low[1] + high[1]) / 2}
        if high[1] - low[1] > breadth:
            spots |= {float(low[1]) + breadth / 2, float(high[1]) - breadth / 2}
        for along in sorted(spots, key=abs):
            middle = self.solid.centre + axes @ np.array([0.0, along, float(low[2] + high[2]) / 2])
            found = self._thickness(of, part, axes, middle, math.inf, breadth, "nothing lies in the palm")
            if found is None:
                continue
            thickness = found[2]
            for angle in of.about_normal:
                c, s = math.cos(angle), math.sin(angle)
                # Out of the palm, along the row of knuckles, beyond.
                hand = np.stack([[0.0, 0.0, -1.0], [c, s, 0.0], np.cross([0.0, 0.0, -1.0], [c, s, 0.0])], axis=1)
                turn = hand @ axes.T
                for forward in (0.31 + wide, 0.24 + wide):
                    at = np.array([-0.05 * length, forward * length, -0.5 * thickness - 0.09 * length])
                    position = at - turn @ (middle + 0.5 * (found[0] + found[1]) * axes[:, 0])
                    out.append(self._placed(of, part, turn, position, thickness, q, np.array([0.0, 0.0, 1.0]), abs(along) + 0.02 * abs(angle)))
        return out

    def _placed(self, of: GraspType, part: int, turn: Array, position: Array, thickness: float, q: Array, approach: Array, arm: float) -> Place:
        return Place(of, part, turn, position, thickness, q, approach, np.eye(3), POST[0], arm / self.posed.length + (0.2 if part >= 0 else 0.0))

    def _stood(self, place: Place) -> Place:
        """With the stand of the object at which the hand comes past the post best, and what that costs."""
        a, b, radius = self.posed.capsules(place.q)
        t = np.linspace(0, 1, 5)[:, None, None]
        cores = ((1 - t) * a + t * b).reshape(-1, 3)
        radii = np.tile(radius, 5)
        best: tuple[float, Array, float] = (math.inf, np.eye(3), POST[0])
        for rest in self.solid.rests:
            to = rest.turn @ place.turn.T  # R_WH
            points = cores @ to.T - to @ place.position
            under = rest.turn @ self.solid.centre
            below = points[:, 2] - radii < float((self.solid.hull @ rest.turn.T)[:, 2].min())
            clear = np.linalg.norm(points[below, :2] - under[:2], axis=1) - radii[below] - post_radius(rest.reach)
            cost = (max(0.0, GAP - float(clear.min(initial=math.inf))) / 0.02 + 0.3 * max(0.0, float(-to[2, 2]))
                    + (0.3 if rest.angle < math.radians(5) else 0.0))
            if cost < best[0] - 1e-9:
                best = cost, rest.turn, post_radius(rest.reach)
        return place._replace(rest=best[1], post=best[2], cost=place.cost + best[0])


def post_radius(reach: float) -> float:
    return float(np.clip(0.6 * reach, *POST))
