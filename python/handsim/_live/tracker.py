"""Joint angles of a tracked hand, frame by frame: a Kalman filter over the inverse kinematics of `handsim track`.

Its state are wrist and joint angles with their rates and accelerations. Accelerations decay, and noise drives them (Singer
1970); the strength of each axis' noise follows from how far corrections of its rate go on in one direction, so that a joint at
rest is smoothed more than one that moves. A frame's 21 points are measured with a noise that the filter estimates, too. So it
smooths as much as the points are worth, predicts where frames are missing, and uses every point for every angle.

`HandFilter.update` finds the angles of a frame; `HandFilter.finish`, when there is time, the covariances for the next one.
"""
from __future__ import annotations

import math
from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._scene import Scene

Array = NDArray[np.float64]
KEPT = 0.08
"""Time within which an acceleration decays [s]."""
ANGLE, POSITION, TURN = 2400.0, 400.0, 6000.0
"""Densities of what drives accelerations, at first [rad^2/s^5], [m^2/s^5], [rad^2/s^5]. Times KEPT^2 they are those of white
accelerations; 2.5 m^2/s^3 is that of MotionPrior of study/track."""
WEAKEST, STRONGEST = 0.05, 10.0
"""Of a density, by the first one."""
LEARNING, MEMORY, BIAS = 0.05, 0.8, 0.2
"""A frame multiplies a density by exp(LEARNING (z m - BIAS)): z is the correction of the rate by its standard deviation, m a sum of
those before it, the newest of the weight 1 and each older one of MEMORY times less."""
DELAY = 0.013
"""Of `HandFilter.late_angles` [s]."""
OUTLIER = 0.025
"""A point farther than this from its prediction, and from the noise, is left out [m]."""
LONGEST_GAP = 0.25
"""Without frames for so long [s], a hand is lost and found anew."""
STEADY, DECAY = 0.04, 0.1
"""A rate that no frame confirms for the first time [s] decays with the second one [s]."""
PALM = [5, 9, 13, 17]
"""Points of the bases of the fingers."""


def turned(by: Array, q: Array) -> Array:
    """A quaternion w x y z turned by a rotation vector in world axes."""
    angle = float(np.linalg.norm(by))
    half = 0.5 * np.sinc(angle / (2 * np.pi))
    w, v = np.cos(angle / 2), half * by
    a, b, c, d = q
    x, y, z = v
    out: Array = np.array([w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b,
                           w * d + x * c - y * b + z * a])
    out /= np.sqrt(out @ out)
    return out


class HandFilter:
    """Angles of one hand of a scene from frames of 21 points."""

    def __init__(self, scene: Scene, hand: int, fit: Optional[_core.HandFit] = None) -> None:
        """:param fit: of the tracked hand's own size, once that is known; else frames are scaled to the scene's hand"""
        self._fit = fit or _core.hand_fit(scene._core, hand)
        self._own = fit is not None
        name = scene.hands[hand]
        self.axes = [f"{name}.{axis}" for axis in self._fit.axes()]
        known = {axis: row for axis, row in zip(scene.coordinates, scene.limits)}
        stops = np.array([known.get(axis, (-np.pi, np.pi)) for axis in self.axes])
        self._low, self._high = stops[:, 0], stops[:, 1]
        size = 6 + len(self.axes)
        self._usual = np.array([POSITION] * 3 + [TURN] * 3 + [ANGLE] * len(self.axes))
        self._size = size
        self.time: Optional[float] = None
        """Of the last frame [s]; None before the first one and while the hand is lost."""
        self.pose: Array = np.zeros(7 + len(self.axes))
        """Of the wrist (x y z, quaternion w x y z) and the angles [rad]."""
        self._motion: Array = np.zeros((2, size))  # rates, accelerations
        self.noise = 2e-3
        """Standard deviation of a coordinate, as estimated [m]."""
        self.scale = 1.0
        """Size of the tracked hand by that of the scene's."""
        # Covariance of pose, rates and accelerations, and theirs (rows) with the angles of the two frames before (columns).
        self._spread: Array = np.zeros((3 * size, 3 * size))
        self._shared: Array = np.zeros((3 * size, 2 * size - 12))
        self._last: Array = np.zeros((2, size - 6))
        self._times = (0.0, 0.0)
        self._waiting: Optional[tuple[Any, ...]] = None
        model = self.points(np.concatenate((np.array([0.0, 0, 0, 1, 0, 0, 0]), np.zeros(len(self.axes)))))
        self._palm = np.linalg.norm(model[PALM] - model[0], axis=1)

    @property
    def rates(self) -> Array:
        """Of wrist and angles [m/s, rad/s]."""
        out: Array = self._motion[0]
        return out

    def points(self, pose: Array) -> Array:
        """The 21 points at a pose [m]."""
        return self._fit.points(pose)

    def update(self, points: Array, time: float) -> bool:
        """Takes a frame [m]; points that are not finite were not seen. :returns: False where too few were"""
        self.finish()
        if self.time is not None and 0 < time - self.time < LONGEST_GAP and self._follow(points, time):
            return True
        if np.isfinite(points).all(axis=1).sum() < 7:
            return False
        if self.time is None:
            self._scale(points, 1.0)
        self._find(self._sized(points), time)
        return True

    def _scale(self, points: Array, share: float) -> None:
        """Learns the size of the tracked hand, by the lengths of its palm."""
        if not self._own and np.isfinite(points[[0, *PALM]]).all():
            ratio = float(np.median(np.linalg.norm(points[PALM] - points[0], axis=1) / self._palm))
            self.scale += share * (min(2.0, max(0.5, ratio)) - self.scale)

    def _sized(self, points: Array) -> Array:
        """The points of a hand of the scene's size: scaled about the fingers' bases."""
        origin = points[5:18:4].sum(axis=0) * 0.25
        if not math.isfinite(origin.sum()):
            origin = points[np.isfinite(points).all(axis=1)].sum(axis=0) / max(1, np.isfinite(points).all(axis=1).sum())
        out: Array = points * (1 / self.scale)
        out += (1 - 1 / self.scale) * origin
        return out

    def _find(self, points: Array, time: float) -> None:
        self.pose = self._fit.find(points, OUTLIER)
        n = self._size
        self._motion, self.time = np.zeros((2, n)), time
        self._last, self._times = np.tile(self.pose[7:], (2, 1)), (time, time)
        self._spread = np.diag(np.concatenate(([1e-5] * 3, [0.01] * (n - 3), [0.1] * 3, [9.0] * (n - 3), [1.0] * 3, [300.0] * (n - 3))))
        self._shared = np.zeros((3 * n, 2 * n - 12))
        self._density, self._trend = self._usual.copy(), np.zeros(n)
        self._waiting = None

    def _follow(self, points: Array, time: float) -> bool:
        """:returns: False where the points are not near the prediction"""
        assert self.time is not None
        dt = time - self.time
        decay = math.exp(-dt / KEPT)
        F = np.array([[1, dt, KEPT * (dt - KEPT * (1 - decay))], [0, 1, KEPT * (1 - decay)], [0, 0, decay]])
        Q = np.array([[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]])
        speed = math.sqrt(sum(each * each for each in self._motion[0, :3].tolist()))
        found = self._fit.follow(self._sized(points), self.pose, self._motion, self._coefficients(dt), self._spread, self._shared, self._density,
                                 F, Q, self.noise, max(OUTLIER, 6 * self.noise) + 0.006 * speed)
        if found is None:
            return False
        before = self.pose[7:]
        self.pose, self._motion, later = found[:3]
        self._last = np.minimum(np.maximum(np.stack((before, self._last[0])) + later.reshape(2, -1), self._low), self._high)
        self._times, self.time = (self.time, self._times[0]), time
        self._waiting = (points, F, Q, *found[3:])
        return True

    def _coefficients(self, dt: float) -> Array:
        """Way, rates and accelerations after a time by rates and accelerations; rates decay, so that a gap ends at rest."""
        steady = min(dt, STEADY)
        rest = 1 - math.exp(-(dt - steady) / DECAY)
        part = KEPT * (1 - math.exp(-steady / KEPT))
        way = steady + DECAY * rest
        return np.array([[way, KEPT * (steady - part) + DECAY * rest * part], [1 - rest, (1 - rest) * part],
                         [0.0, 1 - part / KEPT if dt <= STEADY else 0.0]])

    def predicted(self, dt: float) -> Array:
        """The pose that much after the last frame [s]."""
        way = (self._coefficients(dt) @ self._motion)[0]
        pose = self.pose.copy()
        pose[:3] += way[:3]
        pose[3:7] = turned(way[3:6], pose[3:7])
        pose[7:] = np.clip(pose[7:] + way[6:], self._low, self._high)
        return pose

    def finish(self) -> None:
        """What the next frame needs of the last one: covariances, the noise, how strongly each axis is driven, the size."""
        if self._waiting is None:
            return
        points, F, Q, W, M, change, left, count = self._waiting
        self._waiting, n = None, self._size
        self._scale(points, 0.02)
        shared = np.concatenate((self._spread[:, 6:n], self._shared[:, :n - 6]), axis=1)
        shared = (F @ shared.reshape(3, -1)).reshape(shared.shape)
        half = (F @ self._spread.reshape(3, -1)).reshape(3 * n, 3 * n).T.copy()  # of a symmetric one
        P = (F @ half.reshape(3, -1)).reshape(3 * n, 3 * n)
        i = np.arange(n)
        P.reshape(3, n, 3, n)[:, i, :, i] += self._density[:, None, None] * Q
        # Small products, of two arrays each: BLAS takes threads for larger ones, and for those of an array with itself.
        columns = P[:, :n].copy()
        self._shared = shared - columns @ (M @ shared[:n])
        P -= columns @ (M @ columns.T)
        P += P.T.copy()
        P *= 0.5
        self._spread = P
        # What is left of the residuals tells the noise: the filter has used part of them.
        informed = float(np.sum(W * P[:n, :n]))
        found = float(left @ left) / max(count - informed, 0.2 * count)
        self.noise = float(np.clip(np.sqrt(self.noise**2 + 0.02 * (found - self.noise**2)), 2e-4, 0.02))
        # White corrections of a rate: its axis is driven as strongly as assumed. Corrections in a row: more strongly.
        rates = columns[n:2 * n]
        z = change / np.sqrt(np.maximum(np.sum((rates @ M) * rates, axis=1), 1e-12))
        grown = self._density * np.exp(LEARNING * np.clip(z * self._trend - BIAS, -1.0, 5.0))
        self._density = np.clip(grown, WEAKEST * self._usual, STRONGEST * self._usual)
        self._trend = MEMORY * self._trend + z
        angles, outward = self.pose[7:], self.rates[6:]
        at_stop = (angles <= self._low) & (outward < 0) | (angles >= self._high) & (outward > 0)
        self._motion[:, 6:][:, at_stop] = 0

    def late_angles(self) -> Array:
        """Angles DELAY before the last frame, as it tells them, too [rad]: with less error. Of faster trackers two frames before."""
        assert self.time is not None
        moment = max(self.time - DELAY, self._times[1])
        before, after, begin, end = (self._last[0], self.pose[7:], self._times[0], self.time) if moment >= self._times[0] else \
            (self._last[1], self._last[0], *self._times[::-1])
        share = (moment - begin) / max(end - begin, 1e-9)
        out: Array = before + min(share, 1.0) * (after - before)
        return out

    def lose(self) -> None:
        self.time = None
