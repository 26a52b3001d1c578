"""Tasks: what an environment for learning does with a scene. Needs numpy only."""
from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from .._batch import Batch
from .._core import Motion
from .._errors import flag, input_error, real, whole
from .._hand import draw_persons
from .._scene import Scene, load
from .._shipped import data_path
from .._simulation import Simulation
from ._vary import Vary, drawn_by, scene_values

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
BatchFunction = Callable[[Batch], Any]


def _clipped(numbers: Array, low: Any, high: Any) -> Array:
    """As numpy's, in a third of its time for a few numbers."""
    return np.minimum(np.maximum(numbers, low), high)


def _mean_square(numbers: Array) -> Array:
    """Of each row."""
    return np.asarray(np.einsum("ij,ij->i", numbers, numbers) / numbers.shape[1])


class Task:
    """A scene with actions, observations, a reward and ends. Subclasses replace what they need.

    Actions are numbers in -1..1, one for each of `axes`: what they do is `drive`. All methods work on a whole batch;
    arrays have a row for each environment.
    """

    scene: Scene
    substeps = 10
    """Steps of the solver in one step of the environment."""
    max_steps = 100
    """Steps after which an episode is truncated."""
    observe: Sequence[str] = ("q", "u")
    """Parts of the batch's observation."""
    randomise: Mapping[str, Sequence[Any]] = {}
    """As in `Batch`, drawn at the start of each episode: a part of what `vary` says."""
    actions: int
    """Numbers of an action."""
    goal_numbers = 0
    """Of a task whose goals stand by themselves: the observation ends with so many of what is achieved and of the goal."""
    people: Sequence[Scene] = ()
    """Scenes with other persons and numbers, one of which is drawn for each episode; without any, all are of `scene`."""
    person: NDArray[np.int_]
    """Of each environment's episode: index among `people`."""

    def start(self) -> Optional[Motion]:
        """The motion that episodes begin with; None: the scene's start."""
        return None

    def start_of(self, person: int) -> Optional[Motion]:
        """The same for one of `people`."""
        return self.start()

    def prepare(self, batch: Batch, rows: Sequence[int], randoms: Sequence[np.random.Generator]) -> None:
        """Called before the reset of these environments: sets numbers of the batch that begin with it (`Batch.set`).

        :param randoms: of all environments
        """

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        """Called after the reset of the environments of the mask: draws goals."""

    def drive(self, batch: Batch, action: Array, random: np.random.Generator) -> dict[str, Any]:
        """Arguments of `Batch.step` for an action of shape (n, actions)."""
        raise NotImplementedError

    def advance(self, batch: Batch, given: Mapping[str, Any]) -> None:
        """Steps the batch by what `drive` returned, for a step of the environment."""
        batch.step(**given, substeps=self.substeps)

    def observation(self, batch: Batch) -> Array:
        """Shape (n, numbers)."""
        return batch.observation

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        """Parts of the reward by name, each of shape (n,)."""
        raise NotImplementedError

    def reward(self, batch: Batch, action: Array) -> Array:
        """Shape (n,): the sum of `terms`, which stay in `rewarded`. A task that replaces this needs no terms."""
        self.rewarded = self.terms(batch, action)
        return np.asarray(sum(self.rewarded.values()))

    rewarded: Mapping[str, Array] = {}
    """Terms of the last reward."""

    def terminated(self, batch: Batch) -> Mask:
        """Shape (n,): episodes that are decided."""
        return np.zeros(len(batch), bool)

    def succeeded(self, batch: Batch) -> Optional[Mask]:
        """Shape (n,): episodes that are a success if they end now; None: the task has no success."""
        return None

    def goal_reward(self, achieved: Array, goal: Array) -> Array:
        """Reward by what is achieved and a goal alone, each of shape (..., goal_numbers): for goals that are given afterwards."""
        raise NotImplementedError

    def measures(self, batch: Batch) -> dict[str, Array]:
        """Distances and other numbers of `info`, by name with unit, each of shape (n,)."""
        return {}


class SceneTask(Task):
    """Any scene, with a reward of the caller's.

    An action moves the targets of the driven axes over their range of motion (0: middle), or without control scales
    joint torques by ``torque``.
    """

    def __init__(self, scene: Union[Scene, str], reward: BatchFunction, *,
                 terminated: Optional[BatchFunction] = None, observe: Sequence[str] = ("q", "u"),
                 vary: Vary = None, variants: int = 16, substeps: int = 10, max_steps: int = 100,
                 torque: float = 0.1, start: Optional[Motion] = None) -> None:
        """
        :param reward: called with the `Batch` after each step, returns shape (n,)
        :param terminated: the same, returns shape (n,) of dtype bool
        :param vary: as `HandTask`
        :param variants: as `HandTask`
        :param torque: of an action of 1 [N m], in a scene without control
        :param start: a motion of the scene that episodes begin with
        """
        drawn = drawn_by(vary)
        self.scene = scene if isinstance(scene, Scene) else load(scene)
        if drawn.scenes and (self.scene._origin is None or start is not None):
            raise input_error("vary", ", ".join(drawn.scenes), "keys of a scene that `load` made, without a start")
        if self.scene._origin is not None:
            source, words = self.scene._origin
            own = dict(word.partition("=")[::2] for word in words)
            for end in drawn.ends:  # units and bounds are the reader's
                load(source, {**own, **end})
            random = np.random.default_rng(0)
            if drawn.scenes:
                self.people = [load(source, {**own, **scene_values(drawn.scenes, random)})
                               for _ in range(whole("variants", variants, 1, MOST_PERSONS))]
                self.scene = self.people[0]
        self.observe, self.randomise = observe, drawn.episodes
        self.substeps, self.max_steps = substeps, max_steps
        self._reward, self._terminated, self._start = reward, terminated, start
        self._torque = torque
        limits = self.scene.limits[self.scene.axis_coordinates]
        self._middle, self._half = limits.mean(axis=1), np.diff(limits, axis=1)[:, 0] / 2
        self.actions = len(self.scene.axes) or len(self.scene.coordinates)

    def start(self) -> Optional[Motion]:
        return self._start

    def drive(self, batch: Batch, action: Array, random: np.random.Generator) -> dict[str, Any]:
        if self.scene.axes:
            return {"targets": self._middle + self._half * action}
        return {"torques": self._torque * action}

    def reward(self, batch: Batch, action: Array) -> Array:
        return np.asarray(self._reward(batch), dtype=float)

    def terminated(self, batch: Batch) -> Mask:
        if self._terminated is None:
            return super().terminated(batch)
        return np.asarray(self._terminated(batch), dtype=bool)


DRIVES = ("targets", "torques", "muscles")
MOST_PERSONS = 1024
"""Each is a scene of its own."""


class HandTask(Task):
    """A hand with a fixed forearm that an action drives in one of three ways.

    ``targets``: change of the angle that each joint's servo holds, 1 is ``speed``. ``torques``: of each joint, 1 is
    ``torque``. ``muscles``: excitation of each muscle, ((1 + action) / 2)^3, so that an action of 0 hardly excites. The
    observation begins with q and u of all joints, and what the drive holds: the activations, or (as last numbers) the
    targets less q.
    """

    speed = 0.15
    """Change of a target by an action of 1 [rad]."""
    torque = 0.3
    """Of an action of 1 [N m]."""

    def __init__(self, title: str, rotation: Union[dict[str, Any], Sequence[dict[str, Any]]], drive: str, *, hands: int = 1, persons: int = 0, vary: Vary = None, variants: int = 16,
                 place: Any = (0, 0, 0.2), mount: str = "fixed", pose: Optional[Mapping[str, Any]] = None, taxels: bool = False,
                 **scene: Any) -> None:
        """
        :param rotation: of the wrist, as in a scene; or a list with one for each of `people`, as ``place`` then is
        :param drive: ``targets``, ``torques`` or ``muscles``
        :param hands: 1: the right one; 2: both, 0.3 m apart
        :param persons: drawn from a survey (`draw_persons`), one of them anew for each episode; 0: the median man
        :param vary: keys of the scene, as ``--set`` takes them, each with a value or a way of a study of rollouts: ``uniform``,
            ``log_uniform``, ``normal`` (with ``mean`` and ``sd``) or ``choice``. gravity, mass and friction of objects, and a batch's gains,
            torque_limits and q are drawn anew for each episode; all others make scenes, one of which each episode has
        :param variants: number of these scenes, without persons
        :param place: of the wrist, or of the middle between both [m]
        :param mount: of the palm, as in a scene
        :param pose: angles of joints at the start, as in a scene
        :param taxels: forces on points of the finger pads, 5 mm apart, are observed, too [N]: after q, u and activations
        :param scene: keys of the scene
        """
        if not isinstance(hands, (int, np.integer)) or isinstance(hands, bool) or hands not in (1, 2):
            raise input_error("hands", str(hands), "1 or 2")
        if not isinstance(drive, str) or drive not in DRIVES:
            raise input_error("drive", str(drive), f"one of {', '.join(DRIVES)}")
        data = data_path()
        motors = {"control": {"controller": str(data / "controllers/implicit.yaml"),
                              "poses": str(data / "controllers/poses.yaml"), "program": "every_pose"}}
        own: dict[str, list[str]] = {"targets": ["actuation"], "torques": [], "muscles": ["muscles", "tendon_coupling"]}
        effects = list(dict.fromkeys([*scene.pop("effects", ["gravity", "joint_stops", "passive_tissue"]), *own[drive]]))
        tissue = {} if drive == "muscles" else {"tissue": {"stiffness": 0, "damping": 1}}
        self.driven = drive
        model, who = str(data / "handmodels/anatomical.yaml"), str(data / "config/persons/median_man.yaml")
        turned = [rotation] if isinstance(rotation, Mapping) else list(rotation)
        places = [place] if isinstance(rotation, Mapping) else list(place)

        drawn, random = drawn_by(vary), np.random.default_rng(0)
        self.randomise = drawn.episodes

        def made(k: int, person: Any, values: Mapping[str, Any]) -> Scene:
            x, y, z = places[k % len(places)]
            sides = {"right": x + 0.15 * (hands - 1), "left": x - 0.15}
            return load({
                "title": title,
                "hands": [{"model": model, "person": person, "side": side, **tissue,
                           **({"pose": pose} if pose else {}),
                           "wrist": {"mount": mount, "position": [across, y, z], "rotation": turned[k % len(turned)]}}
                          for side, across in list(sides.items())[:hands]],
                **(motors if drive == "targets" else {}), "effects": effects,
                "solver": {"engine": "articulated", "step": "5 ms"}, "duration": "1000 s", **scene}, values)

        people: list[Any] = list(draw_persons(persons)) if whole("persons", persons, 0, MOST_PERSONS) else []
        if drawn.scenes and not people:
            people = [who] * whole("variants", variants, 1, MOST_PERSONS)
        self.people = [made(k, person, scene_values(drawn.scenes, random)) for k, person in enumerate(people)]
        self.scene = self.people[0] if people else made(0, who, {})
        for end in drawn.ends:  # units and bounds are the reader's
            made(0, who, end)
        self.substeps = round(0.02 / self.scene.step)
        of_hands = [name.startswith(("right.", "left.")) for name in self.scene.coordinates]
        self._driven = self.scene.axis_coordinates if drive == "targets" else np.flatnonzero(of_hands)
        self._low, self._high = self.scene.limits[self._driven].T
        self.actions = len(self.scene.muscles) if drive == "muscles" else len(self._driven)
        self._targets = np.empty((0, len(self._driven)))
        self.observe = ("q", "u", *(["activation"] if drive == "muscles" else []), *(["taxels"] if flag("taxels", taxels) else []),
                        *self.observe[2:])

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        if self._targets.shape != (len(batch), len(self._driven)):
            self._targets = np.zeros((len(batch), len(self._driven)))
        if self.driven == "targets":
            self._targets[mask] = batch.q[mask][:, self._driven]

    def drive(self, batch: Batch, action: Array, random: np.random.Generator) -> dict[str, Any]:
        if self.driven == "muscles":
            return {"excitations": self._excitation(action)}
        if self.driven == "torques":
            torques = np.zeros((len(batch), len(self.scene.coordinates)))
            torques[:, self._driven] = self.torque * action
            return {"torques": torques}
        self._targets = _clipped(self._targets + self.speed * action, self._low, self._high)
        return {"targets": self._targets}

    @staticmethod
    def _excitation(action: Array) -> Array:
        return ((1 + action) / 2) ** 3

    def _with(self, batch: Batch, *more: Array) -> Array:
        if self.driven == "targets":
            more = (self._targets - batch.q[:, self._driven], *more)
        return np.concatenate((batch.observation, *more), axis=1)

    def _held(self, parts: Sequence[str]) -> tuple[dict[str, Array], NDArray[np.int_]]:
        """Parts of the observation in postures that the drive can hold, each after a second of one random action; and the
        person of each. 512 postures, or 64 of each person."""
        n = 64 * len(self.people) if self.people else 512
        batch, random = Batch(self.scene, n, observe=parts), np.random.default_rng(0)
        person = np.arange(n) % max(1, len(self.people))
        for i, scene in enumerate(self.people[k] for k in person if self.people):
            batch.replace(i, scene)
        if self.driven == "targets":
            action = {"targets": self._low + (0.1 + 0.8 * random.random((n, self.actions))) * (self._high - self._low)}
        elif self.driven == "torques":
            action = {"torques": self.torque * 0.1 * random.uniform(-1, 1, (n, len(self.scene.coordinates)))}
        else:
            action = {"excitations": 0.4 * random.random((n, self.actions)) * (random.random((n, self.actions)) < 0.3)}
        batch.step(**action, substeps=round(1 / self.scene.step))
        return {part: batch[part][~batch.failed].copy() for part in parts}, person[~batch.failed]


class _Goal(HandTask):
    """Goals are drawn for each episode among postures that the drive can hold. An episode is a success, and ends, after
    five steps in a row with a distance below ``near``; it is truncated after ``max_steps``."""

    near: float
    unit: str
    """Name of the distance in `info`."""
    bonus = 10.0
    """Reward of success."""
    steady = 5
    """Steps near the goal that make a success."""

    def _prepare(self, goals: Array, person: NDArray[np.int_]) -> None:
        self._goals = [goals[person == k] for k in range(person.max() + 1)]
        self._goal = np.empty((0, goals.shape[1]))
        self._near = np.empty(0, int)

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        super().begin(batch, mask, random)
        if len(self._goal) != len(batch):
            self._goal, self._near = np.zeros((len(batch), self._goals[0].shape[1])), np.zeros(len(batch), int)
        for i in np.flatnonzero(mask):
            own = self._goals[self.person[i]]
            self._goal[i] = own[random.integers(len(own))]
        self._near[mask] = 0

    def _missing(self, batch: Batch) -> Array:
        """Goal less what there is, shape (n, numbers)."""
        raise NotImplementedError

    def distance(self, batch: Batch) -> Array:
        """Shape (n,)."""
        raise NotImplementedError

    def observation(self, batch: Batch) -> Array:
        return self._with(batch, self._missing(batch))

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        distance = self.distance(batch)
        self._near = np.where(distance < self.near, self._near + 1, 0)
        effort = 0.01 * _mean_square(self._excitation(action) if self.driven == "muscles" else action)
        return {"success": self.bonus * (self._near >= self.steady), "near": 1.0 * (distance < self.near),
                "distance": -distance / self.near / 5, "effort": -effort}

    def terminated(self, batch: Batch) -> Mask:
        return np.asarray(self._near >= self.steady)

    def succeeded(self, batch: Batch) -> Optional[Mask]:
        return self.terminated(batch)

    def measures(self, batch: Batch) -> dict[str, Array]:
        return {self.unit: self.distance(batch)}


_PALM_SIDE = {"axis": [1, 0, 0], "angle": "90 deg"}
_VIEWS = {hands: {"size": [480, 480], "camera": {"position": [0, 0.5, 0.32], "target": [0, 0, 0.28], "field_of_view": angle}}
          for hands, angle in ((1, "30 deg"), (2, "46 deg"))}


class Pose(_Goal):
    """The hand takes a pose: the root mean square of the distances of all joints to it falls below 0.1 rad.

    Observation: q, u, what the drive holds (`HandTask`), and the goal less q. Reward of a step (20 ms): 1 within 0.1 rad,
    minus twice the distance [rad], minus 0.01 times the mean square of the action (of the excitation); 10 on success.
    """

    max_steps = 100
    near, unit = 0.1, "distance_rad"
    """[rad]"""

    def __init__(self, *, drive: str = "targets", hands: int = 1, persons: int = 0, vary: Vary = None, variants: int = 16) -> None:
        """As `HandTask`."""
        super().__init__("a hand takes a pose", _PALM_SIDE, drive, hands=hands, persons=persons, vary=vary, variants=variants, pictures=_VIEWS.get(hands, {}))
        held, person = self._held(["q"])
        self._prepare(held["q"], person)

    def _missing(self, batch: Batch) -> Array:
        return np.asarray(self._goal - batch.q)

    def distance(self, batch: Batch) -> Array:
        return np.asarray(np.sqrt(_mean_square(self._missing(batch))))


class Reach(_Goal):
    """The fingertips reach places that are drawn for each episode: their mean distance falls below 12.5 mm.

    Observation: q, u, what the drive holds (`HandTask`), and the goals less the fingertips [dm], x y z of thumb to little
    finger. Reward of a step (20 ms): 1 within 12.5 mm, minus 16 times the mean distance [m], minus 0.01 times the mean
    square of the action (of the excitation); 10 on success.
    """

    max_steps = 100
    near, unit = 0.0125, "distance_m"
    """[m]"""
    observe = ("q", "u", "fingertips")

    def __init__(self, *, drive: str = "targets", hands: int = 1, persons: int = 0, vary: Vary = None, variants: int = 16,
                 goals: bool = False) -> None:
        """
        As `HandTask`.

        :param goals: the observation is a dictionary with the fingertips (``achieved_goal``) and their places (``desired_goal``)
            [m]; the reward is 0 within 12.5 mm, else -1, and episodes end by their limit alone
        """
        super().__init__("fingertips reach their places", _PALM_SIDE, drive, hands=hands, persons=persons, vary=vary,
                         variants=variants, pictures=_VIEWS.get(hands, {}))
        held, person = self._held(["fingertips"])
        self._prepare(self._places(held["fingertips"]), person)
        if flag("goals", goals):
            self.goal_numbers = self._goal.shape[1]

    @staticmethod
    def _places(tips: Array) -> Array:
        return tips.reshape(len(tips), -1, 7)[:, :, :3].reshape(len(tips), -1)

    def _missing(self, batch: Batch) -> Array:
        return np.asarray(10 * (self._goal - self._places(batch["fingertips"])))

    def distance(self, batch: Batch) -> Array:
        return np.asarray(0.1 * np.linalg.norm(self._missing(batch).reshape(len(batch), -1, 3), axis=2).mean(axis=1))

    def observation(self, batch: Batch) -> Array:
        if not self.goal_numbers:
            return super().observation(batch)
        return self._with(batch, self._places(batch["fingertips"]), self._goal)

    def goal_reward(self, achieved: Array, goal: Array) -> Array:
        apart = np.float32(goal) - np.float32(achieved)
        distance = np.linalg.norm(apart.reshape(*apart.shape[:-1], -1, 3), axis=-1).mean(axis=-1)
        return np.where(distance < self.near, 0.0, -1.0)

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        if not self.goal_numbers:
            return super().terms(batch, action)
        return {"goal": self.goal_reward(self._places(batch["fingertips"]), self._goal)}

    def succeeded(self, batch: Batch) -> Optional[Mask]:
        if not self.goal_numbers:
            return super().succeeded(batch)
        return np.asarray(self.goal_reward(self._places(batch["fingertips"]), self._goal) == 0)


class _InHand(HandTask):
    """An object in a hand. ``targets``: an action moves them about those of `_middle`; the others as `HandTask`."""

    observe = ("q", "u", "objects")
    span = 0.6
    """Change of a target by an action of 1 [rad]."""

    def _begin_as(self, settled: Sequence[Simulation]) -> None:
        """Episodes begin as simulations by targets stand, one of each of `people`; by torques and muscles at rest in their
        postures."""
        begun = list(settled)
        if self.driven == "targets":
            self.people = [each.scene for each in settled] if self.people else []
            self.scene, self._driven = settled[0].scene, settled[0].scene.axis_coordinates
            self._low, self._high = self.scene.limits[self._driven].T
            self._middle = np.array([each.q[self._driven] for each in settled])
            self.actions = len(self._driven)
        else:
            for k, (scene, of) in enumerate(zip(self.people or [self.scene], settled)):
                begun[k] = Simulation(scene)
                begun[k].reset(q=of.q, objects=_seen(of, "objects")[:, :7])
        self._motions = [each.motion() for each in begun]
        body = self.scene.bodies.index(self.scene.objects[0])
        self._start_place = np.array([each.bodies.position[body] for each in begun])
        self._first = np.array([each.bodies.quaternion[body] for each in begun])

    def start(self) -> Optional[Motion]:
        return self._motions[0]

    def start_of(self, person: int) -> Optional[Motion]:
        return self._motions[person]

    def drive(self, batch: Batch, action: Array, random: np.random.Generator) -> dict[str, Any]:
        if self.driven != "targets":
            return super().drive(batch, action, random)
        return {"targets": np.clip(self._middle[self.person] + self.span * action, self._low, self._high)}

    def _shift(self, batch: Batch) -> Array:
        """Of the object's centre from its place at the start [m], shape (n, 3)."""
        return np.asarray(batch["objects"][:, :3] - self._start_place[self.person])

    def measures(self, batch: Batch) -> dict[str, Array]:
        return {"shift_m": np.linalg.norm(self._shift(batch), axis=1)}

    def observation(self, batch: Batch) -> Array:
        out = batch.observation.copy()
        first = len(batch.columns) - 13
        out[:, first:first + 3] = self._shift(batch)
        return out


def _seen(simulation: Simulation, part: str) -> Array:
    """A part of the observation, shape (1, numbers)."""
    batch = Batch(simulation.scene, 1, observe=[part])
    batch.reset(to=simulation.motion())
    return batch[part]


Object = Union[str, "PathLike[str]", Mapping[str, Any], None]


def _object_keys(given: Any) -> dict[str, Any]:
    """Keys of a scene's object. A file or mesh is looked for from the working folder; a word without a folder is a shipped one's name."""
    if isinstance(given, Mapping):
        return {"name": "object", **given}
    if not isinstance(given, (str, PathLike)):
        raise input_error("object", repr(given), "the name of a shipped one, a file, or keys of a scene's object")
    path = Path(given)
    if path.suffix.lower() in (".obj", ".stl"):
        return {"name": path.stem, "shape": "convex_mesh", "mesh": str(path.absolute()), "mass": "60 g"}
    return {"name": path.stem, "file": str(path.absolute() if path.exists() else path)}


_TOUCHED: dict[str, Any] = {"effects": ["gravity", "object_contact", "friction", "joint_stops", "passive_tissue"],
            "solver": {"engine": "articulated", "step": "2 ms"}}


class Hold(_InHand):
    """The hand holds a soup can while random forces pull at it.

    An episode begins with the can lifted in a closed hand, which an action of 0 opens by 0.3 rad in each flexion: the can
    falls. Observation: q, u, and of the can its shift from the start [m], quaternion, velocity and angular velocity.
    Action: target of each joint, 1 is 0.6 rad more flexion or abduction; torques and excitations as `HandTask`, which begin
    with a hand at rest in the same posture. Each 0.1 s a new force of random direction pulls
    at the can, up to ``disturbance`` times its weight. Reward of a step (20 ms): 1 minus the can's shift over 50 mm,
    minus 0.05 times the mean square of the action. An episode is terminated when the can has moved by 50 mm, truncated
    after 100 steps.
    """

    substeps = 10
    max_steps = 100
    dropped = 0.05
    """Shift at which the can is dropped [m]."""
    opened = 0.3
    """Extension of an action of 0 [rad]."""
    force_steps = 5
    forces = 20
    """Drawn for each episode; a longer one has them again."""

    def __init__(self, *, drive: str = "targets", disturbance: float = 1, persons: int = 0, vary: Vary = None,
                 variants: int = 16, taxels: bool = False) -> None:
        """
        :param drive: ``targets``, ``torques`` or ``muscles``
        :param disturbance: largest force over the can's weight
        :param persons: each begins with a grasp of their own; as `HandTask`
        :param vary: as `HandTask`; contacts.materials.0 is the pad of fingers and can
        :param taxels: as `HandTask`
        :raises Error: of kind input for one whose hand does not hold the can
        """
        pictures = {"size": [480, 480], "camera": {"position": [-0.4, 0.35, 0.75], "target": [-0.02, 0.06, 0.61],
                                                   "field_of_view": "29 deg"}}
        drawn, random = drawn_by(vary), np.random.default_rng(0)
        people: list[dict[str, Any]] = [{"hands.0.person": each} for each in draw_persons(persons)] if whole("persons", persons, 0, MOST_PERSONS) else []
        count = len(people) or (whole("variants", variants, 1, MOST_PERSONS) if drawn.scenes else 1)
        held = []
        for k in range(count):
            one = Simulation(load("grasp_power_can", {
                "title": "a hand holds a can", "grasps.0.hold": "1000 s", "solver.step": "2 ms",
                **{f"pictures.{key}": value for key, value in pictures.items()}, **(people[k] if people else {}),
                **scene_values(drawn.scenes, random)}, engine="articulated"))
            one.step(substeps=round(2.4 / one.scene.step))
            if len(one.contacts) == 0:
                raise input_error("vary", f"hand {k}, which does not hold the can", "hands, pads and cans that a grasp holds")
            held.append(one)
        wrists = [_seen(one, "wrists")[0] for one in held]
        turns = [{"axis": (wrist[4:7] / np.linalg.norm(wrist[4:7])).tolist(), "angle": float(2 * np.arccos(np.clip(wrist[3], -1, 1)))}
                 for wrist in wrists]
        super().__init__(held[0].scene.title, turns, drive, place=[wrist[:3].tolist() for wrist in wrists], persons=persons, vary=vary,
                         variants=variants, taxels=taxels, pictures=pictures, **_TOUCHED, objects=[
                             {"name": held[0].scene.objects[0], "position": [0, 0, 1],
                              "file": str(data_path() / "config/objects/tomato_soup_can.yaml")}], contacts={
                             "materials": [{"name": "pad", "file": str(data_path() / "handmodels/finger_pad.yaml"),
                                            "spinning_friction": 0}],
                             "rules": [{"between": ["hands", "objects"], "material": "pad"}]})
        self._begin_as(held)
        if drive == "targets":
            self._middle -= self.opened * np.array([name.endswith("flexion") for name in self.scene.axes])
        self._body = self.scene.objects[0]
        weight = 9.80665 * self.scene.masses[self.scene.bodies.index(self._body)]
        self._largest = real("disturbance", disturbance) * weight
        self._forces, self._age = np.empty((0, 0, 3)), np.empty(0, int)

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        super().begin(batch, mask, random)
        if len(self._forces) != len(batch):
            self._forces, self._age = np.zeros((len(batch), self.forces, 3)), np.zeros(len(batch), int)
        direction = random.normal(size=(int(mask.sum()), self.forces, 3))
        direction /= np.linalg.norm(direction, axis=2, keepdims=True)
        self._forces[mask] = self._largest * random.random((len(direction), self.forces, 1)) * direction
        self._age[mask] = 0

    def drive(self, batch: Batch, action: Array, random: np.random.Generator) -> dict[str, Any]:
        force = self._forces[np.arange(len(batch)), self._age // self.force_steps % self.forces]
        self._age += 1
        return {**super().drive(batch, action, random), "forces": {self._body: force}}

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        shift = np.linalg.norm(self._shift(batch), axis=1)
        return {"shift": 1 - np.minimum(1, shift / self.dropped), "action": -0.05 * np.square(action).mean(axis=1)}

    def terminated(self, batch: Batch) -> Mask:
        return np.asarray(np.linalg.norm(self._shift(batch), axis=1) > self.dropped)

    def succeeded(self, batch: Batch) -> Optional[Mask]:
        return ~self.terminated(batch)


class _InPalm(_InHand):
    """An object lies in the bent fingers of a hand whose palm is up, its fingers lower than its wrist."""

    span = 0.4
    mount = "fixed"
    """Of the palm, as in a scene."""
    lost = 0.06
    """Shift at which the object is lost [m]."""
    bent = {"thumb_mcp": 0.3, "thumb_ip": 0.4, "mcp": 0.9, "pip": 0.8, "dip": 0.4}
    """Flexion of thumb and fingers at the start [rad]."""

    thing: Mapping[str, Any]
    """The object, where no other is asked for."""

    def __init__(self, title: str, *, drive: str = "targets", persons: int = 0, object: Object = None, vary: Vary = None,
                 variants: int = 16, taxels: bool = False) -> None:
        """
        :param object: in place of the task's own: a shipped one's name, a file of an object, an OBJ or STL file of a convex mesh
            in metres (60 g), or keys of a scene's object
        :raises Error: of kind input for an object that does not lie in the hand
        """
        # Half a turn about an axis 17.5 degrees from the forearm: the palm is up, the fingers are 35 degrees down.
        rotation = {"axis": [0, 0.9537, -0.3007], "angle": "180 deg"}
        given: dict[str, Any] = {"persons": persons, "vary": vary, "variants": variants, "mount": self.mount, **_TOUCHED, "objects": [
            {"position": [0, 0.11, 0.23], **(self.thing if object is None else _object_keys(object))}], "pictures": {
            "size": [480, 480], "camera": {"position": [-0.15, 0.55, 0.5], "target": [0, 0.1, 0.18], "field_of_view": "22 deg"}}}
        by_targets = HandTask(title, rotation, "targets", **given)
        settled = [self._settled(scene) for scene in by_targets.people or [by_targets.scene]]
        super().__init__(title, rotation, drive, taxels=taxels, **given)
        self._begin_as(settled)
        if drive == "targets":
            self._middle = np.array([self._bent(scene) for scene in self.people or [self.scene]])

    def _bent(self, scene: Scene) -> Array:
        return np.array([self._angle(name) for name in scene.axes])

    def _settled(self, scene: Scene) -> Simulation:
        """After a second in which the object comes to rest."""
        out, body = Simulation(scene), scene.bodies.index(scene.objects[0])
        first = out.bodies.position[body].copy()
        out.step(targets=self._bent(scene), substeps=round(1.0 / scene.step))
        if np.linalg.norm(out.bodies.position[body] - first) > 2 * self.lost:
            raise input_error("object", f"{scene.objects[0]}, which falls from the hand within a second",
                              "one that lies in the bent fingers; its `position` says where it begins")
        return out

    def _angle(self, axis: str) -> float:
        _, joint, kind = axis.split(".")
        return self.bent.get(joint, self.bent.get(joint.partition("_")[2], 0)) if kind == "flexion" else 0

    def _lost(self, batch: Batch) -> Mask:
        return np.asarray(np.linalg.norm(self._shift(batch), axis=1) > self.lost)


class Turn(_InPalm):
    """The hand turns a ball that lies in it.

    The palm is up, its fingers lower than its wrist; a tennis ball lies in the bent fingers. Observation: q, u, and of the
    ball its shift from the start [m], quaternion, velocity and angular velocity. Action: target of each joint, 1 is 0.4 rad
    from its target at the start; torques and excitations as `HandTask`. Reward of a step (20 ms): the angle that the ball turns about the vertical,
    counterclockwise from above [rad], minus 0.002 times the mean square of the action. An episode is terminated when the
    ball has moved by 60 mm, with 5 less of reward; truncated after 200 steps.
    """

    max_steps = 200
    thing = {"name": "ball", "file": str(data_path() / "config/objects/tennis_ball.yaml")}

    def __init__(self, *, drive: str = "targets", persons: int = 0, object: Object = None, vary: Vary = None,
                 variants: int = 16, taxels: bool = False) -> None:
        """As `HandTask`; ``object``: a shipped one's name, a file, a mesh, or keys of a scene's object."""
        super().__init__("a hand turns a ball", drive=drive, persons=persons, object=object, vary=vary, variants=variants, taxels=taxels)

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        return {"turned": batch["objects"][:, 12] * self.scene.step * self.substeps,
                "action": -0.002 * np.square(action).mean(axis=1), "lost": -5.0 * self.terminated(batch)}

    def terminated(self, batch: Batch) -> Mask:
        return self._lost(batch)


class Reorient(_InPalm):
    """The hand turns a die of 45 mm that lies in it to an orientation that is drawn for each episode: up to ``turned`` from
    the first one, about any axis.

    Observation: as `Turn`, of the die, and the rotation that is missing, as a rotation vector [rad]. Action: as `Turn`.
    Reward of a step (20 ms): 1 within ``near`` (0.2 rad), minus the missing angle [rad], minus 0.002 times the mean square
    of the action; 10 on success, 5 less where the die has moved by 60 mm. Success, after five steps within ``near``, and
    loss end the episode; it is truncated after 150 steps.
    """

    max_steps = 150
    near = 0.2
    """[rad]"""
    turned = 1.0
    """[rad]"""
    steady = 5
    thing: Mapping[str, Any] = {"name": "die", "shape": "box", "edges": ["45 mm", "45 mm", "45 mm"], "mass": "60 g"}

    def __init__(self, *, drive: str = "targets", persons: int = 0, object: Object = None, vary: Vary = None,
                 variants: int = 16, taxels: bool = False) -> None:
        """As `Turn`."""
        super().__init__("a hand turns a die", drive=drive, persons=persons, object=object, vary=vary, variants=variants, taxels=taxels)
        self._goal, self._near = np.empty((0, 4)), np.empty(0, int)

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        if len(self._goal) != len(batch):
            self._goal, self._near = np.zeros((len(batch), 4)), np.zeros(len(batch), int)
        first = self._first[self.person[mask]]
        axis = self._across(random.normal(size=(len(first), 3)), first)
        half = 0.5 * self.turned * random.uniform(0.3, 1, (len(axis), 1))
        turn = np.hstack([np.cos(half), np.sin(half) * axis / np.linalg.norm(axis, axis=1, keepdims=True)])
        self._goal[mask] = _product(turn, first)
        self._near[mask] = 0

    def _across(self, axes: Array, first: Array) -> Array:
        """The part of axes of rotation that counts, of objects that begin with these orientations."""
        return axes

    def missing(self, batch: Batch) -> Array:
        """Rotation vector from the object's orientation to its goal, world axes [rad], shape (n, 3)."""
        return _rotation_vector(self._goal, batch["objects"][:, 3:7])

    def observation(self, batch: Batch) -> Array:
        return np.concatenate((super().observation(batch), self.missing(batch)), axis=1)

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        angle = np.linalg.norm(self.missing(batch), axis=1)
        self._near = np.where(angle < self.near, self._near + 1, 0)
        return {"near": 1.0 * (angle < self.near), "angle": -angle, "action": -0.002 * _mean_square(action),
                "success": 10.0 * (self._near >= self.steady), "lost": -5.0 * self._lost(batch)}

    def terminated(self, batch: Batch) -> Mask:
        return np.asarray((self._near >= self.steady) | self._lost(batch))

    def succeeded(self, batch: Batch) -> Optional[Mask]:
        return np.asarray((self._near >= self.steady) & ~self._lost(batch))

    def measures(self, batch: Batch) -> dict[str, Array]:
        return {**super().measures(batch), "distance_rad": np.linalg.norm(self.missing(batch), axis=1)}


class PenTwirl(Reorient):
    """As `Reorient`, with a marker of 139 mm: only the direction of its axis has a goal, up to 1 rad from the first one."""

    thing = {"name": "pen", "file": str(data_path() / "config/objects/large_marker.yaml"),
             "rotation": {"axis": [0, 1, 0], "angle": "90 deg"}}

    def _across(self, axes: Array, first: Array) -> Array:
        own = _axis(first)
        return np.asarray(axes - np.sum(axes * own, axis=1, keepdims=True) * own)

    def missing(self, batch: Batch) -> Array:
        """The least rotation of the pen's axis to its goal, world axes [rad], shape (n, 3)."""
        now, goal = _axis(batch["objects"][:, 3:7]), _axis(self._goal)
        normal = np.cross(now, goal)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        angle = np.arctan2(length, np.sum(now * goal, axis=1, keepdims=True))
        return np.asarray(angle * normal / np.maximum(length, 1e-12))


class KeyTurn(HandTask):
    """Thumb and index turn a key against its lock's spring: the bow of 24 mm stands between their tips, on a hinge that points
    away from the palm, and a torque turns it back, drawn for each episode from 0.02 to 0.06 N m. Forearm and wrist are fixed,
    so that the fingers alone turn the key; they touch each other.

    The key is held while thumb and index touch something, and their tips are within 30 mm of the bow's middle, on the two
    sides of the bow where they began. Observation: q and u of all joints, the last one's the key's, what the drive holds
    (`HandTask`), the tips' poses, force [N] and number of contact points of palm and fingers, the bow's middle less thumb's
    and index' tips, and how far these are from the bow's plane [dm]. Reward of a step (20 ms): ten times the angle by which a
    held key turns on, clockwise as the hand sees it [rad], of one that is not held 0.3 of it, 2 for each step in a row held
    beyond 60 degrees; what is lost again is taken back. Minus 0.5 times the mean distance of the two tips from the bow's
    middle [dm], minus 0.01 times the mean square of the action (of the excitation). 10 on success: five steps in a row held
    beyond 60 degrees. Stops are at 0 and 90 degrees. Success ends the episode; it is truncated after 100 steps. Targets are
    held by the gains of controllers/muscles.yaml: those of the other tasks are too soft to turn the key.
    """

    max_steps = 100
    turned, steady = np.pi / 3, 5
    """[rad]; steps"""
    near = 0.03
    """Of the tips from the bow's middle, while the key is held [m]."""
    loose = 0.3
    """Share of the angle of a key that is not held, in the reward."""
    observe = ("q", "u", "fingertips", "finger_contacts")
    opened = {"thumb_cmc": (-0.06, 0.23), "thumb_mcp": (0.74,), "thumb_ip": (0.65,), "index_mcp": (0.86, 0.185), "index_pip": (0.835,),
              "index_dip": (0.5,)}
    """Angles of the hand around the key [rad]."""
    spring = 0.02, 0.06
    """Least and largest torque that turns the key back [N m]."""

    def __init__(self, *, drive: str = "targets", taxels: bool = False) -> None:
        """As `HandTask`."""
        free = Simulation(HandTask("a hand", _PALM_SIDE, "targets").scene)
        angles = {f"right.{joint}.{name}": angle for joint, of in self.opened.items()
                  for name, angle in zip(("flexion", "abduction"), of)}
        q = np.array([angles.get(name, 0.2 if name.endswith("flexion") and "mcp" in name else 0) for name in free.scene.coordinates])
        free.reset(q=q)
        tips = _seen(free, "fingertips").reshape(-1, 7)[:2, :3]
        self._place = tips.mean(axis=0)
        hinge = np.array([0.0, 1, 0])
        across = tips[1] - tips[0]
        across -= hinge * (hinge @ across)
        across /= np.linalg.norm(across)
        self._across, self._along = across, np.cross(hinge, across)
        axes = np.column_stack([across, self._along, hinge])
        turn = 0.5 * np.array([axes[2, 1] - axes[1, 2], axes[0, 2] - axes[2, 0], axes[1, 0] - axes[0, 1]])
        angle = float(np.arctan2(np.linalg.norm(turn), 0.5 * (np.trace(axes) - 1)))
        pose = {"position": self._place.tolist(), "rotation": {"axis": turn.tolist(), "angle": angle}}
        scene: dict[str, Any] = {**_TOUCHED, "effects": [*_TOUCHED["effects"], "self_contact", "actuation"], "pictures": {
            "size": [480, 480], "camera": {"position": [-0.08, 0.42, 0.38], "target": [-0.015, 0.04, 0.285], "field_of_view": "22 deg"}},
            "bodies": [{"name": "key", "mass": "30 g", "inertia": [5e-5, 5e-5, 5e-5], **pose, "collides": True, "friction": 0.8,
                        "shape": {"kind": "box", "edges": ["3 mm", "24 mm", "22 mm"]}}],
            "joints": [{"name": "lock", "type": "hinge", "parent": "world", "child": "key", "position": self._place.tolist(),
                        "axes": [{"name": "turn", "axis": hinge.tolist(), "range": [0, "90 deg"], "torque": -self.spring[0]}]}]}
        if drive == "targets":
            data = data_path()
            scene["control"] = {"controller": str(data / "controllers/muscles.yaml"), "poses": str(data / "controllers/poses.yaml"),
                                "program": "every_pose"}
        super().__init__("a hand turns a key", _PALM_SIDE, drive, taxels=taxels, **scene)
        start = Simulation(self.scene)
        start.reset(q=np.append(q, 0))
        self._motion = start.motion()
        columns = Batch(self.scene, 1, observe=["finger_contacts"]).columns
        self._points = {finger: columns.index(f"right.{finger}.points") for finger in ("thumb", "index")}
        self._before, self._beyond = np.empty(0), np.empty(0, int)
        self._back = np.empty((0, len(self.scene.coordinates)))

    def start(self) -> Optional[Motion]:
        return self._motion

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        super().begin(batch, mask, random)
        if len(self._before) != len(batch):
            self._before, self._beyond = np.zeros(len(batch)), np.zeros(len(batch), int)
            self._back = np.zeros((len(batch), len(self.scene.coordinates)))
        self._before[mask], self._beyond[mask] = 0, 0
        least, largest = self.spring
        self._back[mask, -1] = -random.uniform(0, largest - least, int(mask.sum()))

    def drive(self, batch: Batch, action: Array, random: np.random.Generator) -> dict[str, Any]:
        given = super().drive(batch, action, random)
        return {**given, "torques": given.get("torques", 0) + self._back}

    def _apart(self, batch: Batch) -> Array:
        tips = batch["fingertips"].reshape(len(batch), -1, 7)[:, :2, :3]
        return np.asarray(10 * (self._place - tips).reshape(len(batch), 6))

    def _distances(self, batch: Batch) -> Array:
        """Of thumb's and index' tip from the bow's middle [dm], shape (n, 2)."""
        return np.asarray(np.linalg.norm(self._apart(batch).reshape(-1, 2, 3), axis=2))

    def _sides(self, batch: Batch) -> Array:
        """How far thumb's and index' tip are from the bow's plane [dm], positive where they began, shape (n, 2)."""
        angle = batch.q[:, -1:]
        normal = np.cos(angle) * self._across + np.sin(angle) * self._along
        return np.asarray(np.einsum("ijk,ik->ij", self._apart(batch).reshape(-1, 2, 3), normal) * [1, -1])

    def held(self, batch: Batch) -> Mask:
        """Shape (n,)."""
        touching = batch["finger_contacts"][:, [self._points["thumb"], self._points["index"]]] > 0
        near = (self._distances(batch) < 10 * self.near) & (self._sides(batch) > 0)
        return np.asarray((touching & near).all(axis=1))

    def observation(self, batch: Batch) -> Array:
        return self._with(batch, self._apart(batch), self._sides(batch))

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        angle, held = batch.q[:, -1], self.held(batch)
        self._beyond = np.where((angle > self.turned) & held, self._beyond + 1, 0)
        worth = 10 * angle * np.where(held, 1, self.loose) + 2 * self._beyond
        gained, self._before = worth - self._before, worth
        effort = 0.01 * _mean_square(self._excitation(action) if self.driven == "muscles" else action)
        return {"gained": gained, "distance": -0.5 * self._distances(batch).mean(axis=1), "effort": -effort,
                "success": 10.0 * (self._beyond >= self.steady)}

    def terminated(self, batch: Batch) -> Mask:
        return np.asarray(self._beyond >= self.steady)

    def succeeded(self, batch: Batch) -> Optional[Mask]:
        return self.terminated(batch)

    def measures(self, batch: Batch) -> dict[str, Array]:
        return {"angle_rad": batch.q[:, -1].copy(), "distance_m": 0.1 * self._distances(batch).mean(axis=1)}


def _product(a: Array, b: Array) -> Array:
    """Of quaternions w x y z, row by row."""
    w, v, x, u = a[:, :1], a[:, 1:], b[:, :1], b[:, 1:]
    return np.hstack([w * x - np.sum(v * u, axis=1, keepdims=True), w * u + x * v + np.cross(v, u)])


def _rotation_vector(goal: Array, now: Array) -> Array:
    """From orientations w x y z to others, world axes [rad], row by row."""
    turn = _product(goal, now * [1, -1, -1, -1])
    turn = np.where(turn[:, :1] < 0, -turn, turn)
    length = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
    return np.asarray(2 * np.arctan2(length, turn[:, :1]) * turn[:, 1:] / np.maximum(length, 1e-12))


def _axis(q: Array) -> Array:
    """The z axis of each orientation w x y z, in the world."""
    w, x, y, z = q.T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
