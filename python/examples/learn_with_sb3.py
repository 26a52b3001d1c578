#!/usr/bin/env python3
"""A can is held by a policy that SAC of stable-baselines3 learns: learn_with_sb3.py. Needs: pip install stable-baselines3."""
import time

import torch
from stable_baselines3 import SAC

import handsim as hs

torch.set_num_threads(1)
env = hs.gym.sb3_vec("hold", 8)
model = SAC("MlpPolicy", env, learning_starts=500, gradient_steps=8, batch_size=64, gamma=0.95, policy_kwargs={"net_arch": [64, 64]}, seed=1)
start = time.perf_counter()
for _ in range(4):
    model.learn(2000, reset_num_timesteps=False)
    kept = list(model.ep_success_buffer)[-16:]
    print(f"{time.perf_counter() - start:.0f} s, {model.num_timesteps} steps: {sum(kept) / len(kept):.0%} of the last {len(kept)} episodes end with the can in the hand", flush=True)
model.save("hold")
