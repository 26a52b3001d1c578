"""A policy for the task `reach` of handsim.gym, learned by gradients through the simulation: a custom derivative for JAX.

    pip install --target out/jax jax==0.4.30      # a version for the NumPy that handsim was built for
    PYTHONPATH=build/release/python:out/jax OPENBLAS_NUM_THREADS=1 python3 python/examples/learn_by_gradients.py --out out/learned

Each update runs some hands for some steps and descends the distance of their fingertips to their goals, by the Jacobians of all steps (`Simulation.derivatives`).
`python/examples/ppo.py --task reach --drive targets` learns the same from rewards alone. Success is measured as there, without noise.
"""
import argparse
import json
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import handsim as hs
from handsim.gym import TASKS, Episodes
from handsim.optimise import Places

jax.config.update("jax_enable_x64", True)


class Hands:
    """Simulations side by side. `step` is differentiable: state and targets to state and fingertips."""

    def __init__(self, scene, count, substeps):
        self.each, self.substeps = [hs.Simulation(scene) for _ in range(count)], substeps
        self.places = Places(self.each[0], [])
        self.tips = [(body, offset) for hand in scene._model.hands for _, body, offset in hand.tips]

        @jax.custom_vjp
        def step(state, targets):
            return self.forward(state, targets)[0]

        step.defvjp(self.forward, self.backward)
        self.step = step

    def forward(self, state, targets):
        out, by_state, by_targets, by_place = [], [], [], []
        n = len(self.each[0].q)
        for simulation, target in zip(self.each, np.asarray(targets)):
            a, b = np.eye(2 * n), np.zeros((2 * n, n))
            for _ in range(self.substeps):
                found = simulation.derivatives(targets=target, advance=True)
                a, b = found.state @ a, found.state @ b + found.targets
            points = [self.places.point(simulation.bodies, *tip) for tip in self.tips]
            out.append(np.concatenate([simulation.q, simulation.u, *(place for place, _ in points)]))
            by_state.append(a)
            by_targets.append(b)
            by_place.append(np.vstack([by for _, by in points]))
        rows = np.array(out)
        return (jnp.array(rows[:, :2 * n]), jnp.array(rows[:, 2 * n:])), tuple(map(np.array, (by_state, by_targets, by_place)))

    def backward(self, kept, slopes):
        by_state, by_targets, by_place = kept
        slope = np.asarray(slopes[0]) + np.einsum("ni,nij->nj", np.asarray(slopes[1]), by_place)
        return jnp.einsum("ni,nij->nj", slope, by_state), jnp.einsum("ni,nij->nj", slope, by_targets)


def policy(weights, x):
    for w, b in weights[:-1]:
        x = jnp.tanh(x @ w + b)
    return jnp.tanh(x @ weights[-1][0] + weights[-1][1])


def measured(task, weights, scale, episodes=200):
    """Share of episodes with success."""
    run = Episodes(task, episodes, seed=7)
    observation, won, over = run.reset(seed=7), np.zeros(episodes, bool), np.zeros(episodes, bool)
    for _ in range(task.max_steps):
        # Without the fingertips' own places and turns, which the goals less the fingertips stand for.
        seen = np.concatenate([observation[:, :40], observation[:, -35:]], axis=1)
        observation, _, terminated, truncated = run.step(np.asarray(policy(weights, seen * scale)))
        won |= terminated & ~over & ~run.batch.failed
        over |= terminated | truncated
        if over.all():
            break
    return won.mean()


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--hands", type=int, default=32)
    options.add_argument("--horizon", type=int, default=16)
    options.add_argument("--updates", type=int, default=200)
    options.add_argument("--rate", type=float, default=3e-3)
    options.add_argument("--out", type=Path, default=Path("out/learned"))
    given = options.parse_args()
    task, random = TASKS["reach"](drive="targets"), np.random.default_rng(0)
    n, low, high = len(task.scene.coordinates), jnp.array(task._low), jnp.array(task._high)
    assert (task._driven == np.arange(n)).all()
    hands = Hands(task.scene, given.hands, task.substeps)
    sizes, scale = [3 * n + 15, 128, 128, n], np.concatenate([np.ones(n), np.full(n, 0.1), np.full(n, 2.0), np.ones(15)])
    weights = [(jnp.array(random.normal(size=(a, b)) / np.sqrt(a) * (0.1 if b == n else 1)), jnp.zeros(b)) for a, b in zip(sizes, sizes[1:])]

    def loss(weights, state, targets, places, goals):
        total = 0.0
        for _ in range(given.horizon):
            x = jnp.concatenate([state, targets - state[:, :n], 10 * (goals - places)], axis=1) * scale
            targets = jnp.clip(targets + task.speed * policy(weights, x), low, high)
            state, places = hands.step(state, targets)
            off = jnp.sqrt(((goals - places).reshape(len(goals), -1, 3)**2).sum(axis=2) + 1e-8)
            total += off.mean()
        return 100 * total / given.horizon, (state, targets, places)

    slopes = jax.value_and_grad(loss, has_aux=True)
    moments, rows, start, steps = None, [], time.process_time(), 0
    goals = np.zeros((given.hands, 15))
    for update in range(given.updates):
        if update % 4 == 0:  # new episodes
            for i, simulation in enumerate(hands.each):
                simulation.reset()
                goals[i] = task._goals[0][random.integers(len(task._goals[0]))]
            state = jnp.array([np.concatenate([s.q, s.u]) for s in hands.each])
            targets = state[:, :n]
            places = jnp.array([np.concatenate([hands.places.point(s.bodies, *tip)[0] for tip in hands.tips]) for s in hands.each])
        (value, (state, targets, places)), found = slopes(weights, state, targets, places, jnp.array(goals))
        state, targets, places = map(jax.lax.stop_gradient, (state, targets, places))
        steps += given.hands * given.horizon
        size = jnp.sqrt(sum((g**2).sum() for g in jax.tree_util.tree_leaves(found)))
        found = jax.tree_util.tree_map(lambda g: g * jnp.minimum(1, 1 / (size + 1e-12)), found)
        if moments is None:
            moments = [jax.tree_util.tree_map(jnp.zeros_like, found) for _ in range(2)]
        moments = [jax.tree_util.tree_map(lambda m, g: 0.9 * m + 0.1 * g, moments[0], found),
                   jax.tree_util.tree_map(lambda v, g: 0.999 * v + 0.001 * g * g, moments[1], found)]
        rate = given.rate * np.sqrt(1 - 0.999**(update + 1)) / (1 - 0.9**(update + 1))
        weights = jax.tree_util.tree_map(lambda w, m, v: w - rate * m / (jnp.sqrt(v) + 1e-8), weights, *moments)
        if (update + 1) % 10 == 0:
            rows.append({"steps": steps, "cpu_s": time.process_time() - start, "success": float(measured(task, weights, scale))})
            print(f"{steps:8} steps, {rows[-1]['cpu_s']:6.1f} s: distance {float(value):.2f} cm, success {rows[-1]['success']:.1%}", flush=True)
            if rows[-1]["success"] >= 0.8:
                break
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "curve.json").write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
