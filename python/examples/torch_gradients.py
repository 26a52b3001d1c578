"""Steps of a batch of hands with a custom derivative for PyTorch, and a network that learns through them which torques bend an index finger as asked.

    apt install python3-torch      # or another PyTorch for the NumPy that handsim was built for
    PYTHONPATH=build/release/python OPENBLAS_NUM_THREADS=1 python3 python/examples/torch_gradients.py

`run` takes states and actions of many environments to the states after the steps; backwards it is `Batch.vjp`. A network sees goals of four angles and gives
torques of 20 knots of 5 ms; it learns from goals that are drawn anew in each update, and is measured on others.
"""
import argparse

import numpy as np
import torch

import handsim as hs


class Steps(torch.autograd.Function):
    """State of each environment, shape (n, s), and actions, shape (n, steps, numbers), to the state after the steps. The batch goes on from where it is; the states
    that are given carry the derivatives (handsim.Derivatives says what their numbers are; turns of free bodies are 0 in the values)."""

    @staticmethod
    def forward(context, state, actions, batch, kind):
        context.batch, context.kind, context.starts = batch, kind, [batch.motion(i) for i in range(len(batch))]
        context.actions, ends = actions.detach().numpy().astype(float), []
        for i, start in enumerate(context.starts):
            simulation = hs.Simulation(batch.scene_of(i))
            simulation.reset(start)
            rollout = hs.Rollout(simulation, context.actions[i], kind, keep=True)
            batch.reset(np.arange(len(batch)) == i, to=rollout.end)
            ends.append(rollout.states[-1])
        return torch.from_numpy(np.array(ends)).to(actions.dtype)

    @staticmethod
    def backward(context, slope):
        batch, now = context.batch, [context.batch.motion(i) for i in range(len(context.batch))]
        moved = lambda motions: [batch.reset(np.arange(len(batch)) == i, to=motion) for i, motion in enumerate(motions)]
        moved(context.starts)
        products = batch.vjp(context.actions, slope.numpy().astype(float), context.kind)
        moved(now)
        by_state, by_actions = (torch.from_numpy(np.array([getattr(each, part) for each in products])).to(slope.dtype) for part in ("start", "action"))
        return by_state, by_actions, None, None


def run(batch, state, actions, kind="torques"):
    return Steps.apply(state, actions, batch, kind)


def start(batch):
    """A state of zeros, from which derivatives begin."""
    simulation = hs.Simulation(batch.scene)
    size = len(simulation.derivatives().names)
    return torch.zeros(len(batch), size, dtype=torch.float64)


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--hands", type=int, default=16)
    options.add_argument("--updates", type=int, default=150)
    given = options.parse_args()
    torch.manual_seed(0)
    torch.set_num_threads(1)
    scene, knots, hold = hs.load("reach"), 20, 5
    batch, n = hs.Batch(scene, given.hands), len(scene.coordinates)
    index = [i for i, name in enumerate(scene.coordinates) if name.startswith("right.index_")]
    low, high = torch.tensor([0.2, -0.1, 0.2, 0.1]), torch.tensor([1.0, 0.1, 1.0, 0.5])
    net = torch.nn.Sequential(torch.nn.Linear(4, 64), torch.nn.Tanh(), torch.nn.Linear(64, knots * 4)).double()
    adam = torch.optim.Adam(net.parameters(), 3e-3)

    def off(goals):
        """Differences of angles, and rates, at the end."""
        batch.reset()
        torques = 0.02 * net(goals).reshape(given.hands, knots, 4).repeat_interleave(hold, dim=1)
        actions = torch.zeros(given.hands, knots * hold, n, dtype=torch.float64)
        actions[:, :, index] = torques
        state = run(batch, start(batch), actions)
        return state[:, index] - goals, state[:, [n + i for i in index]]

    drawn = lambda: (low + (high - low) * torch.rand(given.hands, 4)).double()
    others = drawn()
    for update in range(given.updates + 1):
        if update % 25 == 0:
            with torch.no_grad():
                angles, rates = off(others)
            print(f"{update:4} updates: {torch.rad2deg(angles).square().mean().sqrt():.2f} deg and {rates.square().mean().sqrt():.2f} rad/s off at other goals, RMS", flush=True)
        adam.zero_grad()
        angles, rates = off(drawn())
        (angles.square().mean() + 1e-4 * rates.square().mean()).backward()
        adam.step()


if __name__ == "__main__":
    main()
