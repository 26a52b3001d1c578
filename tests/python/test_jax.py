"""The derivative of python/examples/learn_by_gradients.py for JAX: against differences, with a can in the hand, over steps in a row."""
import importlib.util
from pathlib import Path

import numpy as np
import pytest

try:
    import jax
except ImportError:
    jax = None
pytestmark = pytest.mark.skipif(jax is None, reason="JAX is not installed")


def test_gradients_through_a_held_can_are_those_of_differences():
    path = Path(__file__).parents[2] / "python/examples/learn_by_gradients.py"
    spec = importlib.util.spec_from_file_location("learn_by_gradients", path)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    hold, random = example.Hold(2), np.random.default_rng(0)
    motions, middle = [], np.asarray(hold.middle) + 0.3
    hold.hands.forces = [{hold.task._body: [0.5 * i, 0.3, 0.2]} for i in range(2)]
    hold.begin(random)
    for simulation, forces in zip(hold.hands.each, hold.hands.forces):
        simulation.step(targets=middle, forces=forces, substeps=300)
        motions.append(simulation.motion())
    start = np.array([hold.hands.seen(each)[0] for each in hold.hands.each])
    weights, along = random.normal(size=(2, len(hold.rows))), random.normal(size=(2, 2, len(middle)))

    def value(targets):
        for simulation, motion in zip(hold.hands.each, motions):
            simulation.reset(motion)
        state = jax.numpy.array(start)
        for k in range(2):
            state, places = hold.hands.step(state, targets[k])
        return (weights * state[:, hold.rows]).sum() + places.sum()

    # Fingers slide and stick within some 1e-6 rad: smaller differences, of rounding's 1e-7.
    targets, size = np.tile(middle, (2, 2, 1)), 1e-8
    found = sum(w * float(value(targets + k * size * along)) for k, w in ((1, 8), (-1, -8), (2, -1), (-2, 1))) / (12 * size)
    gradient = np.asarray(jax.grad(value)(jax.numpy.array(targets)))
    assert abs((gradient * along).sum() / found - 1) < 1e-5, (gradient * along).sum()
