"""Two hands side by side, and the statics behind it."""
import json

import numpy as np
import pytest

import handsim as hs
from handsim import compare
from handsim._statics import FINGERS, Pressed, Statics, key_pinch, tip_pinch
from handsim._validate import Measurements, grip_run

HAND = {"model": str(hs.data_path() / "handmodels/anatomical.yaml"), "person": str(hs.data_path() / "config/persons/median_man.yaml"),
        "side": "right"}


def scene(folder, name, **changes):
    """A scene file; JSON is YAML."""
    path = folder / f"{name}.yaml"
    path.write_text(json.dumps({"title": name, "hands": [{**HAND, **changes}], "duration": 1,
                                "effects": ["joint_stops", "passive_tissue", "muscles", "tendon_coupling"]}))
    return str(path)


def test_strength_scales_pinch_and_block_weakens_it(tmp_path):
    """Oracles: forces of muscles, active and passive, that are halved halve what they hold, but for tissue (5 %); after the block a row of
    config/clinic.yaml, with the strongest of three postures, has 0.40 of the key pinch, people 0.23 and 0.42."""
    whole, half, blocked = (key_pinch(Statics(compare.hand_of(scene(tmp_path, name, **changes))))
                            for name, changes in (("whole", {}), ("half", {"strength": 0.5}),
                                                  ("blocked", {"without": ["ulnar_nerve_at_wrist"]})))
    assert half / whole == pytest.approx(0.5, abs=0.05)
    assert 0.25 < blocked / whole < 0.5


def test_the_forces_of_a_pinch_have_no_couple(monkeypatch):
    """Oracle: Newton's third law: forces that two fingertips exchange, leaning or not, do not turn the hand about its wrist, and turn joints of thumb and
    index."""
    of, seen = Statics(compare.hand_of("median_man")), []
    monkeypatch.setattr(Statics, "torques", lambda self, q, point, forces: np.asarray(self.hand.jacobian(q, point)[:3].T @ forces.T))
    monkeypatch.setattr(Statics, "press", lambda self, q, rows, forces, *_: seen.append(forces) or Pressed(0.0, np.zeros(0), np.zeros(0)))
    tip_pinch(of)
    assert seen[0].shape[1] == 8 and np.abs(seen[0][of.rows("wrist")]).max() < 1e-12
    assert np.abs(seen[0][of.rows("thumb_cmc", "index_mcp")]).min(axis=0).max() > 1e-3


def test_a_ligament_helps_on_the_side_where_it_is_taut():
    """Oracle: an index that is abducted by 15 deg at 45 deg of flexion has its ulnar collateral ligament taut and the radial one slack: within the posture it
    holds against a load that abducts it further, and against one that turns it back only tissue does. Straight, both sides are alike but for muscles."""
    of = Statics(compare.hand_of("median_man"))
    row = of.names.index("index_mcp.abduction")
    against_more, against_less = (abs(each) for each in of._gives(of.within({"index_mcp.flexion": 45.0, "index_mcp.abduction": 15.0}), row))
    assert against_more > 2 * against_less
    both = [abs(each) for each in of._gives(of.within({"index_mcp.flexion": 45.0}), row)]
    assert max(both) < 1.2 * min(both)


def test_hands_of_python_take_the_keys():
    """Oracle: the keys: a muscle that is gone has no force to speak of, others stay; a fused joint has no range."""
    hand = hs.Hand(person="median_man", muscles=True, what_if={"without": ["FDP2"], "fused": {"index_pip": "30 deg"}})
    force = {muscle.name.partition(".")[2]: muscle.force for muscle in hand.scene.muscles}
    assert force["FDP2"] < 1e-3 < 100 < force["FDP3"]
    row = hand.joints.row(hand.joints["name"].index("index_pip.flexion"))
    assert row["high"] - row["low"] == pytest.approx(2e-3) and row["low"] < np.radians(30) < row["high"]
    with pytest.raises(hs.Error, match="what_if: got witout"):
        hs.Hand(person="median_man", what_if={"witout": 1})
    with pytest.raises(hs.Error, match="strength: got a hand without muscles"):
        hs.Hand(person="median_man", what_if={"strength": 0.5})


def test_the_command_writes_pages_and_names_mistakes(tmp_path, capsys):
    """Oracle: the files by name; a wrong key is an error of status 2, and nothing is written."""
    one = scene(tmp_path, "one")
    assert compare.main([one, "--set", "hands.0.without=[ulnar_nerve]", "--out", str(tmp_path / "bad")]) == 2
    assert "got ulnar_nerve, need a nerve at a level" in capsys.readouterr().err
    assert compare.main([one]) == 2 and compare.main([one, "--sett", "a=b"]) == 2 and compare.main(["--help"]) == 0
    assert not (tmp_path / "bad").exists()
    capsys.readouterr()
    assert compare.main([one, "--set", "hands.0.strength=0.5", "--out", str(tmp_path / "out")]) == 0
    assert "key pinch" in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["compare.html", "compare.json", "compare.svg"]
    found = json.loads((tmp_path / "out/compare.json").read_text())
    assert found["A"]["tenodesis"]["index_mcp"][0] > found["A"]["tenodesis"]["index_mcp"][-1] + 10  # flexion opens the fingers


def test_persons_are_compared_as_scenes_of_their_hands(tmp_path, capsys):
    """Oracle: the scene that has the person; a man's hand beside a woman's, and a file of one's own."""
    of_scene, of_person = (key_pinch(Statics(compare.hand_of(source))) for source in (scene(tmp_path, "man"), "median_man"))
    assert of_person == pytest.approx(of_scene, rel=1e-9)
    mine = tmp_path / "me.yaml"
    mine.write_text("stature: 1.7 m\nmass: 70 kg\nsex: female\n")
    assert compare.hand_of(str(mine)).side == "right" and len(compare.hand_of(str(mine), ["hands.0.strength=0.5"]).scene.muscles) == 41
    mine.write_text("stature: 17 m\nmass: 70 kg\nsex: female\n")
    assert compare.main([str(mine), "median_man"]) == 2
    assert f"{mine}:1:10: " in capsys.readouterr().err
    assert compare.main(["no_such_person", "median_man"]) == 2 and "no_such_person" in capsys.readouterr().err


def test_rows_outside_of_people_are_marked_with_what_was_measured(tmp_path):
    """Oracle: config/clinic.yaml: after an ulnar block people keep 0.62 and 0.73 of a grip and 0.42 of a tip pinch; a half-strong hand is no such block."""
    pytest.importorskip("yaml", reason="people's values are read by PyYAML")
    hands = [compare.hand_of("median_man"), compare.hand_of("median_man", ["hands.0.without=[ulnar_nerve_at_wrist]"])]
    rows = [("grip", "N", 372.0, 371.0), ("key pinch", "N", 111.0, 36.6), ("tip pinch", "N", 76.8, 74.0), ("index fingertip, palmar", "N", 47.9, 6.3),
            ("index fingertip, distal", "N", 19.9, 1.5)]
    found = compare.measured(hands, rows)
    assert found["grip"].text == "0.62 ± 0.10, 0.73 ± 0.10" and found["grip"].outside and "Kozin" in found["grip"].source
    assert not found["key pinch"].outside and found["tip pinch"].outside
    # Of the whole hand alone: the blocked one has lost what these people had.
    assert found["index fingertip, palmar"].text == "27.9 ± 4.1 N" and found["index fingertip, palmar"].outside and not found["index fingertip, distal"].outside
    weak = compare.measured([hands[0], compare.hand_of("median_man", ["hands.0.strength=0.5"])], rows)
    assert "grip" not in weak and "grip" not in compare.measured([compare.hand_of("median_woman"), hands[1]], rows)
    both = [{"strength": dict.fromkeys(("grip", "key pinch"), 1.0), "planes": [np.ones((48, 2)).tolist()] * 3, "workspace_cm3": 1, "workspace": [[[0, 0], [30, 60]]] * 2,
             "tenodesis": {joint: [0] * 7 for joint in compare.JOINTS}}] * 2
    page = compare.page(["A", "B"], both, found)
    assert page.count("<tr class=outside>") == 2 and "0.62 ± 0.10, 0.73 ± 0.10, outside" in page and "Do not rely" not in page and "do not rely on them" in page


def test_the_grip_is_the_one_of_validate(tmp_path):
    """Oracles: the row of config/validate.yaml for the same man; a left hand is the right one's image; a wrist that a splint holds never grips with less; a
    finger that is fused straight presses nothing; half of all forces is half a grip, but for tissue (5 %); a block takes something."""
    def grips(name, **changes):
        return compare._grips(compare.hand_of(scene(tmp_path, name, **changes)))

    man = grips("man")
    measurements = Measurements(hs.data_path() / "config/validate.yaml")
    row = next(row for row in measurements.rows if row["name"] == "dynamometer grip, man of 30 years, 1.75 m")
    assert man["grip"] == pytest.approx(grip_run(row).force(), rel=5e-3)
    assert sum(man[f"grip, {finger}"] for finger in FINGERS) == pytest.approx(man["grip"], rel=1e-12) and min(man.values()) > 0
    assert grips("left", side="left")["grip"] == pytest.approx(man["grip"], rel=1e-9)
    assert man["grip, wrist in a splint"] >= man["grip"]
    straight = grips("straight", fused=dict.fromkeys(("index_mcp", "index_pip", "index_dip"), "0 deg"))
    assert straight["grip, index"] == 0 and straight["grip"] < 0.95 * man["grip"]
    assert grips("half", strength=0.5)["grip"] == pytest.approx(0.5 * man["grip"], rel=0.05)
    assert grips("blocked", without=["ulnar_nerve_at_wrist"])["grip"] < 0.95 * man["grip"]
