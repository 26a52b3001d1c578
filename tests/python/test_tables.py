"""Names, units, texts and frames of tables; paths in mappings; the bar of progress."""
import copy
import pathlib
import pickle
import sys
import types

import numpy as np
import pytest

import handsim as hs
from handsim import _progress


# Oracle: the names themselves.
def test_units_are_beside_the_names():
    table = hs.Table({"time[s]": np.arange(2.0), "right.FDP2.excitation[]": np.zeros(2), "mass[N m s/rad]": np.ones(2),
                      "held": ["yes", "no"]}, "title")
    for each in (table, copy.deepcopy(table), pickle.loads(pickle.dumps(table))):
        assert list(each) == ["time", "right.FDP2.excitation", "mass", "held"] and each.title == "title"
        assert each.units == {"time": "s", "right.FDP2.excitation": "", "mass": "N m s/rad", "held": ""}
        assert repr(each).splitlines()[1].split("  ")[0] == "time[s]"


# Oracle: the column; a wrong unit is not found.
def test_a_name_as_in_the_files_is_found_too():
    sizes = hs.Hand(stature=1.75, mass=72).dimensions
    assert sizes["length[m]"] == sizes["length"] and sizes.units["length"] == "m"
    for wrong in ("length[mm]", "length[]", "none", 3):
        with pytest.raises(KeyError):
            sizes[wrong]


def test_names_that_differ_by_their_units_keep_them():
    both = hs.Quantities({"a[m]": 1, "a[rad]": 2, "b[m]": 3})
    for each in (both, pickle.loads(pickle.dumps(both))):
        assert dict(each) == {"a[m]": 1, "a[rad]": 2, "b": 3} and each.units["a[rad]"] == "rad"


# Oracle: the header of every kind of table that a run and the studies write: no name is there twice.
def test_names_of_a_study_have_no_brackets(can):
    result = hs.load("grasp_power_can", {"duration": "0.1 s", "grasps.0.hold": "0.1 s"}, engine="articulated").run(frames=0)
    tables = {"trajectory": result.trajectory, "figures": result.figures}
    tables.update(hs.study.inverse("muscle_poses", {"duration": "0.1 s"}, check=False, muscles=True).tables)
    tables.update(hs.study.rollouts("rollouts_free_fall", count=2, threads=1).tables)
    for name, table in tables.items():
        assert len(table) > 0 and not [key for key in table if "[" in key], name


def _rollouts(folder):
    return hs.study.rollouts("rollouts_free_fall", count=3, threads=1, out=folder)


# Oracle: the CSV file of the same study.
def test_texts_of_rollouts_h5_are_str(tmp_path):
    pytest.importorskip("h5py", reason="h5py is not installed (python3-h5py)")
    table = _rollouts(tmp_path).tables["rollouts"]
    h5 = hs.study.read_h5(tmp_path / "rollouts.h5")
    assert set(h5) == set(table) and h5.units == {name: table.units[name] for name in h5}
    texts = [name for name, column in h5.items() if isinstance(column, list)]
    assert texts and all(isinstance(value, str) for name in texts for value in h5[name])
    assert h5["state_hash"] == table["state_hash"]
    states = hs.study.read_h5(tmp_path / "rollouts.h5", "trajectories/0")
    assert states.units["time"] == "s" and np.all(np.diff(states["time"]) > 0) and "right.index_mcp.flexion" in states
    for wrong in ("trajectories/7", "rollouts/held", "trajectories", ""):
        with pytest.raises(hs.Error, match="name: got"):
            hs.study.read_h5(tmp_path / "rollouts.h5", wrong)


# Oracle: the table with the same numbers; without pandas the table itself.
def test_table_is_a_frame_where_pandas_is(two_hands, monkeypatch, tmp_path):
    result = two_hands.run(frames=0)
    study = _rollouts(tmp_path)
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "pandas", None)
        assert pickle.loads(pickle.dumps(study)).table["state_hash"] == study.tables["rollouts"]["state_hash"]
        assert isinstance(two_hands.run(frames=0).table, hs.Table)
    pandas = pytest.importorskip("pandas", reason="pandas is not installed (python3-pandas)")
    for frame, table in ((study.table, study.tables["rollouts"]), (result.table, result.trajectory)):
        assert isinstance(frame, pandas.DataFrame) and list(frame) == list(table)
        assert frame.attrs["units"] == table.units
    study.table["double"] = 2 * study.table["ended_at"]  # a column that is added stays
    assert "double" in study.table and "double" not in pickle.loads(pickle.dumps(study)).table


# Oracle: the same scene with its paths as text.
def test_paths_stand_anywhere_in_a_mapping(balls):
    data = hs.data_path()
    assert isinstance(data, pathlib.Path)
    hand = {"model": data / "handmodels/anatomical.yaml", "person": data / "config/persons/median_man.yaml", "side": "left",
            "wrist": {"mount": "fixed", "position": np.array([0, 0, 0.2])}}
    thing = {"file": data / "config/objects/tomato_soup_can.yaml", "name": "can", "position": (0, 0, np.float32(0.5))}
    scene = {"title": "paths", "hands": (hand,), "objects": [thing], "duration": "0.01 s", "effects": ["gravity"]}
    text = {**scene, "hands": [{**hand, "model": str(hand["model"]), "person": str(hand["person"])}],
            "objects": [{**thing, "file": str(thing["file"])}]}
    loaded = hs.load(scene)
    assert loaded.run(frames=0).state_hash == hs.load(text).run(frames=0).state_hash
    woman = data / "config/persons/median_woman.yaml"
    other = hs.load(scene, {"hands.0.person": woman})
    assert other.masses.sum() < loaded.masses.sum()
    for made in (hs.Simulation(scene, {"hands.0.person": woman}), hs.Batch(scene, 1)):
        made.step()
    assert hs.study.effects(scene, {"hands.0.person": woman}, repeats=1).tables["effects"].rows == 2
    sizes = hs.Hand(model=hand["model"], person=woman).dimensions
    assert sizes == hs.Hand(person="median_woman").dimensions
    with pytest.raises(hs.Error, match="persons/none.yaml"):
        hs.load({**scene, "hands": [{**hand, "person": data / "config/persons/none.yaml"}]})
    with pytest.raises(hs.Error, match="scene: got object"):
        hs.load({**scene, "objects": [{"file": object()}]})


# Oracle: the same hand by arguments.
def test_a_person_may_be_a_mapping():
    person = {"stature": 1.6, "mass": 55, "sex": "female", "hand_length": np.float64(0.17)}
    assert hs.Hand(person=person).dimensions == hs.Hand(**person).dimensions
    with pytest.raises(hs.Error, match="^stature: got 17"):
        hs.Hand(person={**person, "stature": 17})


# Oracle: what a terminal shows after the last carriage return: nothing.
def test_a_bar_is_on_stderr_where_it_is_asked_for(two_hands, monkeypatch, capsys):
    monkeypatch.setattr(_progress, "QUIET", 0)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with _progress.bar(True, "study") as told:
        told(0.0)
        told(0.25)
    shown = capsys.readouterr().err
    assert "[##########" in shown and "study: 25%, 0 s left" in shown and shown.split("\r")[-2:] == [" " * 63, ""]
    two_hands.run(frames=0)
    hs.study.rollouts("rollouts_free_fall", count=2, threads=1)
    assert capsys.readouterr().err == ""
    for wrong in (3, "yes", [1]):
        with pytest.raises(hs.Error, match="progress: got .*need True, False or a function"):
            two_hands.run(frames=0, progress=wrong)


# Oracle: the lines by hand; a pipe gets no carriage return.
def test_a_piped_bar_is_a_line_every_ten_seconds(monkeypatch, capsys):
    monkeypatch.setattr(_progress, "QUIET", 0)
    clock = iter([0.0, 9.0, 10.0, 19.0, 20.0])
    monkeypatch.setattr(_progress.time, "monotonic", lambda: next(clock))
    with _progress.bar(True, "run") as told:
        for share in (0.1, 0.2, 0.3, 0.5):
            told(share)
    assert capsys.readouterr().err == "progress: run: 20%, 40 s left\nprogress: run: 50%, 20 s left\n"


class _Shell:
    kernel = object()


class _Handle:
    def __init__(self, contents):
        self.contents = contents

    def update(self, content):
        self.contents.append(content)


# Oracle: IPython's interface, of which this is a small copy: HTML, and a handle that updates what was shown.
def test_a_bar_is_in_a_notebook_by_itself(monkeypatch, capsys):
    contents = []

    def display(content, display_id):
        assert display_id is True
        contents.append(content)
        return _Handle(contents)

    shell = types.SimpleNamespace(get_ipython=lambda: _Shell())
    monkeypatch.setitem(sys.modules, "IPython", shell)
    monkeypatch.setitem(sys.modules, "IPython.display", types.SimpleNamespace(HTML=str, display=display))
    with _progress.bar(None, "study") as told:
        told(0.1)
    assert contents == []  # a short call shows nothing
    monkeypatch.setattr(_progress, "QUIET", 0)
    with _progress.bar(None, "study") as told:
        told(0.5)
        told(0.75)
    assert ['value="0.500"' in contents[0], 'value="0.750"' in contents[1], contents[2]] == [True, True, ""]
    with _progress.bar(False, "study") as told:
        assert told is None
    assert capsys.readouterr().err == ""
