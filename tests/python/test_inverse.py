"""``handsim inverse``: its tables, text and verdicts."""
import json
import math
import subprocess
import sys

import numpy as np
import pytest

import handsim as hs
from handsim import _inverse

DATA = hs.data_path()
SHORT = ["every_pose", "--engine", "articulated", "--set", "duration=0.2 s", "--set", "criteria={}"]


def inverse(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "inverse", *map(str, words)], capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    out = tmp_path_factory.mktemp("inverse") / "out"
    done = inverse(*SHORT, "--out", out)
    assert done.returncode == 0, done.stderr
    return out, done


# Oracle: the table over time: largest and RMS of its active torques, which are what is left of the total without the passive ones.
def test_figures_are_those_of_the_table_over_time(checked):
    out, _ = checked
    study, summary = hs.study.inverse("every_pose", {"duration": "0.2 s", "criteria": {}, "solver.engine": "articulated"}), json.loads((out / "summary.json").read_text())
    torques = study.tables["torques"]
    assert summary["steps"] == torques.rows and summary["motion"] == "programs of the scene"
    for axis in summary["axes"]:
        total, passive, active = (np.asarray(torques[f"{axis['axis']}_{part}"]) for part in ("total", "passive", "active"))
        assert np.array_equal(active, total - passive)
        assert axis["largest_torque_Nm"] == np.abs(active).max() and axis["rms_torque_Nm"] == pytest.approx(math.sqrt(np.mean(active**2)), rel=1e-12)
    assert study.text.startswith("axis ") and study.summaries["summary"]["axes"] == summary["axes"]


# Oracle: the angles of the check against those of the motion.
def test_errors_are_the_difference_of_check_and_motion(checked):
    out, done = checked
    summary = json.loads((out / "summary.json").read_text())
    motion, check = (np.loadtxt(out / name, skiprows=7) for name in ("motion.mot", "forward.mot"))
    assert motion.shape == check.shape and np.array_equal(motion[:, 0], check[:, 0])
    error = (check - motion)[:, 1:]
    assert summary["forward"]["passed"] and summary["forward"]["rms_error_deg"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-6)
    for column, axis in enumerate(summary["axes"]):
        assert axis["forward_largest_error_deg"] == pytest.approx(np.abs(error[:, column]).max(), rel=1e-6, abs=1e-12)
    assert f"RMS error {summary['forward']['rms_error_deg']:.3g} deg over all axes" in done.stdout and done.stdout.splitlines()[-1].startswith(f"files in {out}")


def test_without_a_folder_it_is_called_after_the_scene(tmp_path):
    done = subprocess.run([sys.executable, "-m", "handsim", "inverse", *SHORT, "--no-check"], capture_output=True, text=True, timeout=300, cwd=tmp_path)
    assert done.returncode == 0 and (tmp_path / "out/every_pose_inverse/torques.sto").exists(), done.stderr


# What was not simulated was not measured.
def test_a_check_that_was_not_made_is_no_zero(tmp_path):
    done = inverse(*SHORT, "--no-check", "--json", "--out", tmp_path / "out")
    summary = json.loads(done.stdout)
    assert done.returncode == 0 and "forward" not in summary and done.stdout == (tmp_path / "out/summary.json").read_text()
    assert not (tmp_path / "out/forward.mot").exists() and not any("forward_rms_error_deg" in axis for axis in summary["axes"])
    assert "not checked" in hs.study.inverse("every_pose", {"duration": "0.1 s", "criteria": {}}, check=False).text


# A force of 5 N on a fingertip that the simulation does not have: its torques do not return to the motion.
def test_a_check_that_misses_is_a_failure(tmp_path):
    rows = "".join(f"{time},right.index_distal,right.middle_distal,0,0,0,0,0,1,0,5,0,0,0\n" for time in (0, 1))
    (tmp_path / "contacts.csv").write_text("time[s],a,b,x[m],y[m],z[m],normal.x,normal.y,normal.z,depth[m],normal_force[N],friction.x[N],friction.y[N],"
                                           f"friction.z[N]\n{rows}")
    words = ["every_pose", "--loads", tmp_path / "contacts.csv", "--out", tmp_path / "out", "--set", "duration=0.5", "--set", "criteria={}"]
    missed, summary = inverse(*words), json.loads((tmp_path / "out/summary.json").read_text())
    assert missed.returncode == 1 and "the check misses the motion: RMS error" in missed.stderr and not summary["forward"]["passed"]
    assert summary["loads"] == "contacts.csv" and summary["forward"]["rms_error_deg"] > summary["forward"]["limit_deg"] == pytest.approx(1, rel=1e-15)
    unchecked = inverse(*words, "--no-check")
    assert unchecked.returncode == 0 and "not checked" in unchecked.stdout, unchecked.stderr


# Oracle: excitations and activations are 0 to 1; the reserves' share of the active torques.
def test_muscles_have_tables_and_leave_a_share_undone(tmp_path):
    done, out = inverse(*SHORT, "--muscles", "--co-contraction", "0.05", "--no-check", "--out", tmp_path / "out"), tmp_path / "out"
    assert done.returncode == 0, done.stderr
    summary, reserves, torques = json.loads((out / "summary.json").read_text()), np.loadtxt(out / "reserves.sto", skiprows=7), np.loadtxt(out / "torques.sto", skiprows=7)
    for name, least in (("activations", 0.04), ("excitations", 0.0)):
        values = np.loadtxt(out / f"{name}.sto", skiprows=7)[:, 1:]
        assert least <= values.min() and values.max() <= 1 + 1e-12
    share = np.sqrt(np.sum(reserves[:, 1:]**2) / np.sum(torques[:, 3::3]**2))
    assert summary["least_activation"] == 0.05 and summary["reserve_share"] == pytest.approx(share, rel=1e-9)
    assert f"muscles leave {100 * share:.2g} % of the torques undone (RMS over all axes): reserves.sto\n" in done.stdout
    causes = summary["undone"]
    assert sum(causes["beyond_strength"].values()) + causes["no_balance"] + causes["faster_than_muscles"] + causes["other"] == pytest.approx(1, abs=1e-9)


def test_causes_are_named_by_their_shares():
    beyond = {"a": 0.1, "b": 0.2, "c": 0.05, "d": 0.01, "e": 0.001}
    assert _inverse.undone_text(_inverse.Undone(beyond, 0.4, 0.235, 0.004)) == (
        "  40 % of it that no balance of muscles gives, which turn several axes at once\n  36 % of it beyond the strength of muscles: b 20 %, a 10 %, c 5 %, d 1 %, ...\n"
        "  24 % of it in changes that are faster than muscles follow, as noise of points makes them\n")


# Oracle: the scene's own effects.
def test_muscles_are_put_in_effect_where_a_scene_has_none():
    scene = hs.load("every_pose", {"effects": ["gravity", "self_contact", "friction", "joint_stops", "actuation"]})
    (beside,), (apart,) = _inverse.muscle_overrides(scene, False), _inverse.muscle_overrides(scene, True)
    assert beside == f"effects=[muscles, tendon_coupling, {', '.join(scene.effects)}]" and apart == "effects=[muscles, tendon_coupling, gravity, joint_stops, actuation]"
    assert set(hs.load("every_pose", {"effects": ["muscles", "tendon_coupling", "gravity", "joint_stops", "actuation"]}).effects) == set(apart[9:-1].split(", "))
    assert _inverse.muscle_overrides(hs.load("muscle_poses"), False) == []


BAD = {
    "nothing": ([], "SCENE: got nothing, need one"),
    "no motion": (["two_hands"], "--motion: got none, with a scene without control, need a motion file, or programs of the scene"),
    "a free hand": (["dropped_hand", "--motion", "x.csv"], "a hand whose palm is not held"),
    "no such motion": (["every_pose", "--motion", "/none.mot"], "/none.mot"),
    "a length as cut-off": (["every_pose", "--cutoff", "6 mm"], '--cutoff: got 6 mm, need a frequency such as "6 Hz", or none'),
    "too much": (["every_pose", "--muscles", "--co-contraction", "2"], "--co-contraction: got 2, need an activation, 0 to 0.9"),
    "co-contraction of no muscles": (["every_pose", "--co-contraction", "0.1"], "--co-contraction: got no muscles, need --muscles beside it"),
    "a report of one hand": (["every_pose", "--report"], "--report: got no drawn hands, need --uncertain beside it"),
    "JSON of drawn hands": (["every_pose", "--uncertain", "3", "--json"], "--json: got drawn hands, need no --uncertain beside it"),
    "names of another kind": (["every_pose", "--names", DATA / "config/two_hands.yaml"], "got a scene, need "),
    "a misspelt option": (["every_pose", "--mution", "x"], "(nearest: --motion)"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_a_sentence(case, tmp_path):
    words, problem = BAD[case]
    done = inverse(*words, "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "") and problem in done.stderr and not list(tmp_path.glob("out/*")), done.stderr
