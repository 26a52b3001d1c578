#!/usr/bin/env python3
"""PPO in one file with PyTorch, in the manner of CleanRL, on a gymnasium vector: ppo_with_torch.py. Needs: pip install gymnasium torch."""
import time

import torch
from torch import nn

import handsim as hs

torch.set_num_threads(1)
torch.manual_seed(1)
n, horizon = 256, 32
env = hs.gym.make_vec("pose", n)
numbers, actions = env.single_observation_space.shape[0], env.single_action_space.shape[0]
actor, critic = (nn.Sequential(nn.Linear(numbers, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, k)) for k in (actions, 1))
optimiser, deviation = torch.optim.Adam([*actor.parameters(), *critic.parameters()], 1e-3), 0.3
x, begun, start = torch.as_tensor(env.reset(seed=1)[0]), torch.zeros(n, dtype=bool), time.perf_counter()
won = ended = 0
for update in range(160):
    rows = []
    for _ in range(horizon):
        with torch.no_grad():
            action = actor(x) + deviation * torch.randn(n, actions)
        y, reward, terminated, truncated, info = env.step(action.clamp(-1, 1).numpy())
        y, done = torch.as_tensor(y), torch.as_tensor(terminated | truncated)
        rows.append((x, action, torch.as_tensor(reward).float(), torch.as_tensor(terminated), done, ~begun, y))  # a step that resets is no experience
        won, ended = won + int(terminated.sum()), ended + int(done.sum())
        x, begun = y, done
    xs, acts, rewards, terms, dones, real, ys = map(torch.stack, zip(*rows))
    with torch.no_grad():
        values, nexts = critic(xs)[..., 0], critic(ys)[..., 0] * ~terms
        advantage, carried = torch.zeros_like(rewards), torch.zeros(n)
        for t in reversed(range(horizon)):
            carried = advantage[t] = rewards[t] + 0.97 * nexts[t] - values[t] + 0.97 * 0.95 * carried * ~dones[t]
        targets, logp = advantage + values, -((acts - actor(xs)) ** 2).sum(-1) / (2 * deviation**2)
    data = [each[real] for each in (xs, acts, advantage, targets, logp)]
    for _ in range(4):
        for rows in torch.randperm(len(data[0])).split(1024):
            o, a, adv, target, before = (each[rows] for each in data)
            ratio = (-((a - actor(o)) ** 2).sum(-1) / (2 * deviation**2) - before).exp()
            adv = (adv - adv.mean()) / (adv.std() + 1e-8)
            loss = -torch.min(ratio * adv, ratio.clamp(0.8, 1.2) * adv).mean() + 0.5 * ((critic(o)[:, 0] - target) ** 2).mean()
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_([*actor.parameters(), *critic.parameters()], 0.5)
            optimiser.step()
    if update % 16 == 15:
        print(f"{time.perf_counter() - start:.0f} s, {(update + 1) * n * horizon} steps: {won / max(1, ended):.0%} of the ended episodes were a success", flush=True)
        won = ended = 0
