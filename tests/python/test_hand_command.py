"""``handsim hand``: what it prints, writes and refuses."""
import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import handsim as hs
from handsim import _core

yaml = pytest.importorskip("yaml")
PROGRAM = os.environ.get("HANDSIM_PROGRAM", "")
DATA = hs.data_path()
MAN = ["--stature", "1.75", "--mass", "72", "--sex", "male"]
CHILD = str(DATA / "config/persons/child.yaml")


def hand(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "hand", *words], capture_output=True, text=True, timeout=120)


@pytest.mark.skipif(not PROGRAM, reason="the program is not in the path (HANDSIM_PROGRAM)")
def test_the_program_hands_it_over():
    done = subprocess.run([PROGRAM, "hand", "--person", "child", "--model", "prototype"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stdout == hand("--person", "child", "--model", "prototype").stdout


# Oracle: the tables of `Hand`, whose figures have oracles of their own.
def test_the_table_has_the_figures_of_the_hand():
    of, text = hs.Hand(1.75, 72, "male"), hand(*MAN, "--side", "right").stdout
    for name in ("length", "breadth", "thickness"):
        assert re.search(rf"hand {name} +{1e3 * of.dimensions[name]:.1f} mm", text), text
    assert re.search(rf"hand mass +{1e3 * of.dimensions['mass']:.1f} g", text)
    for row in list(of.segments.each())[1:]:
        assert re.search(rf"{row['name']} +{1e3 * row['length']:.2f} +{1e3 * row['radius']:.2f} +{1e3 * row['mass']:.2f} ", text), row["name"]
    low, high = (np.degrees(of.joints.row(of.coordinates.index("index_pip.flexion"))[key]) for key in ("low", "high"))
    assert f"index_pip (hinge: flexion {low:.0f}..{high:.0f} deg)" in text


# Oracle: the tables of `Hand` of each side, to the last digit but those of another order of sums.
def test_the_yaml_has_the_bodies_of_both_hands(tmp_path):
    done = hand(*MAN, "--out", str(tmp_path / "out"))
    assert done.returncode == (0 if hs.has_pictures else 1), done.stderr
    found = yaml.safe_load((tmp_path / "out/hand.yaml").read_text())
    assert found["person"] == {"stature": 1.75, "mass": 72, "sex": "male"} and list(found) == ["title", "person", "hand", "left", "right"]
    for side in ("left", "right"):
        of, bodies = hs.Hand(1.75, 72, "male", side), found[side]
        assert [each["name"] for each in bodies] == [f"{side}.{name}" for name in of.bodies]
        assert np.allclose([each["centre_of_mass"] for each in bodies], of.segments["centre_of_mass"], atol=1e-15)
        assert [each["mass"] for each in bodies] == of.segments["mass"].tolist()
        assert np.allclose([each["inertia"] for each in bodies], of.segments["inertia"], rtol=1e-15)
        centres = {row["name"].partition(".")[0]: row["centre"] for row in of.joints.each()}
        for each in bodies[1:]:
            assert np.allclose(each["joint_centre"], centres[each["joint"]["name"].partition(".")[2]], atol=1e-15)
            ends = np.array([each["shapes"][0]["to"], each["shapes"][0]["from"]])
            assert np.linalg.norm(ends[0] - ends[1]) <= each["length"] + 1e-15
    if hs.has_pictures:
        assert (tmp_path / "out/hand.png").read_bytes().startswith(b"\x89PNG") and "hand.yaml and hand.png" in done.stdout


# Oracle: the mirror in the y-z plane.
def test_the_yaml_of_a_hand_of_boxes_is_mirrored(tmp_path):
    hand(*MAN, "--model", "prototype", "--out", str(tmp_path / "out"))
    found = yaml.safe_load((tmp_path / "out/hand.yaml").read_text())
    assert found["right"][0]["shapes"][0]["edges"] == found["right"][0]["edges"] == found["left"][0]["edges"]
    for left, right in zip(found["left"], found["right"]):
        assert np.allclose(left["centre_of_mass"], np.array(right["centre_of_mass"]) * [-1, 1, 1], atol=1e-15)


@pytest.mark.parametrize("side", ["right", "both"])
def test_a_person_outside_the_survey_has_one_warning(side):
    done = hand("--stature", "2.1 m", "--mass", "90", "--sex", "female", "--side", side)
    assert done.returncode == 0 and done.stderr.startswith("warning: stature of 2.1 m is outside the survey (") and done.stderr.count("\n") == 1, done.stderr


# What is measured has its own spread of 1 %: nine in ten within 3.1 mm, of 50 hands to about 1 mm.
def test_uncertain_hands_have_intervals():
    done = hand(*MAN, "--hand-length", "190 mm", "--side", "left", "--uncertain", "50")
    assert done.returncode == 0 and "\n50 hands within what is uncertain of this person\n" in done.stdout
    assert re.search(r"hand length .mm. +1(89|90)[.0-9]* +18[678][.0-9]* to 19[234][.0-9]* +hand_length", done.stdout), done.stdout
    assert re.search(r"hand breadth .mm..*hand_breadth [0-9]+ %", done.stdout), done.stdout


# Oracle: the 5th, 50th and 95th percentiles of the 1386 women of tests/data/oracles/ansur2_hands.csv; 2 mm are two standard errors of its 5th
# percentile.
def test_percentiles_are_those_of_the_survey():
    done = hand("--population", "ansur2", "--sex", "female", "--percentile", "5", "50", "95")
    assert done.returncode == 0 and done.stdout.startswith("ansur2, women: percentiles of the hands of 4000 drawn people\n"), done.stderr
    for name, survey in {"hand length": (165, 180, 199), "hand breadth": (72, 78, 85), "palm length": (100, 108, 119), "hand circumference": (172, 187, 202)}.items():
        row = re.search(rf"{name} \[mm\] +(.*)\n", done.stdout)[1]
        assert [float(each) for each in row.split()] == pytest.approx(survey, abs=2.1), name


def test_an_age_names_the_survey_of_children():
    done = hand("--stature", "1.1", "--mass", "18", "--sex", "female", "--age", "5", "--side", "left")
    assert (done.returncode, done.stderr) == (0, "")
    assert all(part in done.stdout for part in ("female, 5 years", "thumb length", "Snyder et al. 1977"))


def test_the_mass_rule_is_that_of_the_persons_sex():
    assert re.search(r"hand mass .*0\.56 % of body mass; its volume at 1148 kg/m3", hand(*MAN).stdout)
    prototype = hand("--stature", "1.75", "--mass", "72", "--sex", "unknown", "--model", "prototype").stdout
    assert re.search(r"hand mass .*% of body mass; at 1000 kg/m3", prototype), prototype


BAD = {
    "nothing of the sex": (["--stature", "1.7", "--mass", "60"], "--sex: got nothing, need one of male, female, unknown"),
    "a misspelt sex": (["--stature", "1.7", "--mass", "60", "--sex", "femal"], "--sex: got femal, need one of male, female, unknown (nearest: female)"),
    "centimetres": (["--stature", "175", "--mass", "60", "--sex", "male"], '--stature: got 175, need a length, 0.5 to 2.5 m, such as "175 cm"'),
    "neither unit": (["--stature", "17", "--mass", "72", "--sex", "male"], '--stature: got 17, need a length, 0.5 to 2.5 m, such as 1.75 or "175 cm"'),
    "grams": (["--stature", "1.75", "--mass", "72000", "--sex", "male"], '--mass: got 72000, need a mass, 2 to 400 kg, such as "72000 g"'),
    "a comma": (["--stature", "1,75", "--mass", "72", "--sex", "male"], "need a decimal point in place of a comma: 1.75"),
    "pounds": (["--stature", "1.75", "--mass", "60 lb", "--sex", "male"], "--mass: got 60 lb, need a mass"),
    "an empty stature": (["--stature", "", "--mass", "60", "--sex", "male"], "--stature: got nothing"),
    "a small circumference": ([*MAN, "--hand-breadth", "0.08", "--hand-circumference", "0.1"], "--hand-circumference: got 0.1 m around a breadth of 0.08 m"),
    "another side": ([*MAN, "--side", "up"], "--side: got up, need one of right, left, both"),
    "a person and a sex": (["--person", CHILD, "--sex", "male"], "--sex: got a value beside --person"),
    "a scene as person": (["--person", str(DATA / "config/two_hands.yaml")], "got a scene, need a person"),
    "a person as model": ([*MAN, "--model", CHILD], "got a person, need a hand model"),
    "no model": ([*MAN, "--model", "/none.yaml"], "--model: got /none.yaml"),
    "a misspelt person": (["--person", "median_mann"], "nearest: median_man"),
    "a misspelt option": (["--statur", "1.7"], "--statur: got an unknown option, need one of handsim hand --help (nearest: --stature)"),
    "one word too many": ([*MAN, "cm"], "arguments: got one too many, cm, need no more; put a value that contains a blank in quotes"),
    "one hand alone": ([*MAN, "--uncertain", "1"], "--uncertain: got 1, need a whole number of hands, 2 to 1000000"),
    "a mass of a population": (["--population", "ansur2", "--mass", "60"], "--mass: got a value beside --population"),
    "a sex of none": (["--population", "ansur2", "--sex", "m"], "--sex: got m, need one of male, female, unknown"),
    "an unknown population": (["--population", "ansur"], "population: got ansur, need ansur2"),
    "a percentile above all": (["--population", "ansur2", "--percentile", "105"], "--percentile: got 105, need a percentile, 0 to 100"),
    "a percentile of one person": ([*MAN, "--percentile", "5"], "--percentile: got a percentile of one person, need --population beside it"),
    "no folder": ([*MAN, "--out", ""], "--out: got nothing"),
    "a forgotten person": (["--person", "--out", "out"], "--person: got nothing, need a value"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_sentence_with_its_option(case):
    words, problem = BAD[case]
    done = hand(*words)
    assert (done.returncode, done.stdout) == (2, "") and problem in done.stderr and done.stderr.count("\n") == 1, done.stderr


# A decimal point is suggested only where its number is accepted.
def test_no_hint_leads_to_a_bad_number():
    assert "17.5" not in hand("--stature", "17,5", "--mass", "72", "--sex", "male").stderr


@pytest.mark.parametrize("model", ["anatomical", "prototype"])
@pytest.mark.parametrize("size", ["1e-9", "0.000000001 HB", " + ".join(8 * ["0.5 m"] + 17 * ["2 HL"])])
def test_sizes_that_are_too_small_or_large_name_their_key(tmp_path, model, size):
    file = tmp_path / "hand.yaml"
    file.write_text(json.dumps({"based_on": str(DATA / f"handmodels/{model}.yaml"), "segments": [{"name": "index_proximal", "radius": size}]}))
    done = hand(*MAN, "--model", str(file))
    assert done.returncode == 2 and "segments.3.radius: got " in done.stderr and "need above 0.01 mm, at most 10 m" in done.stderr, done.stderr


# Oracle: the lock of another process.
def test_a_folder_in_use_and_a_file_in_its_place_are_refused(tmp_path):
    out, file = tmp_path / "out", tmp_path / "file"
    file.write_text("mine")
    other = _core.output_folder(out, ["hand.yaml"], [])
    busy, taken = hand(*MAN, "--out", str(out)), hand(*MAN, "--out", str(file))
    del other
    assert (busy.returncode, taken.returncode) == (2, 2) and busy.stderr.startswith(f"--out: got {out}, in use by another handsim")
    assert taken.stdout == "" and f"{file}: got " in taken.stderr and file.read_text() == "mine"
