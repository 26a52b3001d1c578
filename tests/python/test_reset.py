"""Resets: every one gives the bits of a new simulation, whatever happened before it."""
import numpy as np
import pytest

import handsim as hs

METHODS = [("ode", "world_step"), ("ode", "quick_step"), ("articulated", "semi_implicit_euler"),
           ("articulated", "rk4"), ("articulated", "dormand_prince"), ("dae", "stabilised_gear"),
           ("dae", "lagrange_penalty"), ("dae", "euler_linearised"), ("dae", "euler_projected")]


def motion_of(simulation):
    """All that moves, as one list of numbers."""
    parts = [simulation.q, simulation.u, simulation.tau, *simulation.bodies, [simulation.time, simulation.steps]]
    return np.concatenate([np.ravel(part) for part in parts])


def loaded(name, engine, method):
    try:
        scene = hs.load(name, {"solver.method": method}, engine=engine)
        return scene, hs.Simulation(scene)
    except hs.Error:  # a study, or a scene that the method does not run
        return None


def disturb(simulation, random):
    """Torques, forces, a snapshot, errors: what an engine refuses of these changes nothing."""
    scene = simulation.scene
    some = {scene.bodies[-1]: random.normal(size=6) * 1e-3}
    for action in ({"torques": random.normal(size=len(scene.coordinates)) * 1e-3}, {"forces": some},
                   {"targets": np.full(len(scene.axes), 0.1)}):
        try:
            simulation.step(**action, substeps=4)
        except hs.Error as error:
            assert error.kind == "input"
    snapshot = simulation.snapshot()
    simulation.step(substeps=5)
    simulation.restore(snapshot)
    with pytest.raises(hs.Error):
        simulation.step(np.full(len(scene.coordinates) + 1, np.nan))


# Oracle: a simulation that is new.
@pytest.mark.parametrize("engine, method", METHODS)
def test_a_reset_has_the_bits_of_a_new_simulation(engine, method):
    random = np.random.default_rng(1)
    scenes = 0
    for name in hs.scenes():
        if method == "stabilised_gear" and ("100" in name or "redundant" in name):
            continue  # takes half a minute
        pair = loaded(name, engine, method)
        if pair is None:
            continue
        scene, simulation = pair
        new = hs.Simulation(scene)
        start = motion_of(new)
        try:
            new.step(substeps=20)
            end = motion_of(new)
            disturb(simulation, random)
            simulation.reset()
            assert np.array_equal(motion_of(simulation), start), name
            simulation.step(substeps=20)
            assert np.array_equal(motion_of(simulation), end), name
            # The same to coordinates: those of the end.
            turned = end[:len(scene.coordinates)]
            other = hs.Simulation(scene)
            for each in (simulation, other):
                each.reset(q=turned)
                each.step(substeps=5)
            assert np.array_equal(motion_of(simulation), motion_of(other)), name
        except hs.Error as error:
            # Method rk4 and such cannot start everywhere; what is refused is said.
            assert error.problems or error.fault, name
            continue
        scenes += 1
    assert scenes >= (40 if engine == "ode" or method == "semi_implicit_euler" else 4)


# Oracle: a new simulation; muscles by static optimisation, which starts from its last solution, are in another place
# after 0.4 s.
@pytest.mark.parametrize("engine", ["ode", "articulated"])
def test_muscles_begin_anew(engine):
    scene = hs.load("muscle_poses", engine=engine)
    first, again = hs.Simulation(scene), hs.Simulation(scene)
    again.step(substeps=400)
    again.reset()
    first.step(substeps=300)
    again.step(substeps=300)
    assert np.array_equal(motion_of(first), motion_of(again))
    snapshot, motion = first.snapshot(), first.motion()
    first.step(substeps=100)
    for back in (lambda: again.restore(snapshot), lambda: again.reset(motion)):
        back()
        again.step(substeps=100)
        assert np.array_equal(motion_of(first), motion_of(again))


# Oracle: a new simulation; 1e8 N on 0.2 kg exceed the engines' bound of 1 km/s.
@pytest.mark.parametrize("engine, method", METHODS[:3])
def test_a_motion_that_diverged_can_be_reset(balls, engine, method):
    scene = hs.load(balls_of(balls), {"solver.method": method}, engine=engine)
    simulation, new = hs.Simulation(scene), hs.Simulation(scene)
    simulation.step(substeps=3)
    snapshot, motion = simulation.snapshot(), simulation.motion()
    new.step(substeps=3)
    third = motion_of(new)
    new.step(substeps=20)
    for back in (simulation.reset, lambda: simulation.reset(motion), lambda: simulation.restore(snapshot)):
        with pytest.raises(hs.Error, match="speed") as caught:
            simulation.step(forces={"high": [1e8, 0, 0]}, substeps=20)
        assert caught.value.kind == "physics"
        with pytest.raises(hs.Error, match="speed"):
            simulation.step()
        back()
        if simulation.steps == 0:
            simulation.step(substeps=3)
        assert np.array_equal(motion_of(simulation), third)
        simulation.step(substeps=20)
        assert np.array_equal(motion_of(simulation), motion_of(new))


def balls_of(balls):
    from conftest import BALLS

    return BALLS


# Oracle: a new batch with the same seeds, alone; positions are drawn, which moved by differences would not return to
# the bit.
@pytest.mark.parametrize("name, randomise", [
    ("grasp_power_can", {"objects.0.position": ("normal", 0.2, 0.01), "objects.0.mass": ("uniform", 0.1, 0.5),
                         "gains": ("log_uniform", 0.5, 2)}),
    ("two_hands", {"q": ("uniform", 0, 0.1), "gravity": ("normal", 0, 5)})])
@pytest.mark.parametrize("engine", ["ode", "articulated"])
def test_a_batch_goes_back_to_the_bit(name, randomise, engine):
    scene = hs.load(name, {"objects.0.overlap": "allowed"} if "can" in name else None, engine=engine)
    used, new = (hs.Batch(scene, 9, randomise=randomise, seed=seed) for seed in (1, 2))
    rows = len(scene.coordinates)
    for _ in range(3):
        used.step(np.full((9, rows), 1e-3), forces={scene.bodies[-1]: np.full((9, 3), 1e-3)}, substeps=4)
        used.reset()
    with pytest.raises(hs.Error):
        used.step(np.full((9, rows), np.nan))
    used.step(substeps=4)
    for batch in (used, new):
        batch.reset(seeds=np.arange(9))
    assert np.array_equal(used.observation, new.observation)
    for batch in (used, new):
        batch.step(substeps=20)
    assert np.array_equal(used.observation, new.observation)


def test_coordinates_out_of_range_are_refused(two_hands):
    simulation = hs.Simulation(two_hands)
    simulation.step(substeps=5)
    before = motion_of(simulation)
    with pytest.raises(hs.Error, match=r"q\.right\.thumb_cmc\.flexion: got 10, need .* rad, within its stops") as caught:
        simulation.reset(q=np.full(40, 10.0))
    assert len(caught.value.problems) == 40
    q = np.zeros(40)
    q[3] = np.nan
    with pytest.raises(hs.Error, match="got nan, need"):
        simulation.reset(q=q)
    with pytest.raises(hs.Error, match=r"u\..*: got inf, need a finite number"):
        simulation.reset(u=np.full(40, np.inf))
    with pytest.raises(hs.Error, match="to: got a motion beside q, u or objects"):
        simulation.reset(simulation.motion(), q=np.zeros(40))
    assert np.array_equal(motion_of(simulation), before)
    free = hs.load("stability/swinging_hand", engine="articulated")
    with pytest.raises(hs.Error, match=r"got 10, need -3.142 to 3.142 rad$"):
        hs.Simulation(free).reset(q=np.full(len(free.coordinates), 10.0))
    with pytest.raises(hs.Error, match=r"q\..*: got 10.*within its stops"):
        hs.Batch(two_hands, 2, randomise={"q": ("uniform", 0, 10)})


# Oracle: a finger pressed on its stop is a little beyond it; its own coordinates are no error.
def test_the_coordinates_of_a_run_are_a_start():
    scene = hs.load("stability/limp_prototype", engine="ode")
    simulation, other = hs.Simulation(scene), hs.Simulation(scene)
    beyond = 0.0
    for _ in range(40):
        simulation.step(substeps=10)
        low, high = scene.limits.T
        beyond = max(beyond, np.max(np.maximum(low - simulation.q, simulation.q - high)))
        other.reset(q=simulation.q)
        assert other.q == pytest.approx(simulation.q, abs=1e-9)
    assert beyond > 1e-3
