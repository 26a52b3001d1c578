"""Tracked hands beside an object: their dynamics without contacts, and what torques take of their strength (docs/forces.md)."""
from __future__ import annotations

import math
from typing import NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._forces_object import GRAVITY
from ._hand import Hand
from ._model import turned
from ._touch import HandShapes

Array = NDArray[np.float64]


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


class Body(NamedTuple):
    """What a hand needs without contacts, and has."""

    needed: Array
    passive: Array
    active: Array
    """Torques of full activations, shape (coordinates, muscles)."""


def lowpass(values: Array, interval: float) -> Array:
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


class Hands:
    """The hands' dynamics, without contacts."""

    def __init__(self, hands: Sequence[HandMotion], interval: float) -> None:
        self.hands, self.interval = hands, interval
        self.shapes = [HandShapes(each.hand) for each in hands]
        self.smooth = [lowpass(each.q, interval) for each in hands]
        self.rates = [np.gradient(q, interval, axis=0) if len(q) > 1 else np.zeros_like(q) for q in self.smooth]
        self.accelerations = [np.gradient(u, interval, axis=0) if len(u) > 1 else np.zeros_like(u) for u in self.rates]
        self.wrists = [np.gradient(np.gradient(lowpass(each.wrist[:, :3], interval), interval, axis=0), interval, axis=0) if len(each.wrist) > 1
                       else np.zeros((len(each.wrist), 3)) for each in hands]
        joints = [each.hand.joints for each in hands]
        self.stiffness = [np.asarray(each["stiffness"]) for each in joints]
        self.rest = [np.asarray(each["rest"]) for each in joints]
        self.axes = [f"{each.name}.{name}" for each in hands for name in each.hand.coordinates]
        self.muscles = [f"{each.name}.{name}" for each in hands for name in each.hand.muscles]
        self.starts = np.cumsum([0, *(len(each.hand.coordinates) for each in hands)])
        self.pulls = np.cumsum([0, *(len(each.hand.muscles) for each in hands)])
        self.tracked = [np.isfinite(each.q).all(axis=1) for each in hands]

    def body(self, k: int, row: int) -> Body:
        hand = self.hands[k]
        core, q = hand.hand.scene._core, hand.q[row]
        gravity = GRAVITY - np.nan_to_num(self.wrists[k][row])
        back = hand.wrist[row, 3:] * [1, -1, -1, -1]
        torque = _core.hand_inverse_dynamics(core, q, np.nan_to_num(self.rates[k][row]), np.nan_to_num(self.accelerations[k][row]), turned(back, gravity))
        passive = self.stiffness[k] * (self.rest[k] - q)
        if not hand.hand.muscles:
            return Body(torque, passive, np.zeros((len(q), 0)))
        arms, _, active, rest, bands = _core.hand_muscles(core, q)
        return Body(torque, passive + rest @ arms + bands, arms.T * active)


def torques_of(hands: Hands, bodies: Sequence[Optional[Body]], pressing: Array) -> Array:
    """About joint axes [N m]: of the motion, and of the forces on the object, which press back."""
    out = np.full(int(hands.starts[-1]), np.nan)
    for k, body in enumerate(bodies):
        if body is not None:
            rows = slice(int(hands.starts[k]), int(hands.starts[k + 1]))
            out[rows] = body.needed + pressing[rows]
    return out


def _strength(body: Body, hand: Hand, along: Array) -> tuple[Array, NDArray[np.bool_]]:
    """What all muscles about an axis give, the way that a torque acts, and the axes that count: not those of the wrist."""
    strength = np.where(along > 0, np.maximum(body.active, 0).sum(axis=1), np.maximum(-body.active, 0).sum(axis=1))
    return strength, np.array([not name.startswith("wrist") for name in hand.coordinates]) & (strength > 1e-3)


def efforts_of(hands: Hands, bodies: Sequence[Optional[Body]], torque: Array) -> Array:
    """Largest share of what all muscles about an axis give that its torque takes, by hand."""
    out = np.full(len(bodies), np.nan)
    for k, body in enumerate(bodies):
        if body is None or not body.active.shape[1]:
            continue
        active = torque[int(hands.starts[k]):int(hands.starts[k + 1])] - body.passive
        strength, counts = _strength(body, hands.hands[k].hand, active)
        out[k] = float((np.abs(active) / np.maximum(strength, 1e-3))[counts].max(initial=0))
    return out


def heaviest_of(hands: Hands, bodies: Sequence[Optional[Body]], torque: Array, pressing: Array) -> float:
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
