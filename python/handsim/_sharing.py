"""How the wrench that an object needs is shared by the places that touch it, in one frame.

Forces lie in cones of friction of `EDGES` edges, each place holds a moment about its normal by spinning friction, and none pulls: sums of edges with
factors of 0 or more. Of all that give the wrench, those of the least sum of squared pressures, or with muscles of squared activations, are taken, by
non-negative least squares.
"""
from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._model import cross
from ._nonnegative import Problem

Array = NDArray[np.float64]
EDGES = 8
"""Of a cone of friction."""
WAYS = 4
"""In which a centre of pressure is moved: along two tangents, either way."""
PER = EDGES + 2 + 2 * WAYS
"""Generators of a place: the edges; a newton along the normal with the largest moment about it either way; at the rim of the pad in each of the ways,
a newton along the normal, and one of the cone's edges, that which bears most of the wrench."""
BALANCE = 100.0
"""Weight of the wrench against that of pressures, both as shares of the weight."""
ARM = 0.05
"""At which the weight's moment counts as the weight [m]."""
UNEVEN = 0.4
"""Deviation of people's pressures from equal ones, as a share: it weighs shifts of centres of pressure against pressures. Chosen."""
PAD = 5e-3
"""How far a centre of pressure may lie from its place: the radius of a pad that is pressed flat (handmodels/finger_pad.yaml) [m]. Half of it is the
standard deviation."""
EVENLY = 1e-3
"""Weight of the square of a generator's force against that of a pressure: forces that give the same are spread evenly."""
TORQUES = 30.0
"""Weight of joint torques of 0.1 N m against an activation of 1."""
PRESSURES = 0.1
"""Weight of pressures beside activations."""
RADIUS = 8e-3
"""Of a finger pad whose pressure counts 1 [m]."""
DEAREST = 15.0
"""Price of a place beyond the gap that touches, at most: less than a wrench that is left undone."""
FARTHER = 10.0
"""Cost from which a place does not count in that sum."""
STEADY = 0.7
"""Weight of a change from the forces of neighbouring frames, against pressures."""
TOTAL = 2.0
"""Weight of the sum of normal forces that a person takes, against pressures: chosen."""
EVEN = 2.0
"""Weight of a finger's difference from its share, against pressures: chosen."""
SHARES = np.array([0.32, 0.32, 0.24, 0.12]) / 0.32
"""Of index, middle, ring and little finger in people's grips (Yun et al., docs/grasping.md)."""
AROUND = 2 * np.pi * np.arange(EDGES) / EDGES
COSINES, SINES = np.cos(AROUND), np.sin(AROUND)
SIGNS = np.array([[1.0, -1, 0, 0], [0, 0, 1, -1]])
"""Of the ways along the two tangents."""


class Places(NamedTuple):
    """Of a frame; n places."""

    points: Array
    """World [m], shape (n, 3)."""
    normals: Array
    """Out of the object."""
    costs: Array
    """Weight of a newton's pressure."""
    fingers: NDArray[np.intp]
    """Hand and finger of each place as one number, 4 for each hand; -1: thumb, palm, and what does not touch."""
    shares: Array
    """Of each place's finger in the grip of its hand, over the index finger's."""
    noise: float = 0.0
    """Standard deviation of a coordinate of a place [m]: it is moved by up to twice that, beside `pad`."""
    pad: float = PAD

    @property
    def rim(self) -> float:
        """How far a centre of pressure is moved, at most [m]."""
        return self.pad + 2 * self.noise

    @property
    def unsure(self) -> float:
        """Standard deviation of a centre of pressure along a tangent [m]."""
        return float(np.hypot(self.pad / 2, self.noise))


class Muscles(NamedTuple):
    """Of the hands of a frame."""

    torques: Array
    """Of full activations, shape (coordinates, muscles) [N m]."""
    needed: Array
    """Without contacts, less what is passive, shape (coordinates,) [N m]."""
    jacobians: Array
    """Of the places, shape (n, 3, coordinates): velocity in the world by rates."""


class Shared(NamedTuple):
    normal: Array
    """By place [N]."""
    force: Array
    """On the object, world axes, shape (n, 3) [N]."""
    spin: Array
    """Moment about the normal, by place [N m]."""
    shift: Array
    """Of the centres of pressure from their places, up to `Places.rim`, shape (n, 3) [m]."""
    residual: Array
    """What the places leave undone: force [N] and moment about the centre [N m], shape (6,)."""
    activation: Array
    """Of the muscles; none without."""
    active: NDArray[np.intp]
    """Unknowns that are not 0: the start of a problem alike."""


def frames_of(normals: Array) -> tuple[Array, Array]:
    """Two tangents of each normal."""
    away = np.where(np.abs(normals[:, :1]) < 0.7, np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]]))
    first = cross(normals, away)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, cross(normals, first)


class Generators(NamedTuple):
    """Each of a newton along the normal; n places."""

    forces: Array
    """On the object, shape (3, n PER)."""
    moments: Array
    """About a centre, shape (3, n PER)."""
    normals: Array
    first: Array
    second: Array
    """The tangents."""


def generators(of: Places, centre: Array, friction: float, spin: float, bearing: Array) -> Generators:
    """:param spin: largest moment about the normal over the normal force [m]
    :param bearing: the force that the object needs
    """
    first, second = frames_of(of.normals)
    along = friction * (COSINES[:, None] * first[:, None] + SINES[:, None] * second[:, None])
    forces = np.repeat(-of.normals[:, None], PER, axis=1)
    forces[:, :EDGES] += along
    best = np.argmax(along @ bearing, axis=1)
    forces[:, EDGES + 2 + WAYS:] += along[np.arange(len(along)), best][:, None]
    moments = cross((of.points - centre)[:, None], forces)
    moments[:, EDGES] += spin * of.normals
    moments[:, EDGES + 1] -= spin * of.normals
    # Of the shift and the normal force alone: what friction gives about the normal there is told from the spin after the solution.
    shifted = of.rim * cross(np.stack([first, -first, second, -second], axis=1), -of.normals[:, None])
    moments[:, EDGES + 2:] += np.concatenate([shifted, shifted], axis=1)
    return Generators(forces.reshape(-1, 3).T, moments.reshape(-1, 3).T, of.normals, first, second)


def share(of: Places, wrench: Array, centre: Array, weight: float, friction: float, spin: float, total: float = 0.0,
          steady: Optional[Array] = None, muscles: Optional[Muscles] = None,
          start: Optional[NDArray[np.intp]] = None, routines: Any = None) -> Shared:
    """:param wrench: force and moment about the centre that the object needs, world axes
    :param weight: of the object [N]: scale of forces
    :param total: sum of normal forces that a person takes where fingers oppose each other [N]
    :param steady: normal forces of places in neighbouring frames [N]; NaN: not known
    :param start: unknowns that are likely not 0
    """
    n = len(of.points)
    if n == 0:
        return Shared(np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), wrench.copy(), np.zeros(0 if muscles is None else muscles.torques.shape[1]),
                      np.zeros(0, dtype=np.intp))
    made = generators(of, centre, friction, spin, wrench[:3])
    forces, moments, count = made.forces, made.moments, n * PER
    scale = np.concatenate([np.full(3, BALANCE), np.full(3, BALANCE / ARM)]) / weight
    light, active = (1.0, 0) if muscles is None else (PRESSURES, muscles.torques.shape[1])
    sums = np.zeros((n, count))
    sums[np.repeat(np.arange(n), PER), np.arange(count)] = 1 / weight
    touch = np.repeat(of.costs < FARTHER, PER) / weight
    rows = [np.vstack([forces, moments]) * scale[:, None], light * of.costs[:, None] * sums, light * TOTAL * touch[None]]
    goals = [wrench * scale, np.zeros(n), np.array([light * TOTAL * total / weight])]
    moved = np.zeros((2, n, n, PER))
    each = np.arange(n)
    moved[:, each, each, EDGES + 2:] = np.tile(SIGNS, (1, 2))[:, None]
    rows.append(light * UNEVEN * of.rim / of.unsure / weight * moved.reshape(2 * n, count))
    goals.append(np.zeros(2 * n))
    if steady is not None:
        known = np.isfinite(steady)
        rows.append(light * STEADY * sums[known])
        goals.append(light * STEADY * steady[known] / weight)
    parts = _evenly(of, sums)
    if parts is not None:
        # Further unknowns: how hard the fingers of a hand press at all.
        own, means = parts
        rows = [np.hstack([each, np.zeros((len(each), means.shape[1]))]) for each in rows]
        rows.append(light * EVEN * np.hstack([own, -means / weight]))
        goals.append(np.zeros(len(own)))
    if muscles is not None:
        pulled = np.einsum("nkc,kng->cng", muscles.jacobians, forces.reshape(3, n, PER)).reshape(-1, count)
        counts = np.abs(muscles.torques).max(axis=1) > 1e-6
        rows = [np.hstack([each, np.zeros((len(each), active))]) for each in rows]
        before = rows[0].shape[1] - active
        pulled = np.hstack([pulled, np.zeros((len(pulled), before - count))])
        rows += [TORQUES / 0.1 * np.hstack([-pulled[counts], muscles.torques[counts]]), np.hstack([np.zeros((active, before)), np.eye(active)])]
        goals += [TORQUES / 0.1 * muscles.needed[counts], np.zeros(active)]
    matrix, goal = np.vstack(rows), np.concatenate(goals)
    ridge = np.full(matrix.shape[1], (EVENLY * light / weight)**2)
    x, rows_of = Problem(matrix, goal, ridge, routines).solve(start)
    by = x[:count].reshape(n, PER)
    normal = by.sum(axis=1)
    force = np.einsum("kng,ng->nk", forces.reshape(3, n, PER), by)
    across, up = of.rim * np.einsum("kg,ng->kn", np.tile(SIGNS, (1, 2)), by[:, EDGES + 2:]) / np.maximum(normal, 1e-12)
    shift = across[:, None] * made.first + up[:, None] * made.second
    # Friction at a place that is shifted has a moment about the normal of its own.
    turning = spin * (by[:, EDGES] - by[:, EDGES + 1]) - (cross(shift, force) * of.normals).sum(axis=1)
    turning = np.clip(turning, -spin * normal, spin * normal)
    moment = (cross(of.points + shift - centre, force) + turning[:, None] * of.normals).sum(axis=0)
    residual = wrench - np.concatenate([force.sum(axis=0), moment])
    return Shared(normal, force, turning, shift, residual, x[len(x) - active:], rows_of)


def _evenly(of: Places, sums: Array) -> Optional[tuple[Array, Array]]:
    """Rows of the forces of fingers, shape (fingers, generators), and of their shares, shape (fingers, hands); None where no hand has two."""
    known = [int(finger) for finger in np.unique(of.fingers[of.fingers >= 0])]
    known = [finger for finger in known if sum(other // 4 == finger // 4 for other in known) > 1]
    if not known:
        return None
    hands = sorted({finger // 4 for finger in known})
    means = np.array([[float(of.shares[of.fingers == finger][0]) if finger // 4 == hand else 0.0 for hand in hands] for finger in known])
    return np.array([sums[of.fingers == finger].sum(axis=0) for finger in known]), means


def costs(radii: Array, gaps: Array, twins: Sequence[bool], touching: NDArray[np.bool_], noises: Array) -> Array:
    """Weight of a newton by the area of its pad, and by how far it is from the surface.

    :param radii: of the shapes [m]; area grows with their square
    :param gaps: beyond that of a place that touches [m]
    :param twins: another place of the same shape touches, too, and shares its area
    :param noises: of places against the object [m]
    """
    beyond = np.where(touching, 0.0, np.maximum(gaps / np.maximum(noises, 1e-9) - 1, 0))
    return np.asarray((RADIUS / radii)**2 * np.where(twins, np.sqrt(2.0), 1.0) * np.minimum(np.exp(np.minimum(3 * beyond, 12)), DEAREST))
