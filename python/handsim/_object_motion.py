"""The motion of a recorded object: the likeliest one, its velocity and acceleration, and how sure the acceleration is.

Jerks are white noise. With third differences D of n frames the likeliest x of measured y has (1 + k D'D) x = y, where k is the variance of a
measurement over that of a third difference; k is the one under which D y is likeliest, with the scale of both.
"""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._errors import input_error
from ._model import product

Array = NDArray[np.float64]
THIRD = np.array([-1.0, 3.0, -3.0, 1.0])
RATIOS = np.logspace(-1, 8, 37)
"""Of the variances, that are tried."""
LONGEST = 4000
"""Frames in which the ratio is looked for."""


class Motion(NamedTuple):
    """Of a frame in the world; rows are frames."""

    poses: Array
    """x y z [m] and quaternion w x y z."""
    velocity: Array
    """Of the frame's origin [m/s]."""
    turning: Array
    """Angular velocity, world axes [rad/s]."""
    acceleration: Array
    """[m/s2]"""
    turning_up: Array
    """Angular acceleration [rad/s2]."""
    noise: tuple[float, float]
    """Standard deviation of a measured coordinate [m], and of an angle [rad]."""
    unsure: tuple[float, float]
    """Of acceleration [m/s2] and angular acceleration [rad/s2], a component."""


def _linalg() -> Any:
    try:
        from scipy import linalg
    except ImportError:
        raise input_error("SciPy", "no Python module of this name", "it, for forces on objects: pip install scipy") from None
    return linalg


def _third(count: int, weights: Array, ratio: float) -> Array:
    """Upper bands of the matrix with the weights on its diagonal and ratio D'D."""
    bands = np.zeros((4, count))
    for row in range(4):
        for k in range(4 - row):
            product_ = ratio * THIRD[k] * THIRD[k + row]
            bands[3 - row, row + k:row + k + count - 3] += product_
    bands[3] += weights
    return bands


def _likeliest(values: Array) -> tuple[float, float]:
    """The ratio, and the variance of a measurement."""
    linalg = _linalg()
    moved = np.diff(values[:LONGEST], 3, axis=0)
    count = len(moved)
    if count < 8:
        return 1.0, float(np.var(values - values.mean(axis=0)) + 1e-18)
    auto = [float(THIRD[:4 - lag] @ THIRD[lag:]) for lag in range(4)]
    best = (-np.inf, 1.0, 1e-18)
    for ratio in RATIOS:
        bands = np.zeros((4, count))
        for lag in range(4):
            bands[3 - lag, lag:] = auto[lag]
        bands[3] += 1 / ratio
        factor = linalg.cholesky_banded(bands)
        spread = float((moved * linalg.cho_solve_banded((factor, False), moved)).sum()) / moved.size
        told = -0.5 * count * moved.shape[1] * np.log(max(spread, 1e-30)) - moved.shape[1] * float(np.log(factor[3]).sum())
        if told > best[0]:
            best = told, float(ratio), spread
    return best[1], best[2]


def smooth_columns(values: Array, seen: NDArray[np.bool_]) -> tuple[Array, float, float]:
    """Smoothed columns, the standard deviation of a measurement, and that of the second difference of the smoothed ones."""
    linalg = _linalg()
    count = len(values)
    filled = np.stack([np.interp(np.arange(count), np.flatnonzero(seen), column[seen]) for column in values.T], axis=1)
    ratio, variance = _likeliest(filled)
    if count < 8:
        return filled, float(np.sqrt(variance)), float(np.sqrt(6 * variance))
    bands = _third(count, seen.astype(float), ratio)
    smooth = linalg.solveh_banded(bands, filled * seen[:, None])
    length = min(count, 401)
    second = np.zeros(length)
    second[length // 2 - 1:length // 2 + 2] = 1, -2, 1
    middle = linalg.solveh_banded(_third(length, np.ones(length), ratio), second)
    return smooth, float(np.sqrt(variance)), float(np.sqrt(max(variance * (second @ middle), 0)))


def _second(values: Array, interval: float) -> Array:
    out = np.zeros_like(values)
    out[1:-1] = (values[2:] - 2 * values[1:-1] + values[:-2]) / interval**2
    out[0], out[-1] = out[1], out[-2]
    return out


def smoothed(times: Array, poses: Array) -> Motion:
    """:param poses: x y z [m] and quaternion, shape (frames, 7); NaN where it was not seen. Frames are equally far apart"""
    seen = np.isfinite(poses).all(axis=1)
    interval = float(np.median(np.diff(times)))
    place, noise, unsure = smooth_columns(poses[:, :3], seen)
    turns = poses[:, 3:].copy()
    rows = np.flatnonzero(seen)
    signs = np.cumprod(np.where((turns[rows][1:] * turns[rows][:-1]).sum(axis=1) < 0, -1.0, 1.0))
    turns[rows[1:]] *= signs[:, None]
    turn, turn_noise, turn_unsure = smooth_columns(turns, seen)
    turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    back = turn * [1, -1, -1, -1]
    return Motion(np.concatenate([place, turn], axis=1), np.gradient(place, interval, axis=0),
                  2 * product(np.gradient(turn, interval, axis=0), back)[:, 1:], _second(place, interval),
                  2 * product(_second(turn, interval), back)[:, 1:], (noise, 2 * turn_noise), (unsure / interval**2, 2 * turn_unsure / interval**2))
