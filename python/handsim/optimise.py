"""Trajectories of torques, targets or excitations at least cost: differential dynamic programming with box limits.

Each iteration makes the run's Jacobians (`Simulation.derivatives`), goes back through it with the costs' Gauss-Newton matrices, and
steps ahead with feedback on the state: Li & Todorov 2004 (iLQR); limits of actions by a projected Newton method in each
knot: Tassa, Mansard & Todorov 2014. An action holds for some steps of the solver, from one knot to the next.
"""
from __future__ import annotations

import copy
import time
from typing import Callable, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from ._core import Motion
from ._errors import Error, input_error
from ._derivatives import ACTIONS, _End, _end, _free, cross, exact_step, rotation_vector
from ._model import turned
from ._simulation import Bodies, Simulation
from ._smoothing import Smoothing, step_with_derivatives

Array = NDArray[np.float64]
Residual = Callable[[Simulation, int], tuple[Array, Array]]
HALVINGS = 4
"""Of a step ahead, before the next damping."""


class Term(NamedTuple):
    """A cost of the state: weight times the squares of its residual, at knots."""

    name: str
    weight: Array
    """Of each knot, shape (knots + 1,); 0: not there."""
    residual: Residual
    """At a knot: shape (r,), and its derivative by the state, shape (r, s)."""


class Trajectory(NamedTuple):
    """A run with its actions."""

    actions: Array
    motions: list[Motion]
    ends: list[_End]
    costs: dict[str, float]

    @property
    def cost(self) -> float:
        return sum(self.costs.values())


class Places:
    """Where points of bodies are, and how they move with the state."""

    def __init__(self, simulation: Simulation, free: Sequence[int]) -> None:
        scene = simulation.scene
        self.model, self.free, self.coordinates = scene._model, list(free), len(scene.coordinates)
        self.positions = self.coordinates + 6 * len(self.free)
        self.size = 2 * self.positions + len(scene.muscles)
        firsts = np.cumsum([0, *(len(joint.slides) for joint in self.model.joints)])
        self.joint_to = {joint.child: (joint, int(first)) for joint, first in zip(self.model.joints, firsts) if not joint.closes_loop}

    def point(self, bodies: Bodies, body: int, offset: Array) -> tuple[Array, Array]:
        """Place of a point [m], offset from the mass centre in the body's axes, and its derivative by the state."""
        place = bodies.position[body] + turned(bodies.quaternion[body], offset)
        by = np.zeros((3, self.size))
        while body in self.joint_to:
            joint, first = self.joint_to[body]
            centre = bodies.position[body] + turned(bodies.quaternion[body], joint.child_frame[:3])
            if joint.spherical:
                raise input_error("point", f"a body beyond the ball joint {joint.name}", "one beyond hinges, universal joints and sliders")
            for k, axis in enumerate(joint.axes):
                carrier, frame = (joint.parent, joint.parent_frame) if k <= sum(joint.slides) else (body, joint.child_frame)
                world = turned(bodies.quaternion[carrier], turned(frame[3:], axis.axis))
                by[:, first + k] = world if joint.slides[k] else cross(world, place - centre)
            body = joint.parent
        if body in self.free:
            at = self.coordinates + 6 * self.free.index(body)
            x, y, z = place - bodies.position[body]
            by[:, at:at + 3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
            by[:, at + 3:at + 6] = np.eye(3)
        return place, by


class Problem:
    """What is to be found."""

    def __init__(self, simulation: Simulation, kind: str, columns: Sequence[int], knots: int, hold: int) -> None:
        """
        :param simulation: where it is now is the start
        :param kind: torques, targets or excitations
        :param columns: of the action that are to be found; the others stay as the scene has them
        :param knots: number of actions
        :param hold: steps that each one holds
        """
        if kind not in ACTIONS:
            raise input_error("actions", repr(kind), ", ".join(ACTIONS))
        self.simulation, self.kind, self.columns, self.hold = simulation, kind, list(columns), hold
        self.free, self.start = _free(simulation), simulation.motion()
        self.places = Places(simulation, self.free)
        self.period = hold * simulation.scene.step
        self.base = self._scenes_own(knots)
        self.first: Array = self.base[:, self.columns]
        """Where the search begins, shape (knots, columns)."""
        self.about: Array = self.first.copy() if kind == "targets" else np.zeros_like(self.first)
        """Actions without effort."""
        count = len(self.columns)
        self.low, self.high = np.full(count, -np.inf), np.full(count, np.inf)
        self.effort, self.rate = np.zeros(count), np.zeros(count)
        """Costs of the integrals of squares [s], and of squares of rates."""
        self.before: Optional[Array] = None
        """The action before the first one, from which its rate counts; None: it does not count."""
        self.terms: list[Term] = []
        self.smoothing: Optional[Smoothing] = None
        """Of the run's Jacobians: sees contacts that the motion does not make yet, or loses."""

    def _scenes_own(self, knots: int) -> Array:
        """Actions of the scene itself, shape (knots, numbers)."""
        simulation, out = self.simulation, []
        if self.kind == "torques":
            return np.zeros((knots, len(simulation.q)))
        for _ in range(knots):
            simulation.step(substeps=self.hold)
            out.append(simulation._core.targets() if self.kind == "targets" else simulation.muscles.excitation)
        simulation.reset(self.start)
        return np.array(out)

    def whole(self, k: int, action: Array) -> Array:
        out: Array = self.base[k].copy()
        out[self.columns] = action
        return out

    def window(self, k: int, knots: int, start: Motion, first: Array, before: Optional[Array]) -> "Problem":
        """The problem of some knots from one on, with another start."""
        out = copy.copy(self)
        out.start, out.first, out.before = start, first, before
        out.base, out.about = self.base[k:k + knots], self.about[k:k + knots]
        out.terms = [Term(term.name, term.weight[k:k + knots + 1], _later(term.residual, k)) for term in self.terms]
        return out

    def ahead(self, policy: Callable[[int, _End, Optional[Array]], Array]) -> Optional[Trajectory]:
        """The run with actions of a policy: knot, state, action before. None: it diverged, or has a step
        without derivatives."""
        simulation, knots = self.simulation, len(self.first)
        simulation.reset(self.start)
        actions, motions, ends, before = [], [simulation.motion()], [_end(simulation, self.free)], self.before
        costs = {"effort": 0.0, "rate": 0.0, **{term.name: 0.0 for term in self.terms}}
        for k in range(knots):
            action = policy(k, ends[-1], before)
            costs["effort"] += float(self.period * self.effort @ (action - self.about[k])**2)
            if before is not None:
                costs["rate"] += float(self.rate @ (action - before)**2 / self.period)
            try:
                for _ in range(self.hold):
                    exact_step(simulation, {self.kind: self.whole(k, action)})
            except Error as error:
                if error.kind == "input" and not str(error).startswith("derivatives:"):
                    raise
                return None
            for term in self.terms:
                if term.weight[k + 1] > 0:
                    costs[term.name] += float(term.weight[k + 1] * (term.residual(simulation, k + 1)[0]**2).sum())
            actions.append(action)
            motions.append(simulation.motion())
            ends.append(_end(simulation, self.free))
            before = action
        return Trajectory(np.array(actions), motions, ends, costs)

    def linear(self, of: Trajectory) -> list[tuple[Array, Array, Array, Array]]:
        """Of each knot: next state by state and action; gradient and Gauss-Newton matrix of half the costs at its end."""
        simulation, out = self.simulation, []
        for k, action in enumerate(of.actions):
            simulation.reset(of.motions[k])
            by_state = by_action = np.zeros((0, 0))
            for step in range(self.hold):
                found = step_with_derivatives(simulation, {self.kind: self.whole(k, action)}, (), self.smoothing)
                own = getattr(found, self.kind)[:, self.columns]
                by_action = found.state @ by_action + own if step else own
                by_state = found.state @ by_state if step else found.state
            slope, curve = np.zeros(len(by_state)), np.zeros((len(by_state),) * 2)
            for term in self.terms:
                if term.weight[k + 1] > 0:
                    residual, by = term.residual(simulation, k + 1)
                    slope += term.weight[k + 1] * by.T @ residual
                    curve += term.weight[k + 1] * by.T @ by
            out.append((by_state, by_action, slope, curve))
        return out

    def back(self, of: Trajectory, linear: Sequence[tuple[Array, Array, Array, Array]],
             damping: float) -> tuple[list[tuple[Array, Array]], float]:
        """Changes of the actions and feedback on (state, action before), and the expected change of half the cost."""
        s, m = self.places.size, len(self.columns)
        slope, curve = np.zeros(s + m), np.zeros((s + m,) * 2)
        out: list[tuple[Array, Array]] = []
        expected = 0.0
        for k in reversed(range(len(of.actions))):
            by_state, by_action, own_slope, own_curve = linear[k]
            slope[:s] += own_slope
            curve[:s, :s] += own_curve
            action = of.actions[k]
            before = of.actions[k - 1] if k else self.before
            rate = self.rate / self.period if before is not None else np.zeros(m)
            effort = self.period * self.effort
            jump = action - before if before is not None else np.zeros(m)
            # Of (state, action before) and of the action; the next state is (A x + B u, u).
            gain = np.vstack([by_action, np.eye(m)])
            through = curve @ gain
            by_u = gain.T @ slope + effort * (action - self.about[k]) + rate * jump
            by_uu = gain.T @ through + np.diag(effort + rate)
            by_uz = np.hstack([through[:s].T @ by_state, -np.diag(rate)])
            by_z = np.concatenate([by_state.T @ slope[:s], -rate * jump])
            by_zz = np.zeros((s + m,) * 2)
            by_zz[:s, :s] = by_state.T @ curve[:s, :s] @ by_state
            by_zz[s:, s:] = np.diag(rate)
            damped = by_uu + np.diag(damping * np.diag(by_uu) + 1e-14)
            change, free = boxed(damped, by_u, self.low - action, self.high - action)
            feedback = np.zeros((m, s + m))
            if free.any():
                feedback[free] = -np.linalg.solve(damped[np.ix_(free, free)], by_uz[free])
            expected += float(change @ by_u + change @ by_uu @ change / 2)
            slope = by_z + feedback.T @ (by_uu @ change + by_u) + by_uz.T @ change
            curve = by_zz + feedback.T @ by_uu @ feedback + feedback.T @ by_uz + by_uz.T @ feedback
            curve = (curve + curve.T) / 2
            out.append((change, feedback))
        return out[::-1], expected

    def improved(self, of: Trajectory, damping: float, linear: Sequence[tuple[Array, Array, Array, Array]],
                 shortest: float = 0.5**HALVINGS) -> tuple[Optional[Trajectory], float]:
        """A better run, or None; and the expected improvement of the cost."""
        changes, expected = self.back(of, linear, damping)
        share = 1.0
        while share >= shortest:
            def policy(k: int, state: _End, before: Optional[Array]) -> Array:
                change, feedback = changes[k]
                off = state.against(of.ends[k])
                last = np.zeros(len(change)) if before is None or k == 0 else before - of.actions[k - 1]
                new: Array = of.actions[k] + share * change + feedback @ np.concatenate([off, last])
                return np.clip(new, self.low, self.high)
            found = self.ahead(policy)
            if found is not None and of.cost - found.cost >= -1e-2 * share * expected:
                return found, -2 * expected
            share /= 2
        return None, -2 * expected


def _later(residual: Residual, knots: int) -> Residual:
    return lambda simulation, k: residual(simulation, k + knots)


def boxed(matrix: Array, slope: Array, low: Array, high: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Least x.T matrix x / 2 + slope.T x between limits, and which are within them: projected Newton (Tassa et al. 2014)."""
    x = np.clip(-np.linalg.solve(matrix, slope), low, high)
    for _ in range(100):
        down = matrix @ x + slope
        free = ~(((x <= low) & (down > 0)) | ((x >= high) & (down < 0)))
        if not free.any() or np.abs(down[free]).max() <= 1e-10 * (np.abs(slope).max() + 1e-300):
            break
        step = np.zeros(len(x))
        step[free] = -np.linalg.solve(matrix[np.ix_(free, free)], down[free])
        value, share = x @ matrix @ x / 2 + slope @ x, 1.0
        while share > 1e-8:
            tried = np.clip(x + share * step, low, high)
            if tried @ matrix @ tried / 2 + slope @ tried <= value + 0.1 * down @ (tried - x):
                break
            share /= 2
        if np.abs(tried - x).max() <= 1e-14 * (1 + np.abs(x).max()):
            break
        x = tried
    return x, free


class Optimum(NamedTuple):
    """What was found."""

    trajectory: Trajectory
    iterations: int
    seconds: float
    converged: bool
    """The next iteration would lower the cost by less than `within` of it."""
    history: list[float]
    """Cost after each iteration, the first guess before all."""


def solve(problem: Problem, most: int = 100, within: float = 1e-4, told: Optional[Callable[[int, float], object]] = None) -> Optimum:
    """:param told: is called with the number of an iteration and its cost"""
    begin = time.perf_counter()
    found = played(problem)
    if found is None:
        raise input_error("first", "actions with which the motion diverges", "others to start from")
    history, damping, converged, iteration = [found.cost], 1e-6, False, 0
    while iteration < most and not converged:
        iteration += 1
        linear = problem.linear(found)
        better: Optional[Trajectory] = None
        while damping < 1e6:
            better, expected = problem.improved(found, damping, linear)
            if expected <= within * found.cost * 1e-2 and damping < 1e-3:
                converged = True
            if better is not None or converged:
                break
            damping = max(10 * damping, 1e-4)
        if better is None:
            break
        converged = converged or found.cost - better.cost <= within * found.cost and damping <= 1e-3
        damping = max(damping / 10, 1e-9)
        found = better
        history.append(found.cost)
        if told:
            told(iteration, found.cost)
    return Optimum(found, iteration, time.perf_counter() - begin, converged, history)


def played(problem: Problem) -> Optional[Trajectory]:
    """The run of the first guess."""
    def guess(k: int, state: _End, before: Optional[Array]) -> Array:
        first: Array = np.clip(problem.first[k], problem.low, problem.high)
        return first
    return problem.ahead(guess)


class Receding:
    """Model predictive control: at each knot one iteration, or some, over the next knots, and the first of their actions."""

    def __init__(self, problem: Problem, knots: int, iterations: int = 1) -> None:
        self.problem, self.knots, self.iterations, self.k = problem, knots, iterations, 0
        self.plan: Array = problem.first[:knots].copy()
        self.before, self.damping = problem.before, 1e-4

    def action(self, start: Motion) -> Array:
        """The action of the next knot, from where the motion is now."""
        knots = min(self.knots, len(self.problem.base) - self.k)
        window = self.problem.window(self.k, knots, start, self.plan[:knots], self.before)
        found = played(window)
        if found is not None:
            for _ in range(self.iterations):
                try:
                    better, _cost = window.improved(found, self.damping, window.linear(found), 0.25)
                except Error as error:
                    if error.kind == "physics":
                        raise
                    better = None
                self.damping = max(self.damping / 10, 1e-6) if better is not None else min(self.damping * 10, 10.0)
                found = better or found
        plan: Array = self.plan if found is None else found.actions
        self.k, self.before = self.k + 1, plan[0].copy()
        self.plan = np.vstack([plan[1:], plan[-1:]])
        first: Array = plan[0].copy()
        return first


def receded(problem: Problem, knots: int) -> Array:
    """Actions of the whole run by windows of some knots: a first guess where a whole run is far from linear."""
    control, motion, out = Receding(problem, knots, 2), problem.start, []
    simulation = problem.simulation
    for k in range(len(problem.first)):
        out.append(control.action(motion))
        simulation.reset(motion)
        for _ in range(problem.hold):
            exact_step(simulation, {problem.kind: problem.whole(k, out[-1])})
        motion = simulation.motion()
    return np.array(out)


# Residuals of terms.

def angle(problem: Problem, rows: Union[int, Sequence[int]], values: Union[float, Array]) -> Residual:
    """Differences of coordinates to a value, or to one each."""
    which = np.atleast_1d(rows)
    by = np.eye(problem.places.size)[which]
    return lambda simulation, k: (simulation.q[which] - values, by)


def point(problem: Problem, body: int, offset: Array, path: Array) -> Residual:
    """A point's difference to a place of each knot, shape (knots + 1, 3); NaN: free in this axis."""
    def of(simulation: Simulation, k: int) -> tuple[Array, Array]:
        place, by = problem.places.point(simulation.bodies, body, offset)
        asked = np.isfinite(path[k])
        return (place - path[k])[asked], by[asked]
    return of


def turn(problem: Problem, body: int, quaternion: Array) -> Residual:
    """A free body's rotation from another one, as a vector [rad]."""
    by = np.zeros((3, problem.places.size))
    first = problem.places.coordinates + 6 * problem.free.index(body)
    by[:, first:first + 3] = np.eye(3)
    return lambda simulation, k: (rotation_vector(simulation.bodies.quaternion[body], quaternion), by)


def still(problem: Problem, rows: Sequence[int]) -> Residual:
    """Rates of these positions: coordinates, then six of each free body."""
    by = np.zeros((len(rows), problem.places.size))
    by[range(len(rows)), [problem.places.positions + row for row in rows]] = 1
    which = list(rows)

    def of(simulation: Simulation, k: int) -> tuple[Array, Array]:
        rates: Array = _end(simulation, problem.free).rates[which]
        return rates, by
    return of
