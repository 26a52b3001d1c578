"""Live sessions in which something goes wrong. Oracles: bit equality with the recording, closed forms, and files that stay."""
import base64
import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
import tracemalloc
import urllib.error
import urllib.request
import zlib
from importlib.util import find_spec

import numpy as np
import pytest
from conftest import BALLS, ROOT

import handsim as hs
from handsim._live.commands import READERS, read_command
from handsim._live.replay import LARGEST_CONTENT, Replay
from handsim._live.saving import save
from handsim._live.session import Session
from handsim._live.streams import Follower

sys.path.insert(0, str(ROOT / "tests/live"))
from random_sessions import MESSAGES, sessions  # noqa: E402

needs_server = pytest.mark.skipif(not hs.has_reports or not find_spec("aiohttp"),
                                  reason="aiohttp or three.js is missing")


def do(session, what, /, **values):
    """A command, in a session that has no thread."""
    session.send(read_command({"do": what, **values}, session.facts))
    session._take()
    while session._building is not None:
        session._building.join()
        session._take()


def repeated(session):
    found = Replay(session.history.recording())
    found.run()
    return found


@pytest.fixture
def hands(two_hands):
    return Session(two_hands)


@pytest.fixture
def balls_session():
    return Session(hs.load(BALLS))


# Objects.

def test_objects_have_the_numbers_that_they_have_in_the_scene_file(tmp_path):
    # The table is static and comes first.
    session = Session(hs.load("stability/resting_capsule"))
    assert {"objects.0.friction", "objects.1.friction", "objects.1.mass"} <= session.facts.numbers.keys() and "objects.0.mass" not in session.facts.numbers
    do(session, "number", name="objects.1.friction", value=0.123)
    core, body = session.course.core, session.facts.bodies.index("capsule")
    assert core.get("objects.1.friction")[0] == 0.123 and core.get("objects.0.friction")[0] != 0.123
    do(session, "push", body=body, force=[3, 0, 0])
    session._steps(300)
    (tmp_path / "scene.yaml").write_bytes(save(session, "scene")[1])
    saved, place = hs.load(tmp_path / "scene.yaml"), session.course.core.bodies()[0][body]
    assert np.linalg.norm(place - Session(session.course.scene).course.core.bodies()[0][body]) > 1e-3
    assert np.allclose(hs.Simulation(saved)._core.bodies()[0][body], place, atol=1e-9)

    def table(scene):
        return scene.resolved.split("\nobjects:")[1].split("capsule")[0]
    assert table(saved) == table(session.files.compile({"objects.1.friction": 0.123}))


# The past and the recording.

def test_every_command_is_in_random_sessions():
    assert MESSAGES.keys() == READERS.keys()


def test_random_sessions_repeat_to_the_bit():
    """`tests/live/random_sessions.py --count 500` has more of them."""
    wrong, given, checks = sessions(16, seed=3)
    assert not wrong, wrong
    assert READERS.keys() <= given.keys() and checks > 60


def test_numbers_change_after_a_step_that_does_not_divide_the_time(hands):
    # 501 steps of 1 ms are no multiple of 2 ms.
    do(hands, "step", steps=501)
    do(hands, "scene", step=0.002)
    angles = np.array(hands.course.core.q)
    do(hands, "number", name="gravity", value=[0, 0, -9])
    assert hands.course.time == pytest.approx(0.501, abs=1e-12) and np.array_equal(hands.course.core.q, angles)
    do(hands, "step", steps=10)
    do(hands, "seek", time=0.511)
    do(hands, "present")
    assert hands.course.time == pytest.approx(0.521, abs=1e-12)
    assert repeated(hands).end == hands.course.state_hash()


def test_numbers_that_do_not_fit_leave_the_motion_where_it_is(hands):
    do(hands, "step", steps=50)
    before = hands.course.state_hash()
    with pytest.raises(hs.Error, match="gains"):
        hands.course.apply({"numbers": {"gravity": [0, 0, 0], "gains": -1.0}})
    assert hands.course.state_hash() == before and hands.course.core.get("gravity")[2] < -9


@pytest.mark.parametrize("change", [("scene", {"engine": "ode"}), ("scene", {"stature": 1.9}), ("reset", {})])
def test_going_on_from_the_step_of_a_change_keeps_the_change(hands, change):
    do(hands, "step", steps=10)
    do(hands, "torques", values=[0.01] * len(hands.facts.coordinates))
    do(hands, change[0], **change[1])
    moment = hands.course.time
    do(hands, "step", steps=50)
    do(hands, "seek", time=moment)
    do(hands, "step", steps=100)
    assert repeated(hands).end == hands.course.state_hash()
    assert f'"{change[0]}":' in hands.history.recording().decode().split("\n", 1)[1]


def test_a_recording_that_is_saved_in_the_past_ends_there_and_a_closed_one_at_the_present(two_hands, tmp_path):
    session = Session(two_hands, tmp_path / "live.jsonl")
    session.log.begin()
    do(session, "step", steps=100)
    do(session, "push", body=session.facts.bodies.index("right.index_distal"), force=[1, 0, 0])
    do(session, "step", steps=20)
    present = session.course.state_hash()
    do(session, "seek", time=0.07)
    found = repeated(session)
    assert (found.course.tick, found.end) == (70, session.course.state_hash())
    session.close()
    found = Replay(tmp_path / "live.jsonl")
    found.run()
    assert (found.course.tick, found.end) == (120, present)


@pytest.mark.parametrize("before", [0, 1, 37])
def test_the_recording_of_a_motion_that_has_diverged_repeats(before):
    session = Session(hs.load("two_hands", {"solver.step": 0.02}, engine="ode"))
    session._steps(before)
    do(session, "torques", values=[20.0] * len(session.facts.coordinates))
    do(session, "number", name="gravity", value=[100, 100, 100])
    do(session, "step", steps=50)
    assert session.course.failed and session.course.tick <= before + 50
    assert repeated(session).course.failed
    assert session.history.recording().count(b'"failed"') == 1


def test_a_motion_that_diverged_in_its_first_step_goes_back():
    session = Session(hs.load("two_hands", {"solver.step": 0.02}, engine="ode"))
    do(session, "torques", values=[20.0] * len(session.facts.coordinates))
    do(session, "number", name="gravity", value=[100, 100, 100])
    do(session, "step", steps=1)
    assert session.course.failed
    do(session, "seek", time=0)
    assert session.course.failed is None and session.problem is None
    do(session, "step", steps=5)
    assert repeated(session).end == session.course.state_hash()


def test_wake_ups_without_a_step_keep_no_keyframe(balls_session):
    history = balls_session.history
    balls_session._steps(500)
    assert len(history.frames) == 3 and balls_session.course.tick == 500
    last = history.frames[-1]
    for _ in range(300):
        balls_session.course.wake()
        assert len(history.advance(10, time.monotonic() + 60, 1.0)) == 0
    assert len(history.frames) == 3 and history.frames[-1] is last
    do(balls_session, "reset")
    do(balls_session, "reset")
    assert len(history.frames) == 3


def test_steps_by_command_have_keyframes_and_hashes(balls_session):
    for _ in range(3):
        do(balls_session, "step", steps=1000)
    assert len(balls_session.history.frames) == 13
    assert repeated(balls_session).checks == 4


def test_a_push_gives_its_impulse_across_a_change_of_the_step(balls_session):
    high = balls_session.facts.bodies.index("high")
    do(balls_session, "push", body=high, force=[2, 0, 0], time=0.05)
    do(balls_session, "step", steps=10)
    do(balls_session, "scene", step=0.004)
    do(balls_session, "step", steps=50)
    assert balls_session.course.core.bodies()[2][high, 0] == pytest.approx(2 * 0.05 / 0.2, rel=1e-9)


def test_targets_arrive_at_their_time_across_a_change_of_the_step():
    hands = Session(hs.load("two_hands_contact", engine="articulated"))
    goal = (hands.course.core.targets() + 0.3).tolist()
    do(hands, "targets", values=goal, time=0.1)
    do(hands, "step", steps=50)
    do(hands, "scene", step=0.002)
    do(hands, "step", steps=24)
    assert not np.allclose(hands.course.core.targets(), goal, atol=1e-4)
    do(hands, "step", steps=2)
    assert np.allclose(hands.course.core.targets(), goal, atol=1e-9)


@pytest.mark.parametrize("change", [("scene", {"step": 0.02}), ("number", {"name": "objects.1.mass", "value": 1e-3})])
def test_a_spring_stays_soft_enough_for_step_and_mass(balls_session, change):
    high = balls_session.facts.bodies.index("high")
    do(balls_session, "spring", id=0, body=high, point=[0, 0, 0], goal=[0.2, 0, 9.01], stiffness=1e4)
    do(balls_session, "step", steps=10)
    do(balls_session, change[0], **change[1])
    row = balls_session.course.controls["springs"]["0"]
    mass = change[1].get("value", 0.2)
    assert row[7] * balls_session.course.scene.step**2 <= 0.1 * mass / 3 * (1 + 1e-9)
    do(balls_session, "step", steps=500)
    assert not balls_session.course.failed and np.linalg.norm(balls_session.course.core.bodies()[2][high]) < 3


# What goes wrong in a session.

@pytest.mark.parametrize("name", ["grasp_power_can", "two_hands", "muscle_poses"])
def test_a_push_on_what_no_force_moves_says_so(name):
    with hs.live(hs.load(name, engine="articulated"), page=False, play=True) as live:
        body = live.session.facts.bodies.index("right.palm")
        live.do("push", body=body, force=[1, 0, 0])
        begin, end = live.session.call(lambda s: s.course.tick).result(20), time.monotonic() + 20
        while live.session.call(lambda s: s.course.tick).result(20) < begin + 50 and time.monotonic() < end:
            time.sleep(0.01)
        assert any("right.palm, which no force moves" in text for text in live.session.notices)
        assert live.session.playing and live.session.problem is None


def test_an_engine_that_takes_no_forces_releases_springs_and_goes_on():
    session = Session(hs.load({**BALLS, "effects": ["gravity"]}))
    do(session, "spring", id=0, body=1, point=[0, 0, 0], goal=[0, 0, 0.5])
    do(session, "push", body=2, force=[1, 0, 0])
    do(session, "step", steps=20)
    do(session, "scene", engine="dae")
    assert session.course.scene.engine == "dae" and not session.course.controls["springs"] and session.course.controls["push"] is None
    do(session, "spring", id=0, body=1, point=[0, 0, 0], goal=[0, 0, 0.5])
    assert "no force moves" in session.notices[-1]
    do(session, "step", steps=20)
    assert session.course.time == pytest.approx(0.04) and repeated(session).end == session.course.state_hash() and session.problem is None


def test_a_callback_that_raises_pauses_the_session_and_ends_wait_and_close(two_hands, capfd):
    live = hs.live(two_hands, page=False)
    live.on_step(lambda session: {}["missing"])
    live.do("play", on=True)
    with pytest.raises(KeyError, match="missing"):
        live.wait()
    assert live.session._thread.is_alive() and "KeyError" in live.session.call(lambda s: s.broken).result(20)
    end = time.monotonic() + 20
    while not live.state["failed"] and time.monotonic() < end:
        time.sleep(0.01)
    assert "KeyError" in live.state["failed"] and live.state["playing"] is False and any("KeyError" in text for text in live.state["notices"])
    live.session.on_step.clear()
    live.do("play", on=True)  # somebody decides to go on
    tick = live.session.call(lambda s: s.course.tick).result(20)
    while live.session.call(lambda s: s.course.tick).result(20) <= tick and time.monotonic() < end:
        time.sleep(0.01)
    live.close()  # said once
    assert "KeyError" in capfd.readouterr().err
    with pytest.raises(KeyError), hs.live(two_hands, page=False) as live:
        live.on_step(lambda session: {}["missing"])
        live.do("play", on=True)
        live.session.trouble.wait(20)


def test_a_builder_that_fails_in_any_way_lets_the_next_change_through(two_hands, monkeypatch, capfd):
    with pytest.raises(RuntimeError, match="no memory"), hs.live(two_hands, page=False) as live:
        prepare, course = live.session.course.prepare, live.session.course
        monkeypatch.setattr(course, "prepare", lambda overrides: (_ for _ in ()).throw(RuntimeError("no memory")))
        live.do("scene", stature=1.6)
        assert live.session.trouble.wait(20)
        monkeypatch.setattr(course, "prepare", prepare)
        live.do("scene", stature=1.8)
        end = time.monotonic() + 30
        while live.state["overrides"].get("hands.0.person.stature") != 1.8 and time.monotonic() < end:
            time.sleep(0.01)
        assert live.state["overrides"]["hands.0.person.stature"] == 1.8


def test_a_full_disk_ends_the_recording_and_not_the_session(two_hands, tmp_path):
    path = tmp_path / "live.jsonl"
    live = hs.live(two_hands, page=False, record=path)
    live.do("play", on=True)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 2000, hard))
    try:
        for k in range(40):
            live.session.call(lambda s, k=k: s.input({"torques": [1e-3 * k] * len(s.facts.coordinates)})).result(20)
        live.session.call(lambda s: s._publish(time.monotonic())).result(20)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    tick = live.session.call(lambda s: s.course.tick).result(20)
    end = time.monotonic() + 20
    while live.session.call(lambda s: s.course.tick).result(20) < tick + 50 and time.monotonic() < end:
        time.sleep(0.01)
    assert live.session.playing and "disk" in live.session.log.lost and any("recording has ended" in text for text in live.session.notices)
    with pytest.raises(hs.Error, match="whole one"):
        live.session.call(lambda s: save(s, "recording")).result(20)
    with pytest.raises(hs.Error, match="live.jsonl") as found:
        live.close()
    assert found.value.kind == "output"
    # What is there is whole lines, and repeats.
    found = Replay(path)
    found.run()
    assert found.end is None and path.read_bytes().endswith(b"\n")


@pytest.mark.parametrize("wrong", [b"live.jsonl", 5, "a\0b", "x" * 5000])
def test_a_recording_s_path_that_is_none_is_refused(two_hands, wrong):
    with pytest.raises(hs.Error, match="record"):
        hs.live(two_hands, page=False, record=wrong)


def test_a_program_that_closes_no_session_ends_well():
    done = subprocess.run([sys.executable, "-c", "import handsim as hs, time\nlive = hs.live(hs.load('two_hands'), page=False, play=True)\ntime.sleep(0.3)"],
                          capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")


def test_calls_of_a_session_that_has_ended_do_not_wait_for_ever(two_hands):
    live = hs.live(two_hands, page=False)
    live.close()
    with pytest.raises(hs.Error, match="ended"):
        live.session.call(lambda session: None)


# The command.

def command(*words, **more):
    return subprocess.run([sys.executable, "-m", "handsim", "live", *map(str, words)], capture_output=True, text=True, timeout=120, **more)


@pytest.fixture
def own(tmp_path):
    """Files that are the user's own."""
    (tmp_path / "notes.txt").write_text("my notes\n")
    (tmp_path / "scene.yaml").write_text(hs.load("two_hands").resolved)
    (tmp_path / "link.jsonl").symlink_to("notes.txt")
    (tmp_path / "folder").mkdir()
    return tmp_path


@needs_server
@pytest.mark.parametrize("name", ["notes.txt", "scene.yaml", "link.jsonl", "folder", "missing/live.jsonl"])
def test_a_recording_replaces_no_other_file(own, name):
    before = {path: path.read_bytes() for path in own.iterdir() if path.is_file()}
    done = command(own / "scene.yaml", "--no-browser", "--record", own / name)
    assert done.returncode == 2 and done.stderr.startswith("record: got ") and "Traceback" not in done.stderr
    assert {path: path.read_bytes() for path in own.iterdir() if path.is_file()} == before


@needs_server
@pytest.mark.parametrize("wrong", [["--port", 99999], ["--address", "192.0.2.1"], ["--stream", "tcp://x"], ["--set", "solver.stepp=1"]])
def test_a_command_that_is_refused_leaves_the_recording_as_it_is(own, wrong):
    old = b'{"handsim_live":1}\n'
    (own / "old.jsonl").write_bytes(old)
    for name in ("old.jsonl", "new.jsonl"):
        assert command(own / "scene.yaml", "--no-browser", "--record", own / name, *wrong).returncode == 2
    assert (own / "old.jsonl").read_bytes() == old and not (own / "new.jsonl").exists()


@pytest.mark.parametrize("words,said", [(["two_hands", "--port", "99999"], "0 to 65535"), (["two_hands", "--port", "-1"], "0 to 65535"), (["two_hands", "--address", "a..b"], "a..b"),
                                        *((["two_hands", "--measure", "--seconds", value], "1 to 3600") for value in ("nan", "inf", "-1", "0", "1e9")),
                                        (["--replay", "x", "--record", "y"], "--record beside --replay")])
@needs_server
def test_wrong_numbers_end_with_a_reason_and_status_2(words, said):
    done = command(*words, "--no-browser")
    assert done.returncode == 2 and said in done.stderr and "Traceback" not in done.stderr, done.stderr


def started(code, *words):
    """The command in a process of its own, after `code`; with the page's address."""
    text = f"import sys\n{code}\nfrom handsim._live.command import main\nsys.exit(main(sys.argv[1:]))"
    out = subprocess.Popen([sys.executable, "-c", text, *map(str, words), "--no-browser"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    return out, out.stdout.readline().rpartition(": ")[2].strip()


@needs_server
def test_a_session_that_has_stopped_by_itself_gives_status_1():
    running, _ = started("import handsim._live.session as s\ns.Session._advance = lambda self: 1 / 0", "two_hands", "--play")
    said = running.stderr.readline()
    assert "ZeroDivisionError" in said
    running.send_signal(signal.SIGINT)
    _, rest = running.communicate(timeout=60)
    assert running.returncode == 1 and "Traceback" not in rest, rest


# What strangers send.

HAND = [[0, 0, 0]] + [[.02 * (i // 4) - .04, .03 + .02 * (i % 4), 0] for i in range(20)]


def test_numbers_beyond_floats_are_refused_wherever_they_come(can):
    session = Session(can)
    follower = Follower(session)
    huge = 10**400
    follower.data(json.dumps({"t": huge, "hands": {"right": {"joints": HAND}}}).encode())
    assert (follower.faults, follower.frames) == (1, 0)
    follower.data(json.dumps({"t": 0, "hands": {"right": {"joints": [[huge, 0, 0]] + HAND[1:]}}}).encode())  # a point that is not seen
    follower.data(json.dumps({"t": 1, "hands": {"right": {"joints": HAND}}}).encode())
    follower.close()
    assert follower.frames == 2
    for message in ({"do": "speed", "value": huge}, {"do": "step", "steps": huge}, {"do": "number", "name": "gravity", "value": [0, 0, huge]},
                    {"do": "spring", "id": huge}, {"do": "spring", "id": 0, "body": 3, "point": [0, 0, 0], "goal": [0, 0, -huge]}, {"do": "step", "steps": 10**5000}):
        with pytest.raises(hs.Error, match="need"):
            read_command(message, session.facts)


def head(**more):
    files = {"resolved.yaml": base64.b64encode(zlib.compress(hs.load("two_hands").resolved.encode())).decode(), **more.pop("files", {})}
    return json.dumps({"handsim_live": 1, "files": files, **more}).encode() + b"\n"


BOMB = base64.b64encode(zlib.compress(bytes(LARGEST_CONTENT + 1), 9)).decode()


@pytest.mark.parametrize("text", [
    b"", b"\xff\n", b"3\n", b'{"handsim_live":1}\n', lambda: head(overrides=[1]), lambda: head(overrides="abc"), lambda: head(overrides=5), lambda: head(overrides={"solver.step": []}),
    lambda: head(overrides={"solver.engine": 5}), lambda: head(files={"a\0b": ""}), lambda: head(files={"\ud800": "eJwDAAAAAAE="}), lambda: head(files={"x": 5}), lambda: head(files={"x": "eJw"}),
    lambda: head(files={"resolved.yaml/x": "eJwDAAAAAAE="}), lambda: head(files={"a" * 5000: "eJwDAAAAAAE="}), lambda: head(files={"../x": "eJwDAAAAAAE="}), lambda: head(files={"b": BOMB}),
    lambda: head() + b'{"at": 1e3}\n', lambda: head() + b'{"at": %d}\n' % 10**30, lambda: head() + b'{"at": 1000000000}\n', lambda: head() + b'{"at": 1, "push": 5}\n',
    lambda: head() + b'{"at": 1, "push": {"body": "right.palm", "force": [1, 0, 0], "steps": 5}}\n', lambda: head() + b'{"at": 1, "springs": {"0": [1e300, 0, 0, 0, 0, 0, 0, 1, 1, 1]}}\n',
    lambda: head() + b'{"at": 1, "excitations": [7]}\n', lambda: head() + b'{"at": 1, "torques": [NaN]}\n', lambda: head() + b'{"at": 1, "numbers": {"gravity": "down"}}\n',
    lambda: head() + b'{"at": 1, "wrists": {"to": [[0, 0, 0, 1, 0, 0, 0]], "steps": 0}}\n', lambda: head() + b'{"at": 1, "scene": [1]}\n', lambda: head() + b'{"at": 1, "scene": {"title": {}}}\n'])
def test_spoilt_recordings_are_refused_with_their_line(tmp_path, text):
    path = tmp_path / "live.jsonl"
    path.write_bytes(text if isinstance(text, bytes) else text())
    with pytest.raises(hs.Error) as found:
        Replay(path).run()
    assert found.value.kind == "input" and str(found.value).startswith(f"{path}:")
    str(found.value).encode()


@pytest.mark.parametrize("text", [lambda: head(version="\ud800", commit="x" * 10**6) + b'{"at": 1, "hash": "\\ud800"}\n', lambda: head() + b'{"at": 1, "hash": {"\\ud800": 1}}\n'])
def test_a_message_about_a_stranger_s_recording_can_be_printed(text):
    with pytest.raises(hs.Error, match="hash") as found:
        Replay(text()).run()
    assert found.value.kind == "physics" and len(str(found.value).encode()) < 1000


def test_a_recording_whose_name_is_no_text_repeats(tmp_path, balls_session):
    path = os.fsencode(tmp_path) + b"/\xff.jsonl"
    with open(path, "wb") as out:
        out.write(balls_session.history.recording())
    done = subprocess.run([os.fsencode(sys.executable), b"-m", b"handsim", b"live", b"--replay", path], capture_output=True, timeout=60)
    assert done.returncode == 0 and b"1 hashes" in done.stdout and done.stderr == b"", done.stderr


def test_a_bomb_is_unpacked_no_further_than_its_bound(monkeypatch):
    import handsim._live.replay as replay

    monkeypatch.setattr(replay, "LARGEST_CONTENT", 100_000)
    tracemalloc.start()
    with pytest.raises(ValueError, match="more than"):
        replay.unpacked({"a": base64.b64encode(zlib.compress(bytes(60_000))), "b": BOMB})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000_000


@needs_server
def test_the_page_s_facts_wait_for_no_simulation(two_hands):
    from handsim._live.server import Server

    session = Session(two_hands)
    server = Server(session)
    session.course.core = None
    assert server._facts()["numbers"]["gravity"][2] == pytest.approx(-9.80665)


@needs_server
def test_requests_that_are_none_say_nothing_in_the_terminal():
    running, url = started("", "two_hands")
    port, query = int(url.split(":")[2].split("/")[0]), url.partition("?")[2]

    def answer(data):
        with socket.create_connection(("127.0.0.1", port), 5) as out:
            out.settimeout(5)
            try:
                out.sendall(data)
                return out.recv(200)
            except OSError:
                return b""
    host = b"Host: 127.0.0.1:%d\r\n\r\n" % port
    assert b" 200 " in answer(b"GET /?" + query.encode() + b" HTTP/1.1\r\n" + host)
    for where in (b"/?token=\xff", b"/?x=\x80&" + query.encode(), b"/\xff\xfe?" + query.encode(), b"/save/\xe9?" + query.encode()):
        assert b" 400 " in answer(b"GET " + where + b" HTTP/1.1\r\n" + host)
    for data in (b"\x00" * 1000, b"GET / HTTP/9.9\r\n\r\n", b"POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n", b"GET http://[ HTTP/1.1\r\n" + host, b"GET //[?" + query.encode() + b" HTTP/1.1\r\n" + host,
                 b"GET / HTTP/1.1\r\nA\xff: \xff\r\n" + host, b"GET /" + b"a" * 100000 + b" HTTP/1.1\r\n" + host, b"GET /?%zz&" + query.encode() + b" HTTP/1.1\r\n" + host):
        assert b" 500 " not in answer(data)
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert (running.returncode, said) == (0, "")


@needs_server
def test_what_goes_wrong_in_a_request_is_a_notice(two_hands, monkeypatch):
    import handsim._live.server as server

    with hs.live(two_hands) as live:
        monkeypatch.setattr(server, "page_text", lambda *_: 1 / 0)
        with pytest.raises(urllib.error.HTTPError, match="500"):
            urllib.request.urlopen(live.url, timeout=20)
        assert any("ZeroDivisionError" in text for text in live.session.notices) and live.session.problem is None
