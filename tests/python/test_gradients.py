"""Derivatives of steps and their products over runs: against differences and each other."""
import handsim as hs
import numpy as np
import pytest

ARTICULATED = {"solver": "{engine: articulated}"}


@pytest.fixture(scope="module")
def pinch():
    """A card held by two fingers."""
    sim = hs.Simulation("grasp_pinch", ARTICULATED)
    sim.step(substeps=2500)
    return sim, sim.motion()


@pytest.fixture
def held(pinch):
    sim, motion = pinch
    sim.reset(motion)
    return sim


def ends(sim, actions, kind):
    for action in actions:
        hs._derivatives.exact_step(sim, {kind: action})
    return np.concatenate([sim.q, sim.u])


def test_a_simulation_stays_unless_it_is_to_advance(held):
    q, time = held.q.copy(), held.time
    found = held.derivatives()
    assert held.time == time and (held.q == q).all()
    assert found.state.shape == (len(found.names),) * 2
    held.derivatives(advance=True)
    assert held.time > time


def test_a_step_after_derivatives_has_the_bits_of_one_without(held):
    held.step(substeps=5)
    there = held.q.copy()
    held.reset()
    held.step(substeps=2500)
    held.derivatives()
    held.step(substeps=5)
    assert (held.q == there).all()


def test_names_are_those_of_the_coordinates_and_the_free_body(held):
    names = held.derivatives().names
    n = len(names) // 2
    assert names[:len(held.scene.coordinates)] == held.scene.coordinates
    assert names[n - 6:n] == [f"card.{kind}.{axis}" for kind in ("turn", "shift") for axis in "xyz"]
    assert names[n] == f"d({names[0]})/dt"


HAND = {"hands": [{"model": str(hs.data_path() / "handmodels" / "anatomical.yaml"),
                   "person": {"stature": 1.755, "mass": 78.4, "sex": "male"}, "side": "right",
                   "wrist": {"mount": "fixed", "position": [0, 0, 0]}}],
        "effects": ["gravity", "passive_tissue"], "solver": {"engine": "articulated", "step": 1e-3}, "duration": 1}


def test_by_gravity_as_scenes_with_another_one_say():
    sim = hs.Simulation(HAND)
    sim.step(substeps=2)
    by = sim.parameters({"gravity": None})
    assert by.names == ["gravity.x", "gravity.y", "gravity.z"]
    np.testing.assert_allclose(by.derivatives(), sim.derivatives().gravity, rtol=1e-7, atol=1e-11)


def test_by_the_mass_of_what_is_held_as_a_force_on_it_says(held):
    found = held.parameters({"objects.0.mass": None}).derivatives()
    assert found.shape == (len(held.derivatives().names), 1)
    # A resting card of more mass is a card under more weight; the compliance of contacts depends on masses by 1e-5.
    weight = held.derivatives(bodies=["card"]).forces["card"][:, 2] * -9.80665
    assert np.abs(found[:, 0] - weight).max() < 1e-2 * np.abs(weight).max()


@pytest.fixture
def relaxing():
    """The card between pads that stiffen and relax, in the middle of their relaxation."""
    pad = hs.data_path() / "handmodels" / "stiffening_pad.yaml"
    sim = hs.Simulation("grasp_pinch", {**ARTICULATED, "contacts.materials": f"[{{name: pad, file: {pad}}}]"})
    sim.step(substeps=2500)
    return sim


def test_a_step_of_pads_that_relax_as_steps_from_states_beside_it(relaxing):
    """What is left of their pressing is as it was at the start of the step, which a note says."""
    before = relaxing.motion()
    exact = relaxing.derivatives()
    assert any("pads that relax" in note for note in exact.notes)
    change, n = np.random.default_rng(3).normal(size=len(exact.names)), len(exact.names) // 2
    change *= np.repeat([1e-8, 1e-5], n)
    ends = []
    for sign in (1, -1):
        relaxing.reset(before)
        relaxing._core.reset_beside(relaxing._core, sign * change)
        hs._derivatives.exact_step(relaxing, {})
        ends.append(hs._derivatives._end(relaxing, [relaxing.scene.bodies.index("card")]))
    found, want = 0.5 * ends[0].against(ends[1]), exact.state @ change
    for part in (slice(0, n), slice(n, None)):
        np.testing.assert_allclose(found[part], want[part], atol=1e-4 * np.abs(want[part]).max())


def test_by_mass_with_pads_that_relax_as_a_force_on_it_says(relaxing):
    found = relaxing.parameters({"objects.0.mass": None}).derivatives()[:, 0]
    weight = relaxing.derivatives(bodies=["card"]).forces["card"][:, 2] * -9.80665
    assert np.abs(found - weight).max() < 1e-2 * np.abs(weight).max()


def test_by_stature_as_differences_of_scenes_that_are_compiled_anew():
    sim = hs.Simulation(HAND)
    found = sim.parameters({"hands.0.person.stature": 1.755}).derivatives()[:, 0]
    change = 1e-4
    sides = []
    for stature in (1.755 - change, 1.755 + change):
        other = hs.Simulation(HAND, {"hands.0.person.stature": stature})
        other.step()
        sides.append(np.concatenate([other.q, other.u]))
    np.testing.assert_allclose(found, (sides[1] - sides[0]) / (2 * change), rtol=1e-5, atol=1e-9)


def test_identify_finds_the_friction_of_a_recording_within_its_interval():
    from handsim.identify import identify

    scene = {"objects": [{"name": "block", "shape": "box", "edges": [0.04, 0.05, 0.03], "mass": 0.2,
                          "position": [0, 0, 0.01499], "friction": 0.2}],
             "ground": {"friction": 0.2}, "gravity": [4, 0, -8], "effects": ["gravity", "ground_contact", "friction"],
             "solver": {"engine": "articulated", "step": 1e-3}, "duration": 1}
    sim, place = hs.Simulation(scene), []
    for _ in range(150):
        sim.step()
        place.append(sim.bodies.position[1, 0])
    noisy = np.array(place) + 1e-4 * np.random.default_rng(0).normal(size=150)
    found = identify(scene, {"objects.0.friction": 0.3}, np.zeros((150, 0)), {"block.shift.x": noisy}, deviation=1e-4,
                     kind="torques")
    assert abs(found.values[0] - 0.2) < 1.5 * found.interval[0] < 0.004
    assert 0.8 < found.residual < 1.2
    with pytest.raises(hs.Error, match="recorded: got 'nose'"):
        identify(scene, {"objects.0.friction": 0.3}, np.zeros((150, 0)), {"nose": noisy}, deviation=1e-4, kind="torques")


def test_products_of_a_run_are_those_of_differences_and_of_each_other(held):
    random = np.random.default_rng(1)
    actions = 1e-3 * random.normal(size=(7, len(held.q)))
    run = hs.Rollout(held, actions, every=3)
    size = 2 * len(held.q) + 12
    end, change = random.normal(size=size), random.normal(size=actions.shape)
    start = 1e-3 * random.normal(size=size)
    back = run.vjp(end)
    ahead = run.jvp(start, change)
    assert len(ahead) == len(run) == 7 and "3 motions" in run.memory
    np.testing.assert_allclose(end @ ahead[-1], back.start @ start + (back.action * change).sum(), rtol=1e-9)
    # By differences of whole runs, in the joints' coordinates.
    by, rows = 1e-4, len(held.q)
    sides = []
    for sign in (1, -1):
        held.reset(run.motions[0])
        sides.append(ends(held, actions + sign * by * change, "torques"))
    along = run.jvp(actions=change)[-1]
    joints = np.concatenate([along[:rows], along[rows + 6:2 * rows + 6]])
    np.testing.assert_allclose((sides[0] - sides[1]) / (2 * by), joints, rtol=1e-4, atol=1e-7)


def test_products_of_a_batch_are_those_of_its_environments(held):
    batch = hs.Batch(held.scene, 2, threads=2)
    batch.step()
    actions = np.zeros((2, 3, len(held.q)))
    end = np.ones((2, 2 * len(held.q) + 12))
    both = batch.vjp(actions, end)
    held.reset(batch.motion(1))
    one = hs.Rollout(held, actions[1]).vjp(end[1])
    np.testing.assert_array_equal(both[1].start, one.start)
    np.testing.assert_array_equal(both[1].action, one.action)
    assert batch.jvp(actions, changes=actions + 1).shape == (2, 3, 2 * len(held.q) + 12)


@pytest.mark.parametrize("scene, changes, got", [
    ("grasp_pinch", None, "engine: ODE"),
    ("slider_crank_iftomm", {"solver": "{engine: articulated, step: 1 ms}"}, "closed loops"),
    ("dropped_hand", ARTICULATED, "free hand"),
    ("muscle_poses", None, "static optimisation"),
])
def test_what_has_no_derivatives_is_refused_by_name(scene, changes, got):
    with pytest.raises(hs.Error, match=got) as caught:
        hs.Simulation(scene, changes).derivatives()
    assert caught.value.kind == "input"


def test_wrong_arguments_say_what_is_needed(held):
    with pytest.raises(hs.Error, match="bodies: got nose, need "):
        held.derivatives(bodies=["nose"])
    with pytest.raises(hs.Error, match="kind: got 'force'"):
        hs.Rollout(held, np.zeros((1, 2)), "force")
    with pytest.raises(hs.Error, match="actions: got shape"):
        hs.Rollout(held, np.zeros(3))
    with pytest.raises(hs.Error, match="need the value that the scene has"):
        held.parameters({"hands.0.person.stature": None})


FIVE = 5


# Oracle: the argument's name, whatever it is.
@pytest.mark.parametrize("strange", [None, "a", b"a", FIVE, np.nan, object(), [[1], [1, 2]], {"a": 1}, np.zeros(3), np.array("a"), [[None]], 1j, 10**400])
def test_strange_values_are_refused_by_name(held, strange):
    sim, batch = held, hs.Batch(held.scene, 2)
    before = sim.motion()
    width = len(sim.q)
    run = hs.Rollout(sim, np.zeros((2, width)))
    sim.reset(before)
    stacked = np.zeros((2, 2, width))
    calls = {"end": lambda: run.vjp(strange), "along": lambda: run.vjp(np.zeros(run.size or run._measured()), strange), "start": lambda: run.jvp(strange),
             "actions": lambda: hs.Rollout(sim, strange), "kind": lambda: hs.Rollout(sim, np.zeros((2, width)), strange), "simulation": lambda: hs.Rollout(strange, np.zeros((2, width))),
             "every": lambda: hs.Rollout(sim, np.zeros((2, width)), every=strange), "numbers": lambda: sim.parameters(strange),
             "objects.0.mass": lambda: sim.parameters({"objects.0.mass": strange}), "parameters": lambda: run.sensitivities(strange),
             "smoothing": lambda: hs.Rollout(sim, np.zeros((2, width)), smoothing=strange), "batch": lambda: batch.vjp(strange, np.zeros((2, 5))),
             "batch end": lambda: batch.vjp(stacked, strange), "batch start": lambda: batch.jvp(stacked, strange), "changes": lambda: batch.jvp(stacked, None, strange),
             "scene": lambda: batch.replace(0, strange), "advance": lambda: sim.derivatives(advance=strange), "bodies": lambda: sim.derivatives(bodies=strange),
             "deviation smoothing": lambda: sim.derivatives(smoothing=hs.Smoothing([10**400, strange]))}
    optional = ("along", "start", "every", "smoothing", "batch start", "changes")
    for name, call in calls.items():
        if strange is None and name in optional or name in ("smoothing", "every") and strange is FIVE:
            continue
        if name == "numbers" and isinstance(strange, dict):
            continue  # its key is named
        if name == "objects.0.mass" and (strange is None or strange is FIVE):
            continue  # None: as set; 5 kg is another mass, of which there are derivatives
        with pytest.raises(hs.Error, match=f"{name.split()[-1]}.*: got|{'actions' if name == 'batch' else name.split()[-1]}: got"):
            call()
    sim.reset(before)
    with pytest.raises(hs.Error, match="those of another simulation"):
        run.sensitivities(hs.Simulation(sim.scene).parameters({"gravity": None}))
