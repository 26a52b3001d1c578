"""A simulation of hands whose object is carried along a recording by a force of its own: what the hands press on it there, and how hands that hold it are
driven for nothing else to carry it.

A spring carries the object, stiff at first, then softer than hands are. As far as the object is off its recording the hands are moved together against it, as
one body, until it comes back: then the hands bear it alone. Targets of their joints are changed by what they press too little or too hard. What is
returned is how the hands move seen from the object, so that a free object in the place that was recorded meets the same pads at the same depths.
"""
from __future__ import annotations

from typing import Any, Callable, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._derivatives import rotation_vector
from ._model import compose, inverse, matrices, turn_of, turned
from ._scene import Scene
from ._simulation import Simulation

Array = NDArray[np.float64]
TAKES, CARRY = 100.0, 20.0
"""Natural frequency of the critically damped spring that carries the object [rad/s], where the rest before the recording begins and from SOFT of it on: 10 and
0.4 N/mm for 1 kg, of which the second is less than hands have. Chosen."""
SOFT = 0.6
"""Share of the rest in which the spring becomes soft: chosen."""
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
    start: Array
    """Of them, at the first frame."""
    wrists: list[Array]
    """Of each hand, as it was moved, seen from the object, for the object in its recorded places."""
    targets: list[Array]
    """Of its joints, as they were changed [rad]."""


def between(places: Array, rates: Array, part: float, span: float) -> tuple[Array, Array]:
    """Place and rate on the cubic of two places and their rates, a part of the span [s] after the first."""
    p, one = part, np.array([1 + 2 * part, part]) * (1 - part)**2
    two = np.array([3 - 2 * p, p - 1]) * p * p
    fast = np.array([6 * p * (p - 1), (1 - p) * (1 - 3 * p), 6 * p * (1 - p), p * (3 * p - 2)])
    place = one[0] * places[0] + two[0] * places[1] + span * (one[1] * rates[0] + two[1] * rates[1])
    return place, (fast[0] * places[0] + fast[2] * places[1]) / span + fast[1] * rates[0] + fast[3] * rates[1]


class _Course:
    """Of the object's centre, as it was recorded: between frames on cubics, whose rates are those of the frames."""

    def __init__(self, times: Array, goals: Array) -> None:
        self.times, self.goals = times, alike(goals)
        self.rates = np.gradient(goals[:, :3], times, axis=0)

    def at(self, row: int, part: float) -> tuple[Array, Array]:
        """Pose and rates a part of the way from a frame to the next one."""
        span, turns = float(self.times[row + 1] - self.times[row]), self.goals[row:row + 2, 3:]
        place, velocity = between(self.goals[row:row + 2, :3], self.rates[row:row + 2], part, span)
        pose = _mixed(self.goals[row], self.goals[row + 1], part)
        return np.concatenate([place, pose[3:]]), np.concatenate([velocity, rotation_vector(turns[1], turns[0]) / span])


class _Together:
    """How hands are moved and turned as one body, in the object's frame."""

    def __init__(self) -> None:
        self.moved, self.pose = np.zeros(6), np.array([0.0, 0, 0, 1, 0, 0, 0])

    def follow(self, goal: Array, off: Array, dt: float) -> None:
        """:param off: from the object to its goal, and turned, in the world"""
        back = goal[3:] * [1, -1, -1, -1]
        most = np.repeat([FURTHEST, TURNED], 3)
        self.moved = np.clip(self.moved * (1 - dt / FORGETS) + dt / COMES_BACK * np.concatenate([turned(back, off[:3]), turned(back, off[3:])]), -most, most)
        self.pose = np.concatenate([self.moved[:3], turn_of(self.moved[3:])])


class _Tally:
    """Means over an interval between frames, of contacts between the object and segments of hands."""

    def __init__(self, scene: Scene, name: str, segments: Sequence[str]) -> None:
        model = scene._model
        self.owner = {shape.name: model.bodies[shape.body].name for shape in model.shapes}
        self.name, self.column = name, {segment: i for i, segment in enumerate(segments)}
        self.clear()

    def clear(self) -> None:
        count = len(self.column)
        self.force, self.place, self.outward, self.pressing = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
        self.help, self.q = np.zeros(6), np.zeros(0)

    def add(self, simulation: Simulation, wrench: Array, share: float) -> None:
        self.help += share * wrench
        self.q = share * simulation.q + (self.q if len(self.q) else 0)
        contacts = simulation.contacts
        for a, b, place, normal, each in zip(contacts.a, contacts.b, contacts.position, contacts.normal, contacts.force):
            first = self.owner.get(a) == self.name
            i = self.column.get(self.owner.get(b if first else a, ""))
            if i is None or (not first and self.owner.get(b) != self.name):
                continue
            weight = max(abs(float(each @ normal)), 1e-9)
            self.force[i] += share * (each if first else -each)
            self.place[i] += weight * place
            self.outward[i] += weight * (-normal if first else normal)
            self.pressing[i] += weight

    def end(self) -> None:
        on = self.pressing > 0
        self.place[on] /= self.pressing[on][:, None]
        self.outward[on] /= np.maximum(np.linalg.norm(self.outward[on], axis=1, keepdims=True), 1e-12)


def carried(scene: Scene, name: str, segments: Sequence[str], times: Array, poses: Array, hands: Sequence[Guided] = (),
            wanted: Optional[Callable[[int, Array, Array, NDArray[np.bool_]], tuple[Array, Array]]] = None, before: int = 0) -> Pressed:
    """:param times: from 0 on [s]
    :param poses: of the object's own frame at these times; the first is where the scene has it
    :param hands: every hand of the scene, in its order, to be driven so that nothing else carries the object; none: as the scene drives them
    :param wanted: by frame, places, outward normals and segments that touch: the forces on the object by segment that hands should give, and where they act
    :param before: frames at rest before the first, in which hands come to bear it
    """
    simulation = Simulation(scene)
    model, dt, count = scene._model, scene.step, len(times)
    body = next(i for i, each in enumerate(model.bodies) if each.name == name)
    mass, inertia, zero = model.bodies[body].mass, model.bodies[body].inertia, model.bodies[body].zero
    goals = compose(poses, np.broadcast_to(compose(inverse(poses[0]), zero), (count, 7)))
    # Hands that are driven here and their object are simulated in a frame that moves as fast as the object at first: from the rest on nothing jerks.
    drift = times[:, None] * (goals[1, :3] - goals[0, :3]) / (times[1] - times[0]) if hands else np.zeros((count, 3))
    course = _Course(times, _shifted(goals, -drift))
    own = [alike(compose(inverse(course.goals), _shifted(hand.wrist, -drift))) for hand in hands]
    together, tally = _Together(), _Tally(scene, name, segments)
    # Changes of targets at the frame and at the next one.
    changes, later = ([np.zeros(hand.targets.shape[1]) for hand in hands] for _ in range(2))
    wrists, targets = [hand.wrist.copy() for hand in hands], [hand.targets.copy() for hand in hands]
    rows: list[tuple[Any, ...]] = []

    def note(row: int) -> None:
        """Of the hands, seen from the object where it is, and carried over to where it was recorded."""
        to = compose(goals[row], inverse(_pose(simulation, body)))
        for k, hand in enumerate(hands):
            wrists[k][row] = compose(to, compose(course.goals[row], compose(together.pose, own[k][row])))
            targets[k][row] = hand.targets[row] + changes[k]

    start, first = 0.0, simulation.q.copy()
    for frame in range(-before, count - 1):
        row, moving = max(frame, 0), frame >= 0
        if frame == 0:
            start, first = simulation.time, simulation.q.copy()
        stiff = CARRY if moving else TAKES * (CARRY / TAKES)**min(1.0, (frame + before) / (SOFT * before))
        span = float(times[row + 1] - times[row])
        steps = max(1, int(round((float(times[row + 1]) - simulation.time + start if moving else span) / dt)))
        note(row)
        tally.clear()
        at = np.zeros((len(hands), 7))
        for step in range(steps):
            part = min((simulation.time - start + dt - float(times[row])) / span, 1.0) if moving else 0.0
            goal, rates = course.at(row, part)
            now, pose = simulation.bodies, _pose(simulation, body)
            off = np.concatenate([goal[:3] - pose[:3], rotation_vector(goal[3:] * np.sign(goal[3:] @ pose[3:]), pose[3:])])
            axes = matrices(np.concatenate([np.zeros(3), pose[3:]]))[:3, :3]
            push = stiff**2 * off + 2 * stiff * (moving * rates - np.concatenate([now.velocity[body], now.angular_velocity[body]]))
            wrench = np.concatenate([mass * push[:3], axes @ inertia @ axes.T @ push[3:]])
            aims = np.zeros(len(scene.axes))
            for k, hand in enumerate(hands):
                change = changes[k] + (step + 1) / steps * (later[k] - changes[k])
                driven = hand.axes >= 0
                aims[hand.axes[driven]] = ((1 - part) * hand.targets[row] + part * hand.targets[row + 1] + change)[driven]
                at[k] = compose(goal, compose(together.pose, _mixed(own[k][row], own[k][row + 1], part)))
            simulation.step(forces={name: wrench}, wrists=at if hands else None, targets=aims if hands else None)
            tally.add(simulation, wrench, 1 / steps)
            together.follow(goal, off, dt)
        tally.end()
        if moving:
            rows.append((tally.force, tally.place + drift[row], tally.outward, tally.pressing > 0, tally.help, tally.q))
        if wanted is not None:
            asked, places = wanted(row, tally.place + drift[row], tally.outward, tally.pressing > 0)
            for k, hand in enumerate(hands):
                s = hand.segments
                spots = np.where((tally.pressing[s] > 0)[:, None], tally.place[s], places[s] - drift[row])
                less = hand.torques(tally.q[hand.coordinates], at[k], spots, asked[s] - tally.force[s])
                changes[k], later[k] = later[k], np.clip((1 - span / SLACKENS) * later[k] + span / YIELDS * less / hand.stiffness, -LARGEST, LARGEST)
    note(count - 1)
    force, place, outward, touching, help, q = (np.array(each) for each in zip(*rows, rows[-1]))
    return Pressed(force, place, outward, touching, help, q, first, wrists, targets)


def _pose(simulation: Simulation, body: int) -> Array:
    bodies = simulation.bodies
    return np.concatenate([bodies.position[body], bodies.quaternion[body]])


def _shifted(poses: Array, by: Array) -> Array:
    return np.concatenate([poses[:, :3] + by, poses[:, 3:]], axis=1)


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
