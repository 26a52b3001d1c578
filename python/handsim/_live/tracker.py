"""Joint angles of a tracked hand, frame by frame: a Kalman filter over the inverse kinematics of `handsim track`.

Its state are wrist, joint angles and their rates; accelerations are white noise of the densities that `handsim track` has, and
a frame's 21 points are measured with a noise that the filter estimates. So it smooths as much as the points are worth, predicts
where frames are missing, and uses every point for every angle.
"""
from __future__ import annotations

from typing import Optional

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._scene import Scene

Array = NDArray[np.float64]
ANGLE, POSITION, TURN = 20.0, 2.5, 40.0
"""Densities of accelerations [rad^2/s^3], [m^2/s^3], [rad^2/s^3]; those of MotionPrior of study/track, with half of its 40 for
angles, which a filter without the future has its least error with."""
OUTLIER = 0.025
"""A point farther than this from its prediction, and from the noise, is left out [m]."""
LONGEST_GAP = 0.25
"""Without frames for so long [s], a hand is lost and found anew."""
DECAY = 0.1
"""A rate that no frame confirms decays with this time [s]."""
PALM = [5, 9, 13, 17]
"""Points of the bases of the fingers."""


def turned(by: Array, q: Array) -> Array:
    """A quaternion w x y z turned by a rotation vector in world axes."""
    angle = float(np.linalg.norm(by))
    half = 0.5 * np.sinc(angle / (2 * np.pi))
    w, v = np.cos(angle / 2), half * by
    out = np.array([w * q[0] - v @ q[1:], *(w * q[1:] + q[0] * v + np.cross(v, q[1:]))])
    return out / np.linalg.norm(out)


class HandFilter:
    """Angles of one hand of a scene from frames of 21 points."""

    def __init__(self, scene: Scene, hand: int) -> None:
        self._fit = _core.hand_fit(scene._core, hand)
        name = scene.hands[hand]
        self.axes = [f"{name}.{axis}" for axis in self._fit.axes()]
        known = {axis: row for axis, row in zip(scene.coordinates, scene.limits)}
        stops = np.array([known.get(axis, (-np.pi, np.pi)) for axis in self.axes])
        self._low, self._high = stops[:, 0], stops[:, 1]
        size = 6 + len(self.axes)
        self._density = np.array([POSITION] * 3 + [TURN] * 3 + [ANGLE] * len(self.axes))
        self._size = size
        self.time: Optional[float] = None
        """Of the last frame [s]; None before the first one and while the hand is lost."""
        self.pose: Array = np.zeros(7 + len(self.axes))
        """Of the wrist (x y z, quaternion w x y z) and the angles [rad]."""
        self.rates: Array = np.zeros(size)
        self.noise = 2e-3
        """Standard deviation of a coordinate, as estimated [m]."""
        self.scale = 1.0
        """Size of the tracked hand by that of the scene's."""
        self._spread: Array = np.zeros((2 * size, 2 * size))
        model = self._points(np.zeros(len(self.axes)))
        self._palm = np.linalg.norm(model[PALM] - model[0], axis=1)

    def _points(self, angles: Array) -> Array:
        """The 21 points of the scene's hand at the origin."""
        pose = np.concatenate(([0, 0, 0, 1, 0, 0, 0], angles))
        return self._fit.rows(np.zeros((21, 3)), pose)[0].reshape(21, 3)

    def points(self, pose: Array) -> Array:
        """The 21 points at a pose [m]."""
        return self._fit.rows(np.zeros((21, 3)), pose)[0].reshape(21, 3)

    def update(self, points: Array, time: float) -> bool:
        """Takes a frame [m]; points that are not finite were not seen. :returns: False where too few were"""
        seen = np.isfinite(points).all(axis=1)
        if seen.sum() < 7:
            return False
        points = self._sized(points)
        if self.time is None or not 0 < time - self.time < LONGEST_GAP:
            self._find(points, time)
            return True
        self._predict(time - self.time)
        self.time = time
        if not self._correct(points, seen):
            self._find(points, time)
        return True

    def _sized(self, points: Array) -> Array:
        """The points of a hand of the scene's size: scaled about the fingers' bases by the lengths of the palm."""
        if np.isfinite(points[[0, *PALM]]).all():
            ratio = float(np.mean(np.linalg.norm(points[PALM] - points[0], axis=1) / self._palm))
            ratio = min(2.0, max(0.5, ratio))
            self.scale += (1.0 if self.time is None else 0.02) * (ratio - self.scale)
        palm = points[PALM]
        origin = np.mean(palm, axis=0) if np.isfinite(palm).all() else np.nanmean(points, axis=0)
        out: Array = origin + (points - origin) / self.scale
        return out

    def _find(self, points: Array, time: float) -> None:
        self._before = None
        self.pose, self.rates, self.time = self._fit.find(points).copy(), np.zeros(self._size), time
        size = self._size
        self._spread = np.diag(np.concatenate(([1e-5] * 3, [0.01] * (size - 3), [0.1] * 3, [9.0] * (size - 3))))

    def _predict(self, dt: float) -> None:
        n = self._size
        self._before = (self.pose, np.concatenate((np.zeros(n), self.rates)), self._spread.copy(), dt)
        self.pose = self.predicted(dt)
        n, P = self._size, self._spread
        keep = float(np.exp(-dt / DECAY)) if dt > 0.04 else 1.0  # of the rates over a gap
        P[:n, :n] += dt * (P[:n, n:] + P[n:, :n]) + dt**2 * P[n:, n:]
        P[:n, n:] += dt * P[n:, n:]
        P[n:, :n] = P[:n, n:].T
        i = np.arange(n)
        P[i, i] += self._density * dt**3 / 3
        P[i, n + i] += self._density * dt**2 / 2
        P[n + i, i] += self._density * dt**2 / 2
        P[n + i, n + i] += self._density * dt
        self.rates = keep * self.rates
        self._ahead, self._predicted_spread = (self.pose, self.rates), P.copy()

    def predicted(self, dt: float) -> Array:
        """The pose that much after the last frame [s]; rates decay, so that a gap ends at rest."""
        ahead = dt if dt <= 0.04 else 0.04 + DECAY * (1 - float(np.exp(-(dt - 0.04) / DECAY)))
        pose = self.pose.copy()
        pose[:3] += ahead * self.rates[:3]
        pose[3:7] = turned(ahead * self.rates[3:6], pose[3:7])
        pose[7:] = np.clip(pose[7:] + ahead * self.rates[6:], self._low, self._high)
        return pose

    def _correct(self, points: Array, seen: NDArray[np.bool_]) -> bool:
        """:returns: False where the points are not near the prediction"""
        n = self._size
        r, J = self._fit.rows(points, self.pose)
        distance = np.linalg.norm(r.reshape(21, 3), axis=1)
        near = seen & (distance < max(OUTLIER, 6 * self.noise) + 0.3 * np.linalg.norm(self.rates[:3]) * 0.02)
        if near.sum() < max(7, 0.6 * seen.sum()):
            return False
        use = np.repeat(near, 3)
        r, J = r[use], J[use]
        self.pose = self.pose.copy()
        P = self._spread
        W = J.T @ J / self.noise**2
        gain = np.linalg.solve(np.eye(n) + P[:n, :n] @ W, P[:n]).T  # P[:, :n] (1 + W P_nn)^-1
        change = -gain @ (J.T @ r) / self.noise**2
        P -= gain @ W @ P[:n]
        self._spread = 0.5 * (P + P.T)
        self.pose[:3] += change[:3]
        self.pose[3:7] = turned(change[3:6], self.pose[3:7])
        angles = self.pose[7:] + change[6:n]
        self.pose[7:] = np.clip(angles, self._low, self._high)
        self.rates = self.rates + change[n:]
        at_stop = (angles < self._low) & (self.rates[6:] < 0) | (angles > self._high) & (self.rates[6:] > 0)
        self.rates[6:][at_stop] = 0
        # What is left of the residuals tells the noise: the filter has used part of them.
        left = r + J @ change[:n]
        share = 1 - float(np.trace(W @ self._spread[:n, :n])) / len(r)
        found = float(left @ left) / len(r) / max(0.2, share)
        self.noise = float(np.clip(np.sqrt(self.noise**2 + 0.02 * (found - self.noise**2)), 2e-4, 0.02))
        return True

    def late_angles(self) -> Array:
        """Angles at the frame before the last one, as both frames tell them (Rauch, Tung and Striebel 1965) [rad]."""
        if self._before is None:
            return self.pose[7:].copy()
        pose, _, spread, dt = self._before
        n = self._size
        ahead = np.concatenate((spread[:, :n] + dt * spread[:, n:], spread[:, n:]), axis=1)
        predicted, rates = self._ahead
        change = np.concatenate((self.pose[7:] - predicted[7:], self.rates[6:] - rates[6:]))
        rows = np.concatenate((np.arange(6, n), np.arange(n + 6, 2 * n)))
        gain = np.linalg.solve(self._predicted_spread[np.ix_(rows, rows)], change)
        out: Array = np.clip(pose[7:] + ahead[6:n][:, rows] @ gain, self._low, self._high)
        return out

    def lose(self) -> None:
        self.time = None
