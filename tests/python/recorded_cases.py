"""Own recordings of hands and objects with known forces: how they are simulated (recorded_forces.py says how near the solver comes to them)."""
from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple, Optional

import numpy as np

import handsim as hs
from handsim._forces_frames import FINGERS
from handsim._model import compose, product, turn_of, turned
from handsim._shipped import data_path

RATE = 60.0
NOISE, TURN_NOISE = 2e-3, math.radians(0.6)
LIGHTEST = 0.4
"""Share of a case's mass below which a hand that cannot grip it is a line on stderr."""
LOOSEST, FIRMEST = 1.1, 2.5
"""Margins of a grip that are kept."""
SLIPPERY = 0.4
"""Friction of pads, at least, where no mass makes a grip loose enough."""
PERSONS = ("median_man", "median_woman", "large_man")


class Case(NamedTuple):
    """A recording; forces are those of fingers that the plan names, raised to what holds."""

    scene: str
    mass: float
    friction: float
    forces: dict[str, float]
    turn: float = 0.0
    """About the world's x axis after the lift [deg]."""
    down: bool = False
    """Sets it down."""
    quick: bool = False
    """A fast lift."""
    spin: float = 0.0
    """Spinning friction of its pads [m]; several points on a round object resist rotation without it."""
    press: float = 0.0
    """Of two hands, whose wrists go so far beyond the first touch of a box [m]; 0: one hand grasps by the plan of the scene."""
    slip: float = 1.0
    """Friction of its pads over that which the plan of its grip reckons with."""


FIVE = {"thumb": 1.0, "index": 0.8, "middle": 0.8, "ring": 0.6, "little": 0.4}
CASES: dict[str, Case] = {
    "pinch": Case("grasp_pinch", 0.1, 0.85, {"index": 0.5}, spin=0.0031),
    "tripod": Case("grasp_tripod", 0.2, 0.9, {"index": 0.5, "middle": 0.5}, spin=0.0024),
    "can": Case("grasp_power_can", 0.5, 0.7, FIVE),
    "mug": Case("grasp_cup", 0.2, 0.65, FIVE),
    "box": Case("grasp_cracker_box", 0.411, 1.0, {"index": 1.0, "middle": 1.0, "ring": 0.7, "little": 0.4}, spin=0.0024),
    "lift": Case("grasp_sphere_70mm", 0.35, 0.95, {"index": 0.8, "middle": 0.8, "ring": 0.6, "little": 0.4}, quick=True),
    "turn": Case("grasp_cylinder_50mm", 0.6, 0.75, FIVE, turn=50),
    "both": Case("", 0.8, 0.75, {}, spin=0.0024, press=4e-3),
    "both_down": Case("", 0.8, 0.75, {}, down=True, spin=0.0024, press=4e-3),
    "set_down": Case("grasp_tripod", 0.12, 0.7, {"index": 0.5, "middle": 0.5}, down=True, spin=0.0024),
}


def minimum_jerk(share: float) -> float:
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10 - 15 * s + 6 * s * s)


def overrides(case: Case, person: str, margin: float) -> dict[str, Any]:
    pad = {"name": "pad", "stiffness": 1800, "damping": 6, "friction": case.slip * case.friction, "spinning_friction": case.spin}
    forces = ", ".join(f"{finger}: {force} N" for finger, force in case.forces.items())
    return {"hands.0.person": f"config/persons/{person}.yaml" if Path(f"config/persons/{person}.yaml").exists() else person,
            "objects.0.mass": case.mass, "contacts.materials": json.dumps([pad]), "grasps.0.grip.friction": case.friction,
            "grasps.0.grip.forces": "{" + forces + "}", "grasps.0.shake.levels": "[]", "grasps.0.hold": "10 ms" if case.turn or case.down else "0.8 s",
            "grasps.0.rest": 0, "grasps.0.lift.time": "0.4 s" if case.quick else "0.7 s", "grasps.0.lift.height": LIFT, "grasps.0.settle": "0.3 s"}


LIFT = 0.2
"""[m]"""
BOX = (0.16, 0.2, 0.14)
"""Edges of what two hands hold [m]."""
ABOVE = 0.03
"""Of the hands over its middle [m]: it hangs between them."""
TOUCHES = 0.0232
"""Of the wrist frame from a wall when the palm of the median man's hand touches it [m] (config/two_hands_contact.yaml)."""


def thickness(person: str) -> float:
    return float(hs.Hand(person=person).dimensions["thickness"])


def both_hands(case: Case, person: str) -> dict[str, Any]:
    """A scene in which two flat hands press a box from its sides, lift it, hold it, and set it down again."""
    model, who = data_path() / "handmodels/anatomical.yaml", data_path() / f"config/persons/{person}.yaml"
    thick = thickness(person)
    touch = BOX[0] / 2 + TOUCHES * thick / thickness("median_man")
    lifted, end = 2.0, 4.6 if case.down else 2.9
    hands = []
    for side, sign in (("right", 1), ("left", -1)):
        turn = {"axis": [0, sign, 0], "angle": "90 deg"}
        way = [(0, 0.04, 0), (0.5, 0, 0), (1.0, -case.press, 0), (1.2, -case.press, 0), (lifted, -case.press, LIFT), (2.9, -case.press, LIFT)]
        way += [(4.0, -case.press, -1e-3), (4.2, -case.press, -1e-3), (end, 0.04, -1e-3)] if case.down else []
        hands.append({"model": str(model), "person": str(who), "side": side, "pose": {"thumb_cmc": ["-32 deg", "-22 deg"], **{f"{finger}_mcp": ["14 deg", 0] for finger in FINGERS}}, "wrist": {"mount": "driven", "motion": {"keyframes": [
                {"time": t, "position": [sign * (touch + away), -0.09, ABOVE + BOX[2] / 2 + up], "rotation": turn} for t, away, up in way]}}})
    pad = {"name": "pad", "stiffness": 1800, "damping": 6, "friction": case.slip * case.friction, "spinning_friction": case.spin}
    return {"title": "two hands and a box", "hands": hands,
            "objects": [{"name": "box", "shape": "box", "edges": list(BOX), "mass": case.mass, "position": [0, 0, BOX[2] / 2]}],
            "control": {"controller": str(data_path() / "controllers/grasp.yaml"), "program": "hold", "poses": {
                "unit": "deg", "poses": {"flat": {"thumb_cmc": [-32, -22], **{f"{finger}_mcp": [14, 0] for finger in FINGERS}}},
                "programs": {"hold": {"hands": {side: [{"time": 0, "move": 0.1, "pose": "flat"}] for side in ("right", "left")}}}}}, "ground": {"height": 0},
            "contacts": {"materials": [pad], "rules": [{"between": ["hands", "objects"], "material": "pad"}, {"between": ["objects", "ground"]}]},
            "effects": ["gravity", "object_contact", "ground_contact", "friction", "joint_stops", "passive_tissue", "actuation", "wrist_motion"],
            "solver": {"engine": "ode", "method": "world_step", "step": "1 ms", "erp": 0.2, "cfm": 1e-8, "seed": 1}, "duration": end}


class Recorded(NamedTuple):
    name: str
    times: np.ndarray
    columns: dict[str, np.ndarray]
    """Of the recording, without noise."""
    normal: dict[str, np.ndarray]
    """True normal forces by hand and finger [N]."""
    tangential: dict[str, np.ndarray]
    wrench: np.ndarray
    """On the object by the hands, about its centre of mass."""
    mass: float
    friction: float
    thing: str
    """Text of the object file."""
    person: str
    supported: np.ndarray
    loads: str
    """Of the true forces on the hands, as `handsim inverse --loads` takes them."""


def margin_of(of: Recorded) -> float:
    """Normal forces of the hold over the least that friction lets bear the weight."""
    held = (of.supported < 1e-6) & (sum(of.normal.values()) > 0.1)
    return float(of.friction * np.mean(sum(of.normal.values())[held]) / (of.mass * 9.80665)) if held.any() else 0.0


def dropped(of: Recorded) -> bool:
    """Whether hands never lift it as high as they go, but for the quarter of it by which it may slip."""
    free, height = of.supported < 1e-6, of.columns["object"][:, 2]
    return not free.any() or bool(height[free].max() - height[0] < 0.75 * LIFT)


def person_grips(name: str, person: str, margin: float) -> Recorded:
    """A recording in which the hand grips about `margin` times as hard as needed: the object is as heavy as that, and where no mass makes the grip loose
    enough, its pads are as slippery."""
    case, found = _by_mass(name, person, margin)
    for _ in range(3):
        has = margin_of(found)
        if has <= FIRMEST:
            break
        # The plan grips as hard as before; only how much of it is needed changes.
        case = case._replace(slip=max(case.slip * margin / has, SLIPPERY / case.friction))
        slippery = simulate(name, person, margin, case)
        if dropped(slippery):
            break
        found = slippery
    if not LOOSEST < margin_of(found) < FIRMEST:
        raise hs.Error(f"{name}: a margin of {margin_of(found):.2f}, which neither mass nor friction mends", "physics")
    return found


def _by_mass(name: str, person: str, margin: float) -> tuple[Case, Recorded]:
    """The one with the mass whose margin is nearest, of three."""
    case = CASES[name]
    nearest: Optional[tuple[Case, Recorded]] = None
    tries = 0
    while tries < 3:
        try:
            found = simulate(name, person, margin, case)
            if dropped(found):
                raise hs.Error(f"{name}: a box of {case.mass:.2g} kg is dropped", "physics")
        except hs.Error:
            if nearest is not None:
                break  # too heavy for the plan
            if case.mass < LIGHTEST * CASES[name].mass:
                raise
            # Too heavy for this hand, or for its strength.
            case = case._replace(mass=0.8 * case.mass)
            continue
        tries += 1
        has = margin_of(found)
        if has > 0 and (nearest is None or abs(math.log(has / margin)) < abs(math.log(margin_of(nearest[1]) / margin))):
            nearest = case, found
        if 0.93 * margin < has < 1.07 * margin:
            break
        case = case._replace(mass=case.mass * min(max(has / margin, 0.5), 2.5))
    if nearest is None:
        raise hs.Error(f"{name}: nothing is held", "physics")
    return nearest


def simulate(name: str, person: str, margin: float, case: Case) -> Recorded:
    scene = hs.load(both_hands(case, person)) if case.press else hs.load(case.scene, overrides(case, person, margin))
    simulation = hs.Simulation(scene)
    model = scene._model
    moving = scene.objects[0]
    body = next(i for i, each in enumerate(model.bodies) if each.name == moving)
    hand = model.hands[0]
    shape_body = {shape.name: model.bodies[shape.body].name for shape in model.shapes}
    wrist_body, names = hand.palm, [each.name for each in model.hands]
    plan = scene.duration
    rows: list[dict[str, Any]] = []
    loads = ["time[s],body,x[m],y[m],z[m],force.x[N],force.y[N],force.z[N]"]
    step, clock, extra = scene.step, 0.0, 0.0 if case.press else (1.2 if case.turn else 0) + (1.6 if case.down else 0)
    held_from: Optional[np.ndarray] = None
    count = int((plan + extra) * RATE)
    for frame in range(count):
        target = frame / RATE
        steps = max(1, int(round((target - simulation.time) / step))) if frame else 1
        if simulation.time < plan - 0.02 or not extra:
            simulation.step(substeps=steps)
        else:
            bodies = simulation.bodies
            if held_from is None:
                held_from, clock = compose(np.concatenate([bodies.position[wrist_body], bodies.quaternion[wrist_body]]), hand.wrist), simulation.time
                start = bodies.position[body].copy()
            # Step by step: at a constant velocity between frames, jerks at their ends would accelerate the object, and forces between show none of it.
            for _ in range(steps):
                since = simulation.time + step - clock
                moved = held_from.copy()
                if case.turn:
                    by = turn_of(np.array([1.0, 0, 0]) * math.radians(case.turn) * minimum_jerk(since / 1.0))
                    moved = np.concatenate([start + turned(by, held_from[:3] - start), product(by, held_from[3:])])
                if case.down:
                    moved[2] -= LIFT * minimum_jerk(since / 0.9)
                simulation.step(wrists=moved[None])
        bodies = simulation.bodies
        poses = np.concatenate([bodies.position, bodies.quaternion], axis=1)
        row: dict[str, Any] = {"time": simulation.time, "object": poses[body]}
        for marker, of, point in model.markers:
            row[marker] = turned(poses[of, 3:], point) + poses[of, :3]
        normal: dict[str, float] = {}
        across: dict[str, float] = {}
        wrench, supported = np.zeros(6), 0.0
        contacts = simulation.contacts
        for a, b, point, direction, force in zip(contacts.a, contacts.b, contacts.position, contacts.normal, contacts.force):
            bodies_ = shape_body.get(a, "world"), shape_body.get(b, "world")
            if moving not in bodies_:
                continue
            on = force if bodies_[0] == moving else -force
            other = bodies_[1] if bodies_[0] == moving else bodies_[0]
            side, _, segment = other.partition(".")
            if side not in names:
                supported += float(np.linalg.norm(force))
                continue
            finger = f"{side}.{segment.partition('_')[0]}"
            pressing = abs(float(force @ direction))
            normal[finger] = normal.get(finger, 0) + pressing
            across[finger] = across.get(finger, 0) + math.sqrt(max(float(force @ force) - pressing**2, 0))
            wrench += np.concatenate([on, np.cross(point - poses[body][:3], on)])
            loads.append(",".join([f"{simulation.time:.9g}", other, *(f"{x:.7g}" for x in (*point, *-on))]))
        row.update(normal=normal, across=across, wrench=wrench, supported=supported)
        rows.append(row)
    times = np.array([row["time"] for row in rows])
    columns = {marker: np.array([row[marker] for row in rows]) for marker, _, _ in model.markers}
    columns["object"] = np.array([row["object"] for row in rows])
    fingers = [f"{side}.{finger}" for side in names for finger in ("thumb", "index", "middle", "ring", "little", "palm")]

    def of(key: str) -> dict[str, np.ndarray]:
        return {finger: np.array([row[key].get(finger, 0.0) for row in rows]) for finger in fingers}

    return Recorded(name, times, columns, of("normal"), of("across"), np.array([row["wrench"] for row in rows]), case.mass, case.slip * case.friction,
                    _object_text(model, body, case.mass), person, np.array([row["supported"] for row in rows]), "\n".join(loads) + "\n")


def _object_text(model: Any, body: int, mass: float) -> str:
    parts = []
    for shape in (each for each in model.shapes if each.body == body):
        size = {"box": f"edges: {shape.edges.tolist()}", "sphere": f"radius: {shape.radius}",
                "cylinder": f"radius: {shape.radius}, length: {shape.length}"}[shape.kind]
        pose = shape.pose
        angle = 2 * math.acos(min(1, max(-1, pose[3])))
        axis = pose[4:] / max(np.linalg.norm(pose[4:]), 1e-12)
        turn = f", rotation: {{axis: {axis.tolist()}, angle: {angle}}}" if angle > 1e-9 else ""
        parts.append(f"  - {{shape: {shape.kind}, {size}, position: {pose[:3].tolist()}{turn}}}\n")
    return f"mass: {mass}\nparts:\n{''.join(parts)}"


def write_recording(of: Recorded, folder: Path, seed: int, noise: float = NOISE) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(seed)
    head, values = ["time[s]"], [of.times]
    for name, points in of.columns.items():
        if name == "object":
            continue
        noisy = points + noise * random.normal(size=points.shape)
        head += [f"{name.replace('_distal.tip', '_tip')}.{axis}[m]" for axis in "xyz"]
        values += list(noisy.T)
    poses = of.columns["object"].copy()
    poses[:, :3] += noise * random.normal(size=(len(poses), 3))
    turns = np.array([turn_of(TURN_NOISE * noise / NOISE * random.normal(size=3)) for _ in poses])
    poses[:, 3:] = product(turns, poses[:, 3:])
    head += [f"object.thing.{part}" for part in ("x[m]", "y[m]", "z[m]", "qw", "qx", "qy", "qz")]
    values += list(poses.T)
    path = folder / "recording.csv"
    np.savetxt(path, np.stack(values, axis=1), delimiter=",", header=",".join(head), comments="", fmt="%.9g")
    (folder / "thing.yaml").write_text(of.thing)
    (folder / "loads.csv").write_text(of.loads)
    return path
