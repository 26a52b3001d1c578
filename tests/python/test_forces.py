"""Forces between recorded hands and an object (docs/forces.md)."""
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import handsim as hs
from handsim import _forces_object, _nonnegative, _object_motion, _objects, _sharing, _touch

pytest.importorskip("scipy", reason="SciPy is not installed")
WEIGHT = 2.0


def pinch(friction, total=0.0, points=((0.03, 0, 0), (-0.03, 0, 0))):
    points = np.array(points, dtype=float)
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    places = _sharing.Places(points, normals, np.ones(len(points)), np.full(len(points), -1), np.ones(len(points)))
    return _sharing.share(places, np.array([0, 0, WEIGHT, 0, 0, 0]), np.zeros(3), WEIGHT, friction, 0.003, total)


# Oracle: two opposite pads carry a weight by friction alone: normal forces of weight / (2 friction) each. 2 %: residuals weigh against pressures.
@pytest.mark.parametrize("friction", [0.3, 0.5, 1.0])
def test_a_pinch_presses_as_hard_as_friction_asks(friction):
    found = pinch(friction)
    assert found.normal == pytest.approx([WEIGHT / (2 * friction)] * 2, rel=0.02)
    assert np.linalg.norm(found.residual[:3]) < 0.01 * WEIGHT
    assert found.force.sum(axis=0)[2] == pytest.approx(WEIGHT, rel=0.01)


# A sum that a person takes is squeezed by both: more than friction asks.
def test_fingers_squeeze_as_hard_as_people_do():
    assert pinch(0.5, total=8.0).normal.sum() > 1.3 * pinch(0.5).normal.sum()


def test_no_force_leaves_its_cone():
    random = np.random.default_rng(3)
    for _ in range(50):
        count = int(random.integers(1, 9))
        normals = random.normal(size=(count, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        places = _sharing.Places(0.03 * normals, normals, random.uniform(0.5, 2, count), random.integers(-1, 4, count), np.ones(count))
        found = _sharing.share(places, random.normal(size=6) * [2, 2, 2, 0.02, 0.02, 0.02], np.zeros(3), WEIGHT, 0.6, 0.003, 5.0)
        along = np.einsum("ni,ni->n", found.force, normals)
        across = np.linalg.norm(found.force - along[:, None] * normals, axis=1)
        assert (found.normal >= 0).all() and along == pytest.approx(-found.normal, abs=1e-9)
        assert (across <= 0.6 * found.normal + 1e-9).all()
        assert (np.abs(found.spin) <= 0.003 * found.normal + 1e-12).all()
        assert (np.linalg.norm(found.shift, axis=1) <= _sharing.PAD + 1e-12).all()


# Oracle: what is asked for less all that the places give, centres of pressure and spin with it.
def test_the_residual_is_all_that_is_left():
    random = np.random.default_rng(4)
    for _ in range(20):
        normals = random.normal(size=(3, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        wrench = np.concatenate([random.normal(size=3), 0.05 * random.normal(size=3)])
        places = _sharing.Places(0.03 * normals, normals, np.ones(3), np.full(3, -1), np.ones(3))
        found = _sharing.share(places, wrench, np.array([0.01, 0, 0]), WEIGHT, 0.6, 0.003)
        given = np.concatenate([found.force.sum(axis=0), (np.cross(places.points + found.shift - [0.01, 0, 0], found.force)
                                                         + found.spin[:, None] * normals).sum(axis=0)])
        assert found.residual == pytest.approx(wrench - given, abs=1e-9)
    # One finger from the side holds no weight.
    assert np.linalg.norm(pinch(0.6, points=((0.03, 0, 0),)).residual[:3]) > 0.3 * WEIGHT


# Oracle: SciPy's non-negative least squares of the same problem; a start changes the way, not the solution.
def test_non_negative_least_squares_from_any_start():
    from scipy.optimize import nnls

    random = np.random.default_rng(6)
    for _ in range(30):
        rows, count = int(random.integers(5, 40)), int(random.integers(2, 60))
        matrix, goal, ridge = random.normal(size=(rows, count)), random.normal(size=rows), np.full(count, 1e-4)
        exact, _ = nnls(np.vstack([matrix, np.diag(np.sqrt(ridge))]), np.concatenate([goal, np.zeros(count)]))
        problem = _nonnegative.Problem(matrix, goal, ridge)
        for start in (None, np.flatnonzero(exact), np.arange(count)):
            found, active = problem.solve(start)
            assert found == pytest.approx(exact, abs=1e-7)
            assert (found >= 0).all() and set(np.flatnonzero(found)) == set(active)


# A centre of pressure moves within its pad and the noise of its place, and no further: a weight 4 mm beside the one pad under it is borne, one of 12 mm
# beside it only where the place is as unsure. Else the residual says so: 7 mm of the weight are 14 % of its moment at 5 cm, of which friction gives some.
@pytest.mark.parametrize("aside, noise, least, most", [(0.004, 0.0, 0.0, 0.01), (0.012, 0.0, 0.1, 0.14), (0.012, 0.004, 0.0, 0.01)])
def test_a_moment_is_given_as_far_as_pads_reach(aside, noise, least, most):
    places = _sharing.Places(np.array([[0, 0, -0.03]]), np.array([[0, 0, -1.0]]), np.ones(1), np.full(1, -1), np.ones(1), noise)
    found = _sharing.share(places, np.array([0, 0, WEIGHT, 0, 0, 0]), np.array([0, aside, 0]), WEIGHT, 0.6, 0.0)
    share = max(np.linalg.norm(found.residual[:3]) / WEIGHT, np.linalg.norm(found.residual[3:]) / (0.05 * WEIGHT))
    assert least <= share <= most
    assert np.linalg.norm(found.shift[0]) <= places.rim + 1e-9


# Oracle: a lift of 0.25 m in 0.6 s; minimum jerk. 2 mm and 1 degree of noise at 60 Hz: accelerations to 0.3 m/s^2, 3 % of the weight.
def test_accelerations_of_a_noisy_object():
    times = np.arange(300) / 60
    s = np.clip((times - 1) / 0.6, 0, 1)
    height = 0.25 * s**3 * (10 - 15 * s + 6 * s * s)
    exact = np.where((s > 0) & (s < 1), 0.25 / 0.36 * (60 * s - 180 * s**2 + 120 * s**3), 0)
    random = np.random.default_rng(1)
    poses = np.zeros((300, 7))
    poses[:, 2], poses[:, 3] = height, 1
    poses[:, :3] += 2e-3 * random.normal(size=(300, 3))
    poses[:, 4:] += math.radians(0.5) * random.normal(size=(300, 3))
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    poses[70:75] = np.nan
    found = _object_motion.smoothed(times, poses)
    assert np.sqrt(np.mean((found.acceleration[:, 2] - exact)**2)) < 0.3
    assert found.noise[0] == pytest.approx(2e-3, rel=0.1) and found.noise[1] == pytest.approx(math.radians(1), rel=0.15)
    # How sure it is, is said: 0.5 to 2 times the error along the axis that moves, as jerks are those of all axes.
    assert 0.5 < found.unsure[0] / np.sqrt(np.mean((found.acceleration[:, 2] - exact)**2)) < 2


# Oracle: the course itself: on a table for 1 s, carried up 0.2 m in 0.6 s, on a shelf until 3 s, carried down, on the table again. A hand is within reach
# until 1.9 s and from 2.6 s on, so that from 1.6 to 1.9 s nobody can tell; and once always.
@pytest.mark.parametrize("hand_leaves", [True, False])
def test_an_object_that_nobody_touches_stands_on_something(hand_leaves):
    times = np.arange(276) / 60
    s = np.clip((times - 1) / 0.6, 0, 1) - np.clip((times - 3) / 0.6, 0, 1)
    poses = np.zeros((276, 7))
    poses[:, 2], poses[:, 3] = 0.2 * s**3 * (10 - 15 * s + 6 * s * s), 1
    poses[:, :3] += 5e-4 * np.random.default_rng(1).normal(size=(276, 3))
    thing = _objects.read_object("can=tomato_soup_can")
    of = _forces_object.needed(thing, times, _objects.Course(times, poses, np.zeros(276)))
    common = _forces_object.common_of([of])
    on = _forces_object.standing(of, "table", common)
    shelf = _forces_object.elsewhere(of, times, on, common.near, lambda row: hand_leaves and 1.9 < times[row] < 2.6)
    # Within 3 mm of its height, which takes a few frames of a carry.
    assert not shelf[(times < 1.5) | (times > 3.1)].any() and not (shelf & on).any()
    assert shelf[(times > 1.6) & (times < 3)].all() == hand_leaves and shelf.any() == hand_leaves
    load = _forces_object.loads(on | shelf, times)
    assert (load[(times > 1.15) & (times < 1.45)] == 1).all() and (load[(times < 0.5) | (times > 4.2)] == 0).all()
    assert (load[(times > 2.05) & (times < 2.55)] == 0).all() == hand_leaves


# Oracle: distances from a cylinder in closed form.
def test_an_object_is_read_with_its_mass_and_outside():
    can = _objects.read_object("can=tomato_soup_can")
    link = can.links[0]
    assert can.mass == pytest.approx(0.349) and link.centre == pytest.approx([0, 0, 0], abs=1e-9)
    away = np.hypot(link.points[:, 0], link.points[:, 1])
    side = np.abs(link.points[:, 2]) < 0.05
    assert away[side].max() <= 0.0339 + 1e-9 and away[side & (np.abs(link.normals[:, 2]) < 0.1)].min() > 0.0337
    # Walls of a mug have no surface where boxes touch each other.
    mug = _objects.read_object("mug=mug").links[0]
    assert mug.mass == pytest.approx(0.118) and np.abs(mug.points[:, 2]).max() < 0.041


def test_what_is_wrong_is_said(tmp_path):
    table = tmp_path / "r.csv"
    table.write_text("time[s],object.can.x[m],object.can.y[m]\n0,0,0\n")
    for word, message in (("can", "NAME=FILE"), ("can=no_such", "the name of a shipped file")):
        with pytest.raises(hs.Error, match=message):
            _objects.read_object(word)
    with pytest.raises(hs.Error, match="object.can without z, qw, qx, qy, qz"):
        _objects.read_courses(table, ["can"])
    done = subprocess.run([sys.executable, "-m", "handsim", "track", str(table), "--friction", "0.5"], capture_output=True, text=True)
    assert done.returncode == 2 and "--object NAME=FILE beside it" in done.stderr


# A recording made by a simulation with other pads, friction and grip than the solver reckons with: one of those of docs/forces.md.
@pytest.fixture(scope="module")
def tripod(tmp_path_factory):
    import recorded_cases
    import recorded_forces

    folder = tmp_path_factory.mktemp("forces")
    case = recorded_cases.CASES["tripod"]
    recorded = recorded_cases.simulate("tripod", "median_man", 1.5, case)
    path = recorded_cases.write_recording(recorded, folder, 5)
    done = subprocess.run([sys.executable, "-m", "handsim", "track", str(path), "--object", f"thing={folder / 'thing.yaml'}", "--support", "post",
                           "--replay", "--uncertain", "20", "--out", str(folder / "tracked")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return recorded, folder, recorded_forces.compare(recorded, folder), done.stdout


# The wrench to 5 % of the weight, every lifted frame balanced to a tenth of it, no finger wrong by half of its peak: people's squeeze is unknown.
def test_forces_of_a_recording_with_known_ones(tripod):
    recorded, folder, found, text = tripod
    assert found.wrench < 0.05 and found.residual > 0.95 and found.lifted > 60
    assert set(found.normal) == {"right.thumb", "right.index", "right.middle"} and max(found.normal.values()) < 0.5
    assert "held" in text and "how hard opposite fingers squeeze does not show" in text
    summary = json.loads((folder / "tracked/forces/forces.json").read_text())
    assert summary["held"] >= found.lifted and summary["unseen"] == 0


# The goal of replays: a hand with the found forces holds the free object to the end of the lift, one with the tracked angles alone loses it.
def test_a_replay_holds_the_object(tripod):
    _, folder, _, text = tripod
    (lift,) = json.loads((folder / "tracked/forces/forces.json").read_text())["lifts"]
    assert lift["problem"] == {"forces": "", "angles": ""} and lift["held_to_the_end"]
    assert lift["held_s"]["forces"] >= 2 * lift["held_s"]["angles"] > 0
    # In the run in which a spring carries the object, the hand bears it before the lift begins.
    assert 0 < lift["spring_share"] < 0.1
    for kind in ("forces", "angles"):
        ended = lift["held_s"][kind] >= lift["end_s"] - lift["begin_s"] - 1e-6
        assert ended == (lift["lost_by"][kind] == "")
    assert "a simulated hand holds it with the forces" in text
    assert hs.load(folder / "tracked/forces/lift_1_forces.yaml").objects == ["thing"]


def test_python_gives_the_tables(tripod, tmp_path):
    _, folder, _, _ = tripod
    found = hs.study.track(folder / "recording.csv", object=f"thing={folder / 'thing.yaml'}", support="post", out=tmp_path / "out")
    assert found.tables["contact_forces"]["residual.share"].shape == found.tables["object"]["time"].shape
    assert found.summaries["forces"]["object"] == "thing" and "right.thumb" in str(found)
    with pytest.raises(hs.Error, match="object"):
        hs.study.track(folder / "recording.csv", support="post")


# Oracle: mechanics. Motion asks of an object of twice the mass for twice the wrench, and residual and shares of the weight stay.
def test_forces_are_in_proportion_to_the_mass(tripod, tmp_path):
    recorded, folder, _, _ = tripod
    words = {"object": f"thing={folder / 'thing.yaml'}", "support": "post"}
    found = {mass: hs.study.track(folder / "recording.csv", mass=mass, out=tmp_path / str(mass), **words) for mass in ("200 g", 0.4, "free")}
    one, two, free = (each.tables["contact_forces"] for each in found.values())
    assert found["200 g"].summaries["forces"]["mass_kg"] == pytest.approx(0.2) and found["free"].summaries["forces"]["mass_kg"] == pytest.approx(1)
    for column in ("wrench.force.z", "right.thumb.normal", "right.index_distal.force.x"):
        assert np.nan_to_num(two[column]) == pytest.approx(2 * np.nan_to_num(one[column]), rel=1e-4, abs=1e-4)
        assert np.nan_to_num(free[column]) == pytest.approx(5 * np.nan_to_num(one[column]), rel=1e-4, abs=1e-4)
    assert free["residual.share"] == pytest.approx(one["residual.share"], rel=1e-4, abs=1e-4)
    # The heaviest object for the strength does not depend on the mass that is taken; a tripod grip holds some kilograms.
    heaviest = [each.summaries["forces"]["heaviest_kg"] for each in found.values()]
    assert heaviest == pytest.approx([heaviest[0]] * 3, rel=0.02) and 0.3 < heaviest[0] < 20
    assert found["free"].summaries["forces"]["effort"] is None and "for each kilogram" in found["free"].text
    for wrong in ({"mass": "2 s"}, {"mass": "free", "muscles": True}, {"mass": -1.0}):
        with pytest.raises(hs.Error, match="mass"):
            hs.study.track(folder / "recording.csv", **words, **wrong)


# Bands that are too narrow hold the truth in few frames: three fingers whose squeeze is drawn from people's.
def test_the_truth_lies_in_the_bands(tripod):
    assert tripod[2].inside > 0.7


def test_the_table_of_loads_goes_into_inverse_dynamics(tripod, tmp_path):
    _, folder, _, _ = tripod
    done = subprocess.run([sys.executable, "-m", "handsim", "inverse", str(folder / "tracked/scene.yaml"), "--loads", str(folder / "tracked/forces/loads.csv"),
                           "--no-check", "--out", str(tmp_path / "inverse")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


# The scenes of a lift run by themselves, each with tables of its own: at the end the one with the forces has the object where the recording has it.
def test_the_scenes_of_a_replay_run_by_themselves(tripod):
    _, folder, _, _ = tripod
    (lift,) = json.loads((folder / "tracked/forces/forces.json").read_text())["lifts"]
    recorded = hs.study.read_csv(folder / "tracked/forces/object.csv")
    last = int(np.argmin(np.abs(recorded["time"] - lift["end_s"])))
    goal = np.array([recorded[f"object.thing.{axis}"][last] for axis in "xyz"])
    away = {}
    for kind in ("forces", "angles"):
        simulation = hs.Simulation(hs.load(folder / f"tracked/forces/lift_1_{kind}.yaml"))
        simulation.step(substeps=round((lift["end_s"] - lift["begin_s"]) / simulation.scene.step))
        body = next(i for i, each in enumerate(simulation.scene._model.bodies) if each.name == "thing")
        away[kind] = np.linalg.norm(simulation.bodies.position[body] - goal)
    assert away["forces"] < 0.01 < away["angles"]


def ball(count, radius=0.05, middle=(0, 0, 0)):
    """Triangles of a sphere of longitudes and latitudes, counter-clockwise seen from outside."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * count + 1), np.linspace(0, np.pi, count + 1), indexing="ij")
    points = radius * np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=2) + middle
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    made = np.concatenate([np.stack([a, d, c], axis=2).reshape(-1, 3, 3), np.stack([a, c, b], axis=2).reshape(-1, 3, 3)])
    return made[np.linalg.norm(np.cross(made[:, 1] - made[:, 0], made[:, 2] - made[:, 0]), axis=1) > 1e-12]


def cup():
    """Triangles of a cube of 0.1 m with a square hole of 0.06 m from above to 0.02 m over its bottom: it is not convex."""
    def brick(low, high):
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return {name: corners[[each]][0] for name, each in zip(("x-", "x+", "y-", "y+", "z-", "z+"), faces)}

    outer, hole = brick((-0.05, -0.05, 0), (0.05, 0.05, 0.1)), brick((-0.03, -0.03, 0.02), (0.03, 0.03, 0.1))
    quads = [quad for name, quad in outer.items() if name != "z+"] + [quad[::-1] for name, quad in hole.items() if name != "z+"]
    rim_out, rim_in = outer["z+"], hole["z+"]
    quads += [np.array([rim_out[k], rim_out[(k + 1) % 4], rim_in[(k + 1) % 4], rim_in[k]]) for k in range(4)]
    return np.array([quad[list(own)] for quad in quads for own in ((0, 1, 2), (0, 2, 3))])


def surface_of(triangles):
    """As of a link."""
    spacing = _objects.spacing_of(triangles)
    points, normals = _objects.sampled(triangles.reshape(-1, 3), np.arange(len(triangles) * 3).reshape(-1, 3), spacing)
    return _touch.Surface(_objects.Link("link", 1.0, np.zeros(3), np.eye(3), points, normals, [], triangles))


# Oracles: closed forms. Surfaces that are closed, not convex, doubled, within each other, and open: of the sphere a cap of 37 degrees is left out, and places
# near the hole are asked for by the plane of its rim no nearer than 5 mm.
@pytest.mark.parametrize("shape", ["sphere", "cup", "doubled", "overlapping", "open"])
def test_inside_is_told_from_outside(shape):
    random = np.random.default_rng(11)
    places = random.uniform(-0.07, 0.07, (4000, 3)) + (np.array([0, 0, 0.05]) if shape == "cup" else 0)
    away = np.linalg.norm(places, axis=1)
    if shape == "cup":
        triangles = cup()
        x, y, z = places.T
        exact = (np.maximum(np.abs(x), np.abs(y)) < 0.05) & (z > 0) & (z < 0.1) & ~((np.maximum(np.abs(x), np.abs(y)) < 0.03) & (z > 0.02))
        asked = np.ones(len(places), dtype=bool)
    else:
        triangles, exact, asked = ball(32), away < 0.05, np.abs(away - 0.05) > 3e-4
    if shape == "doubled":
        triangles = np.concatenate([triangles, triangles])
    if shape == "overlapping":
        triangles, other = np.concatenate([triangles, ball(32, middle=(0.04, 0, 0))]), np.linalg.norm(places - [0.04, 0, 0], axis=1)
        exact, asked = exact | (other < 0.05), asked & (np.abs(other - 0.05) > 3e-4)
    if shape == "open":
        triangles = triangles[triangles[:, :, 2].min(axis=1) < 0.04]
        asked &= places[:, 2] < 0.035
    surface = surface_of(triangles)
    assert 500 < exact[asked].sum() < asked.sum() - 500
    assert (surface.inside.of(places)[asked] == exact[asked]).all()
    # Distances have the sign, too, and the normal leads from inside outwards.
    found, normals = surface.distances(places, 0.1, np.full(len(places), 0.01))
    deep = asked & np.isfinite(found) & (np.abs(found) > 1e-3)
    assert ((found[deep] < 0) == exact[deep]).all() and np.linalg.norm(normals[deep], axis=1) == pytest.approx(1)
    if shape == "sphere":
        assert found[deep] == pytest.approx(away[deep] - 0.05, abs=6e-4)
        assert ((normals * places).sum(axis=1)[deep] / away[deep] > 0.9)[away[deep] > 0.02].all()


# Oracle: a place inside a closed surface sees it all around, one outside nothing of it. Of a hole of a sphere, the solid angle of its
# cap is missing in the middle: (1 - cos) / 2 of the whole.
def test_winding_numbers_are_solid_angles():
    inside = surface_of(ball(64)).inside
    assert inside.winding(np.array([[0, 0, 0], [0.02, 0.01, -0.03], [0.2, 0, 0]])) == pytest.approx([1, 1, 0], abs=1e-9)
    triangles = ball(64)
    rim = np.cos(np.pi * 16 / 64)
    hole = surface_of(triangles[triangles[:, :, 2].min(axis=1) < 0.05 * rim - 1e-9]).inside
    assert hole.winding(np.zeros((1, 3))) == pytest.approx(1 - (1 - rim) / 2, abs=2e-3)


# Oracle: the nearest points of all places, none left out beforehand.
def test_places_that_are_too_far_are_left_out_alone():
    surface = _touch.Surface(_objects.read_object("mug=mug").links[0])
    random = np.random.default_rng(8)
    places, radii, reach = random.uniform(-0.08, 0.08, (2000, 3)), random.uniform(4e-3, 1.2e-2, 2000), 5e-3
    found, _ = surface.distances(places, reach, radii)
    away, at = surface.tree.query(places, k=_touch.CORNER)
    alike = away < away[:, :1] + _touch.TIE
    at = np.where(alike, at, at[:, :1])
    heights = np.where(alike, ((places[:, None] - surface.link.points[at]) * surface.link.normals[at]).sum(axis=2), -np.inf).max(axis=1)
    beside = np.sqrt(np.maximum(away[:, 0]**2 - heights**2, 0))
    sign = np.where(surface.inside.of(places), -1.0, 1.0)
    exact = np.where((beside < _touch.BESIDE) & (sign * heights > 0), heights, sign * away[:, 0])
    near = exact - radii < reach
    assert 200 < near.sum() < 1800 and found[near] == pytest.approx(exact[near], abs=1e-12)


# Oracle: Newton's second law. What hands do to an object that is moved in the air accelerates it and bears its weight: forces and motion of a recording
# with known ones belong to each other, while it is set down, too.
def test_true_forces_of_a_recording_are_those_of_its_motion():
    import recorded_cases

    recorded = recorded_cases.simulate("set_down", "median_man", 1.5, recorded_cases.CASES["set_down"])
    times, place = recorded.times, recorded.columns["object"][:, :3]
    needed = recorded.mass * (np.gradient(np.gradient(place, times, axis=0), times, axis=0) + [0, 0, 9.80665])
    free = (recorded.supported < 1e-6) & (times > 2.45) & (times < 3.1)
    assert free.sum() > 30 and np.abs(needed[free, 2] / (9.80665 * recorded.mass) - 1).max() > 0.1
    wrong = np.linalg.norm((recorded.wrench[:, :3] - needed)[free], axis=1)
    assert np.sqrt(np.mean(wrong**2)) < 0.03 * recorded.mass * 9.80665


# A recording is one of an object that is lifted as high as the hands go, and not of one that slips out of them on the way and falls back.
@pytest.mark.parametrize("highest, dropped", [(0.2, False), (0.19, False), (0.1, True), (0.0, True)])
def test_a_dropped_object_is_no_recording(highest, dropped):
    import recorded_cases

    height = np.concatenate([np.linspace(0, highest, 40), np.linspace(highest, 0, 10), np.zeros(20)])
    of = recorded_cases.Recorded("both", np.arange(70) / 60, {"object": np.stack([height, height, 0.07 + height], axis=1)}, {}, {}, np.zeros((70, 6)), 0.8, 0.75,
                                  "", "median_man", np.where(height > 0, 0.0, 8.0), "")
    assert recorded_cases.dropped(of) == dropped


RECORDINGS = os.environ.get("HANDSIM_RECORDINGS")


@pytest.mark.skipif(not RECORDINGS, reason="HANDSIM_RECORDINGS names no folder of captured sequences")
def test_a_hinged_object_is_two_links():
    box = _objects.read_object(f"box={Path(str(RECORDINGS)) / 'objects/box/box.urdf'}")
    assert [link.name for link in box.links] == ["bottom", "top"] and box.hinge is not None
    closed, open_ = box.places(np.tile([0.0, 0, 0, 1, 0, 0, 0], (2, 1)), np.array([0, 1.0]))
    assert closed[1] == pytest.approx([0, 0, 0, 1, 0, 0, 0]) and 2 * math.acos(open_[1][3]) == pytest.approx(1)
