"""C3D recordings, written by ezc3d itself: angles are those of the same numbers by CSV, to the bit."""
from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import handsim as hs
from handsim import Error
from handsim._live.streams import KEYPOINTS
from handsim._live.tracker import HandFilter, turned
from handsim._model import matrices
from handsim._objects import read_courses

NAMES = [f"right.{name}" for name in KEYPOINTS]
LABELS = [f"Ann:R{i:02}" for i in range(21)]


@pytest.fixture(scope="module")
def points():
    """A hand that turns and bends, 40 frames [m], shape (40, 21, 3)."""
    pytest.importorskip("ezc3d", reason="ezc3d is not installed (pip install ezc3d)")
    filter_ = HandFilter(hs.load("grasp_power_can"), 0)
    low, high = filter_._low, filter_._high
    out = []
    for t in np.arange(40) / 40:
        wrist = np.concatenate(([0.05 * t, 0.1, 0.9], turned(np.array([0.3 * t, 0.2, 0.1]), np.array([1.0, 0, 0, 0]))))
        out.append(filter_.points(np.concatenate((wrist, np.clip(0.2 + 0.6 * t, low, high)))))
    return np.array(out)


def write(path, points, *, unit="mm", rate=100.0, labels=LABELS, first=0, screen=None, bodies=None):
    import ezc3d

    scale = {"mm": 1e3, "cm": 1e2, "m": 1.0}.get(unit, 1.0)
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["LABELS"]["value"], point["UNITS"]["value"] = [rate], list(labels), [unit]
    file["header"]["points"]["first_frame"] = first
    if screen:
        file.add_parameter("POINT", "Y_SCREEN", [screen])
    data = np.ones((4, points.shape[1], len(points)))
    data[:3] = np.float32(scale * points).transpose(2, 1, 0)
    file["data"]["points"] = data
    if bodies:
        for name, value in (("USED", [len(bodies)]), ("LABELS", list(bodies)), ("RATE", [rate])):
            file.add_parameter("ROTATION", name, value)
        stacked = np.array(list(bodies.values()), float)  # bodies, frames, 4, 4
        stacked[..., :3, 3] *= scale
        file["data"]["rotations"] = stacked.transpose(2, 3, 0, 1)
    file.write(str(path))
    return path


def write_csv(path, points, *, rate=100.0, names=NAMES, first=0, unit="mm"):
    columns = ["time[s]", *(f"{name}.{axis}[{unit}]" for name in names for axis in "xyz")]
    rows = np.column_stack(((first + np.arange(len(points))) / rate, np.float32({"mm": 1e3, "m": 1}[unit] * points).reshape(len(points), -1)))
    np.savetxt(path, rows, "%.17g", ",", header=",".join(columns), comments="")
    return path


@pytest.fixture
def names(tmp_path):
    path = tmp_path / "names.yaml"
    path.write_text("# of the laboratory\n" + "".join(f"{label}: {name}\n" for label, name in zip(LABELS, NAMES)))
    return path


def same(a, b, tolerance=0.0):
    assert a.tables.keys() == b.tables.keys() and "right" in a.tables
    for table in ("right", "right_wrist", "frames"):
        for column in a.tables[table]:
            one, two = (np.asarray(of.tables[table][column]) for of in (a, b))
            if one.dtype.kind == "f":
                assert np.allclose(one, two, rtol=0, atol=tolerance, equal_nan=True), (table, column, np.nanmax(np.abs(one - two)))
            else:
                assert (one == two).all(), (table, column)


def test_angles_are_those_of_the_csv_route_to_the_bit(points, names, tmp_path):
    same(hs.study.track(write(tmp_path / "a.c3d", points), names=names), hs.study.track(write_csv(tmp_path / "a.csv", points)))


@pytest.mark.parametrize("rate,first", [(59.94, 0), (200.0, 0), (120.0, 7)])
def test_rate_and_first_frame_are_the_file_s(points, names, tmp_path, rate, first):
    found = hs.study.track(write(tmp_path / "a.c3d", points, rate=rate, first=first), names=names)
    rate = float(np.float32(rate))  # as the file has it
    same(found, hs.study.track(write_csv(tmp_path / "a.csv", points, rate=rate, first=first)))
    assert found.tables["right"]["time"][1] == pytest.approx((first + 1) / rate, abs=1e-6)


@pytest.mark.parametrize("unit", ["m", "cm"])
def test_units_other_than_mm(points, names, tmp_path, unit):
    # float32 of metres and of millimetres differ by 1e-7 of a coordinate.
    same(hs.study.track(write(tmp_path / "a.c3d", points, unit=unit), names=names), hs.study.track(write_csv(tmp_path / "a.csv", points)), 1e-2)


@pytest.mark.parametrize("screen,up", [("+Y", None), (None, "y"), ("+Z", "y")])
def test_y_that_points_up_becomes_z(points, names, tmp_path, screen, up):
    lying = np.stack((points[..., 0], points[..., 2], -points[..., 1]), axis=-1)
    same(hs.study.track(write(tmp_path / "a.c3d", lying, screen=screen), names=names, up=up), hs.study.track(write_csv(tmp_path / "a.csv", points)))


def test_gaps_are_points_that_were_not_seen(points, names, tmp_path):
    with_gaps = points.copy()
    with_gaps[5:9, 8] = np.nan
    with_gaps[20, [3, 12]] = np.nan
    zeros = with_gaps.copy()
    zeros[20, [3, 12]] = 0  # as some programs write them
    wanted = hs.study.track(write_csv(tmp_path / "a.csv", with_gaps))
    same(hs.study.track(write(tmp_path / "a.c3d", with_gaps), names=names), wanted)
    same(hs.study.track(write(tmp_path / "b.c3d", zeros), names=names), wanted)


def course(count):
    """Of a rigid body: poses x y z and quaternion [m], and as matrices."""
    poses = np.array([np.concatenate(([0.1 + 0.002 * k, -0.05, 0.9 + 1e-5 * k * k], turned(np.array([0.01 * k, 0.3, -0.02 * k]), np.array([1.0, 0, 0, 0]))))
                      for k in range(count)])
    return poses, matrices(poses)


# Oracle: the same numbers as columns object.can.x of a table, to float32, in which a C3D file keeps them.
@pytest.mark.parametrize("unit, screen", [("mm", None), ("m", "+Y"), ("cm", None)])
def test_rigid_bodies_are_objects(points, names, tmp_path, unit, screen):
    poses, placed = course(len(points))
    turn = np.eye(4) if screen is None else np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    lying = np.einsum("ij,nkj->nki", turn[:3, :3], points)
    lost = np.einsum("ij,njk->nik", turn, placed)
    lost[7] = 0  # was not seen
    path = write(tmp_path / "a.c3d", lying, unit=unit, screen=screen, bodies={"Ann:can_1": lost, "box": np.einsum("ij,njk->nik", turn, placed)})
    names.write_text(names.read_text() + "Ann:can_1: object.can\n")
    found = read_courses(path, ["can", "box"], names)
    assert np.isnan(found["can"].poses[7]).all()
    seen = np.arange(len(poses)) != 7
    for name, rows in (("can", seen), ("box", seen | True)):
        assert np.allclose(found[name].poses[rows, :3], poses[rows, :3], rtol=0, atol=1e-6)
        assert np.allclose(np.abs((found[name].poses[rows, 3:] * poses[rows, 3:]).sum(axis=1)), 1, rtol=0, atol=1e-6)
    with pytest.raises(Error, match=r"no rigid body cup; objects that it has: box, can"):
        read_courses(path, ["cup"], names)
    # Hands are tracked as without them.
    tolerance = 0.0 if unit == "mm" else 1e-2
    same(hs.study.track(path, names=names), hs.study.track(write_csv(tmp_path / "a.csv", points)), tolerance)


def test_forces_on_a_rigid_body_of_c3d_are_those_of_a_table(points, names, tmp_path):
    pytest.importorskip("scipy", reason="SciPy is not installed")
    poses, placed = course(len(points))
    path = write(tmp_path / "a.c3d", points, bodies={"can": placed})
    table = np.loadtxt(write_csv(tmp_path / "a.csv", points), delimiter=",", skiprows=1)
    head = (tmp_path / "a.csv").read_text().partition("\n")[0]
    head += "".join(f",object.can.{part}" for part in ("x[m]", "y[m]", "z[m]", "qw", "qx", "qy", "qz"))
    np.savetxt(tmp_path / "b.csv", np.column_stack((table, np.float32(poses))), "%.17g", ",", header=head, comments="")
    a = hs.study.track(path, names=names, object="can=tomato_soup_can").tables["contact_forces"]
    b = hs.study.track(tmp_path / "b.csv", object="can=tomato_soup_can").tables["contact_forces"]
    for axis in "xyz":
        assert np.allclose(a[f"wrench.force.{axis}"], b[f"wrench.force.{axis}"], rtol=0, atol=0.02)
    assert list(a["state"]) == list(b["state"])


def test_markers_have_the_names_of_their_set(points, tmp_path):
    # Four markers on the palm and one on the index finger; the set's own names stand behind the subject's.
    at = {"WR": (0, [0, 0, 0.02]), "K2": (5, [0, 0, 0.01]), "K5": (17, [0, 0, 0.01]), "P": (9, [0, 0, 0.01])}
    (tmp_path / "set.yaml").write_text("markers:\n" + "".join(f"  - {{name: {name}, segment: palm, at: [{0.01 * i}, {0.02 + 0.02 * i}, 0.01]}}\n" for i, name in enumerate(at)))
    chosen = points[:, [index for index, _ in at.values()]]
    labels = [f"Bob:{name}" for name in at]
    options = {"markers": tmp_path / "set.yaml", "fit_bones": False}
    a = hs.study.track(write(tmp_path / "a.c3d", chosen, labels=labels), **options)
    b = hs.study.track(write_csv(tmp_path / "a.csv", chosen, names=list(at)), **options)
    for column in a.tables["right_wrist"]:
        assert np.array_equal(a.tables["right_wrist"][column], b.tables["right_wrist"][column])
    assert np.ptp(a.tables["right_wrist"][column]) > 0


def test_wrong_labels_are_named_all_at_once(points, names, tmp_path):
    file = write(tmp_path / "a.c3d", points)
    names.write_text(names.read_text() + "Ann:R99: right.other\nnothing\nAnn:R00: right.twice\n")
    with pytest.raises(Error) as error:
        hs.study.track(file, names=names)
    assert "names.yaml:24:1: got 'nothing'" in str(error.value) and "names.yaml:25:1: Ann:R00: got a label or a name twice" in str(error.value)
    names.write_text("R00: right.wrist\nR77: right.index_tip\nR78: right.index_dip\n")
    with pytest.raises(Error, match="--names: got R77, R78, need labels of .*Ann:R00, Ann:R01"):
        hs.study.track(file, names=names)
    with pytest.raises(Error, match=f"^{file}: got no point of a hand, but R00.*need keypoints such as right"):
        hs.study.track(file)
    out = command(file, "--out", tmp_path / "out")
    assert out.returncode == 2 and out.stderr.startswith(f"{file}: got no point of a hand") and "handsim_c3d_" not in out.stderr


def test_points_that_the_file_does_not_have_are_as_by_csv(points, names, tmp_path):
    few = [0, 5, 9, 13, 17, 6, 7, 8]
    chosen, labels = points[:, few], [LABELS[i] for i in few]
    names.write_text("".join(f"{LABELS[i]}: {NAMES[i]}\n" for i in few))
    by_csv = hs.study.track(write_csv(tmp_path / "a.csv", chosen, names=[NAMES[i] for i in few]), fit_bones=False)
    by_c3d = hs.study.track(write(tmp_path / "a.c3d", chosen, labels=labels), names=names, fit_bones=False)
    assert [each.replace("a.c3d", "a.csv") for each in by_c3d.summary["warnings"]] == by_csv.summary["warnings"]
    same(by_c3d, by_csv)


def test_files_that_are_wrong_end_with_a_reason(points, names, tmp_path):
    whole = write(tmp_path / "a.c3d", points).read_bytes()
    for name, content in {"empty": b"", "text": b"time[s],x\n" * 50, "head": whole[:300], "half": whole[:len(whole) // 2]}.items():
        path = tmp_path / f"{name}.c3d"
        path.write_bytes(content)
        # In a process of its own: what the library does to a spoilt file is its own affair.
        out = command(path, "--names", names, "--out", tmp_path / name)
        assert out.returncode in (1, 2) and "Traceback" not in out.stderr and out.stderr.strip(), (name, out.returncode, out.stderr[-300:])
    for unit, said in {"inch": "POINT:UNITS 'inch', need mm, cm or m"}.items():
        with pytest.raises(Error, match=said):
            hs.study.track(write(tmp_path / "u.c3d", points, unit=unit), names=names)
    with pytest.raises(Error, match=r"POINT:Y_SCREEN \+X"):
        hs.study.track(write(tmp_path / "x.c3d", points, screen="+X"), names=names)
    with pytest.raises(Error, match="need y or z"):
        hs.study.track(tmp_path / "a.c3d", names=names, up="x")
    with pytest.raises(Error, match="a recording in C3D"):
        hs.study.track(tmp_path / "a.csv", names=names)
    with pytest.raises(Error, match="no file"):
        hs.study.track(tmp_path / "none.c3d")


def command(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "track", *map(str, words)], capture_output=True, text=True, timeout=120)


def test_the_command_writes_what_python_returns(points, names, tmp_path):
    file = write(tmp_path / "a.c3d", points)
    out = command(file, "--names", names, f"--out={tmp_path / 'out'}", "--json")
    assert out.returncode == 0 and '"hands"' in out.stdout, out.stderr
    wanted = hs.study.track(file, names=names)
    found = hs.study.read_sto(tmp_path / "out/right.mot")
    assert all(np.array_equal(found[column], wanted.tables["right"][column]) for column in found)
    assert command(file, "--up", "y", "--nonsense").returncode == 2
    assert "--names FILE" in command("--help").stdout


def test_without_ezc3d_there_is_one_sentence(tmp_path):
    file = tmp_path / "a.c3d"
    code = "import sys; sys.modules['ezc3d'] = None; from handsim.__main__ import main; sys.exit(main())"
    out = subprocess.run([sys.executable, "-c", code, "track", str(file), "--out", str(tmp_path / "out")], capture_output=True, text=True, timeout=60)
    assert out.returncode == 2 and "pip install ezc3d" in out.stderr and "Traceback" not in out.stderr and not (tmp_path / "out").exists()


def test_other_words_that_end_in_c3d_are_no_recording(points, names, tmp_path):
    table = write_csv(tmp_path / "a.csv", points)
    for word in (f"--out={tmp_path / 'x.c3d'}",), ("--out", tmp_path / "y.c3d"):
        assert command(table, *word).returncode == 0
    assert (tmp_path / "x.c3d/right.mot").is_file() and (tmp_path / "y.c3d/right.mot").is_file()


def test_words_of_other_formats_do_not_start_the_command_anew(tmp_path):
    # The program calls the package for such words, and the package the program: once each.
    for words in (("track", tmp_path / "none.csv", "--out", tmp_path / "x.glb"), ("export", "two_hands", "--out", tmp_path / "a.xml", "--set", "title=glb")):
        out = subprocess.run([sys.executable, "-m", "handsim", *map(str, words)], capture_output=True, text=True, timeout=60)
        assert out.returncode == (2 if words[0] == "track" else 0) and "Traceback" not in out.stderr, out.stderr


HEAD = bytes([2, 0x50]) + np.array([1, 0, 1, 2], "<u2").tobytes() + bytes(2000)
"""What is looked at before ezc3d reads the file: one of two frames."""


# Oracle: a module of the same name that does what ezc3d does to some spoilt files: it ends the process, or does not return.
@pytest.mark.parametrize("does, said", [("import os; os.abort()", "signal 6"), ("import time; time.sleep(1000)", "does not end to read within"),
                                        ("class c3d(dict):\n    def __init__(self, path):\n        raise RuntimeError('spoilt')", "spoilt"),
                                        ("class c3d(dict):\n    def __init__(self, path):\n        bytearray(10**12)", "MemoryError"),
                                        ("raise SystemExit(0)", "it gave nothing")])
def test_what_a_spoilt_file_does_to_ezc3d_ends_in_a_sentence(tmp_path, monkeypatch, does, said):
    from handsim import _c3d

    (tmp_path / "ezc3d.py").write_text(does + "\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(_c3d, "SECONDS", 2.0)
    (tmp_path / "a.c3d").write_bytes(HEAD)
    with pytest.raises(Error, match=f"a.c3d: got .*{said}.*, need a whole C3D file"):
        _c3d.table_of(str(tmp_path / "a.c3d"))


# Oracle: the letter of Latin-1. ezc3d gives bytes that are no UTF-8 as surrogates.
def test_labels_in_latin_1_are_names(tmp_path, monkeypatch):
    from handsim import _c3d

    (tmp_path / "ezc3d.py").write_text("""
import numpy as np
def c3d(path):
    label = b"F\\xe4ust".decode("utf-8", "surrogateescape")
    return {"parameters": {"POINT": {"LABELS": {"value": [label]}, "UNITS": {"value": ["mm"]}, "RATE": {"value": [100.0]}}}, "header": {"points": {"first_frame": 0}},
            "data": {"points": np.ones((4, 1, 2)), "meta_points": {"residuals": np.zeros((1, 1, 2))}}}
""")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "a.c3d").write_bytes(HEAD)
    assert _c3d.table_of(str(tmp_path / "a.c3d"))[0][1] == "F\u00e4ust.x[mm]"
    with _c3d.as_csv(str(tmp_path / "a.c3d")) as table:
        assert table.read_text(encoding="utf-8").startswith("time[s],F\u00e4ust.x[mm]")
