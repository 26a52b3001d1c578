"""Optimal control: against closed forms, the conditions of an optimum by other gradients, and what the command writes."""
import json
import os
import subprocess
import sys

import handsim as hs
import numpy as np
import pytest
from handsim import optimise
from handsim._gradients import Rollout
from handsim._optimise_command import main

pytest.importorskip("yaml", reason="goals are read by PyYAML")
STEP = 0.01
# A mass of 2 kg on a rail.
RAIL = {"bodies": [{"name": "cart", "mass": 2, "inertia": [0.01, 0.01, 0.01], "position": [0, 0, 0]}],
        "joints": [{"name": "rail", "type": "slider", "child": "cart", "position": [0, 0, 0], "axes": [{"name": "x", "axis": [1, 0, 0]}]}],
        "effects": ["gravity"], "solver": {"engine": "articulated", "step": STEP}, "duration": 1}
GOAL = "actions: torques\nhold: 10 ms\nduration: 0.5\neffort: 1\ncosts:\n  - {point: cart, is: [0.3, ~, ~], at: 0.5, weight: 1000}\n"


def rail(knots=50, hold=1, weight=1000.0):
    problem = optimise.Problem(hs.Simulation(RAIL), "torques", [0], knots, hold)
    last = np.zeros(knots + 1)
    last[-1] = weight
    problem.effort[:] = 1
    problem.terms = [optimise.Term("end", last, optimise.angle(problem, 0, 0.3))]
    return problem


def test_a_cart_moves_as_least_squares_says():
    # Semi-implicit Euler: x(N) = sum of h^2 / m (N - k) f(k); least h f.T f + w (x(N) - 0.3)^2 in closed form.
    found = optimise.solve(rail())
    row = STEP**2 / 2 * (50 - np.arange(50))
    forces = 1000 * 0.3 * row / (STEP + 1000 * row @ row)
    np.testing.assert_allclose(found.trajectory.actions[:, 0], forces, rtol=1e-9)
    cost = STEP * forces @ forces + 1000 * (row @ forces - 0.3)**2
    assert found.converged and abs(found.trajectory.cost - cost) < 1e-9 * cost


def test_an_action_that_holds_is_that_of_all_its_steps():
    found = optimise.solve(rail(10, 5))
    row = (STEP**2 / 2 * (50 - np.arange(50))).reshape(10, 5).sum(axis=1)
    forces = 1000 * 0.3 * row / (5 * STEP + 1000 * row @ row)
    np.testing.assert_allclose(found.trajectory.actions[:, 0], forces, rtol=1e-9)


def test_limits_and_rates_hold_where_another_gradient_vanishes():
    problem = rail()
    problem.low[:], problem.high[:], problem.rate[:] = -2, 4, 1e-3
    found = optimise.solve(problem, within=1e-9)
    actions = found.trajectory.actions[:, 0]
    assert found.converged and actions.max() == 4 and actions.min() >= -2
    problem.simulation.reset(problem.start)
    run = Rollout(problem.simulation, found.trajectory.actions)
    gradient = run.vjp([2 * 1000 * (problem.simulation.q[0] - 0.3), 0]).action[:, 0] + 2 * STEP * actions
    jump = 2 * 1e-3 / STEP * np.diff(actions)
    gradient[1:] += jump
    gradient[:-1] -= jump
    free = actions < 4
    assert np.abs(gradient[free]).max() < 1e-6 * np.abs(gradient[~free]).max()
    assert (gradient[~free] < 0).all()


def test_a_quadratic_between_limits_meets_its_conditions():
    random = np.random.default_rng(0)
    for _ in range(50):
        root = random.normal(size=(6, 6))
        matrix, slope = root @ root.T + 0.1 * np.eye(6), 3 * random.normal(size=6)
        low, high = -random.uniform(0, 1, 6), random.uniform(0, 1, 6)
        x, free = optimise.boxed(matrix, slope, low, high)
        down = matrix @ x + slope
        assert np.abs(down[free]).max(initial=0) < 1e-8
        assert ((x == low) & (down > 0) | (x == high) & (down < 0))[~free].all()


def test_places_of_points_have_their_derivatives():
    sim = hs.Simulation("grasp_pinch", {"solver": "{engine: articulated}"})
    places = optimise.Places(sim, [])
    q = np.random.default_rng(0).uniform(0.05, 0.2, len(sim.q))
    tip = dict((name, (body, offset)) for name, body, offset in sim.scene._model.hands[0].tips)["right.index_tip"]

    def at(angles):
        sim.reset(q=angles)
        return places.point(sim.bodies, *tip)

    by = at(q)[1]
    for i in range(len(q)):
        change = 1e-6 * (np.arange(len(q)) == i)
        np.testing.assert_allclose((at(q + change)[0] - at(q - change)[0]) / 2e-6, by[:, i], atol=1e-9)


@pytest.fixture
def files(tmp_path):
    (tmp_path / "rail.yaml").write_text(json.dumps(RAIL))
    (tmp_path / "goal.yaml").write_text(GOAL)
    return tmp_path


def command(*words):
    done = subprocess.run([sys.executable, "-m", "handsim", *map(str, words)], capture_output=True, text=True,
                          env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})
    return done.returncode, done.stdout, done.stderr


def test_what_is_written_plays_the_same_run(tmp_path):
    goal = hs.data_path() / "config" / "goals" / "reach.yaml"
    status, out, err = command("optimise", "reach", "--goal", goal, "--out", tmp_path / "out", "--no-run")
    assert status == 0, err
    result = json.loads((tmp_path / "out" / "optimise.json").read_text())
    assert result["converged"] and result["played_difference"] < 1e-12
    # The servos' torques are those that were found: their integral of squares is the effort.
    simulation, effort = hs.Simulation(tmp_path / "out" / "scene.yaml"), 0.0
    without = hs.Simulation("reach")
    actions = np.loadtxt(tmp_path / "out" / "inputs" / "actions.csv", delimiter=",", skiprows=1)[1:, 1:]
    for row in actions:
        simulation.step()
        torques = np.zeros(len(simulation.q))
        torques[4:8] = 50 * (row - simulation.q[4:8])
        without.step(torques)
        effort += 1e-3 * (torques**2).sum()
    np.testing.assert_allclose(without.q, simulation.q, atol=1e-9)
    assert abs(effort / result["costs"]["effort"] - 1) < 1e-9


def test_a_reach_by_torques_arrives():
    scene = hs.load("reach")
    from handsim._optimise_command import Goal

    goal = Goal(hs.data_path() / "config" / "goals" / "reach.yaml", scene)
    problem = goal.problem(hs.Simulation(scene))
    found = optimise.solve(problem)
    tip = next((body, offset) for name, body, offset in scene._model.hands[0].tips if name == "right.index_tip")
    place = problem.places.point(problem.simulation.bodies, *tip)[0]
    assert found.converged and np.linalg.norm(place - goal.file.get("costs.0.is")) < 1e-5


def test_muscles_lift_a_block_in_a_pinch_and_hold_it(tmp_path):
    goal = hs.data_path() / "config" / "goals" / "lift.yaml"
    status, out, err = command("optimise", "muscle_pinch", "--goal", goal, "--out", tmp_path / "out", "--no-run", "--iterations", 3)
    result = json.loads((tmp_path / "out" / "optimise.json").read_text())
    assert status in (0, 1) and result["played_difference"] < 1e-6 and all(share == 1 for share in result["touch"].values()), (out, err)
    # What is written lifts it by excitations alone; those of the scene do not.
    held = []
    for source in (tmp_path / "out" / "scene.yaml", "muscle_pinch"):
        simulation = hs.Simulation(source)
        assert not simulation.scene.axes and len(simulation.scene.muscles) == 41
        block, lifted = simulation.scene.bodies.index("block"), 0
        start = simulation.bodies.position[block][2]
        for _ in range(600):
            simulation.step()
            touched = {name for contacts in (simulation.contacts.a, simulation.contacts.b) for name in contacts}
            lifted += simulation.bodies.position[block][2] - start >= 0.02 and "ground" not in touched
        held.append(0.002 * lifted)
    assert held[0] >= 0.5 and held[1] == 0


def test_angles_by_pattern_count_from_the_start_and_paths_may_leave_axes_free(tmp_path):
    from handsim._optimise_command import Goal

    (tmp_path / "goal.yaml").write_text("actions: torques\nof: right.index_*\nduration: 0.1\ncosts:\n  - {angle: 'right.index_*', weight: 3}\n"
                                        "  - {point: right.index_tip, relative: true, path: [[0, ~, 0, ~], [0.1, ~, 0.02, ~]], weight: 5}\n")
    scene = hs.load("reach", {"hands.0.pose.index_pip": 0.3})
    simulation = hs.Simulation(scene)
    problem = Goal(tmp_path / "goal.yaml", scene).problem(simulation)
    angles, path = (term.residual for term in problem.terms)
    body, offset = next((body, offset) for name, body, offset in scene._model.hands[0].tips if name == "right.index_tip")
    before = problem.places.point(simulation.bodies, body, offset)[0]
    q = simulation.q + 0.01 * np.arange(len(simulation.q))
    simulation.reset(q=q)
    off, by = angles(simulation, 5)
    np.testing.assert_allclose(off, 0.01 * np.arange(4, 8), atol=1e-15)
    np.testing.assert_array_equal(by, np.eye(problem.places.size)[4:8])
    off, by = path(simulation, 5)
    place, moved = problem.places.point(simulation.bodies, body, offset)
    np.testing.assert_allclose(off, [place[1] - before[1] - 0.01], atol=1e-15)
    np.testing.assert_array_equal(by, moved[1:2])


def test_all_that_is_wrong_with_a_goal_is_said_with_its_place(files, capsys):
    (files / "goal.yaml").write_text("actions: torques\nhold: 3 ms\ncost: []\n")
    assert main([str(files / "rail.yaml"), "--goal", str(files / "goal.yaml"), "--out", str(files / "out")]) == 2
    assert f"{files / 'goal.yaml'}:3:7: cost: got an unknown key, need costs" in capsys.readouterr().err
    (files / "goal.yaml").write_text("actions: torques\nduration: 0.5\ncosts:\n  - {point: cat, is: [1, 2], at: 0.7, weight: 1}\n  - {angle: rail.x, is: 1 N}\n")
    assert main([str(files / "rail.yaml"), "--goal", str(files / "goal.yaml"), "--out", str(files / "out")]) == 2
    said = capsys.readouterr().err
    assert "actions: got torques, need torques of a hand" in said
    for text in ("4:13: costs.0.point: got 'cat', need cart", "4:22: costs.0.is: got [1, 2], need", "costs.0.at: got 0.7, need a number of",
                 "costs.1.weight: got nothing"):
        assert text in said, (text, said)
    (files / "goal.yaml").write_text("actions: torques\nduration: 0.5\ncosts:\n  - {point: cart, is: [~, ~, ~], weight: 1}\n  - {angle: 'cat*', weight: 1}\n"
                                     "  - {point: cart, path: [[~, 1, 2, 3]], weight: 1}\n")
    assert main([str(files / "rail.yaml"), "--goal", str(files / "goal.yaml"), "--out", str(files / "out")]) == 2
    said = capsys.readouterr().err
    for text in ("4:5: costs.0: got a place of which all axes are free", "5:13: costs.1.angle: got 'cat*', need", "costs.2.path: got times that do not increase"):
        assert text in said, (text, said)
    assert not (files / "out").exists()
    assert main([str(files / "rail.yaml")]) == 2 and "--goal: got nothing" in capsys.readouterr().err


@pytest.mark.parametrize("more, said", [
    ("touch: null", "touch: got nothing, need a list of pairs"), ("touch: true", "touch: got True"), ("touch: 5", "touch: got 5"),
    ("touch: [[a]]", "touch: got [['a']]"), ("touch: [[a, [b]]]", "touch: got"), ("of: []", "of: got an empty list, need a name or pattern of rail.x"),
    ("window: []", "window: got []"), ("title: &a [*a]", "title.0: got an alias of itself"), ("title: 2001-99-99", "yaml: got "), ("effort: 1" + 400 * "0", "effort: got"),
    ("title: " + 2000 * "[" + 2000 * "]", "lists within lists within lists"), ("title: " + 60 * "[" + 60 * "]", "lists within lists within lists"),
    ("a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(f"{c}: &{c} [{', '.join(10 * ['*' + b])}]\n" for b, c in zip("abcdef", "bcdefg")), "aliases of aliases"),
    ("? [a, b]\n: c", "yaml: got found unhashable key"), ("limits: [2, 1]", "limits: got [2, 1]"), ("duration: 9000", "at most 10000 actions")])
def test_whatever_a_goal_has_is_refused_with_its_place(tmp_path, capsys, more, said):
    (tmp_path / "rail.yaml").write_text(json.dumps(RAIL))
    goal = GOAL if not more.startswith(("duration", "effort")) else GOAL.replace("duration: 0.5\n" if more[0] == "d" else "effort: 1\n", "")
    (tmp_path / "goal.yaml").write_text(goal + more + "\n")
    assert main([str(tmp_path / "rail.yaml"), "--goal", str(tmp_path / "goal.yaml"), "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"{tmp_path / 'goal.yaml'}:") and said in err and not (tmp_path / "out").exists(), err


def test_receding_windows_reach_what_the_whole_run_reaches():
    # A path over time: windows see all that counts soon.
    problem = rail(60)
    path = np.stack([0.1 * np.sin(np.arange(61) / 10), np.full(61, np.nan), np.full(61, np.nan)], axis=1)
    problem.effort[:] = 1e-6
    problem.terms = [optimise.Term("path", np.full(61, 1.0), optimise.point(problem, 1, np.zeros(3), path))]
    whole = optimise.solve(problem).trajectory
    problem.first = optimise.receded(problem, 15)
    parts = optimise.played(problem)
    assert whole.cost <= parts.cost < 1.5 * whole.cost


def test_a_shipped_goal_has_a_name_and_its_output_a_default(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["reach", "--goal", "reeach", "--no-run"]) == 2
    assert "--goal: got reeach, need a path, or the name of a shipped file; nearest: reach" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert main(["reach", "--goal", "reach", "--iterations", "2", "--no-run", "--quiet"]) in (0, 1)
    assert (tmp_path / "out" / "reach" / "optimise.json").is_file()
