#!/usr/bin/env python3
"""A policy learned by PPO of Ray RLlib, whose workers, here or on other machines, each have a batch of hands: train_with_ray.py
[--task Pose] [--workers 2] [--envs 64] [--iterations 3] [--address ADDRESS]. Needs: pip install "ray[rllib]" torch gymnasium.
"""
import argparse
import time

import ray
from ray.rllib.algorithms.ppo import PPOConfig


def config(task: str, workers: int, envs: int, steps: int) -> PPOConfig:
    """:param workers: processes that simulate; 0: the process that learns, too. :param steps: of all hands in an iteration"""
    return (PPOConfig()
            # The module's name, from which each worker registers the tasks. RLlib expects a reset by the step after the last.
            .environment(f"handsim.gym:handsim/{task}-v0", env_config={"autoreset_mode": "NextStep", "threads": 1})
            .env_runners(num_env_runners=workers, num_envs_per_env_runner=envs, gym_env_vectorize_mode="vector_entry_point")
            .training(train_batch_size_per_learner=steps, minibatch_size=steps // 8, num_epochs=4))


def learn(task: str, workers: int, envs: int, steps: int, iterations: int) -> list[dict[str, float]]:
    """:returns: for each iteration steps so far, the mean return of ended episodes, and steps a second while hands are simulated"""
    algorithm = config(task, workers, envs, steps).build_algo()
    out = []
    for _ in range(iterations):
        result = algorithm.train()
        runners = result["env_runners"]
        spent = result["timers"]["env_runner_sampling_timer"]
        out.append({"steps": runners["num_env_steps_sampled_lifetime"], "return": runners.get("episode_return_mean", float("nan")),
                    "a second": runners["num_env_steps_sampled"] / spent})
        print(f"{out[-1]['steps']:.0f} steps, return {out[-1]['return']:.3f}, {out[-1]['a second']:.0f} steps a second", flush=True)
    algorithm.stop()
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="Pose")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--envs", type=int, default=64, help="hands of each worker")
    parser.add_argument("--steps", type=int, default=8192, help="of all hands in an iteration")
    parser.add_argument("--iterations", type=int, default=3)
    parser.add_argument("--address", help="of a cluster of Ray; without: this machine")
    options = parser.parse_args()
    ray.init(address=options.address, include_dashboard=False)
    begin = time.monotonic()
    learn(options.task, options.workers, options.envs, options.steps, options.iterations)
    print(f"{options.workers} workers of {options.envs} hands: {time.monotonic() - begin:.0f} s")


if __name__ == "__main__":
    main()
