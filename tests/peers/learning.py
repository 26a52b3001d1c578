#!/usr/bin/env python3
"""Learning beside MyoSuite and Gymnasium-Robotics: steps a second, and one PPO on all. Needs envpool, which has MyoSuite's tasks, and
gymnasium-robotics (both PyPI); --beside names pairs of one of them alone.

    PYTHONPATH=build/release/python python3 tests/peers/learning.py --cpu-minutes 4 --out out/learning

The PPO is python/examples/ppo.py with its defaults, but for the number of environments, which is the one that is fastest in each.
Success, in all: five steps in a row within the task's own threshold (MyoSuite's `solved`; `is_success` and `success` of
Gymnasium-Robotics). Time is CPU time, of the learner and of all threads and processes of the environments, so that other work on the
machine changes little. OUT/learning.json has the steps of random actions in a second of CPU time, in turns in one run, and for each pair
the success over CPU time; OUT has the curves.
"""
import argparse
import json
import os
import sys
import time
from pathlib import Path
from types import SimpleNamespace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import numpy as np

from handsim.gym import TASKS, Episodes

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python/examples"))
import ppo

# Of ours: task and drive; of theirs: the library and the task's name.
PAIRS = [("pose", "muscles", "envpool", "myoHandPoseRandom-v0"), ("reach", "muscles", "envpool", "myoHandReachRandom-v0"),
         ("key_turn", "muscles", "envpool", "myoHandKeyTurnRandom-v0"), ("pen_twirl", "muscles", "envpool", "myoHandPenTwirlRandom-v0"),
         ("reach", "targets", "gymnasium_robotics", "HandReachDense-v3"),
         ("rotate", "targets", "gymnasium_robotics", "HandManipulateBlockRotateZDense-v1"),
         ("relocate", "targets", "gymnasium_robotics", "AdroitHandRelocate-v1")]
OURS, THEIRS = 512, {"envpool": 64, "gymnasium_robotics": 16}
"""Environments: more are not faster."""
STEADY = 5


TICKS = os.sysconf("SC_CLK_TCK")


def cpu_of(process):
    """CPU time of another process and of its threads [s] (Linux)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


class Peer:
    """Episodes of other libraries, as ppo.py takes them. An episode that was a success ends as one at its time limit."""

    clock = staticmethod(time.process_time)

    def __init__(self, n, steps, actions, observed):
        self.task = SimpleNamespace(max_steps=steps, actions=actions, succeeded=lambda batch: self.done)
        self.batch = SimpleNamespace(failed=np.zeros(n, bool))
        self.observed = observed
        self.steps, self.row, self.done = np.zeros(n, int), np.zeros(n, int), np.zeros(n, bool)

    def reset(self, mask=None, seed=None):
        chosen = np.ones(len(self.steps), bool) if mask is None else np.asarray(mask)
        self.observed[chosen] = self._reset(chosen)
        self.steps[chosen] = self.row[chosen] = self.done[chosen] = 0
        return self.observed.copy()

    def step(self, action):
        observed, reward, ended, cut, solved = self._step(np.clip(action, -1, 1).astype(np.float32))
        self.observed[:] = observed
        self.steps += 1
        self.row = np.where(solved, self.row + 1, 0)
        self.done |= self.row >= STEADY
        over = ended | cut | (self.steps >= self.task.max_steps)
        return observed.copy(), reward, over & self.done, over & ~self.done


class EnvPool(Peer):
    def __init__(self, name, n, seed=0):
        import envpool

        self.pool = envpool.make(name, env_type="gymnasium", num_envs=n, seed=seed)
        super().__init__(n, self.pool.spec.config.max_episode_steps, self.pool.action_space.shape[0], self.pool.reset()[0].copy())

    def _reset(self, chosen):
        return self.pool.reset(np.flatnonzero(chosen).astype(np.int32))[0]

    def _step(self, action):
        observed, reward, ended, cut, info = self.pool.step(action)
        return observed, reward, ended, cut, info["solved"]


class Robotics(Peer):
    """In so many processes as there are cores, each with a part of the environments."""

    def __init__(self, name, n, seed=0):
        import gymnasium
        import gymnasium_robotics
        from gymnasium.vector import AutoresetMode

        gymnasium.register_envs(gymnasium_robotics)
        self.pool = gymnasium.make_vec(name, n, vectorization_mode="async", vector_kwargs={"autoreset_mode": AutoresetMode.DISABLED})
        super().__init__(n, gymnasium.spec(name).max_episode_steps, self.pool.single_action_space.shape[0],
                         self._flat(self.pool.reset(seed=seed)[0]))

    def clock(self):
        return time.process_time() + sum(cpu_of(each.pid) for each in self.pool.processes)

    @staticmethod
    def _flat(observed):
        if isinstance(observed, dict):
            observed = np.concatenate([observed["observation"], observed["desired_goal"] - observed["achieved_goal"]], axis=1)
        return np.array(observed, dtype=float)

    def _reset(self, chosen):
        return self._flat(self.pool.reset(options={"reset_mask": chosen})[0])[chosen]

    def _step(self, action):
        observed, reward, ended, cut, info = self.pool.step(action)
        return self._flat(observed), reward, ended, cut, np.asarray(info.get("is_success", info.get("success")), bool)


def rate(episodes, n, seconds, random, clock):
    start, steps = clock(), 0
    while clock() - start < seconds:
        *_, terminated, truncated = episodes.step(random.uniform(-1, 1, (n, episodes.task.actions)))
        steps += n
        if np.any(terminated | truncated):
            episodes.reset(terminated | truncated)
    return steps / (clock() - start)


def minutes_to(rows, share):
    return next((minutes for _, _, minutes, success, _ in rows if success >= share), None)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cpu-minutes", type=float, default=10, help="of learning, for each task of each; 0: steps a second alone")
    parser.add_argument("--seconds", type=float, default=10, help="of CPU time, of each measurement of steps a second")
    names = [beside for *_, beside in PAIRS]
    parser.add_argument("--beside", nargs="+", default=names, choices=names, help="pairs, by the peer's task")
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    asked.out = asked.out.resolve()
    asked.out.mkdir(parents=True, exist_ok=True)
    os.chdir(asked.out)  # MuJoCo leaves its log where it runs
    found, random = {"cores": os.cpu_count(), "cpu_minutes": asked.cpu_minutes, "pairs": []}, np.random.default_rng(0)
    for task, drive, library, beside in (pair for pair in PAIRS if pair[-1] in asked.beside):
        n = THEIRS[library]
        ours, theirs = Episodes(TASKS[task](drive=drive), OURS), {"envpool": EnvPool, "gymnasium_robotics": Robotics}[library](beside, n)
        rates = [(rate(ours, OURS, asked.seconds, random, time.process_time), rate(theirs, n, asked.seconds, random, theirs.clock))
                 for _ in range(3)]
        mine, peer = np.median(rates, axis=0)
        row = {"task": task, "drive": drive, "beside": beside, "library": library, "version": __import__(library).__version__,
               "steps_per_s": mine, "peer_steps_per_s": peer, "ratio": float(np.median([a / b for a, b in rates]))}
        found["pairs"].append(row)
        print(f"{task} by {drive}: {mine:.0f} steps/s; {beside}: {peer:.0f}; ratio {row['ratio']:.1f}", flush=True)
        for who, episodes, count, clock in (("handsim", ours, OURS, time.process_time), ("peer", theirs, n, theirs.clock)):
            if asked.cpu_minutes == 0:
                continue
            folder = asked.out / f"{task}_{drive}_{who}"
            folder.mkdir(parents=True, exist_ok=True)
            words = ["--task", task, "--drive", drive, "--cpu-minutes", str(asked.cpu_minutes), "--environments", str(count), "--out", str(folder)]
            rows = ppo.learn(ppo.parsed(words), folder, episodes, {"drive": drive}, clock)
            row[who] = {"steps": int(rows[-1][0]), "success": float(rows[-1][3]), "cpu_minutes_to_80": minutes_to(rows, 0.8)}
            print(f"  {who}: {row[who]}", flush=True)
        (asked.out / "learning.json").write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
