"""``handsim export --suite DIR``: cases that any engine can take, with what judges them (docs/suite.md).

Each case is a folder: the model as MJCF and, where URDF can say it, a file for each thing that is free or stands alone; tables of bodies,
joints, shapes and pairs; case.json; and a page. Files have the same bytes each time.
"""
from __future__ import annotations

import copy
import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any, Iterable, Mapping, Optional, Sequence

import numpy as np

from . import _core
from ._errors import Error, input_error
from ._files import path_of
from ._mjcf import coordinate, mjcf_of
from ._model import IDENTITY, Array, Model, inverse
from ._progress import Told
from ._scene import load
from ._simulation import Simulation
from ._suite_cases import CYCLES, FREQUENCY, HOLD, PALM, SHAKE, SHAKEN, Asked, every
from ._urdf import urdf_of_tree

OWN = "suite.json"
MARK = b'{\n "suite": 1,'
FILES = Path(__file__).with_name("_suite_files")
POSE = "x,y,z,qw,qx,qy,qz"


def _number(value: float) -> str:
    """With 12 digits: a thousandth of a nanometre of a metre; 0 in place of -0."""
    text = f"{float(value):.12g}"
    return "0" if text == "-0" else text


def _table(head: str, rows: Iterable[Sequence[Any]]) -> bytes:
    lines = [",".join(each if isinstance(each, str) else _number(each) for each in row) for row in rows]
    return ("\n".join([head, *lines]) + "\n").encode()


def _json(content: Mapping[str, Any]) -> bytes:
    return (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode()


# The shake: an oscillation in each of six directions, whose window rises and falls within half a cycle.


def _shake_wave(n: Array) -> tuple[Array, Array, Array]:
    """Displacement after n cycles, with its first and second derivative by n, for an amplitude of 1."""
    inside = np.clip(np.minimum(n, CYCLES - n) / 0.5, 0, 1)
    sign = np.where(n < CYCLES - n, 1, -1) / 0.5
    w = inside ** 3 * (10 + inside * (6 * inside - 15))
    w1 = sign * 30 * (inside * (1 - inside)) ** 2
    w2 = sign ** 2 * 60 * inside * (1 - inside) * (1 - 2 * inside)
    sine, cosine, round_ = np.sin(2 * np.pi * n), np.cos(2 * np.pi * n), 2 * np.pi
    return w * sine, w1 * sine + round_ * w * cosine, (w2 - round_ ** 2 * w) * sine + 2 * round_ * w1 * cosine


def shake_table(step: float) -> bytes:
    """How the palm moves from the end of the hold: displacement, velocity and acceleration in world axes."""
    most = float(np.abs(_shake_wave(np.arange(0, CYCLES, 1e-4))[2]).max())
    amplitude = SHAKE / (most * FREQUENCY ** 2)
    rows = np.zeros((round(SHAKEN / step) + 1, 10))
    rows[:, 0] = step * np.arange(len(rows))
    span = CYCLES / FREQUENCY
    for k, direction in enumerate((1, -1, 1, -1, 1, -1)):
        n = FREQUENCY * (rows[:, 0] - k * span)
        on = (n > 0) & (n < CYCLES)
        for derivative, wave in enumerate(_shake_wave(n[on])):
            rows[on, 1 + 3 * derivative + k // 2] = direction * amplitude * FREQUENCY ** derivative * wave
    rows[np.abs(rows) < 1e-12] = 0
    return _table("time,x,y,z,vx,vy,vz,ax,ay,az", rows.tolist())


# Files of a case.


def part_of(model: Model, bodies: Sequence[int], still: bool = True) -> Model:
    """The model of some of its bodies, with the joints between them, and with shapes that are the world's own where `still`; fixed bodies
    do not move."""
    out = copy.copy(model)
    keep = sorted({0, *bodies})
    new = {old: place for place, old in enumerate(keep)}
    out.bodies = [model.bodies[old] for old in keep]
    out.joints = [joint._replace(parent=new[joint.parent], child=new[joint.child]) for joint in model.joints
                  if joint.parent in new and joint.child in new]
    shapes = {old: place for place, old in enumerate(i for i, shape in enumerate(model.shapes) if shape.body in new and (shape.body or still))}
    out.shapes = [model.shapes[old]._replace(body=new[model.shapes[old].body]) for old in shapes]
    out.pairs = [(shapes[i], shapes[k], place) for i, k, place in model.pairs if i in shapes and k in shapes]
    out.mobilities = None if model.mobilities is None else [model.mobilities[old] for old in keep]
    out.drives, out.nails, out.hands, out.markers = [], [], [], []
    moves = np.array([[not model.bodies[old].fixed] for old in keep])
    out.start = model.start._replace(poses=model.start.poses[keep], velocities=model.start.velocities[keep] * moves,
                                     turning=model.start.turning[keep] * moves)
    return out


def _below(model: Model, root: int) -> list[int]:
    """A body and all that joints carry on it."""
    out = [root]
    for joint in model.joints:
        if joint.parent in out and not joint.closes_loop:
            out.append(joint.child)
    return out


def _without_supports(model: Model) -> Model:
    """Less what stands still and touches nothing that is held: posts and stands of a lifted object."""
    hands = {body for hand in model.hands for body in hand.bodies}
    return part_of(model, [body for body in range(1, len(model.bodies)) if body in hands or not model.bodies[body].fixed], False)


def _bodies(model: Model) -> bytes:
    rows: list[list[Any]] = []
    links = {joint.child: inverse(joint.child_frame) for joint in model.joints if not joint.closes_loop}
    for i, body in enumerate(model.bodies[1:], 1):
        inertia = body.inertia
        rows.append([body.name, int(body.fixed), body.mass, *np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2], *model.start.poses[i],
                     *model.start.velocities[i], *model.start.turning[i], *links.get(i, IDENTITY)])
    link = ",".join(f"link_{name}" for name in POSE.split(","))
    return _table(f"body,fixed,mass,ixx,iyy,izz,ixy,ixz,iyz,{POSE},vx,vy,vz,wx,wy,wz,{link}", rows)


def _joints(model: Model, asked: Asked) -> bytes:
    rows: list[list[Any]] = []
    pressed = {name.partition(".")[2]: float(value) for name, _, value in (each.partition("=") for each in asked.set) if name.endswith("axes.0.torque")}
    for place, joint in enumerate(model.joints):
        points = [*joint.parent_frame[:3], *joint.child_frame[:3]]
        ends = [model.bodies[joint.parent].name if joint.parent else "world", model.bodies[joint.child].name]
        if joint.spherical:
            rows.append([joint.name, joint.name, joint.kind, *ends, int(joint.closes_loop), *[0.0] * 6, np.inf, 0.0, 0.0, 0.0, -np.inf, np.inf,
                         0.0, 0.0, 0.0, *points])
            continue
        for i, axis in enumerate(joint.axes):
            dof = joint.first + i
            servo = model.servos.get(dof)
            q, u = (0.0, 0.0) if joint.closes_loop else (model.start.q[dof], model.start.u[dof])
            drive = ([q + servo.error, servo.stiffness, servo.damping, servo.feed, servo.limit] if servo
                     else [0.0, 0.0, 0.0, pressed.get(f"{place}.axes.0.torque", 0.0), np.inf])
            tissue = [axis.stiffness, axis.damping, axis.rest] if model.passive(axis) else [0.0, 0.0, 0.0]
            stop = [axis.low, axis.high] if model.stopped(axis) else [-np.inf, np.inf]
            rows.append([coordinate(joint, axis), joint.name, joint.kind, *ends, int(joint.closes_loop), q, u, *drive, *tissue, *stop, *axis.axis,
                         *points])
    return _table("joint,of,kind,parent,child,closes_loop,start,rate,target,gain,rate_gain,feed,limit,tissue_stiffness,tissue_damping,tissue_rest,"
                  "low,high,ax,ay,az,px,py,pz,cx,cy,cz", rows)


def _name(model: Model, body: int) -> str:
    return model.bodies[body].name if body else "world"


def _shapes(model: Model) -> bytes:
    return _table(f"shape,body,kind,{POSE},radius,length,ex,ey,ez",
                  [[shape.name, _name(model, shape.body), shape.kind, *shape.pose, shape.radius, shape.length, *shape.edges] for shape in model.shapes])


def _pairs(model: Model) -> bytes:
    """Of bodies, with the surface between them."""
    rows: dict[tuple[str, ...], list[Any]] = {}
    for i, k, place in model.pairs:
        touch = model.touches[place]
        spring = touch.spring or [np.inf, np.inf]
        friction = [touch.friction, touch.spinning_friction, touch.rolling_friction] if "friction" in model.effects else [0.0, 0.0, 0.0]
        row = [*sorted(_name(model, model.shapes[each].body) for each in (i, k)), *friction, *spring]
        rows[tuple(map(str, row))] = row
    return _table("a,b,friction,spinning_friction,rolling_friction,stiffness,damping", [rows[key] for key in sorted(rows)])


def _urdfs(model: Model) -> tuple[dict[str, bytes], list[dict[str, Any]]]:
    """A file for each thing that is free or stands alone; none where URDF cannot say one of them."""
    files: dict[str, bytes] = {}
    told: list[dict[str, Any]] = []
    try:
        for root in [*([0] if any(shape.body == 0 for shape in model.shapes) else []), *model.roots()]:
            # Joints to the world itself carry mechanisms, whose file has the world as base.
            tree = [0, *(body for joint in model.joints if joint.parent == 0 for body in _below(model, joint.child))] if root == 0 else _below(model, root)
            name = (model.bodies[root].name if root else "world").partition(".")[0]
            files[f"{name}.urdf"] = urdf_of_tree(model, root, tree).encode()
            told.append({"file": f"{name}.urdf", "root": model.bodies[root].name if root else "world",
                         "fixed": bool(root == 0 or model.bodies[root].fixed)})
        if any(joint.parent == 0 for joint in model.joints) and "world.urdf" not in files:
            tree = [0, *(body for joint in model.joints if joint.parent == 0 for body in _below(model, joint.child))]
            files["world.urdf"] = urdf_of_tree(model, 0, tree).encode()
            told.append({"file": "world.urdf", "root": "world", "fixed": True})
    except Error:
        return {}, []
    return files, told


def _grip_of(run: Simulation, body: str, until: float) -> float:
    """The mean sum of normal forces on a body in the hold [N]."""
    scene_model, sums, count = run.scene._model, 0.0, 0
    shapes = {shape.name for shape in scene_model.shapes if scene_model.bodies[shape.body].name == body}
    while run.time < until - 1e-9:
        run.step(substeps=10)
        found = run.contacts
        normal = np.sum(found.force * found.normal, axis=1) if len(found.a) else np.zeros(0)
        sums += sum(abs(x) for a, b, x in zip(found.a, found.b, normal) if a in shapes or b in shapes)
        count += 1
    return sums / count


def case_files(asked: Asked) -> dict[str, bytes]:
    """By name. :raises Error: for a scene that does not compile or diverges"""
    scene = load(asked.scene, asked.overrides(), engine="articulated")
    run = Simulation(scene)
    while run.time < asked.begins - 0.5 * scene.step:
        run.step(substeps=min(100, round((asked.begins - run.time) / scene.step)))
    whole = Model(run._core.description(), scene.title)
    judge = asked.judge(whole)
    model = _without_supports(whole) if asked.grasp else part_of(whole, range(1, len(whole.bodies)))
    urdfs, told = _urdfs(model)
    wrist = [float(_number(x)) for x in run._core.wrists()[0]] if asked.grasp else None
    if asked.grasp:
        grip = _grip_of(run, str(asked.forces), asked.begins + HOLD)
        judge = [{**spec, "of": float(f"{grip:.6g}")} if spec["measure"] == "grip" else spec for spec in judge]
    recorded = [PALM, str(asked.forces)] if asked.grasp else [body.name for body in model.bodies[1:] if not body.fixed]
    content = {
        "case": asked.name, "title": asked.title, "why": asked.why, "step": scene.step, "duration": asked.duration,
        "gravity": [float(_number(x)) for x in model.pull()],
        "shaken": {"base": PALM, "table": "shake.csv", "from": HOLD} if asked.grasp else None,
        "record": {"every": asked.every, "bodies": recorded, "forces": asked.forces},
        "mjcf": "model.xml", "urdf": told, "judge": judge,
        "handsim": {"scene": asked.scene, "set": asked.overrides(beside=True), "base": PALM if asked.grasp else None, "wrist": wrist}}
    files = {"case.json": _json(content), "model.xml": mjcf_of(model).encode(), "bodies.csv": _bodies(model), "joints.csv": _joints(model, asked),
             "shapes.csv": _shapes(model), "pairs.csv": _pairs(model), **{f"urdf/{name}": text for name, text in urdfs.items()}}
    files["README.md"] = _page(asked, judge, model, bool(urdfs))
    return files


def _limits(spec: Mapping[str, Any]) -> str:
    units = {"shift": "m", "turn": "rad", "shaken": "m", "lost": "m"}
    if spec["measure"] == "grasp":
        return ", ".join(f"{name} {spec[name]:.4g} {unit}" for name, unit in units.items())
    unit = {"creep": " m/s", "drift": " m", "turn": " rad", "rms_speed": " m/s", "top_speed": " m/s", "joint_gap": " m", "penetration": " m"}
    return f"{spec['limit']:.4g}{unit.get(spec['measure'], '')}" if "limit" in spec else f"none; handsim: {spec['of']:.4g} N"


def _page(asked: Asked, judge: Sequence[Mapping[str, Any]], model: Model, urdf: bool) -> bytes:
    soft = any(touch.spring for touch in model.touches)
    spins = any(model.touches[place].spinning_friction > 0 for _, _, place in model.pairs)
    lines = [f"# {asked.name}", "", f"{asked.title[0].upper()}{asked.title[1:]}.", "", asked.why, "",
             f"{asked.duration:g} s, a row every {1e3 * asked.every:g} ms; model.xml has a step of {1e3 * model.step:g} ms.", ""]
    if asked.grasp:
        lines += ["The palm stands still in model.xml: it does not turn in the shake, so that gravity less its acceleration (`../shake.csv`) "
                  "does the same to the rest. An engine that moves the palm by the table's displacements does the same, too. Posts and "
                  "stands, from which the object was lifted, are left out. The drives' targets do not change.", ""]
    lines += ["| measure | limit | why |", "| --- | --- | --- |",
              *(f"| {spec['measure']} | {_limits(spec)} | {spec['why']} |" for spec in judge), "",
              "What MJCF carries in place of the law here:", ""]
    if soft:
        lines.append("- Pads are spring-dampers that act at the step's end (stiffness and damping in `pairs.csv`, shared by the contact points of "
                     "a pair of shapes). MJCF says this by solref and solimp, for the step of the file, and gives each contact point the "
                     "whole stiffness: objects with several points are pressed by a few percent more.")
    if spins:
        lines.append("- Spinning friction (`spinning_friction`: the largest moment about the normal over the normal force, in m) is one limit here, that of "
                     "sliding another; in MJCF it is condim 4, whose elliptic cone has both together.")
    if any(touch.spring is None for _, _, place in model.pairs for touch in (model.touches[place],)):
        lines.append("- Rigid contacts have MuJoCo's own softness: solref and solimp are not written.")
    if asked.name == "crank":
        lines.append("- The loop is a connect, which is soft in MuJoCo.")
    if any(model.stopped(axis) for joint in model.joints for axis in joint.axes):
        lines.append("- Stops have MuJoCo's own softness; here they are rigid, without a bounce.")
    if lines[-1] == "":
        lines.append("- Nothing: there is no contact, stop or loop.")
    if not urdf:
        lines += ["", "No URDF: it has neither loops nor ball joints."]
    return ("\n".join(lines) + "\n").encode()


# The whole.


def suite_files(told: Told = None) -> dict[str, bytes]:
    """Every file by its name below the suite's folder."""
    files = {path.relative_to(FILES).as_posix(): path.read_bytes() for path in sorted(FILES.rglob("*"))
             if path.is_file() and path.suffix in (".py", ".md") or path.name == "LICENSE"}
    cases = every()
    for place, asked in enumerate(cases):
        for name, content in case_files(asked).items():
            files[f"{asked.name}/{name}"] = content
        if told:
            told((place + 1) / len(cases))
    files["shake.csv"] = shake_table(1e-3)
    files[OWN] = _json({"suite": 1, "handsim": _core.version, "cases": [asked.name for asked in cases], "files": sorted([*files, OWN])})
    return files


def check_folder(out: Path) -> None:
    """:raises Error: of kind input for a folder with anything but an earlier suite, whose files are as they were named"""
    if not os.path.lexists(out):
        if not out.parent.is_dir():
            raise input_error("--suite", out, "a folder in one that is there")
        return
    if out.is_symlink() or not out.is_dir():
        raise input_error("--suite", f"{out}, which is no folder", "a new folder, or that of an earlier suite")
    found = {path.relative_to(out).as_posix() for path in out.rglob("*") if not path.is_dir() or path.is_symlink()}
    if not found:
        return
    try:
        text = (out / OWN).read_bytes()
        own = set(json.loads(text)["files"]) if text.startswith(MARK) else set()
    except (OSError, ValueError, KeyError, TypeError):
        own = set()
    foreign = sorted(found - own)
    if foreign:
        raise input_error("--suite", f"{out}, where {foreign[0]}{f' and {len(foreign) - 1} more' if len(foreign) > 1 else ''} "
                          f"{'is' if len(foreign) == 1 else 'are'} not of a suite", "a new folder, or that of an earlier suite")


def write_suite(place: str, told: Told = None) -> str:
    """Writes the folder, complete or not at all. :returns: what it has
    :raises Error: of kind input for a folder that is the user's; of kind output on a full disk"""
    out = path_of("--suite", place)
    check_folder(out)
    files = suite_files(told)
    parent = out.resolve().parent
    made: Optional[Path] = None
    try:
        made = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=parent))
        new, old = made / "new", made / "old"
        for name, content in files.items():
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).write_bytes(content)
        check_folder(out)
        if out.exists():
            out.rename(old)
        new.rename(out)
    except OSError as error:
        if made is not None and (made / "old").exists() and not out.exists():
            (made / "old").rename(out)
        raise Error(f"{out}: {error.strerror}", "output") from None
    finally:
        if made is not None:
            shutil.rmtree(made, ignore_errors=True)
    size = sum(map(len, files.values()))
    return f"{place}: {len(every())} cases in {len(files)} files, {size / 1e6:.2f} MB"
