"""Environments of gymnasium, which is a package of its own: pip install gymnasium."""
from __future__ import annotations

from typing import Any, Optional, Sequence, Union

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, Space
from gymnasium.utils import EzPickle
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .._batch import MOST
from .._errors import flag, input_error, whole
from .._pictures import Picture
from ._episodes import TASKS, Episodes, task_of
from ._tasks import Task

Observation = Union[NDArray[np.float32], dict[str, NDArray[np.float32]]]
LARGEST = 1e6
"""Bound of the numbers of an observation: an engine stops before a speed is so large."""


def _box(numbers: int) -> Box:
    return Box(-LARGEST, LARGEST, (numbers,), np.float32)


def _spaces(episodes: Episodes) -> tuple[Space, Box]:
    numbers, goal = episodes.task.observation(episodes.batch).shape[1], episodes.task.goal_numbers
    space = _box(numbers) if not goal else Dict({"observation": _box(numbers - 2 * goal), "achieved_goal": _box(goal),
                                                 "desired_goal": _box(goal)})
    return space, Box(-1, 1, (episodes.task.actions,), np.float32)


def _observation(task: Task, array: NDArray[np.float64]) -> Observation:
    flat, goal = np.asarray(array, dtype=np.float32), task.goal_numbers
    if not goal:
        return flat
    return {"observation": flat[:, :-2 * goal].copy(), "achieved_goal": flat[:, -2 * goal:-goal].copy(),
            "desired_goal": flat[:, -goal:].copy()}


def row_of(observation: Observation, i: int) -> Observation:
    """A copy of one environment's."""
    if isinstance(observation, dict):
        return {key: value[i].copy() for key, value in observation.items()}
    return np.array(observation[i])


def _fps(task: Task) -> int:
    return round(1 / (task.scene.step * task.substeps))


RENDER_MODES = ["rgb_array"]


def _checked_mode(render_mode: Optional[str]) -> Optional[str]:
    if render_mode is not None and render_mode not in RENDER_MODES:
        raise input_error("render_mode", render_mode, "rgb_array, or None; a window or page of their own these environments have not")
    return render_mode


def _limited(task: Task, steps: Optional[int]) -> Task:
    if steps is not None:
        task.max_steps = whole("max_episode_steps", steps, 1)
    return task


def _mode_of(mode: Any) -> AutoresetMode:
    try:
        return AutoresetMode[mode] if mode in AutoresetMode.__members__ else AutoresetMode(mode)
    except (ValueError, TypeError):
        raise input_error("autoreset_mode", mode, "one of gymnasium's AutoresetMode: "
                          + ", ".join(f"{each.name} ({each.value})" for each in AutoresetMode)) from None


def _masked(info: dict[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """An info of all environments by gymnasium's rules: `_key` says which have it; the others have 0. Without any, it is empty."""
    out: dict[str, Any] = {}
    if not mask.any():
        return out
    for key, value in info.items():
        out[key] = _masked(value, mask) if isinstance(value, dict) else np.where(mask, value, np.zeros_like(value))
        out[f"_{key}"] = mask.copy()
    return out


def _entropy() -> int:
    return int(np.random.SeedSequence().generate_state(1)[0])


class HandVectorEnv(VectorEnv, EzPickle):  # type: ignore[misc]  # without gymnasium's types, VectorEnv is Any
    """n environments in one batch, on all cores. The same as gymnasium's SyncVectorEnv of so many `HandEnv`.

    Autoreset mode NEXT_STEP, gymnasium's default: an environment that has ended is reset by the next step, whose action it
    ignores and whose reward is 0. SAME_STEP: it is reset in the same step; the observation is the first of its next episode,
    ``info["final_obs"]`` and ``info["final_info"]`` have the last of the old one where ``info["_final_obs"]`` says so.
    DISABLED: it is reset by `reset` with ``options={"reset_mask": mask}``.

    Observations are float32 of shape (n, numbers), actions -1..1 of shape (n, actions); the task says what they are. ``info``
    has arrays by `Episodes.info`: ``failed`` (the motion diverged), ``is_success``, distances, ``reward_terms``; each ``key``
    with the mask ``_key`` of the environments that have it: those that an autoreset began anew have none.
    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, task: Union[Task, str] = "hold", num_envs: int = 1, *, render_mode: Optional[str] = None,
                 rendered: Optional[int] = None, threads: int = 0, max_episode_steps: Optional[int] = None,
                 autoreset_mode: Union[AutoresetMode, str] = AutoresetMode.NEXT_STEP, **options: Any) -> None:
        """
        :param render_mode: None or ``rgb_array``
        :param rendered: `render` draws the first so many environments; None: all
        :param threads: 0: one for each core
        :param max_episode_steps: in place of the task's
        :param autoreset_mode: gymnasium's, or its word: ``NextStep``, ``SameStep``, ``Disabled``
        :param options: of a ready task
        :raises Error: of kind input for a wrong option
        """
        EzPickle.__init__(self, task, num_envs, render_mode=render_mode, rendered=rendered, threads=threads,
                          max_episode_steps=max_episode_steps, autoreset_mode=autoreset_mode, **options)
        self.autoreset_mode, self.render_mode = _mode_of(autoreset_mode), _checked_mode(render_mode)
        self.num_envs = whole("num_envs", num_envs, 1, MOST)
        self.rendered = num_envs if rendered is None else whole("rendered", rendered, 1, num_envs)
        made = _limited(task_of(task, **options), max_episode_steps)
        self.episodes = Episodes(made, num_envs, seed=_entropy(), threads=threads)
        self.metadata = {**self.metadata, "render_fps": _fps(made), "autoreset_mode": self.autoreset_mode}
        self._ended = np.zeros(num_envs, bool)
        """Reset by the next step."""
        self.single_observation_space, self.single_action_space = _spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(self, *, seed: Union[int, Sequence[Optional[int]], None] = None,
              options: Optional[dict[str, Any]] = None) -> tuple[Observation, dict[str, Any]]:
        """New episodes.

        :param seed: environment i has seed + i; or a list with a seed (or None) for each
        :param options: ``{"reset_mask": array}`` of shape (n,), dtype bool: only these
        """
        mask = (options or {}).get("reset_mask")
        observation = _observation(self.episodes.task, self.episodes.reset(mask, seed=seed))
        self._ended[True if mask is None else mask] = False
        return observation, {}

    def step(self, actions: Any) -> tuple[Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_],
                                          dict[str, Any]]:
        last, reward, terminated, truncated = self.episodes.step(actions)
        observation, all_info, begun = _observation(self.episodes.task, last), self.episodes.info(), self._ended
        if begun.any():
            observation = _observation(self.episodes.task, self.episodes.reset(begun))
            reward[begun], terminated[begun], truncated[begun] = 0, False, False
        ended = terminated | truncated
        if self.autoreset_mode == AutoresetMode.SAME_STEP and ended.any():
            info = _masked(all_info, ~ended)
            info.update(final_obs=np.full(self.num_envs, None, object), _final_obs=ended, final_info=_masked(all_info, ended),
                        _final_info=ended.copy())
            for i in np.flatnonzero(ended):
                info["final_obs"][i] = row_of(observation, i)
            observation = _observation(self.episodes.task, self.episodes.reset(ended))
        else:
            info = _masked(all_info, ~begun)
        self._ended = ended.copy() if self.autoreset_mode == AutoresetMode.NEXT_STEP else np.zeros(self.num_envs, bool)
        return observation, reward, terminated, truncated, info

    def render(self) -> Optional[tuple[Picture, ...]]:
        """Pictures of all environments, or of the first ``rendered``."""
        if self.render_mode is None:
            return None
        return tuple(self.episodes.batch.draw(i) for i in range(self.rendered))

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """By goals alone, of a task with ``goals=True``: as gymnasium_robotics' GoalEnv, for hindsight experience replay."""
        return self.episodes.task.goal_reward(np.asarray(achieved_goal), np.asarray(desired_goal))

    def close_extras(self, **kwargs: Any) -> None:
        """Nothing is held but memory."""


class HandEnv(gymnasium.Env, EzPickle):  # type: ignore[misc]  # without gymnasium's types, Env is Any
    """One environment, for programs that take no vectors. Observation, action and ``info`` as in `HandVectorEnv`, of one."""

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "render_fps": 50}

    def __init__(self, task: Union[Task, str] = "hold", *, render_mode: Optional[str] = None,
                 max_episode_steps: Optional[int] = None, truncates: bool = True, **options: Any) -> None:
        """
        :param max_episode_steps: in place of the task's
        :param truncates: False: episodes end by success or loss alone, as under gymnasium's TimeLimit, which has the limit
        """
        EzPickle.__init__(self, task, render_mode=render_mode, max_episode_steps=max_episode_steps, truncates=truncates, **options)
        self.render_mode, self._truncates = _checked_mode(render_mode), flag("truncates", truncates)
        self.episodes = Episodes(_limited(task_of(task, **options), max_episode_steps), 1, seed=_entropy(), threads=1)
        self.metadata = {**self.metadata, "render_fps": _fps(self.episodes.task)}
        self.observation_space, self.action_space = _spaces(self.episodes)

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[dict[str, Any]] = None) -> tuple[Observation, dict[str, Any]]:
        super().reset(seed=seed)
        return row_of(_observation(self.episodes.task, self.episodes.reset(seed=seed)), 0), {}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        last, reward, terminated, truncated = self.episodes.step([action])
        info = {key: {name: float(term[0]) for name, term in value.items()} if isinstance(value, dict) else value[0].item()
                for key, value in self.episodes.info().items()}
        return row_of(_observation(self.episodes.task, last), 0), float(reward[0]), bool(terminated[0]), self._truncates and bool(truncated[0]), info

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """By goals alone, of a task with ``goals=True``: as gymnasium_robotics' GoalEnv, for hindsight experience replay."""
        return self.episodes.task.goal_reward(np.asarray(achieved_goal), np.asarray(desired_goal))

    def render(self) -> Optional[Picture]:
        return None if self.render_mode is None else self.episodes.batch.draw()


def limited_by_gymnasium(**options: Any) -> HandEnv:
    """What gymnasium.make puts its TimeLimit around."""
    return HandEnv(truncates=False, **options)


def register() -> None:
    """Makes ``gymnasium.make("handsim/Hold-v0")`` and ``gymnasium.make_vec`` of it work; so for every task."""
    for name, task in TASKS.items():
        word = f"handsim/{name.title().replace('_', '')}-v0"
        if word not in gymnasium.registry:
            gymnasium.register(word, entry_point="handsim.gym._envs:limited_by_gymnasium", kwargs={"task": name},
                               vector_entry_point="handsim.gym:HandVectorEnv", max_episode_steps=getattr(task, "max_steps"))
