"""Muscles by excitations: one simulation, batches of any split, what they observe and refuse."""
import numpy as np
import pytest

import handsim as hs

PARTS = ("excitation", "activation", "fibre_length", "fibre_speed", "tendon_length", "tendon_force")


def hand(wrist={"mount": "universal", "position": [0, 0, 0.2]}, **changes):
    """A hand on a still palm that only muscles move."""
    scene = {
        "hands": [{"model": str(hs.data_path() / "handmodels/anatomical.yaml"),
                   "person": str(hs.data_path() / "config/persons/median_man.yaml"), "side": "right", "wrist": wrist}],
        "effects": ["gravity", "joint_stops", "passive_tissue", "muscles", "tendon_coupling"],
        "solver": {"engine": "articulated", "step": "1 ms"}, "duration": "1 s"}
    return hs.load({**scene, **changes})


def drawn(n, seed=0):
    return np.random.default_rng(seed).random((n, 41))


# Oracle: the same excitations in the scene's file.
@pytest.mark.parametrize("engine", ["articulated", "ode"])
def test_excitations_are_those_of_a_scene(engine):
    solver = {"engine": engine, "step": "1 ms"}
    row = drawn(1)[0]
    scene = hand(solver=solver)
    given = {"times": [0], **{muscle.name: float(e) for muscle, e in zip(scene.muscles, row)}}
    by_file, by_call = hs.Simulation(hand(solver=solver, excitations=given)), hs.Simulation(scene)
    by_file.step(substeps=100)
    by_call.step(excitations=row, substeps=100)
    assert np.array_equal(by_call.q, by_file.q) and by_call.muscles.activation.max() > 0.9
    assert all(np.array_equal(a, b) for a, b in zip(by_call.muscles, by_file.muscles))


# Oracle: the order of semi-implicit Euler. Fingers reach 60 to 80 rad/s; where what the muscles do in a step was not counted
# as work, a fast finger lost energy at every step size, and no step came closer than 0.24 rad. The steps are half of those that
# this test began with: since DIP joints bend back by 10 deg, the ring finger of seed 3 is farther off at each of them.
@pytest.mark.parametrize("seed", [0, 3])
def test_fast_motion_converges(seed):
    random = np.random.default_rng(seed)
    excitations = random.random(41) * (random.random(41) < 0.3)

    def motion(step):
        held = {"mount": "fixed", "position": [0, 0, 0.2], "rotation": {"axis": [1, 0, 0], "angle": "90 deg"}}
        simulation = hs.Simulation(hand(held, solver={"engine": "articulated", "step": f"{step} s"}))
        out = []
        for _ in range(30):
            simulation.step(excitations=excitations, substeps=round(0.005 / step))
            out.append(simulation.q.copy())
        return np.array(out)

    true = motion(1e-3 / 64)
    errors = [abs(motion(step) - true).max() for step in (5e-4, 2.5e-4, 1.25e-4)]
    assert errors[2] < 0.06
    assert all(a > 1.7 * b for a, b in zip(errors, errors[1:]))


# Oracle: each environment alone.
@pytest.mark.parametrize("strain", [None, 0.049])
def test_a_batch_has_the_bits_of_simulations_in_any_split(strain):
    scene = hand()
    if strain:
        scene = hand(hands=[{"model": str(hs.data_path() / "handmodels/anatomical.yaml"), "tendon_strain": strain,
                             "person": str(hs.data_path() / "config/persons/median_man.yaml"), "side": "right",
                             "wrist": {"mount": "universal", "position": [0, 0, 0.2]}}])
    excitations = [drawn(64, seed) for seed in (1, 2)]
    alone = []
    for i in range(64):
        simulation = hs.Simulation(scene)
        for e in excitations:
            simulation.step(excitations=e[i], substeps=10)
        alone.append(np.concatenate([simulation.q, simulation.u, *simulation.muscles]))
    for size in (1, 7, 64):
        for threads in (1, 2):
            batch = hs.Batch(scene, size, observe=("q", "u", *PARTS), threads=threads)
            for e in excitations:
                batch.step(excitations=e[:size], substeps=10)
            assert np.array_equal(batch.observation, alone[:size]), (size, threads)


def test_a_batch_drives_muscles_as_its_scene_does():
    simulation, batch = hs.Simulation("muscle_poses"), hs.Batch("muscle_poses", 2, observe=("q", "excitation"))
    simulation.step(substeps=30)
    batch.step(substeps=30)
    assert np.array_equal(batch.q[1], simulation.q) and batch["excitation"][1].max() > 0.01
    assert np.array_equal(batch["excitation"][1], simulation.muscles.excitation)


# Oracles: the length of a rigid tendon; the slope of the fibres' length over a small step.
def test_fibres_and_tendons_are_those_of_the_path():
    simulation = hs.Simulation(hand())
    simulation.step(excitations=drawn(1)[0], substeps=50)
    now = simulation.muscles
    slack = np.array([muscle.slack_length for muscle in simulation.scene.muscles])
    short = now.tendon_length > slack + 1e-12  # beyond the shortest fibres, a tendon hangs loose
    assert np.allclose(now.tendon_length[~short], slack[~short], atol=1e-12) and short.sum() < 10
    fine = hs.Simulation(hand(solver={"engine": "articulated", "step": "10 us"}))
    fine.step(excitations=drawn(1)[0], substeps=3000)
    before = fine.muscles.fibre_length
    fine.step(excitations=drawn(1)[0])
    change = (fine.muscles.fibre_length - before) / 1e-5
    assert np.abs(change).max() > 0.1
    assert np.allclose(fine.muscles.fibre_speed, change, atol=2e-3 * np.abs(change).max())


def test_muscles_have_names_groups_and_nerves():
    scene = hand()
    muscles, groups = scene.muscles, scene.muscle_groups
    assert len(muscles) == 41 and muscles[0].name == "right.FDP2" and muscles[0].moves == "index"
    names = {word: {muscles[i].name.partition(".")[2] for i in of} for word, of in groups.items()}
    assert names["right"] == {muscle.name.partition(".")[2] for muscle in muscles}
    assert names["wrist"] == {"FCR", "FCU", "PL", "ECRL", "ECRB", "ECU"}
    assert names["thumb"] == {"FPL", "EPL", "EPB", "APL", "APB", "FPB", "OP", "ADP"}
    assert names["median"] | names["ulnar"] | names["radial"] == names["right"]
    # Gray's Anatomy: the median nerve has the two radial lumbricals and deep flexors, the ulnar nerve the others.
    assert {"LU2", "LU3", "FDP2", "FDP3"} <= names["median"] and {"LU4", "LU5", "FDP4", "FDP5"} <= names["ulnar"]
    assert names["extrinsic"] & names["intrinsic"] == set() and "EPL" in names["extrinsic"] and "OP" in names["intrinsic"]


def test_wrong_excitations_are_refused_by_name():
    simulation, batch = hs.Simulation(hand()), hs.Batch(hand(), 3)
    start = simulation.q.copy()
    for value, need in ((1.1, "got 1.1, need 0 to 1"), (-0.1, "got -0.1, need 0 to 1"), (np.nan, "need 0 to 1")):
        row = np.zeros(41)
        row[2] = value
        with pytest.raises(hs.Error, match=f"excitations.right.FDP4: .*{need}"):
            simulation.step(excitations=row)
        with pytest.raises(hs.Error, match=f"excitations.right.FDP4: .*{need}"):
            batch.step(excitations=np.tile(row, (3, 1)))
    with pytest.raises(hs.Error, match=r"excitations: got shape \(40,\).*, need shape \(41,\)"):
        simulation.step(excitations=np.zeros(40))
    with pytest.raises(hs.Error, match=r"excitations: got shape \(41,\).*, need shape \(3, 41\)"):
        batch.step(excitations=np.zeros(41))
    assert np.array_equal(simulation.q, start)
    with pytest.raises(hs.Error, match="observe: got activation in a scene without muscles"):
        hs.Batch("dropped_hand", 1, observe=["activation"])


def test_a_simulation_takes_objects_and_numbers():
    simulation = hs.Simulation("grasp_pinch")
    place = np.array([[0.3, 0.2, 0.9, 1, 0, 0, 0]])
    simulation.reset(objects=place)
    index = simulation.scene.bodies.index(simulation.scene.objects[0])
    assert np.allclose(simulation.bodies.position[index], place[0, :3])
    mass = simulation.get("objects.0.mass")
    simulation.set("objects.0.mass", 2 * mass)
    assert np.array_equal(simulation.get("objects.0.mass"), 2 * mass)
    simulation.reset()
    twice = hs.Batch("grasp_pinch", 1)
    twice.set("objects.0.mass", 2 * mass)
    twice.reset()
    simulation.step(substeps=200)
    twice.step(substeps=200)
    assert np.array_equal(simulation.q, twice.q[0])
    with pytest.raises(hs.Error, match="vary: got objects.0.size, need one of gravity"):
        simulation.set("objects.0.size", 1)


# Oracle: the same hand alone. The hand that the batch was made of is replaced after it has moved.
def test_a_batch_outlives_the_environment_it_was_made_of():
    scene, n = hand(wrist={"mount": "fixed", "position": [0, 0, 0.2]}), 8
    other = hand(wrist={"mount": "fixed", "position": [0, 0, 0.2]}, title="another")
    batch, rows = hs.Batch(scene, n, threads=1), 0.1 * drawn(n)
    batch.step(excitations=rows, substeps=20)
    batch.replace(0, other)
    batch.step(excitations=rows, substeps=20)
    for i, steps in ((0, 20), (1, 40)):
        alone = hs.Simulation(scene)
        alone.step(excitations=rows[i], substeps=steps)
        assert np.array_equal(batch.q[i], alone.q)


def undone(scene, **motion):
    found = hs.study.inverse(scene, muscles=True, check=False, **motion).summary
    causes = found["undone"]
    weak = sum(causes["beyond_strength"].values())
    assert weak + causes["no_balance"] + causes["faster_than_muscles"] + causes["other"] == pytest.approx(1, abs=1e-9)
    return weak, causes


def test_what_muscles_leave_undone_has_its_causes(tmp_path):
    """Oracles: shares add up to 1; fingers that muscles of a hundredth of their strength cannot lift are beyond that strength, by the muscles that
    extend them over a palm that faces down; noise of 1 deg at each of 100 points a second is what muscles are too slow for."""
    scene = {"hands": [{"model": str(hs.data_path() / "handmodels/anatomical.yaml"), "person": str(hs.data_path() / "config/persons/median_man.yaml"), "side": "right",
                        "wrist": {"mount": "fixed", "position": [0, 0, 0.2]}}],
             "effects": ["gravity", "joint_stops", "passive_tissue", "muscles", "tendon_coupling"], "solver": {"engine": "articulated", "step": 0.001}, "duration": 0.5}
    names, times, random = hs.load(scene).coordinates, np.arange(51) / 100, np.random.default_rng(1)
    bend = 0.6 * np.array([name.endswith("mcp.flexion") and "thumb" not in name for name in names])
    still = np.outer(np.ones(51), 0.1 + bend)

    def table(name, angles):
        np.savetxt(tmp_path / name, np.column_stack([times, angles]), delimiter=",", comments="", header=",".join(["time[s]", *(f"{each}[rad]" for each in names)]))
        return tmp_path / name

    weak, causes = undone({**scene, "hands": [{**scene["hands"][0], "strength": 0.01}]}, motion=table("still.csv", still), cutoff=None)
    strongest = max(causes["beyond_strength"], key=causes["beyond_strength"].get)
    assert weak > 0.5 and strongest.startswith("right.E"), causes
    _, causes = undone(scene, motion=table("noisy.csv", still + np.radians(random.normal(size=still.shape))), cutoff=None)
    assert causes["faster_than_muscles"] > 0.5 > sum(causes["beyond_strength"].values())


def test_torques_beside_an_object_say_that_the_hand_is_empty(tmp_path):
    """Oracle: the line, with the object's name; with its forces there is none."""
    scene = {"hands": [{"model": str(hs.data_path() / "handmodels/anatomical.yaml"), "person": str(hs.data_path() / "config/persons/median_man.yaml"), "side": "right",
                        "wrist": {"mount": "fixed", "position": [0, 0, 0.2]}}], "objects": [{"name": "ball", "shape": "sphere", "radius": 0.03, "mass": 0.1, "position": [0.5, 0, 0.1]}],
             "effects": ["gravity", "joint_stops", "passive_tissue"], "solver": {"engine": "articulated"}, "duration": 0.05}
    names = hs.load(scene).coordinates
    np.savetxt(tmp_path / "a.csv", np.column_stack([np.arange(6) / 100, np.full((6, len(names)), 0.1)]), delimiter=",", comments="",
               header=",".join(["time[s]", *(f"{each}[rad]" for each in names)]))
    (tmp_path / "loads.csv").write_text("time[s],body,x[m],y[m],z[m],force.x[N],force.y[N],force.z[N]\n0,right.index_distal,0,0.1,0.2,0,0,-1\n")
    said = hs.study.inverse(scene, motion=tmp_path / "a.csv", check=False).summary["warnings"]
    assert any("THOSE OF AN EMPTY HAND: what ball weighs" in line for line in said)
    said = hs.study.inverse(scene, motion=tmp_path / "a.csv", loads=tmp_path / "loads.csv", check=False).summary["warnings"]
    assert not any("EMPTY" in line for line in said)
