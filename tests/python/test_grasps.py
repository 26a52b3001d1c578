"""``handsim grasp`` and its tables."""
import csv
import json
import os
import subprocess
import sys

import pytest

import handsim as hs
from handsim import _grasps

PROGRAM = os.environ.get("HANDSIM_PROGRAM", "")
SHORT = ["--engine", "articulated", "--set", "grasps.0.hold=0.1 s", "--set", "grasps.0.shake.levels=[]"]


def grasp(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "grasp", *map(str, words)], capture_output=True, text=True, timeout=300)


def table_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def pinch(tmp_path_factory):
    out = tmp_path_factory.mktemp("grasps") / "of_a_card"
    return out, grasp("grasp_pinch", *SHORT, "--side", "both", "--confirm", "--out", out)


# Oracle: the JSON beside it, the runs' own summaries, and the same study by the function.
def test_the_tables_have_the_figures_of_the_runs(pinch):
    out, done = pinch
    rows, told = table_of(out / "grasps.csv"), json.loads((out / "grasps.json").read_text())
    assert [row["side"] for row in rows] == ["right", "left"] and not (out / "climbs.csv").exists()
    for row, one in zip(rows, told):
        assert float(row["shift[mm]"]) == pytest.approx(1e3 * one["shift_m"], rel=1e-5) and float(row["turn[deg]"]) == pytest.approx(57.29578 * one["turn_rad"], rel=1e-5)
        assert float(row["slip[um/s]"]) == pytest.approx(1e6 * one["slip_m_per_s"], rel=1e-5)
        assert row["held"] == str(int(one["held"])) and row["outcome_half_step"] == one["half_step"]["outcome"] and row["turning"] == ""
        summary = json.loads((out / f"grasp_pinch_{row['side']}/summary.json").read_text())
        assert all(each["verdict"] == "held" for each in summary["criteria"]) == one["criteria_held"]
    assert done.returncode == (0 if all(one["criteria_held"] for one in told) else 1)
    study = hs.study.grasps("grasp_pinch", {"solver.engine": "articulated", "grasps.0.hold": "0.1 s", "grasps.0.shake.levels": "[]"}, sides=["right"])
    assert study.summaries["grasps"][0]["shift_m"] == told[0]["shift_m"]


def test_the_screen_has_a_line_for_each_grasp_and_its_half_step(pinch):
    out, done = pinch
    lines = done.stdout.splitlines()
    assert lines[0].split() == ["scene", "hand", "verdict", "criteria", "margin", "slip", "in", "shake", "after", "it", "turned", "contacts", "grip", "epsilon",
                                "volume", "friction"]
    assert sum(line.startswith("grasp_pinch ") for line in lines) == sum(line.startswith("  at half the step") for line in lines) == 2
    assert lines[-1] == f"files in {out}" and len(set(map(len, (line for line in lines if line.startswith("grasp_pinch "))))) == 1


# Oracle: the command of the study, run again.
def test_the_command_of_the_study_repeats_it(pinch, tmp_path):
    command = json.loads((pinch[0] / "study.json").read_text())["command"]
    assert command.startswith("handsim grasp ") and "--side both --set solver.engine=articulated" in command and command.endswith(" --out again")


# Oracle: the person of the scene, median_man: 1.755 m, a hand of 193.1 mm (handsim hand).
@pytest.mark.skipif(not hs.has_reports or not PROGRAM, reason="built without three.js, or the program is not in the path")
def test_the_page_says_whose_hand_it_is_and_is_not_titled_by_its_folder(tmp_path):
    out = tmp_path / "of_a_can"
    subprocess.run([PROGRAM, "grasp", "grasp_power_can", *SHORT, "--out", str(out), "--report"], timeout=300, check=False)
    row = table_of(out / "grasps.csv")[0]
    assert row["stature[m]"] == "1.755" and float(row["hand_length[m]"]) == pytest.approx(0.1931, abs=1e-4) and float(row["grip_strength[N]"]) > 300
    assert "<title>1 grasp</title>" in (out / "report.html").read_text() and (out / "grasp_power_can/report.html").exists()


# Oracle: nothing holds a can without friction that is lifted.
def test_what_was_not_measured_is_empty(tmp_path):
    done = grasp("grasp_power_can", *SHORT, "--friction", "0", "--friction-search", "--out", tmp_path / "out")
    row, told = table_of(tmp_path / "out/grasps.csv")[0], json.loads((tmp_path / "out/grasps.json").read_text())[0]
    assert done.returncode == 1 and "  note: no search for the least friction: the scene's own friction does not meet all criteria\n" in done.stdout
    assert row["smallest_friction"] == "" and told["smallest_friction"] is None and "turning" not in told and "half_step" not in told
    assert row["held"] == "0" and (row["margin"] == "") == (told["margin"] is None)


# Oracle: the shipped climb; its load over the norm of grip.
def test_a_climb_has_a_table_of_its_own(tmp_path):
    done = grasp("climb_jug", "--engine", "articulated", "--out", tmp_path / "out")
    row, told = table_of(tmp_path / "out/climbs.csv")[0], json.loads((tmp_path / "out/climbs.json").read_text())[0]
    assert done.returncode == 0 and done.stdout.splitlines()[0].split()[:4] == ["scene", "hand", "verdict", "load"], done.stderr
    assert float(row["load_over_norm"]) == pytest.approx(told["load_N"] / told["grip_strength_norm_N"], rel=1e-3)
    assert float(row["travel_at_load[mm]"]) == pytest.approx(1e3 * told["travel_at_load_m"], rel=1e-3)
    assert json.loads((tmp_path / "out/grasps.json").read_text()) == []


def test_a_verdict_says_what_decides_it():
    figures = {"name": "right.card", "held": True, "word": "held", "told": "held", "complete": True, "margin": 0.1, "slip": 1e-6, "shaken_shift": 1e-3,
               "shift": 1e-3, "turn": 0.01, "contacts": 3, "normal_force": 2.5, "friction_used": 0.5, "force_closure": True, "epsilon": 0.1,
               "wrench_volume": 1e-3, "disagree": False, "lost_time": None, "moved_time": None}
    row = {"scene": "s", "side": "right", "passed": True, "simulated": 1.0, "wall": 1.0, "fault": "", "stature": 1.7, "hand_length": 0.19, "grip_strength": 400.0,
           "figures": figures, "uncertain": False, "half_step": None, "smallest_friction": None, "not_searched": "", "turning": None}

    def verdict(**more):
        text = _grasps.grasps_text([{**row, **more}])
        return text.splitlines()[2].split()[2], text

    assert verdict()[0] == "held" and "note" not in verdict()[1]
    assert verdict(turning="5 % more mass")[0] == "marginal" and "  note: held; 5 % more mass turns it\n" in verdict(turning="5 % more mass")[1]
    assert verdict(turning="")[0] == "held"
    half = {"uncertain": True, "half_step": {**figures, "word": "MOVED", "told": "MOVED"}}
    assert verdict(**half)[0] == "uncertain" and "  note: held; MOVED at half the step: the step decides\n" in verdict(**half)[1]
    assert verdict(fault="right.card: speed")[0] == "diverged"
    moved = {"figures": {**figures, "held": False, "word": "MOVED", "told": "MOVED at 3.500 s", "disagree": True}}
    assert "  note: MOVED at 3.500 s\n  note: not held, though the contacts have force closure\n" in verdict(**moved)[1]


BAD = {
    "nothing": ([], "SCENES: got nothing, need one"),
    "friction": (["grasp_pinch", "--friction", "-3"], "--friction: got -3, need a coefficient of friction, 0 to 10"),
    "a word as friction": (["grasp_pinch", "--friction", "x"], "--friction: got x, need a coefficient"),
    "another side": (["grasp_pinch", "--side", "up"], "--side: got up, need one of right, left, both"),
    "a misspelt option": (["grasp_pinch", "--oot", "x"], "(nearest: --out)"),
    "a scene without grasps": (["two_hands"], "which has no grasps, need scenes with a grasps or climbs block"),
    "a scene twice": (["grasp_pinch", hs.data_path() / "config/grasp_pinch.yaml"], "whose name another has"),
    "frames of no video": (["grasp_pinch", "--fps", "30"], "--fps: got 30, need --video beside it"),
    "a folder of videos": (["grasp_pinch", "--video", "a/b.mp4"], "--video: got a/b.mp4, need a name without a folder, such as grasp.mp4"),
    "a cluster for one run": (["grasp_pinch", "--on", "dask://a:1"], "--on: got dask://a:1, need --uncertain beside it"),
    "a margin of drawn hands": (["grasp_pinch", "--uncertain", "3", "--margin"], "--uncertain: got options of one run of each scene"),
    "bad keys": (["grasp_pinch", "--set", "grasps.0.hold=-1"], "grasps.0.hold: got -1"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_leaves_no_folder(case, tmp_path):
    words, problem = BAD[case]
    done = grasp(*words, "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "") and problem in done.stderr and not (tmp_path / "out").exists(), done.stderr
