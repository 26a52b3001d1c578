"""Derivatives of one step of the articulated engine, as arrays; and what a step ends with, beside that of another one."""
from __future__ import annotations

import math
from typing import Any, Mapping, NamedTuple, Protocol, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._scene import Scene

Array = NDArray[np.float64]
ACTIONS = ("torques", "targets", "excitations")


class Stepped(Protocol):
    """What the functions below need of a `Simulation`."""

    scene: Scene
    _core: _core.Simulation


class Derivatives(NamedTuple):
    """The Jacobians of one step. A state has s numbers, named by `names`: positions of all coordinates, their rates,
    activations of the muscles. Coordinates are those of the scene [rad] or [m]; then each free body's turn [rad], a
    rotation vector added before, ``exp(turn) R``, and shift of its mass centre [m], in world axes. Rates of free
    bodies are angular and linear velocities in world axes."""

    names: list[str]
    """Of the state's numbers, shape (s,)."""
    state: Array
    """Next state by state, shape (s, s)."""
    torques: Array
    """By torques of the scene's coordinates [1/(N m)] or [1/N], shape (s, coordinates)."""
    targets: Array
    """By targets of the controller [1/rad], shape (s, axes)."""
    excitations: Array
    """Shape (s, muscles)."""
    forces: dict[str, Array]
    """Of each body asked for: by force at its mass centre [1/N], then by moment [1/(N m)], world axes, shape (s, 6)."""
    gravity: Array
    """By gravity [s^2/m], world axes, shape (s, 3); a weight that the controller carries does not change."""
    notes: list[str]
    """Derivatives that hold to one side only, or without a part: what, and where. Empty: all are two-sided."""


def state_names(simulation: Stepped, free_bodies: Sequence[str]) -> list[str]:
    positions = list(simulation.scene.coordinates)
    positions += [f"{body}.{kind}.{axis}" for body in free_bodies for kind in ("turn", "shift") for axis in "xyz"]
    return positions + [f"d({name})/dt" for name in positions] + [m.name for m in simulation.scene.muscles]


def stacked(moving: Array, activation: Array) -> Array:
    """Rows of positions and rates above those of activations."""
    return np.vstack([moving, activation])


def _made(simulation: Stepped, action: Mapping[str, Any], bodies: list[str], step_only: bool) -> dict[str, Any]:
    given = [action.get(name) for name in (*ACTIONS, "wrists", "forces")]
    return simulation._core.step_with_derivatives(given[0], given[1], given[2], given[3], given[4], bodies, step_only)


def exact_derivatives(simulation: Stepped, action: Mapping[str, Any], bodies: Sequence[str]) -> Derivatives:
    """Makes the step, and returns its own derivatives."""
    found = _made(simulation, action, list(bodies), False)
    muscles = len(found["activation_by_activation"])
    own = np.diag(found["activation_by_activation"])
    moving = found["state"]
    if muscles == 0:
        def whole_rows(of: Array) -> Array:
            return of
        state = moving
    else:
        def whole_rows(of: Array) -> Array:
            return stacked(of, np.zeros((muscles, of.shape[1])))
        state = np.block([[moving, found["activations"]], [np.zeros((muscles, moving.shape[1])), own]])
    excitations = found["excitations"]
    excitations = (stacked(excitations, np.diag(found["activation_by_excitation"])) if muscles
                   else np.zeros((len(state), 0)))
    forces = {body: whole_rows(found["forces"][:, 6 * i:6 * i + 6]) for i, body in enumerate(bodies)}
    return Derivatives(state_names(simulation, found["free_bodies"]), state, whole_rows(found["torques"]),
                       whole_rows(found["targets"]), excitations, forces, whole_rows(found["gravity"]),
                       list(dict.fromkeys(found["notes"])))


def exact_step(simulation: Stepped, action: Mapping[str, Any]) -> None:
    """A step with contacts solved to rounding, which the derivatives are of."""
    _made(simulation, action, [], True)


class _End(NamedTuple):
    """Where a step ends."""

    joints: Array
    quaternion: Array
    position: Array
    rates: Array

    def against(self, other: "_End") -> Array:
        turns = np.array([rotation_vector(a, b) for a, b in zip(self.quaternion, other.quaternion)]).reshape(-1, 3)
        free = np.hstack([turns, self.position - other.position]).ravel()
        out: Array = np.concatenate([self.joints - other.joints, free, self.rates - other.rates])
        return out


def cross(a: Array, b: Array) -> Array:
    """Of two vectors; numpy's takes ten times as long."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def rotation_vector(to: Array, start: Array) -> Array:
    """Of ``to start^-1`` [rad]; quaternions w x y z."""
    w = float(to @ start)
    v = start[0] * to[1:] - to[0] * start[1:] - cross(to[1:], start[1:])
    size = float(np.linalg.norm(v))
    out: Array = (2 if size < 1e-12 else 2 * math.atan2(size, w) / size) * v
    return out


def _end(simulation: Stepped, free: Sequence[int]) -> _End:
    core, rows = simulation._core, list(free)
    position, quaternion, velocity, angular_velocity = core.bodies()
    moving = np.hstack([angular_velocity[rows], velocity[rows]]).ravel()
    activation = core.muscles()[1] if simulation.scene.muscles else np.zeros(0)
    return _End(core.q.copy(), quaternion[rows], position[rows], np.concatenate([core.u, moving, activation]))


def _state(simulation: Stepped, free: Sequence[int]) -> Array:
    """Turns of free bodies as zeros, their shifts as positions."""
    end = _end(simulation, free)
    return np.concatenate([end.joints, np.hstack([0 * end.position, end.position]).ravel(), end.rates])


def _free(simulation: Stepped) -> list[int]:
    """Bodies without a joint; the simulation stays."""
    before, muscles = simulation._core.motion(), len(simulation.scene.muscles)
    try:
        found = simulation._core.step_with_derivatives(
            None, None, np.full(muscles, 0.1) if muscles else None, None, None, [], False)
    finally:
        simulation._core.reset_to_motion(before)
    return [simulation.scene.bodies.index(name) for name in found["free_bodies"]]
