"""Tasks whose goal is a few numbers, which also stand by themselves: a button's force, an object's turn. Needs numpy only."""
from __future__ import annotations

from typing import Any, Mapping, Optional

import numpy as np

from .._batch import Batch
from .._core import Motion
from .._errors import flag
from .._shipped import data_path
from .._simulation import Simulation
from ._tasks import _PALM_SIDE, _TOUCHED, Array, HandTask, Mask, Object, _InPalm, _mean_square, _product, _seen
from ._vary import Vary


class ToGoals(HandTask):
    """A task whose goal is ``numbers`` that are drawn for each episode: an episode is a success, and ends, after ``steady``
    steps in a row with a distance below ``near``; or it is lost.

    A state is worth a number, by terms. The reward of a step is what it gains of that, less the effort; with success and loss it
    has its own. To wait costs nothing, and what is lost again is taken back: neither a loss, which ends what waiting would cost, nor
    a hand that stays near its goal and avoids to end is ahead of success.

    With ``goals=True`` the observation is a dictionary with these numbers as they are (``achieved_goal``) and as they shall be
    (``desired_goal``), as hindsight experience replay takes it; the reward is 0 near the goal, else -1, and episodes end by
    their limit alone.
    """

    numbers: int
    near: float
    unit: str
    """Name of the distance in `info`."""
    steady = 5
    bonus, loss = 20.0, 10.0
    """Reward of success; what a lost episode takes."""
    staying = 2.0
    """Worth of each step in a row near the goal."""

    def _take_goals(self, goals: bool) -> None:
        self._goal, self._near, self._before = np.empty((0, self.numbers)), np.empty(0, int), np.empty((1, 0))
        if flag("goals", goals):
            self.goal_numbers = self.numbers

    def draw_goals(self, batch: Batch, mask: Mask, random: np.random.Generator) -> Array:
        """Of the environments of the mask, shape (theirs, numbers)."""
        raise NotImplementedError

    def achieved(self, batch: Batch) -> Array:
        """Shape (n, numbers)."""
        raise NotImplementedError

    def seen(self, batch: Batch) -> Array:
        """The observation without what is known of the goal, shape (n, others)."""
        raise NotImplementedError

    def missing(self, batch: Batch) -> Array:
        """What is observed of the goal, shape (n, some)."""
        return np.asarray(self._goal - self.achieved(batch))

    def apart(self, achieved: Array, goal: Array) -> Array:
        """Distance of what is achieved from a goal, each of shape (..., numbers), in the unit of ``near``."""
        return np.asarray(np.linalg.norm(goal - achieved, axis=-1))

    def counts(self, batch: Batch) -> Mask:
        """Shape (n,): where being near is not by accident."""
        return np.ones(len(batch), bool)

    def is_lost(self, batch: Batch) -> Mask:
        """Shape (n,)."""
        return np.zeros(len(batch), bool)

    def worth(self, batch: Batch) -> dict[str, Array]:
        """What a state is worth beside the steps near the goal: terms by name, each of shape (n,)."""
        raise NotImplementedError

    def distance(self, batch: Batch) -> Array:
        """Shape (n,)."""
        return self.apart(self.achieved(batch), self._goal)

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        super().begin(batch, mask, random)
        if len(self._goal) != len(batch):
            self._goal, self._near = np.zeros((len(batch), self.numbers)), np.zeros(len(batch), int)
            self._before = np.full((1, len(batch)), np.nan)
        self._goal[mask] = self.draw_goals(batch, mask, random)
        self._near[mask], self._before[:, mask] = 0, np.nan

    def observation(self, batch: Batch) -> Array:
        more = (self.achieved(batch), self._goal) if self.goal_numbers else (self.missing(batch),)
        return np.concatenate((self.seen(batch), *more), axis=1)

    def goal_reward(self, achieved: Array, goal: Array) -> Array:
        # As float32, which the spaces of dictionaries have.
        near = self.apart(np.asarray(achieved, np.float32), np.asarray(goal, np.float32)) < self.near
        return np.where(near, 0.0, -1.0)

    def _at_goal(self, batch: Batch) -> Mask:
        return np.asarray((self.distance(batch) < self.near) & self.counts(batch))

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        if self.goal_numbers:
            return {"goal": self.goal_reward(self.achieved(batch), self._goal)}
        self._near = np.where(self._at_goal(batch), self._near + 1, 0)
        worth = {**self.worth(batch), "near": self.staying * self._near}
        now = np.stack(list(worth.values()))
        gained = np.where(np.isnan(self._before), 0.0, now - self._before)  # the first step of an episode gains nothing
        self._before = now
        effort = 0.01 * _mean_square(self._excitation(action) if self.driven == "muscles" else action)
        return {**dict(zip(worth, gained)), "effort": -effort, "success": self.bonus * (self._near >= self.steady),
                "lost": -self.loss * self.is_lost(batch)}

    def terminated(self, batch: Batch) -> Mask:
        return np.asarray(((self._near >= self.steady) | self.is_lost(batch)) & (self.goal_numbers == 0))

    def succeeded(self, batch: Batch) -> Optional[Mask]:
        if self.goal_numbers:
            return np.asarray(self.goal_reward(self.achieved(batch), self._goal) == 0)
        return np.asarray((self._near >= self.steady) & ~self.is_lost(batch))

    def measures(self, batch: Batch) -> dict[str, Array]:
        return {**super().measures(batch), self.unit: self.distance(batch)}


class Button(ToGoals):
    """The index finger presses a button with a force that is asked for: from 1.5 to 4 N, drawn for each episode, within 0.5 N.

    The button of 20 mm stands 4 mm before the fingertip and moves by up to 10 mm along the finger's own way, against a spring of 1 to
    2 N/mm that is drawn for each episode and not observed; its force is. Forearm and wrist are fixed. An episode is lost when the
    force is 4 N more than asked for; a success, and ends, after ten steps in a row within the window in which the index finger
    touches the button. Observation: q and u of all joints, the last one's the button's [m], fingertips, force [N] and number of
    contact points of palm and fingers, what the drive holds (`HandTask`), the fingertip less the button's face [dm], the button's
    force [N], and what is missing of it [N]. Reward of a step (20 ms): what it gains of a worth (`ToGoals`), minus 2.5 times the
    missing force [N], minus 10 times the fingertip's distance from the face [dm], 2 for each step in a row within the window; minus 0.01
    times the mean square of the action (of the excitation); 20 on success, 10 less on loss. Truncated after 100 steps. Targets change by
    0.05 rad, and are held by controllers/muscles.yaml.
    """

    max_steps, steady = 100, 10
    numbers, near, unit = 1, 0.5, "force_error_N"
    speed = 0.05
    observe = ("q", "u", "fingertips", "finger_contacts")
    asked = 1.5, 4.0
    """Least and largest force [N]."""
    too_much = 4.0
    """Beyond the force that is asked for [N]."""
    springs = 1000.0, 2000.0
    """Least and largest stiffness [N/m]."""
    damping = 2.0
    """Of the spring [N s/m]."""
    bent = {"index_mcp.flexion": 0.5, "index_pip.flexion": 0.6, "index_dip.flexion": 0.35}
    """Of the finger at the start [rad]."""
    gap, pad, thick = 4e-3, 8e-3, 8e-3
    """Between skin and button, from the tip to the skin, and of the button [m]."""

    def __init__(self, *, drive: str = "targets", vary: Vary = None, variants: int = 16, goals: bool = False, taxels: bool = False) -> None:
        """As `HandTask`, and `Reach` for ``goals``: achieved and desired force [N]."""
        free = Simulation(HandTask("a hand", _PALM_SIDE, "targets").scene)
        tips = []
        for more in (-0.05, 0.05, 0):
            q = np.array([self.bent.get(name.partition(".")[2], 0.0) for name in free.scene.coordinates])
            q[free.scene.coordinates.index("right.index_mcp.flexion")] += more
            free.reset(q=q)
            tips.append(_seen(free, "fingertips").reshape(-1, 7)[1, :3].copy())
        self._way = (tips[1] - tips[0]) / np.linalg.norm(tips[1] - tips[0])
        self._face = tips[2] + (self.gap + self.pad) * self._way
        centre = (self._face + 0.5 * self.thick * self._way).tolist()
        scene: dict[str, Any] = {**_TOUCHED, "effects": [*_TOUCHED["effects"], "actuation"], "pictures": {
            "size": [480, 480], "camera": {"position": [-0.35, 0.3, 0.42], "target": [-0.02, 0.05, 0.31], "field_of_view": "28 deg"}},
            "bodies": [{"name": "button", "mass": "20 g", "inertia": [1e-6, 1e-6, 1e-6], "position": centre, "z_axis": self._way.tolist(),
                        "collides": True, "friction": 0.8, "shape": {"kind": "cylinder", "radius": "10 mm", "length": self.thick}}],
            "joints": [{"name": "press", "type": "slider", "parent": "world", "child": "button", "position": centre,
                        "axes": [{"name": "travel", "axis": self._way.tolist(), "range": [0, "10 mm"]}]}]}
        if drive == "targets":
            data = data_path()
            scene["control"] = {"controller": str(data / "controllers/muscles.yaml"), "poses": str(data / "controllers/poses.yaml"),
                                "program": "every_pose"}
        else:
            scene["joints"][0]["axes"][0]["torque"] = 1e-6  # an effect needs something that acts; the spring is the task's
        super().__init__("a finger presses a button", _PALM_SIDE, drive, vary=vary, variants=variants, taxels=taxels, **scene)
        self._motions: list[Motion] = []
        for each in self.people or [self.scene]:
            start = Simulation(each)
            start.reset(q=np.append(q, 0))
            self._motions.append(start.motion())
        columns = Batch(self.scene, 1, observe=["finger_contacts"]).columns
        self._points = columns.index("right.index.points")
        self._stiffness = np.empty(0)
        self._take_goals(goals)

    def start(self) -> Optional[Motion]:
        return self._motions[0]

    def start_of(self, person: int) -> Optional[Motion]:
        return self._motions[person]

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        if len(self._stiffness) != len(batch):
            self._stiffness = np.zeros(len(batch))
        self._stiffness[mask] = random.uniform(*self.springs, int(mask.sum()))
        super().begin(batch, mask, random)

    def draw_goals(self, batch: Batch, mask: Mask, random: np.random.Generator) -> Array:
        return random.uniform(*self.asked, (int(mask.sum()), 1))

    def advance(self, batch: Batch, given: Mapping[str, Any]) -> None:
        torques = np.zeros((len(batch), len(self.scene.coordinates))) + given.get("torques", 0)
        for _ in range(self.substeps):  # the spring acts anew in each step of the solver
            torques[:, -1] = -self._stiffness * batch.q[:, -1] - self.damping * batch.u[:, -1]
            batch.step(**{**given, "torques": torques})

    def achieved(self, batch: Batch) -> Array:
        """The spring's force [N], shape (n, 1)."""
        return np.asarray(self._stiffness[:, np.newaxis] * np.maximum(batch.q[:, -1:], 0))

    def counts(self, batch: Batch) -> Mask:
        return np.asarray(batch["finger_contacts"][:, self._points] > 0)

    def is_lost(self, batch: Batch) -> Mask:
        return np.asarray(self.achieved(batch)[:, 0] > self._goal[:, 0] + self.too_much)

    def _before_face(self, batch: Batch) -> Array:
        tip = batch["fingertips"].reshape(len(batch), -1, 7)[:, 1, :3]
        return np.asarray(10 * (tip + self.pad * self._way - self._face - batch.q[:, -1:] * self._way))

    def seen(self, batch: Batch) -> Array:
        return self._with(batch, self._before_face(batch), self.achieved(batch))

    def worth(self, batch: Batch) -> dict[str, Array]:
        return {"force": -2.5 * self.distance(batch), "distance": -10 * np.linalg.norm(self._before_face(batch), axis=1)}


class Rotate(ToGoals, _InPalm):
    """The hand turns a cube of 45 mm, or a ball, that lies in it about the vertical by an angle that is drawn for each episode:
    0.5 to 1.5 rad in either sense. Palm and fingers turn it: the wrist has its two joints.

    Observation: as `Turn`, and the angle that is missing [rad]. Action: target of each joint, 1 is 0.4 rad from its target at the
    start; torques and excitations as `HandTask`. Reward of a step (20 ms): what it gains of a worth (`ToGoals`), minus 10
    times the missing angle [rad], 2 for each step in a row within ``near`` (0.15 rad); minus 0.01 times the mean square of the action
    (of the excitation); 20 on success, after ten steps in a row within ``near``, 10 less where the object has moved by 60 mm. Both end
    the episode; it is truncated after 150 steps.
    """

    max_steps, steady = 150, 10
    numbers, near, unit = 2, 0.15, "distance_rad"
    turned = 0.5, 1.5
    """Least and largest angle [rad]."""
    mount = "universal"
    thing: Mapping[str, Any] = {"name": "cube", "shape": "box", "edges": ["45 mm", "45 mm", "45 mm"], "mass": "60 g"}

    def __init__(self, *, drive: str = "targets", persons: int = 0, object: Object = None, vary: Vary = None,
                 variants: int = 16, goals: bool = False, taxels: bool = False) -> None:
        """As `Turn`, with ``object="tennis_ball"`` for a ball, and `Reach` for ``goals``: cosine and sine of the angle."""
        super().__init__("a hand turns a cube", drive=drive, persons=persons, object=object, vary=vary, variants=variants, taxels=taxels)
        self._take_goals(goals)

    def draw_goals(self, batch: Batch, mask: Mask, random: np.random.Generator) -> Array:
        count = int(mask.sum())
        angle = random.uniform(*self.turned, count) * random.choice([-1.0, 1.0], count)
        return np.column_stack([np.cos(angle), np.sin(angle)])

    def achieved(self, batch: Batch) -> Array:
        turn = _product(batch["objects"][:, 3:7], self._first[self.person] * np.array([1.0, -1, -1, -1]))
        angle = 2 * np.arctan2(turn[:, 3], turn[:, 0])
        return np.column_stack([np.cos(angle), np.sin(angle)])

    @staticmethod
    def _angle_to(achieved: Array, goal: Array) -> Array:
        return np.asarray(np.arctan2(achieved[..., 0] * goal[..., 1] - achieved[..., 1] * goal[..., 0], (achieved * goal).sum(axis=-1)))

    def apart(self, achieved: Array, goal: Array) -> Array:
        return np.abs(self._angle_to(achieved, goal))

    def missing(self, batch: Batch) -> Array:
        return self._angle_to(self.achieved(batch), self._goal)[:, np.newaxis]

    def seen(self, batch: Batch) -> Array:
        return _InPalm.observation(self, batch)

    def is_lost(self, batch: Batch) -> Mask:
        return self._lost(batch)

    def worth(self, batch: Batch) -> dict[str, Array]:
        return {"angle": -10 * self.distance(batch)}
