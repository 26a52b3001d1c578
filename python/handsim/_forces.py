"""Forces between recorded hands and a recorded object: docs/forces.md.

The object's motion and weight ask for a wrench in each frame. Places of the hands that touch share it (`_sharing`). Motion does not show how hard
opposite fingers squeeze: that is taken from how people hold things, and its band from how much they differ.
"""
from __future__ import annotations

import math
import warnings
from typing import Any, Callable, Collection, Iterator, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._hand import Hand
from ._model import matrices, turned
from ._nonnegative import lapack
from ._object_motion import Motion, smooth_columns, smoothed
from ._objects import Course, Link, Thing
from ._sharing import PER, SHARES, Muscles, Places, Shared, costs, share
from ._touch import HandShapes, Surface, Touch, contact_jacobians, segment, touches

Array = NDArray[np.float64]
GRAVITY = np.array([0, 0, -9.80665])
FRICTION, FRICTION_SPREAD = 0.8, 0.15
"""Of skin: handmodels/finger_pad.yaml."""
MARGIN, MARGIN_SPREAD = math.sqrt(1.2 * 2.0), math.log(2.0 / 1.2) / (2 * 1.645)
"""Grip over the least that holds: people's median and the deviation of its logarithm, for 1.2 to 2 in nine of ten."""
SPIN = 3.75e-3
"""Largest moment about the normal over friction and normal force [m]: handmodels/finger_pad.yaml."""
SHARING_SPREAD = 0.4
"""Deviation of the logarithm of how a person weighs the pressure of a place: chosen."""
FINGER_SPREAD = 0.3
"""The same of the shares of fingers: chosen."""
MASS_SPREAD = 0.02
"""Of a mass that was stated: chosen."""
LOADING = 0.4
"""Within which hands take over the weight before an object leaves its support [s]: chosen."""
NEAR = 1e-3
"""Gap within which a place touches, beside the noise of hand and object [m]."""
BEGINS, ENDS, FURTHEST = 1.0, 2.0, 3.0
"""Noises beside NEAR: a place that comes this near touches, until it is so far away; up to the last it may bear a force, at a price."""
SHORT = 0.1
"""Share of the weight: a frame with a larger residual has too little contact."""
MOST_PLACES = 20
WINDOW = 0.1
"""Over which forces are steady [s]."""
CHUNK = 512
"""Frames in memory at once."""
POST = 0.1
"""Of a post: how far beside its place an object no longer stands on it [m]."""
FINGERS = ("index", "middle", "ring", "little")
STATES = ("unseen", "apart", "supported", "held", "short")
LOW, HIGH = 0.05, 0.95
"""Of the bands."""


class Asked(NamedTuple):
    friction: float = FRICTION
    friction_spread: float = FRICTION_SPREAD
    support: str = "table"
    """table, post or none."""
    muscles: bool = False
    draws: int = 0
    """Of what is uncertain; 0: no bands."""
    seed: int = 1
    weighed: bool = True
    """False: nobody knows the mass; forces are those of an object of 1 kg."""


class HandMotion(NamedTuple):
    """A tracked hand; rows are frames."""

    name: str
    hand: Hand
    q: Array
    """[rad]; NaN where it was not tracked."""
    wrist: Array
    """Pose of the hand frame in the world."""
    noise: float
    """Of a coordinate of its points [m]."""
    rms: float = 0.0
    """Of the distances of the points from those of the fitted hand [m]."""

    @property
    def unsure(self) -> float:
        """Standard deviation of a coordinate of a place on the hand [m]: half of the noise, which is smoothed, and what the fit leaves beside the noise."""
        return math.hypot(self.noise / 2, math.sqrt(max(self.rms**2 / 3 - self.noise**2, 0)))


class Result(NamedTuple):
    """Rows are frames; `segments` are columns of all that is by segment."""

    times: Array
    mass: float
    state: NDArray[np.intp]
    """Index of STATES."""
    wrench: Array
    """That the object needs from what touches it, about its centre of mass, world axes [N], [N m], shape (frames, 6)."""
    unsure: Array
    """Standard deviation of each component, shape (6,)."""
    load: Array
    """Share of it that hands bear, 0 to 1: the rest a support."""
    residual: Array
    """What no place that touches gives, shape (frames, 6) [N], [N m]."""
    segments: list[str]
    """right.index_distal, ..."""
    normal: Array
    """Normal force by segment [N]."""
    force: Array
    """On the object by segment, world axes, shape (frames, segments, 3) [N]."""
    centre: Array
    """Of pressure by segment, world [m], shape (frames, segments, 3); NaN without a force."""
    used: Array
    """Tangential over normal force by segment; NaN without a force."""
    gap: Array
    """Of the nearest place by segment [m]; NaN where it cannot bear a force."""
    touching: NDArray[np.bool_]
    """By segment: it touches."""
    fingers: list[str]
    """right.index, ...: the palm is one."""
    by_finger: Array
    """Normal force [N]."""
    bands: Optional[Array]
    """Of by_finger: 5 and 95 %, shape (frames, fingers, 2)."""
    axes: list[str]
    torque: Array
    """About joint axes, with the contacts: what muscles and tissue give [N m]."""
    torque_bands: Optional[Array]
    pressing: Array
    """About joint axes, of the forces on the object alone [N m]."""
    effort: Array
    """Largest share of the strength about an axis that its torque takes, by hand."""
    heaviest: Array
    """Mass of the object up to which the strength about every axis suffices [kg]; NaN where nothing presses."""
    muscles: list[str]
    activation: Array
    activation_bands: Optional[Array]
    motion: Motion
    places: Array
    """Of the object's links, shape (frames, links, 7)."""
    hinge: Array
    """[rad]"""
    noise: float
    """Standard deviation of a place of a hand against the object [m]."""
    reach: float
    """Gap at which a contact begins [m]."""
    ground: float
    """Height of the support [m]; NaN without one."""

    @property
    def lifted(self) -> NDArray[np.bool_]:
        return (self.load >= 1) & (self.state > 0)

    @property
    def share(self) -> Array:
        """Residual force over the weight, or its moment over that of the weight at 5 cm, whichever is more."""
        weight = self.mass * 9.80665
        out: Array = np.maximum(np.linalg.norm(self.residual[:, :3], axis=1) / weight, np.linalg.norm(self.residual[:, 3:], axis=1) / (0.05 * weight))
        return out


class Needed(NamedTuple):
    """Of the object."""

    motion: Motion
    places: Array
    centre: Array
    """Of mass, shape (frames, 3)."""
    wrench: Array
    unsure: Array
    seen: NDArray[np.bool_]
    lowest: Array
    """Height of its lowest point [m]."""


def _of_link(link: Link, motion: Motion, centre: Array) -> Array:
    axes = matrices(motion.poses)[:, :3, :3]
    arm = np.einsum("nij,j->ni", axes, link.centre)
    w, a = motion.turning, motion.turning_up
    force = link.mass * (motion.acceleration + np.cross(a, arm) + np.cross(w, np.cross(w, arm)) - GRAVITY)
    inertia = axes @ link.inertia @ axes.transpose(0, 2, 1)
    moment = np.einsum("nij,nj->ni", inertia, a) + np.cross(w, np.einsum("nij,nj->ni", inertia, w))
    return np.concatenate([force, moment + np.cross(motion.poses[:, :3] + arm - centre, force)], axis=1)


def needed(thing: Thing, times: Array, course: Course) -> Needed:
    """:param times: equally far apart; the course is interpolated to them"""
    seen = np.isfinite(course.poses).all(axis=1)
    own = np.array([np.interp(times, course.times[seen], column[seen]) for column in course.poses.T]).T
    nearest = np.minimum(np.searchsorted(course.times, times - 1e-6), len(course.times) - 1)
    own[:, 3:] /= np.linalg.norm(own[:, 3:], axis=1, keepdims=True)
    there = seen[nearest]
    angles = np.interp(times, course.times[seen], np.nan_to_num(course.angles)[seen])
    whole = smoothed(times, np.where(there[:, None], own, np.nan))
    if thing.hinge is not None:
        angles = smooth_columns(angles[:, None], there)[0][:, 0]
    places = thing.places(whole.poses, angles)
    motions = [whole, *(smoothed(times, places[:, k]) for k in range(1, len(thing.links)))]
    centres = [turned(places[:, k, 3:], link.centre) + places[:, k, :3] for k, link in enumerate(thing.links)]
    centre: Array = np.sum([link.mass * at for link, at in zip(thing.links, centres)], axis=0) / thing.mass
    wrench: Array = np.sum([_of_link(link, motion, centre) for link, motion in zip(thing.links, motions)], axis=0)
    spread = math.sqrt(sum(float(np.trace(link.inertia)) / 3 for link in thing.links))
    unsure = np.concatenate([np.full(3, thing.mass * whole.unsure[0]), np.full(3, spread**2 * whole.unsure[1])])
    lowest = np.min([(turned(places[:, k, None, 3:], np.concatenate(link.corners)[None]) + places[:, k, None, :3])[..., 2].min(axis=1)
                     for k, link in enumerate(thing.links)], axis=0)
    return Needed(whole, places, centre, wrench, unsure, there, lowest)


def _level(of: Needed) -> float:
    """Height of what the object stands on where it rests lowest."""
    still = (np.linalg.norm(of.motion.velocity, axis=1) < 0.03) & of.seen
    rows = np.flatnonzero(still if still.any() else of.seen)
    low = float(np.percentile(of.lowest[rows], 2))
    return float(np.median(of.lowest[rows][of.lowest[rows] < low + 0.01]))


def loads(of: Needed, times: Array, support: str) -> tuple[Array, float]:
    """Share of the wrench that hands bear if they touch, and the height of the support."""
    if support == "none":
        return np.ones(len(times)), math.nan
    level = _level(of)
    on = of.lowest < level + max(3e-3, 3 * of.motion.noise[0])
    if support == "post":
        at = np.median(of.centre[on & of.seen, :2], axis=0) if (on & of.seen).any() else of.centre[0, :2]
        on &= np.linalg.norm(of.centre[:, :2] - at, axis=1) < POST
    free = times[~on]
    if not len(free):
        return np.zeros(len(times)), level
    after = np.searchsorted(free, times)
    away = np.minimum(np.abs(times - free[np.minimum(after, len(free) - 1)]), np.abs(times - free[np.maximum(after - 1, 0)]))
    return np.where(on, np.clip(1 - away / LOADING, 0, 0.999), 1.0), level


class _Frame(NamedTuple):
    """Of which forces are found."""

    row: int
    found: list[Touch]
    on: NDArray[np.bool_]
    """By place: it touches."""
    places: Places
    keys: list[int]
    """Of each place: hand and shape as one number, by which it is known in other frames."""
    wrench: Array
    jacobians: Array
    """Of the places, shape (n, 3, coordinates of all hands)."""

    @property
    def hands(self) -> int:
        """That have two fingers on the object."""
        fingers = np.unique(self.places.fingers[self.places.fingers >= 0])
        return int(np.count_nonzero(np.unique(fingers // 4, return_counts=True)[1] > 1))

    @property
    def touching(self) -> set[int]:
        """Keys of the places that touch."""
        return {key for key, on in zip(self.keys, self.on) if on}


class _Body(NamedTuple):
    """What a hand needs without contacts, and has."""

    needed: Array
    passive: Array
    active: Array
    """Torques of full activations, shape (coordinates, muscles)."""


def _lowpass(values: Array, interval: float) -> Array:
    """Of the tracked angles, as `handsim inverse` has it: 6 Hz, forwards and backwards. NaN stays."""
    from scipy.signal import butter, filtfilt

    out = values.copy()
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(rows) < 20 or 6.0 * interval * 2 >= 0.95:
        return out
    full = np.array([np.interp(np.arange(len(values)), rows, column[rows]) for column in values.T]).T
    b, a = butter(2, 6.0 * interval * 2)
    out[rows] = filtfilt(b, a, full, axis=0)[rows]
    return out


class _Hands:
    """The hands' dynamics, without contacts."""

    def __init__(self, hands: Sequence[HandMotion], interval: float) -> None:
        self.hands, self.interval = hands, interval
        self.shapes = [HandShapes(each.hand) for each in hands]
        self.smooth = [_lowpass(each.q, interval) for each in hands]
        self.rates = [np.gradient(q, interval, axis=0) if len(q) > 1 else np.zeros_like(q) for q in self.smooth]
        self.accelerations = [np.gradient(u, interval, axis=0) if len(u) > 1 else np.zeros_like(u) for u in self.rates]
        self.wrists = [np.gradient(np.gradient(_lowpass(each.wrist[:, :3], interval), interval, axis=0), interval, axis=0) if len(each.wrist) > 1
                       else np.zeros((len(each.wrist), 3)) for each in hands]
        joints = [each.hand.joints for each in hands]
        self.stiffness = [np.asarray(each["stiffness"]) for each in joints]
        self.rest = [np.asarray(each["rest"]) for each in joints]
        self.axes = [f"{each.name}.{name}" for each in hands for name in each.hand.coordinates]
        self.muscles = [f"{each.name}.{name}" for each in hands for name in each.hand.muscles]
        self.starts = np.cumsum([0, *(len(each.hand.coordinates) for each in hands)])
        self.pulls = np.cumsum([0, *(len(each.hand.muscles) for each in hands)])
        self.tracked = [np.isfinite(each.q).all(axis=1) for each in hands]

    def body(self, k: int, row: int) -> _Body:
        hand = self.hands[k]
        core, q = hand.hand.scene._core, hand.q[row]
        gravity = GRAVITY - np.nan_to_num(self.wrists[k][row])
        back = hand.wrist[row, 3:] * [1, -1, -1, -1]
        torque = _core.hand_inverse_dynamics(core, q, np.nan_to_num(self.rates[k][row]), np.nan_to_num(self.accelerations[k][row]), turned(back, gravity))
        passive = self.stiffness[k] * (self.rest[k] - q)
        if not hand.hand.muscles:
            return _Body(torque, passive, np.zeros((len(q), 0)))
        arms, _, active, rest, bands = _core.hand_muscles(core, q)
        return _Body(torque, passive + rest @ arms + bands, arms.T * active)


def smooth_rows(values: Array, width: int) -> Array:
    """Moving means over frames in which a value is known."""
    if width < 2 or not values.size:
        return values
    known = np.isfinite(values)
    kernel = np.ones(min(width, 2 * len(values) - 1))
    middle = slice(len(kernel) // 2, len(kernel) // 2 + len(values))
    total, count = (np.apply_along_axis(np.convolve, 0, each, kernel)[middle] for each in (np.where(known, values, 0.0), known.astype(float)))
    return np.asarray(np.where(known, total / np.maximum(count, 1), np.nan))


class Solver:
    """Of a recording of one object."""

    def __init__(self, thing: Thing, times: Array, course: Course, hands: Sequence[HandMotion], asked: Asked) -> None:
        self.thing, self.times, self.asked, self.motions = thing, times, asked, list(hands)
        self.interval = float(np.median(np.diff(times)))
        self.of = needed(thing, times, course)
        self.load, self.ground = loads(self.of, times, asked.support)
        self.hands = _Hands(hands, self.interval)
        self.surfaces = [Surface(link) for link in thing.links]
        # Of a place of each hand against the object.
        self.noises = [math.hypot(each.unsure, self.of.motion.noise[0] / 2) for each in hands]
        self.noise = max(self.noises, default=0.0)
        self.reach = NEAR + BEGINS * self.noise
        self.weight = thing.mass * 9.80665
        self.bones = [(k, name) for k, each in enumerate(hands) for name in dict.fromkeys(self.hands.shapes[k].names)]
        self.segments = [f"{hands[k].name}.{name}" for k, name in self.bones]
        self.column = {bone: i for i, bone in enumerate(self.bones)}
        named = [f"{hands[k].name}.{segment(name)[0]}" for k, name in self.bones]
        self.fingers = list(dict.fromkeys(named))
        self.finger = np.array([self.fingers.index(name) for name in named], dtype=np.intp)
        self.lapack = lapack()

    def frame(self, row: int, before: Collection[int] = ()) -> Optional[_Frame]:
        """None where the object was not seen.

        :param before: keys of the places that touched in the frame before
        """
        if not self.of.seen[row]:
            return None
        found: list[Touch] = []
        for k, each in enumerate(self.motions):
            if self.hands.tracked[k][row]:
                shapes = self.hands.shapes[k]
                found += touches(shapes, k, shapes.bodies(each.q[row], each.wrist[row]), self.surfaces, self.of.places[row],
                                 NEAR + FURTHEST * self.noises[k])
        found = sorted(found, key=lambda touch: touch.gap)[:MOST_PLACES]
        gaps = np.array([touch.gap for touch in found])
        noises = np.array([self.noises[touch.hand] for touch in found])
        keys = [1000 * touch.hand + touch.shape for touch in found]
        on = gaps < NEAR + np.where(np.isin(keys, list(before)), ENDS, BEGINS) * noises
        radii = np.array([self.hands.shapes[touch.hand].radii[self.hands.shapes[touch.hand].first[touch.shape]] for touch in found])
        twins = [keys.count(key) > 1 for key in keys]
        fingers = np.array([self._finger(touch) if own else -1 for touch, own in zip(found, on)], dtype=np.intp)
        places = Places(np.array([touch.place for touch in found]).reshape(-1, 3), np.array([touch.normal for touch in found]).reshape(-1, 3),
                        costs(radii, gaps - NEAR, twins, on, noises) if found else np.zeros(0),
                        fingers, SHARES[np.maximum(fingers, 0) % 4], self.noise)
        total = int(self.hands.starts[-1])
        jacobians = np.zeros((len(found), 3, total))
        for k, each in enumerate(self.motions):
            own = [i for i, touch in enumerate(found) if touch.hand == k]
            if own:
                jacobians[own, :, int(self.hands.starts[k]):int(self.hands.starts[k + 1])] = contact_jacobians(
                    self.hands.shapes[k], each.q[row], each.wrist[row], [found[i] for i in own])
        return _Frame(row, found, on, places, keys, self.of.wrench[row] * self.load[row], jacobians)

    def _finger(self, touch: Touch) -> int:
        name = segment(self.hands.shapes[touch.hand].names[touch.shape])[0]
        return 4 * touch.hand + FINGERS.index(name) if name in FINGERS else -1

    def muscles(self, bodies: Sequence[Optional[_Body]], jacobians: Array) -> Muscles:
        total, count = int(self.hands.starts[-1]), int(self.hands.pulls[-1])
        torques, needed_ = np.zeros((total, count)), np.zeros(total)
        for k, body in enumerate(bodies):
            if body is not None:
                rows = slice(int(self.hands.starts[k]), int(self.hands.starts[k + 1]))
                torques[rows, int(self.hands.pulls[k]):int(self.hands.pulls[k + 1])] = body.active
                needed_[rows] = body.needed - body.passive
        return Muscles(torques, needed_, jacobians)

    def chunks(self) -> Iterator[tuple[int, int]]:
        for first in range(0, len(self.times), CHUNK):
            yield first, min(first + CHUNK, len(self.times))


def _steady(frames: Sequence[Optional[_Frame]], found: Sequence[Optional[Shared]], width: int) -> list[Optional[Array]]:
    """Normal forces of each frame's places, as neighbouring frames have them, a place of a shape for half of it."""
    keys = sorted({key for frame in frames if frame for key in frame.keys})
    at = {key: i for i, key in enumerate(keys)}
    table = np.full((len(frames), len(keys)), np.nan)
    for row, (frame, shared) in enumerate(zip(frames, found)):
        if frame and shared is not None:
            table[row] = 0.0
            for key, force in zip(frame.keys, shared.normal):
                table[row, at[key]] += force
    smooth = smooth_rows(table, width)
    return [np.array([smooth[row, at[key]] / frame.keys.count(key) for key in frame.keys]) if frame else None for row, frame in enumerate(frames)]


def _start(frame: _Frame, before: Optional[_Frame], shared: Optional[Shared]) -> Optional[NDArray[np.intp]]:
    """Unknowns that were not 0 in the frame before, of the places that are there in both; other unknowns count from the end."""
    if before is None or shared is None:
        return None
    ends = len(before.keys) * PER, len(frame.keys) * PER
    forces, others = shared.active[shared.active < ends[0]], shared.active[shared.active >= ends[0]]
    at = {(key, frame.keys[:i].count(key)): i for i, key in enumerate(frame.keys)}
    places = np.array([at.get((key, before.keys[:i].count(key)), -1) for i, key in enumerate(before.keys)], dtype=np.intp)
    to = places[forces // PER] if len(places) else forces
    # Fingers' means stand between the forces and the muscles: both have as many only where the same hands touch.
    own = others - ends[0] + ends[1] if before.hands == frame.hands else others[:0]
    return np.asarray(np.concatenate([(to * PER + forces % PER)[to >= 0], own]), dtype=np.intp)


class Draw(NamedTuple):
    """Of what is uncertain."""

    friction: float
    margin: float
    mass: float
    sharing: dict[int, float]
    """By key of a place: a factor on its cost."""
    fingers: Array
    """By finger of each hand: a factor on its share."""
    seed: int


def draws_of(asked: Asked, keys: Sequence[int]) -> list[Draw]:
    random = np.random.default_rng(asked.seed)
    out = []
    for i in range(asked.draws):
        friction = max(0.1, asked.friction + asked.friction_spread * random.normal())
        margin = max(1.0, MARGIN * math.exp(MARGIN_SPREAD * random.normal()))
        out.append(Draw(friction, margin, 1 + (MASS_SPREAD if asked.weighed else 0) * random.normal(),
                        {key: math.exp(SHARING_SPREAD * random.normal()) for key in keys}, np.exp(FINGER_SPREAD * random.normal(size=8)),
                        asked.seed + 1000 + i))
    return out


def solve(of: Solver, told: Optional[Callable[[float], object]] = None) -> Result:
    """Forces of all frames."""
    asked, hands, count = of.asked, of.hands, len(of.times)
    n, total, pulls = len(of.segments), int(hands.starts[-1]), int(hands.pulls[-1])
    state = np.zeros(count, dtype=np.intp)
    normal, force, centre = np.zeros((count, n)), np.zeros((count, n, 3)), np.full((count, n, 3), np.nan)
    gap, residual, torque = np.full((count, n), np.nan), np.zeros((count, 6)), np.full((count, total), np.nan)
    pressing, effort, heaviest = np.zeros((count, total)), np.full((count, len(of.motions)), np.nan), np.full(count, np.nan)
    activation = np.full((count, pulls if asked.muscles else 0), np.nan)
    load, touch_ = of.load.copy(), np.zeros((count, n), dtype=bool)
    shapes = [1000 * k + i for k, each in enumerate(hands.shapes) for i in range(len(each.names))]
    draws = draws_of(asked, shapes)
    bands = np.full((count, len(of.fingers), 2), np.nan) if draws else None
    torque_bands = np.full((count, total, 2), np.nan) if draws else None
    activation_bands = np.full((*activation.shape, 2), np.nan) if draws and asked.muscles else None
    width = max(1, int(round(WINDOW / of.interval)) | 1)
    friction = asked.friction / MARGIN
    frames: list[Optional[_Frame]] = []
    bodies: list[list[Optional[_Body]]] = []
    begun, touching = 0, set[int]()

    for first, last in of.chunks():
        low, high = max(0, first - width), min(count, last + width)
        # Of the chunk before, its end is kept: contact depends on the frame before.
        frames, bodies = frames[low - begun:], bodies[low - begun:]
        begun = low
        for row in range(low + len(frames), high):
            made = of.frame(row, touching)
            frames.append(made)
            touching = set() if made is None else made.touching
            bodies.append([hands.body(k, row) if hands.tracked[k][row] else None for k in range(len(of.motions))])

        def one(frame: _Frame, place: int, own: Places, wrench: Array, mu: float, steady: Optional[Array], start: Optional[Any]) -> Shared:
            muscles = of.muscles(bodies[place], frame.jacobians) if asked.muscles else None
            total = float(np.linalg.norm(wrench[:3])) / mu
            return share(own, wrench, of.of.centre[frame.row], of.weight, mu, SPIN * mu, total, steady, muscles, start, of.lapack)

        def drawn(mu: float, change: Callable[[_Frame], tuple[Places, Array]]) -> list[Optional[Shared]]:
            """Every frame for itself, from the set of the likeliest solution: what is drawn is smoothed together."""
            return [None if frame is None or first_ is None else one(frame, i, *change(frame), mu, None, first_.active)
                    for i, (frame, first_) in enumerate(zip(frames, rough))]

        rough: list[Optional[Shared]] = []
        last_: tuple[Optional[_Frame], Optional[Shared]] = None, None
        for i, frame in enumerate(frames):
            rough.append(None if frame is None else one(frame, i, frame.places, frame.wrench, friction, None, _start(frame, *last_)))
            last_ = frame, rough[-1]
        steady = _steady(frames, rough, width)
        found = [None if frame is None or first_ is None else one(frame, i, frame.places, frame.wrench, friction, steady[i], first_.active)
                 for i, (frame, first_) in enumerate(zip(frames, rough))]
        for i, (frame, shared) in enumerate(zip(frames, found)):
            row = low + i
            if not first <= row < last:
                continue
            if frame is None or shared is None:
                load[row] = np.nan
                continue
            residual[row] = shared.residual
            pressed = np.zeros((n, 3))
            for touch, touched, strength, on, shift in zip(frame.found, frame.on, shared.normal, shared.force, shared.shift):
                at = of.column[touch.hand, hands.shapes[touch.hand].names[touch.shape]]
                normal[row, at] += strength
                force[row, at] += on
                pressed[at] += strength * (touch.place + shift)
                gap[row, at] = np.fmin(gap[row, at], touch.gap)
                touch_[row, at] |= touched
            whose = normal[row] > 1e-6
            centre[row, whose] = pressed[whose] / normal[row, whose, None]
            pressing[row] = np.einsum("nkc,nk->c", frame.jacobians, shared.force)
            torque[row] = _torques(hands, bodies[i], frame, shared)
            effort[row] = _efforts(hands, bodies[i], torque[row])
            heaviest[row] = of.thing.mass * _heaviest(hands, bodies[i], torque[row], pressing[row])
            if asked.muscles:
                activation[row] = np.minimum(shared.activation, 1)
            near = bool(frame.on.any())
            share_ = max(float(np.linalg.norm(shared.residual[:3])) / of.weight, float(np.linalg.norm(shared.residual[3:])) / (0.05 * of.weight))
            if load[row] < 1 and not near:
                load[row], residual[row], normal[row], force[row], centre[row] = 0, 0, 0, 0, np.nan
                pressing[row] = 0
                state[row] = STATES.index("apart")
            else:
                state[row] = STATES.index("short" if share_ > SHORT else "held" if load[row] >= 1 else "supported")
        if draws:
            kept = _drawn(of, frames, draws, drawn, bodies)
            rows, own = slice(first, last), slice(first - low, last - low)
            apart = state[rows] == STATES.index("apart")
            for goal, values in ((bands, kept[0]), (torque_bands, kept[1]), (activation_bands, kept[2])):
                if goal is not None:
                    smooth = np.stack([smooth_rows(each, width) for each in values])[:, own]
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore", RuntimeWarning)  # frames in which nothing was seen
                        goal[rows] = np.moveaxis(np.nanquantile(smooth, (LOW, HIGH), axis=0), 0, -1)
            if bands is not None:
                bands[rows][apart] = 0
        if told is not None:
            told(last / count)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = np.linalg.norm(force, axis=2)
        used = np.where(normal > 1e-6, np.sqrt(np.maximum(along**2 - normal**2, 0)) / normal, np.nan)
    by_finger = np.zeros((count, len(of.fingers)))
    np.add.at(by_finger.T, of.finger, normal.T)
    return Result(of.times, of.thing.mass, state, of.of.wrench, of.of.unsure, np.nan_to_num(load), residual, of.segments, normal, force, centre, used, gap, touch_,
                  of.fingers, by_finger, bands, hands.axes, torque, torque_bands, pressing, effort, heaviest, hands.muscles if asked.muscles else [], activation,
                  activation_bands, of.of.motion, of.of.places, np.zeros(count), of.noise, of.reach, of.ground)


def _torques(hands: _Hands, bodies: Sequence[Optional[_Body]], frame: _Frame, shared: Shared) -> Array:
    """About joint axes [N m]: of the motion, and of the forces on the object, which press back."""
    out = np.full(int(hands.starts[-1]), np.nan)
    pressing = np.einsum("nkc,nk->c", frame.jacobians, shared.force)
    for k, body in enumerate(bodies):
        if body is not None:
            rows = slice(int(hands.starts[k]), int(hands.starts[k + 1]))
            out[rows] = body.needed + pressing[rows]
    return out


def _strength(body: _Body, hand: Hand, along: Array) -> tuple[Array, NDArray[np.bool_]]:
    """What all muscles about an axis give, the way that a torque acts, and the axes that count: not those of the wrist."""
    strength = np.where(along > 0, np.maximum(body.active, 0).sum(axis=1), np.maximum(-body.active, 0).sum(axis=1))
    return strength, np.array([not name.startswith("wrist") for name in hand.coordinates]) & (strength > 1e-3)


def _efforts(hands: _Hands, bodies: Sequence[Optional[_Body]], torque: Array) -> Array:
    """Largest share of what all muscles about an axis give that its torque takes, by hand."""
    out = np.full(len(bodies), np.nan)
    for k, body in enumerate(bodies):
        if body is None or not body.active.shape[1]:
            continue
        active = torque[int(hands.starts[k]):int(hands.starts[k + 1])] - body.passive
        strength, counts = _strength(body, hands.hands[k].hand, active)
        out[k] = float((np.abs(active) / np.maximum(strength, 1e-3))[counts].max(initial=0))
    return out


def _heaviest(hands: _Hands, bodies: Sequence[Optional[_Body]], torque: Array, pressing: Array) -> float:
    """Factor on the forces on the object up to which muscles give the torques; NaN where no torque comes of them."""
    out = np.inf
    for k, body in enumerate(bodies):
        if body is None or not body.active.shape[1]:
            continue
        rows = slice(int(hands.starts[k]), int(hands.starts[k + 1]))
        own, pressed = torque[rows] - pressing[rows] - body.passive, pressing[rows]
        strength, counts = _strength(body, hands.hands[k].hand, pressed)
        counts &= np.abs(pressed) > 1e-9
        out = min(out, float(((strength - np.sign(pressed) * own)[counts] / np.abs(pressed[counts])).min(initial=np.inf)))
    return max(out, 0.0) if np.isfinite(out) else np.nan


def _drawn(of: Solver, frames: Sequence[Optional[_Frame]], draws: Sequence[Draw], solved: Any,
           bodies: Sequence[Sequence[Optional[_Body]]]) -> tuple[Array, Array, Array]:
    """Normal forces of fingers, torques and activations of each draw, shape (draws, frames, ...)."""
    fingers = np.full((len(draws), len(frames), len(of.fingers)), np.nan)
    torques = np.full((len(draws), len(frames), int(of.hands.starts[-1])), np.nan)
    activations = np.full((len(draws), len(frames), int(of.hands.pulls[-1]) if of.asked.muscles else 0), np.nan)
    for d, draw in enumerate(draws):
        def change(frame: _Frame) -> tuple[Places, Array]:
            random = np.random.default_rng((draw.seed, frame.row))
            weights = np.array([draw.sharing[key] for key in frame.keys])
            shares = frame.places.shares * np.array([draw.fingers[max(finger, 0)] for finger in frame.places.fingers])
            moved = frame.places.points + of.noise * random.normal(size=frame.places.points.shape)
            wrench = frame.wrench * draw.mass + of.of.unsure * random.normal(size=6) * of.load[frame.row]
            return frame.places._replace(points=moved, costs=frame.places.costs * weights, shares=shares), wrench
        for i, (frame, shared) in enumerate(zip(frames, solved(draw.friction / draw.margin, change))):
            if frame is None or shared is None:
                continue
            fingers[d, i] = 0
            for touch, strength in zip(frame.found, shared.normal):
                fingers[d, i, of.finger[of.column[touch.hand, of.hands.shapes[touch.hand].names[touch.shape]]]] += strength
            torques[d, i] = _torques(of.hands, bodies[i], frame, shared)
            if of.asked.muscles:
                activations[d, i] = np.minimum(shared.activation, 1)
    return fingers, torques, activations
