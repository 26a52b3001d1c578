"""Conventions of trackers, and what `track` makes of captured sequences."""
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import handsim as hs

ROOT = Path(__file__).parents[2]
SHIPPED = {"mano": 21, "mediapipe": 21, "openxr": 26, "leap": 27, "aria": 21}


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_convention_is_read(name):
    assert (ROOT / "handmodels/points" / f"{name}.yaml").read_text().count("- {name:") == SHIPPED[name]
    done = subprocess.run([sys.executable, "-m", "handsim", "check", str(ROOT / "handmodels/points" / f"{name}.yaml")], capture_output=True, text=True)
    assert done.returncode == 0 and "a marker set, good" in done.stdout, done.stdout + done.stderr


# Oracle: the number of points that the convention has, which is not the recording's.
@pytest.mark.parametrize("name", SHIPPED)
def test_the_command_finds_a_shipped_convention_by_its_name(name, tmp_path):
    (tmp_path / "a.json").write_text('{"rate": 30, "frames": [{"hands": [{"side": "right", "points": [%s]}]}]}' % ",".join(["[0,0,1]"] * 5))
    done = subprocess.run([sys.executable, "-m", "handsim", "track", str(tmp_path / "a.json"), "--points", name, "--out", str(tmp_path / "out")],
                          capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2 and f"5 points, need {SHIPPED[name]} points" in done.stderr, done.stderr


def test_a_recording_with_another_number_of_points_names_the_option(tmp_path):
    (tmp_path / "a.json").write_text('{"rate": 30, "frames": [{"hands": [{"side": "right", "points": [%s]}]}]}' % ",".join(["[0,0,1]"] * 26))
    with pytest.raises(hs.Error, match="26 points, need 21 points, .*--points"):
        hs.study.track(tmp_path / "a.json")
    with pytest.raises(hs.Error, match="nearest: openxr"):
        hs.study.track(tmp_path / "a.json", points="openx")


def test_a_convention_replaces_no_file_of_the_user(tmp_path):
    scene, recording = tmp_path / "scene.yaml", tmp_path / "a.json"
    scene.write_text("title: mine\n")
    recording.write_text('{"rate": 30, "frames": []}')
    for out in (scene, recording):
        before = out.read_bytes()
        done = subprocess.run([sys.executable, "-m", "handsim", "track", "--convention-from", str(recording), "--out", str(out)], capture_output=True, text=True)
        assert done.returncode == 2 and str(out) in done.stderr and "Traceback" not in done.stderr, done.stderr
        assert out.read_bytes() == before


@pytest.mark.skipif("HANDSIM_RECORDINGS" not in os.environ, reason="HANDSIM_RECORDINGS names no folder of captured sequences")
@pytest.mark.parametrize("name", ["s5_box_grab_01", "s6_phone_grab_01"])
def test_captured_hands_of_people_who_are_not_in_the_convention_are_people(name, tmp_path):
    """Oracle: the survey, and rigid bones of one person. Goals of hand size and RMS distance."""
    spec = importlib.util.spec_from_file_location("captured", ROOT / "tests/study/track/captured.py")
    captured = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(captured)
    file = tmp_path / "keypoints.json"
    file.write_text(json.dumps(captured.recording(Path(os.environ["HANDSIM_RECORDINGS"]) / f"{name}.npz")))
    study = hs.study.track(file, points="mano")
    person = study.summary["person"]
    for dimension in ("length", "breadth"):
        assert 2 < captured.percentile(dimension, person[f"hand_{dimension}_mm"]) < 98
    rms = np.concatenate([np.asarray(study.tables["frames"][f"{side}.rms"])[np.asarray(study.tables["frames"][f"{side}.status"]) == "tracked"].astype(float)
                          for side in ("right", "left")])
    assert np.sqrt(np.mean(rms**2)) < 4
