#!/usr/bin/python3
"""Random sessions of handsim live, whose recordings must repeat to the bit.

random_sessions.py [--count 500] [--seed 1] [--only K]; with handsim on PYTHONPATH. Session K has a scene, a mode (stepped by the
test, or in real time by its thread) and inputs that follow from seed and K; in real time the steps at which they act do not.
Every command of `READERS` is drawn, frames of tracked hands and saving too. Oracle: `Replay` compares every hash of the state, for
the recording that is saved in the middle, and for the file that the end leaves.
"""
import argparse
import json
import pathlib
import random
import sys
import tempfile
import time

import handsim as hs
from handsim._live.commands import READERS, read_command
from handsim._live.replay import Replay
from handsim._live.saving import save
from handsim._live.session import Session
from handsim._live.streams import Follower

BALLS = {
    "title": "balls", "ground": {"height": 0}, "duration": "0.5 s",
    "objects": [{"name": "table", "shape": "box", "edges": [0.2, 0.2, 0.02], "static": True, "position": [0.5, 0, 0.01]},
                {"name": "low", "shape": "sphere", "radius": "30 mm", "mass": "100 g", "position": [0, 0, 0.03]},
                {"name": "high", "shape": "sphere", "radius": "30 mm", "mass": "200 g", "position": [0.2, 0, 0.4]}],
    "effects": ["gravity", "ground_contact", "friction"],
    "solver": {"engine": "articulated", "step": "1 ms"}}
SMOOTH = {**BALLS, "title": "falling balls", "effects": ["gravity"]}  # for engine dae
SCENES = [(BALLS, "articulated"), (BALLS, "ode"), (SMOOTH, "articulated"), ("two_hands", "articulated"), ("two_hands_contact", "articulated"),
          ("two_hands_contact", "ode"), ("grasp_power_can", "articulated"), ("stability/resting_capsule", "articulated"), ("muscle_poses", "articulated")]


def vector(draw, size, low, high):
    return [draw.uniform(low, high) for _ in range(size)]


def some(draw, **values):
    """Some of the keys of a command that may be left out."""
    return {key: value for key, value in values.items() if draw.random() < 0.6}


def spring(draw, facts, _):
    if draw.random() < 0.3:
        return {"id": draw.randrange(8), "release": True}
    return {"id": draw.randrange(8), "body": draw.randrange(1, len(facts.bodies)), "point": vector(draw, 3, -0.05, 0.05),
            "goal": vector(draw, 3, -0.5, 0.7), **some(draw, stiffness=10 ** draw.uniform(0, 4), force=draw.uniform(0, 50))}


def targets(draw, facts, _):
    if draw.random() < 0.2:
        return {"release": True}
    return {"values": vector(draw, len(facts.axes), -1.5, 1.5), **some(draw, time=draw.uniform(0, 1))}


def values(size, low, high):
    def of(draw, facts, _):
        scale = draw.choice([1e-3, 5e-3, 0.02, 0.02, 1.0])
        return {"release": True} if draw.random() < 0.2 else {"values": vector(draw, size(facts), scale * low, scale * high)}
    return of


def number(draw, facts, _):
    name = draw.choice(sorted(facts.numbers))
    value = {"gravity": lambda: vector(draw, 3, *draw.choice([(-10, 10)] * 5 + [(-100, 100)])), "mass": lambda: 10 ** draw.uniform(*draw.choice([(-1, 1), (-4, 2)]))}
    return {"name": name, "value": value.get(name.rpartition(".")[2], lambda: draw.uniform(0.1, 2))()}


def scene(draw, _, __):
    while True:
        out = some(draw, engine=draw.choice(["ode", "articulated", "articulated", "dae"]), stature=draw.uniform(1.5, 1.95), mass=draw.uniform(50, 100),
                   step=draw.choice([5e-4, 1e-3, 1e-3, 2e-3, 3e-3]))
        if out:
            return out


MESSAGES = {
    "play": lambda draw, _, __: {"on": draw.random() < 0.6},
    "step": lambda draw, _, __: some(draw, steps=draw.choice([1, 7, 250, 1000])),
    "speed": lambda draw, _, __: {"value": draw.choice([0.1, 0.5, 1, 2, 10])},
    "seek": lambda draw, _, time_: {"time": max(0.0, draw.choice([0, time_, time_ - draw.uniform(0, 0.1), draw.uniform(0, 2 * time_ + 0.1)]))},
    "present": lambda *_: {}, "reset": lambda *_: {},
    "spring": spring, "targets": targets, "number": number, "scene": scene,
    "push": lambda draw, facts, _: {"body": draw.randrange(1, len(facts.bodies)), "force": vector(draw, 3, *draw.choice([(-2, 2), (-50, 50)])), **some(draw, time=draw.uniform(1e-3, 0.3))},
    "pose": lambda draw, facts, _: {"name": draw.choice(sorted(facts.poses) or ["none"]), **some(draw, time=draw.uniform(0, 1))},
    "torques": values(lambda facts: len(facts.coordinates), -20, 20),
    "excitations": values(lambda facts: facts.muscles, 0, 1),
}
"""Of every command, a message that mostly fits: ``f(draw, facts, time)``."""
RARE = {"scene": 0.4, "reset": 0.5}
"""Shares of commands that take long, or take all away."""


class Random:
    """A session and what happens to it."""

    def __init__(self, seed, index, folder):
        self.draw = random.Random(f"{seed} {index}")
        source, engine = SCENES[index % len(SCENES)]
        self.timed = index // len(SCENES) % 3 == 2
        self.name = f"{index}: {source if isinstance(source, str) else source['title']}, {engine}, {'in real time' if self.timed else 'stepped'}"
        self.path = pathlib.Path(folder) / f"{index}.jsonl"
        self.session = Session(hs.load(source, engine=engine), self.path)
        self.done, self.checks, self.steps, self.failed = [], 0, 0, 0
        try:
            self.follower = Follower(self.session)
            self.follower.close()  # frames come of themselves
        except hs.Error:
            self.follower = None

    def run(self, inputs):
        self.session.start() if self.timed else self.session.log.begin()
        try:
            for _ in range(inputs):
                self.input()
                self.wait()
                if self.draw.random() < 0.04:
                    self.save()
            self.settle()
            self.save()
        finally:
            self.session.close()
        self.repeat(self.path)
        assert self.session.problem is None, self.session.problem

    def input(self):
        facts = self.session.facts
        names = [name for name in READERS if self.draw.random() < RARE.get(name, 1.0)] + ["frame"]
        name = self.draw.choice(names)
        self.done.append(name)
        try:
            if name == "frame":
                self.frame()
            else:
                self.session.send(read_command({"do": name, **MESSAGES[name](self.draw, facts, self.session.course.time)}, facts))
        except hs.Error as error:
            assert error.kind == "input"
            self.done[-1] += " (refused)"

    def frame(self):
        if self.follower is not None:
            hand = next(iter(self.follower._hands.values())).filter
            angles = [self.draw.uniform(low, high) for low, high in zip(hand._low, hand._high)]
            points = hand.points([*vector(self.draw, 3, -0.1, 0.4), 1, 0, 0, 0, *angles])
            self.follower.message({"t": time.monotonic(), "hands": {self.draw.choice(["right", "left"]): {"joints": points.tolist()}}})

    def wait(self):
        session = self.session
        if self.timed:
            time.sleep(self.draw.choice([0, 0.003, 0.03, 0.1]))
            return
        session._take()
        if self.draw.random() < 0.5:
            self.built()
        if session.playing:
            session._steps(self.draw.choice([1, 3, 40, 250, 400]))
        if self.draw.random() < 0.3:
            session._publish(time.monotonic())

    def built(self):
        """A scene that is under way is there."""
        while self.session._building is not None:
            self.session._building.join()
            self.session._take()

    def settle(self):
        if not self.timed:
            return self.built()
        while self.session._building is not None:
            time.sleep(0.01)

    def save(self):
        def saved(session):
            out = save(session, "recording")[1]
            for what in ("snapshot", "scene"):
                try:
                    save(session, what)
                except hs.Error:  # a motion that has failed, a scene whose task places an object
                    pass
            return out
        self.repeat(self.session.call(saved).result(60) if self.timed else saved(self.session))

    def repeat(self, recording):
        found = Replay(recording)
        found.run()
        found.files.close()
        self.checks += found.checks
        self.steps += found.course.tick
        self.failed += found.course.failed is not None
        # The end has a hash, unless the motion has failed there.
        assert found.end is not None or found.course.failed


def sessions(count, seed=1, inputs=40, only=None, report=None):
    """:returns: by session that does not repeat: why. And how often each command was given, and hashes compared"""
    wrong, given, checks = {}, {}, 0
    with tempfile.TemporaryDirectory() as folder:
        for index in range(count) if only is None else [only]:
            begin = time.monotonic()
            each = Random(seed, index, folder)
            try:
                each.run(inputs)
            except Exception as error:
                wrong[each.name] = f"{type(error).__name__}: {error}"
            checks += each.checks
            for name in each.done:
                given[name] = given.get(name, 0) + 1
            if report:
                report(f"{each.name}: {wrong.get(each.name, 'repeats')}; {each.checks} hashes, {each.steps} steps, failed at {each.failed} ends, {time.monotonic() - begin:.1f} s")
            each.path.unlink(missing_ok=True)
    return wrong, given, checks


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inputs", type=int, default=40)
    parser.add_argument("--only", type=int, help="this session alone")
    words = parser.parse_args()
    wrong, given, checks = sessions(words.count, words.seed, words.inputs, words.only, lambda text: print(text, flush=True))
    print(json.dumps(dict(sorted(given.items()))))
    print(f"{1 if words.only is not None else words.count} sessions, {sum(given.values())} inputs, {checks} hashes: {len(wrong)} do not repeat")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
