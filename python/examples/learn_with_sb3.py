#!/usr/bin/env python3
"""A can is held by a policy that SAC of stable-baselines3 learns: learn_with_sb3.py. Needs: pip install stable-baselines3."""
import time

import torch
from stable_baselines3 import SAC

import handsim as hs

torch.set_num_threads(1)
env = hs.gym.sb3_vec("hold", 16)
model = SAC("MlpPolicy", env, learning_starts=1000, train_freq=1, gradient_steps=4, seed=1)
start = time.perf_counter()
while time.perf_counter() - start < 240:
    model.learn(4000, reset_num_timesteps=False)
    kept = [bool(each) for each in model.ep_success_buffer]
    print(f"{time.perf_counter() - start:.0f} s, {model.num_timesteps} steps: {sum(kept) / max(1, len(kept)):.0%} of the last {len(kept)} cans kept", flush=True)
