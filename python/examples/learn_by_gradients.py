"""A policy for the tasks `reach` and `hold` of handsim.gym, learned by gradients through the simulation: a custom derivative for JAX.

    pip install --target out/jax jax==0.4.30      # a version for the NumPy that handsim was built for
    PYTHONPATH=build/release/python:out/jax OPENBLAS_NUM_THREADS=1 python3 python/examples/learn_by_gradients.py --task reach --out out/learned

Each update runs some hands for some steps and descends what the task asks for, by the Jacobians of all steps (`Simulation.derivatives`): the distance of
fingertips to their goals, or the shift of the can in the hand while forces pull at it. `python/examples/ppo.py --drive targets` learns the same from rewards
alone. Success is measured as there, without noise.
"""
import argparse
import json
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import handsim as hs
from handsim._derivatives import _free, _state
from handsim.gym import TASKS, Episodes
from handsim.optimise import Places

jax.config.update("jax_enable_x64", True)


class Hands:
    """Simulations side by side. `step` is differentiable: state and targets to state and fingertips. Each simulation has its own state; the one that is given
    carries the derivatives."""

    def __init__(self, scene, count, substeps):
        self.each, self.substeps, self.forces = [hs.Simulation(scene) for _ in range(count)], substeps, [None] * count
        self.free = _free(self.each[0])
        self.places = Places(self.each[0], self.free)
        self.tips = [(body, offset) for hand in scene._model.hands for _, body, offset in hand.tips]

        @jax.custom_vjp
        def step(state, targets):
            return self.forward(state, targets)[0]

        step.defvjp(self.forward, self.backward)
        self.step = step

    def seen(self, simulation):
        """State, fingertips, and their derivative by the state."""
        points = [self.places.point(simulation.bodies, *tip) for tip in self.tips]
        return _state(simulation, self.free), np.concatenate([place for place, _ in points]), np.vstack([by for _, by in points])

    def forward(self, state, targets):
        rows, by_state, by_targets = [], [], []
        for simulation, target, forces in zip(self.each, np.asarray(targets), self.forces):
            a, b = np.eye(self.places.size), np.zeros((self.places.size, len(target)))
            for _ in range(self.substeps):
                found = simulation.derivatives(targets=target, forces=forces, advance=True)
                a, b = found.state @ a, found.state @ b + found.targets
            rows.append(self.seen(simulation))
            by_state.append(a)
            by_targets.append(b)
        states, tips, by_place = map(np.array, zip(*rows))
        return (jnp.array(states), jnp.array(tips)), (np.array(by_state), np.array(by_targets), by_place)

    def backward(self, kept, slopes):
        by_state, by_targets, by_place = kept
        slope = np.asarray(slopes[0]) + np.einsum("ni,nij->nj", np.asarray(slopes[1]), by_place)
        return jnp.einsum("ni,nij->nj", slope, by_state), jnp.einsum("ni,nij->nj", slope, by_targets)


class Reach:
    """The policy sees q, u, the targets less q and the goals less the fingertips."""

    every = 4  # updates of an episode

    def __init__(self, count):
        self.task = TASKS["reach"](drive="targets")
        self.hands, self.goals, n = Hands(self.task.scene, count, self.task.substeps), np.zeros((count, 15)), self.task.actions
        self.low, self.high = jnp.array(self.task._low), jnp.array(self.task._high)
        self.scale = np.concatenate([np.ones(n), np.full(n, 0.1), np.full(n, 2.0), np.ones(15)])

    def begin(self, random):
        for i, simulation in enumerate(self.hands.each):
            simulation.reset()
            self.goals[i] = self.task._goals[0][random.integers(len(self.task._goals[0]))]

    def targets(self, state):
        return state[:, :self.task.actions]

    def seen(self, state, targets, places):
        return jnp.concatenate([state, targets - state[:, :self.task.actions], 10 * (self.goals - places)], axis=1) * self.scale

    def next(self, targets, action):
        return jnp.clip(targets + self.task.speed * action, self.low, self.high)

    def loss(self, state, places, action):
        """Mean distance [cm]."""
        return 100 * jnp.sqrt(((self.goals - places).reshape(len(self.goals), -1, 3)**2).sum(axis=2) + 1e-8).mean()

    def columns(self, observation):
        """Of the task's observation: without the fingertips' own places and turns, which the goals less the fingertips stand for."""
        return np.concatenate([observation[:, :40], observation[:, -35:]], axis=1) * self.scale

    def over(self, state):
        return False

    def won(self, terminated, truncated):
        return terminated


class Hold:
    """The policy sees q, u and the can's shift, angular velocity and velocity. A new force pulls at each can every five steps, as in the task."""

    every = 5

    def __init__(self, count):
        self.task = TASKS["hold"](drive="targets")
        self.hands, n = Hands(self.task.scene, count, self.task.substeps), self.task.actions
        self.low, self.high, self.middle = map(jnp.array, (self.task._low, self.task._high, self.task._middle))
        self.scale = np.concatenate([np.ones(n), np.full(n, 0.1), np.full(3, 20.0), np.full(6, 0.1)])
        self.rows = np.array([*range(n), *range(n + 6, 2 * n + 6), n + 3, n + 4, n + 5, *range(2 * n + 6, 2 * n + 12)])  # of the state
        self.start, self.random, self.age = np.zeros(2 * n + 12), np.random.default_rng(0), 0
        self.start[n + 3:n + 6] = self.task._start_place

    def begin(self, random):
        for simulation in self.hands.each:
            simulation.reset(self.task.start())
        self.age = 0

    def targets(self, state):
        return None

    def seen(self, state, targets, places):
        if self.age % self.task.force_steps == 0:
            pulls = self.random.normal(size=(len(state), 3))
            pulls *= self.task._largest * self.random.random((len(state), 1)) / np.linalg.norm(pulls, axis=1, keepdims=True)
            self.hands.forces = [{self.task._body: pull} for pull in pulls]
        self.age += 1
        return (state - self.start)[:, self.rows] * self.scale

    def next(self, targets, action):
        return jnp.clip(self.middle + self.task.span * action, self.low, self.high)

    def loss(self, state, places, action):
        """The task's: shift over that at which the can is dropped, and effort."""
        n = self.task.actions
        shift = jnp.sqrt(((state - self.start)[:, n + 3:n + 6]**2).sum(axis=1) + 1e-8)
        return (jnp.minimum(1, shift / self.task.dropped) + 0.05 * (action**2).mean(axis=1)).mean()

    def columns(self, observation):
        n = self.task.actions
        can = observation[:, 2 * n:]
        return np.concatenate([observation[:, :2 * n], can[:, :3], can[:, 10:13], can[:, 7:10]], axis=1) * self.scale

    def over(self, state):
        """Half of the cans have fallen: gradients say nothing of these."""
        n = self.task.actions
        return np.median(np.linalg.norm((state - self.start)[:, n + 3:n + 6], axis=1)) > self.task.dropped

    def won(self, terminated, truncated):
        return truncated


def policy(weights, x):
    for w, b in weights[:-1]:
        x = jnp.tanh(x @ w + b)
    return jnp.tanh(x @ weights[-1][0] + weights[-1][1])


def measured(learned, weights, episodes=200):
    """Share of episodes with success."""
    task = learned.task
    run = Episodes(task, episodes, seed=7)
    observation, won, over = run.reset(seed=7), np.zeros(episodes, bool), np.zeros(episodes, bool)
    for _ in range(task.max_steps):
        observation, _, terminated, truncated = run.step(np.asarray(policy(weights, learned.columns(observation))))
        won |= learned.won(terminated, truncated) & ~over & ~run.batch.failed
        over |= terminated | truncated
        if over.all():
            break
    return won.mean()


class Adam:
    """Kingma & Ba 2014, with gradients of a length of 1 at most."""

    def __init__(self, rate):
        self.rate, self.moments, self.updates = rate, None, 0

    def __call__(self, weights, slope):
        size = jnp.sqrt(sum((g**2).sum() for g in jax.tree_util.tree_leaves(slope)))
        slope = jax.tree_util.tree_map(lambda g: g * jnp.minimum(1, 1 / (size + 1e-12)), slope)
        if self.moments is None:
            self.moments = [jax.tree_util.tree_map(jnp.zeros_like, slope) for _ in range(2)]
        self.moments = [jax.tree_util.tree_map(lambda m, g: 0.9 * m + 0.1 * g, self.moments[0], slope),
                        jax.tree_util.tree_map(lambda v, g: 0.999 * v + 0.001 * g * g, self.moments[1], slope)]
        self.updates += 1
        rate = self.rate * np.sqrt(1 - 0.999**self.updates) / (1 - 0.9**self.updates)
        return jax.tree_util.tree_map(lambda w, m, v: w - rate * m / (jnp.sqrt(v) + 1e-8), weights, *self.moments)


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--task", default="reach", choices=("reach", "hold"))
    options.add_argument("--hands", type=int, default=16)
    options.add_argument("--horizon", type=int, default=16)
    options.add_argument("--updates", type=int, default=200)
    options.add_argument("--look", type=int, default=10, help="updates from one measurement of success to the next")
    options.add_argument("--rate", type=float, default=3e-3)
    options.add_argument("--out", type=Path, default=Path("out/learned"))
    given = options.parse_args()
    random, state = np.random.default_rng(0), None
    learned = {"reach": Reach, "hold": Hold}[given.task](given.hands)
    hands, n = learned.hands, learned.task.actions
    sizes = [len(learned.scale), 128, 128, n]
    weights = [(jnp.array(random.normal(size=(a, b)) / np.sqrt(a) * (0.1 if b == n else 1)), jnp.zeros(b)) for a, b in zip(sizes, sizes[1:])]

    def loss(weights, state, targets, places):
        total = 0.0
        for _ in range(given.horizon):
            action = policy(weights, learned.seen(state, targets, places))
            targets = learned.next(targets, action)
            state, places = hands.step(state, targets)
            total += learned.loss(state, places, action)
        return total / given.horizon, (state, targets, places)

    slopes, descend = jax.value_and_grad(loss, has_aux=True), Adam(given.rate)
    rows, spent, steps = [], 0.0, 0
    for update in range(given.updates):
        start = time.process_time()
        if update % learned.every == 0 or learned.over(state):
            learned.begin(random)
            seen = [hands.seen(each) for each in hands.each]
            state, places = jnp.array([row[0] for row in seen]), jnp.array([row[1] for row in seen])
            targets = learned.targets(state)
        (value, (state, targets, places)), found = slopes(weights, state, targets, places)
        state, targets, places = map(jax.lax.stop_gradient, (state, targets, places))
        weights = descend(weights, found)
        steps += given.hands * given.horizon
        spent += time.process_time() - start
        if (update + 1) % given.look == 0:
            rows.append({"steps": steps, "cpu_s": spent, "success": float(measured(learned, weights))})
            print(f"{steps:8} steps, {spent:6.1f} s: loss {float(value):.3f}, success {rows[-1]['success']:.1%}", flush=True)
            if rows[-1]["success"] >= 0.8:
                break
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "curve.json").write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
