"""Derivatives of steps of the articulated engine, and their products over many steps."""
from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Callable, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import flag, input_error, numbers as numbers_of, one_of, real, whole

if TYPE_CHECKING:
    from ._core import Motion
    from ._simulation import Simulation
    from ._smoothing import Smoothing

Array = NDArray[np.float64]
ACTIONS = ("torques", "targets", "excitations")


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


def state_names(simulation: "Simulation", free_bodies: Sequence[str]) -> list[str]:
    positions = list(simulation.scene.coordinates)
    positions += [f"{body}.{kind}.{axis}" for body in free_bodies for kind in ("turn", "shift") for axis in "xyz"]
    return positions + [f"d({name})/dt" for name in positions] + [m.name for m in simulation.scene.muscles]


def stacked(moving: Array, activation: Array) -> Array:
    """Rows of positions and rates above those of activations."""
    return np.vstack([moving, activation])


def _made(simulation: "Simulation", action: Mapping[str, Any], bodies: list[str], step_only: bool) -> dict[str, Any]:
    given = [action.get(name) for name in (*ACTIONS, "wrists", "forces")]
    return simulation._core.step_with_derivatives(given[0], given[1], given[2], given[3], given[4], bodies, step_only)


def step_with_derivatives(simulation: "Simulation", action: Mapping[str, Any], bodies: Sequence[str],
                          smoothing: Optional["Smoothing"] = None) -> Derivatives:
    """Makes the step."""
    if smoothing is not None:
        return smoothing.step_with_derivatives(simulation, action, bodies)
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


def exact_step(simulation: "Simulation", action: Mapping[str, Any]) -> None:
    """A step with contacts solved to rounding, which the derivatives are of."""
    _made(simulation, action, [], True)


SET = ("gravity", "gains", "torque_limits", ".mass", ".friction")
"""Ends of names of `Simulation.set` that change a scene's numbers."""
STEP = 3e-5
"""Of the differences, as a share of the number: an error of its fourth power beside rounding."""


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


def _end(simulation: "Simulation", free: Sequence[int]) -> _End:
    bodies, rows = simulation.bodies, list(free)
    moving = np.hstack([bodies.angular_velocity[rows], bodies.velocity[rows]]).ravel()
    return _End(simulation.q.copy(), bodies.quaternion[rows], bodies.position[rows],
                np.concatenate([simulation.u, moving, simulation.muscles.activation]))


def _state(simulation: "Simulation", free: Sequence[int]) -> Array:
    """Turns of free bodies as zeros, their shifts as positions."""
    end = _end(simulation, free)
    return np.concatenate([end.joints, np.hstack([0 * end.position, end.position]).ravel(), end.rates])


def _free(simulation: "Simulation") -> list[int]:
    """Bodies without a joint; the simulation stays."""
    before, muscles = simulation.motion(), len(simulation.scene.muscles)
    try:
        found = simulation._core.step_with_derivatives(
            None, None, np.full(muscles, 0.1) if muscles else None, None, None, [], False)
    finally:
        simulation.reset(before)
    return [simulation.scene.bodies.index(name) for name in found["free_bodies"]]


class Parameters:
    """Derivatives of steps by numbers of a scene, by differences of steps of scenes that are compiled with other
    numbers. All that follows from a number changes with it: lengths, masses, inertias, gains and pads with a stature.
    """

    def __init__(self, simulation: "Simulation", numbers: Mapping[str, Optional[float]]) -> None:
        """
        :param numbers: by dotted key, as ``--set`` of the command line, the value that it has (SI); or None for a name of
            `Simulation.set`: gravity (3 numbers), gains, torque_limits, objects.I.mass, objects.I.friction
        :raises Error: of kind input where a scene with another number does not compile
        """
        from ._scene import with_value
        from ._simulation import Simulation

        self.simulation = one_of("simulation", simulation, Simulation)
        if not isinstance(numbers, Mapping):
            raise input_error("numbers", type(numbers).__name__, "a mapping: dotted key to its value, or to None")
        self.free = _free(simulation)
        self.names: list[str] = []
        """One for each column."""
        self._beside: list[list[tuple["Simulation", float]]] = []

        def add(name: str, scale: float, make: Callable[[float], "Simulation"]) -> None:
            size = STEP * max(abs(scale), 1e-9)
            self.names.append(name)
            self._beside.append([(make(size * k), weight / (12 * size)) for k, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1))])

        for key, value in numbers.items():
            if value is not None:
                number = real(str(key), value)
                add(key, number, lambda by: Simulation(with_value(simulation.scene, key, number + by)))
                continue
            if not isinstance(key, str):
                raise input_error("numbers", repr(key)[:80], "dotted keys")
            if not key.endswith(SET):
                raise input_error(key, "no value", "the value that the scene has")
            now = simulation.get(key)
            for k in range(len(now)):
                def changed(by: float) -> "Simulation":
                    other = Simulation(simulation.scene)
                    other.set(key, now + by * (np.arange(len(now)) == k))
                    other.reset()
                    return other
                add(key if len(now) == 1 else f"{key}.{'xyz'[k]}", float(np.linalg.norm(now)), changed)

    def derivatives(self, **action: Any) -> Array:
        """Of the next step with an action as in `Simulation.step`: next state by numbers, shape (s, numbers). The
        simulation stays."""
        columns = []
        for beside in self._beside:
            ends = []
            for other, _ in beside:
                other._core.reset_beside(self.simulation._core, None)
                exact_step(other, action)
                ends.append(_end(other, self.free))
            columns.append(sum(weight * end.against(ends[0]) for end, (_, weight) in zip(ends, beside)))
        return np.array(columns).T


def _shaped(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    out: Array = numbers_of(name, values, f"shape {shape}")
    if out.shape != shape:
        raise input_error(name, f"shape {out.shape}", f"shape {shape}")
    return out


class Product(NamedTuple):
    """Of `Rollout.vjp`."""

    start: Array
    """Gradient by the state at the start, shape (s,)."""
    action: Array
    """By the action of each step, shape (steps, numbers)."""
    notes: list[str]
    """As in Derivatives, each once."""


class Rollout:
    """A run of many steps, from where a simulation is, and products with its derivatives.

    The run is kept at some of its steps only. A product backwards makes the steps between two of them again, with
    their Jacobians: for K steps the memory is K / c motions and c pairs of Jacobians, and two steps' time is spent
    for each one (`memory`). The Jacobians of the whole run are never formed.
    """

    def __init__(self, simulation: "Simulation", actions: ArrayLike, kind: str = "torques", *,
                 every: Optional[int] = None, keep: bool = False,
                 smoothing: Union["Smoothing", float, None] = None) -> None:
        """
        :param simulation: where it is now is the start; it is left at the end
        :param actions: of each step, shape (steps, numbers)
        :param kind: torques, targets or excitations, as in `Simulation.step`
        :param every: steps from one kept motion to the next; None: the root of their number
        :param keep: `states` after each step are kept
        :param smoothing: of the products' Jacobians, as in `Simulation.derivatives`; the run is not disturbed
        """
        if not isinstance(kind, str) or kind not in ACTIONS:
            raise input_error("kind", repr(kind)[:80], ", ".join(ACTIONS))
        from ._simulation import Simulation
        from ._smoothing import smoothing_of

        one_of("simulation", simulation, Simulation), flag("keep", keep)
        self.simulation, self.kind, self.smoothing = simulation, kind, smoothing_of(smoothing)
        self.actions: Array = numbers_of("actions", actions, "shape (steps, numbers), one step or more", 2)
        if len(self.actions) == 0:
            raise input_error("actions", f"shape {self.actions.shape}", "shape (steps, numbers), one step or more")
        self.every = math.isqrt(len(self.actions) - 1) + 1 if every is None else whole("every", every, 1)
        self.motions: list[Motion] = []
        self.size = 0
        states: list[Array] = []
        free = _free(simulation) if keep else []
        for i, action in enumerate(self.actions):
            if i % self.every == 0:
                self.motions.append(simulation.motion())
            exact_step(simulation, {kind: action})
            if keep:
                states.append(_state(simulation, free))
        self.states: Array = np.array(states)
        """With ``keep``: shape (steps, s), turns of free bodies 0 and their shifts as positions in the world."""
        self.end: Motion = simulation.motion()

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def memory(self) -> str:
        """What a product backwards keeps, in words."""
        size = self.size or 2 * len(self.simulation.q)
        numbers = min(self.every, len(self)) * size * (size + self.actions.shape[1])
        return (f"{len(self.motions)} motions and {min(self.every, len(self))} pairs of Jacobians "
                f"({8e-6 * numbers:.3g} MB)")

    def _measured(self) -> int:
        """Size of the state."""
        if self.size == 0:
            self.simulation.reset(self.motions[0])
            try:
                self._pairs(0, 1, [])
            finally:
                self.simulation.reset(self.end)
        return self.size

    def _pairs(self, first: int, last: int, notes: list[str]) -> list[tuple[Array, Array]]:
        out = []
        for action in self.actions[first:last]:
            found = step_with_derivatives(self.simulation, {self.kind: action}, (), self.smoothing)
            notes += [note for note in found.notes if note not in notes]
            out.append((found.state, getattr(found, self.kind)))
        self.size = len(out[0][0])
        return out

    def vjp(self, end: ArrayLike, along: Optional[ArrayLike] = None) -> Product:
        """Gradient of a scalar function of the run.

        :param end: its gradient by the state at the end, shape (s,)
        :param along: by the state after each step, shape (steps, s); the last is added to `end`
        """
        size = self._measured()
        gradient, notes = _shaped("end", end, (size,)), list[str]()
        extra = None if along is None else _shaped("along", along, (len(self), size))
        out = np.zeros(self.actions.shape)
        try:
            for i in reversed(range(len(self.motions))):
                first, last = i * self.every, min(len(self), (i + 1) * self.every)
                self.simulation.reset(self.motions[i])
                for step, (by_state, by_action) in reversed(list(enumerate(self._pairs(first, last, notes), first))):
                    if extra is not None:
                        gradient = gradient + extra[step]
                    out[step] = gradient @ by_action
                    gradient = gradient @ by_state
        finally:
            self.simulation.reset(self.end)
        return Product(gradient, out, notes)

    def jvp(self, start: Optional[ArrayLike] = None, actions: Optional[ArrayLike] = None) -> Array:
        """Changes of the state after each step, shape (steps, s), with changes of the start's state, shape (s,), and of
        the actions, shape (steps, numbers); None: no change."""
        size = self._measured()
        changed = np.zeros(size) if start is None else _shaped("start", start, (size,))
        given = np.zeros(self.actions.shape) if actions is None else _shaped("actions", actions, self.actions.shape)
        out = []
        self.simulation.reset(self.motions[0])
        try:
            for action, change in zip(self.actions, given):
                found = step_with_derivatives(self.simulation, {self.kind: action}, (), self.smoothing)
                changed = found.state @ changed + getattr(found, self.kind) @ change
                out.append(changed)
        finally:
            self.simulation.reset(self.end)
        return np.array(out)

    def sensitivities(self, parameters: Parameters) -> Array:
        """Changes of the state after each step with numbers of the scene, shape (steps, s, numbers); the start stays.

        :param parameters: of this simulation
        """
        if one_of("parameters", parameters, Parameters).simulation is not self.simulation:
            raise input_error("parameters", "those of another simulation", "Parameters of this one")
        self.simulation.reset(self.motions[0])
        out: list[Array] = []
        for action in self.actions:
            direct = parameters.derivatives(**{self.kind: action})
            found = step_with_derivatives(self.simulation, {self.kind: action}, (), self.smoothing)
            out.append(found.state @ out[-1] + direct if out else direct)
        self.simulation.reset(self.end)
        return np.array(out)


def each(work: Callable[[int], Any], count: int, threads: int) -> list[Any]:
    """Of each environment, in threads: steps release the GIL."""
    with ThreadPoolExecutor(threads or None) as pool:
        return list(pool.map(work, range(count)))
