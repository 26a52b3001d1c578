"""The study of effects, by motions that closed forms know."""
import json
import math
import os
import subprocess

import numpy as np
import pytest

import handsim as hs
from handsim._effects import measure

PROGRAM = os.environ.get("HANDSIM_PROGRAM", "")
BALL = {"objects": [{"name": "ball", "shape": "sphere", "radius": 0.1, "mass": 1, "position": [0, 0, 0]}], "duration": 0.5}
BOB = {"bodies": [{"name": "bob", "mass": 0.1, "inertia": [1e-4, 1e-4, 1e-4], "position": [0.1, 0, 0]}], "effects": ["gravity"], "duration": 0.3}


def row_of(of, name):
    return next(row for row in of.rows if row.name == name)


def test_without_gravity_a_free_body_stays_at_its_start():
    """Oracle: free fall under semi-implicit Euler, g h^2 n (n + 1) / 2, that is g t^2 / 2 to first order."""
    of = measure(hs.load({**BALL, "effects": ["gravity"], "gravity": [0, 0, -10]}), 1)
    assert len(of.rows) == 1 and of.steps == 500 and not of.has_angles
    assert of.rows[0].displacement.value == pytest.approx(10 * 1e-6 * 500 * 501 / 2, abs=1e-12)
    assert of.rows[0].displacement.value == pytest.approx(0.5 * 10 * 0.25, abs=10 * 1e-3 * 0.5)
    assert of.rows[0].displacement.place == "ball" and of.rows[0].displacement.time == pytest.approx(0.5, abs=1e-12)


def test_angle_differences_are_the_motion_if_the_variant_rests():
    """Oracle: a pendulum that starts horizontally. Without gravity it rests, so the largest difference is the angle of the complete
    scene; it passes the lowest point, so that is more than 90 degrees."""
    scene = hs.load({**BOB, "joints": [{"name": "pin", "type": "hinge", "parent": "world", "child": "bob", "position": [0, 0, 0],
                                        "axes": [{"name": "swing", "axis": [0, 1, 0]}]}]})
    row, whole, angles = measure(scene, 1).rows[0], hs.Simulation(scene), []
    for _ in range(300):
        whole.step()
        angles.append(float(whole.q[0]))
    assert np.max(np.abs(angles)) > math.pi / 2
    assert row.angle.value == pytest.approx(np.max(np.abs(angles)), abs=1e-12) and row.angle.place == "pin.swing"
    assert row.angle_rms == pytest.approx(np.sqrt(np.mean(np.square(angles))), abs=1e-12)


def test_the_angle_of_a_ball_joint_is_that_of_the_turn():
    """Oracle: the same pendulum on a hinge: about one axis a ball joint turns by the hinge's angle."""
    joint = {"name": "pin", "parent": "world", "child": "bob", "position": [0, 0, 0]}
    ball = measure(hs.load({**BOB, "joints": [{**joint, "type": "ball"}]}), 1).rows[0]
    hinge = measure(hs.load({**BOB, "joints": [{**joint, "type": "hinge", "axes": [{"name": "swing", "axis": [0, 1, 0]}]}]}), 1).rows[0]
    assert ball.angle.place == "pin" and ball.angle.value > math.pi / 2
    assert ball.angle.value == pytest.approx(hinge.angle.value, abs=1e-6) and ball.angle_rms == pytest.approx(hinge.angle_rms, abs=1e-6)


def test_an_effect_without_influence_changes_nothing():
    """Oracle: bit equality; the gravity is zero."""
    gravity = row_of(measure(hs.load("two_hands", {"gravity": [0, 0, 0], "duration": 0.2}), 5), "gravity")
    assert (gravity.angle.value, gravity.angle_rms, gravity.displacement.value) == (0, 0, 0)


def test_dependent_effects_are_removed_together(tmp_path):
    """Oracle: the contract: without the last contact effect, friction is removed too and the row says so. Speculative contacts have a
    row. Without the ground the ball falls on."""
    scene = hs.load({**BALL, "ground": {"height": -0.1}, "effects": ["gravity", "ground_contact", "friction"]})
    of = measure(scene, 1)
    assert [row.name for row in of.rows] == ["gravity", "ground_contact", "friction", "solver.speculative"]
    assert of.rows[3].displacement.value == 0
    assert row_of(of, "ground_contact").without == ["friction"] and row_of(of, "friction").without == []
    assert row_of(of, "ground_contact").displacement.value == pytest.approx(0.5 * 9.80665 * 0.25, abs=0.01)
    assert "ground_contact with friction" in hs.study.effects(scene, repeats=1).text


def test_settings_of_the_solver_have_rows():
    of = measure(hs.load({**BALL, "effects": ["gravity"], "solver": {"projection": True}}), 1)
    assert [(row.name, row.fault) for row in of.rows] == [("gravity", None), ("solver.projection", None)]


def test_an_effect_without_which_the_scene_fails_has_a_row_with_the_fault():
    """Oracle: without the ground the ball is faster than 1000 m/s."""
    ball = {**BALL["objects"][0], "position": [0, 0, 0.1]}
    scene = hs.load({"objects": [ball], "duration": 1.2, "ground": {"height": 0}, "effects": ["gravity", "ground_contact"], "gravity": [0, 0, -1000]})
    of = measure(scene, 1)
    assert "ball: speed" in row_of(of, "ground_contact").fault and row_of(of, "gravity").fault is None
    assert hs.study.effects(scene, repeats=1).summary["rows"][1]["fault"] == row_of(of, "ground_contact").fault


def test_every_effect_of_a_controlled_scene_on_a_driven_wrist_can_be_removed():
    of = measure(hs.load("pose_tracking", {"duration": 0.05}), 1)
    assert row_of(of, "actuation").fault is None and row_of(of, "wrist_motion").fault is None
    assert row_of(of, "actuation").angle.value > 0


def test_files_of_a_title_that_gnuplot_could_misread(tmp_path):
    study = hs.study.effects({**BALL, "title": "it's \\ `x`", "effects": ["gravity"]}, repeats=1, out=tmp_path)
    assert len((tmp_path / "effects.csv").read_text().splitlines()) == 2 + 1
    assert study.summary["title"] == "it's \\ `x`" and "title 'it s    x : without each effect in turn'" in (tmp_path / "effects.gp").read_text()


@pytest.mark.skipif(not PROGRAM, reason="the program is not in the path (HANDSIM_PROGRAM)")
def test_the_command_prints_the_table_or_the_json(tmp_path):
    """Oracle: each row's command, run again, has the effects that the row has left."""
    def called(*more):
        return subprocess.run([PROGRAM, "effects", "two_hands", "--out", str(tmp_path), "--set", "duration=50 ms", "--repeats", "1", *more],
                              capture_output=True, text=True, timeout=60)

    table, printed = called(), called("--json", "--engine", "articulated")
    assert table.returncode == printed.returncode == 0, table.stderr + printed.stderr
    assert "\njoint_stops" in table.stdout and f"files in {tmp_path}" in table.stdout
    assert printed.stdout == (tmp_path / "effects.json").read_text()
    commands = json.loads((tmp_path / "study.json").read_text())["rows"]["effects.csv"]
    assert len(commands) == 4 and "effects=[gravity, joint_stops]" in commands[3] and "--set solver.engine=articulated" in commands[0]
    for words, problem in ((["--repeats", "0"], "--repeats: got 0, need a whole number of timed rounds"), (["--sat", "1"], "--sat: got an unknown option"),
                           (["--set", "solver.stepp=1 ms"], "nearest: step"),
                           (["--set", "effects=[]", "--set", "criteria={}"], "effects: got no effect")):
        refused = called(*words)
        assert refused.returncode == 2 and problem in refused.stderr, refused.stderr
