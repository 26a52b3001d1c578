"""Plays a policy in new episodes: python3 -m handsim.gym policy.onnx --out out/played

Prints the share of episodes that end with success. Writes played.mp4 of four of them (with ffmpeg), and for a task that
begins as its scene and is driven by targets or muscles alone, a run of the first with its report: played/report.html. Needs onnxruntime
(pip install onnxruntime), or onnx from 1.13 on.

The model takes observations, float32 of shape (n, numbers), and gives actions (n, actions). Its metadata `task` and `options`
(JSON), which python/examples/ppo.py writes, say the task; --task and --option replace them.
"""
from __future__ import annotations

import argparse
import inspect
import io
import json
import os
import shutil
import sys
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any, Callable

import numpy as np
from numpy.typing import NDArray

import handsim as hs

from .._errors import input_error
from .._files import OutputFolder, check_target, ended, write_file
from . import TASKS, Episodes, Task

Policy = Callable[[NDArray[np.float32]], Any]
"""Observations, shape (n, numbers), to actions, shape (n, actions)."""


def policy_of(path: Path) -> tuple[Policy, dict[str, str]]:
    """The model as a function, and its metadata."""
    try:
        onnxruntime: Any = import_module("onnxruntime")
        session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
        name = session.get_inputs()[0].name
        return lambda x: session.run(None, {name: x})[0], session.get_modelmeta().custom_metadata_map
    except ImportError:
        pass
    try:
        onnx: Any = import_module("onnx")
        reference: Any = import_module("onnx.reference")
    except ImportError:
        sys.exit("handsim.gym: a policy needs onnxruntime: pip install onnxruntime")
    model = onnx.load(str(path))
    run = reference.ReferenceEvaluator(model)
    return lambda x: run.run(None, {run.input_names[0]: x})[0], {each.key: each.value for each in model.metadata_props}


def answers(policy: Policy, path: Path) -> Policy:
    """The policy with errors that are handsim's, whatever the model's library raises."""
    def asked(observation: NDArray[np.float32]) -> Any:
        try:
            return np.asarray(policy(observation), dtype=float)
        except Exception as error:  # of another width of its input, or in one of its operators
            raise input_error(str(path), f"a model that fails on observations of shape {observation.shape} ({str(error).strip()[:300]})",
                              "a policy of this task") from None
    return asked


def loaded_again(scene: hs.Scene, folder: Path, given: dict[str, Any]) -> hs.Scene:
    """The scene from its own files, with other values."""
    for name, content in scene._core.standalone().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_file(folder / name, content)
    return hs.load(folder / "resolved.yaml", given)


def run_again(episodes: Episodes, driven: list[dict[str, Any]], out: Path) -> None:
    """The first environment's episode as a run of its scene with a report; each action was held for a step."""
    scene, step = episodes.batch.scene_of(0), episodes.task.scene.step * episodes.task.substeps
    muscles = "excitations" in driven[0]
    names = [muscle.name for muscle in scene.muscles] if muscles else [f"{name}[rad]" for name in scene.axes]
    # A step takes what a table has at its end.
    times = np.sort(np.concatenate([np.arange(len(driven)) * step + 2e-9, np.arange(1, len(driven) + 1) * step + 1e-9]))
    rows = np.repeat([next(iter(each.values()))[0] for each in driven], 2, axis=0)
    table = (out / "actions.csv").resolve()
    text = io.StringIO()
    np.savetxt(text, np.column_stack([times, rows]), "%.17g", ",", header=",".join(["time[s]", *names]), comments="")
    write_file(table, text.getvalue().encode())
    given = {"excitations" if muscles else "control.program": str(table), "duration": len(driven) * step}
    loaded_again(scene, out / "scene", given).run(out, report=hs.has_reports, frames=4)


def film(episodes: Episodes, frames: list[list[hs.Frame]], out: Path) -> None:
    """Of four environments, two by two, with skin in place of muscles; each until its episode ends."""
    films = []
    for i in range(4):
        with tempfile.TemporaryDirectory() as folder:
            scene = loaded_again(episodes.batch.scene_of(i), Path(folder), {"pictures.muscles": False})
        films.append(scene.draw_frames([row[i] for row in frames], size=(240, 240)))
    grid = [np.vstack([np.hstack([np.asarray(each[t]) for each in films[j:j + 2]]) for j in (0, 2)])
            for t in range(len(frames))]
    hs.save_video(grid, out / "played.mp4", fps=25)


def play(policy: Policy, episodes: Episodes, title: str, out: Path, seed: int) -> None:
    count = len(episodes.batch)
    observation = episodes.reset(seed=seed)
    success, going = np.zeros(count, bool), np.ones(count, bool)
    frames: list[list[hs.Frame]] = []
    driven: list[dict[str, Any]] = []
    for step in range(episodes.task.max_steps):
        if step % 2 == 0:
            # An episode that has ended stays as it ended.
            frames.append([episodes.batch.frame(i) if going[i] else frames[-1][k] for k, i in enumerate(np.arange(4) % count)])
        observation, _, terminated, truncated = episodes.step(np.asarray(policy(observation.astype(np.float32)), float))
        if going[0]:
            driven.append({key: np.array(value) for key, value in episodes.given.items() if key in ("targets", "excitations")})
        decided = episodes.task.succeeded(episodes.batch)
        if decided is not None:
            success |= (terminated | truncated) & going & decided & ~episodes.batch.failed
        going &= ~terminated
    print(f"{title}: {success.mean():.1%} of {count} new episodes end with success")
    out.mkdir(parents=True, exist_ok=True)
    if episodes.task.start() is None and type(episodes.task).advance is Task.advance and driven[0]:
        run_again(episodes, driven, out)
    if films(count):
        film(episodes, frames, out)


def films(count: int) -> bool:
    return bool(hs.has_pictures and shutil.which("ffmpeg") and count >= 4)


def check_folder(out: Path, inputs: list[Path]) -> None:
    """Before the episodes. :raises Error: of kind input where files in it are not those of an earlier call"""
    with OutputFolder(out, "scene/resolved.yaml", b"title: ", ["actions.csv"], inputs):
        pass
    if os.path.lexists(out / "played.mp4"):
        check_target("--out", out / "played.mp4", "mp4", inputs)


def options_of(words: list[str]) -> dict[str, Any]:
    """``key=value`` as arguments of a task. :raises Error: of kind input"""
    out: dict[str, Any] = {}
    for word in words:
        key, equals, value = word.partition("=")
        try:
            out[key] = json.loads(value)
        except (json.JSONDecodeError, RecursionError):
            out[key] = value
        if not (key.isidentifier() and equals):
            raise input_error("--option", word, "KEY=VALUE, e.g. persons=32")
    return out


def said_options(path: Path, text: str) -> dict[str, Any]:
    """Of a model's metadata. :raises Error: of kind input"""
    try:
        out = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise input_error(f"{path}: options", f"{text[:60]!r} ({error})", "JSON of the task's options") from None
    if not isinstance(out, dict):
        raise input_error(f"{path}: options", repr(out)[:60], "a mapping of the task's options")
    return out


def task_with(name: str, options: dict[str, Any], path: Path) -> Task:
    """:raises Error: of kind input for an option that the task does not have"""
    known = [each for each in inspect.signature(TASKS[name]).parameters]
    wrong = [each for each in options if each not in known]
    if wrong:
        raise input_error(f"{path}: options", ", ".join(wrong)[:200], f"options of {name}: {', '.join(known)}")
    try:
        return TASKS[name](**options)
    except TypeError as error:  # of a list in place of a number
        raise input_error(f"{path}: options", f"{options!r:.200} ({error})", f"options of {name}") from None


def work(asked: argparse.Namespace) -> int:
    path: Path = asked.policy
    given = options_of(asked.option)
    if not path.is_file():
        raise input_error("policy", path, "an ONNX file")
    try:
        policy, said = policy_of(path)
    except Exception as error:  # onnxruntime has types of its own for a file that is no model
        raise input_error(str(path), f"a file that is no model ({str(error).strip()[:300]})", "an ONNX file") from None
    name = asked.task or said.get("task")
    if name not in TASKS:
        raise input_error(f"{path}: task", name, f"--task, one of {', '.join(TASKS)}")
    options = {**said_options(path, said.get("options", "{}")), **given}
    check_folder(asked.out, [path])
    episodes = Episodes(task_with(name, options, path), asked.episodes, seed=asked.seed)
    play(answers(policy, path), episodes, f"{name} {options}", asked.out, asked.seed)
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(prog="python3 -m handsim.gym", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--task", choices=TASKS)
    parser.add_argument("--option", action="append", default=[], help="key=value of the task")
    parser.add_argument("--episodes", type=int, default=256)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    return ended(lambda: work(asked))


if __name__ == "__main__":
    sys.exit(main())
