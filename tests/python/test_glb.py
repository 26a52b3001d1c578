"""Files for viewers: python3 -m handsim export, Hand.to_glb."""
import json
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import handsim as hs
from conftest import BALLS
from handsim import export
from handsim._model import bent, compose, inverse, matrices, skins_of, surface

TYPES = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}
SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    """A file read back by the specification alone."""

    def __init__(self, content):
        magic, version, size, length, kind = struct.unpack("<4sIII4s", content[:20])
        assert (magic, version, size, kind) == (b"glTF", 2, len(content), b"JSON")
        self.json, self.data = json.loads(content[20:20 + length]), content[28 + length:]
        assert self.json["buffers"][0]["byteLength"] == len(self.data) and len(content) % 4 == 0

    def array(self, index):
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        width = SIZES[accessor["type"]]
        out = np.frombuffer(self.data, TYPES[accessor["componentType"]], accessor["count"] * width, view["byteOffset"])
        assert out.nbytes == view["byteLength"] and np.all(np.isfinite(out))
        return out.reshape(-1, width)

    def globals(self, row=None):
        """Matrices of the nodes: as they stand, or at a row of the animation."""
        local = {}
        for i, node in enumerate(self.json["nodes"]):
            x, y, z, w = node.get("rotation", [0, 0, 0, 1])
            local[i] = np.array([*node.get("translation", [0, 0, 0]), w, x, y, z], dtype=float)
        for channel in self.json["animations"][0]["channels"] if row is not None else ():
            sampler = self.json["animations"][0]["samplers"][channel["sampler"]]
            value = self.array(sampler["output"])[row].astype(float)
            if channel["target"]["path"] == "translation":
                local[channel["target"]["node"]][:3] = value
            else:
                local[channel["target"]["node"]][3:] = value[[3, 0, 1, 2]]
        out = {}

        def visit(node, above):
            out[node] = compose(above, local[node])
            for child in self.json["nodes"][node].get("children", []):
                visit(child, out[node])

        for root in self.json["scenes"][0]["nodes"]:
            visit(root, np.array([0.0, 0, 0, 1, 0, 0, 0]))
        return out


@pytest.fixture(scope="module")
def fall():
    """Two hands and a ball, exported with their motion; the scene and the run's table."""
    scene = hs.load("two_hands", {"duration": "0.4 s", "solver.engine": "articulated", "record.every": "10 ms"})
    times, poses = export.simulated(scene, False)
    return scene, times, poses


# Oracle: the run's own poses, by the joint centres that the model has; glTF's rules for skins.
def test_nodes_move_as_the_bodies_do(fall):
    scene, times, poses = fall
    model, skins = scene._model, skins_of(scene._core)
    file = Glb(export.glb_of_model(model, skins, poses, times))
    assert [node["name"] for node in file.json["nodes"][1:len(model.bodies)]] == [body.name for body in model.bodies[1:]]
    assert np.allclose(file.array(file.json["animations"][0]["samplers"][0]["input"]).ravel(), times)
    up = np.array([0, 0, 0, np.sqrt(0.5), -np.sqrt(0.5), 0, 0])
    for row in (0, len(times) // 2, len(times) - 1):
        world = file.globals(row)
        for joint in model.joints:
            centre = compose(up, compose(poses[row, joint.child], joint.child_frame))
            # A track that would move by less than 0.02 mm is left out, at each of up to four joints.
            assert np.allclose(world[joint.child][:3], centre[:3], atol=1e-4), joint.name
    for skin, parts in zip(file.json["skins"], skins):
        assert skin["joints"] == parts.bodies
        mesh = next(node["mesh"] for node in file.json["nodes"] if node.get("skin") is not None and file.json["skins"][node["skin"]] is skin)
        primitive = file.json["meshes"][mesh]["primitives"][0]
        points, joints, shares = (file.array(primitive["attributes"][key]).astype(float) for key in ("POSITION", "JOINTS_0", "WEIGHTS_0"))
        assert np.allclose(shares.sum(axis=1), 1, atol=1e-6)
        assert file.array(primitive["indices"]).max() == len(points) - 1
        bind = file.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1).astype(float)
        row = len(times) - 1
        world = matrices(np.array([file.globals(row)[node] for node in skin["joints"]])) @ bind
        moved = np.einsum("nk,nkij,nj->ni", shares, world[joints.astype(int)], np.concatenate([points, np.ones((len(points), 1))], 1))[:, :3]
        exact = compose(up, np.concatenate([bent(parts, poses[row][parts.bodies]), np.tile([1.0, 0, 0, 0], (len(points), 1))], 1))[:, :3]
        rigid = shares.max(axis=1) > 1 - 1e-6
        assert np.count_nonzero(rigid) > 500 and np.abs(moved - exact)[rigid].max() < 1e-4
        # Linear blending between bodies that are bent by up to 45 degrees: the chord of the arc about a joint.
        assert np.abs(moved - exact).max() < 0.006


# Oracle: closed forms of volume and area; a closed surface has each edge in both directions.
@pytest.mark.parametrize("kind, volume", [("sphere", 4 / 3 * np.pi), ("capsule", 4 / 3 * np.pi + 2 * np.pi), ("cylinder", 2 * np.pi), ("box", 6)])
def test_triangles_enclose_the_shape(kind, volume):
    shape = hs.load(BALLS)._model.shapes[-1]._replace(kind=kind, radius=1.0, length=2.0, edges=np.array([1.0, 2, 3]))
    of = surface(shape)
    a, b, c = (of.points[of.faces[:, k].astype(int)] for k in range(3))
    # 32 sides are within 1 % of the circle.
    assert volume * 0.98 < np.sum(np.cross(a, b) * c) / 6 <= volume * (1 + 1e-9)
    assert np.all(np.sum(np.cross(b - a, c - a) * of.normals[of.faces[:, 0].astype(int)], axis=1) > 0)
    number = {tuple(point): i for i, point in enumerate(np.unique(np.round(of.points, 9) + 0.0, axis=0))}
    faces = [[number[tuple(point)] for point in np.round(of.points[face.astype(int)], 9) + 0.0] for face in of.faces]
    edges = [(face[k], face[(k + 1) % 3]) for face in faces for k in range(3)]
    assert len(set(edges)) == len(edges) and all((second, first) in set(edges) for first, second in edges)


# Oracle: the poses of the hand.
@pytest.mark.parametrize("side", ["right", "left"])
def test_a_hand_has_its_motion(side):
    hand = hs.Hand(stature=1.75, mass=72, sex="male", side=side)
    q = 0.5 * np.minimum(hand.joints["high"], 1)
    file = Glb(hand.to_glb(np.stack([0 * q, q]), times=[0, 1]))
    assert [file.json["nodes"][joint]["name"] for joint in file.json["skins"][0]["joints"]] == hand.bodies
    poses, up = hand.poses(q), np.array([0, 0, 0, np.sqrt(0.5), -np.sqrt(0.5), 0, 0])
    world = file.globals(1)
    for joint in hand._model.joints:
        row = hand.bodies.index(hand._model.bodies[joint.child].name.partition(".")[2])
        centre = compose(up, compose(np.concatenate([poses.position[row], poses.quaternion[row]]), joint.child_frame))
        assert np.allclose(world[joint.child][:3], centre[:3], atol=1e-6), joint.name
    with pytest.raises(hs.Error, match="times: got"):
        hand.to_glb(q, times=[0, 1])


def command(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "export", *map(str, words)], capture_output=True, text=True, check=False)


# Oracle: what is written is what the command says; a run's folder and its scene give one motion.
def test_command_writes_files_of_scene_run_and_person(tmp_path):
    scene = tmp_path / "balls.yaml"
    scene.write_text(json.dumps(BALLS))
    assert command(scene, "--out", tmp_path / "scene.glb").returncode == 0
    hs.load(scene).run(tmp_path / "run", frames=0)
    assert command(tmp_path / "run", "--out", tmp_path / "run.glb").returncode == 0
    first, second = (Glb((tmp_path / f"{name}.glb").read_bytes()) for name in ("scene", "run"))
    assert first.json["animations"] == second.json["animations"] and len(first.json["meshes"]) == 3
    # The high ball falls by g t^2 / 2 to 0.4 s.
    assert command(tmp_path / "run", "--time", 0.4, "--out", tmp_path / "ball.obj").returncode == 0
    heights = [float(line.split()[2]) for line in (tmp_path / "ball.obj").read_text().split("o high")[1].split("\no ")[0].splitlines() if line.startswith("v ")]
    # One step of 1 ms of the solver is g h t / 2 off.
    assert (max(heights) + min(heights)) / 2 == pytest.approx(9 - 9.80665 * 0.4**2 / 2, abs=0.003)
    assert command(scene, "--time", 0.4, "--out", tmp_path / "ball.stl").returncode == 0
    content = (tmp_path / "ball.stl").read_bytes()
    assert len(content) == 84 + 50 * struct.unpack("<I", content[80:84])[0]
    assert command("--person", "child", "--side", "left", "--out", tmp_path / "hand.glb").returncode == 0
    assert "animations" not in Glb((tmp_path / "hand.glb").read_bytes()).json


# Oracle: one sentence, status 2, and no file.
@pytest.mark.parametrize("words, text", [
    (["two_hands", "--out", "a.fbx", "--format", "glb"], "a.fbx"), (["two_hands", "--out", "a.glb", "--format", "usda"], ".usda"),
    (["two_hands", "--out", "a.glb", "--format", "fbx"], "fbx"),
    (["two_hands", "--out", "a.glb", "--time", "7"], "--time"), (["two_hands", "--out", "a.stl", "--time", "-1"], "--time"),
    (["--out", "a.glb"], "scene"), (["two_hands", "--person", "child", "--out", "a.glb"], "scene"), ([".", "--out", "a.glb"], "resolved.yaml"),
    (["two_hands", "--out", "a.glb", "--set", "duration"], "--set"), (["two_hands", "--out", "a.glb", "--fps", "0"], "--fps"),
    (["no_such_scene", "--out", "a.glb"], "no_such_scene"), (["two_hands", "--out", "no/such/folder/a.glb", "--set", "duration=0.01"], "folder")])
def test_wrong_use_is_refused(tmp_path, words, text):
    done = subprocess.run([sys.executable, "-m", "handsim", "export", *words], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2, done
    assert text in done.stderr and len(done.stderr.strip().splitlines()) == 1 and not list(tmp_path.rglob("*.*")), done.stderr


# Oracle: Khronos' validator, where npm has it: NODE_PATH names the folder.
def test_khronos_validator_finds_no_error(tmp_path, fall):
    script = """const v = require('gltf-validator'), fs = require('fs');
        v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r => console.log(JSON.stringify(r.issues)))"""
    node = shutil.which("node")
    if not node or not os.environ.get("NODE_PATH") or not (Path(os.environ["NODE_PATH"]) / "gltf-validator").exists():
        pytest.skip("gltf-validator is missing: npm install gltf-validator, and NODE_PATH its folder node_modules")
    scene, times, poses = fall
    hand = hs.Hand(person="median_woman", side="left")
    for name, content in (("hands", export.glb_of_model(scene._model, skins_of(scene._core), poses, times)), ("hand", hand.to_glb()),
                          ("shapes", export.glb_of_model(scene._model, [], poses, times, hands="shapes"))):
        (tmp_path / f"{name}.glb").write_bytes(content)
        done = subprocess.run([node, "-e", script, str(tmp_path / f"{name}.glb")], capture_output=True, text=True, check=True)
        issues = json.loads(done.stdout)
        assert issues["numErrors"] == issues["numWarnings"] == 0, (name, issues["messages"][:5])


def test_inverse_undoes_a_pose():
    """Oracle: the identity."""
    x = np.array([0.1, -0.2, 0.3, 0.5, -0.5, 0.5, 0.5])
    assert np.allclose(compose(x, inverse(x)), [0, 0, 0, 1, 0, 0, 0], atol=1e-15)


def test_without_out_a_file_is_named_after_what_it_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "balls.yaml").write_text(json.dumps(BALLS))
    assert export.main(["balls.yaml", "--format", "stl"]) == 0
    assert export.main(["--stature", "1.75", "--mass", "70", "--sex", "male", "--side", "right", "--format", "obj", "--hands", "shapes"]) == 0
    assert sorted(each.name for each in (tmp_path / "out").iterdir()) == ["balls.stl", "export.obj"]
    assert export.main(["balls.yaml", "--format", "stl", "--out", "balls.obj"]) == 2 and "a name that ends in .stl" in capsys.readouterr().err
