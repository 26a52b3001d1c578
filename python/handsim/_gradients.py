"""Runs of many steps of the articulated engine, and products with their derivatives."""
from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, NamedTuple, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from ._core import Motion
from ._derivatives import ACTIONS, Array, _free, _state, exact_step
from ._errors import flag, input_error, numbers as numbers_of, one_of, whole
from ._simulation import Parameters, Simulation
from ._smoothing import Smoothing, smoothing_of, step_with_derivatives


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

    def __init__(self, simulation: Simulation, actions: ArrayLike, kind: str = "torques", *,
                 every: Optional[int] = None, keep: bool = False,
                 smoothing: Union[Smoothing, float, None] = None) -> None:
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
