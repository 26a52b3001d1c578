"""Learns a task of handsim.gym by PPO (Schulman et al. 2017, arXiv:1707.06347). Needs numpy and onnx (Debian's python3-onnx).

    python3 python/examples/ppo.py --task pose --drive muscles --cpu-minutes 4 --out out/ppo
    python3 -m handsim.gym out/ppo/policy.onnx --out out/played

Writes curve.csv (steps, minutes, minutes of CPU time, success and return of the last 400 episodes or more), curve.png (with gnuplot), and
policy.onnx after every tenth update, which the second command plays. Time is CPU time, so that other work on the machine changes nothing.
--option gives an option of the task: --option persons=32 --option hands=2.
"""
import argparse
import json
import os
import shutil
import subprocess
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads would wait for one another between small products
import numpy as np
import onnx
from onnx import helper, numpy_helper

from handsim.gym import TASKS, Episodes
from handsim.gym.__main__ import options_of


class Net:
    """A perceptron with two hidden layers (tanh); Adam (Kingma & Ba 2014). All arrays are float32."""

    def __init__(self, sizes, last, random):
        self.weights = []
        for i, (a, b) in enumerate(zip(sizes, sizes[1:])):
            scale = last if i == len(sizes) - 2 else 1.0
            basis = np.linalg.qr(random.normal(size=(max(a, b), min(a, b))))[0]
            self.weights += [np.float32(scale * (basis if a >= b else basis.T)), np.zeros(b, np.float32)]
        self.moments = [(np.zeros_like(w), np.zeros_like(w)) for w in self.weights]
        self.updates = 0

    def __call__(self, x):
        self.layers = [x]
        for i in range(0, len(self.weights), 2):
            x = x @ self.weights[i] + self.weights[i + 1]
            if i < len(self.weights) - 2:
                x = np.tanh(x)
            self.layers.append(x)
        return x

    def gradients(self, slope):
        """Of the last call, where `slope` is the loss's by its outputs."""
        out = []
        for i in range(len(self.weights) - 2, -1, -2):
            out = [self.layers[i // 2].T @ slope, slope.sum(axis=0)] + out
            if i > 0:
                slope = (slope @ self.weights[i].T) * (1 - np.square(self.layers[i // 2]))
        return out

    def descend(self, gradients, rate, most=0.5):
        norm = np.sqrt(sum(float(np.square(g).sum()) for g in gradients))
        self.updates += 1
        step = rate * np.sqrt(1 - 0.999**self.updates) / (1 - 0.9**self.updates)
        for w, (m, v), g in zip(self.weights, self.moments, gradients):
            g = g * min(1.0, most / (norm + 1e-9))
            m += 0.1 * (g - m)
            v += 0.001 * (g * g - v)
            w -= np.float32(step) * m / (np.sqrt(v) + 1e-8)


class Policy:
    """Gaussian actions about a net's output, and a net for the value; observations are normalised."""

    def __init__(self, inputs, actions, start, deviation, hidden=(64, 64), random=np.random.default_rng(0)):
        self.actor = Net([inputs, *hidden, actions], 0.01, random)
        self.actor.weights[-1][:] = start
        self.critic = Net([inputs, *hidden, 1], 1.0, random)
        self.spread = Net([1, actions], 0, random)  # the logarithm of the deviation: a row of weights
        self.spread.weights[0][:] = np.log(deviation)
        self.count, self.mean, self.square = 1e-4, np.zeros(inputs), np.ones(inputs)

    def see(self, observation):
        share = len(observation) / (self.count + len(observation))
        self.mean += share * (observation.mean(axis=0) - self.mean)
        self.square += share * (np.square(observation).mean(axis=0) - self.square)
        self.count += len(observation)

    def normal(self, observation):
        deviation = np.sqrt(np.maximum(self.square - self.mean**2, 1e-6))
        return np.float32(np.clip((observation - self.mean) / deviation, -5, 5))

    @property
    def log_deviation(self):
        return np.clip(self.spread.weights[0][0], -3, 0.5)

    def save(self, path, task, options):
        """The mean action as ONNX: observation (n, numbers) to action (n, actions); with the task, for `handsim.gym`."""
        scale = 1 / np.sqrt(np.maximum(self.square - self.mean**2, 1e-6))
        numbers = {"mean": self.mean, "scale": scale, "low": -5, "high": 5} | {f"w{i}": w for i, w in enumerate(self.actor.weights)}
        nodes = [helper.make_node("Sub", ["observation", "mean"], ["shifted"]),
                 helper.make_node("Mul", ["shifted", "scale"], ["scaled"]),
                 helper.make_node("Clip", ["scaled", "low", "high"], ["x0"])]
        for i in range(0, len(self.actor.weights), 2):
            last = i == len(self.actor.weights) - 2
            nodes.append(helper.make_node("Gemm", [f"x{i}", f"w{i}", f"w{i + 1}"], ["action" if last else f"y{i}"]))
            if not last:
                nodes.append(helper.make_node("Tanh", [f"y{i}"], [f"x{i + 2}"]))
        shaped = lambda name, size: helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, ["n", size])
        graph = helper.make_graph(nodes, "policy", [shaped("observation", len(self.mean))],
                                  [shaped("action", self.actor.weights[-1].size)],
                                  [numpy_helper.from_array(np.asarray(x, np.float32), name) for name, x in numbers.items()])
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
        helper.set_model_props(model, {"task": task, "options": json.dumps(options)})
        onnx.checker.check_model(model)
        path.write_bytes(model.SerializeToString())


def collect(episodes, policy, observation, options, random, ended):
    """Steps of all environments; new episodes begin by themselves. Appends (success, return) of episodes to `ended`."""
    rows = []
    for _ in range(options.horizon):
        policy.see(observation)
        x = policy.normal(observation)
        mean, value = policy.actor(x), policy.critic(x)[:, 0]
        # Noise that lasts moves a hand further than noise that turns about in every step.
        fresh = np.float32(random.normal(size=mean.shape))
        noise = fresh if collect.noise is None else options.lasting * collect.noise + np.sqrt(1 - options.lasting**2) * fresh
        collect.noise = noise = np.float32(noise)
        action = mean + np.exp(policy.log_deviation) * noise
        after, reward, terminated, truncated = episodes.step(action)
        collect.total += reward
        # A truncated episode would have gone on: its last value stands for the rest.
        rest = np.where(truncated, policy.critic(policy.normal(after))[:, 0], 0)
        over = terminated | truncated
        rows.append((x, action, -0.5 * np.square(noise).sum(axis=1) - policy.log_deviation.sum(), value, options.scale * reward, over, rest))
        observation = after
        if over.any():
            # An episode that is lost is terminated, too: the task says which are a success, if it has any.
            won = episodes.task.succeeded(episodes.batch)
            ended += zip((over & (False if won is None else won) & ~episodes.batch.failed)[over], collect.total[over])
            collect.total[over] = 0
            observation = episodes.reset(over)
    return [np.array(column) for column in zip(*rows)], observation


def advantages(value, reward, over, rest, last, discount, decay):
    """Generalised advantage estimation (Schulman et al. 2015, arXiv:1506.02438), shape as value."""
    out, ahead = np.zeros_like(value), np.zeros_like(last)
    for t in range(len(value) - 1, -1, -1):
        next_value = np.where(over[t], rest[t], last if t == len(value) - 1 else value[t + 1])
        ahead = reward[t] + discount * next_value - value[t] + discount * decay * np.where(over[t], 0, ahead)
        out[t] = ahead
    return out


def improve(policy, x, action, chance, advantage, target, rate, random, epochs, rows, clip=0.2, bound=0.3):
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    for _ in range(epochs):
        order = random.permutation(len(x))
        for first in range(0, len(x), rows):
            i = order[first:first + rows]
            mean, spread = policy.actor(x[i]), policy.log_deviation
            z = (action[i] - mean) / np.exp(spread)
            ratio = np.exp(np.clip(-0.5 * np.square(z).sum(axis=1) - spread.sum() - chance[i], -20, 20))
            acts = ~((advantage[i] > 0) & (ratio > 1 + clip) | (advantage[i] < 0) & (ratio < 1 - clip))
            slope = np.float32(-(advantage[i] * ratio * acts) / len(i))[:, None]
            # Beyond 1 an action changes nothing more, and noise that does not come back from there teaches nothing.
            beyond = np.float32(bound / len(i)) * (mean - np.clip(mean, -1, 1))
            policy.actor.descend(policy.actor.gradients(slope * z / np.exp(spread) + beyond), rate)
            of_spread = (slope * (np.square(z) - 1)).sum(axis=0)
            policy.spread.descend([of_spread[None], 0 * of_spread], rate)
            value = policy.critic(x[i])[:, 0]
            policy.critic.descend(policy.critic.gradients(np.float32((value - target[i]) / len(i))[:, None]), rate)


def learn(options, folder, episodes, of_task, clock=time.process_time):
    """Until the clock, CPU time in seconds, has gone on by the options' minutes, or the last episodes are a success."""
    random = np.random.default_rng(options.seed)
    observation = episodes.reset(seed=options.seed)
    # Episodes of different ages, so that they do not all end together.
    episodes.steps[:] = random.integers(episodes.task.max_steps, size=options.environments)
    # Muscles that all pull a little close a fist against its stops, where noise moves nothing: begin with muscles at rest.
    start, deviation = (-0.6, 0.37) if options.drive == "muscles" else (0, options.deviation)
    policy = Policy(observation.shape[1], episodes.task.actions, start, deviation, random=random)
    collect.total, collect.noise = np.zeros(options.environments), None
    start, begun, rows, ended, steps = time.perf_counter(), clock(), [], [], 0
    while (minutes := (clock() - begun) / 60) < options.cpu_minutes:
        columns, observation = collect(episodes, policy, observation, options, random, ended)
        x, action, chance, value, reward, over, rest = columns
        last = policy.critic(policy.normal(observation))[:, 0]
        gain = advantages(value, reward, over, rest, last, options.discount, 0.95)
        flat = [np.reshape(column, (-1, *np.shape(column)[2:])) for column in (x, action, chance, gain, gain + value)]
        improve(policy, *flat, options.rate * (1 - minutes / options.cpu_minutes), random, options.epochs, options.rows)
        steps += chance.size
        ended = ended[-max(400, options.environments):]
        success, total = np.mean(ended, axis=0) if ended else (0, 0)
        rows.append([steps, (time.perf_counter() - start) / 60, (clock() - begun) / 60, success, total])
        if len(rows) % 10 == 0:
            print(f"{steps / 1e6:6.2f} M steps, {rows[-1][2]:5.2f} min of CPU time: success {success:5.1%}, return {total:7.2f}, "
                  f"deviation {np.exp(policy.log_deviation).mean():.2f}", flush=True)
            policy.save(folder / "policy.onnx", options.task, of_task)
        if len(ended) >= 400 and success >= options.until:
            break
    policy.save(folder / "policy.onnx", options.task, of_task)
    np.savetxt(folder / "curve.csv", rows, "%.5g", ",", header="steps,time[min],cpu[min],success,return", comments="")
    draw_curve(folder, f"{options.task}, driven by {options.drive}")
    return rows


def draw_curve(folder, title):
    """curve.png of curve.csv, by gnuplot."""
    if not shutil.which("gnuplot"):
        return print("no curve.png: gnuplot is not installed")
    commands = (f"set terminal pngcairo size 1000,400; set output '{folder / 'curve.png'}'; set datafile separator ','; "
                f"set multiplot layout 1,2 title '{title}' noenhanced; set ylabel 'episodes with success [%]'; set yrange [0:100]; "
                "set y2label 'return'; set ytics nomirror; set y2tics; set grid; set key bottom right; ")
    for over, column in (("steps [million]", "($1/1e6)"), ("CPU time [min]", "3")):
        commands += (f"set xlabel '{over}'; plot '{folder / 'curve.csv'}' every ::1 using {column}:(100*$4) with lines lw 2 title 'success', "
                     f"'' every ::1 using {column}:5 axes x1y2 with lines title 'return'; ")
    subprocess.run(["gnuplot", "-e", commands], check=True)


def parsed(words=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="pose", choices=TASKS)
    parser.add_argument("--drive", default="muscles", choices=("targets", "torques", "muscles"))
    parser.add_argument("--out", type=Path, default=Path("out/ppo"))
    parser.add_argument("--option", action="append", default=[], help="key=value of the task")
    parser.add_argument("--cpu-minutes", type=float, default=10)
    parser.add_argument("--until", type=float, default=2, help="share of the last 400 episodes, or more, with success that ends it before")
    parser.add_argument("--deviation", type=float, default=0.6, help="of the actions at the beginning; 0.37 by muscles")
    parser.add_argument("--environments", type=int, default=512)
    parser.add_argument("--horizon", type=int, default=16, help="steps of each environment between two updates")
    parser.add_argument("--epochs", type=int, default=3)
    parser.add_argument("--rows", type=int, default=2048, help="samples of one gradient")
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--scale", type=float, default=0.1, help="of the reward")
    parser.add_argument("--discount", type=float, default=0.97)
    parser.add_argument("--lasting", type=float, default=0.7, help="share of a step's noise that is the last step's")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(words)


if __name__ == "__main__":
    options = parsed()
    of_task = {"drive": options.drive, **options_of(options.option)}
    options.out.mkdir(parents=True, exist_ok=True)
    learn(options, options.out, Episodes(TASKS[options.task](**of_task), options.environments, seed=options.seed), of_task)
