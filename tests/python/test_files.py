"""Every command that writes files, C++ and Python: what is the user's stays, and nothing is half-written (docs/outputs.md).

Oracle: all bytes below a folder before a command and after it.
"""
import importlib.util
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import handsim as hs

DATA = hs.data_path()
PROGRAM = os.environ.get("HANDSIM_PROGRAM") or shutil.which("handsim")
HAND = {"model": str(DATA / "handmodels/anatomical.yaml"), "person": str(DATA / "config/persons/median_man.yaml"), "side": "right"}
BLOCK = {"objects": [{"name": "block", "shape": "box", "edges": [0.04, 0.05, 0.03], "mass": 0.2, "position": [0, 0, 0.01499], "friction": 0.2}],
         "ground": {"friction": 0.2}, "gravity": [4, 0, -8], "effects": ["gravity", "ground_contact", "friction"],
         "solver": {"engine": "articulated", "step": 0.001}, "duration": 0.02, "record": {"every": 0.002, "contacts": True}}
MOVING = {"hands": [{**HAND, "wrist": {"mount": "fixed", "position": [0, 0, 0.2]}}], "effects": ["gravity", "joint_stops", "passive_tissue"],
          "solver": {"engine": "articulated", "step": 0.001}, "duration": 0.02, "record": {"every": 0.002, "markers": True}}


class Command(NamedTuple):
    words: str
    """``OUT`` stands for the folder or the file, other words in capitals for files of the fixture."""
    name: str
    """Of a file that it writes: in the folder, or the file itself."""
    reads: str
    """One of its inputs, of the fixture."""
    folder: bool = True
    python: bool = False
    full: bool = True
    """It takes a second or two: its work is done on a full disk, too."""


COMMANDS = {
    "run": Command("run SLIDE --out OUT", "summary.json", "SLIDE"),
    "hand": Command("hand --person PERSON --out OUT", "hand.yaml", "PERSON"),
    "grasp": Command("grasp GRASP --out OUT", "grasps.csv", "GRASP", full=False),
    "accuracy": Command("accuracy ACCURACY --out OUT", "accuracy.csv", "ACCURACY", full=False),
    "rollouts": Command("rollouts ROLLOUTS --out OUT", "rollouts.csv", "ROLLOUTS"),
    "effects": Command("effects SLIDE --out OUT --repeats 1", "effects.csv", "SLIDE"),
    "validate": Command("validate MEASURED --out OUT", "validate.csv", "MEASURED"),
    "track": Command("track KEYPOINTS --out OUT", "scene.yaml", "KEYPOINTS"),
    "inverse": Command("inverse MOVING --motion MOTION --out OUT", "torques.sto", "MOTION"),
    "render": Command("render SLIDE --out OUT", "a.png", "SLIDE", folder=False),
    "video": Command("render SLIDE --video OUT", "a.gif", "SLIDE", folder=False),
    "report": Command("report RUN --out OUT", "a.html", "RUN/trajectory.csv", folder=False),
    "export xml": Command("export SLIDE --out OUT", "a.xml", "SLIDE", folder=False),
    "export osim": Command("export MOVING --out OUT", "a.osim", "MOVING", folder=False),
    "export urdf": Command("export MOVING --out OUT", "a.urdf", "MOVING", folder=False),
    "export glb": Command("export SLIDE --out OUT", "a.glb", "SLIDE", folder=False, python=True),
    "export usda": Command("export SLIDE --out OUT", "a.usda", "SLIDE", folder=False, python=True),
    "export obj": Command("export SLIDE --out OUT", "a.obj", "SLIDE", folder=False, python=True),
    "export stl": Command("export SLIDE --out OUT", "a.stl", "SLIDE", folder=False, python=True),
    "export glb of a run": Command("export RUN --out OUT", "a.glb", "RUN/trajectory.csv", folder=False, python=True, full=False),
    "identify": Command("identify RUN --scene SLIDE --free objects.0.friction=0.3 --out OUT", "scene.yaml", "SLIDE", python=True),
    "optimise": Command("optimise MOVING --goal GOAL --iterations 1 --quiet --no-run --out OUT", "actions.csv", "GOAL", python=True),
    "compare": Command("compare PERSON PERSON --out OUT", "compare.html", "PERSON", python=True, full=False),
}
if importlib.util.find_spec("trimesh"):
    COMMANDS["object"] = Command("object STL --mass 1kg --unit m --out OUT", "a.yaml", "STL", folder=False, python=True, full=False)  # SciPy writes, too: test_object.py
COMMANDS_WITHOUT = {"completion", "check", "schema", "view", "live", "stability", *({"object"} - set(COMMANDS))}
"""Write nothing; a page on the screen; files of their own tests."""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    if not PROGRAM:
        pytest.skip("the program is not in the path (HANDSIM_PROGRAM)")
    folder = tmp_path_factory.mktemp("files")

    def write(name, content):
        (folder / name).write_text(content if isinstance(content, str) else json.dumps(content))
        return folder / name

    def shipped(name):
        text = (DATA / "config" / f"{name}.yaml").read_text()
        for word in ("handmodels", "controllers"):
            text = text.replace(f"../{word}/", f"{DATA}/{word}/")
        return write(f"{name}.yaml", text.replace("persons/", f"{DATA}/config/persons/").replace("objects/", f"{DATA}/config/objects/"))

    out = {"SLIDE": write("slide.yaml", BLOCK), "MOVING": write("moving.yaml", MOVING), "GRASP": shipped("grasp_pinch"),
           "PERSON": write("me.yaml", {"stature": 1.7, "mass": 70, "sex": "female"}), "ACCURACY": shipped("accuracy_2017"),
           "ROLLOUTS": write("rolls.yaml", {"scene": str(folder / "slide.yaml"), "count": 2, "seed": 1, "vary": {"objects.0.mass": {"uniform": [0.1, 0.3]}}}),
           "MEASURED": write("measured.yaml", {"hand": HAND["model"], "people": {"man": HAND["person"]}, "measurements": [
               {"name": "fist", "kind": "excursion", "person": "man", "muscles": ["FDP3"], "from": {}, "pose": {"middle_mcp.flexion": "85 deg"}, "measured": "12 mm",
                "spread": "4 mm", "source": "a test", "of": "cadavers", "spread_is": "chosen", "value_is": "fitted"}]}), "RUN": folder / "run",
           "GOAL": write("goal.yaml", {"actions": "torques", "of": ["right.index_*"], "hold": "10 ms", "duration": "20 ms",
                                       "costs": [{"angle": "right.index_pip.flexion", "is": 0.01, "at": "20 ms", "weight": 100}]})}
    done = hs.load(out["SLIDE"]).run(out["RUN"], frames=0)
    assert done.passed
    moved = hs.load(out["MOVING"])
    moved.run(folder / "moved", frames=0)
    out["KEYPOINTS"] = Path(shutil.copy(folder / "moved/markers.csv", folder / "keypoints.csv"))
    names = moved.coordinates
    out["MOTION"] = write("motion.csv", "\n".join([",".join(["time[s]", *(f"{name}[rad]" for name in names)])] +
                                                  [",".join(map(str, [0.01 * i, *[0.1 + 0.01 * i] * len(names)])) for i in range(6)]) + "\n")
    corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    facets = "".join("facet normal 0 0 0\nouter loop\n" + "".join("vertex {} {} {}\n".format(*corners[i]) for i in face) + "endloop\nendfacet\n"
                     for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
    out["STL"] = write("tetrahedron.stl", f"solid a\n{facets}endsolid a\n")
    return out


def tree(*folders):
    """All that is below them: bytes of files, where links lead."""
    out = {}
    for folder in folders:
        for path in sorted(Path(folder).rglob("*")):
            out[str(path)] = (os.readlink(path) if path.is_symlink() else path.read_bytes() if path.is_file() else path.stat().st_mode)
    return out


def call(command, files, out, limit=None):
    words = [str(out) if word == "OUT" else str(files[word]) if word in files else word for word in command.words.split()]

    def child():
        if limit is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    start = [sys.executable, "-m", "handsim"] if command.python else [PROGRAM]
    return subprocess.run([*start, *words], capture_output=True, text=True, timeout=300, preexec_fn=child, cwd=files["SLIDE"].parent, stdin=subprocess.DEVNULL)


def refused(command, files, out, place):
    """Ends with status 2 and a sentence, and nothing is other than before."""
    before = tree(place, files["SLIDE"].parent)
    done = call(command, files, out)
    assert done.returncode == 2 and done.stderr.strip() and "Traceback" not in done.stderr, (done.returncode, done.stderr[-600:])
    assert tree(place, files["SLIDE"].parent) == before, done.stderr[-600:]


def target(command, place):
    """The argument OUT, and the file that the command would write."""
    folder = place / "out"
    if command.folder:
        folder.mkdir()
        return folder, folder / command.name
    return place / command.name, place / command.name


def test_every_command_is_here():
    """Oracle: the program's own list."""
    done = subprocess.run([PROGRAM or "handsim", "completion", "bash"], capture_output=True, text=True) if PROGRAM else pytest.skip("no program")
    known = {each.split()[0] for each in COMMANDS} | {command.words.split()[0] for command in COMMANDS.values()} | COMMANDS_WITHOUT
    listed = subprocess.run([PROGRAM, "--help"], capture_output=True, text=True).stdout.partition("ubcommands:")[2]
    names = {line.split()[0] for line in listed.splitlines() if line.startswith("  ") and not line.startswith("   ") and line.split()}
    assert done.returncode == 0 and names and names <= known, names - known


@pytest.mark.parametrize("name", COMMANDS)
def test_no_input_is_replaced(files, tmp_path, name):
    """The file that the command would write is another name of one that it reads."""
    command = COMMANDS[name]
    out, file = target(command, tmp_path)
    source = files["RUN"] / "trajectory.csv" if "/" in command.reads else files[command.reads]
    os.link(source, file)
    refused(command, files, out, tmp_path)


@pytest.mark.parametrize("name", COMMANDS)
def test_folders_pipes_and_links_of_its_name_stay(files, tmp_path, name):
    command = COMMANDS[name]
    for kind in ("folder", "pipe", "broken link", "link"):
        place = tmp_path / kind
        place.mkdir()
        out, file = target(command, place)
        mine = place / "mine.txt"
        mine.write_text("mine")
        if kind == "folder":
            file.mkdir()
            (file / "mine.txt").write_text("mine")
        elif kind == "pipe":
            os.mkfifo(file)
        else:
            file.symlink_to(mine if kind == "link" else place / "nowhere")
        refused(command, files, out, place)


@pytest.mark.parametrize("name", COMMANDS)
def test_other_files_stay(files, tmp_path, name):
    """A file of any other name stays; one of its own name, too, where it is not what the command writes: of the program's commands
    with a folder, which write tables, this holds for the file that --out names alone."""
    command = COMMANDS[name]
    out, file = target(command, tmp_path)
    if not command.folder or command.python:
        file.write_text("my own notes\n")
        refused(command, files, out, tmp_path)
    elif command.full:
        mine = out / "mine.csv"
        mine.write_text("my own notes\n")
        done = call(command, files, out)
        assert done.returncode in (0, 1) and file.is_file() and mine.read_text() == "my own notes\n", done.stderr[-600:]
        # Its own output of before is replaced.
        assert call(command, files, out).returncode == done.returncode


@pytest.mark.parametrize("name", COMMANDS)
def test_where_nothing_can_be_written_it_says_so(files, tmp_path, name):
    command = COMMANDS[name]
    out = Path("/proc/handsim") / ("" if command.folder else command.name)
    for place in (out, Path("/dev/null") / ("" if command.folder else command.name), tmp_path / (300 * "n" + Path(command.name).suffix)):
        done = call(command, files, place)
        assert done.returncode == 2 and done.stderr.strip() and "Traceback" not in done.stderr, (place, done.returncode, done.stderr[-600:])
    if os.geteuid() != 0:
        (tmp_path / "locked").mkdir()
        (tmp_path / "locked").chmod(0o555)
        refused(command, files, tmp_path / "locked" / command.name, tmp_path)


@pytest.mark.parametrize("name", [name for name, command in COMMANDS.items() if command.full])
@pytest.mark.parametrize("limit", [0, 300])
def test_a_full_disk_leaves_no_half_file(files, tmp_path, name, limit):
    """No file may be longer than some bytes, as on a disk that is full: each is whole or not there."""
    command = COMMANDS[name]
    out, file = target(command, tmp_path)
    done = call(command, files, out, limit)
    assert done.returncode in (1, 2) and done.stderr.strip() and "Traceback" not in done.stderr, (done.returncode, done.stderr[-600:])
    # rollouts.part is what --resume goes on from: it is read up to its last whole part.
    left = [path for path in tmp_path.rglob("*") if path.is_file() and path.name != "rollouts.part"]
    assert not [path for path in left if path.name.endswith(".part")], left
    assert all(path.stat().st_size <= limit for path in left)
    for path in left:
        if path.suffix == ".json":
            json.loads(path.read_text())
    assert command.folder or not left


@pytest.mark.skipif(os.geteuid() != 0 or not shutil.which("unshare"), reason="a small disk can be mounted by root alone")
def test_a_small_disk_leaves_no_half_file(files, tmp_path):
    """A disk of one page, in a name space of its own."""
    if subprocess.run(["unshare", "-m", "mount", "-t", "tmpfs", "tmpfs", str(tmp_path)], capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")
    for name, words in {"identify": f"identify {files['RUN']} --scene {files['SLIDE']} --free objects.0.friction=0.3 --out {tmp_path}/o",
                        "optimise": f"optimise {files['MOVING']} --goal {files['GOAL']} --iterations 1 --quiet --no-run --out {tmp_path}/o",
                        "glb": f"export {files['MOVING']} --out {tmp_path}/a.glb --time 0.001"}.items():
        script = (f"mount -t tmpfs -o size=4k tmpfs {tmp_path} && {sys.executable} -m handsim {words}; echo status $?; "
                  f"find {tmp_path} -type f -printf '%f %s\\n'")
        done = subprocess.run(["unshare", "-m", "sh", "-c", script], capture_output=True, text=True, timeout=300)
        assert "status 1" in done.stdout and "Traceback" not in done.stderr and ".part" not in done.stdout, (name, done.stdout, done.stderr[-600:])
        assert "a file that cannot be written (No space left on device)" in done.stderr, (name, done.stderr)


def test_functions_of_python_keep_other_files(files, tmp_path):
    picture = np.zeros((4, 5, 3), np.uint8)
    result = hs.load(files["SLIDE"]).run(frames=0)
    calls = {"a.png": lambda path: hs.save_png(picture, path)}
    if hs.has_reports:
        calls["a.html"] = result.report
    for name, call_ in calls.items():
        mine = tmp_path / name
        mine.write_text("my own notes\n")
        with pytest.raises(hs.Error, match="which exists and is not"):
            call_(mine)
        assert mine.read_text() == "my own notes\n"
        for _ in range(2):  # its own may be replaced
            call_(tmp_path / f"new_{name}")
        with pytest.raises(hs.Error, match="a file that cannot be created"):
            call_(tmp_path / "no/folder" / name)
        with pytest.raises(hs.Error, match="a path"):
            call_(5)


def test_an_earlier_output_of_a_command_is_replaced_and_its_folder_is_locked(files, tmp_path):
    from handsim._files import OutputFolder

    out = tmp_path / "out"
    for _ in range(2):
        assert call(COMMANDS["identify"], files, out).returncode == 0
    with OutputFolder(out, "identified.json", b'{\n "values"', ["scene.yaml"], []):
        done = call(COMMANDS["identify"], files, out)
        assert done.returncode == 2 and f"in use by another handsim (process {os.getpid()})" in done.stderr, done.stderr
    with pytest.raises(hs.Error, match="need a path"), OutputFolder("a\0b", "a", b"", [], []):
        pass


def test_a_refused_command_leaves_no_folder(files, tmp_path):
    done = subprocess.run([sys.executable, "-m", "handsim", "identify", str(files["RUN"]), "--scene", str(files["SLIDE"]), "--free", "objects.0.nose=1",
                           "--out", str(tmp_path / "a/b")], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and not list(tmp_path.iterdir()), done.stderr


@pytest.mark.parametrize("words", ["export SLIDE --out /dev/shm/handsim_test.obj", "identify RUN --scene SLIDE --free objects.0.friction=0.3"])
def test_lost_standard_output_is_status_1(files, tmp_path, words):
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-m", "handsim", *(str(files.get(word, word)) for word in words.split())], stdout=full,
                              stderr=subprocess.PIPE, text=True, timeout=120)
    Path("/dev/shm/handsim_test.obj").unlink(missing_ok=True)
    assert done.returncode == 1 and "output was lost: No space left" in done.stderr and "Traceback" not in done.stderr, done.stderr


@pytest.mark.skipif(not PROGRAM, reason="the program is not in the path (HANDSIM_PROGRAM)")
def test_a_run_takes_its_table_of_excitations_along_and_does_not_replace_it(tmp_path):
    """Oracle: the hash of the run from the other folder, whose table is gone."""
    table = tmp_path / "muscles.sto"
    table.write_text("excitations\nversion=1\nnRows=2\nnColumns=2\ninDegrees=no\nendheader\ntime\tFDP2\n0\t0.5\n1\t0.5\n")
    scene = tmp_path / "a.yaml"
    scene.write_text(json.dumps({**MOVING, "effects": ["muscles", "tendon_coupling", "joint_stops", "passive_tissue"], "excitations": "muscles.sto"}))
    done = subprocess.run([PROGRAM, "run", str(scene), "--out", str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == 2 and "overwrite its own input" in done.stderr, done.stderr
    first = hs.load(scene).run(tmp_path / "out", frames=0)
    table.unlink()
    (tmp_path / "out").rename(tmp_path / "moved")
    assert hs.load(tmp_path / "moved/resolved.yaml").run(frames=0).state_hash == first.state_hash
