"""How the wrench that an object needs is shared by the places that touch it, in one frame.

Forces lie in cones of friction of `EDGES` edges, each place holds a moment about its normal by spinning friction, and none pulls: sums of edges with
factors of 0 or more. Of all that give the wrench, those of the least sum of squared pressures, or with muscles of squared activations, are taken, by
non-negative least squares (scipy.optimize.nnls).
"""
from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._errors import input_error

Array = NDArray[np.float64]
EDGES = 8
"""Of a cone of friction."""
PER = EDGES + 2
"""Generators of a place: the edges, and a newton along the normal with the largest moment about it either way."""
BALANCE = 100.0
"""Weight of the wrench against that of pressures, both as shares of the weight."""
TORQUES = 30.0
"""Weight of joint torques of 0.1 N m against an activation of 1."""
PRESSURES = 0.1
"""Weight of pressures beside activations."""
RADIUS = 8e-3
"""Of a finger pad whose pressure counts 1 [m]."""
STEADY = 0.7
"""Weight of a change from the forces of neighbouring frames, against pressures."""
AROUND = 2 * np.pi * np.arange(EDGES) / EDGES
COSINES, SINES = np.cos(AROUND), np.sin(AROUND)


def solver() -> Any:
    try:
        from scipy.optimize import nnls
    except ImportError:
        raise input_error("SciPy", "no Python module of this name", "it, for forces on objects: pip install scipy") from None
    return nnls


class Places(NamedTuple):
    """Of a frame; n places."""

    points: Array
    """World [m], shape (n, 3)."""
    normals: Array
    """Out of the object."""
    costs: Array
    """Weight of a newton's pressure."""


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
    residual: Array
    """What the places leave undone: force [N] and moment about the centre [N m], shape (6,)."""
    activation: Array
    """Of the muscles; none without."""


def frames_of(normals: Array) -> tuple[Array, Array]:
    """Two tangents of each normal."""
    away = np.where(np.abs(normals[:, :1]) < 0.7, np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]]))
    first = np.cross(normals, away)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normals, first)


def generators(of: Places, centre: Array, friction: float, spin: float) -> tuple[Array, Array]:
    """Forces on the object of the generators, shape (3, n PER), and moments about a centre, each of a newton along the normal.

    :param spin: largest moment about the normal over the normal force [m]
    """
    first, second = frames_of(of.normals)
    along = COSINES[:, None] * first[:, None] + SINES[:, None] * second[:, None]
    forces = np.repeat(-of.normals[:, None], PER, axis=1)
    forces[:, :EDGES] += friction * along
    moments = np.cross((of.points - centre)[:, None], forces)
    moments[:, EDGES] += spin * of.normals
    moments[:, EDGES + 1] -= spin * of.normals
    return forces.reshape(-1, 3).T, moments.reshape(-1, 3).T


def share(of: Places, wrench: Array, centre: Array, weight: float, size: float, friction: float, spin: float, steady: Optional[Array] = None,
          muscles: Optional[Muscles] = None, nnls: Any = None) -> Shared:
    """:param wrench: force and moment about the centre that the object needs, world axes
    :param weight: of the object [N], and its size [m]: scales of forces and moments
    :param steady: normal forces of places in neighbouring frames [N]; NaN: not known
    """
    n = len(of.points)
    if n == 0:
        return Shared(np.zeros(0), np.zeros((0, 3)), np.zeros(0), wrench.copy(), np.zeros(0 if muscles is None else muscles.torques.shape[1]))
    forces, moments = generators(of, centre, friction, spin)
    count = n * PER
    scale = BALANCE / np.concatenate([np.full(3, weight), np.full(3, weight * size)])
    light = 1.0 if muscles is None else PRESSURES
    sums = np.zeros((n, count))
    sums[np.repeat(np.arange(n), PER), np.arange(count)] = 1 / weight
    rows = [np.vstack([forces, moments]) * scale[:, None], light * of.costs[:, None] * sums]
    goals = [wrench * scale, np.zeros(n)]
    if steady is not None:
        known = np.isfinite(steady)
        rows.append(light * STEADY * sums[known])
        goals.append(light * STEADY * steady[known] / weight)
    if muscles is not None:
        pulled = np.einsum("nkc,kng->cng", muscles.jacobians, forces.reshape(3, n, PER)).reshape(-1, count)
        active = muscles.torques.shape[1]
        counts = np.abs(muscles.torques).max(axis=1) > 1e-6
        rows = [np.hstack([each, np.zeros((len(each), active))]) for each in rows]
        rows += [TORQUES / 0.1 * np.hstack([-pulled[counts], muscles.torques[counts]]), np.hstack([np.zeros((active, count)), np.eye(active)])]
        goals += [TORQUES / 0.1 * muscles.needed[counts], np.zeros(active)]
    matrix, goal = np.vstack(rows), np.concatenate(goals)
    x, _ = (nnls or solver())(matrix, goal, maxiter=50 * matrix.shape[1])
    by = x[:count].reshape(n, PER)
    found = np.concatenate([forces @ x[:count], moments @ x[:count]])
    return Shared(by.sum(axis=1), np.einsum("kng,ng->nk", forces.reshape(3, n, PER), by), spin * (by[:, EDGES] - by[:, EDGES + 1]), wrench - found, x[count:])


def costs(radii: Array, gaps: Array, twins: Sequence[bool], reach: float) -> Array:
    """Weight of a newton by the area of its pad, and by how far it is from the surface.

    :param radii: of the shapes [m]; area grows with their square
    :param twins: another place of the same shape touches, too, and shares its area
    :param reach: gap up to which a place counts as touching [m]
    """
    beyond = np.maximum(gaps - reach, 0) / reach
    return np.asarray((RADIUS / radii)**2 * np.where(twins, np.sqrt(2.0), 1.0) * np.exp(np.minimum(3 * beyond, 12)))
