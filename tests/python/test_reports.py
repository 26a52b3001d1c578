"""Reports, videos, and the studies of recorded motion."""
import html
import json
import os
import re
import shutil
import subprocess

import numpy as np
import pytest

import handsim as hs

PROGRAM = os.environ.get("HANDSIM_PROGRAM")
needs_reports = pytest.mark.skipif(not hs._core.has_reports, reason="this build has no three.js (libjs-three)")
needs_ffmpeg = pytest.mark.skipif(not shutil.which("ffprobe"), reason="ffmpeg is not installed")
needs_program = pytest.mark.skipif(not PROGRAM, reason="HANDSIM_PROGRAM names no program to compare with")


def data_of(page):
    """What the page shows."""
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S).group(1))


def frames_of(path):
    """Number, width and height of a video's frames, by ffprobe."""
    done = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_entries", "stream=nb_read_frames,width,height",
                           "-of", "json", str(path)], capture_output=True, text=True, check=True)
    stream = json.loads(done.stdout)["streams"][0]
    return int(stream["nb_read_frames"]), stream["width"], stream["height"]


@pytest.fixture(scope="module")
def short():
    return hs.load("two_hands", {"duration": "0.1 s"}, engine="articulated")


# Oracle: the page of the run with files.
@needs_reports
def test_a_run_in_memory_has_the_page_of_the_run_with_files(short, tmp_path):
    memory, files = short.run(frames=0), short.run(tmp_path / "run", frames=0, report=True)
    page = hs.report(tmp_path / "run", out=tmp_path / "again.html")
    ours, theirs = (data_of(text)["runs"][0] for text in (memory.report(), page.read_text()))
    assert ours["poses"] == theirs["poses"] and ours["scene"] == theirs["scene"] and theirs["name"] == str(tmp_path / "run")
    assert data_of(files.report(tmp_path / "copy.html")) == data_of((tmp_path / "copy.html").read_text())
    # A run with report also records energies.
    assert {c["group"] for c in theirs["curves"]} - {c["group"] for c in ours["curves"]} >= {"Energies"}
    both = data_of(hs.report(tmp_path / "run", tmp_path / "run", out=tmp_path / "both.html").read_text())
    assert len(both["runs"]) == 2
    with pytest.raises(hs.Error, match="out: got none, need a folder"):
        short.run(report=True)
    with pytest.raises(hs.Error, match="report: got .*, need the folder of a run or study"):
        hs.report(tmp_path / "none")


# Oracle: what a browser would read from the frame's attribute is the page itself.
@needs_reports
def test_a_result_shows_its_replay_in_a_notebook(short):
    result = short.run(frames=0)
    shown = result._repr_html_()
    assert shown.count("<iframe") == 1 and "joint_gap" in shown
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', shown).group(1))
    assert data_of(page)["runs"][0]["poses"] == data_of(result.report())["runs"][0]["poses"]
    assert "<table>" in hs.Hand(stature=1.7, mass=60)._repr_html_() and "<table>" in short._repr_html_()


# Oracle: the numbers asked for: 0 to 0.1 s at 40 frames a second are 5 frames.
@needs_ffmpeg
@pytest.mark.skipif(not hs.has_pictures, reason="a build without pictures")
def test_videos_have_the_frames_asked_for(short, tmp_path):
    short.video(tmp_path / "scene.mp4", fps=40, size=(160, 120))
    assert frames_of(tmp_path / "scene.mp4") == (5, 160, 120)
    short.run(tmp_path / "run", frames=0, video=tmp_path / "run.gif", fps=40, speed=0.5)
    assert frames_of(tmp_path / "run.gif")[0] == 9
    with pytest.raises(hs.Error, match="--video: got .*x.avi, need a name that ends in .mp4 or .gif"):
        short.video(tmp_path / "x.avi")
    for speed in (2.0**64, 1e5, 0.0):  # the first one never ended
        with pytest.raises(hs.Error, match="--speed: got .*, need one above 0, at most 10000"):
            short.video(tmp_path / "x.mp4", speed=speed)


@needs_ffmpeg
def test_a_video_of_pictures(tmp_path):
    pictures = (np.full((48, 64, 3), 30 * k, np.uint8) for k in range(7))
    hs.save_video(pictures, tmp_path / "v.mp4", 10)
    assert frames_of(tmp_path / "v.mp4") == (7, 64, 48)
    with pytest.raises(hs.Error, match="pictures: got none"):
        hs.save_video([], tmp_path / "none.mp4")
    with pytest.raises(hs.Error, match="50 x 40 pixels, need 64 x 48"):
        hs.save_video([np.zeros((48, 64, 3), np.uint8), np.zeros((40, 50, 3), np.uint8)], tmp_path / "mixed.mp4")
    assert not (tmp_path / "none.mp4").exists() and not (tmp_path / "mixed.mp4").exists()


def command(*words):
    subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True)


def same_tables(a, b, names):
    for name in names:
        assert (a / name).read_bytes() == (b / name).read_bytes(), name


# Oracle: the command line's files, byte by byte.
@needs_program
def test_recorded_motion_is_that_of_the_command_line(tmp_path):
    hs.load("every_pose", {"record.markers": True, "duration": "0.3 s"}, engine="articulated").run(tmp_path / "true", frames=0)
    track = hs.study.track(tmp_path / "true/markers.csv", fit_bones=False, out=tmp_path / "a")
    command("track", tmp_path / "true/markers.csv", "--keep-person", "--out", tmp_path / "b")
    same_tables(tmp_path / "a", tmp_path / "b", ["right.mot", "left.mot", "right_wrist.csv", "frames.csv"])
    assert track.tables["right"].rows == track.tables["frames"].rows > 10
    inverse = hs.study.inverse("every_pose", {"duration": "0.1 s"}, check=False, out=tmp_path / "c")
    command("inverse", hs.data_path() / "config/every_pose.yaml", "--set", "duration=0.1 s", "--no-check", "--out", tmp_path / "d")
    same_tables(tmp_path / "c", tmp_path / "d", ["torques.sto", "summary.csv"])
    assert "time" in inverse.tables["torques"] and inverse.tables["summary"].rows == 40
    hs.study.validate(out=tmp_path / "e")
    subprocess.run([PROGRAM, "validate", "--out", str(tmp_path / "f")], capture_output=True)
    same_tables(tmp_path / "e", tmp_path / "f", ["validate.csv"])


# Oracle: the command's own files; the page has table and commands as they are.
@needs_program
def test_the_page_of_rollouts_has_their_table(tmp_path):
    study = hs.data_path() / "config/rollouts_free_fall.yaml"
    command("rollouts", study, "--count", 4, "--out", tmp_path / "a")
    hs.study.rollouts("rollouts_free_fall", count=4, out=tmp_path / "b")
    same_tables(tmp_path / "a", tmp_path / "b", ["rollouts.csv", "summary.json", "rollouts.h5"])
    commands = json.loads((tmp_path / "a/study.json").read_text())
    assert commands["templates"]["rollouts.csv"].endswith("--rollout {rollout}")
    data = data_of(hs.report(tmp_path / "a").read_text())
    assert data["tables"] == [{"name": "rollouts.csv", "csv": (tmp_path / "a/rollouts.csv").read_text()}]
    assert data["study"] == commands


# Oracle: the engines' and the effects' own commands.
def test_every_study_writes_the_commands_of_its_rows(tmp_path):
    hs.study.effects("two_hands", {"duration": "0.02 s"}, repeats=1, out=tmp_path)
    commands = json.loads((tmp_path / "study.json").read_text())
    assert commands["rows"]["effects.csv"][0].startswith("handsim run ")
    assert data_of(hs.report(tmp_path).read_text())["study"] == commands
