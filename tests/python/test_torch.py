"""The derivative of python/examples/torch_gradients.py for PyTorch: against products of `Rollout`, against differences, and over runs in a row."""
import importlib.util
from pathlib import Path

import numpy as np
import pytest

import handsim as hs

try:
    import torch
except ImportError:
    torch = None
pytestmark = pytest.mark.skipif(torch is None, reason="PyTorch is not installed")


@pytest.fixture(scope="module")
def example():
    path = Path(__file__).parents[2] / "python/examples/torch_gradients.py"
    spec = importlib.util.spec_from_file_location("torch_gradients", path)
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.fixture(scope="module")
def held():
    """A held card, with a batch of three of it that are at different times."""
    scene = hs.load("grasp_pinch", {"solver": "{engine: articulated}"})
    simulation, batch = hs.Simulation(scene), hs.Batch(scene, 3)
    simulation.step(substeps=2500)
    for i in range(3):
        simulation.step(substeps=20)
        batch.reset(np.arange(3) == i, to=simulation.motion())
    return batch


def at(batch, motions):
    for i, motion in enumerate(motions):
        batch.reset(np.arange(len(batch)) == i, to=motion)


def test_gradients_of_a_batch_are_products_of_its_environments(example, held):
    motions, random = [held.motion(i) for i in range(3)], np.random.default_rng(0)
    actions = torch.tensor(0.01 * random.normal(size=(3, 4, len(held.scene.coordinates))), requires_grad=True)
    state = example.start(held).requires_grad_()
    weights = random.normal(size=tuple(state.shape))
    end = example.run(held, state, actions)
    after = [held.motion(i) for i in range(3)]
    (end * torch.tensor(weights)).sum().backward()
    for i, motion in enumerate(motions):
        simulation = hs.Simulation(held.scene)
        simulation.reset(motion)
        rollout = hs.Rollout(simulation, actions.detach().numpy()[i], keep=True)
        found = rollout.vjp(weights[i])
        np.testing.assert_array_equal(end.detach().numpy()[i], rollout.states[-1])
        np.testing.assert_array_equal(actions.grad.numpy()[i], found.action)
        np.testing.assert_array_equal(state.grad.numpy()[i], found.start)
    # The batch has gone on, and stays there when gradients are made.
    for i in range(3):
        simulation.reset(after[i])
        np.testing.assert_array_equal(simulation.q, held.q[i])
    at(held, motions)


def test_gradients_are_those_of_differences(example, held):
    motions, random = [held.motion(i) for i in range(3)], np.random.default_rng(1)
    given = 0.01 * random.normal(size=(3, 4, len(held.scene.coordinates)))
    names = hs.Simulation(held.scene).derivatives().names
    # Values have no turns of the card.
    weights = torch.tensor(random.normal(size=(3, len(names))) * [".turn." not in name or name.startswith("d(") for name in names])

    def value(actions):
        at(held, motions)
        return (example.run(held, example.start(held), actions) * weights).sum()

    actions = torch.tensor(given, requires_grad=True)
    value(actions).backward()
    along, size = random.normal(size=given.shape), 1e-5
    # Differences of fourth order of steps solved to rounding.
    found = sum(w * float(value(torch.tensor(given + k * size * along))) for k, w in ((1, 8), (-1, -8), (2, -1), (-2, 1))) / (12 * size)
    assert abs(float((actions.grad * torch.tensor(along)).sum()) / found - 1) < 1e-6
    at(held, motions)


def test_runs_in_a_row_have_the_gradient_of_the_whole_run(example, held):
    motions, random = [held.motion(i) for i in range(3)], np.random.default_rng(2)
    given, weights = 0.01 * random.normal(size=(3, 6, len(held.scene.coordinates))), torch.tensor(random.normal(size=(3, example.start(held).shape[1])))
    found = []
    for parts in ((6,), (2, 4)):
        at(held, motions)
        actions, state, first = torch.tensor(given, requires_grad=True), example.start(held), 0
        for steps in parts:
            state = example.run(held, state, actions[:, first:first + steps])
            first += steps
        (state * weights).sum().backward()
        found.append(actions.grad.numpy())
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-9 * np.abs(found[0]).max())
    at(held, motions)
