"""Environments for learning: `make_vec` for gymnasium, ready tasks, and `Episodes` that needs numpy only.

    env = handsim.gym.make_vec("hold", 1024)                         # or another name of `TASKS`
    env = handsim.gym.make_vec("pose", 1024, drive="muscles")        # targets, torques or muscles
    env = handsim.gym.make_vec("two_hands", 1024, reward=my_reward)  # any scene, with a reward of your own

    env = handsim.gym.sb3_vec("hold", 16)                            # as stable-baselines3 takes it

gymnasium is a package of its own (pip install gymnasium). Where it is installed, importing this module also registers
the tasks with it: ``handsim/Pose-v0``, ``handsim/Reach-v0`` and so on.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional, Union

from .._errors import input_error
from .._scene import Scene
from ._episodes import TASKS, Episodes
from ._goals import Button, Rotate, ToGoals
from ._tasks import BatchFunction, HandTask, Hold, KeyTurn, PenTwirl, Pose, Reach, Reorient, SceneTask, Task, Turn
from ._wrist import Bottle, MovingWrist, Relocate

if TYPE_CHECKING:
    from ._envs import HandEnv, HandVectorEnv


def make_vec(task: Union[Task, Scene, str], n: int, *, reward: Optional[BatchFunction] = None,
             terminated: Optional[BatchFunction] = None, render_mode: Optional[str] = None, rendered: Optional[int] = None,
             threads: int = 0, autoreset_mode: Any = "NextStep", max_episode_steps: Optional[int] = None,
             **options: Any) -> "HandVectorEnv":
    """A gymnasium VectorEnv of n environments in one batch.

    :param task: the name of a ready task, a Task, or a Scene (also by name), which needs a reward
    :param reward: of a scene: called with the `Batch` after each step, returns shape (n,)
    :param terminated: of a scene: the same, returns shape (n,) of dtype bool
    :param render_mode: None or ``rgb_array``
    :param rendered: `render` draws the first so many environments; None: all
    :param threads: 0: one for each core
    :param autoreset_mode: gymnasium's AutoresetMode, or its word: ``NextStep``, ``SameStep``, ``Disabled``
    :param max_episode_steps: in place of the task's
    :param options: of a ready task (`Hold`), or of `SceneTask`: observe, vary, variants, substeps, max_steps, torque, start
    :raises ImportError: without gymnasium
    :raises Error: of kind input for a scene without a reward or a wrong option, or as `Batch`
    """
    from ._envs import HandVectorEnv

    made: dict[str, Any] = {"render_mode": render_mode, "rendered": rendered, "threads": threads,
                            "autoreset_mode": autoreset_mode, "max_episode_steps": max_episode_steps}
    if isinstance(task, Task) or (isinstance(task, str) and task in TASKS):
        if reward is not None:
            raise input_error("reward", "one beside a task", "a Scene, or a Task that has its own")
        return HandVectorEnv(task, n, **made, **options)
    if reward is None:
        raise input_error("reward", "none", f"a function of the Batch for a scene; or a task: {', '.join(TASKS)}")
    return HandVectorEnv(SceneTask(task, reward, terminated=terminated, **options), n, **made)


def sb3_vec(task: Union[Task, Scene, str], n: int, **options: Any) -> Any:
    """The same as a VecEnv of stable-baselines3, in its VecMonitor: ``SAC("MlpPolicy", sb3_vec("hold", 16))``.

    Infos have ``terminal_observation``, ``TimeLimit.truncated``, ``is_success``, distances and terms of the reward. `get_attr`,
    `set_attr` and `env_method` are of the vector environment, or of its task.

    :param options: as `make_vec`, without ``autoreset_mode``
    :raises ImportError: without stable-baselines3
    """
    from . import _sb3

    if "autoreset_mode" in options:
        raise input_error("autoreset_mode", options["autoreset_mode"], "none: stable-baselines3 has one of its own")
    return _sb3.vec(make_vec(task, n, autoreset_mode="Disabled", **options))


def __getattr__(name: str) -> Any:
    if name in ("HandEnv", "HandVectorEnv"):
        from . import _envs

        return getattr(_envs, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _register() -> None:
    try:
        from ._envs import register
    except ImportError:
        return
    register()


_register()

__all__ = ["TASKS", "Bottle", "Button", "Episodes", "HandEnv", "HandTask", "HandVectorEnv", "Hold", "KeyTurn", "MovingWrist", "PenTwirl",
           "Pose", "Reach", "Relocate", "Reorient", "Rotate", "SceneTask", "Task", "ToGoals", "Turn", "make_vec", "sb3_vec"]
