"""Wrong arguments: every call refuses them by name, and none ends the process."""
import copy
import pathlib
import pickle

import numpy as np
import pytest

import handsim as hs
from attack import attack
from handsim import _core


# Oracle: the rules of attack.py. Other seeds and counts by hand: python3 tests/python/attack.py --count 5000 --seed 1
def test_cases_by_chance():
    assert list(attack(0, 500)) == []


@pytest.mark.parametrize("force", [None, "a", [1, 2], {}, np.nan, [None] * 3, np.zeros((3, 1)), [[1, 2, 3]]])
def test_a_force_that_is_none(balls, force):
    simulation, batch = hs.Simulation(balls), hs.Batch(balls, 2)
    for call in (simulation.step, batch.step):
        with pytest.raises(hs.Error, match=r"forces.high: got .*need shape \("):
            call(forces={"high": force})
    with pytest.raises(hs.Error, match="forces: got list, need a mapping"):
        simulation.step(forces=[1, 2])
    with pytest.raises(hs.Error, match=r"q: got shape \(\), dtype object"):
        batch._core.set("q", None)


# Oracle: Python's word for what cannot be made; a copy and a pickle are equal to the bit.
def test_objects_of_the_module_have_their_content(balls):
    kinds = [each for each in vars(_core).values() if isinstance(each, type)]
    assert {each.__name__ for each in kinds} >= {"Scene", "Simulation", "Batch", "Snapshot", "Motion", "Frame", "Video"}
    for kind in kinds:
        for make in (lambda: kind(), lambda: kind.__new__(kind), lambda: object.__new__(kind),
                     lambda: kind.__base__.__new__(kind), lambda: type("Own", (kind,), {})()):
            with pytest.raises(TypeError):
                make()
    simulation = hs.Simulation(balls)
    simulation.step(substeps=20)
    for snapshot in (copy.deepcopy(simulation.snapshot()), pickle.loads(pickle.dumps(simulation.snapshot()))):
        other = hs.Simulation(balls)
        other.restore(snapshot)
        assert np.array_equal(other.bodies.velocity, simulation.bodies.velocity)
    data = simulation.snapshot().__reduce__()[1][0]
    for text in (b"", data[:-1], data[:100] + b"x" + data[101:]):
        with pytest.raises(hs.Error, match="snapshot"):
            _core.snapshot(text)


@pytest.mark.parametrize("seeds", [[-1, 1], [1.5, 1], [np.nan, 1], [1], [[1, 2]], ["a", "b"], [2**64, 1], [True, False], 3])
def test_seeds_are_whole_numbers(balls, seeds):
    batch = hs.Batch(balls, 2)
    with pytest.raises(hs.Error, match=r"seeds: got .*, need shape \(2,\), integers of 0 or more"):
        batch.reset(seeds=seeds)
    batch.reset(seeds=np.array([2**64 - 1, 0], np.uint64))
    batch.reset(seeds=np.array([5, 0], np.int8))


@pytest.mark.parametrize("name, value", [
    (name, value) for name in ("seed", "n", "threads", "substeps", "environment", "reset")
    for value in (-1, 1.5, np.nan, "1", None if name != "reset" else "a", 2**64)])
def test_whole_numbers_are_refused_by_name(balls, name, value):
    batch = hs.Batch(balls, 2)
    calls = {"seed": lambda: hs.Batch(balls, 2, seed=value), "n": lambda: hs.Batch(balls, value),
             "threads": lambda: hs.Batch(balls, 2, threads=value), "substeps": lambda: batch.step(substeps=value),
             "environment": lambda: batch.frame(value), "reset": lambda: batch.reset(seed=value)}
    with pytest.raises(hs.Error, match=f"{'seed' if name == 'reset' else name}: got .*, need a whole number, "):
        calls[name]()


@pytest.mark.parametrize("spec, need", [
    (("uniform", 1, 0), "finite bounds, the lower one first"), (("normal", 0, -1), "a deviation of 0 or more"),
    (("log_uniform", 0, 1), "finite bounds above 0"), (("uniform", np.nan, 1), "a finite number"),
    (("uniform", "a", 1), "a finite number"), (("normal", 1e400, 1), "a finite number"), (("triangle", 0, 1), "uniform"),
    (("uniform", -1, 1), "above 0 kg"), ("uniform", "uniform.*low, high")])
def test_distributions_are_checked(balls, spec, need):
    with pytest.raises(hs.Error, match=rf"objects.0.mass: got .*, need .*{need}"):
        hs.Batch(balls, 2, randomise={"objects.0.mass": spec})


# Oracle: the same scene from texts.
def test_a_mapping_may_have_paths_and_arrays():
    data = hs.data_path()
    scene = {"title": "a hand", "duration": 1, "effects": ["gravity", "joint_stops"],
             "hands": [{"model": data / "handmodels" / "anatomical.yaml", "person": data / "config/persons/median_man.yaml",
                        "side": "right", "wrist": {"mount": "fixed", "position": np.array([0, 0, 0.2])}}]}
    by_text = {**scene, "hands": [{**scene["hands"][0], "model": str(scene["hands"][0]["model"]),
                                   "person": str(scene["hands"][0]["person"]),
                                   "wrist": {"mount": "fixed", "position": [0.0, 0.0, 0.2]}}]}
    assert hs.load(scene).resolved == hs.load(by_text).resolved
    assert hs.load(scene, {"hands.0.person": pathlib.Path(data / "config/persons/median_man.yaml")}).bodies
    for wrong in ({**scene, "title": {1, 2}}, {**scene, ("a", 1): 2}):
        with pytest.raises(hs.Error, match="scene: got "):
            hs.load(wrong)


# A call from within a call of the same object would wait for itself.
def test_a_signal_handler_may_not_use_its_simulation(two_hands):
    import signal

    simulation = hs.Simulation(two_hands)
    previous = signal.signal(signal.SIGALRM, lambda *_: simulation.bodies)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(hs.Error, match="call: got a call from within another one"):
            while True:
                simulation.step(substeps=1_000_000)
    finally:
        signal.signal(signal.SIGALRM, previous)
    assert 0 < simulation.steps and simulation.bodies.position.shape[1] == 3
