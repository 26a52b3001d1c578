"""Forces between recorded hands and a recorded object: docs/forces.md.

The object's motion and weight ask for a wrench in each frame (`_forces_object`). Places of the hands that touch (`_forces_frames`) share it (`_sharing`).
Motion does not show how hard opposite fingers squeeze: that is taken from how people hold things, and its band from how much they differ.
"""
from __future__ import annotations

import math
import warnings
from typing import Any, Callable, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._forces_frames import Asked, Frame, Solver, smooth_rows, start_of, steady_of
from ._forces_hands import Body, efforts_of, heaviest_of, torques_of
from ._object_motion import Motion
from ._sharing import Places, Shared, share

Array = NDArray[np.float64]
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
SHORT = 0.1
"""Share of the weight: a frame with a larger residual has too little contact."""
WINDOW = 0.1
"""Over which forces are steady [s]."""
STATES = ("unseen", "apart", "supported", "held", "short")
LOW, HIGH = 0.05, 0.95
"""Of the bands."""


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

    def rows(self, rows: Any) -> "Result":
        """Of some frames: a slice, or their indices."""
        motion = self.motion._replace(**{name: getattr(self.motion, name)[rows] for name in ("poses", "velocity", "turning", "acceleration", "turning_up")})
        return self._replace(motion=motion, **{name: value[rows] for name, value in self._asdict().items() if isinstance(value, np.ndarray) and name != "unsure"})

    @property
    def lifted(self) -> NDArray[np.bool_]:
        return (self.load >= 1) & (self.state > 0)

    @property
    def share(self) -> Array:
        """Residual force over the weight, or its moment over that of the weight at 5 cm, whichever is more."""
        weight = self.mass * 9.80665
        out: Array = np.maximum(np.linalg.norm(self.residual[:, :3], axis=1) / weight, np.linalg.norm(self.residual[:, 3:], axis=1) / (0.05 * weight))
        return out


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
    frames: list[Optional[Frame]] = []
    bodies: list[list[Optional[Body]]] = []
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

        def one(frame: Frame, place: int, own: Places, wrench: Array, mu: float, steady: Optional[Array], start: Optional[Any]) -> Shared:
            muscles = of.muscles(bodies[place], frame.jacobians) if asked.muscles else None
            total = float(np.linalg.norm(wrench[:3])) / mu
            return share(own, wrench, of.of.centre[frame.row], of.weight, mu, SPIN * mu, total, steady, muscles, start, of.lapack)

        def drawn(mu: float, change: Callable[[Frame], tuple[Places, Array]]) -> list[Optional[Shared]]:
            """Every frame for itself, from the set of the likeliest solution: what is drawn is smoothed together."""
            return [None if frame is None or first_ is None else one(frame, i, *change(frame), mu, None, first_.active)
                    for i, (frame, first_) in enumerate(zip(frames, rough))]

        rough: list[Optional[Shared]] = []
        last_: tuple[Optional[Frame], Optional[Shared]] = None, None
        for i, frame in enumerate(frames):
            rough.append(None if frame is None else one(frame, i, frame.places, frame.wrench, friction, None, start_of(frame, *last_)))
            last_ = frame, rough[-1]
        steady = steady_of(frames, rough, width)
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
            pressing[row] = frame.pressing(shared)
            torque[row] = torques_of(hands, bodies[i], pressing[row])
            effort[row] = efforts_of(hands, bodies[i], torque[row])
            heaviest[row] = of.thing.mass * heaviest_of(hands, bodies[i], torque[row], pressing[row])
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


def _drawn(of: Solver, frames: Sequence[Optional[Frame]], draws: Sequence[Draw], solved: Any,
           bodies: Sequence[Sequence[Optional[Body]]]) -> tuple[Array, Array, Array]:
    """Normal forces of fingers, torques and activations of each draw, shape (draws, frames, ...)."""
    fingers = np.full((len(draws), len(frames), len(of.fingers)), np.nan)
    torques = np.full((len(draws), len(frames), int(of.hands.starts[-1])), np.nan)
    activations = np.full((len(draws), len(frames), int(of.hands.pulls[-1]) if of.asked.muscles else 0), np.nan)
    for d, draw in enumerate(draws):
        def change(frame: Frame) -> tuple[Places, Array]:
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
            torques[d, i] = torques_of(of.hands, bodies[i], frame.pressing(shared))
            if of.asked.muscles:
                activations[d, i] = np.minimum(shared.activation, 1)
    return fingers, torques, activations
