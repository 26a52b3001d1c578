"""Smoothed derivatives: of the mean of the next state over small disturbances of this one."""
from __future__ import annotations

from typing import Any, Mapping, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ._errors import Error, input_error, real, whole
from ._derivatives import Array, Derivatives, Stepped, _end, exact_derivatives

REACH = 0.1
"""An angle is disturbed as much as moves a point at this distance by the deviation [m]."""


class Smoothing(NamedTuple):
    """Derivatives of the mean of the next state, where each position is disturbed on its own by a normal distribution.
    They see contacts that are about to close or open, where those of the step itself hold to one side.

    The mean is of steps from opposite disturbances: of their Jacobians, and of what their ends have beside these, so
    that jumps of the rates count, too. Without a contact near, the error against the exact derivatives is of second
    order in the deviation."""

    deviation: ArrayLike
    """Of shifts and sliders [m]; of angles and turns it is divided by 0.1 m. Or of each position and rate, shape (2n,)."""
    pairs: int = 64
    """Of opposite disturbances; each takes two steps with Jacobians."""
    seed: int = 0
    """Of the disturbances, with the number of the step."""

    def _deviations(self, simulation: Stepped, names: Sequence[str]) -> Array:
        moving = len(names) - len(simulation.scene.muscles)
        try:
            out = np.array(self.deviation, dtype=float)
        except (TypeError, ValueError, OverflowError):
            out = np.array([np.nan])
        if out.shape not in ((), (moving,)) or not (np.isfinite(out) & (out >= 0)).all():
            raise input_error("smoothing", f"{self.deviation!r}", f"a deviation [m], or one for each position and rate, "
                                                                  f"shape ({moving},), none negative")
        if out.ndim:
            return out
        straight = [slides for joint in simulation.scene._model.joints for slides in joint.slides]
        straight += [".shift." in name for name in names[len(straight):moving // 2]]
        return np.concatenate([np.where(straight, 1, 1 / REACH) * out, np.zeros(moving // 2)])

    def step_with_derivatives(self, simulation: Stepped, action: Mapping[str, Any],
                              bodies: Sequence[str]) -> Derivatives:
        """Makes the step, undisturbed. `notes` are those of that step."""
        whole("smoothing.pairs", self.pairs, 1)
        random = np.random.default_rng([whole("smoothing.seed", self.seed, 0), simulation._core.steps])
        before = simulation._core.motion()
        exact = exact_derivatives(simulation, action, bodies)
        after = simulation._core.motion()
        deviations = self._deviations(simulation, exact.names)
        free = [simulation.scene.bodies.index(name[:-len(".turn.x")]) for name in exact.names if name.endswith(".turn.x")]
        found: list[Derivatives] = []
        changes, odd = [], []
        failure: Optional[Error] = None
        try:
            for change in random.normal(size=(self.pairs, len(deviations))) * deviations:
                pair, ends = [], []
                try:
                    for side in (change, -change):
                        simulation._core.reset_to_motion(before)
                        simulation._core.reset_beside(simulation._core, side)
                        pair.append(exact_derivatives(simulation, action, bodies))
                        ends.append(_end(simulation, free))
                except Error as error:
                    failure = error
                    continue
                found += pair
                changes.append(change)
                odd.append(0.5 * ends[0].against(ends[1]))
        finally:
            simulation._core.reset_to_motion(after)
        if failure and not found:
            raise failure
        out = _mean(exact, found)
        # What the Jacobians' mean does not say of the ends: by Stein's identity, of jumps and of the samples' noise.
        used, x = deviations > 0, np.array(changes)
        rest = np.array(odd) - x @ out.state[:, :x.shape[1]].T
        out.state[:, :x.shape[1]][:, used] += rest.T @ x[:, used] / (len(x) * deviations[used]**2)
        if failure:
            out.notes.append(f"smoothing: {self.pairs - len(x)} of {self.pairs} pairs are left out: {failure}")
        return out


def _mean(exact: Derivatives, found: Sequence[Derivatives]) -> Derivatives:
    def of(name: str) -> Array:
        out: Array = np.mean([getattr(each, name) for each in found], axis=0)
        return out
    forces: dict[str, Array] = {body: np.mean([each.forces[body] for each in found], axis=0) for body in exact.forces}
    return Derivatives(exact.names, of("state"), of("torques"), of("targets"), of("excitations"), forces, of("gravity"),
                       list(exact.notes))


def smoothing_of(given: Any) -> Optional[Smoothing]:
    """Of an argument; a number is the deviation [m]."""
    if given is None or isinstance(given, Smoothing):
        return given
    try:
        return Smoothing(real("smoothing", given))
    except Error:
        raise input_error("smoothing", repr(given), "a deviation [m], or a Smoothing") from None


def step_with_derivatives(simulation: Stepped, action: Mapping[str, Any], bodies: Sequence[str],
                          smoothing: Optional[Smoothing] = None) -> Derivatives:
    """Makes the step, and returns its derivatives: smoothed, or its own."""
    return (exact_derivatives(simulation, action, bodies) if smoothing is None
            else smoothing.step_with_derivatives(simulation, action, bodies))
