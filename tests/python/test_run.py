"""Runs: the same as those of the command line, in memory and with files."""
import json
import os
import pickle
import signal
import threading
import time

import numpy as np
import pytest

import handsim as hs
from handsim.study import read_csv


# Oracle: the files that a run writes.
def test_a_run_in_memory_is_the_run_with_files(two_hands, tmp_path):
    memory, files = two_hands.run(frames=3), two_hands.run(tmp_path / "out", frames=0)
    assert memory.state_hash == files.state_hash == json.loads((tmp_path / "out/summary.json").read_text())["state_hash"]
    assert memory.verdicts == files.verdicts and memory.passed and files.passed
    table = read_csv(tmp_path / "out/trajectory.csv")
    assert list(memory.trajectory) == list(table) == list(files.trajectory)
    for name, column in memory.trajectory.items():
        # The table has twelve digits of the time and all of the others.
        assert np.allclose(column, table[name], rtol=1e-11 if name == "time" else 0, atol=0), name
    assert [frame.time for frame in memory.frames] == pytest.approx([0, 1, 2])
    assert memory.summary["criteria"] == files.summary["criteria"]
    assert (files["joint_gap"], files.units["joint_gap"]) == (memory["joint_gap"], "m")


# Oracle: the verdict of the same figure.
def test_figures_are_those_of_the_verdicts(two_hands):
    result = two_hands.run(frames=0)
    for verdict in result.verdicts:
        assert result[verdict.name] == result.figures[verdict.name] == verdict.measured
        assert result.units[verdict.name] == verdict.unit


# Oracle: a criterion that no run can hold.
def test_a_criterion_that_fails_is_not_passed():
    result = hs.load("two_hands", {"duration": "0.1 s", "criteria": {"joint_gap": 1e-15}}).run(frames=0)
    assert not result.passed and result.fault is None
    assert [v.held for v in result.verdicts if v.name == "joint_gap"] == [False]


# Oracle: 100 m/s and 1000 m/s^2: the engines' bound of 1 km/s is reached at sqrt(1000^2 - 100^2) / 1000 s = 0.995 s.
def test_a_motion_that_diverges_is_a_fault_not_an_exception():
    ball = {"name": "ball", "shape": "sphere", "radius": 0.03, "mass": 0.1, "position": [0, 0, 1], "velocity": [100, 0, 0]}
    scene = hs.load({"title": "fast", "duration": "2 s", "objects": [ball], "effects": ["gravity"],
                     "gravity": [0, 0, -1000]})
    result = scene.run(frames=0)
    assert not result.passed and result.fault.where == "ball" and "speed" in result.fault.quantity
    assert result.fault.time == pytest.approx(0.995, abs=2e-3)
    simulation = hs.Simulation(scene)
    with pytest.raises(hs.Error) as caught:
        simulation.step(substeps=2000)
    assert caught.value.kind == "physics" and caught.value.fault.where == "ball" and not caught.value.problems


def interrupted(call):
    """Sends Ctrl-C while a call runs. :returns: time from there to its end [s]"""
    sent = []

    def send():
        time.sleep(0.3)
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            call()
        return time.perf_counter() - sent[0]
    finally:
        thread.join()


# Oracle: the call would take minutes to hours; the test has a time limit. The latencies are printed (pytest -s).
@pytest.mark.parametrize("what", ["run", "run with files", "simulation", "batch", "draw", "study", "study in threads", "step", "step of a study"])
def test_ctrl_c_ends_long_work(what, tmp_path):
    scene = hs.load("two_hands", {"duration": "100000 s", "record.every": "100 s"})
    calls = {
        "run": lambda: scene.run(frames=0),
        "run with files": lambda: scene.run(tmp_path / "out", frames=0),
        "simulation": lambda: hs.Simulation(scene).step(substeps=100_000_000),
        "batch": lambda: hs.Batch(scene, 8).step(substeps=100_000_000),
        "draw": lambda: scene.draw(100_000),
        "study": lambda: hs.study.grasps("grasp_power_can", {"grasps.0.hold": "900 s"}, out=tmp_path),
        "step": lambda: hs.load("two_hands", {"duration": "100000 s", "record.every": "100 s", "solver.engine": "articulated", "solver.step": "auto"})
        .run(frames=0),
        "step of a study": lambda: hs.study.grasps("grasp_power_can", {"grasps.0.hold": "900 s", "solver.engine": "articulated", "solver.step": "auto"},
                                                   out=tmp_path),
        "study in threads": lambda: hs.study.rollouts("rollouts_free_fall", count=10_000_000, out=tmp_path),
    }
    print(f"\n{what}: {interrupted(calls[what]):.3f} s")


# Oracle: the exception of the callback itself.
def test_progress_is_called_and_may_end_the_run():
    scene = hs.load("two_hands", {"duration": "100000 s", "record.every": "100 s"})
    shares = []

    def progress(share):
        shares.append(share)
        if len(shares) == 3:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        scene.run(frames=0, progress=progress)
    assert 0 <= shares[0] <= shares[1] <= shares[2] < 1


# Oracle: the table itself.
def test_a_result_pickles_and_becomes_a_frame(two_hands):
    result = two_hands.run(frames=2)
    again = pickle.loads(pickle.dumps(result))
    assert again.state_hash == result.state_hash and again.verdicts == result.verdicts
    assert np.array_equal(again.trajectory["time"], result.trajectory["time"])
    pytest.importorskip("pandas", reason="pandas is not installed: there are no frames")
    frame = result.to_pandas()
    assert list(frame.columns) == list(result.trajectory)
    assert np.array_equal(frame["time"], result.trajectory["time"])
