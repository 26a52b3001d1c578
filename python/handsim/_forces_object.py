"""What motion and weight of a recorded object ask for, and what it stands on: docs/forces.md."""
from __future__ import annotations

import math
from typing import Callable, NamedTuple, Sequence

import numpy as np
from numpy.typing import NDArray

from ._model import matrices, turned
from ._object_motion import Motion, smooth_columns, smoothed
from ._objects import Course, Link, Thing

Array = NDArray[np.float64]
GRAVITY = np.array([0, 0, -9.80665])
LOADING = 0.4
"""Within which hands take over the weight before an object leaves its support [s]: chosen."""
POST = 0.1
"""Of a post: how far beside its place an object no longer stands on it [m]."""
STILL = 0.03
"""Speed of an object that rests [m/s], at most: chosen."""
REST = 0.2
"""For so long an object must lie still, with no hand within reach, to stand on something [s]: chosen."""


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


class Common(NamedTuple):
    """What belongs to a whole recording: noise, and what the object stands on where it rests lowest."""

    noise: float
    """Standard deviation of a measured coordinate of the object [m]."""
    level: float
    """Height of the support [m]."""
    place: Array
    """Of the object's centre there, in the ground's plane [m], shape (2,)."""

    @property
    def near(self) -> float:
        """Height over the support within which an object stands on it [m]."""
        return max(3e-3, 3 * self.noise)


def common_of(parts: Sequence[Needed]) -> Common:
    """:param parts: of the recording, or samples of it"""
    lowest, centre = np.concatenate([of.lowest for of in parts]), np.concatenate([of.centre for of in parts])
    seen = np.concatenate([of.seen for of in parts])
    still = (np.linalg.norm(np.concatenate([of.motion.velocity for of in parts]), axis=1) < STILL) & seen
    rows = np.flatnonzero(still if still.any() else seen)
    low = float(np.percentile(lowest[rows], 2))
    level = float(np.median(lowest[rows][lowest[rows] < low + 0.01]))
    out = Common(parts[0].motion.noise[0] if len(parts) == 1 else math.sqrt(sum(of.motion.noise[0]**2 for of in parts) / len(parts)), level, centre[0, :2])
    on = (lowest < level + out.near) & seen
    return out._replace(place=np.median(centre[on, :2], axis=0)) if on.any() else out


def standing(of: Needed, support: str, common: Common) -> NDArray[np.bool_]:
    """On the support where it rests lowest."""
    on = of.lowest < common.level + common.near
    if support == "post":
        on &= np.linalg.norm(of.centre[:, :2] - common.place, axis=1) < POST
    return np.asarray(on)


def _runs(of: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """Of consecutive True, as first and end; those of at least so many."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], of, [False]]).astype(int)))
    return [(first, end) for first, end in zip(ends[::2].tolist(), ends[1::2].tolist()) if end - first >= least]


def elsewhere(of: Needed, times: Array, on: NDArray[np.bool_], near: float, untouched: Callable[[int], bool]) -> NDArray[np.bool_]:
    """Where the object stands on something higher, such as a shelf: it lies still there for some time while no hand is within reach, and is no
    farther than `near` from that height before and after.

    :param on: where it stands on its support
    :param untouched: whether no hand is within reach in a frame, and every hand is seen
    """
    still = of.seen & ~on & (np.linalg.norm(of.motion.velocity, axis=1) < STILL)
    least = max(2, math.ceil(REST / float(np.median(np.diff(times)))))
    out = np.zeros(len(times), dtype=bool)
    for first, end in _runs(still, least):
        for a, b in _runs(np.array([untouched(row) for row in range(first, end)]), least):
            low, high = first + a, first + b
            there = of.seen & (np.abs(of.lowest - np.median(of.lowest[low:high])) < near)
            while low > 0 and there[low - 1]:
                low -= 1
            while high < len(times) and there[high]:
                high += 1
            out[low:high] = True
    return out


def loads(on: NDArray[np.bool_], times: Array) -> Array:
    """Share of the wrench that hands bear if they touch. :param on: where the object stands on something"""
    free = times[~on]
    if not len(free):
        return np.zeros(len(times))
    after = np.searchsorted(free, times)
    away = np.minimum(np.abs(times - free[np.minimum(after, len(free) - 1)]), np.abs(times - free[np.maximum(after - 1, 0)]))
    return np.where(on, np.clip(1 - away / LOADING, 0, 0.999), 1.0)
