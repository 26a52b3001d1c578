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
ANGLE, POSITION, TURN = 14.0, 2.5, 40.0
"""Densities of accelerations [rad^2/s^3], [m^2/s^3], [rad^2/s^3]; those of MotionPrior of study/track, with a third of its 40 for
angles, which a filter without the future has its least error with."""
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


def _quaternion(turn: Array) -> Array:
    """w x y z of a rotation matrix: the eigenvector of its largest eigenvalue (Bar-Itzhack 2000)."""
    (a, b, c), (d, e, f), (g, h, i) = turn
    K = np.array([[a + e + i, h - f, c - g, d - b], [h - f, a - e - i, b + d, c + g], [c - g, b + d, e - a - i, f + h],
                  [d - b, c + g, f + h, i - a - e]]) / 3
    out: Array = np.linalg.eigh(K)[1][:, -1]
    return out


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
        # Covariance of pose, rates, and the angles of the frame before.
        self._spread: Array = np.zeros((3 * size - 6, 3 * size - 6))
        self._last: Array = np.zeros(size - 6)
        model = self._points(np.zeros(len(self.axes)))
        self._palm = np.linalg.norm(model[PALM] - model[0], axis=1)

    def _points(self, angles: Array) -> Array:
        """The 21 points of the scene's hand at the origin."""
        pose = np.concatenate((np.array([0.0, 0, 0, 1, 0, 0, 0]), angles))
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
            ratio = float(np.median(np.linalg.norm(points[PALM] - points[0], axis=1) / self._palm))
            ratio = min(2.0, max(0.5, ratio))
            self.scale += (1.0 if self.time is None else 0.02) * (ratio - self.scale)
        palm = points[PALM]
        origin = np.mean(palm, axis=0) if np.isfinite(palm).all() else np.nanmean(points, axis=0)
        out: Array = origin + (points - origin) / self.scale
        return out

    def _find(self, points: Array, time: float) -> None:
        points = points.copy()
        for _ in range(5):
            self.pose = self._start(points)
            distance = np.linalg.norm(self._fit.rows(points, self.pose)[0].reshape(21, 3), axis=1)
            if distance.max() <= OUTLIER or np.isfinite(points).all(axis=1).sum() < 8:
                break
            points[np.argmax(distance)] = np.nan
        self.rates, self.time = np.zeros(self._size), time
        n = self._size
        self._last = self.pose[7:].copy()
        self._spread[:] = np.diag(np.concatenate(([1e-5] * 3, [0.01] * (n - 3), [0.1] * 3, [9.0] * (n - 3), [0.01] * (n - 6))))

    def _start(self, points: Array) -> Array:
        """The pose of a frame without a past: the palm's points place the hand (Kabsch 1976), Levenberg-Marquardt steps bend it."""
        seen = np.isfinite(points).all(axis=1)
        best, least = np.zeros(0), np.inf
        for flexion in (0.35, 0.9):
            angles = np.clip([flexion if axis.endswith("flexion") else 0.0 for axis in self.axes], self._low, self._high)
            model = self._points(angles)
            rows = [i for i in (0, *PALM) if seen[i]]
            rows = rows if len(rows) > 2 else list(np.flatnonzero(seen))
            a, b = model[rows] - model[rows].mean(axis=0), points[rows] - points[rows].mean(axis=0)
            u, _, v = np.linalg.svd(a.T @ b)
            turn = v.T @ np.diag([1, 1, np.sign(np.linalg.det(v.T @ u.T))]) @ u.T
            place = points[rows].mean(axis=0) - turn @ model[rows].mean(axis=0)
            pose = np.concatenate((place, _quaternion(turn), angles))
            damping = 1e-4
            r, J = self._fit.rows(points, pose)
            for _ in range(25):
                step = np.linalg.solve(J.T @ J + damping * np.eye(self._size), -J.T @ r)
                trial = pose.copy()
                trial[:3] += step[:3]
                trial[3:7] = turned(step[3:6], pose[3:7])
                trial[7:] = np.clip(pose[7:] + step[6:], self._low, self._high)
                r_trial, J_trial = self._fit.rows(points, trial)
                better = r_trial @ r_trial < r @ r
                damping = max(1e-9, damping * (0.3 if better else 5))
                if better:
                    pose, r, J = trial, r_trial, J_trial
            if r @ r < least:
                best, least = pose, float(r @ r)
        return best

    def _predict(self, dt: float) -> None:
        n, P = self._size, self._spread
        self._last = self.pose[7:].copy()
        P[2 * n:] = P[6:n]
        P[:, 2 * n:] = P[:, 6:n]
        self.pose = self.predicted(dt)
        P[:n] += dt * P[n:2 * n]
        P[:, :n] += dt * P[:, n:2 * n]
        i, density = np.arange(n), self._density
        P[i, i] += density * dt**3 / 3
        P[i, n + i] += density * dt**2 / 2
        P[n + i, i] += density * dt**2 / 2
        P[n + i, n + i] += density * dt
        if dt > STEADY:
            self.rates = self.rates * np.exp(-(dt - STEADY) / DECAY)

    def predicted(self, dt: float) -> Array:
        """The pose that much after the last frame [s]; rates decay, so that a gap ends at rest."""
        ahead = dt if dt <= STEADY else STEADY + DECAY * (1 - float(np.exp(-(dt - STEADY) / DECAY)))
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
        # Small products, of two arrays each: BLAS takes threads for larger ones, and for those of an array with itself.
        P = self._spread
        turned_J = J.T.copy() / self.noise**2
        W = turned_J @ J
        gain = np.linalg.solve(np.eye(n) + P[:n, :n] @ W, P[:n]).T  # P (1 + W P)^-1, rows of all, columns of the pose
        change = gain @ (turned_J @ -r)
        P -= gain @ (W @ P[:n])
        P += P.T
        P *= 0.5
        informed = float(np.sum(W * P[:n, :n]))
        self.pose = self.pose.copy()
        self.pose[:3] += change[:3]
        self.pose[3:7] = turned(change[3:6], self.pose[3:7])
        angles = self.pose[7:] + change[6:n]
        self.pose[7:] = np.clip(angles, self._low, self._high)
        self._last = np.clip(self._last + change[2 * n:], self._low, self._high)
        self.rates = self.rates + change[n:2 * n]
        at_stop = (angles < self._low) & (self.rates[6:] < 0) | (angles > self._high) & (self.rates[6:] > 0)
        self.rates[6:][at_stop] = 0
        # What is left of the residuals tells the noise: the filter has used part of them.
        left = r + J @ change[:n]
        found = float(left @ left) / max(len(r) - informed, 0.2 * len(r))
        self.noise = float(np.clip(np.sqrt(self.noise**2 + 0.02 * (found - self.noise**2)), 2e-4, 0.02))
        return True

    def late_angles(self) -> Array:
        """Angles at the frame before the last one, as the last one tells them, too [rad]: with less error, a frame later."""
        return self._last

    def lose(self) -> None:
        self.time = None
