"""Frames of a recording whose forces are found: places of the hands that touch the object, and what their shares begin with (docs/forces.md)."""
from __future__ import annotations

import math
from typing import Collection, Iterator, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._forces_hands import Body, HandMotion, Hands
from ._forces_object import Common, common_of, elsewhere, loads, needed, standing
from ._nonnegative import lapack
from ._objects import Course, Thing
from ._sharing import PER, SHARES, Muscles, Places, Shared, costs
from ._touch import Surface, Touch, contact_jacobians, segment, touches

Array = NDArray[np.float64]
FRICTION, FRICTION_SPREAD = 0.8, 0.15
"""Of skin: handmodels/finger_pad.yaml."""
NEAR = 1e-3
"""Gap within which a place touches, beside the noise of hand and object [m]."""
BEGINS, ENDS, FURTHEST = 1.0, 2.0, 3.0
"""Noises beside NEAR: a place that comes this near touches, until it is so far away; up to the last it may bear a force, at a price."""
MOST_PLACES = 20
CHUNK = 512
"""Frames in memory at once."""
FINGERS = ("index", "middle", "ring", "little")


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


class Frame(NamedTuple):
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

    def pressing(self, shared: Shared) -> Array:
        """About joint axes, of the forces on the object alone [N m]."""
        return np.asarray(np.einsum("nkc,nk->c", self.jacobians, shared.force))


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

    def __init__(self, thing: Thing, times: Array, course: Course, hands: Sequence[HandMotion], asked: Asked, common: Optional[Common] = None) -> None:
        """:param common: of the recording that this is a part of; None: it is the whole"""
        self.thing, self.times, self.asked, self.motions = thing, times, asked, list(hands)
        self.interval = float(np.median(np.diff(times)))
        self.of = needed(thing, times, course)
        common = common or common_of([self.of])
        self.hands = Hands(hands, self.interval)
        self.surfaces = [Surface(link) for link in thing.links]
        # Of a place of each hand against the object.
        self.noises = [math.hypot(each.unsure, common.noise / 2) for each in hands]
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
        self.load, self.ground = np.ones(len(times)), math.nan
        if asked.support != "none":
            on, self.ground = standing(self.of, asked.support, common), common.level
            self.load = loads(on | elsewhere(self.of, times, on, common.near, self._untouched), times)

    def _touches(self, row: int) -> list[Touch]:
        """Places of the hands that may bear a force."""
        out: list[Touch] = []
        for k, each in enumerate(self.motions):
            if self.hands.tracked[k][row]:
                shapes = self.hands.shapes[k]
                out += touches(shapes, k, shapes.bodies(each.q[row], each.wrist[row]), self.surfaces, self.of.places[row],
                               NEAR + FURTHEST * self.noises[k])
        return out

    def _untouched(self, row: int) -> bool:
        return all(tracked[row] for tracked in self.hands.tracked) and not self._touches(row)

    def frame(self, row: int, before: Collection[int] = ()) -> Optional[Frame]:
        """None where the object was not seen.

        :param before: keys of the places that touched in the frame before
        """
        if not self.of.seen[row]:
            return None
        found = sorted(self._touches(row), key=lambda touch: touch.gap)[:MOST_PLACES]
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
        return Frame(row, found, on, places, keys, self.of.wrench[row] * self.load[row], jacobians)

    def _finger(self, touch: Touch) -> int:
        name = segment(self.hands.shapes[touch.hand].names[touch.shape])[0]
        return 4 * touch.hand + FINGERS.index(name) if name in FINGERS else -1

    def muscles(self, bodies: Sequence[Optional[Body]], jacobians: Array) -> Muscles:
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


def steady_of(frames: Sequence[Optional[Frame]], found: Sequence[Optional[Shared]], width: int) -> list[Optional[Array]]:
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


def start_of(frame: Frame, before: Optional[Frame], shared: Optional[Shared]) -> Optional[NDArray[np.intp]]:
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
