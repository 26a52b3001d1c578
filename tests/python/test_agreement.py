"""tests/study/agreement.py: counts, draws and the command that repeats a draw."""
import importlib.util
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import handsim as hs

SCRIPT = Path(__file__).parents[1] / "study" / "agreement.py"
spec = importlib.util.spec_from_file_location("agreement", SCRIPT)
agreement = importlib.util.module_from_spec(spec)
spec.loader.exec_module(agreement)

# Cut off after the hold: grips are known, verdicts are not.
BRIEF = {"grasps.0.hold": "0.1 s", "solver.step": "4 ms", "duration": "2.5 s"}


def said(held, grip=1.0, slip=0.0):
    return {"held": held, "grip": grip, "slip": slip, "outcome": "", "margin": None}


def row(*says, turning=""):
    return {"says": dict(zip(agreement.WAYS, says)), "turning": turning, "place_m": [0, 0, 0], "mass_kg": 0.3, "friction": 0.5}


# Oracle: counted by hand. Of four draws two differ, one of these is marginal; of the two that both hold the grip differs by 5 and
# by 25 %.
def test_verdicts_and_grips_are_counted():
    pair = agreement.compare([row(said(True, 21, 1e-6), said(True, 20, 3e-6)), row(said(False), said(True)),
                              row(said(True), said(False), turning="5 % more mass"),
                              row(said(True, 10, 2e-6), said(True, 8, 4e-6))], "ode", "articulated")
    assert pair["same_verdict"] == {"same": 2, "of": 4}
    assert pair["same_verdict_not_marginal"] == {"same": 2, "of": 3}
    assert pair["grip_difference_most"] == pytest.approx(0.25)
    assert pair["grip_within_a_tenth"] == {"same": 1, "of": 2}
    assert pair["slip_median_m_per_s"] == pytest.approx([1.5e-6, 3.5e-6])


# Oracle: counted by hand: one pair of slips is below 1 um/s, of the two others one differs by less than 10 %.
def test_slips_above_the_floor_are_compared():
    pair = agreement.compare([row(said(True, 1, 0.2e-6), said(True, 1, 0.9e-6)), row(said(True, 1, 0.5e-6), said(True, 1, 1.5e-6)),
                              row(said(True, 1, 5.1e-6), said(True, 1, 5.3e-6)),
                              row(said(False, 1, 5e-6), said(True, 1, 5e-6))], "ode", "articulated")
    assert pair["slip_below_floor"] == 1
    assert pair["slip_within_a_tenth"] == {"same": 1, "of": 2}


# Oracle: of ODE's quarter steps only the rows that were to have them count, however many have them.
def test_quarter_steps_of_the_first_draws_alone_count():
    rows = [row(*[said(True)] * 4), row(said(True), said(True), said(False)), row(said(True), *[said(False)] * 3)]
    pairs = agreement.summary(rows, 1)["pairs"]
    assert [pair["same_verdict"] for pair in pairs] == [{"same": 2, "of": 3}, {"same": 2, "of": 3}, *[{"same": 1, "of": 1}] * 2]
    assert len(agreement.summary(rows, 0)["pairs"]) == 2
    assert [entry["draw"] for entry in agreement.summary(rows, 0)["differences"]] == [2]


# A draw that the grip refuses is replaced by the next one; where no draw can be held, drawing ends.
def test_refused_draws_are_drawn_again():
    draws, refused = agreement.draws_of(agreement.BOX, {}, 30, 2201)
    assert len(draws) == 30 and len(refused) > 0 and all("grasps.0: got a hand of" in text for text in refused)
    assert draws[:10] == agreement.draws_of(agreement.BOX, {}, 10, 2201)[0]
    with pytest.raises(hs.Error):
        agreement.draws_of(agreement.BOX, {"objects.0.edges": [0.3, 0.3, 0.3]}, 3, 1)


# Oracle: the program with the draw's own command: the same slip on the articulated engine. In one process and in two the files are
# the same but for times.
def test_the_command_of_a_draw_repeats_it(tmp_path):
    found = []
    for jobs in (1, 2):
        out = tmp_path / str(jobs)
        subprocess.run([sys.executable, SCRIPT, "--draws", "2", "--jobs", str(jobs), "--out", out,
                        *(word for key, value in BRIEF.items() for word in ("--set", f"{key}={value}"))],
                       check=True, capture_output=True)
        table = hs.study.read_csv(out / "agreement.csv")
        found.append([table.row(k) for k in range(table.rows)])
    for one, two in zip(*found):
        del one["cpu"], two["cpu"]
        assert str(one) == str(two)
    draw = agreement.draws_of(agreement.BOX, BRIEF, 1, 1)[0][0]
    words = shlex.split(agreement.command_of(agreement.BOX, BRIEF, draw))
    subprocess.run([os.environ["HANDSIM_PROGRAM"], *words[1:-1], tmp_path / "again"], capture_output=True, check=False)
    again = json.loads((tmp_path / "again/box/summary.json").read_text())["grasps"][0]
    assert 1e6 * again["slip_m_per_s"] == pytest.approx(found[0][0]["articulated slip"], rel=1e-12)
