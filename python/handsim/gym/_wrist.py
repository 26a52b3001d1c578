"""Tasks in which the wrist moves, within limits of speed and force. Needs numpy only."""
from __future__ import annotations

from typing import Any, Mapping, Sequence

import numpy as np

from .._batch import Batch
from .._errors import flag, input_error
from .._model import turned
from .._shipped import data_path
from .._simulation import Simulation
from ._goals import ToGoals
from ._tasks import _TOUCHED, Array, Mask, _rotation_vector, _seen
from ._vary import Vary


class MovingWrist(ToGoals):
    """A hand that an arm carries: a free palm, and a force and a moment on it. The first four numbers of an action move the place
    where the hand shall be, by x, y and z (1 is ``speed_of_place``), and turn it about the vertical (1 is ``turning``); the others
    drive the fingers. With ``synergy=True`` one number does, by targets: all joints go together from the open pose (-1) to beyond
    the closed one (1), as one postural synergy.

    The place is the grip's, a point that moves with the palm. A spring and a damper, critically damped, pull the palm there, and
    carry the hand's weight; what they give together is at most ``force`` and ``moment``, whatever the hand meets. The place stays
    within ``reach`` of where it began, and near the hand, so that a hand that is held back does not jump when it is let go. A hand
    that is faster than ``fastest``, by what its fingers do or meet, gets no power from the arm: it is braked only.
    """

    speed_of_place, turning = 0.4, 1.5
    """Of the place, of an action of 1 [m/s], [rad/s]."""
    fastest = 0.5
    """That the arm drives the hand, at its mass centre [m/s]."""
    force, moment = 30.0, 4.0
    """At most, of the arm on the palm, at the hand's mass centre [N], [N m]."""
    frequency = 50.0
    """Of the hand on the arm's spring, sliding and turning [rad/s]."""
    reach = (0.25, 0.25, 0.25), 1.4
    """Of the place, from where it began: x, y, z [m], and angle [rad]."""
    speed = 0.05
    """Largest change of a finger's target in a step [rad]."""
    press = 0.3
    """How far a target of 1 lies inside what a finger holds [rad]."""
    spread = 0.15
    """Of an action of 1 on joints that are alike in both poses [rad]."""
    opened: Mapping[str, Sequence[float]] = {
        "thumb_cmc": (-42, 0), "thumb_mcp": (46,), "thumb_ip": (52,), "index_mcp": (-9, 0), "index_pip": (35,), "index_dip": (24,),
        "middle_mcp": (-29, 0), "middle_pip": (65,), "middle_dip": (43,), "ring_mcp": (0, 0), "ring_pip": (44,), "ring_dip": (30,),
        "little_mcp": (33, -12), "little_pip": (2,), "little_dip": (2,)}
    closed: Mapping[str, Sequence[float]] = {
        "thumb_cmc": (-5, -6), "thumb_mcp": (55,), "thumb_ip": (57,), "index_mcp": (22, -2), "index_pip": (52,), "index_dip": (35,),
        "middle_mcp": (2, 2), "middle_pip": (82,), "middle_dip": (53,), "ring_mcp": (27, -6), "ring_pip": (57,), "ring_dip": (38,),
        "little_mcp": (58, -15), "little_pip": (10,), "little_dip": (7,)}
    """Flexion and abduction [degrees] of an action of -1 and of 1: open_sphere_70mm and sphere_70mm of controllers/grasp_poses.yaml."""
    at = -0.015, 0.105, -0.052
    """The grip in the hand frame [m]: the middle of a ball in the closed pose."""

    def _make(self, title: str, drive: str, above: Sequence[float], goals: bool, synergy: bool, **scene: Any) -> None:
        """:param above: the grip's place at the start [m]. :param scene: options of `HandTask`, and keys of the scene"""
        data = data_path()
        if flag("synergy", synergy) and drive != "targets":
            raise input_error("synergy", f"True beside drive {drive}", "drive targets, or synergy False")
        if drive == "targets":
            scene["control"] = {"controller": str(data / "controllers/grasp.yaml"), "poses": str(data / "controllers/poses.yaml"),
                                "program": "every_pose"}
        scene = {**_TOUCHED, **scene, "effects": [*_TOUCHED["effects"], *scene.get("effects", [])]}
        super().__init__(title, {"axis": [1, 0, 0], "angle": 0}, drive, place=(np.array(above) - self.at).tolist(), mount="free",
                         pose={joint: np.radians(angle).tolist() if len(angle) > 1 else float(np.radians(angle[0]))
                               for joint, angle in self.opened.items()}, **scene)
        names = [self.scene.coordinates[k].split(".") for k in self._driven]
        first, last = (np.radians([pose[joint][kind == "abduction"] for _, joint, kind in names]) for pose in (self.opened, self.closed))
        half = 0.5 * (last + [self.press * (kind == "flexion") for *_, kind in names] - first)
        self._middle, self._half = first + half, np.where(half == 0, 0 if synergy else self.spread, half)
        self.actions = 4 + (1 if synergy else self.actions)
        carried = []
        for each in self.people or [self.scene]:
            one = Simulation(each)
            body = [k for k, name in enumerate(each.bodies) if name.partition(".")[0] in each.hands]
            mass, places, wrist = each.masses[body], one.bodies.position[body], _seen(one, "wrists")[0, :3]
            centre = mass @ places / mass.sum()
            carried.append([*(places[0] - wrist), *(centre - wrist), mass.sum(), mass @ np.square(places - centre).sum(axis=1)])
        self._carried = np.array(carried)
        """Of each of `people`: mass centres of palm and hand in the hand frame [m], the hand's mass [kg], and moment about it [kg m2]."""
        self._home = np.array(above, dtype=float)
        self._place, self._angle, self.wrench = np.empty((0, 3)), np.empty(0), np.empty((0, 6))
        self.most = np.empty((0, 3))
        """Of the last step: the arm's largest force [N] and moment [N m], and the largest speed of the hand's mass centre [m/s],
        shape (n, 3)."""
        self._take_goals(goals)

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        if len(self._place) != len(batch):
            self._place, self._angle = np.zeros((len(batch), 3)), np.zeros(len(batch))
            self.wrench, self.most = np.zeros((len(batch), 6)), np.zeros((len(batch), 3))
        self._place[mask], self._angle[mask], self.wrench[mask], self.most[mask] = self._home, 0, 0, 0
        super().begin(batch, mask, random)

    def drive(self, batch: Batch, action: Array, random: np.random.Generator) -> dict[str, Any]:
        time, (far, most) = self.scene.step * self.substeps, self.reach
        way = action[:, :3] / np.maximum(1, np.linalg.norm(action[:, :3], axis=1, keepdims=True))
        asked = np.clip(self._place + self.speed_of_place * time * way, self._home - far, self._home + far)
        grip = self.grip(batch)
        ahead = asked - grip
        lag = 0.6 * self.force / (self._carried[self.person, 6:7] * self.frequency**2)
        self._place = grip + ahead * np.minimum(1, lag / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9))
        self._angle = np.clip(self._angle + self.turning * time * action[:, 3], -most, most)
        if self.driven != "targets":
            return super().drive(batch, action[:, 4:], random)
        asked = np.clip(self._middle + self._half * action[:, 4:], self._low, self._high)
        self._targets = self._targets + np.clip(asked - self._targets, -self.speed, self.speed)
        return {"targets": self._targets}

    def advance(self, batch: Batch, given: Mapping[str, Any]) -> None:
        self.most[:] = 0
        for _ in range(self.substeps):  # the arm acts anew in each step of the solver
            self._carry(batch)
            step: dict[str, Any] = {**given, **self.acts(batch, given), "forces": {"right.palm": self.wrench}}
            batch.step(**step)
            self.most = np.maximum(self.most, np.column_stack([*self._given, np.linalg.norm(self._speed(batch), axis=1)]))

    def acts(self, batch: Batch, given: Mapping[str, Any]) -> dict[str, Any]:
        """What a scene's mechanism adds in each step of the solver."""
        return {}

    def _lever(self, batch: Batch, of: Any) -> Array:
        """Of a point of the hand frame [m], world axes, shape (n, 3)."""
        return turned(batch["wrists"][:, 3:7], np.broadcast_to(of, (len(batch), 3)))

    def grip(self, batch: Batch) -> Array:
        """Where the hand's grip is [m], shape (n, 3)."""
        return batch["wrists"][:, :3] + self._lever(batch, self.at)

    def _speed(self, batch: Batch) -> Array:
        """Of the hand's mass centre, as if its fingers did not move [m/s], shape (n, 3)."""
        return batch["wrists"][:, 7:10] + np.cross(batch["wrists"][:, 10:13], self._lever(batch, self._carried[self.person, 3:6]))

    def _carry(self, batch: Batch) -> None:
        """The arm's force and moment of now, as they act at the palm's centre of mass."""
        wrists, (palm, centre, mass, inertia) = batch["wrists"], np.split(self._carried[self.person], [3, 6, 7], axis=1)
        half, rate = 0.5 * self._angle, self.frequency
        goal = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
        lever = self._lever(batch, centre)
        speed = self._speed(batch)
        missing = self._place + turned(goal, centre - self.at) - wrists[:, :3] - lever
        force = mass * (rate**2 * missing - 2 * rate * speed + [0, 0, 9.80665])
        moment = inertia * (rate**2 * _rotation_vector(goal, wrists[:, 3:7]) - 2 * rate * wrists[:, 10:13])
        for each, most in ((force, self.force), (moment, self.moment)):
            each *= np.minimum(1, most / np.maximum(np.linalg.norm(each, axis=1, keepdims=True), 1e-9))
        fast, power = np.sum(speed * speed, axis=1, keepdims=True), np.sum(force * speed, axis=1, keepdims=True)
        force -= np.where(fast > self.fastest**2, np.maximum(power, 0) / np.maximum(fast, 1e-9), 0) * speed
        self._given = np.linalg.norm(force, axis=1), np.linalg.norm(moment, axis=1)
        self.wrench = np.hstack([force, moment + np.cross(lever - self._lever(batch, palm), force)])

    def seen(self, batch: Batch) -> Array:
        return self._with(batch, 10 * (self._place - self.grip(batch)), self._angle[:, np.newaxis])

    def measures(self, batch: Batch) -> dict[str, Array]:
        return {**super().measures(batch), **dict(zip(("wrist_force_N", "wrist_moment_N_m", "wrist_speed_m_s"), self.most.T.copy()))}


class Relocate(MovingWrist):
    """The hand reaches for a ball that lies on the ground, grasps and lifts it, and holds it at a place in the air; or, with
    ``put_down=True``, puts it down at a place on the ground and lets go.

    The ball (70 mm, 150 g) lies up to 40 mm from the middle; its place is up to 0.15 m beside it and 0.08 to 0.2 m above the
    ground, both drawn for each episode. The hand begins with open fingers, palm down, 0.1 m above the middle; `MovingWrist` says
    what moves it. Action by targets: 4 of the wrist, then 20 of joints, -1 opens and 1 closes; torques and excitations as
    `HandTask`. Observation: q, u, wrist, fingertips, normal force and number of contact points of palm and fingers with ball and
    ground, the ball's pose and velocity, what the drive holds, place of the wrist less the grip [dm] and its angle, ball less grip
    [dm], and place less ball [m]. Reward of a step (20 ms): what it gains of a worth (`ToGoals`), minus 5 times the distance of ball and
    grip [dm], minus 10 times that of ball and place [dm], 2 and 5 times the ball's height above the ground [dm], at most 5, while thumb
    and a finger touch it, 2 for each step in a row within 25 mm of the place; minus 0.01 times the mean square of the action (of the
    excitation); 20 on success, after five steps in a row within 25 mm of the place; 10 less for a ball that is lost, 0.4 m from the
    middle. Truncated after 150 steps.

    ``put_down``: the place is on the ground, 0.08 to 0.15 m from where the ball lies. Success is five steps in a row in which the ball
    lies within 35 mm of it, slower than 50 mm/s, and nothing of the hand touches it, once thumb and a finger have had it 15 mm above the
    ground: a ball that is pushed there does not count. That it has been lifted is observed, too (0 or 1, before the last three numbers),
    and worth what it was worth to be held at 0.1 m; within 35 mm of the place the distance of ball and grip counts no more, and a ball
    that nothing touches there is worth 5. It does not go with ``goals``.
    """

    max_steps = 150
    numbers, near, unit = 3, 0.025, "distance_m"
    observe = ("q", "u", "wrists", "fingertips", "contact_pairs", "objects")
    radius = 0.035
    lies, aside, up = 0.04, 0.15, (0.08, 0.2)
    """Of the ball, how far it lies from the middle; its place from there, and above the ground [m]."""
    far = 0.4
    """Where the ball is lost [m]."""
    lifting, slow, beside = 0.015, 0.05, (0.08, 0.15)
    """Of a ball that is put down: its height once [m], its speed at the end [m/s], the place from where it lay [m]."""

    def __init__(self, *, drive: str = "targets", persons: int = 0, vary: Vary = None, variants: int = 16, goals: bool = False,
                 taxels: bool = False, synergy: bool = False, put_down: bool = False) -> None:
        """As `HandTask`, `Reach` for ``goals``, which are the ball's place [m], and `MovingWrist` for ``synergy``."""
        self.put_down = flag("put_down", put_down)
        if put_down:
            if goals:
                raise input_error("put_down", "True beside goals", "one of both: letting go is no matter of the ball's place")
            self.near = self.radius
        self._lifted = np.empty(0, bool)
        self._make("a hand takes a ball to its place", drive, (0, 0, self.radius + 0.1), goals, synergy, persons=persons, vary=vary, variants=variants, taxels=taxels,
                   effects=["ground_contact"], ground={"height": 0, "friction": 0.8}, contacts={
                       "materials": [{"name": "pad", "file": str(data_path() / "handmodels/finger_pad.yaml"), "spinning_friction": 0}],
                       "rules": [{"between": ["hands", "objects"], "material": "pad"}, {"between": ["hands", "ground"]},
                                 {"between": ["objects", "ground"]}]}, objects=[
                       {"name": "ball", "shape": "sphere", "radius": self.radius, "mass": "150 g", "position": [0, 0, self.radius],
                        "rolling_friction": "1 mm", "color": "#d9772e"}],
                   pictures={"size": [480, 480], "camera": {"position": [-0.75, 0.5, 0.45], "target": [0, 0, 0.12],
                                                            "field_of_view": "34 deg"}})
        columns = Batch(self.scene, 1, observe=["contact_pairs"]).columns
        self._points = [columns.index(f"right.{part}-ball.points") for part in ("thumb", "index", "middle", "ring", "little", "palm")]

    def prepare(self, batch: Batch, rows: Sequence[int], randoms: Sequence[np.random.Generator]) -> None:
        places = batch.get("objects.0.position")
        for i in rows:
            places[i, :2] = randoms[i].uniform(-self.lies, self.lies, 2)
        batch.set("objects.0.position", places)

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        if len(self._lifted) != len(batch):
            self._lifted = np.zeros(len(batch), bool)
        self._lifted[mask] = False
        super().begin(batch, mask, random)

    def draw_goals(self, batch: Batch, mask: Mask, random: np.random.Generator) -> Array:
        count = int(mask.sum())
        if self.put_down:
            angle, apart = random.uniform(0, 2 * np.pi, count), random.uniform(*self.beside, count)
            lies = batch["objects"][mask, :2]
            return np.column_stack([lies[:, 0] + apart * np.cos(angle), lies[:, 1] + apart * np.sin(angle), np.full(count, self.radius)])
        return np.column_stack([random.uniform(-self.aside, self.aside, (count, 2)), random.uniform(*self.up, count)])

    def achieved(self, batch: Batch) -> Array:
        return batch["objects"][:, :3]

    def _to_ball(self, batch: Batch) -> Array:
        return self.achieved(batch) - self.grip(batch)

    def seen(self, batch: Batch) -> Array:
        more = [self._lifted[:, np.newaxis]] if self.put_down else []
        return np.hstack([super().seen(batch), 10 * self._to_ball(batch), *more])

    def _touched(self, batch: Batch) -> Mask:
        """By thumb, fingers and palm, shape (n, 6)."""
        return np.asarray(batch["contact_pairs"][:, self._points] > 0)

    def held(self, batch: Batch) -> Mask:
        """Shape (n,): thumb and a finger touch the ball."""
        touched = self._touched(batch)
        return np.asarray(touched[:, 0] & touched[:, 1:5].any(axis=1))

    def height(self, batch: Batch) -> Array:
        """Of the ball above the ground [m], shape (n,)."""
        return np.asarray(self.achieved(batch)[:, 2] - self.radius)

    def is_lost(self, batch: Batch) -> Mask:
        return np.asarray(np.linalg.norm(self.achieved(batch)[:, :2], axis=1) > self.far)

    def counts(self, batch: Batch) -> Mask:
        if not self.put_down:
            return super().counts(batch)
        slow = np.linalg.norm(batch["objects"][:, 7:10], axis=1) < self.slow
        return np.asarray(self._lifted & slow & ~self._touched(batch).any(axis=1))

    def terms(self, batch: Batch, action: Array) -> dict[str, Array]:
        self._lifted |= self.held(batch) & (self.height(batch) > self.lifting)
        return super().terms(batch, action)

    def worth(self, batch: Batch) -> dict[str, Array]:
        reach, held = -50 * np.linalg.norm(self._to_ball(batch), axis=1), self.held(batch) * (2 + 50 * np.clip(self.height(batch), 0, 0.1))
        out = {"reach": reach, "distance": -100 * self.distance(batch), "held": held}
        if self.put_down:
            there = self._lifted & (self.distance(batch) < self.near)
            out["reach"], out["held"] = np.where(there, 0, reach), np.where(self._lifted, 7.0, held)
            out["let_go"] = 5.0 * (there & ~self._touched(batch).any(axis=1))
        return out


class Bottle(MovingWrist):
    """The hand unscrews the cap of a bottle by an angle that is drawn for each episode, 0.5 to 1.5 rad counterclockwise.

    The bottle stands below the hand and does not move; its cap of 60 mm turns about the vertical, against a drag that grows with
    the rate up to 0.05 to 0.15 N m, drawn for each episode, at 2 rad/s; the thread's rise is left out. The hand begins with open
    fingers, palm down, 40 mm above the cap; `MovingWrist` says what moves it. Action by targets: 4 of the wrist, then 20 of
    joints, -1 opens and 1 closes; torques and excitations as `HandTask`. Observation: q and u, the last one's the cap's, wrist,
    fingertips, force and number of contact points of palm and fingers, what the drive holds, place of the wrist less the grip [dm]
    and its angle, cap less grip [dm], and the angle that is missing [rad]. Reward of a step (20 ms): what it gains of a worth
    (`ToGoals`), minus 10 times the distance of cap and grip [dm], minus 10 times the missing angle [rad], 2 while thumb and a finger touch
    something, 2 for each step in a row within 0.1 rad of the goal; minus 0.01 times the mean square of the action (of the excitation); 20
    on success, after five steps in a row within 0.1 rad. Truncated after 150 steps.
    """

    max_steps = 150
    numbers, near, unit = 1, 0.1, "distance_rad"
    observe = ("q", "u", "wrists", "fingertips", "finger_contacts")
    height = 0.2
    """Of the cap's middle above the ground [m]."""
    asked, drags = (0.5, 1.5), (0.05, 0.15)
    """Least and largest: angle [rad], drag [N m]."""
    full = 2.0
    """Rate of the full drag [rad/s]."""

    def __init__(self, *, drive: str = "targets", persons: int = 0, vary: Vary = None, variants: int = 16, goals: bool = False,
                 taxels: bool = False, synergy: bool = False) -> None:
        """As `HandTask`, `Reach` for ``goals``, which are the cap's angle [rad], and `MovingWrist` for ``synergy``."""
        centre = [0.0, 0.0, self.height]
        torque = {} if drive == "targets" else {"torque": 1e-9}  # an effect needs something that acts; the drag is the task's
        self._make("a hand unscrews a cap", drive, (0, 0, self.height + 0.046), goals, synergy, persons=persons, vary=vary, variants=variants,
                   taxels=taxels, effects=["actuation"],
                   bodies=[{"name": "cap", "mass": "60 g", "inertia": [2e-4, 2e-4, 2e-4], "position": centre, "collides": True,
                            "friction": 0.8, "shape": {"kind": "cylinder", "radius": "30 mm", "length": "16 mm"}}],
                   joints=[{"name": "thread", "type": "hinge", "parent": "world", "child": "cap", "position": centre,
                            "axes": [{"name": "turn", "axis": [0, 0, 1], "range": [0, "180 deg"], **torque}]}],
                   objects=[{"name": "bottle", "shape": "cylinder", "radius": "26 mm", "length": self.height - 0.008, "static": True,
                             "position": [0, 0, 0.5 * (self.height - 0.008)], "color": "#7fa8c9"}],
                   pictures={"size": [480, 480], "camera": {"position": [-0.6, 0.45, 0.5], "target": [0, -0.02, 0.2],
                                                            "field_of_view": "28 deg"}})
        columns = Batch(self.scene, 1, observe=["finger_contacts"]).columns
        self._points = [columns.index(f"right.{finger}.points") for finger in ("thumb", "index", "middle", "ring", "little")]
        self._drag = np.empty(0)

    def begin(self, batch: Batch, mask: Mask, random: np.random.Generator) -> None:
        if len(self._drag) != len(batch):
            self._drag = np.zeros(len(batch))
        self._drag[mask] = random.uniform(*self.drags, int(mask.sum()))
        super().begin(batch, mask, random)

    def acts(self, batch: Batch, given: Mapping[str, Any]) -> dict[str, Any]:
        torques = np.zeros((len(batch), len(self.scene.coordinates))) + given.get("torques", 0)
        torques[:, -1] = -self._drag * np.clip(batch.u[:, -1] / self.full, -1, 1)
        return {"torques": torques}

    def draw_goals(self, batch: Batch, mask: Mask, random: np.random.Generator) -> Array:
        return random.uniform(*self.asked, (int(mask.sum()), 1))

    def achieved(self, batch: Batch) -> Array:
        return batch.q[:, -1:]

    def _to_cap(self, batch: Batch) -> Array:
        return np.array([0, 0, self.height + 0.006]) - self.grip(batch)

    def seen(self, batch: Batch) -> Array:
        return np.hstack([super().seen(batch), 10 * self._to_cap(batch)])

    def worth(self, batch: Batch) -> dict[str, Array]:
        touched = batch["finger_contacts"][:, self._points] > 0
        return {"reach": -100 * np.linalg.norm(self._to_cap(batch), axis=1), "angle": -10 * self.distance(batch),
                "held": 2.0 * (touched[:, 0] & touched[:, 1:].any(axis=1))}
