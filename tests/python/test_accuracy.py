"""What the study of accuracy makes of its rows: tables, plots and the command."""
import json
import os
import subprocess
import sys

import pytest

import handsim as hs
from handsim import _accuracy

PROGRAM = os.environ.get("HANDSIM_PROGRAM", "")


def row(method, error, cost, own=False):
    return {"method": method, "step": 1e-3, "fault": None, "own_reference": own, "is_reference": False, "rate_error": error, "cpu": cost}


def test_the_cheapest_row_reaches_the_target():
    rows = [row("a", 0.1, 1.0), row("b", 0.01, 3.0), row("c", 0.005, 2.0)]
    found = {"rows": rows, "reference": None}
    assert _accuracy.cheapest(found, 0.05) is rows[2] and _accuracy.cheapest(found, 0.2) is rows[0] and _accuracy.cheapest(found, 1e-4) is None
    # a at 0.1, then c down to 0.01: one line each, at the smallest error.
    assert [line.split()[:2] for line in _accuracy.cheapest_table(found).splitlines()[1:]] == [["0.1", "a"], ["0.01", "c"]]
    assert _accuracy.cheapest_table({**found, "rows": []}) == ""


def test_a_row_with_its_own_reference_does_not_compete_in_a_study_that_has_one():
    """Rows with and without contact have different reference motions."""
    rows = [row("a", 0.01, 1.0, own=True)]
    assert _accuracy.cheapest({"rows": rows, "reference": None}, 0.1) is rows[0]
    assert _accuracy.cheapest({"rows": rows, "reference": {"time": [0], "rate": [0]}}, 0.1) is None


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "study.yaml"
    scene = hs.data_path() / "config/slider_crank_iftomm.yaml"
    # After 1 s the ball is faster than 1000 m/s.
    ball = tmp_path / "ball.yaml"
    ball.write_text(json.dumps({"objects": [{"name": "ball", "shape": "sphere", "radius": 0.1, "mass": 1, "position": [0, 0, 0]}], "effects": ["gravity"],
                                "gravity": [0, 0, -1000], "duration": 1.2}))
    path.write_text(json.dumps({"title": "it's", "scene": str(scene), "reference": "slider_crank_iftomm", "observe": "slide", "repeats": 1, "early": 0.1,
                                "steps": ["5 ms", "1 ms"], "plot_steps": ["1 ms"], "methods": [
                                    {"name": "it's", "set": {"duration": 0.2}},
                                    {"name": "it fails", "scene": str(ball), "observe": "ball.z", "steps": ["5 ms"]}]}))
    return path


def test_files_have_the_rows(study, tmp_path):
    """Oracle: the rows' own numbers, in the JSON; the method converges, so the smaller step has the smaller error."""
    found = hs.study.accuracy(study, out=tmp_path / "out")
    lines, rows = (tmp_path / "out/accuracy.csv").read_text().splitlines(), found.summary["rows"]
    assert lines[1].startswith('"it\'s",0.005,') and lines[1].split(",")[2] == repr(rows[0]["rate_error_rms"])
    assert rows[1]["early_rate_error_rms"] < rows[0]["early_rate_error_rms"] and rows[0]["step_s"] == 0.005
    assert set(rows[2]) == {"method", "step_s", "fault"} and "ball: speed" in rows[2]["fault"] and rows[2]["fault"] in found.text
    assert found.summary["versions"]["engines"][0].startswith("ODE 0.16")
    script = (tmp_path / "out/accuracy.gp").read_text()
    assert "title 'it s' noenhanced" in script and "set title 'step 1 ms'" in script and "title 'reference'" in script
    commands = json.loads((tmp_path / "out/study.json").read_text())
    assert len(commands["rows"]["accuracy.csv"]) == 3 and "--set solver.step=0.001" in commands["rows"]["accuracy.csv"][1]


@pytest.mark.skipif(not PROGRAM, reason="the program is not in the path (HANDSIM_PROGRAM)")
def test_the_command_names_the_cheapest_row_or_fails(study, tmp_path):
    def called(*more):
        return subprocess.run([PROGRAM, "accuracy", str(study), *more], cwd=tmp_path, capture_output=True, text=True, timeout=120)

    reached, missed = called("--target", "10"), called("--target", "1e-12", "--out", str(tmp_path / "other"))
    assert reached.returncode == 0 and "files in out/study\ncheapest at 10 m/s: it's at " in reached.stdout, reached.stdout + reached.stderr
    assert missed.returncode == 1 and missed.stdout.endswith("no row reaches an error of 1e-12 m/s\n")
    refused = called("--target", "fine")
    assert refused.returncode == 2 and refused.stderr == "--target: got fine, need an error above 0, such as 1e-3\n"
    study.write_text('{"scene": "none.yaml", "reference": "exact", "steps": ["1 mm"], "methods": []}')
    wrong = called()
    assert wrong.returncode == 2 and all(f"{study}:1:" in line for line in wrong.stderr.splitlines()) and len(wrong.stderr.splitlines()) > 2, wrong.stderr
    assert "Example: handsim accuracy" in called("--help").stdout


# The benchmark's reference has rates alone: no position error can be measured.
def test_a_reference_without_positions_leaves_their_error_out(tmp_path):
    study = tmp_path / "tiny.yaml"
    study.write_text(f"title: tiny\nscene: {hs.data_path() / 'config/slider_crank_iftomm.yaml'}\nreference: slider_crank_iftomm\nsteps: [\"5 ms\"]\n"
                     "methods:\n  - {name: ode, set: {duration: 0.2}}\n")
    found = hs.study.accuracy(study, out=tmp_path / "out")
    row = json.loads((tmp_path / "out/accuracy.json").read_text())["rows"][0]
    assert row["position_error_rms"] is None and row["rate_error_rms"] > 0
    assert ",nan," in (tmp_path / "out/accuracy.csv").read_text() and " nan " in str(found)


# Oracle: what programs do. Nothing was asked for, so nothing comes where results would.
@pytest.mark.parametrize("command", ["accuracy", "effects", "identify", "optimise", "report", "track", "view"])
def test_usage_is_an_error_where_nothing_is_said_and_an_answer_to_help(command):
    silent, asked = (subprocess.run([sys.executable, "-m", "handsim", command, *words], capture_output=True, text=True) for words in ([], ["--help"]))
    assert (silent.returncode, silent.stdout) == (2, "") and f"handsim {command}" in silent.stderr
    assert (asked.returncode, asked.stderr) == (0, "") and asked.stdout == silent.stderr
