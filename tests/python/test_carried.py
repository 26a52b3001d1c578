"""A simulation in which an object is carried along its recording, and hands that are driven for nothing else to carry it (docs/forces.md, replay)."""
import math

import numpy as np
import pytest

import handsim as hs
from handsim import _carried, _model, _replay

pytest.importorskip("scipy", reason="SciPy is not installed")
MASS = 0.3
WRIST = np.array([0, 0, 0.5, 0, 0, 1, 0])


# Oracles: Newton's second law, and how a critically damped spring follows a circle in the complex plane. No hand is near: the force that carries a ball is all
# that accelerates it and bears its weight.
def test_an_object_is_carried_along_its_recording(tmp_path):
    scene = hs.load({"title": "a ball", "objects": [{"name": "ball", "shape": "sphere", "radius": 0.03, "mass": 0.2, "position": [0.1, 0, 0.5]}],
                     "effects": ["gravity"], "solver": {"engine": "articulated", "step": "1 ms"}, "duration": 1})
    times, rate = np.arange(61) / 60, 4.0
    poses = np.tile([0.0, 0, 0.5, 1, 0, 0, 0], (61, 1))
    poses[:, 0], poses[:, 1] = 0.1 * np.cos(rate * times), 0.1 * np.sin(rate * times)
    found = _carried.carried(scene, "ball", ["right.palm"], times, poses)
    middle = (times[30:-2] + times[31:-1]) / 2  # the ball starts at rest
    follows = (_carried.CARRY**2 + 2j * _carried.CARRY * rate) / (_carried.CARRY + 1j * rate)**2
    pull = -0.2 * rate**2 * 0.1 * follows * np.exp(1j * rate * middle)
    exact = np.stack([pull.real, pull.imag, np.full(29, 0.2 * 9.80665)], axis=1)
    assert found.help[30:-2, :3] == pytest.approx(exact, abs=3e-3)
    assert not found.touching.any() and np.abs(found.help[30:-2, 3:]).max() < 1e-6


def open_hand(raised=0.0, wrist=WRIST):
    """A scene with a box that far over an open hand, which points down the world's y axis, palm upwards; there is no ground."""
    import recorded_cases

    whole = recorded_cases.both_hands(recorded_cases.CASES["both"], "median_man")
    hand, programs = whole["hands"][0], whole["control"]["poses"]["programs"]["hold"]["hands"]
    programs.pop("left")
    long = np.linalg.norm(wrist[4:])
    turn = {"axis": (wrist[4:] / long).tolist(), "angle": 2 * math.atan2(long, wrist[3])}
    hand["wrist"] = {"mount": "driven", "motion": {"keyframes": [{"time": time, "position": wrist[:3].tolist(), "rotation": turn} for time in (0, 5)]}}
    place = [0, 0.05, 0.5 + recorded_cases.TOUCHES + 0.02 + raised]
    whole.pop("ground")
    whole["contacts"]["rules"].pop()
    effects = [each for each in whole["effects"] if each != "ground_contact"]
    scene = hs.load({**whole, "hands": [hand], "solver": {"engine": "articulated", "step": "1 ms"}, "duration": 5, "effects": effects,
                     "objects": [{"name": "box", "shape": "box", "edges": [0.05, 0.05, 0.04], "mass": MASS, "position": place, "overlap": "allowed"}]})
    return scene, np.array([*place, 1, 0, 0, 0])


def guided(scene, wrist):
    segments = [name for name in scene.bodies if name.startswith("right.")]
    targets = np.tile(hs.Simulation(scene).q[scene.axis_coordinates], (len(wrist), 1))
    return segments, _carried.Guided(wrist, targets, np.arange(len(scene.axes)), scene.axis_coordinates, np.arange(len(segments)),
                                     np.ones(len(scene.axes)), lambda q, *_: np.zeros(len(scene.axes)))


# Oracle: the weight. A box is 10 mm over an open hand: the spring that carries it gives way by that, and the hand bears the rest; a hand that is moved for the
# box to come back bears all of it. A movement that is forgotten within 2 s and made within 0.1 s leaves the box 1/20 of it beside its place.
@pytest.mark.parametrize("moved", [False, True])
def test_hands_that_are_moved_bear_all_of_the_object(moved):
    scene, box = open_hand(raised=0.01)
    segments, own = guided(scene, np.tile(WRIST, (61, 1)))
    found = _carried.carried(scene, "box", segments, np.arange(61) / 30, np.tile(box, (61, 1)), [own] if moved else [])
    weight, spring = 9.80665 * MASS, MASS * _carried.CARRY**2
    assert found.force[-5:].sum(axis=1).mean(axis=0) + found.help[-5:, :3].mean(axis=0) == pytest.approx([0, 0, weight], abs=0.02 * weight)
    if not moved:
        # The box stands on the places that touch: as far as the spring gives way, and turns, they are below its recorded bottom,
        # and up to the depth of pads of 1.8 N/mm within it.
        weights = found.touching[-1] * found.force[-1, :, 2]
        low, x, y = np.average(found.place[-1, :, [2, 0, 1]] - box[[2, 0, 1], None], axis=1, weights=weights) + [0.02, 0, 0]
        turn = -found.help[-1, 3:5] / (_carried.CARRY**2 * MASS * (0.05**2 + 0.04**2) / 12)
        inside = low - (-found.help[-1, 2] / spring + turn[0] * y - turn[1] * x)
        assert found.help[-1, 2] > 0.01 * spring and 0 < inside < weights.sum() / 1800
        return
    shift = _model.compose(found.wrists[0][-1], _model.inverse(WRIST))
    rise = (_model.turned(shift[3:], box[:3]) + shift[:3] - box[:3])[2]
    left = _carried.COMES_BACK / _carried.FORGETS
    assert 0.01 < rise < 0.02 and found.help[-1, 2] == pytest.approx(spring * rise * left / (1 + left), rel=0.1)
    assert np.abs(found.help[-1, :3]).max() < 0.06 * weight


# Oracle: equilibrium. Driven as was found, the hand bears a box that nothing carries, at rest where it was recorded.
def test_a_free_object_rests_on_a_hand_that_is_driven_as_was_found():
    scene, box = open_hand(raised=0.01)
    segments, own = guided(scene, np.tile(WRIST, (61, 1)))
    found = _carried.carried(scene, "box", segments, np.arange(61) / 30, np.tile(box, (61, 1)), [own], None, 30)
    free, _ = open_hand(0.01, found.wrists[0][-1])
    simulation = hs.Simulation(free)
    simulation.reset(q=found.q[-1])
    body = next(i for i, each in enumerate(free._model.bodies) if each.name == "box")
    for _ in range(5):
        simulation.step(targets=found.targets[0][-1], substeps=100)
        assert np.linalg.norm(simulation.bodies.position[body] - box[:3]) < 1e-4


# Oracle: Galilei. A hand and its object that move at a constant velocity do as those at rest, from the rest before the recording on.
def test_what_hands_do_is_the_same_at_a_constant_velocity():
    scene, box = open_hand(raised=2e-3)
    times = np.arange(21) / 30
    found = []
    for velocity in (0.0, 0.4):
        by = velocity * times[:, None] * [0.6, 0, 0.8] @ np.eye(3, 7)
        segments, own = guided(scene, WRIST + by)
        each = _carried.carried(scene, "box", segments, times, box + by, [own], None, 10)
        found.append((each.help, each.force, np.where(each.touching[..., None], each.place - by[:, None, :3], 0)[:-1], each.wrists[0] - by))
    for rest, fast in zip(*found):
        assert fast == pytest.approx(rest, abs=1e-6)
    assert np.abs(found[0][1]).max() > 1


# Oracle: steps that are known, in noise that is known. No step is found where there is none, and a step of a noise in each of 20 coordinates after 20 frames is.
def test_pieces_are_those_between_steps():
    random = np.random.default_rng(12)
    noise, price = 2e-3, 3 * 20
    still = noise * random.normal(size=(60, 20))
    assert _replay.pieces(still, noise, price) == [(0, 60)]
    steps = still + np.where(np.arange(60) < 20, 0.0, 2 * noise)[:, None] + np.where(np.arange(60) < 45, 0.0, -2 * noise)[:, None]
    assert _replay.pieces(steps, noise, price) == [(0, 20), (20, 45), (45, 60)]
    # A higher price keeps one piece: 20 coordinates times 2/3 of 60 frames times the variance of the steps in noises.
    assert _replay.pieces(steps, noise, 60 * 20 * 4) == [(0, 60)]


# Oracle: a hand that moves with the object keeps its place on it, and noise of single frames falls with the root of those in the mean. A second grip 3 cm beside
# the first is one of its own, and a hand that bears nothing is where it was recorded but for means over 7 frames.
def test_a_hand_that_holds_is_steady_seen_from_the_object():
    random = np.random.default_rng(7)
    count, width = 200, 7
    turns = np.array([_model.turn_of([0, 0, 0.01 * i]) for i in range(count)])
    poses = np.concatenate([np.stack([0.003 * np.arange(count), np.zeros(count), np.sin(np.arange(count) / 30)], axis=1), turns], axis=1)
    on_object = np.tile([0.05, -0.1, 0.02, *_model.turn_of([0.3, 0.2, 0.1])], (count, 1))
    on_object[120:, 0] += 0.06
    exact = _model.compose(poses, on_object)
    for noise, holds, most in ((0.0, True, 1e-9), (2e-3, True, 1.5 * 2e-3 / math.sqrt(80)), (2e-3, False, 1.5 * 2e-3 / math.sqrt(width))):
        wrist = exact.copy()
        wrist[:, :3] += noise * random.normal(size=(count, 3))
        hands = [type("Motion", (), {"q": np.zeros((count, 20)), "wrist": wrist})]
        of = type("Solver", (), {"motions": hands, "noises": [2e-3], "of": type("Needed", (), {"motion": type("Motion", (), {"poses": poses})})})
        _, found, pieces = _replay.steadied(of, 0, np.arange(count), np.full(count, holds), width)
        assert pieces == ([(0, 120), (120, 200)] if holds else [])
        away = np.linalg.norm(found[:, :3] - exact[:, :3], axis=1)
        away[120 - width:120 + width] = 0
        assert np.sqrt(np.mean(away[width:-width]**2) / 3) <= most
