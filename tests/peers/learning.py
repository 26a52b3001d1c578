#!/usr/bin/env python3
"""Learning by muscles beside MyoSuite: steps a second, and one PPO on both. Needs envpool (PyPI), which has MyoSuite's tasks.

    PYTHONPATH=build/release/python python3 tests/peers/learning.py --minutes 10 --out out/learning

A step is 20 ms in each. The PPO is python/examples/ppo.py with its defaults, but for the number of environments, which is the
one that is fastest in each. Success, in both: five steps in a row within the task's own threshold (MyoSuite's `solved`).
OUT/learning.json has the steps a second of random actions, in turns in one run, and for each task the success over time.
"""
import argparse
import json
import os
import sys
import time
from pathlib import Path
from types import SimpleNamespace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import envpool
import numpy as np

from handsim.gym import TASKS, Episodes

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python/examples"))
import ppo

PAIRS = {"pose": "myoHandPoseRandom-v0", "reach": "myoHandReachRandom-v0"}
OURS, THEIRS = 512, 64
"""Environments: more are not faster."""
STEADY = 5


class Peer:
    """Episodes of an envpool task, as ppo.py takes them. An episode that was a success ends as one at its time limit."""

    def __init__(self, name, n, seed=0):
        self.pool = envpool.make(name, env_type="gymnasium", num_envs=n, seed=seed)
        self.task = SimpleNamespace(max_steps=self.pool.spec.config.max_episode_steps, actions=self.pool.action_space.shape[0])
        self.batch = SimpleNamespace(failed=np.zeros(n, bool))
        self.observed = self.pool.reset()[0].copy()
        self.steps, self.row, self.done = np.zeros(n, int), np.zeros(n, int), np.zeros(n, bool)

    def reset(self, mask=None, seed=None):
        chosen = np.flatnonzero(np.ones(len(self.steps), bool) if mask is None else mask).astype(np.int32)
        self.observed[chosen] = self.pool.reset(chosen)[0]
        self.steps[chosen] = self.row[chosen] = self.done[chosen] = 0
        return self.observed.copy()

    def step(self, action):
        observed, reward, ended, cut, info = self.pool.step(np.clip(action, -1, 1).astype(np.float32))
        self.observed[:] = observed
        self.steps += 1
        self.row = np.where(info["solved"], self.row + 1, 0)
        self.done |= self.row >= STEADY
        over = ended | cut | (self.steps >= self.task.max_steps)
        return observed.copy(), reward, over & self.done, over & ~self.done


def rate(episodes, n, seconds, random):
    start, steps = time.perf_counter(), 0
    while time.perf_counter() - start < seconds:
        *_, terminated, truncated = episodes.step(random.uniform(-1, 1, (n, episodes.task.actions)))
        steps += n
        if np.any(terminated | truncated):
            episodes.reset(terminated | truncated)
    return steps / (time.perf_counter() - start)


def minutes_to(rows, share):
    return next((minutes for _, minutes, success, _ in rows if success >= share), None)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10, help="of learning, for each task of each; 0: steps a second alone")
    parser.add_argument("--seconds", type=float, default=10, help="of each measurement of steps a second")
    parser.add_argument("--tasks", nargs="+", default=list(PAIRS), choices=PAIRS)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    asked.out = asked.out.resolve()
    asked.out.mkdir(parents=True, exist_ok=True)
    os.chdir(asked.out)  # MuJoCo leaves its log where it runs
    found, random = {"envpool": envpool.__version__, "cores": os.cpu_count(), "tasks": {}}, np.random.default_rng(0)
    for task in asked.tasks:
        ours, theirs = Episodes(TASKS[task](drive="muscles"), OURS), Peer(PAIRS[task], THEIRS)
        rates = [(rate(ours, OURS, asked.seconds, random), rate(theirs, THEIRS, asked.seconds, random)) for _ in range(3)]
        mine, peer = np.median(rates, axis=0)
        row = found["tasks"][task] = {"beside": PAIRS[task], "steps_per_s": mine, "peer_steps_per_s": peer,
                                      "ratio": float(np.median([a / b for a, b in rates]))}
        print(f"{task}: {mine:.0f} steps/s; {PAIRS[task]}: {peer:.0f}; ratio {row['ratio']:.0f}", flush=True)
        for who, episodes, n in (("handsim", ours, OURS), ("peer", theirs, THEIRS)):
            if asked.minutes == 0:
                continue
            folder = asked.out / f"{task}_{who}"
            folder.mkdir(parents=True, exist_ok=True)
            words = ["--task", task, "--minutes", str(asked.minutes), "--environments", str(n), "--out", str(folder)]
            rows = ppo.learn(ppo.parsed(words), folder, episodes, {"drive": "muscles"})
            row[who] = {"steps": int(rows[-1][0]), "success": float(rows[-1][2]), "minutes_to_80": minutes_to(rows, 0.8)}
            print(f"  {who}: {row[who]}", flush=True)
    (asked.out / "learning.json").write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
