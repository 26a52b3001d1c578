"""handsim identify: numbers from recordings with noise, their intervals, and bad input."""
import json

import handsim as hs
import numpy as np
import pytest
from handsim._identify_command import main

pytest.importorskip("yaml", reason="numbers of a scene are read by PyYAML")
# A block slides on a table until friction stops it.
SLIDE = {"objects": [{"name": "block", "shape": "box", "edges": [0.04, 0.05, 0.03], "mass": 0.2, "position": [0, 0, 0.01499],
                      "velocity": [0.5, 0, 0], "friction": 0.3}],
         "ground": {"friction": 0.3}, "effects": ["gravity", "ground_contact", "friction"],
         "solver": {"engine": "articulated", "step": 2e-3}, "duration": 0.3, "record": {"every": 0.01, "contacts": True}}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slide")
    (folder / "slide.yaml").write_text(json.dumps(SLIDE))
    hs.load(folder / "slide.yaml").run(folder / "run", frames=0)
    return folder


def noisy(folder, seed):
    """1 mm and 0.05 N, in other units than handsim's."""
    from handsim._identify_command import _read

    random = np.random.default_rng(seed)
    columns = _read(folder / "run")[1]
    rows = [columns["time[s]"], 1e3 * columns["block.x[m]"] + random.normal(size=31), columns["block.force.z[N]"] + 0.05 * random.normal(size=31),
            columns["block.force.x[N]"] + 0.05 * random.normal(size=31)]
    file = folder / f"noisy{seed}.csv"
    np.savetxt(file, np.array(rows).T, delimiter=",", comments="", header="time[s],block.x[mm],block.force.z[N],block.force.x[N]")
    return file


def fit(folder, file, capsys, *more):
    status = main([str(file), "--scene", str(folder / "slide.yaml"), "--free", "objects.0.mass=0.15,objects.0.friction=0.5", "--json", *more])
    said = capsys.readouterr()
    assert status == 0, said.err
    return json.loads(said.out)


def test_mass_and_friction_come_from_noisy_places_and_forces_and_intervals_are_calibrated(recorded, capsys):
    off = []
    for seed in range(8):
        found = fit(recorded, noisy(recorded, seed), capsys)
        values, half = found["values"], found["intervals"]
        off += [(values[key] - true) / half[key] * 1.96 for key, true in (("objects.0.mass", 0.2), ("objects.0.friction", 0.3))]
        assert abs(values["objects.0.mass"] / 0.2 - 1) < 0.02 and abs(values["objects.0.friction"] / 0.3 - 1) < 0.04
        assert 0.7 < found["residual"] < 1.3
    # 16 differences over their deviations: chi-square of 16 degrees, 0.1 and 99.9 %: 3.9 and 39.
    assert 3.9 < np.square(off).sum() < 39


def test_mass_friction_and_tissue_come_within_two_percent():
    from handsim.identify import _Model, identify

    data = hs.data_path()
    scene = {**SLIDE, "hands": [{"model": str(data / "handmodels/anatomical.yaml"), "person": str(data / "config/persons/median_man.yaml"), "side": "right",
                                 "wrist": {"mount": "fixed", "position": [0, 0, 0.2], "rotation": {"axis": [1, 0, 0], "angle": "-90 deg"}},
                                 "pose": {"index_mcp": ["80 deg", 0], "middle_mcp": ["80 deg", 0]}}],
             "objects": [{**SLIDE["objects"][0], "position": [0.1, 0.2, 0.01499], "velocity": [0.9, 0, 0]}],
             "effects": [*SLIDE["effects"], "passive_tissue", "joint_stops"], "contacts": {"rules": [{"between": ["objects", "ground"]}]}}
    names = ["block.shift.x", "block.force.z", "block.force.x", *(f"right.{finger}_distal.place.{axis}" for finger in ("index", "middle") for axis in "yz")]
    actions, deviation = np.zeros((150, 20)), {name: 0.05 if "force" in name else 1e-3 for name in names}
    true = {"objects.0.mass": 0.2, "objects.0.friction": 0.3, "hands.0.tissue.stiffness": 1.0}
    rows = _Model(scene, list(true), actions, "torques", names, None, None, 150).run(np.array(list(true.values()))).reshape(len(names), 150)
    random = np.random.default_rng(0)
    noisy = {name: row + deviation[name] * random.normal(size=150) for name, row in zip(names, rows)}
    found = identify(scene, {"objects.0.mass": 0.15, "objects.0.friction": 0.5, "hands.0.tissue.stiffness": 1.4}, actions, noisy, deviation=deviation,
                     kind="torques")
    assert (np.abs(found.values / list(true.values()) - 1) < 0.02).all() and 0.9 < found.residual < 1.1


def test_a_folder_of_a_run_gives_its_numbers_back_and_a_scene(recorded, tmp_path, capsys):
    found = fit(recorded, recorded / "run", capsys, "--out", str(tmp_path / "out"))
    assert abs(found["values"]["objects.0.friction"] - 0.3) < 1e-4 and abs(found["values"]["objects.0.mass"] - 0.2) < 1e-5
    assert hs.load(tmp_path / "out" / "scene.yaml").masses[1] == pytest.approx(0.2, abs=1e-5)


def test_a_number_of_which_the_recording_says_nothing_has_no_interval(recorded, capsys):
    found = fit(recorded, recorded / "run", capsys, "--columns", "block.x")
    assert found["intervals"]["objects.0.mass"] is None or found["intervals"]["objects.0.mass"] > 0.05


def test_bad_input_is_said(recorded, tmp_path, capsys):
    def error(*words):
        assert main([str(word) for word in words]) == 2
        return capsys.readouterr().err

    scene = ["--scene", recorded / "slide.yaml"]
    assert "--scene: got nothing" in error(tmp_path)
    assert "need a key with a number in the resolved scene, or objects.0.weight=VALUE" in error(recorded / "run", *scene, "--free", "objects.0.weight")
    (tmp_path / "bad.csv").write_text("time[s],nose.x[m]\n0.1,2\n")
    assert "bad.csv:1:1: columns: got nose.x[m], need" in error(tmp_path / "bad.csv", *scene, "--free", "objects.0.mass")
    assert "--deviation: got m=x" in error(recorded / "run", *scene, "--free", "objects.0.mass", "--deviation", "m=x")
    assert "an unknown option" in error(recorded / "run", "--nose")


def test_a_recording_that_says_nothing_is_refused_with_its_line(recorded, tmp_path, capsys):
    """Oracle: the line and the word. A column in which nothing was seen has no residual, and infinity is no gap."""
    cases = {"nan": ("time[s],block.x[m]\n0,nan\n0.002,nan\n", "1:1: block.x[m]: got no number"),
             "inf": ("time[s],block.x[m]\n0,0\n0.002,inf\n0.004,0\n", "3:1: block.x[m]: got inf, need a finite number"),
             "ragged": ("time[s],block.x[m]\n0\n0.01,1,2\n", "2:1: row: got 1 fields, need 2"), "empty": ("", "1:1: columns: got none"),
             "head": ("time[s],block.x[m]\n", "1:1: time[s]: got no row"), "texts": ("time[s],block.x[m]\n0,a\n", "1:1: block.x[m]: got texts"),
             "back": ("time[s],block.x[m]\n0.01,0\n0.005,0\n", "3:1: time[s]: got 0.005 after 0.01"),
             "late": ("time[s],block.x[m]\n0,0\n9999,0\n", "3:1: time[s]: got 9999 s, need times to the scene's duration of 0.3 s"),
             "early": ("time[s],block.x[m]\n0,0\n", "2:1: time[s]: got 1 times"), "twice": ("time[s],block.x[m],block.x[m]\n0,0,0\n", "got block.x[m] twice"),
             "binary": (b"\xff\xfe\0", "a file that is not text in UTF-8")}
    for name, (content, said) in cases.items():
        file = tmp_path / f"{name}.csv"
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        assert main([str(file), "--scene", str(recorded / "slide.yaml"), "--free", "objects.0.friction", "--out", str(tmp_path / "out")]) == 2, name
        err = capsys.readouterr().err
        assert err.startswith(str(file)) and said in err and not (tmp_path / "out").exists(), (name, err)
    for free in ("solver.step", "duration=1", "record.every"):
        assert main([str(recorded / "run"), "--scene", str(recorded / "slide.yaml"), "--free", free]) == 2
        assert "which says how the scene is run" in capsys.readouterr().err
    step = ["--set", "solver.step=1e-6", "--set", "duration=2"]
    (tmp_path / "long.csv").write_text("time[s],block.x[m]\n0,0\n1.5,0\n")
    assert main([str(tmp_path / "long.csv"), "--scene", str(recorded / "slide.yaml"), "--free", "objects.0.friction", *step]) == 2
    assert "long.csv:3:1: time[s]: got 1.5 s, 1500000 steps of 1e-06 s, need at most 1000000 steps" in capsys.readouterr().err
    (tmp_path / "run").mkdir()
    (tmp_path / "run/trajectory.csv").write_bytes((recorded / "run/trajectory.csv").read_bytes())
    for content, said in (("time[s],a\n0,b\n", "b: got no such column"), ((recorded / "run/contacts.csv").read_text().replace("\n0.3,", "\n9,"), "contacts until 9 s")):
        (tmp_path / "run/contacts.csv").write_text(content)
        assert main([str(tmp_path / "run"), "--scene", str(recorded / "slide.yaml"), "--free", "objects.0.friction"]) == 2
        assert said in capsys.readouterr().err


@pytest.mark.parametrize("wrong, said", [
    ({"recorded": {"block.shift.x": [np.nan] * 3}}, "recorded.block.shift.x: got no number"), ({"recorded": {"block.shift.x": [0, np.inf, 0]}}, "got an infinite number"),
    ({"recorded": {"block.shift.x": [0, 0]}}, r"shape \(2,\), need shape \(3,\)"), ({"recorded": {}}, "recorded: got"), ({"recorded": [1]}, "recorded: got"),
    ({"recorded": {"block.shift.x": "a"}}, "recorded.block.shift.x: got str"), ({"deviation": 0}, "deviation: got 0"), ({"deviation": {}}, "none of block.shift.x"),
    ({"deviation": np.nan}, "deviation: got nan"), ({"numbers": {}}, "numbers: got"), ({"numbers": {"solver.step": 1e-3}}, "a number of hands"),
    ({"numbers": {"objects.0.mass": "a"}}, "objects.0.mass: got 'a'"), ({"numbers": {5: 1}}, "numbers: got 5"), ({"actions": 5}, "actions: got shape"),
    ({"actions": [[1], [1, 2]]}, "actions: got list"), ({"times": [0.1, np.nan, 1]}, "times: got"), ({"times": [1, 2, 3]}, "times of the steps"), ({"most": 0}, "most: got 0")])
def test_wrong_arguments_are_refused_by_name(wrong, said):
    from handsim.identify import identify

    right = {"scene": SLIDE, "numbers": {"objects.0.friction": 0.2}, "actions": np.zeros((3, 0)), "recorded": {"block.shift.x": [0, 0.001, 0.002]},
             "deviation": 1e-3, "kind": "torques"}
    with pytest.raises(hs.Error, match=said):
        identify(**{**right, **wrong})
