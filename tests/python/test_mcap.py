"""MCAP files, read by rosbags, which shares no code with their writer."""
from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import handsim as hs
from handsim import Error


@pytest.fixture(scope="module")
def highlevel():
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed (pip install mcap-ros2-support)")
    return pytest.importorskip("rosbags.highlevel", reason="rosbags is not installed (pip install rosbags)")


def export(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "export", *map(str, words)], capture_output=True, text=True, timeout=300)


def messages(highlevel, path):
    """Times [s] and messages of each topic."""
    out = {}
    with highlevel.AnyReader([path]) as reader:
        for connection, time, raw in reader.messages():
            out.setdefault(connection.topic, []).append((1e-9 * time, reader.deserialize(raw, connection.msgtype)))
    return out


@pytest.fixture(scope="module")
def held(highlevel, tmp_path_factory):
    path = tmp_path_factory.mktemp("mcap") / "can.mcap"
    out = export("grasp_power_can", "--engine", "articulated", "--time", 4, "--out", path, "--quiet")
    assert out.returncode == 0, out.stderr
    return messages(highlevel, path)


def test_joints_are_those_of_the_simulation(held):
    scene = hs.load("grasp_power_can", engine="articulated")
    run = hs.Simulation(scene)
    assert len(held["/joint_states"]) > 200
    for time, message in held["/joint_states"][:120]:
        run.step(substeps=round((time - run.time) / scene.step)) if time > run.time else None
        assert run.time == pytest.approx(time, abs=1e-9) and list(message.name) == scene.coordinates
        assert message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec == pytest.approx(time, abs=1e-9)
        for field, wanted in (("position", run.q), ("velocity", run.u), ("effort", run.tau)):
            assert np.array_equal(getattr(message, field), wanted), (time, field)


def test_transforms_are_the_bodies_poses(held):
    scene = hs.load("grasp_power_can", engine="articulated")
    run = hs.Simulation(scene)
    run.step(substeps=round(held["/tf"][30][0] / scene.step))
    transforms = held["/tf"][30][1].transforms
    assert [each.child_frame_id for each in transforms] == scene.bodies[1:] and {each.header.frame_id for each in transforms} == {"world"}
    for each, place, turn in zip(transforms, run.bodies.position[1:], run.bodies.quaternion[1:]):
        x, q = each.transform.translation, each.transform.rotation
        assert np.array_equal([x.x, x.y, x.z], place) and np.array_equal([q.w, q.x, q.y, q.z], turn)


def test_contact_holds_the_can_against_its_weight(held):
    # Held still: forces add up to the weight, in the can's axes, about its centre of mass to no moment. Fingers get the reaction.
    scene = hs.load("grasp_power_can", engine="articulated")
    weight = 9.80665 * scene.masses[scene.bodies.index("can")]
    turns = {time: next(each.transform.rotation for each in message.transforms if each.child_frame_id == "can") for time, message in held["/tf"]}
    of = [(time, message.wrench) for time, message in held["/contact/can"] if time > 3.8]
    assert len(of) >= 10
    for time, wrench in of:
        q, f = turns[time], np.array([wrench.force.x, wrench.force.y, wrench.force.z])
        r = np.array([q.x, q.y, q.z])
        world = f + 2 * np.cross(r, np.cross(r, f) + q.w * f)
        assert np.allclose(world, [0, 0, weight], atol=0.01 * weight)
        assert np.abs([wrench.torque.x, wrench.torque.y, wrench.torque.z]).max() < 1e-3
    parts = [topic for topic in held if topic.startswith("/contact/right/")]
    assert len(parts) >= 6 and {held[topic][0][1].header.frame_id for topic in parts} == {topic[9:].replace("/", ".") for topic in parts}


def test_a_finished_run_is_the_same_file_as_its_scene(highlevel, tmp_path):
    hs.load("dropped_hand", {"duration": "0.3 s"}).run(out=tmp_path / "run")
    for source, name in ((tmp_path / "run", "a.mcap"), (tmp_path / "run/resolved.yaml", "b.mcap")):
        assert export(source, "--fps", 100, "--out", tmp_path / name).returncode == 0
    a, b = (messages(highlevel, tmp_path / name) for name in ("a.mcap", "b.mcap"))
    assert a.keys() == b.keys() and all(len(a[topic]) == len(b[topic]) == 31 for topic in a)
    assert all(np.array_equal(x.position, y.position) for (_, x), (_, y) in zip(a["/joint_states"], b["/joint_states"]))


def test_wrong_words_end_with_a_reason(highlevel, tmp_path):
    for words, said in ((["--stature", 1.7, "--mass", 60, "--sex", "male"], "got a person"), (["two_hands", "--time", 99], "0 to the end of the motion"),
                        (["two_hands", "--fps", 0], "1 to 1000"), (["nothing.yaml"], "nothing.yaml")):
        out = export(*words, "--out", tmp_path / "a.mcap")
        assert out.returncode == 2 and said in out.stderr and "Traceback" not in out.stderr, out.stderr


def test_without_the_library_there_is_one_sentence(tmp_path):
    code = "import sys; sys.modules['mcap_ros2'] = None; from handsim.__main__ import main; sys.exit(main())"
    out = subprocess.run([sys.executable, "-c", code, "export", "two_hands", "--out", str(tmp_path / "a.mcap")], capture_output=True, text=True, timeout=60)
    assert out.returncode == 2 and "pip install mcap-ros2-support" in out.stderr and not (tmp_path / "a.mcap").exists()


def test_a_run_that_its_scene_does_not_repeat_is_refused(highlevel, tmp_path):
    hs.load("dropped_hand", {"duration": "0.1 s"}).run(out=tmp_path)
    table = tmp_path / "trajectory.csv"
    lines = table.read_text().splitlines()
    column = lines[0].split(",").index("left.palm.z[m]")
    row = lines[-1].split(",")
    row[column] = str(float(row[column]) + 0.01)
    table.write_text("\n".join([*lines[:-1], ",".join(row)]) + "\n")
    out = export(tmp_path, "--fps", 1000, "--out", tmp_path / "a.mcap")
    assert out.returncode == 2 and "does not repeat" in out.stderr
