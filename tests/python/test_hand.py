"""Hands as tables."""
import pickle
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import handsim as hs


@pytest.fixture(scope="module")
def hand():
    return hs.Hand(stature=1.75, mass=72, sex="male", side="right")


# Oracle: the parts make the whole; de Leva's share of body mass for young men, 0.61 %, within 1.5 standard deviations of 0.083 %.
def test_masses_sum_to_the_hands(hand):
    assert hand.segments["mass"].sum() == pytest.approx(hand.dimensions["mass"], rel=1e-12)
    assert hand.dimensions["mass"] == pytest.approx(0.0061 * 72, abs=1.5 * 0.00083 * 72)
    centre = hand.segments["mass"] @ hand.segments["centre_of_mass"] / hand.dimensions["mass"]
    assert centre[1] == pytest.approx(hand.dimensions["centre_of_mass"], abs=0.01)


# Oracle: geometry: a segment is as long as the distance between its joint centre and the next one's.
def test_segments_are_as_long_as_joint_centres_are_apart(hand):
    length = {row["name"]: row["length"] for row in hand.segments.each()}
    centre = {row["name"].partition(".")[0]: row["centre"] for row in hand.joints.each()}
    for finger in ("index", "middle", "ring", "little"):
        for segment, joint, next_joint in (("proximal", "mcp", "pip"), ("middle", "pip", "dip")):
            apart = np.linalg.norm(centre[f"{finger}_{next_joint}"] - centre[f"{finger}_{joint}"])
            assert length[f"{finger}_{segment}"] == pytest.approx(apart, rel=1e-9)
    assert hand.segments.rows == 16 and hand.joints.rows == 20


# Oracle: mirror in the y-z plane.
def test_a_left_hand_is_the_mirror_image(hand):
    left = hs.Hand(stature=1.75, mass=72, sex="male", side="left")
    assert left.dimensions == hand.dimensions
    assert np.allclose(left.segments["centre_of_mass"], hand.segments["centre_of_mass"] * [-1, 1, 1], atol=1e-15)
    for name in ("low", "high", "stiffness"):
        assert np.array_equal(left.joints[name], hand.joints[name])


# Oracle: measured values stand as given.
def test_measured_values_replace_predicted_ones():
    hand = hs.Hand(stature=1.6, mass=55, sex="female", hand_length=0.17, hand_mass=0.3)
    assert hand.dimensions["length"] == pytest.approx(0.17) and hand.dimensions["mass"] == pytest.approx(0.3)
    assert hs.Hand(person="child").dimensions["length"] < 0.16
    girl = hs.Hand(1.1, 18, "female", age=5)
    assert girl.dimensions == hs.Hand(person="child").dimensions
    # Oracle: the survey's girls of five years: 122 and 56 mm within 2 mm, a thumb of 42 mm within 2 mm.
    assert girl.dimensions["breadth"] == pytest.approx(0.056, abs=0.002)
    assert girl.dimensions["thumb_length"] == pytest.approx(0.042, abs=0.002)


# Oracle: names of the arguments, no places of files that the caller has not written.
def test_every_impossible_value_is_named_as_an_argument():
    with pytest.raises(hs.Error) as caught:
        hs.Hand(stature=17, mass=-3, sex="m", side="right")
    assert {p.key for p in caught.value.problems} == {"stature", "mass", "sex"}
    assert all(p.file is None and p.line is None for p in caught.value.problems)
    assert "stature: got 17, need" in str(caught.value)
    with pytest.raises(hs.Error, match="person: got measures beside a person"):
        hs.Hand(stature=1.7, person="child")


# Oracle: MJCF's masses.
def test_the_export_weighs_as_much(hand):
    root = ET.fromstring(hand.to_mjcf())
    masses = [float(each.get("mass")) for each in root.findall(".//inertial")]
    assert sum(masses) == pytest.approx(hand.dimensions["mass"], rel=1e-9)
    assert ET.fromstring(hand.to_urdf()).tag == "robot"
    assert ET.fromstring(hand.to_osim()).tag == "OpenSimDocument"
    again = pickle.loads(pickle.dumps(hand))
    assert again.dimensions == hand.dimensions and again.to_mjcf() == hand.to_mjcf()


def test_muscles_come_along(hand):
    muscled = hs.Hand(person="median_man", muscles=True)
    names = {muscle.get("name") for muscle in ET.fromstring(muscled.to_osim()).iter("RigidTendonMuscle")}
    assert len(names) == 41 - 6 and "right.FDP2" in names  # those of the wrist alone pull nothing on a fixed palm
    assert ET.fromstring(muscled.to_mjcf()).find("tendon") is not None
    assert not list(ET.fromstring(hand.to_osim()).iter("RigidTendonMuscle"))
    assert len(hs.Hand(stature=1.7, mass=70, model="prototype").joints["name"]) == 16
    with pytest.raises(hs.Error, match="muscles without a hand that has some"):
        hs.Hand(stature=1.7, mass=70, model="prototype", muscles=True)


def test_tables_print_and_become_frames(hand):
    text = repr(hand.segments)
    assert "index_distal" in text and "length[m]" in text
    assert "<th>mass[kg]</th>" in hand.segments._repr_html_()
    pytest.importorskip("pandas", reason="pandas is not installed: there are no frames")
    frame = hand.segments.to_pandas()
    assert len(frame) == 16 and "centre_of_mass.y" in frame.columns


# Oracle: the argument's name.
@pytest.mark.parametrize("strange", ["a", 5, [[1, 2], [3]], memoryview(b"abc"), ("index_distal", "a"), ("index_distal", [1]), ("index_distal", [[1], [1, 2]]), object(), 10**400])
def test_points_and_angles_of_other_kinds_are_refused_by_name(hand, strange):
    q = np.zeros(len(hand.coordinates))
    for call in (hand.position, hand.jacobian):
        with pytest.raises(hs.Error, match="point: got|offset: got"):
            call(q, strange)
    for call in (lambda: hand.to_glb(strange), lambda: hand.to_glb(np.array([q, q]), times=strange), lambda: hand.mesh(strange), lambda: hand.poses(strange)):
        with pytest.raises(hs.Error, match="q: got|times: got"):
            call()
