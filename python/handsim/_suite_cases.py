"""The cases of ``handsim export --suite``: what is asked of an engine, why, and by which limits it is judged."""
from __future__ import annotations

import math
from typing import Any, Callable, NamedTuple, Optional

from ._model import Model, compose, posed

PERSONS = ("small_woman", "median_man", "large_man")
GRASPS = {"tripod": "ball", "pinch": "card", "cup": "mug", "cylinder_50mm": "cylinder", "cylinder_100mm": "cylinder", "power_can": "can",
          "sphere_35mm": "ball", "sphere_70mm": "ball", "hook_bar": "bar", "cracker_box": "box"}
"""Scenes ``grasp_NAME``, and their objects."""
PALM = "right.palm"
SETTLING, HOLD, REST = 0.6, 1.0, 0.5
"""Of a grasp's hold: before the case begins, and within it; and after the shake [s]."""
SHAKE, FREQUENCY, CYCLES = 19.6, 5.0, 2
"""Largest acceleration [m/s2], frequency [Hz], and cycles in each of six directions."""
SHAKEN = 6 * CYCLES / FREQUENCY
"""[s]"""
G = 9.81

Judge = list[dict[str, Any]]


class Asked(NamedTuple):
    """A case, of which the files are made."""

    name: str
    title: str
    why: str
    scene: str
    set: list[str]
    """Changes of the scene."""
    duration: float
    every: float
    """Between two rows of the results [s]."""
    judge: Callable[[Model], Judge]
    """Measures with their limits, and why those."""
    forces: Optional[str] = None
    """The body whose contact forces are asked for."""
    begins: float = 0.0
    """Time of the scene's run that is the start of the case [s]."""
    beside: tuple[str, ...] = ()
    """More changes for a run of the case in handsim: supports that the case does not have."""
    person: str = ""

    def overrides(self, beside: bool = False) -> dict[str, str]:
        """As `handsim.load` takes them."""
        return {key: value for key, _, value in (each.partition("=") for each in (*self.set, *(self.beside if beside else ())))}

    @property
    def grasp(self) -> bool:
        return self.begins > 0


def hold_starts(name: str) -> float:
    """Of a shipped grasp: after approach, closing, pressing, settling and lift [s]."""
    return 0.5 + (0.65 if name == "cylinder_100mm" else 0.6) + 0.3 + 0.3 + 0.6


def _hand_length(model: Model) -> float:
    """From the wrist to the farthest fingertip, with straight fingers [m]."""
    hand = model.hands[0]
    wrist = compose(model.bodies[hand.palm].zero, hand.wrist)[:3]
    return max(float(math.dist(wrist, compose(model.bodies[body].zero, posed(point))[:3])) for _, body, point in hand.tips)


def _grasp_judge(body: str) -> Callable[[Model], Judge]:
    def judge(model: Model) -> Judge:
        rest = {"from": 0.5 * HOLD, "to": HOLD}
        return [
            {"measure": "grasp", "body": body, "palm": PALM, "hold_end": HOLD, "shift": 2e-3, "turn": math.radians(2), "shaken": 5e-3,
             "lost": _hand_length(model),
             "why": "held: at the end the object lies within 2 mm and 2 degrees of its place in the palm at the end of the hold, less than a "
                    "finger pad is deep, and was never more than 5 mm off; lost: it was farther from its start than the hand is long, where "
                    "no part of the hand that held it can reach it; else moved"},
            {"measure": "creep", "body": body, "in": PALM, **rest, "limit": 1e-5,
             "why": "what is held at rest does not wander: at 10 um/s an object is 0.6 mm off after a minute"},
            {"measure": "weight", "body": body, **rest, "limit": 0.01,
             "why": "the contact forces on a body at rest are its weight, by Newton's law; a hundredth is left for what trembles"},
            {"measure": "grip", "body": body, **rest,
             "why": "drives and pads are springs: the sum of the normal forces is given by their stiffness; it has no limit, as points of "
                    "contact are an engine's own"}]
    return judge


def _grasps() -> list[Asked]:
    out = []
    for person in PERSONS:
        for name, body in GRASPS.items():
            changes = [f"hands.0.person={person}", f"grasps.0.hold={SETTLING + HOLD:g}", f"grasps.0.rest={REST:g}",
                       f"grasps.0.shake.levels=[{{acceleration: {SHAKE:g}, frequency: {FREQUENCY:g}}}]", f"grasps.0.shake.cycles={CYCLES}"]
            beside = ("grasps.0.support=ground", *(() if name != "hook_bar" else ("objects.1.position.2=-5", "objects.2.position.2=-5")))
            out.append(Asked(
                f"grasp_{name}.{person}", f"the hand of a {person.replace('_', ' ')} holds a {body}, and is shaken",
                "A grip by friction alone, of torques that the springs of the joints give. It starts in the midst of the hold, where all is at "
                f"rest, holds for {HOLD:g} s, is shaken along x, -x, y, -y, z and -z with 2 g at {FREQUENCY:g} Hz, and rests for {REST:g} s. An engine whose "
                "friction gives way, whose drives are not those that were asked for, or whose steps let the contacts tremble, lets it slip.",
                f"grasp_{name}", changes, HOLD + SHAKEN + REST, 0.01, _grasp_judge(body), body, hold_starts(name) + SETTLING, beside, person))
    return out


def _fixed(*judge: dict[str, Any]) -> Callable[[Model], Judge]:
    return lambda model: list(judge)


def _boxes(model: Model) -> list[str]:
    return [body.name for body in model.bodies[1:]]


PINCHED = {"box": "{name: thing, shape: box, edges: [0.04, 0.04, 0.04], mass: 0.045, position: [0, 0, 0.1], friction: 0.7}",
           "sphere": "{name: thing, shape: sphere, radius: 0.02, mass: 0.045, position: [0, 0, 0.1], friction: 0.7}",
           "capsule": "{name: thing, shape: capsule, radius: 0.02, length: 0.04, mass: 0.045, position: [0, 0, 0.1], friction: 0.7}"}


def _pinch(name: str, scene: str, shape: str, force: float, times: str) -> Asked:
    return Asked(
        name, f"a {shape} of 45 g between two {scene.rpartition('_')[2]} that press with {times} the force that friction needs",
        "Two fingers on sliders press with a constant force; Coulomb's law holds the object: no slip at all. An engine that regularises "
        "friction creeps; one with a pyramid in place of the cone, or with too few iterations, lets it go.",
        f"stability/{scene}", [f"objects.0={PINCHED[shape]}", f"joints.0.axes.0.torque={force:g}", f"joints.1.axes.0.torque={force:g}"], 5, 0.02,
        _fixed({"measure": "creep", "body": "thing", "from": 2, "to": 5, "limit": 1.4e-6,
                "why": "what MuJoCo's documentation of noslip calls no slip: 1.4 um/s, a millimetre in 12 minutes"},
               {"measure": "turn", "body": "thing", "limit": math.radians(2), "why": "the object does not tilt out of the pinch"},
               {"measure": "weight", "body": "thing", "from": 2, "to": 5, "limit": 0.01, "why": "the contact forces at rest are the weight"}),
        "thing")


def _tilted(degrees: float, heading: float) -> str:
    a, b = math.radians(degrees), math.radians(heading)
    return f"gravity=[{G * math.sin(a) * math.cos(b):.9g}, {G * math.sin(a) * math.sin(b):.9g}, {-G * math.cos(a):.9g}]"


def _stack(name: str, mass: float) -> Asked:
    return Asked(
        name, f"five boxes on each other; the top one has {mass / 0.1:g} times the mass of the others",
        "A stack at rest stays at rest. A heavy body on light ones needs many iterations of a solver that goes from contact to contact.",
        "stability/stack", [f"objects.4.mass={mass:g}"], 3, 0.02,
        lambda model: [
            {"measure": "drift", "bodies": _boxes(model), "limit": 1e-3, "why": "a fortieth of an edge: nothing has begun to topple"},
            {"measure": "penetration", "pairs": [["world", "box0"], *([a, b] for a, b in zip(_boxes(model), _boxes(model)[1:]))], "from": 0.5,
             "limit": 1e-4, "why": "rigid boxes: 0.1 mm is a four hundredth of an edge"}])


def _others() -> list[Asked]:
    at_35 = G * (math.sin(math.radians(35)) - 0.5 * math.cos(math.radians(35)))
    thin = "effects=[gravity, object_contact, ground_contact, friction, joint_stops]"
    gain = {"measure": "energy_gain", "limit": 1e-2, "why": "contacts and joints take energy away, or keep it; a hundredth of the largest "
                                                            "kinetic energy is left for the error of a step"}
    return [
        _pinch("pinch_box", "pinch_pads", "box", 1.26, "4 times"), _pinch("pinch_box_at_limit", "pinch_pads", "box", 0.331, "1.05 times"),
        _pinch("pinch_sphere_at_limit", "pinch_pads", "sphere", 0.331, "1.05 times"),
        _pinch("pinch_capsules", "pinch_capsules", "capsule", 12, "38 times"),
        Asked("incline_sticks", "a box on an incline of 26 degrees, below the angle of friction of 26.57; across the axes",
              "Coulomb's law: it sticks. The direction is 22.5 degrees off the axes, where a pyramid of friction is not a cone.",
              "stability/incline", [_tilted(26, 22.5)], 1, 0.01,
              _fixed({"measure": "creep", "body": "box", "from": 0.1, "to": 1, "limit": 1e-6, "why": "a micrometre in a second: none"},
                     {"measure": "weight", "body": "box", "from": 0.1, "to": 1, "limit": 0.01, "why": "the contact forces at rest are the weight"}),
              "box"),
        Asked("incline_slides", "a box on an incline of 35 degrees, above the angle of friction; along the diagonal",
              "Coulomb's law: its speed is g (sin a - mu cos a) t. A pyramid of friction holds it on the diagonal.",
              "stability/incline", [_tilted(35, 45)], 1, 0.01,
              _fixed({"measure": "speed_error", "body": "box", "expected": at_35, "limit": 5e-4,
                      "why": "half of what one step of 1 ms more or less is, of 1000"})),
        Asked("ball_rolls", "a ball rolls down an incline of 15 degrees", "Rolling without slip: its speed is 5/7 g sin a t.",
              "stability/ball_on_incline", [_tilted(15, 45)], 1, 0.01,
              _fixed({"measure": "speed_error", "body": "ball", "expected": 5 / 7 * G * math.sin(math.radians(15)), "limit": 1e-3,
                      "why": "one step of 1 ms of 1000"})),
        _stack("stack", 0.1), _stack("stack_1000", 100),
        Asked("resting_capsule", "a capsule lies on a box", "A body on a line of contact is at rest, and does not rock between its two ends.",
              "stability/resting_capsule", [], 3, 0.01,
              _fixed({"measure": "rms_speed", "body": "capsule", "from": 1, "limit": 1e-5, "why": "0.6 mm in a minute, did it all go one way"},
                     {"measure": "penetration", "pairs": [["table", "capsule"]], "from": 1, "limit": 5e-5, "why": "a two hundredth of its radius"},
                     {"measure": "weight", "body": "capsule", "from": 1, "to": 3, "limit": 0.01, "why": "the contact forces at rest are the weight"}),
              "capsule"),
        Asked("free_spin", "a block spins about its middle axis, and tumbles", "No force acts: energy and angular momentum are constant.",
              "stability/free_spin", [], 10, 0.02,
              _fixed({"measure": "energy_gain", "limit": 1e-9, "why": "an error of rounding; energy may be lost to the step, never gained"},
                     {"measure": "momentum_error", "limit": 1e-8, "why": "an error of rounding over ten thousand steps"})),
        Asked("chain", "a chain of five links falls from the level and swings", "Its joints stay closed, and it gains no energy.",
              "stability/chain", [], 10, 0.01,
              _fixed({"measure": "joint_gap", "limit": 1e-4, "why": "a thousandth of a link"},
                     {"measure": "energy_rise", "limit": 1e-2, "why": "over what it was before; a swing without friction keeps it"})),
        Asked("crank", "a slider-crank turns at 10 rad/s through both dead centres; its loop is closed by a ball joint",
              "A closed loop, which MJCF says by connect: its joints stay closed.", "stability/crank_10", [], 5, 0.01,
              _fixed({"measure": "joint_gap", "limit": 1e-5, "why": "a two thousandth of the crank"})),
        Asked("swinging_hand", "a hand without drives, stops and tissue falls and swings on its wrist", "It gains no energy, and its joints stay closed.",
              "stability/swinging_hand", [], 4, 0.01,
              _fixed({"measure": "energy_gain", "limit": 1e-3, "why": "a thousandth of the largest kinetic energy, of 21 bodies whose angles "
                                                                      "run freely"},
                     {"measure": "joint_gap", "limit": 1e-4, "why": "a hundredth of a fingertip"})),
        Asked("hand_dropped", "a hand is dropped onto the ground", "Contacts, joints and stops do not add energy, and no body sinks into the ground.",
              "stability/thrown_hand", ["objects=[]", thin.replace("object_contact, ", ""), "solver.engine=articulated", "hands.0.wrist.rotation.angle=-20 deg"], 0.6, 0.005,
              lambda model: [gain, {"measure": "top_speed", "limit": 10, "why": "it falls 0.15 m, with 1.7 m/s; bodies that a hand's rotation "
                                                                               "whips on reach 8 m/s in throws"},
                             {"measure": "penetration", "pairs": [["world", body.name] for body in model.bodies[1:]], "from": 0, "limit": 1e-3,
                              "why": "a rigid ground: a step of 1 ms at 1.7 m/s is 1.7 mm deep before an engine can know of it"}]),
        Asked("object_dropped", "a ball of 100 g is dropped onto a hand that drops onto the ground", "Contacts, joints and stops do not add energy.",
              "stability/falling_object", [thin, "solver.engine=articulated", "hands.0.wrist.position.2=0.08", "objects.0.position.2=0.18"], 0.6, 0.005, _fixed(gain)),
        Asked("hands_collide", "two free hands, a ball and a spinning box collide, without gravity",
              "No force acts from outside: linear and angular momentum are constant, whatever happens between the bodies.",
              "stability/colliding_hands", ["objects.0.restitution=0"], 0.5, 0.005,
              _fixed({"measure": "momentum_error", "limit": 1e-6, "why": "of the sums of amounts: an engine that solves for impulses keeps it "
                                                                        "to rounding, one that turns bodies to first order does not"})),
    ]


def every() -> list[Asked]:
    """The cases, by name."""
    return sorted([*_grasps(), *_others()], key=lambda case: case.name)
