"""The page of a run, read back. Oracles: the tables of the run, and the scene's own model."""
import re
import shutil
import subprocess
import sys
from base64 import b64decode

import numpy as np
import pytest

import handsim as hs
from handsim import _run_page
from handsim._table_files import read_csv, read_sto
from test_reports import PROGRAM, data_of, needs_program

pytestmark = pytest.mark.skipif(not hs._core.has_reports, reason="this build has no three.js (libjs-three)")


def floats(text):
    return np.frombuffer(b64decode(text), dtype="<f4")


def page_of(*folders):
    return data_of(_run_page.run_page(folders))["runs"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "run"
    hs.load("two_hands", {"duration": "0.3 s"}).run(out, frames=0)
    return out


def test_the_page_has_the_poses_of_the_trajectory(folder):
    poses = page_of(folder)[0]["poses"]
    table, scene = read_csv(folder / "trajectory.csv"), hs.load(folder / "resolved.yaml")
    values = floats(poses["values"]).reshape(len(floats(poses["times"])), len(poses["moving"]), 7)
    assert poses["recorded"] == table.rows and len(poses["moving"]) == 2 * 15
    for i, body in enumerate(poses["moving"]):
        for k, axis in enumerate("xyz"):
            column = next(table[name] for name in table if name.startswith(f"{scene.bodies[body]}.{axis}"))
            assert values[0, i, k] == np.float32(column[0]) and values[-1, i, k] == np.float32(column[-1])


def test_the_page_has_every_shape_of_the_scene_and_the_command_that_repeats_it(folder):
    run = page_of(folder)[0]
    # Nails and stumps of wrists are marks beside the model's shapes.
    shapes = [each["name"] for each in run["scene"]["shapes"] if not each.get("mark")]
    assert shapes == [each.name for each in hs.load(folder / "resolved.yaml")._model.shapes]
    assert len(run["scene"]["tips"]) == 10 and {each["part"] for each in run["scene"]["tips"]} == {"thumb", "index", "middle", "ring", "little"}
    assert f"--expect-hash {run['summary']['state_hash']}" in run["command"] and "duration" in run["resolved"]


def test_the_page_of_two_runs_has_both_and_one_skin(folder):
    first, second = page_of(folder, folder)
    assert first["scene"]["skins"] and "skins" not in second["scene"] and first["poses"] == second["poses"]


def test_tables_of_another_scene_are_refused(folder, tmp_path):
    for name in ("resolved.yaml", "summary.json"):
        shutil.copy(folder / name, tmp_path)
    with pytest.raises(hs.Error, match="without trajectory.csv"):
        page_of(tmp_path)
    (tmp_path / "trajectory.csv").write_text("time[s],a\n0,1\n")
    with pytest.raises(hs.Error, match="columns of another scene"):
        page_of(tmp_path)


# Oracle: muscles.sto, and the anatomy: the deep flexor of the index moves the index.
def test_the_page_has_activations_and_tensions_of_muscles_by_finger(tmp_path):
    hs.load("muscle_poses", {"duration": "0.1 s"}).run(tmp_path, frames=0)
    run, table = page_of(tmp_path)[0], read_sto(tmp_path / "muscles.sto")
    assert "Torques" not in {each["group"] for each in run["curves"]}
    # Axes are named flexion and abduction.
    assert all(re.search("(flexion|abduction)$", each["name"]) for each in run["curves"] if each["group"] == "Angles")
    found = {each["group"]: each for each in run["curves"] if each["name"] == "right.FDP2"}
    for group, unit, column in (("Tensions, index", "N", "tendon[N]"), ("Activations, index", "", "activation[]")):
        assert found[group]["unit"] == unit
        assert floats(found[group]["values"])[-1] == np.float32(next(table[name] for name in table if f"right.FDP2.{column}".startswith(name))[-1])
    assert len(found) == 2
    # The wrist is fixed in this scene.
    assert run["zero"] == ["Activations, wrist", "Joint gaps", "Tensions, wrist", "Torques"]


def test_tables_that_were_changed_are_refused_at_their_line(folder, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    lines = (folder / "trajectory.csv").read_text().splitlines(keepends=True)
    row = lines[2].rstrip("\n").rpartition(",")[0]
    wrong = {"a line without its end": [*lines[:-1], lines[-1][:-1]], "need times that increase": [*lines, *lines[2:]],
             ":3:1: got nan": [*lines[:2], row + ",nan\n", *lines[3:]], "need a unit quaternion": [*lines[:2], row + ",5\n", *lines[3:]]}
    for message, content in wrong.items():
        (copy / "trajectory.csv").write_text("".join(content))
        with pytest.raises(hs.Error, match=message):
            page_of(copy)
    (copy / "trajectory.csv").write_text("".join(lines))
    assert page_of(copy)[0]["poses"] == page_of(folder)[0]["poses"]


# Oracle: contacts.csv; gravity, which a ball at rest presses on the ground with.
def test_the_page_has_the_forces_of_contacts(balls, tmp_path):
    balls.run(tmp_path, frames=0, report=True)
    contacts = data_of((tmp_path / "report.html").read_text())["runs"][0]["contacts"]
    table = read_csv(tmp_path / "contacts.csv")
    values = floats(contacts["values"]).reshape(-1, 6)
    assert len(values) == table.rows and floats(contacts["starts"])[-1] == table.rows
    assert np.array_equal(values[:, :3], np.column_stack([np.float32(next(table[n] for n in table if n.startswith(axis))) for axis in "xyz"]))
    assert values[-1, 5] == pytest.approx(0.981, rel=1e-3) and contacts["largest"] >= 0.981 * 0.999


# Oracle: the package's own page of the same run, from a process that has made no skin of another hand.
@needs_program
def test_the_program_writes_the_same_page(tmp_path):
    words = ["run", "dropped_hand", "--set", "duration=0.2 s", "--report", "--quiet", "--out", str(tmp_path / "run")]
    subprocess.run([PROGRAM, *words], capture_output=True)
    ours = data_of((tmp_path / "run/report.html").read_text())
    own = tmp_path / "own.html"
    subprocess.run([sys.executable, "-m", "handsim", "report", str(tmp_path / "run"), "--out", str(own)], check=True, capture_output=True)
    assert ours == data_of(own.read_text())
    assert ours["runs"][0]["contacts"]["largest"] > 0
