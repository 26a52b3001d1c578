"""``handsim grasp plan`` and ``hs.grasps``. Oracles: the taxonomy's own counts, contacts made by hand, closed forms of boxes and balls, the scenes run again."""
import csv
import json
import math
import subprocess
import sys

import numpy as np
import pytest

import handsim as hs
from handsim._grasp_plan import Planner
from handsim._grasp_plan import object_file as object_file_of
from handsim._grasp_places import Posed, Search, Solid
from handsim._grasp_types import FINGERS, read_types
from handsim._objects import of_scene

pytest.importorskip("scipy", reason="scipy is not installed")
pytest.importorskip("yaml", reason="PyYAML is not installed")


def object_file(folder, name, **keys):
    path = folder / f"{name}.yaml"
    path.write_text("".join(f"{key}: {json.dumps(value)}\n" for key, value in keys.items()))
    return path


def plan(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "grasp", "plan", *map(str, words)], capture_output=True, text=True, timeout=900)


# Oracle: the table of Feix et al. 2016: 33 types, of which 10, 16 and 7 are oppositions of palm, pads and sides.
def test_there_are_the_types_of_the_taxonomy():
    types = read_types()
    assert sorted(of.number for of in types.values()) == list(range(1, 34))
    assert [sum(of.opposition == each for of in types.values()) for each in ("palm", "pad", "side")] == [10, 16, 7]
    assert all(set(of.open) == set(FINGERS) == set(of.closed) and of.forces for of in types.values())


def test_contacts_are_of_the_type_that_they_look_like():
    types = read_types()
    tripod = {"thumb_distal": 8.0, "index_distal": 4.0, "middle_distal": 4.0}
    pinch = {"thumb_distal": 8.0, "index_distal": 8.0}
    key = {"thumb_distal": 8.0, "index_middle": 6.0, "index_proximal": 2.0}
    wrap = {"palm": 30.0, "thumb_proximal": 20.0, **{f"{finger}_{part}": 8.0 for finger in FINGERS[1:] for part in ("proximal", "distal")}}
    assert not types["tripod"].faults(tripod) and not types["palmar_pinch"].faults(pinch) and not types["lateral"].faults(key)
    assert types["tripod"].faults(pinch) == ["middle_distal does not touch"]
    assert types["palmar_pinch"].faults(tripod) == ["middle bears 25%"]
    assert types["palmar_pinch"].faults(key) == ["index_distal does not touch"]
    assert types["tripod"].faults({**tripod, "palm": 10.0}) == ["palm bears 38%"]
    # A part that leans against the object with a twentieth of the force changes nothing.
    assert not types["tripod"].faults({**tripod, "palm": 0.8})
    assert not types["medium_wrap"].faults(wrap, 0.25) and types["medium_wrap"].faults(wrap, 0.5) == ["0.50 hand lengths across"]
    assert "palm bears 26%" in types["ventral"].faults(wrap) and "palm bears 26%" in types["writing_tripod"].faults(wrap)
    assert types["fixed_hook"].faults(wrap)[0].startswith("thumb bears") and types["large_diameter"].faults({}) == ["nothing touches"]


def test_wrong_types_are_refused_with_every_place(tmp_path):
    file = tmp_path / "types.yaml"
    pose = "{thumb: [0, 0, 0, 0], index: [0, 0, 0, 0], middle: [0, 0, 0, 0], ring: [0, 0, 0, 0], little: [0, 0, 0]}"
    file.write_text(f"""title: types
source: none
unit: deg
types:
  one:
    number: 1.5
    title: one
    class: strong
    opposition: pad
    thumb: abducted
    virtual_fingers: [[thumb], [indx]]
    size: [0.3, 0.1]
    object: any
    sites: [[thumb_distal palmar], [index_distal inside]]
    open: {pose}
    closed: {pose}
    forces: {{index: "5 m"}}
    touches: [[thumb], [index_distal]]
    keep_off: [palm]
""")
    with pytest.raises(hs.Error) as caught:
        read_types(file)
    found = {(p.line, p.key) for p in caught.value.problems}
    assert {(6, "types.one.number"), (8, "types.one.class"), (11, "types.one.virtual_fingers.1.0"), (12, "types.one.size"), (14, "types.one.sites.1.0"),
            (15, "types.one.open.little"), (16, "types.one.closed.little"), (19, "types.one.keep_off")} <= found
    assert str(caught.value).startswith(f"{file}:") and "need power, intermediate, precision" not in str(caught.value)
    assert "types.one.keep_off: got an unknown key, need keeps_off" in str(caught.value)


# Oracle: the symmetries of the solids. Of the 24 ways to name three axes a ball has one, a cylinder 24/8, a box of three edges 24/4.
def test_symmetric_objects_have_fewer_orientations_and_stand_as_boxes_do(tmp_path):
    def solid(name, **keys):
        return Solid(of_scene(name, object_file(tmp_path, name, mass=0.1, **keys)))

    box = solid("box", shape="box", edges=[0.04, 0.06, 0.1])
    assert [len(each.orientations(-1)) for each in (solid("ball", shape="sphere", radius=0.03), solid("rod", shape="cylinder", radius=0.02, length=0.1), box)] == [1, 3, 6]
    # A box on a face tilts over the nearest edge: half that edge's distance over half the height.
    angles = sorted(round(math.degrees(rest.angle), 3) for rest in box.rests)
    assert angles == sorted(round(math.degrees(math.atan2(min(others), height)), 3)
                            for height, others in ((0.04, (0.06, 0.1)), (0.06, (0.04, 0.1)), (0.1, (0.04, 0.06))) for _ in range(2))


# Oracle: the pads' gap in the hand's own kinematics is the thickness of the plate, and the plate's faces lie across it.
def test_a_plate_lies_between_the_pads_that_are_as_far_apart_as_it_is_thick(tmp_path):
    plate = Solid(of_scene("plate", object_file(tmp_path, "plate", mass=0.1, shape="box", edges=[0.02, 0.06, 0.1])))
    posed, of = Posed(hs.Hand(person="median_man")), read_types()["palmar_pinch"]
    thin = [place for place in Search(plate, posed).places(of) if abs(place.thickness - 0.02) < 2e-3]
    assert thin
    for place in thin:
        sites = posed.sites_at(of, place.thickness)
        assert sites.gap == pytest.approx(place.thickness, abs=2.5e-3)
        assert abs(place.turn[:, 0] @ sites.axes[:, 0]) == pytest.approx(1, abs=1e-9)
        middle = place.turn.T @ (sites.middle - place.position)
        assert abs(middle[0]) < 2e-3 and (np.abs(middle) < [0.01, 0.03, 0.05]).all()


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    out = tmp_path_factory.mktemp("planning") / "ball"
    return out, plan("golf_ball", "--count", 2, "--threads", 1, "--out", out)


def rows_of(out):
    with open(out / "grasps.csv", newline="") as file:
        return list(csv.DictReader(file))


def test_the_list_is_the_same_for_one_thread_and_two(ball, tmp_path):
    out, done = ball
    assert done.returncode == 0, done.stderr
    again = plan("golf_ball", "--count", 2, "--threads", 2, "--out", tmp_path / "again")
    assert again.returncode == 0
    assert (out / "grasps.csv").read_bytes() == (tmp_path / "again/grasps.csv").read_bytes()
    for rank in (1, 2):
        assert (out / f"grasp_{rank:02d}.yaml").read_bytes() == (tmp_path / f"again/grasp_{rank:02d}.yaml").read_bytes()
    # A shorter list takes the place of a longer one.
    assert plan("golf_ball", "--count", 1, "--out", tmp_path / "again").returncode == 0
    assert not (tmp_path / "again/grasp_02.yaml").exists()


# Oracle: the scenes, run by `hs.study.grasps`; weights of the table are sums over segments.
def test_scenes_of_a_plan_are_held_when_they_are_run(ball):
    out, _ = ball
    rows = [row for row in rows_of(out) if row["rank"]]
    assert [row["rank"] for row in rows] == ["1", "2"] and all(row["held"] == "1" and row["outcome_half_step"] == "held" for row in rows)
    study = hs.study.grasps([out / row["scene"] for row in rows], confirm=True)
    for row, told in zip(rows, study.summaries["grasps"]):
        assert told["held"] and not told["uncertain"] and told["margin"] == pytest.approx(float(row["margin"]), rel=1e-4)
        fingers = sum(float(row[f"{finger}[N]"]) for finger in FINGERS)
        assert fingers / hs.Hand(person="median_man").dimensions["grip_strength"] == pytest.approx(float(row["effort"]), rel=1e-3)
        assert 0 < float(row["least_effort"]) <= float(row["effort"])
    # Others say why they are none.
    assert all(row["why"] for row in rows_of(out) if row["held"] == "0")


# Oracle: the scene where it was. What is moved has no path of the place before.
def test_a_folder_with_its_object_can_be_moved(tmp_path):
    ball = object_file(tmp_path, "ball", shape="sphere", radius=0.02, mass=0.03)
    before = tmp_path / "before"
    before.mkdir()
    ball = ball.rename(before / "ball.yaml")
    assert plan(ball, "--type", "tripod", "--count", 1, "--others", "golf_ball", "--report", "--out", before / "plan").returncode == 0
    hash_of = hs.load(before / "plan/grasp_01.yaml").run(frames=0).state_hash
    assert str(tmp_path) not in (before / "plan/grasp_01.yaml").read_text() + (before / "plan/who.yaml").read_text()
    assert "<!doctype html>" in (before / "plan/best.html").read_text()[:200]
    after = before.rename(tmp_path / "after")
    assert hs.load(after / "plan/grasp_01.yaml").run(frames=0).state_hash == hash_of
    # Who can hold it: six persons, both balls, five draws of friction.
    found = hs.study.rollouts(after / "plan/who.yaml", count=1)
    table = found.tables["rollouts"]
    assert len(table["held"]) == 12 and set(table["objects.0.file"]) == {"../ball.yaml", "golf_ball"}
    assert len(set(table["hands.0.person"])) == 6 and sum(table["held"]) > 6


def test_a_card_is_pinched_and_a_left_hand_does_it_as_a_right_one(tmp_path):
    card = object_file(tmp_path, "card", shape="box", edges=[0.054, 0.085, 0.01], mass=0.045)
    found = {side: hs.grasps(card, "median_man", side=side, types=["palmar_pinch"], count=1) for side in ("right", "left")}
    right, left = (found[side].grasps[0] for side in ("right", "left"))
    assert right.type.name == "palmar_pinch" and set(segment.partition("_")[0] for segment in right.forces) == {"thumb", "index"}
    assert left.margin == pytest.approx(right.margin, abs=0.02)


def test_a_mug_is_held(tmp_path):
    found = hs.grasps("mug", "median_man", types=["large_diameter", "power_sphere", "ring"], count=1)
    assert found.grasps and found.grasps[0].held and found.grasps[0].margin > 0


# Oracle: what the type is. On the handle of a knife the index lies along it, beyond its first joint; palm, middle and ring hold it.
def test_a_knife_is_held_with_the_index_along_it(tmp_path):
    knife = object_file(tmp_path, "knife", shape="box", edges=[0.018, 0.028, 0.2], mass=0.09)
    forces = hs.grasps(knife, "median_man", types=["index_finger_extension"], count=1).grasps[0].forces
    total = sum(forces.values())
    assert forces.get("index_middle", 0) + forces.get("index_distal", 0) > 0.02 * total and min(forces["palm"], forces["ring_distal"]) > 0.1 * total


def test_a_strawberry_is_held_on_the_bent_index_off_the_palm():
    found = hs.grasps("strawberry", "median_man", types=["ventral"], count=1)
    assert found.grasps and {segment.partition("_")[0] for segment in found.grasps[0].forces} == {"thumb", "index"}


# A can of 102 mm is 0.604 lengths of her hand: how thick a wrap may be is for the fit to say.
def test_a_small_woman_holds_a_large_can():
    found = hs.grasps("master_chef_can", "small_woman", types=["large_diameter"], count=1)
    assert found.grasps and found.grasps[0].place.thickness > 0.6 * found.hand_length and found.grasps[0].margin > 0.2


def test_what_cannot_be_held_says_why(tmp_path):
    heavy = object_file(tmp_path, "heavy", shape="sphere", radius=0.0215, mass=30)
    done = plan(heavy, "--type", "tripod", "palmar_pinch", "--count", 1, "--out", tmp_path / "heavy_out")
    assert done.returncode == 1 and "no grasp of heavy.yaml by a hand of 193 mm" in done.stdout and "too heavy" in done.stdout
    rows = rows_of(tmp_path / "heavy_out")
    assert {row["code"] for row in rows} <= {"too_heavy", "out_of_reach", "no_opposition"} and all(row["why"] for row in rows)
    # Of 3 kg, which weigh 88 N in the shake, some places are balanced, too weak, and the nearest is that which lacks least.
    done = plan(object_file(tmp_path, "weight", shape="sphere", radius=0.0215, mass=3), "--type", "tripod", "palmar_pinch", "--count", 1, "--out", tmp_path / "out")
    lacking = [float(row["lacking"]) for row in rows_of(tmp_path / "out") if row["lacking"]]
    assert lacking and min(lacking) > 1 and f"which need {min(lacking):.2g} times its force" in done.stdout
    large = hs.grasps(object_file(tmp_path, "large", shape="sphere", radius=0.2, mass=0.1), count=1)
    assert not large.grasps and any("too thick" in why for why in large.why())
    assert {each.code for each in large.refusals()} >= {"too_large", "other_shape"}


# Oracle: the codes of both tables, counted.
def test_refusals_are_those_of_all_places(ball):
    out, _ = ball
    with open(out / "refusals.csv", newline="") as file:
        refusals = list(csv.DictReader(file))
    failed = [row for row in rows_of(out) if row["held"] == "0"]
    assert failed and all(row["code"] for row in failed) and not any(row["code"] for row in rows_of(out) if row["held"] == "1")
    for code in {row["code"] for row in failed}:
        assert sum(int(row["places"]) for row in refusals if row["tried"] == "1" and row["code"] == code) == sum(row["code"] == code for row in failed)
    assert {row["code"] for row in refusals if row["tried"] == "0"} <= {"too_large", "too_small", "other_shape", "nothing_there", "hand_in_way"}


# Oracle: of twice the places that were tried twice as many are refused, in the same order.
def test_refusals_count_places(tmp_path):
    heavy = hs.grasps(object_file(tmp_path, "weight", shape="sphere", radius=0.0215, mass=3), types=["tripod", "palmar_pinch"], count=1)
    once = [each for each in heavy.refusals() if each.tried]
    twice = [each for each in heavy._replace(tried=heavy.tried * 2).refusals() if each.tried]
    assert once and twice == [each._replace(places=2 * each.places) for each in once]
    assert sum(each.places for each in once) == len(heavy.tried)


# Oracle: the simulation. What the fit's own forces let slip is never held worse, and some of it better, by a hand that presses harder.
def test_what_slips_is_pressed_harder():
    planner = Planner(object_file_of("mustard_bottle"), "small_woman", "right", read_types(), True, 1)
    grasps = [planner.pressed(place, 1.0) for place in planner.queue()[:30] if place.type.opposition == "palm"]
    slipped = [grasp for grasp in grasps if grasp.code == "moved"]
    harder = [planner.judged(grasp.place) for grasp in slipped]
    assert slipped and all(after.margin >= before.margin for before, after in zip(slipped, harder))
    assert any(after.held or after.margin > before.margin + 0.1 for before, after in zip(slipped, harder))
    assert any("reserve" in after.content["grasps"][0]["grip"] for after in harder)


# Oracle: what weighs twice as much. With a reserve of 2 the fit presses as hard as for that, and nearly twice as hard as without.
def test_a_reserve_presses_as_for_a_heavier_object():
    def pressed(mass, reserve):
        scene = hs.load("grasp_tripod", {"solver": {"engine": "articulated", "step": "1 ms"}, "objects.0.mass": mass, "grasps.0.grip.reserve": reserve,
                                         "grasps.0.hold": "0.6 s", "grasps.0.shake.levels": [{"acceleration": "19.6 m/s2", "frequency": "5 Hz"}]})
        return scene.run(frames=0, progress=False).figures["normal_force"]

    assert pressed(0.4, 2) == pytest.approx(pressed(0.8, 1), rel=0.1) and pressed(0.4, 2) > 1.5 * pressed(0.4, 1)


@pytest.mark.parametrize("words, told", [
    (["edge_10mm"], "an object that does not move"), (["golf_ball", "--type", "tripot"], "type: got tripot, need"), (["golf_bal"], "nearest: golf_ball"),
    (["golf_ball", "--count", "0"], "--count: got 0"), (["golf_ball", "--person", "nobody"], "person: got nobody"), (["golf_ball", "--side", "both"], "side: got both"),
    (["golf_ball", "--cont", "3"], "nearest: --count"), ([], "")])
def test_wrong_words_are_refused(words, told, tmp_path):
    done = plan(*words, *(["--out", tmp_path / "out"] if words else []))
    assert done.returncode == 2 and told in done.stderr and not (tmp_path / "out").exists()


def test_a_mesh_is_told_of_the_command_that_makes_an_object_of_it(tmp_path):
    (tmp_path / "handle.stl").write_text("solid a\nendsolid a\n")
    with pytest.raises(hs.Error, match="handsim object handle.stl makes one of a mesh"):
        hs.grasps(tmp_path / "handle.stl")
