"""Ready tasks by name, and their episodes without gymnasium. Needs numpy only."""
from __future__ import annotations

import inspect
from typing import Any, Callable, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from .._batch import Batch
from .._errors import input_error, seed_of
from ._goals import Button, Rotate
from ._tasks import Array, Hold, KeyTurn, Mask, PenTwirl, Pose, Reach, Reorient, Task, Turn, _clipped
from ._wrist import Bottle, Relocate

TASKS: dict[str, Callable[..., Task]] = {
    "pose": Pose, "reach": Reach, "hold": Hold, "turn": Turn, "reorient": Reorient, "pen_twirl": PenTwirl, "key_turn": KeyTurn,
    "button": Button, "rotate": Rotate, "relocate": Relocate, "bottle": Bottle}


def task_of(task: Union[Task, str], **options: Any) -> Task:
    """A ready task by name, or the task itself. :raises Error: of kind input for a task or an option that there is not"""
    if isinstance(task, Task):
        if options:
            raise input_error("options", ", ".join(options), "none beside a Task, which has its own")
        return task
    if not isinstance(task, str) or task not in TASKS:
        raise input_error("task", task, f"one of {', '.join(TASKS)}, or a Task")
    known = list(inspect.signature(TASKS[task]).parameters)
    for name in options:
        if name not in known:
            raise input_error(name, repr(options[name]), f"options of {task}: {', '.join(known)}")
    return TASKS[task](**options)


Seeds = Union[int, Sequence[Optional[int]]]


class Episodes:
    """A task on a batch: episodes without gymnasium. `reset` and `step` as there; nothing is reset by itself.

    Environment i draws all its episodes from seed + i, or from the i-th of a list of seeds, alone: it is the same in a batch
    of any size.
    """

    def __init__(self, task: Union[Task, str], n: int, *, seed: Seeds = 0, threads: int = 0) -> None:
        self.task = task_of(task)
        self.batch = Batch(self.task.scene, n, observe=self.task.observe, randomise=self.task.randomise, threads=threads)
        self.random = np.random.default_rng(0)
        """Of `Task.drive`."""
        self._randoms = [self.random] * n
        self.steps = np.zeros(n, int)
        """Of each environment's episode."""
        self.given: dict[str, Any] = {}
        """To `Batch.step` by the last step."""
        self.task.person = np.zeros(n, int)
        self.reset(seed=seed)

    def _seed(self, seed: Seeds) -> None:
        n = len(self.batch)
        if isinstance(seed, (list, tuple, np.ndarray)):
            if len(seed) != n:
                raise input_error("seed", f"{len(seed)} seeds", f"a seed for each of {n} environments, or one")
            seeds = [None if each is None else seed_of(each) for each in seed]
        else:
            seeds = [(seed_of(seed) + i) % 2**64 for i in range(n)]
        for i, each in enumerate(seeds):
            if each is not None:
                self._randoms[i] = np.random.default_rng(each)
        self.random = np.random.default_rng([each or 0 for each in seeds])

    def reset(self, mask: Optional[Mask] = None, *, seed: Optional[Seeds] = None) -> Array:
        """New episodes for the environments of the mask.

        :param seed: of environment 0, and one more for each that follows; or a list with one of each, None: it goes on
        :returns: the observation, shape (n, numbers)
        """
        n = len(self.batch)
        if seed is not None:
            self._seed(seed)
        chosen = np.ones(n, bool) if mask is None else np.asarray(mask)
        if chosen.shape != (n,) or chosen.dtype != bool:
            raise input_error("mask", f"shape {chosen.shape}, dtype {chosen.dtype}", f"shape ({n},), dtype bool")
        seeds, rows = np.zeros(n, np.uint64), np.flatnonzero(chosen)
        for i in rows:
            seeds[i] = self._randoms[i].integers(2**63)
            if self.task.people:
                self.task.person[i] = k = int(self._randoms[i].integers(len(self.task.people)))
                self.batch.replace(i, self.task.people[k])
        self.task.prepare(self.batch, rows.tolist(), self._randoms)
        for k in np.unique(self.task.person[chosen]) if self.task.people else [0]:
            self.batch.reset(chosen & (self.task.person == k), seeds=seeds, to=self.task.start_of(int(k)))
        self.steps[chosen] = 0
        for i in rows:
            one = np.zeros(n, bool)
            one[i] = True
            self.task.begin(self.batch, one, self._randoms[i])
        return self.task.observation(self.batch)

    def info(self) -> dict[str, Any]:
        """Of the last step, each of shape (n,): ``failed``, ``is_success`` (of a task that has one), the task's `measures`
        and, as a dictionary, ``reward_terms``."""
        success = self.task.succeeded(self.batch)
        out: dict[str, Any] = {"failed": self.batch.failed.copy()}
        if success is not None:
            out["is_success"] = success & ~self.batch.failed
        out.update(self.task.measures(self.batch))
        if self.task.rewarded:
            out["reward_terms"] = {name: np.where(self.batch.failed, 0, term) for name, term in self.task.rewarded.items()}
        return out

    def _checked(self, action: ArrayLike) -> Array:
        shape = (len(self.batch), self.task.actions)
        try:
            out: Array = np.asarray(action, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise input_error("action", type(action).__name__, f"numbers of shape {shape}") from None
        if out.shape != shape:
            raise input_error("action", f"shape {out.shape}", f"shape {shape}")
        if not np.isfinite(out).all():
            i, k = np.argwhere(~np.isfinite(out))[0]
            raise input_error("action", f"{out[i, k]} at [{i}, {k}]", "finite numbers; those beyond -1 to 1 count as -1 and 1")
        return out

    def step(self, action: ArrayLike) -> tuple[Array, Array, Mask, Mask]:
        """:returns: observation (n, numbers), reward, terminated and truncated (n,). Failed environments are
        terminated, without reward.

        :raises Error: of kind input for an action of another shape, or one that is not finite"""
        clipped = _clipped(self._checked(action), -1, 1)
        self.given = self.task.drive(self.batch, clipped, self.random)
        self.task.advance(self.batch, self.given)
        self.steps += 1
        failed = self.batch.failed
        reward = np.where(failed, 0, self.task.reward(self.batch, clipped))
        terminated = self.task.terminated(self.batch) | failed
        return self.task.observation(self.batch), reward, terminated, (self.steps >= self.task.max_steps) & ~terminated
