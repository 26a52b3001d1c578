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
from handsim import _guess
from handsim._conventions import POINT
from handsim._live import measured
from handsim._live.measured import Layout
from handsim._live.streams import KEYPOINTS
from handsim._live.tracker import HandFilter

ROOT = Path(__file__).parents[2]
SHIPPED = {"mano": 21, "mano_joints": 21, "mediapipe": 21, "openxr": 26, "webxr": 25, "leap": 27, "aria": 21}


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
    (tmp_path / "a.json").write_text('{"rate": 30, "frames": [{"hands": [{"side": "right", "points": [%s]}]}]}' % ",".join(["[0,0,1]"] * 23))
    with pytest.raises(hs.Error, match="23 points, need 21 points, .*--points"):
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


@pytest.mark.parametrize("words, said", [(["--out", "x.yaml"], "RECORDING: got nothing, need one"), (["a.json"], "--out: got nothing, need one"),
                                         (["a.json", "--out", "x.yaml", "--points", "openx"], "nearest: openxr"), (["--up", "y"], "--up: got an unknown option")])
def test_a_convention_from_wrong_words_is_refused(words, said):
    done = subprocess.run([sys.executable, "-m", "handsim", "track", "--convention-from", *words], capture_output=True, text=True)
    assert done.returncode == 2 and said in done.stderr, done.stderr


def test_conventions_of_one_place_and_two_orders_agree():
    def rows(name):
        return [line for line in (ROOT / "handmodels/points" / f"{name}.yaml").read_text().splitlines() if line.startswith("  - {name:")]

    assert sorted(rows("mano_joints")) == sorted(rows("mano")) and rows("mano_joints") != rows("mano")
    assert rows("webxr") == rows("openxr")[1:]


@pytest.fixture(scope="module")
def keypoints():
    """Of a hand that bends, by name: 30 frames of shape (3,) [m]."""
    filter_ = HandFilter(hs.load("grasp_power_can"), 0)
    low, high = filter_._low, filter_._high
    every = np.array([filter_.points(np.concatenate(([0.05 * t, 0.1, 0.9, 1, 0, 0, 0], np.clip(0.2 + 0.6 * t, low, high)))) for t in np.arange(30) / 30])
    return dict(zip(KEYPOINTS, every.transpose(1, 0, 2)))


def of_convention(keypoints, name):
    """The same hand as a tracker gives it, by its points' names in their order."""
    def place(point, joint):
        if joint:
            return keypoints[joint]
        finger = point.partition("_")[0]
        return (keypoints["wrist"] + keypoints.get(f"{finger}_mcp", keypoints["middle_mcp"])) / 2

    return {point: place(point, joint) for point, joint in _guess.points_of(ROOT / "handmodels/points" / f"{name}.yaml").items()}


def write_json(path, points, listed=True, **head):
    count = len(next(iter(points.values())))
    frames = [{"hands": [{"side": "right", "points": [p[k].tolist() for p in points.values()] if listed else {n: p[k].tolist() for n, p in points.items()}}]}
              for k in range(count)]
    path.write_text(json.dumps({"rate": 30, **head, "frames": frames}))
    return path


def taken(path):
    return _guess.guess(_guess.sample(path))


# Oracle: the convention in whose order the points were written.
@pytest.mark.parametrize("name, by", [("openxr", "number of its points, 26"), ("webxr", "number of its points, 25"), ("leap", "number of its points, 27"),
                                      ("mano_joints", "order of its points"), ("aria", "order of its points")])
def test_points_without_names_tell_their_tracker_by_number_and_order(keypoints, tmp_path, name, by):
    found = taken(write_json(tmp_path / "a.json", of_convention(keypoints, name)))
    assert found.name == name and by in found.by
    # Numbers of columns are a list, too, in any unit; one point in ten was not seen.
    points = of_convention(keypoints, name)
    rng = np.random.default_rng(1)
    rows = ["time[s]," + ",".join(f"left.{i}.{axis}[mm]" for i in range(len(points)) for axis in "xyz")]
    for k in range(30):
        rows.append(f"{k / 30}," + ",".join("," * 2 if rng.random() < 0.1 and k > 9 else ",".join(f"{1e3 * x}" for x in p[k]) for p in points.values()))
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    assert taken(tmp_path / "a.csv").name == name


# Oracle: the names that these programs give to their points.
@pytest.mark.parametrize("style, name", [
    (lambda name: name.upper().replace("_", "_FINGER_", 1 if name[0] in "imr" else 0).replace("LITTLE", "PINKY"), "mediapipe"),
    (lambda name: f"XR_HAND_JOINT_{name.upper()}_EXT", "openxr"), (lambda name: name, "leap"), (lambda name: name, "aria"), (lambda name: name, "openxr"),
    (lambda name: name.replace("_", "-finger-phalanx-") if name.endswith(("proximal", "intermediate")) else name, "webxr")])
def test_names_tell_their_tracker(keypoints, tmp_path, style, name):
    points = {style(each): place for each, place in of_convention(keypoints, name).items()}
    found = taken(write_json(tmp_path / "a.json", points, listed=False))
    assert found.name == name and "names" in found.by, found
    rows = ["time[s]," + ",".join(f"right.{each}.{axis}[m]" for each in points for axis in "xyz"), "0," + ",".join(f"{x}" for p in points.values() for x in p[0])]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    assert taken(tmp_path / "a.csv").name == name


def test_what_is_taken_is_said_and_used(keypoints, tmp_path):
    file = write_json(tmp_path / "a.json", of_convention(keypoints, "openxr"))
    by_guess, by_option = hs.study.track(file), hs.study.track(file, points="openxr")
    assert by_guess.summary["convention"] == {"name": "openxr", "by": "the number of its points, 26"}
    assert by_option.summary["convention"] == {"name": "openxr", "by": "--points"}
    assert by_guess.text.startswith("points: as openxr has them, by the number of its points, 26")
    assert all(np.array_equal(by_guess.tables["right"][column], by_option.tables["right"][column]) for column in by_option.tables["right"])
    said = taken(write_json(tmp_path / "b.json", of_convention(keypoints, "mediapipe"), tracker="MediaPipe 0.10"))
    assert said == ("mediapipe", '"tracker": "MediaPipe 0.10"')
    assert taken(write_json(tmp_path / "c.json", of_convention(keypoints, "mano_joints"), convention="MANO")).name == "mano_joints"


def test_what_the_file_does_not_tell_is_said(keypoints, tmp_path):
    file = write_json(tmp_path / "a.json", keypoints)
    study = hs.study.track(file)
    assert "name" not in study.summary["convention"] and "21 points as mano and mediapipe have them: taken as joint centres" in study.text
    # Points of one place tell nothing about their order.
    for k in keypoints:
        keypoints = {**keypoints, k: np.zeros((30, 3))}
    assert "aria and mano and mano_joints and mediapipe" in taken(write_json(tmp_path / "b.json", keypoints)).by


# Oracle: the order in which the points were written; a shipped person is not to blame for it.
def test_points_in_another_order_than_said_are_told_as_such(keypoints, tmp_path):
    file = write_json(tmp_path / "a.json", of_convention(keypoints, "mano_joints"))
    with pytest.raises(hs.Error, match=r"a.json: got points in another order than that of mediapipe: bones are \d+ mm off those of a hand, and 0 mm in the order of "
                                       "mano_joints, need --points mano_joints"):
        hs.study.track(file, points="mediapipe")
    with pytest.raises(hs.Error, match="another order than that of mano_joints.*need --points mano or mediapipe"):
        hs.study.track(write_json(tmp_path / "b.json", keypoints), points="mano_joints")
    wrong = dict(zip(keypoints, of_convention(keypoints, "mano_joints").values()))
    with pytest.raises(hs.Error, match="another order than its names say.*in the order of mano_joints, need names for the points in that order"):
        hs.study.track(write_json(tmp_path / "c.json", wrong, listed=False))
    # With noise of 5 mm the order is still told, and the right one is not refused.
    rng = np.random.default_rng(1)
    noisy = {name: place + rng.normal(0, 0.005, place.shape) for name, place in of_convention(keypoints, "mano_joints").items()}
    with pytest.raises(hs.Error, match="mano_joints"):
        hs.study.track(write_json(tmp_path / "d.json", noisy), points="mediapipe")
    assert hs.study.track(tmp_path / "d.json", points="mano_joints").summary["hands"][0]["tracked"] > 0


def test_doubtful_points_are_left_out_and_told(keypoints, tmp_path):
    frames = [{"hands": [{"side": "right", "confidence": 0.2 if k == 7 else 0.9, "points": {name: {**dict(zip("xyz", place[k].tolist())),
              **({"confidence": 0.3} if name == "index_tip" and k < 5 else {})} for name, place in keypoints.items()}}]} for k in range(30)]
    for k in range(5):
        frames[k]["hands"][0]["points"]["index_tip"]["x"] += 0.02
    (tmp_path / "a.json").write_text(json.dumps({"rate": 30, "frames": frames}))
    study = hs.study.track(tmp_path / "a.json")
    assert any("26 of 630 points have a confidence below 0.5: they count as not seen" in each for each in study.summary["warnings"])
    assert study.tables["frames"]["right.status"][7] == "missing"
    assert np.isnan(study.tables["frames"]["right.index_tip"][:5]).all() and np.nanmax(study.tables["frames"]["right.rms"]) < 0.5  # [mm]


UNLISTED = """title: of a laboratory
recording: {up: z, unit: mm, unseen: "null"}
points:
  - {name: back, segment: palm, at: [0, 0, 0.5], spread: [0.1, 0.1, 0.5]}
"""
"""What somebody knows of a tracker that no file is of: names, segments, and roughly where."""


def unlisted(person, seconds=3.0):
    """Points of a tracker of its own kind: on the back of the wrist, distal of the knuckles, at a quarter of the middle segments and at the nails.
    :returns: points by name, shape (frames, 3), and true angles by axis
    """
    filter_ = HandFilter(hs.load("grasp_power_can", {"hands.0.person": person}), 0)
    rng, times = np.random.default_rng(len(person)), np.arange(int(30 * seconds)) / 30
    middle, reach = (filter_._low + filter_._high) / 2, 0.35 * (filter_._high - filter_._low)
    speeds, begins = rng.uniform(2, 5, len(middle)), rng.uniform(0, 6, len(middle))
    angles = np.array([middle + reach * np.sin(speeds * t + begins) for t in times])
    places = np.array([filter_.points(np.concatenate(([0.05 * t, 0.1, 0.9, 1, 0, 0, 0], each))) for t, each in zip(times, angles)])
    of = dict(zip(KEYPOINTS, places.transpose(1, 0, 2)))
    across = np.cross(of["index_mcp"] - of["wrist"], of["little_mcp"] - of["wrist"])
    out = {"back": of["wrist"] - 0.018 * across / np.linalg.norm(across, axis=1, keepdims=True)}
    for finger in ("index", "middle", "ring", "little"):
        mcp, pip, dip, tip = (of[f"{finger}_{joint}"] for joint in ("mcp", "pip", "dip", "tip"))
        out.update({f"{finger}_a": of["wrist"] + 1.12 * (mcp - of["wrist"]), f"{finger}_b": pip + 0.25 * (dip - pip), f"{finger}_c": dip + 0.9 * (tip - dip)})
    out.update(thumb_a=of["thumb_mcp"], thumb_b=of["thumb_ip"], thumb_c=of["thumb_ip"] + 0.9 * (of["thumb_tip"] - of["thumb_ip"]))
    return out, dict(zip(filter_.axes, angles.T))


# Oracle: the angles of the hands of which the points were made. A person who is not among those of the convention; 3 deg is the goal for known hands.
def test_a_convention_is_fitted_to_a_tracker_that_is_not_listed(tmp_path):
    start = tmp_path / "start.yaml"
    segments = {"a": ("palm", "[{}, 0.45, 0]", "[0.1, 0.15, 0.4]"), "b": ("{}_middle", "[0, 0.1, 0]", "[0.4, 0.4, 0.4]"), "c": ("{}_distal", "[0, 1, 0]", "[0.4, 0.2, 0.4]")}
    lines = [UNLISTED]
    for finger, x in (("index", -0.25), ("middle", 0), ("ring", 0.2), ("little", 0.4)):
        lines += [f"  - {{name: {finger}_{part}, segment: {segment.format(finger)}, at: {at.format(x)}, spread: {spread}}}\n"
                  for part, (segment, at, spread) in segments.items()]
    lines += [f"  - {{name: thumb_{part}, segment: {segment}, at: [0, {y}, 0], spread: [0.4, 0.2, 0.4]}}\n"
              for part, segment, y in (("a", "thumb_proximal", 0), ("b", "thumb_distal", 0), ("c", "thumb_distal", 1))]
    start.write_text("".join(lines))
    files = []
    for person in ("median_man", "median_woman", "large_man", "small_woman", "large_woman"):
        points, truth = unlisted(person)
        files.append(write_json(tmp_path / f"{person}.json", {name: 1e3 * place for name, place in points.items()}))
    fitted = tmp_path / "fitted.yaml"
    done = subprocess.run([sys.executable, "-m", "handsim", "track", "--convention-from", *map(str, files[:-1]), "--points", str(start), "--out", str(fitted)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = hs.study.track(files[-1], points=fitted)
    assert found.summary["hands"][0]["tracked"] == 90
    errors = [np.radians(found.tables["right"][axis]) - angles for axis, angles in truth.items() if axis in found.tables["right"]]
    assert len(errors) > 15 and np.degrees(np.sqrt(np.mean(np.square(errors)))) < 3
    # Where the points were put on the segments; those who are taken for the survey's mean are not it, and their bones not the model's.
    places = {row[2]: [float(x) for x in row[4].split(",")] for row in map(POINT.fullmatch, fitted.read_text().splitlines()) if row}
    for finger in ("index", "middle", "ring", "little"):
        assert places[f"{finger}_b"][1] == pytest.approx(0.25, abs=0.1) and places[f"{finger}_c"][1] == pytest.approx(0.9, abs=0.1), places
    assert places["back"][2] == pytest.approx(0.6, abs=0.15)


# Oracle: `track` of the same frames. What `live` has measured of a hand is what `track` measures, and both say the same of it.
@pytest.mark.parametrize("convention", [None, "mano"])
def test_live_measures_and_says_what_track_does(keypoints, tmp_path, convention):
    rng = np.random.default_rng(3)
    points = {name: place + rng.normal(0, 1e-3, place.shape) + (np.array([0, 0, 0.02]) if name == "wrist" else 0) for name, place in keypoints.items()}
    layout = Layout.of(ROOT / f"handmodels/points/{convention}.yaml" if convention else None, "")
    scene = hs.load("grasp_power_can", {"hands.0.person": "median_man"})
    live = measured.find(scene, 0, layout, [k / 30 for k in range(30)], np.array(list(points.values())).transpose(1, 0, 2))
    study = hs.study.track(write_json(tmp_path / "a.json", points, listed=convention is not None), points=convention)
    person = study.summary["person"]
    for key in ("hand_length_mm", "hand_breadth_mm"):
        assert live.state[key] == pytest.approx(person[key], abs=0.06)
    assert live.state["noise_mm"] == pytest.approx(study.summary["hands"][0]["noise_mm"], abs=0.006)
    said = [[each.partition(": ")[2] for each in warnings] for warnings in (live.warnings, study.summary["warnings"])]
    # The wrist point that is off is said where no convention has it.
    assert said[0] == said[1] and bool(said[0]) == (convention is None)


def captured_script():
    spec = importlib.util.spec_from_file_location("captured", ROOT / "tests/study/track/captured.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


@pytest.mark.skipif("HANDSIM_RECORDINGS" not in os.environ, reason="HANDSIM_RECORDINGS names no folder of captured sequences")
@pytest.mark.parametrize("name", ["s5_box_grab_01", "s6_phone_grab_01"])
def test_captured_hands_of_people_who_are_not_in_the_convention_are_people(name, tmp_path):
    """Oracle: the survey, and rigid bones of one person. Goals of hand size and RMS distance."""
    captured = captured_script()
    file = tmp_path / "keypoints.json"
    file.write_text(json.dumps(captured.recording(Path(os.environ["HANDSIM_RECORDINGS"]) / f"{name}.npz")))
    study = hs.study.track(file, points="mano")
    person = study.summary["person"]
    for dimension in ("length", "breadth"):
        assert 2 < captured.percentile(dimension, person[f"hand_{dimension}_mm"]) < 98
    rms = np.concatenate([np.asarray(study.tables["frames"][f"{side}.rms"])[np.asarray(study.tables["frames"][f"{side}.status"]) == "tracked"].astype(float)
                          for side in ("right", "left")])
    assert np.sqrt(np.mean(rms**2)) < 4


# Oracle: one person has hands of one length, within 1.5 % of the mean of all sequences.
@pytest.mark.skipif("HANDSIM_RECORDINGS" not in os.environ, reason="HANDSIM_RECORDINGS names no folder of captured sequences")
@pytest.mark.parametrize("person", ["s2", "s5"])
def test_captured_hands_of_one_person_have_one_length(person, tmp_path):
    captured = captured_script()
    lengths = []
    for source in sorted(Path(os.environ["HANDSIM_RECORDINGS"]).glob(f"{person}_*.npz")):
        (tmp_path / "a.json").write_text(json.dumps(captured.recording(source)))
        lengths.append(hs.study.track(tmp_path / "a.json", points="mano").summary["person"]["hand_length_mm"])
    assert len(lengths) == 5 and np.abs(np.array(lengths) / np.mean(lengths) - 1).max() < 0.015


@pytest.mark.skipif("HANDSIM_RECORDINGS" not in os.environ, reason="HANDSIM_RECORDINGS names no folder of captured sequences")
def test_captured_hands_in_their_own_order_are_known_by_it(tmp_path):
    """Oracle: the order that the sequences' description has, MANO's own."""
    for file in sorted(Path(os.environ["HANDSIM_RECORDINGS"]).glob("*.npz")):
        points = np.load(file)["right"].astype(float)[::10]
        found = taken(write_json(tmp_path / "a.json", {str(i): points[:, i] for i in range(21)}))
        assert found.name == "mano_joints" and "order of its points" in found.by, (file.name, found)
