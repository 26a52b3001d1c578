"""Studies give what the commands write."""
import shutil
import struct

import numpy as np
import pytest

import handsim as hs


# Oracle: the effects of the scene; the files in the folder that the study was told to keep.
def test_effects_lists_every_effect(tmp_path):
    shares = []
    scene = hs.load("two_hands", {"duration": "0.1 s"})
    study = hs.study.effects(scene, repeats=1, out=tmp_path, progress=shares.append)
    assert study.tables["effects"]["effect_taken_away"] == ["none", *scene.effects]
    assert (tmp_path / "effects.csv").is_file() and "gravity" in study.text
    assert [row["effect"] for row in study.summary["rows"]] == scene.effects
    assert all(0 <= share <= 1 for share in shares)


# Oracle: number and seed of the draws; the same seed gives the same table, in one thread and in two.
@pytest.mark.skipif(not shutil.which("gnuplot"), reason="gnuplot is not installed")
def test_the_plot_of_many_keys_and_outcomes_has_24_panels_at_most():
    # Such a plot was 8,640 pixels tall. The oracle is the size in the PNG's own head.
    found = hs.study.uncertain("muscle_grip", {"duration": "0.05 s"}, count=4)
    outcomes = found.summary["outcomes"]
    width, height = struct.unpack(">II", found.plots["rollouts"][16:24])
    assert len(outcomes) * max(len(each["keys"]) for each in outcomes.values() if "keys" in each) > 24
    assert max(width, height) <= 2880 and width * height <= 24 * 480 * 360


def test_uncertain_hands_have_intervals():
    """Oracle: a hand's deviations are drawn for each run; those of the first runs do not depend on the count."""
    motion = {"duration": "0.02 s", "solver.engine": "articulated"}
    few, more = (hs.study.uncertain("two_hands", motion, count=n) for n in (3, 5))
    name = "hands.*.person.deviations.hand_length"
    assert len(set(more.tables["rollouts"][name])) == 5
    assert np.array_equal(few.tables["rollouts"][name], more.tables["rollouts"][name][:3])
    gap = more.summary["outcomes"]["joint_gap[m]"]
    assert gap["percentile_5"] <= gap["mean"]["value"] <= gap["percentile_95"]


def test_drawn_hands_grasp_and_move():
    """Oracle: the same seed's table in one thread and in two; a drawn hand's torques are those of its own inverse dynamics."""
    short = {"grasps.0.hold": "0.6 s", "solver.engine": "articulated",
             "grasps.0.shake.levels": [{"acceleration": 2, "frequency": "4 Hz"}]}
    first, second = (hs.study.grasps("grasp_pinch", short, uncertain=3, threads=n) for n in (1, 2))
    assert list(first.tables["uncertain"]["figure"]) == list(second.tables["uncertain"]["figure"])
    assert np.array_equal(first.tables["uncertain"]["mean"], second.tables["uncertain"]["mean"])
    assert "held in" in first.text
    motion = {"duration": "0.05 s", "criteria": {}}
    drawn = hs.study.inverse("every_pose", motion, uncertain=2)
    name = "right.index_mcp.flexion"
    column = drawn.tables["rollouts"]
    own = dict(motion)
    for key in column:
        if "deviations" in key:
            own.update({key.replace("*", hand): float(column[key][1]) for hand in "01"})
    torques = hs.study.inverse("every_pose", own, check=False).tables["torques"]
    assert np.isclose(np.abs(torques[f"{name}_active"]).max(), column[f"{name}.largest_torque[N_m]"][1], rtol=1e-6)
    assert "right.index_mcp.flexion.torque.p5" in drawn.tables["bands"]
    with pytest.raises(hs.Error, match="options of one run"):
        hs.study.grasps("grasp_pinch", uncertain=3, margin=True)


def test_rollouts_are_a_function_of_the_seed():
    first, second = (hs.study.rollouts("rollouts_free_fall", count=6, seed=3, threads=n) for n in (1, 2))
    table, other = first.tables["rollouts"], second.tables["rollouts"]
    assert table.rows == 6
    for name, column in table.items():
        if isinstance(column, np.ndarray):
            assert np.array_equal(column, other[name], equal_nan=True), name
        else:
            assert column == other[name], name


# Oracle: the figures of the scene's own run, to the digits of the table.
def test_grasps_agree_with_the_run():
    short = {"grasps.0.hold": "0.5 s", "grasps.0.shake.levels": [{"acceleration": 2, "frequency": "4 Hz"}],
             "solver.engine": "articulated"}
    study = hs.study.grasps("grasp_power_can", short)
    figures = hs.load("grasp_power_can", short).run(frames=0).figures
    table = study.tables["grasps"]
    row = table.row(0)
    assert table.rows == 1 and row["scene"] == "grasp_power_can" and row["side"] == "right"
    assert row["shift"] == pytest.approx(1e3 * figures["grasp_shift"], rel=1e-2)
    assert (table.units["shift"], figures.units["grasp_shift"]) == ("mm", "m")


# Oracle: rk4 is of order 4 on smooth motion: half the step has a sixteenth of the error (12 to 20 here).
def test_accuracy_measures_the_order_of_a_method(tmp_path):
    (tmp_path / "study.yaml").write_text(f"""
title: order of rk4
scene: {hs.data_path()}/config/slider_crank_iftomm.yaml
reference: slider_crank_iftomm
observe: slide
sample_every: "10 ms"
early: "0.1 s"
repeats: 1
steps: ["2 ms", "1 ms"]
methods: [{{name: rk4, set: {{duration: 0.5, solver.engine: articulated, solver.method: rk4}}}}]
""")
    table = hs.study.accuracy(tmp_path / "study.yaml").table
    assert table["step"].tolist() == [0.002, 0.001]
    error = table["rate_error_rms"]
    assert 12 < error[0] / error[1] < 20


def test_a_study_of_another_kind_is_refused():
    with pytest.raises(hs.Error) as caught:
        hs.study.accuracy("two_hands")
    assert caught.value.problems
