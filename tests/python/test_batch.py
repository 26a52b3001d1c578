"""Batches: views without copies, resets, draws, actions."""
import gc
import resource
import shutil
import weakref

import numpy as np
import pytest

import handsim as hs


# Oracle: a simulation alone with the same torques, to the bit.
def test_every_environment_moves_as_a_simulation(two_hands):
    torques = np.random.default_rng(1).uniform(-0.01, 0.01, (5, 40))
    batch = hs.Batch(two_hands, 5)
    for _ in range(3):
        batch.step(torques, substeps=10)
    for i in range(5):
        alone = hs.Simulation(two_hands, contact_forces=False)
        alone.step(torques[i], substeps=30)
        assert np.array_equal(batch.q[i], alone.q) and np.array_equal(batch.u[i], alone.u)


# Oracle: a simulation of the other person's scene, to the bit; the others stay as they were.
def test_an_environment_becomes_one_of_another_person():
    of = lambda person: hs.load("two_hands", {f"hands.{side}.person": person for side in (0, 1)}, engine="articulated")
    first, *others = [of(person) for person in hs.draw_persons(3, seed=4)]
    batch = hs.Batch(first, 9)
    for i in range(8):
        batch.replace(i, others[i % 2])
    batch.step(substeps=30)
    expected = [hs.Simulation(scene, contact_forces=False) for scene in (*others, first)]
    for each in expected:
        each.step(substeps=30)
    assert len({each.q.tobytes() for each in expected}) == 3
    for i in range(9):
        which = 2 if i == 8 else i % 2
        assert np.array_equal(batch.q[i], expected[which].q) and batch.scene_of(i) is expected[which].scene
    batch.replace(0, first)
    batch.reset()
    batch.step(substeps=30)
    assert np.array_equal(batch.q[0], expected[2].q) and np.array_equal(batch.q[1], expected[1].q)
    for name, changes in (("dropped_hand", {}), ("two_hands", {"solver.step": "2 ms"})):
        with pytest.raises(hs.Error, match="scene: got .*, need bodies, joints, axes, muscles, wrists, engine and step of the batch's"):
            batch.replace(1, hs.load(name, changes, engine="articulated"))


MOTORS = ["gravity", "joint_stops", "passive_tissue", "actuation"]
MUSCLES = ["gravity", "joint_stops", "passive_tissue", "muscles", "tendon_coupling"]
TOUCH = ["gravity", "object_contact", "ground_contact", "friction", "joint_stops", "passive_tissue", "actuation"]


def less(effects, *names):
    return {"effects": [effect for effect in effects if effect not in names]}


def model_with_few_bands(folder):
    models = shutil.copytree(hs.data_path() / "handmodels", folder / "handmodels")
    rows = (models / "muscles.yaml").read_text().splitlines()
    (models / "muscles.yaml").write_text("\n".join(row for row in rows if "{name: quadriga" not in row))
    return str(models / "anatomical.yaml")


def mixtures(folder):
    """Scenes that may share a batch, by what they have in common, and the action of all."""
    controllers = [{"control.controller": str(hs.data_path() / f"controllers/{name}.yaml")}
                   for name in ("explicit", "feed_forward", "integral", "muscles")]
    hand = {"model": str(hs.data_path() / "handmodels/anatomical.yaml"), "person": str(hs.data_path() / "config/persons/median_man.yaml"),
            "side": "right", "wrist": {"mount": "fixed", "position": [0, 0, 0.2]}}
    pulled = {"hands": [hand], "duration": "1 s", "solver": {"engine": "articulated", "step": "1 ms"}, **less(MUSCLES)}
    return {
        # Fingers close to fists.
        "motors": ("every_pose", {"targets": 1.7}, [
            less(MOTORS), *(less(MOTORS, effect) for effect in MOTORS[:3]), less([*MOTORS, "self_contact"]),
            less([*MOTORS, "self_contact", "friction"]), less([*MOTORS, "tendon_coupling"]), *controllers, {"gravity": [0, 3, 0]}]),
        "muscles": (pulled, {"excitations": 0.4}, [
            {}, *(less(MUSCLES, effect) for effect in ("tendon_coupling", "gravity", "joint_stops", "passive_tissue")),
            less([*MUSCLES, "self_contact"]), {"hands.0.model": model_with_few_bands(folder)}, {"hands.0.tendon_strain": 0.05},
            {"hands.0.strength": 0.5}]),
        # Three fingers hold a pen.
        "touch": ("pen", {}, [
            {}, *(less(TOUCH, effect) for effect in ("gravity", "friction", "passive_tissue")),
            {**less(TOUCH, "object_contact"), "contacts.rules": [{"between": ["objects", "ground"], "material": "paper"}]},
            {"objects.0.mass": "50 g"}, {"control.controller.gravity_compensation": False},
            {"control.controller.feed_forward": True}])}


# Oracle: a simulation of its own scene, to the bit, whichever scene the batch was made of and has beside it.
@pytest.mark.parametrize("engine", ["articulated", "ode"])
@pytest.mark.parametrize("kind", ["motors", "muscles", "touch"])
def test_scenes_that_share_a_batch_do_not_mix(kind, engine, tmp_path):
    name, action, changes = mixtures(tmp_path)[kind]
    scenes = [hs.load(name, each, engine=engine) for each in changes]
    rows = {key: np.full(len(scenes[0].muscles) if key == "excitations" else len(scenes[0].axes), value) for key, value in action.items()}
    alone = [hs.Simulation(scene, contact_forces=False) for scene in scenes]
    for each in alone:
        each.step(**rows, substeps=60)
        each.step(**rows, substeps=60)
    ends = [each.q.tobytes() + each.u.tobytes() for each in alone]
    assert len(set(ends)) == len(scenes)
    for first in scenes:
        batch = hs.Batch(first, 2 * len(scenes))
        for i in range(len(batch)):
            batch.replace(i, scenes[i % len(scenes)])
        for _ in range(2):
            batch.step(**{key: np.tile(row, (len(batch), 1)) for key, row in rows.items()}, substeps=60)
        assert [batch.q[i].tobytes() + batch.u[i].tobytes() for i in range(len(batch))] == 2 * ends


# Oracle: a batch of that scene with the same seeds, to the bit: nothing that another environment drew stays in the scene.
def test_a_replaced_environment_draws_as_one_of_its_scene():
    draws = {"gains": ("uniform", 0.5, 2)}
    of = lambda person: hs.load("pose_tracking", {"hands.0.person": person, "hands.1.person": person}, engine="articulated")
    first, other = map(of, hs.draw_persons(2))
    batch, alone = hs.Batch(first, 3, randomise=draws), hs.Batch(other, 3, randomise=draws)
    for i in (0, 2):
        batch.replace(i, other)
    for each in (batch, alone):
        each.reset(seeds=[5, 6, 7])
        each.step(substeps=20)
    assert np.array_equal(batch.get("gains")[[0, 2]], alone.get("gains")[[0, 2]])
    assert np.array_equal(batch.q[[0, 2]], alone.q[[0, 2]]) and not np.array_equal(batch.q[1], alone.q[1])


# Oracle: the survey's means; person k is the same whatever the number.
def test_persons_are_drawn_from_the_survey():
    persons = hs.draw_persons(400, seed=2)
    assert hs.draw_persons(3, seed=2) == persons[:3] != hs.draw_persons(3, seed=3)
    men = [each["stature"] for each in persons if each["sex"] == "male"]
    assert 150 < len(men) < 250 and np.mean(men) == pytest.approx(1.756, abs=0.015)
    assert hs.Hand(**persons[0]).scene.hands == ["right"]
    with pytest.raises(hs.Error, match="population: got mars, need ansur2"):
        hs.draw_persons(1, population="mars")


# Oracle: numpy's own word on memory: no array owns data, all are in one buffer, whose address stays.
def test_states_are_views_that_stay_where_they_are(two_hands):
    batch = hs.Batch(two_hands, 4, observe=["fingertips", "q"])
    views = [batch.q, batch.u, batch.observation, batch["fingertips"], batch.failed]
    addresses = [view.__array_interface__["data"] for view in views]
    assert not any(view.flags.owndata or view.flags.writeable for view in views)
    assert batch.q.shape == batch.u.shape == (4, 40) and batch["fingertips"].shape == (4, 70)
    assert batch.observation.shape == (4, 110) and len(batch.columns) == 110
    assert np.shares_memory(batch.q, batch.observation) and not np.shares_memory(batch.u, batch.observation)
    before = batch.q.copy()
    batch.step(substeps=20)
    assert not np.array_equal(batch.q, before)
    batch.reset()
    assert np.array_equal(batch.q, before)
    again = [batch.q, batch.u, batch.observation, batch["fingertips"], batch.failed]
    assert [view.__array_interface__["data"] for view in again] == addresses


# Oracle: the values before; the memory of the batch is freed with its last view.
def test_a_view_outlives_its_batch(two_hands):
    batch = hs.Batch(two_hands, 64)
    batch.step(substeps=5)
    q, expected = batch.q[:, 3:7], batch.q[:, 3:7].copy()
    core = weakref.ref(batch)
    del batch
    gc.collect()
    assert core() is None
    others = [hs.Batch(two_hands, 64) for _ in range(2)]
    assert np.array_equal(q, expected) and len(others) == 2


# Oracle: the scene's start for those of the mask, no change for the others.
def test_a_mask_resets_its_environments_only(two_hands):
    batch = hs.Batch(two_hands, 4)
    start = batch.q.copy()
    batch.step(substeps=20)
    moved = batch.q.copy()
    batch.reset(np.array([True, False, True, False]))
    assert np.array_equal(batch.q[[0, 2]], start[[0, 2]]) and np.array_equal(batch.q[[1, 3]], moved[[1, 3]])
    with pytest.raises(hs.Error, match=r"mask: got shape \(4,\), dtype int64, need shape \(4,\), dtype bool"):
        batch.reset(np.array([1, 0, 1, 0]))


# Oracle: bounds of the distribution, the seed alone, and the mean and variance of a uniform distribution within four
# standard errors.
def test_draws_are_a_function_of_the_seed(can):
    def masses(n, seed):
        return hs.Batch(can, n, randomise={"objects.0.mass": ("uniform", 0.1, 0.5)}, seed=seed).get("objects.0.mass")[:, 0]

    some = masses(200, 1)
    assert np.array_equal(some[:20], masses(20, 1)) and not np.array_equal(some[:20], masses(20, 2))
    assert some.min() >= 0.1 and some.max() <= 0.5
    assert some.mean() == pytest.approx(0.3, abs=4 * 0.4 / np.sqrt(12 * 200))
    batch = hs.Batch(can, 4, randomise={"objects.0.mass": ("uniform", 0.1, 0.5)}, seed=1)
    first = batch.get("objects.0.mass").copy()
    batch.reset(np.array([True, False, False, False]))
    second = batch.get("objects.0.mass")
    assert second[0] != first[0] and np.array_equal(second[1:], first[1:])
    batch.reset(seed=1)
    assert np.array_equal(batch.get("objects.0.mass"), first)
    batch.reset(seeds=[7, 7, 7, 8])
    same = batch.get("objects.0.mass")[:, 0]
    assert same[0] == same[1] == same[2] != same[3]
    with pytest.raises(hs.Error, match="randomise.objects.0.mass"):
        hs.Batch(can, 4, randomise={"objects.0.mass": 0.3})


# Oracle: the values set, from the next reset on.
def test_numbers_can_be_set_one_by_one(can):
    batch = hs.Batch(can, 3)
    batch.set("objects.0.mass", [0.2, 0.3, 0.4])
    batch.set("gravity", np.tile([0, 0, -1.62], (3, 1)))
    batch.reset()
    assert batch.get("objects.0.mass")[:, 0].tolist() == [0.2, 0.3, 0.4]
    assert batch.get("gravity").shape == (3, 3)
    with pytest.raises(hs.Error, match="objects.0.mass: got -1 kg, need above 0 kg"):
        batch.set("objects.0.mass", [0.5, -1, 0.5])
    assert batch.get("objects.0.mass")[:, 0].tolist() == [0.2, 0.3, 0.4]


# Oracle: F = m a of a free ball, each environment with a force of its own.
def test_forces_have_a_row_for_each_environment(balls):
    batch = hs.Batch(balls, 3, observe=["objects"])
    forces = np.array([[0.1, 0, 0], [0.2, 0, 0], [0, 0.3, 0]])
    batch.step(forces={"high": forces}, substeps=100)
    velocity = batch["objects"][:, 13 + 7:13 + 10]
    assert velocity == pytest.approx(0.1 * (forces / 0.2 + [0, 0, -9.80665]), rel=1e-9)
    with pytest.raises(hs.Error, match=r"forces.high: got shape \(3,\), dtype float64, need shape \(3, 3\)"):
        batch.step(forces={"high": [0.0, 0, 1]})


# Oracle: the motion of the simulation that it is of, to the bit, with the mask's environments alone.
def test_a_reset_goes_to_a_motion(can):
    simulation = hs.Simulation(can)
    simulation.step(substeps=200)
    batch = hs.Batch(can, 3)
    start = batch.q.copy()
    batch.reset(np.array([False, True, True]), to=simulation.motion())
    assert np.array_equal(batch.q[0], start[0]) and np.array_equal(batch.q[1], simulation.q)
    simulation.step(substeps=50)
    batch.step(substeps=50)
    assert np.array_equal(batch.q[2], simulation.q)
    moved = batch.motion(2)
    batch.reset(to=moved)
    assert np.array_equal(batch.q[0], simulation.q)
    with pytest.raises(hs.Error):
        batch.reset(to=hs.Simulation("two_hands").motion())


# Oracle: one call of 40 substeps, whatever parts it is cut into, and four calls of 10.
def test_parts_of_a_step_have_the_same_bits(can):
    targets = np.tile(can.limits[can.axis_coordinates].mean(axis=1), (2, 1))
    whole, parts = hs.Batch(can, 2), hs.Batch(can, 2)
    whole.step(targets=targets, substeps=40)
    for _ in range(4):
        parts.step(targets=targets, substeps=10)
    assert np.array_equal(whole.q, parts.q) and np.array_equal(whole.u, parts.u)


# Oracle: 1e8 N on 0.2 kg exceed the engines' bound of 1 km/s in the first step; the others go on as without.
def test_a_motion_that_diverges_marks_its_environment(balls):
    batch, good = hs.Batch(balls, 3, observe=["objects"]), hs.Batch(balls, 1, observe=["objects"])
    forces = np.zeros((3, 3))
    forces[1, 0] = 1e8
    batch.step(forces={"high": forces}, substeps=20)
    good.step(substeps=20)
    assert batch.failed.tolist() == [False, True, False]
    assert batch.failure(0) is None and "high" in batch.failure(1) and "speed" in batch.failure(1)
    assert np.array_equal(batch["objects"][2], good["objects"][0])
    batch.reset(batch.failed)
    good.reset()
    assert not batch.failed.any() and np.array_equal(batch["objects"][1], good["objects"][0])


def test_what_there_is_not_is_an_error(two_hands):
    with pytest.raises(hs.Error, match="n: got 0"):
        hs.Batch(two_hands, 0)
    with pytest.raises(hs.Error, match="toes"):
        hs.Batch(two_hands, 2, observe=["toes"])
    with pytest.raises(hs.Error, match="part: got objects, need one of q, u"):
        hs.Batch(two_hands, 2)["objects"]
    with pytest.raises(hs.Error, match=r"targets: got shape \(2, 40\), dtype float64, need shape \(2, 0\)"):
        hs.Batch(two_hands, 2).step(targets=np.zeros((2, 40)))


# Oracle: the largest memory of the process after 2,000 resets; 10,000 more need less than a byte and a half each more
# (16 kB of slack for the heap). An array or dict that is lost has 48 bytes or more.
def test_ten_thousand_resets_do_not_leak(can):
    batch = hs.Batch(can, 4, randomise={"objects.0.mass": ("uniform", 0.1, 0.5)}, threads=1)
    motion = hs.Simulation(can).motion()
    zeros = np.zeros((4, 20))

    def resets(count):
        for k in range(count):
            batch.reset(np.array([True, False, True, k % 2 == 0]), to=motion if k % 3 == 0 else None)
            batch.step(zeros, targets=np.zeros((4, 20)), forces={"can": np.zeros((4, 3))})
            if k % 100 == 0:
                batch.frame(0), batch.motion(1), batch.get("objects.0.mass")

    resets(2000)
    gc.collect()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    resets(10_000)
    gc.collect()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before <= 32
