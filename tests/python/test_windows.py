"""Long recordings, which are read a window of frames after the other (docs/forces.md)."""
import json

import numpy as np
import pytest

import handsim as hs
from handsim import _windows

pytest.importorskip("scipy", reason="SciPy is not installed")
COUNT, FEW = 900, 250
"""Frames of the recording, and of a window."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A folder with a tripod grip that is repeated forwards and backwards, and with one in which for some time nothing is seen."""
    import recorded_cases

    folder = tmp_path_factory.mktemp("windows")
    recorded = recorded_cases.simulate("tripod", "median_man", 1.5, recorded_cases.CASES["tripod"])
    head, *lines = recorded_cases.write_recording(recorded, folder, 5).read_text().splitlines()
    order = [*range(len(lines)), *range(len(lines) - 2, 0, -1)]
    rows = [lines[order[i % len(order)]].partition(",")[2] for i in range(COUNT)]
    hidden = [rows[i] if not 380 <= i < 745 else "," * rows[i].count(",") for i in range(COUNT)]
    for name, each in (("recording.csv", rows), ("hidden.csv", hidden)):
        (folder / name).write_text("\n".join([head, *(f"{i / 60:.9g},{row}" for i, row in enumerate(each))]) + "\n")
    return folder


@pytest.fixture
def short(monkeypatch):
    """Windows are short."""
    for name, value in (("LONGEST", FEW), ("WINDOW", FEW), ("OVERLAP", 60), ("STRETCH", 30)):
        monkeypatch.setattr(_windows, name, value)


@pytest.fixture(scope="module")
def found(recording):
    """Of the first one, read whole and in windows."""
    words = {"object": f"thing={recording / 'thing.yaml'}", "support": "post", "muscles": True, "uncertain": 2}
    out = {"whole": hs.study.track(recording / "recording.csv", out=recording / "whole", **words)}
    with pytest.MonkeyPatch.context() as patch:
        short.__wrapped__(patch)
        out["windows"] = hs.study.track(recording / "recording.csv", out=recording / "windows", **words)
        with pytest.raises(hs.Error, match="--replay: got a recording of 900 frames"):
            hs.study.track(recording / "recording.csv", out=recording / "refused", replay=True, **words)
    return recording, out


# Oracle: the same recording, read whole. Noise is found in each window anew, so that a place may begin to touch a frame earlier or later: normal forces differ
# by less than 2 % of their peak in the root of mean squares. What the object needs differs by less than 1 % of its weight in every frame, at the seams of windows, too.
def test_windows_give_what_the_whole_gives(found):
    _, of = found
    whole, parts = (of[name].tables["contact_forces"] for name in ("whole", "windows"))
    assert list(whole) == list(parts) and np.array_equal(whole["time"], parts["time"]) and len(parts["time"]) == COUNT
    assert np.mean(np.array(whole["state"]) == np.array(parts["state"])) > 0.99
    peak, weight = np.nanmax(whole["right.thumb.normal"]), 9.81 * of["whole"].summaries["forces"]["mass_kg"]
    assert peak > 1
    for column in ("right.thumb.normal", "right.index.normal", "right.middle.normal"):
        assert np.sqrt(np.mean(np.nan_to_num(whole[column] - parts[column])**2)) < 0.02 * peak
    for axis in "xyz":
        assert np.abs(whole[f"wrench.force.{axis}"] - parts[f"wrench.force.{axis}"]).max() < 0.01 * weight


# Every table has a row for each frame, or for each in which there is a hand, and heads that say so.
def test_tables_are_whole(found):
    folder, _ = found
    names = sorted(str(path.relative_to(folder / "whole")) for path in (folder / "whole").rglob("*") if path.is_file())
    assert names == sorted(str(path.relative_to(folder / "windows")) for path in (folder / "windows").rglob("*") if path.is_file())
    for name in names:
        if name.endswith((".csv", ".mot", ".sto")):
            whole, parts = ((folder / kind / name).read_text().splitlines() for kind in ("whole", "windows"))
            body = [next((i for i, line in enumerate(lines) if line == "endheader"), -1) + 1 for lines in (whole, parts)]
            assert whole[:body[0] + 1] == parts[:body[1] + 1] and abs(len(whole) - len(parts)) <= (0 if name != "forces/loads.csv" else 4), name
            separator = "," if name.endswith(".csv") else "\t"
            assert [line.split(separator)[0] for line in whole] == [line.split(separator)[0] for line in parts] or name == "forces/loads.csv", name


def test_figures_are_those_of_the_whole(found):
    folder, _ = found
    whole, parts = (json.loads((folder / kind / "forces/forces.json").read_text()) for kind in ("whole", "windows"))
    for key in ("frames", "unseen", "apart"):
        assert whole[key] == pytest.approx(parts[key], abs=3), key
    for key in ("support_height_m", "object_noise_mm", "place_noise_mm", "effort", "heaviest_kg"):
        assert whole[key] == pytest.approx(parts[key], rel=0.05), key
    assert whole["fingers"].keys() == parts["fingers"].keys()
    for finger, figures in whole["fingers"].items():
        assert figures == pytest.approx(parts["fingers"][finger], rel=0.05)
    whole, parts = (json.loads((folder / kind / "summary.json").read_text()) for kind in ("whole", "windows"))
    assert [parts["hands"][0][key] for key in ("tracked", "missing")] == [whole["hands"][0][key] for key in ("tracked", "missing")]
    assert parts["hands"][0]["noise_mm"] == pytest.approx(whole["hands"][0]["noise_mm"], rel=0.02) and "4 windows" in parts["warnings"][0]
    assert hs.load(folder / "windows/scene.yaml").duration == hs.load(folder / "whole/scene.yaml").duration


# The page of a long recording draws some of its frames, evenly, and says so.
def test_the_page_is_thinned(found):
    for kind in ("whole", "windows"):
        text = (found[0] / kind / "forces/forces.html").read_text()
        data = json.loads(text.partition("const data = ")[2].partition(";\nconst ")[0].replace("<\\/", "</"))
        assert "one of 3 is drawn" in text and data["times"] == pytest.approx(np.arange(0, COUNT, 3) / 60, abs=1e-4)
        assert len(data["bones"]) == len(data["arrows"]) == len(data["normal"]) == 300


# In a window, with the frames beside it, nothing is seen: it has rows that say so, and the others are as they are.
def test_a_window_in_which_nothing_is_seen(recording, short):
    assert _windows.windows(COUNT)[2] == (450, 675, 390, 735)
    of = hs.study.track(recording / "hidden.csv", out=recording / "hidden", object=f"thing={recording / 'thing.yaml'}", support="post")
    forces, summary = of.tables["contact_forces"], json.loads((recording / "hidden/summary.json").read_text())
    seen = np.array([not 380 <= i < 745 for i in range(COUNT)])
    assert forces["time"] == pytest.approx(np.arange(COUNT) / 60, abs=1e-7) and np.array_equal(np.array(forces["state"]) == "unseen", ~seen)
    assert of.summaries["forces"]["unseen"] == 365 and summary["hands"][0]["missing"] == 365 and summary["hands"][0]["tracked"] == COUNT - 365
    assert np.nanmax(forces["right.thumb.normal"][:380]) > 1 < np.nanmax(forces["right.thumb.normal"][745:])
    statuses = [line.split(",")[1] for line in (recording / "hidden/frames.csv").read_text().splitlines()[1:]]
    assert statuses == ["tracked" if each else "missing" for each in seen]


# What is wrong is said of the recording, with its line, and not of the part that was read: the first and the last one here are in the sample, too.
@pytest.mark.parametrize("row", [0, 333, 700, 712])
def test_a_wrong_row_is_named_by_its_line(recording, short, monkeypatch, row):
    monkeypatch.setattr(_windows, "STRETCH", 10)
    assert any(first <= row < last for first, last in _windows.stretches(COUNT)) == (row in (0, 712))
    lines = (recording / "recording.csv").read_text().splitlines()
    lines[1 + row] = lines[1 + row].partition(",")[0] + ",one" + "," * (lines[0].count(",") - 1)
    path = recording / "wrong.csv"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(hs.Error) as told:
        hs.study.track(path, out=recording / "wrong")
    assert str(told.value).startswith(f"{path}:{row + 2}:") and told.value.problems[0].file == str(path) and told.value.problems[0].line == row + 2
