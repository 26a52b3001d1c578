"""Environments of stable-baselines3, which is a package of its own: pip install stable-baselines3."""
from __future__ import annotations

from typing import Any, Iterable, Optional, Sequence, Union

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

from .._errors import input_error
from .._pictures import Picture
from ._envs import HandVectorEnv, Observation, row_of

Indices = Union[int, Iterable[int], None]


def _rows(info: dict[str, Any], n: int) -> list[dict[str, Any]]:
    """A dictionary for each environment, of an info of all."""
    columns = [_rows(value, n) if isinstance(value, dict) else value.tolist() for value in info.values()]
    return [dict(zip(info, row)) for row in zip(*columns)] if columns else [{} for _ in range(n)]


class HandVecEnv(VecEnv):  # type: ignore[misc]  # without the package's types, VecEnv is Any
    """A `HandVectorEnv` as stable-baselines3 takes it. The environments are one batch: attributes and methods are those of all."""

    def __init__(self, env: HandVectorEnv) -> None:
        if env.autoreset_mode != AutoresetMode.DISABLED:
            raise input_error("autoreset_mode", env.autoreset_mode.value, "Disabled: what has ended is reset here")
        self.env = env
        self._actions: Any = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> Observation:
        observation, _ = self.env.reset(seed=self._seeds)
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: Any) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Observation, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        observation, reward, terminated, truncated, _ = self.env.step(self._actions)
        infos, ended = _rows(self.env.episodes.info(), self.num_envs), terminated | truncated
        for i, info in enumerate(infos):
            info["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        if ended.any():
            for i in np.flatnonzero(ended):
                infos[i]["terminal_observation"] = row_of(observation, i)
                self.reset_infos[i] = {}
            observation, _ = self.env.reset(options={"reset_mask": ended})
        return observation, reward.astype(np.float32), ended, infos

    def close(self) -> None:
        self.env.close()

    def get_images(self) -> Sequence[Optional[Picture]]:
        return self.env.render() or [None] * self.num_envs

    def _owner(self, name: str) -> Any:
        for owner in (self.env, self.env.episodes.task):
            if hasattr(owner, name):
                return owner
        raise AttributeError(f"{name}: neither the environments nor their task have it")

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Of the environments, or of their task."""
        return [getattr(self._owner(attr_name), attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Of the environments or of their task, for all."""
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise input_error("indices", indices, "None: the environments are one batch")
        setattr(self._owner(attr_name), attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any) -> list[Any]:
        """One call for all: its result once for each index."""
        result = getattr(self._owner(method_name), method_name)(*method_args, **method_kwargs)
        return [result] * len(list(self._get_indices(indices)))

    def env_is_wrapped(self, wrapper_class: Any, indices: Indices = None) -> list[bool]:
        return [False] * len(list(self._get_indices(indices)))


def vec(env: HandVectorEnv) -> VecMonitor:
    return VecMonitor(HandVecEnv(env))
