"""``handsim track``: the day at the bench. A run records keypoints, track follows them, inverse computes torques, a run plays the scene."""
import json
import subprocess
import sys

import numpy as np
import pytest

import handsim as hs
from handsim._table_files import read_csv, read_sto


def command(*words):
    return subprocess.run([sys.executable, "-m", "handsim", *map(str, words)], capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def true(tmp_path_factory):
    """A run that was recorded."""
    folder = tmp_path_factory.mktemp("bench") / "true"
    assert command("run", "bench", "--out", folder, "--quiet", "--set", "duration=0.6 s").returncode == 0
    return folder


@pytest.fixture(scope="module")
def tracked(true):
    out = true.parent / "tracked"
    done = command("track", true / "markers.csv", "--out", out, "--truth", true / "trajectory.mot", "--person", "median_woman", "--json")
    assert done.returncode == 0, done.stderr
    return out, json.loads(done.stdout)


# Oracle: the motion that was recorded; the tracked angles lead through inverse dynamics and a run back to it. 0.01 deg: the joints of
# ODE open by 1e-4 mm.
def test_keypoints_lead_to_torques_and_back(tracked, tmp_path):
    folder, summary = tracked
    assert [hand["hand"] for hand in summary["hands"]] == ["right", "left"]
    for hand in summary["hands"]:
        assert hand["tracked"] == 76 and hand["difference_rms_deg"] < 0.01
    torques = command("inverse", folder / "scene.yaml", "--out", tmp_path / "torques", "--json", "--set",
                      "effects=[gravity, joint_stops, passive_tissue, actuation, wrist_motion]")
    assert torques.returncode == 0, torques.stderr
    # OpenSim calls its `_moment` what handsim calls `_active`: no column has the name with another meaning.
    table = (tmp_path / "torques/torques.sto").read_text()
    assert "index_pip.flexion_active" in table and "_moment" not in table
    assert json.loads(torques.stdout)["forward"]["rms_error_deg"] < 0.1
    assert command("run", folder / "scene.yaml", "--out", tmp_path / "again", "--json").returncode == 0


# Oracle: the trajectory of the run, in degrees at the times of the recording; the wrist of bench.yaml is at rest.
def test_the_files_have_the_recorded_motion(true, tracked):
    folder, summary = tracked
    assert json.loads((folder / "summary.json").read_text())["hands"] == summary["hands"]
    known, frames = read_sto(true / "trajectory.mot"), read_csv(folder / "frames.csv")
    for hand in ("right", "left"):
        found, wrist = read_sto(folder / f"{hand}.mot"), read_csv(folder / f"{hand}_wrist.csv")
        assert found.rows == wrist.rows == 76 and list(found)[0] == "time"
        for name in list(found)[1:]:
            values = np.interp(found["time"], known["time"], known[name])
            assert np.abs(values - found[name]).max() < 0.2, name  # between rows of the trajectory angles are no straight lines
        assert set(frames[f"{hand}.status"]) == {"tracked"}
        quaternions = np.column_stack([wrist[f"{hand}.wrist.{part}"] for part in ("qw", "qx", "qy", "qz")])
        assert np.abs(np.linalg.norm(quaternions, axis=1) - 1).max() < 1e-12


def test_python_gives_what_the_command_writes(true, tracked):
    found = hs.study.track(true / "markers.csv", truth=true / "trajectory.mot", person=hs.data_path() / "config/persons/median_woman.yaml")
    table = read_sto(tracked[0] / "right.mot")
    assert all(np.array_equal(found.tables["right"][name], table[name]) for name in table)
    assert "76 frames: 76 tracked" in str(found)


# A shipped person is not to blame for the order of the points.
def test_points_in_another_order_that_make_no_hand_are_a_problem_of_the_recording(true, tmp_path):
    head, *rows = (line.split(",") for line in (true / "markers.csv").read_text().splitlines())
    right = head[1:next(i for i, name in enumerate(head) if name.startswith("left."))]
    names = [name for first in range(len(right) - 3, -1, -3) for name in right[first:first + 3]]
    recording = tmp_path / "reversed.csv"
    recording.write_text("\n".join(",".join(row) for row in [[head[0], *names], *(row[:1 + len(right)] for row in rows)]) + "\n")
    done = command("track", recording, "--out", tmp_path / "out")
    assert done.returncode == 2 and f"\n{recording}: got points in another order than its names say: bones are " in "\n" + done.stderr, done.stderr  # after its progress
    assert "median_man" not in done.stderr and not (tmp_path / "out").exists()


def test_a_recording_without_a_tracked_frame_is_a_failure(tmp_path):
    head = ["time[s]", *(f"right.{name}.{axis}[m]" for name in ("wrist", "index_mcp", "little_mcp") for axis in "xyz")]
    rows = [f"{k},0,0,0,-0.03,0.09,0,0.03,0.08,0" for k in range(5)]
    (tmp_path / "palm.csv").write_text("\n".join([",".join(head), *rows]) + "\n")
    refused = command("track", tmp_path / "palm.csv", "--out", tmp_path / "out")
    assert refused.returncode == 2 and "fewer than three frames that show a hand" in refused.stderr, refused.stderr
    done = command("track", tmp_path / "palm.csv", "--out", tmp_path / "out", "--keep-person")
    assert done.returncode == 1 and "no frame of any hand is tracked" in done.stderr, done.stderr
    assert (tmp_path / "out/frames.csv").is_file() and not (tmp_path / "out/scene.yaml").exists()


@pytest.mark.parametrize("content, said", [
    ("time[s],right.wrist.x[m],right.wrist.y[m],right.wrist.z[m]\n0,,,\n", "no frame in which a point of a hand was seen"),
    ("time[s],wrist.x[m],wrist.y[m],wrist.z[m]\n0,1,2,3\n", "no point of a hand, but wrist"),
    (None, "no such file")])
def test_bad_recordings_are_refused(tmp_path, content, said):
    if content is not None:
        (tmp_path / "a.csv").write_text(content)
    done = command("track", tmp_path / "a.csv", "--out", tmp_path / "out")
    assert done.returncode == 2 and said in done.stderr, done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words, said", [
    (["--noise", "2 ms"], 'need a length such as "2 mm"'), (["--seed", "-1"], "need a whole number"), (["--up", "x"], "--up: got 'x', need y or z"),
    (["--names", "labels.yaml"], "need a recording in C3D with it"), (["--handedness", "both"], "need left or right"), (["--points", "openx"], "nearest: openxr"),
    (["--points", "mano", "--markers", "set.yaml"], "got markers beside it"),
    (["--person", "median_womn"], "nearest: median_woman"), (["--nonsense"], "an unknown option")])
def test_bad_options_are_refused(true, tmp_path, words, said):
    done = command("track", true / "markers.csv", "--out", tmp_path / "out", *words)
    assert done.returncode == 2 and said in done.stderr, done.stderr


def test_every_kind_of_recording_is_named(tmp_path):
    (tmp_path / "a.txt").write_text("1")
    assert "need a recording: .csv, .json, .trc or .c3d" in command("track", tmp_path / "a.txt", "--out", tmp_path / "out").stderr


# Oracle: people's thenar muscles go with the thumb, which lies beside the palm here (10 deg of flexion, -25 of abduction). The run has the hand whose pad is
# a part of the palm, whose own depth of the thumb in it is what `--model anatomical` finds.
def test_a_thumb_beside_the_palm_lies_on_a_pad_that_goes_with_it(tmp_path):
    pose = {"thumb_cmc": ["10 deg", "-25 deg"], "thumb_mcp": ["10 deg"], "index_mcp": ["20 deg", 0], "index_pip": ["30 deg"]}
    (tmp_path / "pose.yaml").write_text(json.dumps({
        "hands": [{"model": "anatomical", "person": "median_man", "side": "right", "wrist": {"mount": "fixed"}, "pose": pose}],
        "effects": ["gravity"], "gravity": [0, 0, 0], "duration": 0.2, "record": {"every": "10 ms", "markers": True}}))
    assert command("run", tmp_path / "pose.yaml", "--out", tmp_path / "true", "--quiet").returncode == 0
    depths = {}
    for name, options in (("default", ()), ("anatomical", ("--model", "anatomical"))):
        done = command("track", tmp_path / "true/markers.csv", "--out", tmp_path / name, "--keep-person", "--person", "median_man", "--json", *options)
        assert done.returncode == 0, done.stderr
        hand, = json.loads(done.stdout)["hands"]
        depths[name] = max((pair["deepest_mm"] for pair in hand["overlaps"]["pairs"] if "thumb" in pair["where"]), default=0)
    assert depths["anatomical"] > 8 and depths["default"] < depths["anatomical"] / 2, depths
