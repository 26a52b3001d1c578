"""Environments of gymnasium, which is a package of its own: pip install gymnasium."""
from __future__ import annotations

from typing import Any, Optional, Union

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .._pictures import Picture
from ._tasks import TASKS, Episodes, Task, task_of

Observation = NDArray[np.float32]
LARGEST = 1e6
"""Bound of the numbers of an observation: an engine stops before a speed is so large."""


def _spaces(episodes: Episodes) -> tuple[Box, Box]:
    numbers = episodes.task.observation(episodes.batch).shape[1]
    return (Box(-LARGEST, LARGEST, (numbers,), np.float32),
            Box(-1, 1, (episodes.task.actions,), np.float32))


def _observation(array: NDArray[np.float64]) -> Observation:
    return np.asarray(array, dtype=np.float32)


def _fps(task: Task) -> int:
    return round(1 / (task.scene.step * task.substeps))


class HandVectorEnv(VectorEnv):  # type: ignore[misc]  # without gymnasium's types, VectorEnv is Any
    """n environments in one batch, on all cores.

    Autoreset mode SAME_STEP: an environment that ends is reset in the same step: the observation is the first of its
    next episode; ``info["final_obs"]`` has the last of the old one in the rows of the mask ``info["_final_obs"]``.
    NEXT_STEP: it is reset by the next step, whose action it ignores and whose reward is 0. DISABLED: by `reset` with a
    mask. ``info["failed"]`` has the environments whose motion diverged. Observations are float32 of shape (n, numbers), actions
    -1..1 of shape (n, actions); the task says what they are.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(self, task: Union[Task, str] = "hold", num_envs: int = 1, *, render_mode: Optional[str] = None,
                 rendered: int = 1, threads: int = 0, max_episode_steps: Optional[int] = None,
                 autoreset_mode: Union[AutoresetMode, str] = AutoresetMode.SAME_STEP, **options: Any) -> None:
        """
        :param rendered: `render` draws the first so many environments
        :param threads: 0: one for each core
        :param max_episode_steps: in place of the task's
        :param autoreset_mode: gymnasium's, or its word: ``SameStep``, ``NextStep``, ``Disabled``
        :param options: of a ready task
        """
        made = task_of(task, **options)
        if max_episode_steps is not None:
            made.max_steps = max_episode_steps
        self.episodes = Episodes(made, num_envs, threads=threads)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "render_fps": _fps(made), "autoreset_mode": self.autoreset_mode}
        self.num_envs = num_envs
        self._ended = np.zeros(num_envs, bool)
        """Reset by the next step."""
        self.render_mode = render_mode
        self.rendered = min(rendered, num_envs)
        self.single_observation_space, self.single_action_space = _spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[dict[str, Any]] = None) -> tuple[Observation, dict[str, Any]]:
        """New episodes. :param options: ``{"reset_mask": array}`` of shape (n,), dtype bool: only these"""
        mask = (options or {}).get("reset_mask")
        self._ended[True if mask is None else mask] = False
        return _observation(self.episodes.reset(mask, seed=seed)), {}

    def step(self, actions: Any) -> tuple[Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_],
                                          dict[str, Any]]:
        last, reward, terminated, truncated = self.episodes.step(actions)
        observation = _observation(last)
        failed = self.episodes.batch.failed.copy()
        if self._ended.any():
            observation = _observation(self.episodes.reset(self._ended))
            reward[self._ended] = 0
            for flags in (terminated, truncated, failed):
                flags[self._ended] = False
        info: dict[str, Any] = {"failed": failed} if failed.any() else {}
        ended = terminated | truncated
        if self.autoreset_mode == AutoresetMode.NEXT_STEP:
            self._ended = ended
        elif self.autoreset_mode == AutoresetMode.SAME_STEP and ended.any():
            info.update(final_obs=observation, _final_obs=ended)
            observation = _observation(self.episodes.reset(ended))
        return observation, reward, terminated, truncated, info

    def render(self) -> Optional[tuple[Picture, ...]]:
        """Pictures of the first ``rendered`` environments."""
        if self.render_mode is None:
            return None
        return tuple(self.episodes.batch.draw(i) for i in range(self.rendered))

    def close_extras(self, **kwargs: Any) -> None:
        """Nothing is held but memory."""


class HandEnv(gymnasium.Env):  # type: ignore[misc]  # without gymnasium's types, Env is Any
    """One environment, for programs that take no vectors. Observation and action as in `HandVectorEnv`."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 50}

    def __init__(self, task: Union[Task, str] = "hold", *, render_mode: Optional[str] = None, **options: Any) -> None:
        self.episodes = Episodes(task_of(task, **options), 1, threads=1)
        self.metadata = {**self.metadata, "render_fps": _fps(self.episodes.task)}
        self.render_mode = render_mode
        self.observation_space, self.action_space = _spaces(self.episodes)

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[dict[str, Any]] = None) -> tuple[Observation, dict[str, Any]]:
        super().reset(seed=seed)
        return _observation(self.episodes.reset(seed=seed))[0], {}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        last, reward, terminated, truncated = self.episodes.step([action])
        return _observation(last)[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), {}

    def render(self) -> Optional[Picture]:
        return None if self.render_mode is None else self.episodes.batch.draw()


def register() -> None:
    """Makes ``gymnasium.make("handsim/Hold-v0")`` and ``gymnasium.make_vec`` of it work; so for every task."""
    for name in TASKS:
        word = f"handsim/{name.title().replace('_', '')}-v0"
        if word not in gymnasium.registry:
            gymnasium.register(word, entry_point="handsim.gym:HandEnv", kwargs={"task": name},
                               vector_entry_point="handsim.gym:HandVectorEnv")
