"""``handsim export --suite``: the folder, its judge against closed forms, and its cases run by the engine here."""
import csv
import hashlib
import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import handsim as hs
from handsim import _suite, _suite_cases

FILES = Path(_suite.FILES)
RELEASE = Path(__file__).parents[1] / "data/suite/release.csv"
POSE = ["x", "y", "z", "qw", "qx", "qy", "qz"]
HEAD = ["time", "body", *POSE, "vx", "vy", "vz", "wx", "wy", "wz"]


def module(name):
    spec = importlib.util.spec_from_file_location(f"suite_{name}", FILES / f"{name}.py")
    found = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = found  # dataclasses and typing look it up
    spec.loader.exec_module(found)
    return found


judge = module("judge")


def handsim(*words, cwd=None):
    return subprocess.run([sys.executable, "-m", "handsim", *map(str, words)], capture_output=True, text=True, timeout=600, cwd=cwd)


@pytest.fixture(scope="session")
def suite(tmp_path_factory):
    """The whole suite, once."""
    out = tmp_path_factory.mktemp("suite") / "suite"
    done = handsim("export", "--suite", out)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="session")
def results(suite, tmp_path_factory):
    """Of the articulated engine, by the driver in the suite."""
    out = tmp_path_factory.mktemp("results")
    done = subprocess.run([sys.executable, suite / "drivers/handsim_driver.py", "--engine", "articulated", "--out", out],
                          capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    return out


def judged(results, suite, *words):
    return subprocess.run([sys.executable, suite / "judge.py", results, *map(str, words)], capture_output=True, text=True, timeout=120)


# A suite of one case, made by hand.


def written(folder, spec, bodies, joints=(), shapes=(), **more):
    """A case whose bodies are (name, mass, inertia, pose) or with their twist."""
    case = folder / "suite/case"
    case.mkdir(parents=True)
    names = [body[0] for body in bodies]
    content = {"case": "case", "gravity": [0, 0, -10], "duration": 1.0, "record": {"every": 0.01, "bodies": names, "forces": None}, "judge": spec, **more}
    (case / "case.json").write_text(json.dumps(content))
    rows = [[name, 0, mass, *inertia, 0, 0, 0, *pose, *(twist[0] if twist else [0] * 6), *[0] * 7] for name, mass, inertia, pose, *twist in bodies]
    (case / "bodies.csv").write_bytes(_suite._table("body,fixed,mass,ixx,iyy,izz,ixy,ixz,iyz,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz,"
                                                    "link_x,link_y,link_z,link_qw,link_qx,link_qy,link_qz", rows))
    (case / "joints.csv").write_bytes(_suite._table("joint,kind,parent,child,ax,ay,az,px,py,pz,cx,cy,cz", joints))
    (case / "shapes.csv").write_bytes(_suite._table("shape,body,kind,x,y,z,qw,qx,qy,qz,radius,length,ex,ey,ez", shapes))
    return folder / "suite"


def told(folder, rows, head=HEAD, **of_case):
    """Results of that case: rows of (time, body, pose, twist)."""
    out = folder / "results"
    out.mkdir(exist_ok=True)
    (out / "run.json").write_text(json.dumps({"engine": "none", "version": "1", "options": "-", "cases": {"case": {"cpu_s": 0, **of_case}}}))
    (out / "case.csv").write_text("\n".join([",".join(head), *(",".join(map(str, row)) for row in rows)]) + "\n")
    return out


def figures(folder, suite, rows, **more):
    [row] = judge.judge(told(folder, rows, **more), suite, [])
    return row["verdict"], {figure.name: figure for figure in row["figures"]}


STILL = [1, 0, 0, 0]
TIMES = [k / 100 for k in range(101)]
IN_PALM = [{"measure": "grasp", "body": "can", "palm": "palm", "hold_end": 0.5, "shift": 2e-3, "turn": np.radians(2), "shaken": 5e-3, "lost": 0.2},
           {"measure": "creep", "body": "can", "in": "palm", "from": 0.1, "to": 0.5, "limit": 1e-5}]
PALM_AND_CAN = [("palm", 0.4, [1, 1, 1], [0, 0, 0, *STILL]), ("can", 0.3, [1e-4, 2e-4, 3e-4], [0.1, 0, 0, *STILL])]


def held(move, turn=lambda t: STILL, base=lambda t: [0, 0, 0]):
    """Of a can that moves in a palm that moves."""
    rows = []
    for t in TIMES:
        at = np.array(base(t), float)
        rows += [[t, "palm", *at, *STILL, *[0] * 6], [t, "can", *(at + [0.1, 0, 0] + np.array(move(t))), *turn(t), *[0] * 6]]
    return rows


def test_a_body_that_nothing_holds_is_lost(tmp_path):
    suite = written(tmp_path, IN_PALM, PALM_AND_CAN)
    assert figures(tmp_path, suite, held(lambda t: [0, 0, -5 * t * t]))[0] == "lost"
    verdict, of = figures(tmp_path, suite, held(lambda t: [0, 0, 0]))
    assert verdict == "held" and of["shift"].value == of["creep"].value == of["turn"].value == 0


# Oracle: the slip that the table was made with; the palm shakes by a metre meanwhile.
@pytest.mark.parametrize("slip, verdict", [(1.9e-3, "held"), (2.1e-3, "moved"), (4e-2, "moved"), (0.21, "lost")])
def test_a_slip_of_known_size_is_told(tmp_path, slip, verdict):
    suite = written(tmp_path, IN_PALM, PALM_AND_CAN)
    found, of = figures(tmp_path, suite, held(lambda t: [0, slip * max(0, t - 0.5) * 2, 0], base=lambda t: [np.sin(9 * t), 0, t]))
    assert found == verdict and of["shift"].value == pytest.approx(slip, rel=1e-9) and of["shaken"].value == pytest.approx(slip, rel=1e-9)
    found, of = figures(tmp_path, suite, held(lambda t: [0, 1e-4 * t, 0]))
    assert found == "held" and of["creep"].value == pytest.approx(1e-4, rel=1e-6) and of["creep"].held is False


def test_a_shake_out_of_its_place_and_a_turn_are_told(tmp_path):
    suite = written(tmp_path, IN_PALM, PALM_AND_CAN)
    verdict, of = figures(tmp_path, suite, held(lambda t: [6e-3 * (0.6 < t < 0.7), 0, 0]))
    assert verdict == "moved" and of["shift"].value == 0 and of["shaken"].value == pytest.approx(6e-3)
    angle = np.radians(3)
    verdict, of = figures(tmp_path, suite, held(lambda t: [0, 0, 0], lambda t: [np.cos(angle * (t > 0.5) / 2), 0, np.sin(angle * (t > 0.5) / 2), 0]))
    assert verdict == "moved" and of["turn"].value == pytest.approx(angle)


# Oracle: a ball thrown upwards, whose energy is constant, and one that gains 3 % of it; their momentum.
def test_energy_and_momentum_of_known_motions(tmp_path):
    spec = [{"measure": name, "limit": 0.01} for name in ("energy_gain", "energy_rise", "energy_error", "momentum_error")]
    suite = written(tmp_path, spec, [("ball", 2.0, [0.1, 0.2, 0.3], [0, 0, 0, *STILL], [1, 0, 4, 0, 0, 3])])
    thrown = lambda gain: [[t, "ball", t, 0, 4 * t - 5 * t * t, *STILL, (1 + gain * t), 0, 4 - 10 * t, 0, 0, 3] for t in TIMES]  # noqa: E731
    verdict, of = figures(tmp_path, suite, thrown(0))
    assert verdict == "held" and all(abs(figure.value) < 1e-12 for figure in of.values())
    verdict, of = figures(tmp_path, suite, thrown(0.5))
    # Kinetic energy: half of 2 (1.5^2 + 6^2), of the spin half of 0.3 3^2; the gain is half of 2 (1.5^2 - 1).
    assert verdict == "falls short" and of["energy_gain"].value == pytest.approx(1.25 / (2.25 + 36 + 1.35))
    # About the point that flies on, 5 m above at the end: 2 * 5 * 0.5, over itself and the spin; linear it is 1 of 12.4.
    assert of["momentum_error"].value == pytest.approx(5 / (5 + 0.3 * 3)) and of["momentum_error"].note == "angular"
    spun = [[*row[:-1], 3 + row[0]] for row in thrown(0)]
    assert figures(tmp_path, suite, spun)[1]["momentum_error"].value == pytest.approx(0.3 * 1 / (0.3 * 4))
    verdict, of = figures(tmp_path, suite, [row[:9] for row in thrown(0)], head=HEAD[:9])
    assert verdict == "not measured" and of["energy_gain"].value is None


# Oracle: what falls apart in closed form, with a principal axis that turns.
def test_a_turning_bodys_energy_is_that_of_its_axes(tmp_path):
    spec = [{"measure": "energy_error", "limit": 1e-9}]
    suite = written(tmp_path, spec, [("block", 1.0, [0.1, 0.2, 0.3], [0, 0, 0, *STILL], [0, 0, 0, 4, 0, 0])], gravity=[0, 0, 0])
    rows = [[t, "block", 0, 0, 0, np.cos(2 * t), np.sin(2 * t), 0, 0, 0, 0, 0, 4, 0, 0] for t in TIMES]
    assert figures(tmp_path, suite, rows)[0] == "held"
    # About another axis of the world, whose moment of inertia is 0.2 to 0.3 as the block turns.
    wrong = [[*row[:-3], 0, 4, 0] if row[0] else row for row in rows]
    assert figures(tmp_path, suite, wrong)[1]["energy_error"].value == pytest.approx((0.3 - 0.1) / 0.3, rel=1e-3)


def solid(kind, place, turn=STILL, radius=0.0, length=0.0, edges=(0, 0, 0)):
    return judge.Solid(kind, np.array([[*place, *turn]], float), radius, length, np.array(edges, float) / 2)


C45, QUARTER = [np.cos(np.pi / 8), 0, np.sin(np.pi / 8), 0], [np.cos(np.pi / 4), np.sin(np.pi / 4), 0, 0]
# Oracle: depth by hand.
DEPTHS = [
    (solid("sphere", [0, 0, 0.9], radius=1), solid("plane", [0, 0, 0]), 0.1),
    (solid("box", [0, 0, 1.3], C45, edges=[2, 2, 2]), solid("plane", [0, 0, 0]), np.sqrt(2) - 1.3),
    (solid("box", [0, 0, 0], edges=[2, 2, 2]), solid("box", [0.3, 0.2, 1.95], edges=[2, 2, 2]), 0.05),
    (solid("box", [0, 0, 0], edges=[2, 2, 2]), solid("box", [0, 0, 2.35], C45, edges=[2, 2, 2]), 1 + np.sqrt(2) - 2.35),
    (solid("sphere", [0, 0, 0]), solid("sphere", [0, 0, 0], radius=1), 1.0),
    (solid("capsule", [5, 0, 1.9], QUARTER, radius=1, length=12), solid("box", [0, 0, 0], edges=[20, 20, 2]), 0.1),
    (solid("capsule", [0, 0, 0], QUARTER, radius=1, length=4), solid("capsule", [0, 2.5, 0.5], radius=1, length=1), 2 - np.hypot(0.5, 0)),
    (solid("cylinder", [0, 0, 0.9], QUARTER, radius=1, length=3), solid("plane", [0, 0, 0]), 0.1),
    (solid("sphere", [0, 1.9, 0], radius=1), solid("cylinder", [0, 0, 0], radius=1, length=3), 0.1),
    (solid("sphere", [0, 0, 0.3], radius=0.1), solid("box", [0, 0, 0], edges=[2, 2, 2]), 0.8),
]


@pytest.mark.parametrize("a, b, expected", DEPTHS)
def test_depths_of_two_shapes(a, b, expected):
    for one, other in ((a, b), (b, a)):
        assert judge.depth(one, other)[0] == pytest.approx(expected, abs=1e-9)


def test_hidden_penetration_is_found(tmp_path):
    """A box deep in the one below, corner above corner, so that no corner lies inside it by any of its sides."""
    boxes = [("low", 1, [1, 1, 1], [0, 0, 0.5, *STILL]), ("high", 1, [1, 1, 1], [0, 0, 1.4, *STILL])]
    shapes = [["low", "low", "box", 0, 0, 0, *STILL, 0, 0, 1, 1, 1], ["high", "high", "box", 0, 0, 0, *STILL, 0, 0, 1, 1, 1]]
    suite = written(tmp_path, [{"measure": "penetration", "pairs": [["low", "high"]], "from": 0, "limit": 1e-4}], boxes, shapes=shapes)
    rows = [[t, name, *pose, *[0] * 6] for t in TIMES for name, _, _, pose in boxes]
    verdict, of = figures(tmp_path, suite, rows)
    assert verdict == "falls short" and of["penetration"].value == pytest.approx(0.1) and of["penetration"].note == "low in high"


def test_a_joint_that_opens_is_told(tmp_path):
    joints = [["pin", "hinge", "world", "link", 1, 0, 0, 0, 0, 0, 0, -1, 0], ["rail", "slider", "world", "link", 0, 1, 0, 0, 0, 0, 0, -1, 0]]
    suite = written(tmp_path, [{"measure": "joint_gap", "limit": 1e-4}], [("link", 1, [1, 1, 1], [0, 1, 0, *STILL])], joints)
    rows = lambda far: [[t, "link", 0, 1 + far[1] * t, far[0] * t, *STILL, *[0] * 6] for t in TIMES]  # noqa: E731
    assert figures(tmp_path, suite, rows((0, 0)))[0] == "held"
    assert figures(tmp_path, suite, rows((3e-3, 4e-3)))[1]["joint_gap"].value == pytest.approx(5e-3)
    (suite / "case/joints.csv").write_text((suite / "case/joints.csv").read_text().replace("pin,hinge", "pin,slider").replace("1,0,0,0,0,0,0,-1", "0,1,0,0,0,0,0,-1"))
    assert figures(tmp_path, suite, rows((3e-3, 4e-3)))[1]["joint_gap"].value == pytest.approx(3e-3)


def with_cell(rows, line, column, value):
    out = [list(row) for row in rows]
    out[line - 2][column] = value
    return out


GOOD = held(lambda t: [0, 0, 0])
WRONG = [
    (lambda: (GOOD, [name for name in HEAD if name != "qz"]), "case.csv:1:1: qz: got no such column, need the columns time,body,x,y,z,qw,qx,qy,qz"),
    (lambda: (GOOD, [*HEAD[:-1], "wzz"]), "case.csv:1:44: wzz: got an unknown column"),
    (lambda: (with_cell(GOOD, 7, 3, "nan"), HEAD), "case.csv:7:14: y: got nan, need a finite number"),
    (lambda: (with_cell(GOOD, 7, 4, "far"), HEAD), "case.csv:7:18: z: got far, need a finite number"),
    (lambda: (GOOD[:100], HEAD), "case.csv:101:1: time: got an end at 0.49 s, need rows to 1 s"),
    (lambda: (GOOD[:100] + GOOD[120:], HEAD), "case.csv:102:1: time: got 0.6 s after 0.49 s, need a row every 0.01 s"),
    (lambda: (GOOD[:10] + GOOD[14:16] + GOOD[10:], HEAD), "case.csv:14:1: time: got 0.05 after 0.07, need times that rise"),
    (lambda: (GOOD[:11] + GOOD[12:], HEAD), "case.csv:12:1: body: got no can at 0.05 s, need each of palm, can at every time"),
    (lambda: (GOOD[:12] + GOOD[11:], HEAD), "case.csv:14:6: body: got can twice at 0.05 s, need one row for each body and time"),
    (lambda: ([[*row[:2], *(1000 * x for x in row[2:5]), *row[5:]] for row in GOOD], HEAD), "case.csv:3:1: can: got 100, 0, 0 first, need 0.1, 0, 0: metres"),
    (lambda: ([[*row[:5], *row[6:9], row[5], *row[9:]] for row in GOOD], HEAD), "a first quaternion 0, 0, 0, 1, need 1, 0, 0, 0: w x y z"),
    (lambda: (with_cell(GOOD, 7, 5, 0.5), HEAD), "case.csv:7:22: qw: got a quaternion of length 0.5, need a unit quaternion"),
    (lambda: ([row[:8] for row in GOOD], HEAD), "case.csv:2:1: row: got 8 fields, need 15"),
    (lambda: ([[*row[:9], 9, 0, 0, 0, 0, 0] if row[1] == "can" else row for row in GOOD], HEAD), "case.csv:3:1: can: got a first twist 9, 0, 0, 0, 0, 0, need 0, 0,"),
    (lambda: ([], HEAD), "case.csv:1:1: table: got no row, need rows from 0 to 1 s"),
]


@pytest.mark.parametrize("made, message", WRONG, ids=range(len(WRONG)))
def test_a_wrong_table_gets_file_line_and_column(tmp_path, made, message):
    suite = written(tmp_path, IN_PALM, PALM_AND_CAN)
    rows, head = made()
    done = subprocess.run([sys.executable, FILES / "judge.py", told(tmp_path, rows, head), "--suite", suite], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and message in done.stderr and done.stdout == "" and "Traceback" not in done.stderr, done.stderr


def test_a_case_that_broke_off_is_no_wrong_table(tmp_path):
    suite = written(tmp_path, IN_PALM, PALM_AND_CAN)
    [row] = judge.judge(told(tmp_path, GOOD[:50], failed="not finite at 0.25 s"), suite, [])
    assert row["verdict"] == "broke off" and row["why"] == "not finite at 0.25 s"
    (tmp_path / "results/run.json").write_text("{}")
    with pytest.raises(judge.Wrong, match=r"run.json:1:1: run: got no such file"):
        judge.judge(tmp_path / "results", suite, [])


# The folder.


def test_the_suite_is_whole_small_and_the_same_each_time(suite):
    content = json.loads((suite / "suite.json").read_text())
    found = {path.relative_to(suite).as_posix(): path.read_bytes() for path in suite.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    assert sorted(found) == content["files"] and content["cases"] == [case.name for case in _suite_cases.every()]
    assert sum(map(len, found.values())) < 10e6
    assert len([name for name in content["cases"] if name.startswith("grasp_")]) == 30
    for name in ("grasp_pinch.small_woman", "stack", "crank"):
        [asked] = [case for case in _suite_cases.every() if case.name == name]
        again = _suite.case_files(asked)
        assert all(hashlib.sha256(found[f"{name}/{file}"]).digest() == hashlib.sha256(text).digest() for file, text in again.items())
    for name in content["cases"]:
        assert {"case.json", "model.xml", "bodies.csv", "joints.csv", "shapes.csv", "pairs.csv", "README.md"} <= {path.name for path in (suite / name).iterdir()}
        spec = json.loads((suite / name / "case.json").read_text())
        assert all(each["why"] for each in spec["judge"]) and (suite / name / "urdf").is_dir() == (name != "crank")


def test_a_folder_of_the_users_stays(tmp_path, suite):
    taken = tmp_path / "mine"
    taken.mkdir()
    (taken / "notes.txt").write_text("mine")
    done = handsim("export", "--suite", taken)
    assert done.returncode == 2 and "notes.txt is not of a suite, need a new folder" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine"] and (taken / "notes.txt").read_text() == "mine"
    for words, message in ((("--suite", tmp_path / "none/suite"), "need a folder in one that is there"), (("--suite", "x", "grasp_pinch"), "--suite DIR alone"),
                           (("--suite", taken / "notes.txt"), "which is no folder"), (("--suite", ""), "--suite: got")):
        done = handsim("export", *words, cwd=tmp_path)
        assert done.returncode == 2 and message in done.stderr and "Traceback" not in done.stderr, done.stderr


def test_an_earlier_suite_is_replaced_and_what_lies_in_it_is_not(tmp_path, monkeypatch):
    place = tmp_path / "suite"
    monkeypatch.setattr(_suite, "every", lambda: [case for case in _suite_cases.every() if case.name == "stack"])
    assert "1 cases" in _suite.write_suite(str(place))
    first = (place / "stack/case.json").read_bytes()
    _suite.write_suite(str(place))
    assert (place / "stack/case.json").read_bytes() == first and [path.name for path in tmp_path.iterdir()] == ["suite"]
    (place / "results.csv").write_text("mine")
    with pytest.raises(hs.Error, match="results.csv is not of a suite"):
        _suite.write_suite(str(place))


def test_a_full_disk_leaves_what_was_there(tmp_path, monkeypatch):
    place = tmp_path / "suite"
    monkeypatch.setattr(_suite, "suite_files", lambda told: {"suite.json": _suite.MARK + b' "files": ["suite.json", "a"]}', "a": b"1"})
    _suite.write_suite(str(place))
    real = Path.write_bytes
    monkeypatch.setattr(Path, "write_bytes", lambda self, content: real(self, content) if self.name != "a" else (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(hs.Error, match="No space left"):
        _suite.write_suite(str(place))
    assert sorted(path.name for path in place.iterdir()) == ["a", "suite.json"] and [path.name for path in tmp_path.iterdir()] == ["suite"]


# Oracle: the palm's motion in a run of the scene.
def test_the_shake_is_that_of_the_scenes():
    [asked] = [case for case in _suite_cases.every() if case.name == "grasp_pinch.median_man"]
    run = hs.Simulation(hs.load(asked.scene, asked.overrides(), engine="articulated"), contact_forces=False)
    rows = np.array([[float(x) for x in line.split(",")] for line in _suite.shake_table(1e-3).decode().splitlines()[1:]])
    run.step(substeps=round((asked.begins + _suite_cases.HOLD) / 1e-3))
    palm = run.scene.bodies.index("right.palm")
    start = run.bodies.position[palm]
    for before, row in zip(rows, rows[1:]):
        run.step()
        assert np.allclose(run.bodies.position[palm] - start, row[1:4], atol=1e-9)
        # What a driven body's velocity is there: the mean of the step.
        assert np.allclose(run.bodies.velocity[palm], (row[1:4] - before[1:4]) / 1e-3, atol=1e-6)
    assert np.allclose(np.gradient(rows[:, 1:4], 1e-3, axis=0)[1:-1], rows[1:-1, 4:7], atol=2e-3)
    assert np.allclose(np.gradient(rows[:, 4:7], 1e-3, axis=0)[1:-1], rows[1:-1, 7:], atol=0.25)
    assert np.abs(rows[:, 7:]).max() == pytest.approx(19.6, rel=1.3e-4)  # a peak between two rows: 1 - cos(2 pi 5 Hz 0.5 ms)


# The engine here.


def table_of(results, suite):
    return {row["case"]: row for row in judge.judge(results, suite, [])}


# Oracle: the whole grasp, from the approach on, by `handsim grasp`.
@pytest.mark.parametrize("person", _suite_cases.PERSONS)
def test_verdicts_are_those_of_the_whole_grasps(results, suite, tmp_path, person):
    rows = table_of(results, suite)
    cases = {case.scene: case for case in _suite_cases.every() if case.person == person}
    assert len({json.dumps(case.overrides()) for case in cases.values()}) == 1
    found = hs.study.grasps(list(cases), {**next(iter(cases.values())).overrides(), "solver.engine": "articulated"})
    whole = {row["scene"]: row["outcome"] for row in found.summaries["grasps"]}
    assert {scene: rows[case.name]["verdict"] for scene, case in cases.items()} == {scene: told.split()[0].lower() for scene, told in whole.items()}


# Oracle: the whole grasp at that friction, by `handsim grasp`, which is lost.
def test_a_slippery_ball_is_lost_here_as_in_the_whole_grasp(suite, tmp_path):
    slippery = {"contacts.materials.0.friction": "0.05"}
    copied, out = tmp_path / "suite", tmp_path / "results"
    shutil.copytree(suite / "grasp_tripod.median_man", copied / "grasp_tripod.median_man")
    shutil.copy(suite / "shake.csv", copied)
    place = copied / "grasp_tripod.median_man/case.json"
    content = json.loads(place.read_text())
    content["handsim"]["set"].update(slippery)
    place.write_text(json.dumps(content))
    subprocess.run([sys.executable, suite / "drivers/handsim_driver.py", "--suite", copied, "--out", out], check=True, capture_output=True, timeout=300)
    [row] = judge.judge(out, copied, [])
    [asked] = [case for case in _suite_cases.every() if case.name == "grasp_tripod.median_man"]
    [whole] = hs.study.grasps(asked.scene, {**asked.overrides(), **slippery, "solver.engine": "articulated"}).summaries["grasps"]
    assert row["verdict"] == "lost" and whole["outcome"].startswith("LOST")


def test_every_other_case_is_held(results, suite):
    assert not {name: row["figures"] for name, row in table_of(results, suite).items() if not name.startswith("grasp_") and row["verdict"] != "held"}


# The release's own verdicts and figures. Bounds: a hundredth of a grip is a fifth of the change of friction or mass that makes a grasp marginal
# (docs/grasping.md); a tenth of a limit is what a margin may change by.
def test_verdicts_and_forces_are_those_of_the_release(results, suite):
    rows = table_of(results, suite)
    with open(RELEASE, newline="") as file:
        release = {row["case"]: row for row in csv.DictReader(file)}
    assert release.keys() == rows.keys()
    changed = []
    for name, then in release.items():
        now = {figure.name: figure for figure in rows[name]["figures"]}
        forces = [each["of"] for each in json.loads((suite / name / "case.json").read_text())["judge"] if each["measure"] == "grip"]
        if forces:
            # A case's own force is that of this build.
            now["grip"] = now["grip"]._replace(value=now["grip"].value * forces[0])
        if rows[name]["verdict"] != then["verdict"]:
            changed.append(f"{name}: {then['verdict']}, now {rows[name]['verdict']}")
        for figure in ("shift", "turn", "shaken", "creep", "grip"):
            if not then[figure] and figure not in now:
                continue
            was, bound = float(then[figure]), 0.01 * float(then["grip"] or 0) if figure == "grip" else now[figure].limit * (1 if figure == "creep" else 0.1)
            if not abs(now[figure].value - was) <= bound:
                changed.append(f"{name}: {figure} {was:g}, now {now[figure].value:g}")
    assert not changed, "\n".join(changed)
