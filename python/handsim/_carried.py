"""A simulation of hands whose object is carried along a recording by a force of its own: what the hands press on it there."""
from __future__ import annotations

from typing import NamedTuple, Sequence

import numpy as np
from numpy.typing import NDArray

from ._derivatives import rotation_vector
from ._model import compose, inverse, matrices
from ._scene import Scene
from ._simulation import Simulation

Array = NDArray[np.float64]
CARRY = 200.0
"""Natural frequency of the critically damped spring that carries the object [rad/s]: stiffer than hands, stable at steps of 1 ms. Chosen."""


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


def between(places: Array, rates: Array, part: float, span: float) -> tuple[Array, Array]:
    """Place and rate on the cubic of two places and their rates, a part of the span [s] after the first."""
    p, one = part, np.array([1 + 2 * part, part]) * (1 - part)**2
    two = np.array([3 - 2 * p, p - 1]) * p * p
    fast = np.array([6 * p * (p - 1), (1 - p) * (1 - 3 * p), 6 * p * (1 - p), p * (3 * p - 2)])
    place = one[0] * places[0] + two[0] * places[1] + span * (one[1] * rates[0] + two[1] * rates[1])
    return place, (fast[0] * places[0] + fast[2] * places[1]) / span + fast[1] * rates[0] + fast[3] * rates[1]


def carried(scene: Scene, name: str, segments: Sequence[str], times: Array, poses: Array) -> Pressed:
    """:param times: from 0 on [s]
    :param poses: of the object's own frame at these times; the first is where the scene has it
    """
    simulation = Simulation(scene)
    model = scene._model
    body = next(i for i, each in enumerate(model.bodies) if each.name == name)
    mass, inertia, zero = model.bodies[body].mass, model.bodies[body].inertia, model.bodies[body].zero
    owner = {shape.name: model.bodies[shape.body].name for shape in model.shapes}
    column = {segment: i for i, segment in enumerate(segments)}
    count = len(times)
    goals = compose(poses, np.broadcast_to(compose(inverse(poses[0]), zero), (count, 7)))
    force, place, outward, q = np.zeros((count, len(segments), 3)), np.zeros((count, len(segments), 3)), np.zeros((count, len(segments), 3)), []
    pressing, help = np.zeros((count, len(segments))), np.zeros((count, 6))
    rates = np.gradient(goals[:, :3], times, axis=0)
    for row in range(count - 1):
        steps = max(1, int(round((float(times[row + 1]) - simulation.time) / scene.step)))
        span = float(times[row + 1] - times[row])
        turn = goals[row + 1, 3:] * np.sign(goals[row, 3:] @ goals[row + 1, 3:])
        turning = rotation_vector(turn, goals[row, 3:]) / span
        angles = np.zeros(len(simulation.q))
        for _ in range(steps):
            part, now = (simulation.time + scene.step - float(times[row])) / span, simulation.bodies
            goal, velocity = between(goals[row:row + 2, :3], rates[row:row + 2], part, span)
            attitude = (1 - part) * goals[row, 3:] + part * turn
            attitude *= np.sign(attitude @ now.quaternion[body]) / np.linalg.norm(attitude)
            off = rotation_vector(attitude, now.quaternion[body])
            axes = matrices(np.concatenate([np.zeros(3), now.quaternion[body]]))[:3, :3]
            push = CARRY**2 * (goal - now.position[body]) + 2 * CARRY * (velocity - now.velocity[body])
            twist = CARRY**2 * off + 2 * CARRY * (turning - now.angular_velocity[body])
            wrench = np.concatenate([mass * push, axes @ inertia @ axes.T @ twist])
            simulation.step(forces={name: wrench})
            help[row] += wrench / steps
            angles += simulation.q / steps
            contacts = simulation.contacts
            for a, b, at, normal, each in zip(contacts.a, contacts.b, contacts.position, contacts.normal, contacts.force):
                first = owner.get(a) == name
                i = column.get(owner.get(b if first else a, ""))
                if i is None or (not first and owner.get(b) != name):
                    continue
                weight = max(abs(float(each @ normal)), 1e-9)
                force[row, i] += (each if first else -each) / steps
                place[row, i] += weight * at
                outward[row, i] += weight * (-normal if first else normal)
                pressing[row, i] += weight
        q.append(angles)
    touching = pressing > 0
    place[touching] /= pressing[touching][:, None]
    outward[touching] /= np.maximum(np.linalg.norm(outward[touching], axis=1, keepdims=True), 1e-12)
    every = Pressed(force, place, outward, touching, help, np.array([*q, q[-1]]))
    for values in every[:5]:
        values[-1] = values[-2]
    return every
