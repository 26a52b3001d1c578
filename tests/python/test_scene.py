"""Scenes: found, changed, refused, pickled, drawn."""
import multiprocessing
import pickle
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from conftest import ROOT

import handsim as hs


# Oracle: the path of the file that the name stands for.
def test_a_name_is_the_shipped_file_of_that_name():
    path = hs.data_path() / "config" / "dropped_hand.yaml"
    assert hs.load("dropped_hand").resolved == hs.load(path).resolved == hs.load(str(path)).resolved
    assert hs.load("stability/stack").title


# Oracle: the folders that README names; each file of `scenes` exists.
def test_the_data_files_come_with_the_package():
    data = hs.data_path()
    for name in ("handmodels/anatomical.yaml", "controllers/grasp.yaml", "config/objects/tomato_soup_can.yaml",
                 "config/persons/median_man.yaml", "config/stability.yaml"):
        assert (data / name).is_file(), name
    assert {"two_hands", "grasp_power_can", "stability/stack"} <= set(hs.scenes())


# Oracle: the values themselves, in the units that texts carry.
def test_overrides_are_those_of_set():
    scene = hs.load("grasp_power_can", {"objects.0.mass": np.float32(0.5), "solver.step": "2 ms",
                                        "effects": ["gravity", "actuation", "joint_stops", "passive_tissue",
                                                    "wrist_motion", "object_contact"]}, engine="articulated")
    assert scene.masses[scene.bodies.index("can")] == 0.5
    assert scene.step == 0.002
    assert scene.engine == "articulated"
    assert "friction" not in scene.effects


# Oracle: the places in the file that this test writes.
def test_every_problem_has_its_place(tmp_path):
    path = tmp_path / "bad.yaml"
    path.write_text("title: bad\nduration: -1\nhands:\n  - {model: none.yaml, side: middle}\n")
    with pytest.raises(hs.Error) as caught:
        hs.load(path)
    problems = {p.key: p for p in caught.value.problems}
    duration = problems["duration"]
    assert (duration.file, duration.line, duration.column, duration.got) == (str(path), 2, 11, "-1")
    assert problems["hands.0.side"].line == 4
    assert caught.value.kind == "input" and caught.value.fault is None
    assert f"{path}:2:11: duration: got -1, need " in str(caught.value)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value) and again.problems == caught.value.problems


# Oracle: the nearest name by eye.
def test_an_unknown_name_names_the_nearest():
    with pytest.raises(hs.Error, match="two_hnds.*nearest: two_hands"):
        hs.load("two_hnds")


def _hash_of(scene):
    return scene.run(frames=0).state_hash


# Oracle: the hash of all states of the scene itself. The copy has no file of the first one.
def test_a_pickled_scene_runs_with_the_same_bits_in_another_process(tmp_path):
    (tmp_path / "mesh.stl").write_bytes((ROOT / "tests/data/meshes/icosahedron.stl").read_bytes())
    thing = {"name": "thing", "shape": "convex_mesh", "mesh": str(tmp_path / "mesh.stl"), "mass": "100 g",
             "position": [0, 0, 1], "angular_velocity": [1, 2, 3]}
    scene = hs.load({"title": "mesh", "duration": "0.1 s", "objects": [thing], "effects": ["gravity"]})
    (tmp_path / "mesh.stl").unlink()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(_hash_of, [scene]) == [_hash_of(scene)]


# Oracle: numbers of the model; MJCF has a body for each but the world, and a joint for each axis.
def test_exports_have_every_body_and_axis(two_hands):
    root = ET.fromstring(two_hands.to_mjcf())
    assert len(root.findall(".//body")) == len(two_hands.bodies) - 1
    assert {j.get("name") for j in root.findall(".//body/joint")} == set(two_hands.coordinates)
    assert len(ET.fromstring(two_hands.to_urdf()).findall("joint")) >= len(two_hands.coordinates)


# Oracle: signs of flexion stops of the anatomical hand: a finger bends further to the palm than to the back.
def test_limits_are_those_of_the_joints(two_hands):
    limits = two_hands.limits
    assert limits.shape == (40, 2)
    at = two_hands.coordinates.index("left.index_pip.flexion")
    assert limits[at, 0] < 0.1 and limits[at, 1] == pytest.approx(np.radians(100))


# Oracle: the requested size; a hand is not the colour of the floor, and two times differ.
@pytest.mark.skipif(not hs.has_pictures, reason="this build of handsim has no pictures (HANDSIM_PICTURES)")
def test_a_picture_shows_the_scene_at_its_time(two_hands, tmp_path):
    first, last = two_hands.draw(size=(160, 120)), two_hands.draw(0.5, size=(160, 120))
    assert first.shape == (120, 160, 3) and first.dtype == np.uint8
    assert np.any(first != last)
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 100
    hs.save_png(first, tmp_path / "first.png")
    assert (tmp_path / "first.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(hs.Error, match="view: got above, need dorsal, palmar"):
        two_hands.draw(view="above")
    with pytest.raises(hs.Error, match="time: got 3"):
        two_hands.draw(3)


# Oracle: a decoder that is not ours reads the same pixels, where one is installed.
def test_a_png_reads_back_as_the_same_pixels():
    image = pytest.importorskip("matplotlib.image", reason="matplotlib is not installed: nothing else reads PNG here")
    import io

    picture = np.random.default_rng(1).integers(0, 256, (7, 5, 3), np.uint8)
    back = image.imread(io.BytesIO(hs.png(picture)))
    assert np.array_equal(np.round(255 * back[:, :, :3]).astype(np.uint8), picture)


@pytest.mark.parametrize("what", ["hand", "scene", "result"])
def test_a_notebook_shows_tables_and_pictures(what, two_hands):
    shown = {"hand": lambda: hs.Hand(stature=1.7, mass=60, sex="female"), "scene": lambda: two_hands,
             "result": lambda: two_hands.run(frames=3)}[what]()._repr_html_()
    assert shown.count("<table>") >= 1
    assert ("data:image/png;base64," in shown) == hs.has_pictures


# Oracle: the scene itself: what a run writes as its scene can be read again.
@pytest.mark.parametrize("look", ["skin", "shapes", "both"])
def test_resolved_scenes_of_every_look_load_again(look):
    scene = hs.load("two_hands", {"pictures.hands": look})
    assert pickle.loads(pickle.dumps(scene)).resolved == scene.resolved
