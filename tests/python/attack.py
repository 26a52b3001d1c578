"""Calls of the package with arguments that are wrong in one or two places, in child processes.

    python3 tests/python/attack.py --count 5000 --seed 1

Each case is a function of its number. What is a finding: a crash or a hang of the process, another exception than
handsim.Error, TypeError, MemoryError or OSError, an error of kind input after which a simulation has moved, and a state that is
not finite. Of a command: any exception, another exit status than 0, 1 and 2, a failure without a sentence, and a file that is left half-written.
"""
import argparse
import contextlib
import copy
import faulthandler
import io
import json
import os
import pathlib
import pickle
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import warnings
from importlib import import_module

import numpy as np

import handsim as hs
from handsim import _core
from handsim.__main__ import COMMANDS
from handsim.identify import identify

ALLOWED = (hs.Error, TypeError, MemoryError, OSError)
MANY = ("substeps", "count", "n", "repeats", "draws", "frames")  # right, and long, where they are large
SECONDS = 60
CHUNK = 100


class Strange:
    """Raises, lies or changes its owner when numpy or Python asks it for a value."""

    def __init__(self, owner, what):
        self.owner, self.what = owner, what

    def __array__(self, dtype=None, copy=None):
        if self.what == "raise":
            raise hs.Error("strange")
        if isinstance(self.owner, dict):
            self.owner.clear()
        return np.zeros(3) if self.what == "array" else np.array("text")

    def __index__(self):
        if self.what == "raise":
            raise TypeError("strange")
        return -7

    __float__ = lambda self: float("nan")  # noqa: E731


NUMBERS = [0, -1, 1, 2, 7, 2**31 - 1, 2**31, -2**31 - 1, 2**63, 2**64, 10**400, 0.5, 1.5, -1.5, float("nan"), float("inf"),
           -float("inf"), 1e308, -1e308, 1e-320, np.float32(1), np.int8(-3), np.uint64(2**64 - 1), True, 1j]
TEXTS = ["", "q", "high", "ball", "a\0b", "é" * 3000, "../../..", "/dev/null", "solver.step", "{", "nan", b"bytes", "\ud800"]


def wrong(chance, owner=None):
    """Something that no argument is."""
    return chance.choice([lambda: None, lambda: chance.choice(NUMBERS), lambda: chance.choice(TEXTS), list, dict, set, tuple,
                          object, lambda: Strange(owner, chance.choice(["raise", "array", "text"])), lambda: [[1, 2], [3]],
                          lambda: {"a": {1: None}}, lambda: (x for x in range(3)), lambda: np.zeros(0),
                          lambda: np.array(3.0), lambda: pathlib.Path("nowhere"), lambda: print, lambda: hs.Scene,
                          lambda: np.zeros(5, [("x", float)]), lambda: [chance.choice(NUMBERS)] * 3,
                          lambda: memoryview(b"abc"), lambda: np.ma.masked_all(3)])()


def mutated(chance, value, depth=0):
    """A value that is wrong in one place; arrays also in ways that are right (strides, byte order, read-only)."""
    if isinstance(value, np.ndarray) and chance.random() < 0.8:
        return wrong_array(chance, value.copy())
    if isinstance(value, dict) and value and chance.random() < 0.8 and depth < 6:
        out = dict(value)
        key = chance.choice(list(out))
        kind = chance.randrange(6)
        if kind == 0:
            del out[key]
        elif kind == 1:
            out[wrong_key(chance)] = out.pop(key)
        elif kind == 2:
            out[wrong_key(chance)] = wrong(chance, out)
        else:
            out[key] = mutated(chance, out[key], depth + 1)
        return out
    if isinstance(value, (list, tuple)) and value and chance.random() < 0.7 and depth < 6:
        out = list(value)
        at = chance.randrange(len(out))
        kind = chance.randrange(5)
        if kind == 0:
            del out[at]
        elif kind == 1:
            out.insert(at, wrong(chance))
        else:
            out[at] = mutated(chance, out[at], depth + 1)
        return type(value)(out)
    if isinstance(value, bytes) and value and chance.random() < 0.9:
        out = bytearray(value)
        for _ in range(chance.choice([1, 1, 3, 50])):
            out[chance.randrange(len(out))] = chance.randrange(256)
        return bytes(out[:chance.choice([len(out), chance.randrange(len(out))])])
    if isinstance(value, (int, float)) and chance.random() < 0.6:
        return chance.choice(NUMBERS)
    return wrong(chance)


def wrong_key(chance):
    return chance.choice(["nonsense", "", 1, None, ("a", 1), "title", "a.b", b"x", float("nan")])


def wrong_array(chance, array):
    flat = array.reshape(-1)
    if flat.dtype == float and flat.size and chance.random() < 0.5:
        flat[chance.randrange(flat.size)] = chance.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320, 1e6, -1e6, 20])
        return array
    wide = np.zeros((*array.shape, 2), array.dtype)
    wide[..., 0] = array
    return chance.choice([
        lambda: array[..., None], lambda: array[None], lambda: flat, lambda: flat[:-1], lambda: np.append(flat, flat),
        lambda: array.T, lambda: np.asfortranarray(array), lambda: wide[..., 0], lambda: array[::-1], lambda: array[:0],
        lambda: np.broadcast_to(flat[:1] if flat.size else np.zeros(1), array.shape),
        lambda: np.broadcast_to(np.zeros(1, array.dtype), (2**40, 3)), lambda: array.astype(">f8"),
        lambda: array.astype("f2"), lambda: array.astype(complex), lambda: array.astype(bool), lambda: array.astype(object),
        lambda: array.astype(str), lambda: array.astype("u8"), lambda: array.astype(np.longdouble),
        lambda: array.astype("M8[s]"), lambda: array.view(np.matrix) if array.ndim < 3 else array,
        lambda: np.ma.masked_array(array, True), lambda: array.tolist(), lambda: memoryview(array),
        lambda: array.astype("V8"), lambda: readonly(array), lambda: array + 1j * np.nan])()


WORDS = ["", "-", "--", "--out", "--set", "--nose", "=", "a=b", "nowhere", "..", "/", "/dev/null", "/dev/full", "/proc/self/mem", "\u00e9" * 200, "n" * 300, "nan", "-1", "1e400", "*", "[", "{}",
         "objects.0.mass=nan", "objects.0.mass=1e309", "objects.0.nose=1", "solver.step=0.001", "duration=-1", "m=0", "--time=nan", "--fps=1e9", "--help", "\n", "'", '"', "%s", "~"]


def wrong_words(chance, words):
    out, at = list(words), chance.randrange(len(words))
    kind = chance.randrange(5)
    if kind == 0:
        del out[at]
    elif kind == 1:
        out.insert(at, chance.choice(WORDS))
    elif kind == 2:
        out[at] += chance.choice(WORDS)
    elif kind == 3:
        out.append(out[at])
    else:
        out[at] = chance.choice(WORDS)
    return out or ["--help"]


def wrong_bytes(chance, content):
    """A file that is cut, has other bytes, other numbers or lines, or grows."""
    kind = chance.randrange(6)
    lines = content.split(b"\n")
    if kind == 0:
        return content[:chance.randrange(len(content) + 1)]
    if kind == 1:
        return b"\n".join(chance.sample(lines, chance.randint(0, len(lines))))
    if kind == 2:
        word = chance.choice([b"nan", b"inf", b"-1e400", b"null", b"[]", b"{}", b"\xff\xfe", b"\0", b"&a [*a]", b"!!python/object:os.system x", b"1" * 400, b"~", b"true", b'"', b"'"])
        parts = re.split(rb"([-0-9.]+)", content)
        at = chance.randrange(len(parts))
        return b"".join([*parts[:at], word, *parts[at + 1:]])
    if kind == 3:
        out = bytearray(content or b"x")
        for _ in range(chance.choice([1, 1, 3, 50])):
            out[chance.randrange(len(out))] = chance.randrange(256)
        return bytes(out)
    if kind == 4:
        return b"\xef\xbb\xbf" + content
    return content + chance.choice([b"\n" + lines[0], b"\n,,,", b"\n- [", b"\n" * 1000, bytes(1000)])


def readonly(array):
    array.flags.writeable = False
    return array


BALLS = {
    "title": "balls", "ground": {"height": 0}, "duration": 0.02,
    "objects": [{"name": "low", "shape": "sphere", "radius": 0.03, "mass": 0.1, "position": [0, 0, 0.03]},
                {"name": "high", "shape": "sphere", "radius": 0.03, "mass": 0.2, "position": [0.2, 0, 9]}],
    "effects": ["gravity", "ground_contact", "friction"], "solver": {"engine": "articulated", "step": 0.001}}


class World:
    """What the calls are made on."""

    def __init__(self, videos):
        self.videos = videos
        self.folder = tempfile.TemporaryDirectory()
        here = pathlib.Path(self.folder.name)
        self.scenes = [hs.load(BALLS), hs.load({**BALLS, "solver": {"engine": "ode", "step": 0.001}}),
                       hs.load("grasp_power_can", engine="articulated"), hs.load("grasp_power_can", engine="ode"),
                       hs.load("muscle_poses", engine="articulated"), hs.load("slider_crank_iftomm", engine="dae")]
        self.simulations = [hs.Simulation(scene, watch=k % 2 == 0) for k, scene in enumerate(self.scenes)]
        self.batches = [hs.Batch(scene, 3, threads=2) for scene in self.scenes[:5]]
        self.path = here / "out"
        self.bound = [each for each in vars(_core).values() if isinstance(each, type)]
        picture = np.zeros((4, 5, 3), np.uint8)
        self.pure = [
            (hs.load, {"source": BALLS, "overrides": {"objects.0.mass": 0.2, "solver.step": "2 ms"}, "engine": "ode"}),
            (hs.Hand, {"stature": 1.75, "mass": 72.0, "sex": "male", "side": "left", "model": "anatomical", "muscles": False,
                       "hand_length": 0.19, "age": 30.0}),
            (hs.png, {"picture": picture}), (hs.save_png, {"picture": picture, "path": here / "p.png"}),
            (hs.contact_sheet, {"pictures": [picture, picture], "captions": ["a", "b"], "title": "t", "width": 200}),
            (hs.save_video, {"pictures": [picture], "path": here / "v.gif", "fps": 20.0}),
            (hs.report, {"folder": here, "other": None, "out": here / "r.html"}),
            (hs.study.rollouts, {"study": "nowhere", "count": 2, "seed": 1, "threads": 1, "overrides": {"a": 1}, "client": None}),
            (hs.study.effects, {"scene": "nowhere", "repeats": 1}),
            (hs.study.grasps, {"scenes": ["nowhere"], "sides": ["left"], "friction": 0.5}),
            (hs.study.accuracy, {"study": "nowhere", "out": here}),
            (hs.study.track, {"recording": here / "none.csv", "person": here, "noise": 0.1, "seed": 1}),
            (hs.study.inverse, {"scene": self.scenes[0], "motion": here / "none.csv", "cutoff": 6.0, "clamp": True}),
            (hs.study.read_csv, {"path": here / "none.csv"}),
            (hs.gym.Episodes, {"task": hs.gym.SceneTask(self.scenes[0], lambda batch: np.zeros(len(batch))), "n": 2, "seed": 1,
                               "threads": 1})]
        self.hand = hs.Hand(1.75, 72)
        self.small = hs.load({**BALLS, "solver": {"engine": "articulated", "step": 0.002}, "duration": 0.02})
        (here / "balls.yaml").write_text(json.dumps({**BALLS, "record": {"every": 0.004}}))
        self.small.run(here / "run", frames=0)
        (here / "reach.csv").write_text("time[s],low.x[m],low.force.z[N]\n0,0,1\n0.004,0,1\n0.01,0,1\n")
        (here / "goal.yaml").write_text("actions: torques\nof: ['right.index_*']\nhold: 10 ms\nduration: 20 ms\ntouch: [[a, b]]\n"
                                        "costs:\n  - {angle: right.index_pip.flexion, is: 0.01, at: 20 ms, weight: 100}\n")
        (here / "points.c3d").write_bytes(bytes([2, 0x50]) + bytes(2000))

    def calls(self, chance):
        """A function and its right arguments, by name; the simulation that it changes, or None."""
        kind = chance.randrange(16)
        if kind >= 14:
            return self.of_command(chance)
        if kind >= 12:
            return self.of_gradients(chance)
        if kind < 4:
            return self.of_simulation(chance)
        if kind < 7:
            return self.of_batch(chance)
        if kind < 8:
            return self.of_bound(chance)
        if kind < 10:
            return self.of_scene(chance)
        return (*chance.choice(self.pure), None)

    def of_gradients(self, chance):
        simulation = hs.Simulation(self.small)
        rows, batch = np.zeros((3, 0)), hs.Batch(self.small, 2, threads=1)
        run = hs.Rollout(simulation, rows)
        size = run._measured()
        calls = [
            (hs.Rollout, {"simulation": simulation, "actions": rows, "kind": "torques", "every": 2, "keep": True, "smoothing": None}),
            (run.vjp, {"end": np.ones(size), "along": np.ones((3, size))}), (run.jvp, {"start": np.ones(size), "actions": rows}),
            (run.sensitivities, {"parameters": simulation.parameters({"gravity": None})}),
            (simulation.parameters, {"numbers": {"objects.0.mass": 0.1, "gravity": None}}),
            (simulation.derivatives, {"torques": np.zeros(0), "forces": {"high": np.ones(3)}, "bodies": ["high"], "advance": True, "smoothing": 1e-4}),
            (simulation.derivatives, {"smoothing": hs.Smoothing(1e-4, 2, 1)}),
            (lambda **given: simulation.derivatives(smoothing=hs.Smoothing(**given)), {"deviation": 1e-4, "pairs": 2, "seed": 1}),
            (batch.vjp, {"actions": np.zeros((2, 3, 0)), "end": np.ones((2, size)), "kind": "torques", "every": 1}),
            (batch.jvp, {"actions": np.zeros((2, 3, 0)), "start": np.ones((2, size)), "changes": np.zeros((2, 3, 0)), "kind": "torques"}),
            (batch.replace, {"environment": 1, "scene": self.small}),
            (identify, {"scene": self.small, "numbers": {"objects.0.mass": 0.1}, "actions": rows, "recorded": {"high.shift.z": np.array([9.0, 9, 9])},
                        "deviation": 1e-3, "kind": "torques", "times": np.array([0.002, 0.004, 0.006]), "most": 2}),
            (hs.draw_persons, {"count": 3, "population": "ansur2", "seed": 1}), (hs.study.read_sto, {"path": self.path}), (hs.study.read_h5, {"path": self.path, "name": "rollouts"}),
            (hs.study.uncertain, {"scene": "nowhere", "count": 2, "threads": 1}), (hs.study.validate, {"measurements": self.path, "uncertain": 2}),
            (hs.gym.Pose, {"drive": "targets", "hands": 3, "persons": 2}), (hs.gym.SceneTask, {"scene": self.small, "reward": 5, "terminated": 5}),
            (self.hand.position, {"q": np.zeros(len(self.hand.coordinates)), "point": ("index_distal", np.zeros(3))}),
            (self.hand.inverse_dynamics, {key: np.zeros(len(self.hand.coordinates)) for key in "qua"}), (self.hand.mesh, {"q": np.zeros(len(self.hand.coordinates))}),
            (self.hand.to_glb, {"q": np.zeros((2, len(self.hand.coordinates))), "times": np.array([0.0, 1])}), (self.hand.jacobian, {"q": np.zeros(20), "point": "index_tip"})]
        return (*chance.choice(calls), None)

    def of_command(self, chance):
        """A command whose words, or one of whose files, are wrong in some places."""
        here = pathlib.Path(self.folder.name)
        out = here / "made"
        commands = {
            "identify": ["here/reach.csv", "--scene", "here/balls.yaml", "--free", "objects.0.mass=0.1", "--out", "here/made", "--deviation", "m=1e-3", "--columns", "low.*",
                         "--set", "duration=0.02"],
            "optimise": ["reach", "--goal", "here/goal.yaml", "--out", "here/made", "--iterations", "1", "--no-run", "--quiet"],
            "export": ["here/balls.yaml", "--out", "here/made/a." + chance.choice(["obj", "stl", "usda", "glb"]), "--time", "0.002", "--set", "duration=0.004", "--hands", "shapes"],
            "compare": ["here/balls.yaml", "here/balls.yaml", "--set", "hands.0.strength=0.5", "--out", "here/made"],
            "track": ["here/points.c3d", "--names", "here/reach.csv", "--up", "y", "--out", "here/made"]}
        name = chance.choice(list(commands))
        words = [word.replace("here", str(here)) for word in commands[name]]
        files = [path for path in (here / "reach.csv", here / "balls.yaml", here / "goal.yaml", here / "points.c3d") if any(str(path) in word for word in words)]
        if chance.random() < 0.5:
            for _ in range(chance.choice([1, 1, 2])):
                words = wrong_words(chance, words)
            changed = None
        else:
            changed = chance.choice(files)

        def run(words, content):
            before = changed.read_bytes() if changed else b""
            out.mkdir(exist_ok=True)
            said, told = io.StringIO(), io.StringIO()
            try:
                if changed:
                    changed.write_bytes(content)
                with contextlib.redirect_stderr(said), contextlib.redirect_stdout(told):
                    status = import_module(COMMANDS[name]).main(words)
            except SystemExit as end:  # of argparse's --help
                status = end.code or 0
            finally:
                if changed:
                    changed.write_bytes(before)
            wrong = [path.name for path in out.rglob("*") if ".part" in path.name]
            shutil.rmtree(out, ignore_errors=True)
            # The program's own export and track write to the descriptor.
            if status not in (0, 1, 2) or wrong or status and name not in ("track", "export") and not (said.getvalue() + told.getvalue()).strip():
                raise AssertionError(f"status {status}, left {wrong}, said {said.getvalue()[:200]}")
            raise TypeError("as it should")  # for the count: no state is compared
        content = wrong_bytes(chance, changed.read_bytes()) if changed else b""
        return (lambda **given: run(words, content)), {f"{name} {' '.join(words)} {changed and changed.name} {content[:300]!r}": 0}, None

    def of_simulation(self, chance):
        simulation = chance.choice(self.simulations)
        scene, normal = simulation.scene, np.random.default_rng(chance.randrange(1000)).normal
        n = len(scene.coordinates)
        name = chance.choice(["step", "step", "step", "reset", "restore", "draw", "new", "core_step", "to"])
        action = {"torques": 1e-3 * normal(size=n), "targets": 0.1 * normal(size=len(scene.axes)),
                  "wrists": np.tile([0, 0, 0.3, 1, 0, 0, 0.0], (len(scene.wrists), 1)),
                  "forces": {scene.bodies[-1]: 1e-3 * normal(size=chance.choice([3, 6]))}, "substeps": 3}
        if name == "step":
            return simulation.step, some(chance, action), simulation
        if name == "core_step":
            return simulation._core.step, action, simulation
        if name == "reset":
            return simulation.reset, {"q": 0.01 + 0 * simulation.q, "u": 0.1 * normal(size=n)}, simulation
        if name == "to":
            return simulation.reset, {"to": simulation.motion()}, simulation
        if name == "restore":
            return lambda snapshot: simulation.restore(unpickled(snapshot)), {
                "snapshot": pickle.dumps(simulation.snapshot())}, simulation
        if name == "draw":
            return simulation.draw, picture_options(chance), None
        return hs.Simulation, {"scene": BALLS, "overrides": {"solver.step": 0.001}, "watch": True, "contact_forces": True}, None

    def of_batch(self, chance):
        batch = chance.choice(self.batches)
        scene, n = batch.scene, len(batch)
        name = chance.choice(["step", "step", "reset", "set", "get", "frame", "motion", "failure", "new", "draw", "part",
                              "columns_of", "repeat"])
        action = {"torques": np.full((n, len(scene.coordinates)), 1e-3), "targets": np.zeros((n, len(scene.axes))),
                  "wrists": np.tile([0, 0, 0.3, 1, 0, 0, 0.0], (n, len(scene.wrists), 1)),
                  "forces": {scene.bodies[-1]: np.full((n, chance.choice([3, 6])), 1e-3)}, "substeps": 3}
        calls = {
            "step": (batch.step, some(chance, action)),
            "repeat": (batch._core.repeat, {"torques": action["torques"], "substeps": 2, "count": 2}),
            "reset": (batch.reset, some(chance, {"mask": np.array([True, False, True]), "seed": 3, "seeds": np.arange(n),
                                                 "to": batch.motion(0) if batch.failure(0) is None else None})),
            "set": (batch.set, {"name": chance.choice(["gravity", "objects.0.mass", "q", "gains"]), "values": np.full(n, 0.1)}),
            "get": (batch.get, {"name": "gravity"}), "frame": (batch.frame, {"environment": 1}),
            "motion": (batch.motion, {"environment": 1}), "failure": (batch.failure, {"environment": 1}),
            "draw": (batch.draw, {"environment": 1, **picture_options(chance)}), "part": (batch.__getitem__, {"part": "q"}),
            "columns_of": (batch.columns_of, {"part": "q"}),
            "new": (hs.Batch, {"scene": BALLS, "n": 2, "observe": ["q", "objects"], "seed": 1, "threads": 1, "watch": False,
                               "randomise": {"objects.0.mass": ("uniform", 0.1, 0.2), "gravity": ("normal", 0.0, 1.0)}})}
        return (*calls[name], None)

    def of_bound(self, chance):
        """Objects of the C++ classes made in other ways than by their functions."""
        kind = chance.choice(self.bound)
        core = self.simulations[0]._core
        ways = [lambda value: kind.__new__(kind), lambda value: kind(value), lambda value: object.__new__(kind),
                lambda value: kind.__base__.__new__(kind), lambda value: type("Own", (kind,), {})(value),
                lambda value: core.restore(value), lambda value: core.reset_to_motion(value),
                lambda value: core.__init__(value), lambda value: core.__setstate__(value),
                lambda value: _core.draw(self.scenes[0]._core, [value], None, None, None),
                lambda value: _core.snapshot(value), lambda value: _core.simulation(value, True, True),
                lambda value: copy.copy(core), lambda value: pickle.dumps(chance.choice([core, value])),
                lambda value: copy.deepcopy(core.snapshot()), lambda value: _core.hand_segments(self.scenes[0]._core)]
        return self.without_attribute(chance.choice(ways)), {"value": core.snapshot()}, None

    @staticmethod
    def without_attribute(call):
        def run(value):
            try:
                return call(value)
            except AttributeError as error:
                raise TypeError(str(error)) from None
            except pickle.PicklingError as error:
                raise TypeError(str(error)) from None
        return run

    def of_scene(self, chance):
        scene = self.scenes[chance.randrange(2)]
        calls = [(scene.run, {"frames": 2, "stop_lost": False, "progress": lambda share: None}),
                 (scene.run, {"out": self.path, "frames": 0, "poses": False, "plots": False}),
                 (scene.draw, {"time": 0.01, **picture_options(chance)}),
                 (scene.video, {"path": self.path.with_suffix(".gif"), "time": 0.002, "fps": 20.0, "speed": 1.0,
                                **picture_options(chance)}),
                 (scene.draw_frames, {"frames": [self.simulations[0].frame()], **picture_options(chance)}),
                 (_core.Scene.load, {"path": "nowhere", "overrides": ["a=b"]}),
                 (_core.Scene.parse, {"text": "{title: a}", "name": "scene", "overrides": ["solver.step=1 ms"]}),
                 (self.hand.draw, picture_options(chance))]
        if not self.videos:
            del calls[3]
        return (*chance.choice(calls), None)


def unpickled(data):
    """A pickle's own errors are Python's."""
    if not isinstance(data, bytes):
        return data
    try:
        out = pickle.loads(data)
    except hs.Error:
        raise
    except Exception as error:
        raise TypeError(str(error)) from None
    return out


def some(chance, arguments):
    """One to all of them."""
    keys = chance.sample(list(arguments), chance.randint(1, len(arguments)))
    return {key: arguments[key] for key in keys}


def picture_options(chance):
    return {"size": (32, 24), **chance.choice([{"view": "dorsal"}, {"camera": ([0.0, 0.5, 0.3], [0.0, 0.0, 0.2], 0.5)}])}


def finite(simulation):
    return all(np.isfinite(part).all() for part in (simulation.q, simulation.u, *simulation.bodies))


def state_of(simulation):
    return np.concatenate([np.ravel(part) for part in (simulation.q, simulation.u, *simulation.bodies)])


def in_threads(world, chance):
    """Readers beside a thread that steps and resets."""
    simulation, batch = chance.choice(world.simulations), chance.choice(world.batches)
    faults = []
    work = [lambda: simulation.step(substeps=5), simulation.reset, lambda: simulation.contacts, lambda: simulation.bodies,
            lambda: simulation.restore(simulation.snapshot()), lambda: simulation.reset(simulation.motion()),
            lambda: simulation.frame(), lambda: simulation.verdicts, lambda: simulation.q.copy(), lambda: batch.frame(1),
            lambda: batch.step(substeps=3), batch.reset, lambda: batch.get("gravity"), lambda: batch.motion(0),
            lambda: batch.set("gravity", np.zeros((3, 3))), lambda: batch.q.copy(), lambda: batch.failure(2)]

    def loop(calls):
        for call in calls:
            try:
                call()
            except ALLOWED:
                pass
            except BaseException as error:
                faults.append(error)

    threads = [threading.Thread(target=loop, args=([chance.choice(work) for _ in range(30)],)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if faults:
        raise faults[0]


def one_case(world, number):
    """:returns: what is wrong, or None"""
    chance = random.Random(number)
    if chance.random() < 0.04:
        try:
            in_threads(world, chance)
        except BaseException as error:
            return f"threads: {type(error).__name__}: {error}"
        return None
    call, arguments, simulation = world.calls(chance)
    arguments = dict(arguments)
    for key in () if " " in next(iter(arguments)) else chance.sample(list(arguments), min(len(arguments), chance.choice([1, 1, 1, 2]))):
        arguments[key] = mutated(chance, arguments[key])
        if key in MANY and isinstance(arguments[key], int) and 1000 < arguments[key] < 2**63:
            arguments[key] = 1000
    text = f"{getattr(call, '__qualname__', call)}({', '.join(f'{k}={v!r:.300}' for k, v in arguments.items())})"
    print(f"case {number}: {text!a:.1500}", flush=True)
    before = None if simulation is None else state_of(simulation)
    try:
        call(**arguments)
    except ALLOWED as error:
        if simulation is not None:
            input_error = not isinstance(error, hs.Error) or error.kind == "input"
            after = state_of(simulation)
            if input_error and not np.array_equal(before, after):
                return f"moved by a refused call: {error}"
            if not input_error:
                simulation.reset()
                if not np.array_equal(state_of(simulation), state_of(hs.Simulation(simulation.scene))):
                    return f"another start after: {error}"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    if simulation is not None and not finite(simulation):
        simulation.reset()
        return "a state that is not finite"
    return None


def child(first, last):
    faulthandler.enable()
    # A parent that ignores Ctrl-C hands that on.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    os.chdir(tempfile.mkdtemp())
    world = World(videos=first >= 1_000_000)
    for number in range(first, last):
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        wrong_here = one_case(world, number)
        faulthandler.cancel_dump_traceback_later()
        if wrong_here:
            print(f"FOUND {number}: {wrong_here!a:.600}", flush=True)
    print("done", flush=True)


def attack(first, last):
    """Cases in child processes; a new one goes on behind a case that ends its process.

    :returns: findings as they are found, each with its case
    """
    while first < last:
        end = min(last, first + CHUNK)
        run = subprocess.run([sys.executable, __file__, "--child", str(first), str(end)], capture_output=True, text=True)
        cases = [line for line in run.stdout.splitlines() if line.startswith("case ")]
        yield from [f"{line}\n    {next((case for case in cases if case.startswith(f'case {line.split()[1]}')), '')}"
                  for line in run.stdout.splitlines() if line.startswith("FOUND")]
        if run.stdout.endswith("done\n"):
            first = end
            continue
        last_case = cases[-1] if cases else f"case {first}: none was begun"
        yield f"ended with status {run.returncode}: {last_case}\n{run.stderr[-1500:]}"
        first = int(last_case.split()[1].rstrip(":")) + 1


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="first case is seed times 1,000,000; "
                        "seed 0, which the test takes, makes no videos: ffmpeg and forks take long")
    parser.add_argument("--child", type=int, nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        return child(*arguments.child)
    first = 1_000_000 * arguments.seed
    found = 0
    for finding in attack(first, first + arguments.count):
        print(finding, flush=True)
        found += 1
    print(f"{arguments.count} cases, {found} findings")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
