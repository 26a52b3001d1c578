"""A simulation of hands whose object is carried along a recording by a force of its own: what the hands press on it there, and how hands that hold it are
driven for nothing else to carry it.

The object is carried by a spring, softer than hands are. As far as it is off its recording the hands are moved together against it, as one body, until it
comes back: then hands bear it alone. Targets of their joints are changed by what they press too little or too hard.
"""
from __future__ import annotations

from typing import Callable, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._derivatives import rotation_vector
from ._model import compose, inverse, matrices, turn_of, turned
from ._scene import Scene
from ._simulation import Simulation

Array = NDArray[np.float64]
CARRY = 40.0
"""Natural frequency of the critically damped spring that carries the object [rad/s]: 1.6 N/mm for 1 kg, about as stiff as hands hold. Chosen."""
COMES_BACK = 0.1
"""Within which hands move as far as the object is off [s]: chosen."""
FORGETS = 2.0
"""Within which such a movement is forgotten [s]: chosen."""
FURTHEST, TURNED = 0.03, 0.75
"""That hands are moved and turned together, at most, about each axis [m], [rad]."""
YIELDS, SLACKENS = 1 / 6, 10 / 3
"""Within which the target of a joint is changed by what it presses too little or too hard, and within which the change is forgotten [s]: chosen."""
LARGEST = 0.6
"""Change of a target, at most [rad]."""


class Guided(NamedTuple):
    """A hand; rows are frames."""

    wrist: Array
    """Poses of its frame."""
    targets: Array
    """Of its joints [rad]."""
    axes: NDArray[np.intp]
    """Of its joints among the scene's targets; -1: it has none."""
    coordinates: NDArray[np.intp]
    """Of its joints among the scene's coordinates."""
    segments: NDArray[np.intp]
    """Columns of its segments."""
    stiffness: Array
    """Of the joints [N m/rad]."""
    torques: Callable[[Array, Array, Array, Array], Array]
    """By angles, the wrist's pose, places and forces on the object of its segments: what they take about the joints [N m]."""


class Pressed(NamedTuple):
    """Means over the intervals between frames; rows are frames, columns segments of hands. The last row is that before."""

    force: Array
    """On the object, shape (frames, segments, 3) [N]."""
    place: Array
    """Centre of pressure, shape (frames, segments, 3) [m]."""
    outward: Array
    """Normal out of the object, shape (frames, segments, 3)."""
    touching: NDArray[np.bool_]
    help: Array
    """Force and moment about the centre of mass that carry the object beside them, shape (frames, 6) [N], [N m]."""
    q: Array
    """Of the scene's coordinates, shape (frames, coordinates)."""
    wrists: list[Array]
    """Of each hand, as it was moved, at the frames."""
    targets: list[Array]
    """Of its joints, as they were changed [rad]."""


def between(places: Array, rates: Array, part: float, span: float) -> tuple[Array, Array]:
    """Place and rate on the cubic of two places and their rates, a part of the span [s] after the first."""
    p, one = part, np.array([1 + 2 * part, part]) * (1 - part)**2
    two = np.array([3 - 2 * p, p - 1]) * p * p
    fast = np.array([6 * p * (p - 1), (1 - p) * (1 - 3 * p), 6 * p * (1 - p), p * (3 * p - 2)])
    place = one[0] * places[0] + two[0] * places[1] + span * (one[1] * rates[0] + two[1] * rates[1])
    return place, (fast[0] * places[0] + fast[2] * places[1]) / span + fast[1] * rates[0] + fast[3] * rates[1]


def carried(scene: Scene, name: str, segments: Sequence[str], times: Array, poses: Array, hands: Sequence[Guided] = (),
            wanted: Optional[Callable[[int, Array, Array, NDArray[np.bool_]], tuple[Array, Array]]] = None, before: int = 0) -> Pressed:
    """:param times: from 0 on [s]
    :param poses: of the object's own frame at these times; the first is where the scene has it
    :param hands: every hand of the scene, in its order, to be driven so that nothing else carries the object; none: as the scene drives them
    :param wanted: by frame, places, outward normals and segments that touch: the forces on the object by segment that hands should give, and where they act
    :param before: frames at rest before the first, in which hands come to bear it
    """
    simulation = Simulation(scene)
    model = scene._model
    body = next(i for i, each in enumerate(model.bodies) if each.name == name)
    mass, inertia, zero = model.bodies[body].mass, model.bodies[body].inertia, model.bodies[body].zero
    owner = {shape.name: model.bodies[shape.body].name for shape in model.shapes}
    column = {segment: i for i, segment in enumerate(segments)}
    count, n, dt, start = len(times), len(segments), scene.step, 0.0
    goals = compose(poses, np.broadcast_to(compose(inverse(poses[0]), zero), (count, 7)))
    force, place, outward = (np.zeros((count, n, 3)) for _ in range(3))
    pressing, help, q = np.zeros((count, n)), np.zeros((count, 6)), np.zeros((count, len(simulation.q)))
    rates = np.gradient(goals[:, :3], times, axis=0)
    own = [alike(compose(inverse(goals), hand.wrist)) for hand in hands]
    # In the object's frame: how the hands are moved together, and turned.
    moved, together = np.zeros(6), np.array([0.0, 0, 0, 1, 0, 0, 0])
    most = np.repeat([FURTHEST, TURNED], 3)
    changes = [np.zeros(hand.targets.shape[1]) for hand in hands]
    wrists, targets = [hand.wrist.copy() for hand in hands], [hand.targets.copy() for hand in hands]
    for frame in range(-before, count - 1):
        row = max(frame, 0)
        if frame == 0:
            start = simulation.time
        span = float(times[row + 1] - times[row])
        steps = max(1, int(round((span if frame < 0 else float(times[row + 1]) - simulation.time + start) / dt)))
        turn = goals[row + 1, 3:] * np.sign(goals[row, 3:] @ goals[row + 1, 3:])
        turning = rotation_vector(turn, goals[row, 3:]) / span
        for values in (force, place, outward, pressing, help, q):
            values[row] = 0
        for wrist, seen in zip(wrists, own):
            wrist[row] = compose(goals[row], compose(together, seen[row]))
        for _ in range(steps):
            now = simulation.bodies
            part = 0.0 if frame < 0 else min((simulation.time - start + dt - float(times[row])) / span, 1.0)
            goal, velocity = between(goals[row:row + 2, :3], rates[row:row + 2], part, span)
            attitude = (1 - part) * goals[row, 3:] + part * turn
            attitude *= np.sign(attitude @ now.quaternion[body]) / np.linalg.norm(attitude)
            off = rotation_vector(attitude, now.quaternion[body])
            axes = matrices(np.concatenate([np.zeros(3), now.quaternion[body]]))[:3, :3]
            moves = 0.0 if frame < 0 else 1.0
            push = CARRY**2 * (goal - now.position[body]) + 2 * CARRY * (moves * velocity - now.velocity[body])
            twist = CARRY**2 * off + 2 * CARRY * (moves * turning - now.angular_velocity[body])
            wrench = np.concatenate([mass * push, axes @ inertia @ axes.T @ twist])
            pose = np.concatenate([goal, attitude])
            aims = np.zeros(len(scene.axes))
            for hand, change in zip(hands, changes):
                driven = hand.axes >= 0
                aims[hand.axes[driven]] = ((1 - part) * hand.targets[row] + part * hand.targets[row + 1] + change)[driven]
            at = np.array([compose(pose, compose(together, _mixed(seen[row], seen[row + 1], part))) for seen in own])
            simulation.step(forces={name: wrench}, wrists=at if hands else None, targets=aims if hands else None)
            help[row] += wrench / steps
            q[row] += simulation.q / steps
            contacts = simulation.contacts
            for a, b, where, normal, each in zip(contacts.a, contacts.b, contacts.position, contacts.normal, contacts.force):
                first = owner.get(a) == name
                i = column.get(owner.get(b if first else a, ""))
                if i is None or (not first and owner.get(b) != name):
                    continue
                weight = max(abs(float(each @ normal)), 1e-9)
                force[row, i] += (each if first else -each) / steps
                place[row, i] += weight * where
                outward[row, i] += weight * (-normal if first else normal)
                pressing[row, i] += weight
            back = pose[3:] * [1, -1, -1, -1]
            moved = moved * (1 - dt / FORGETS) + dt / COMES_BACK * np.concatenate([turned(back, goal - now.position[body]), turned(back, off)])
            moved = np.clip(moved, -most, most)
            together = np.concatenate([moved[:3], turn_of(moved[3:])])
        on = pressing[row] > 0
        place[row, on] /= pressing[row, on][:, None]
        outward[row, on] /= np.maximum(np.linalg.norm(outward[row, on], axis=1, keepdims=True), 1e-12)
        if wanted is not None:
            asked, where_ = wanted(row, place[row], outward[row], on)
            for k, hand in enumerate(hands):
                s = hand.segments
                spots = np.where(on[s][:, None], place[row, s], where_[s])
                less = hand.torques(q[row, hand.coordinates], at[k], spots, asked[s] - force[row, s])
                changes[k] = np.clip((1 - span / SLACKENS) * changes[k] + span / YIELDS * less / hand.stiffness, -LARGEST, LARGEST)
        for k, hand in enumerate(hands):
            targets[k][row] = hand.targets[row] + changes[k]
    for values in (force, place, outward, pressing, help, q):
        values[-1] = values[-2]
    for k, hand in enumerate(hands):
        wrists[k][-1] = compose(goals[-1], compose(together, own[k][-1]))
        targets[k][-1] = hand.targets[-1] + changes[k]
    return Pressed(force, place, outward, pressing > 0, help, q, wrists, targets)


def alike(poses: Array) -> Array:
    """With quaternions each of the sign of the one before."""
    out = poses.copy()
    out[1:, 3:] *= np.cumprod(np.where((poses[1:, 3:] * poses[:-1, 3:]).sum(axis=1) < 0, -1.0, 1.0))[:, None]
    return out


def _mixed(a: Array, b: Array, part: float) -> Array:
    """Between two poses that are near each other."""
    out = (1 - part) * a + part * b
    out[3:] /= np.linalg.norm(out[3:])
    return out
