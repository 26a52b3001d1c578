"""Live sessions. Oracles: bit equality of a session, its past and its recording; closed forms of springs and falls."""
import base64
import gc
import json
import os
import resource
import socket
import struct
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from conftest import BALLS

import handsim as hs
from handsim._live.commands import READERS, Command, Facts, poses_of, read_command
from handsim._live.course import Course, Files
from handsim._live.frames import HEAD, encode
from handsim._live.history import KEPT
from handsim._live.replay import Replay
from handsim._live.session import Session
from handsim._live.streams import PACKED, Follower, points_of, read_packed
from handsim._live.tracker import DELAY, HandFilter, turned

needs_server = pytest.mark.skipif(not hs.has_reports or not __import__("importlib").util.find_spec("aiohttp"),
                                  reason="aiohttp or three.js is missing")


class Hand:
    """A session that the test steps itself, without a clock."""

    def __init__(self, scene):
        self.session = Session(scene)

    def do(self, what, /, **values):
        self.session.send(read_command({"do": what, **values}, self.session.facts))
        self.session._take()

    def run(self, steps):
        self.session._steps(steps)

    def replay(self):
        found = Replay(self.session.history.recording())
        found.run()
        return found


@pytest.fixture
def hands(two_hands):
    return Hand(hs.load("two_hands_contact", engine="articulated"))


@pytest.fixture
def balls_hand():
    return Hand(hs.load(BALLS))


# The course.

def test_without_inputs_it_has_the_bits_of_the_simulation(two_hands):
    hand, plain = Hand(two_hands), hs.Simulation(two_hands)
    hand.run(300)
    plain.step(substeps=300)
    assert np.array_equal(hand.session.course.core.q, plain.q) and np.array_equal(hand.session.course.core.u, plain.u)


def test_a_spring_stretches_by_weight_over_stiffness():
    # A ball of 0.2 kg hangs on a spring of 150 N/m: 0.2 * 9.80665 / 150 = 13.08 mm.
    scene = hs.load({**BALLS, "objects": [BALLS["objects"][1]]})
    hand = Hand(scene)
    hand.do("spring", id=0, body=1, point=[0, 0, 0], goal=[0.2, 0, 9], stiffness=150)
    hand.run(9000)
    assert hand.session.course.core.bodies()[0][1, 2] == pytest.approx(9 - 0.2 * 9.80665 / 150, abs=1e-6)
    assert hand.session.course.spring_forces[0, 2] == pytest.approx(0.2 * 9.80665, abs=1e-4)


def test_a_spring_beside_the_centre_turns_a_body_with_its_moment():
    # Without gravity, at rest: the first step gives force * h / m and (arm x force) * h / I; I of a sphere is 2/5 m r^2.
    ball = {**BALLS["objects"][1], "position": [0, 0, 1]}
    scene = hs.load({**BALLS, "gravity": [0, 0, 0], "objects": [ball]})
    hand = Hand(scene)
    hand.do("spring", id=0, body=1, point=[0.03, 0, 0], goal=[0.03, 0, 1.01], stiffness=100)
    hand.run(1)
    _, _, v, w = hand.session.course.core.bodies()
    force = 100 * 0.01
    assert v[1, 2] == pytest.approx(force * 1e-3 / 0.2, rel=1e-6)
    assert w[1, 1] == pytest.approx(-0.03 * force * 1e-3 / (0.4 * 0.2 * 0.03**2), rel=1e-6)


def test_a_spring_never_pulls_with_more_than_its_largest_force(hands):
    tip = hands.session.facts.bodies.index("right.index_distal")
    hands.do("spring", id=1, body=tip, point=[0, 0, 0], goal=[3, 0, 0], stiffness=1e4, force=5)
    hands.run(50)
    assert np.linalg.norm(hands.session.course.spring_forces[0]) == pytest.approx(5, rel=1e-9)


def test_a_push_gives_its_impulse(balls_hand):
    high = balls_hand.session.facts.bodies.index("high")
    balls_hand.do("push", body=high, force=[2, 0, 0], time=0.05)
    balls_hand.run(200)
    assert balls_hand.session.course.core.bodies()[2][high, 0] == pytest.approx(2 * 0.05 / 0.2, rel=1e-9)


def test_gravity_changes_while_it_falls(balls_hand):
    high = balls_hand.session.facts.bodies.index("high")
    balls_hand.run(100)
    balls_hand.do("number", name="gravity", value=[0, 0, 0])
    balls_hand.run(100)
    assert balls_hand.session.course.core.bodies()[2][high, 2] == pytest.approx(-9.80665 * 0.1, rel=1e-9)


def test_the_mass_of_an_object_changes_what_a_push_does(balls_hand):
    high = balls_hand.session.facts.bodies.index("high")
    balls_hand.do("number", name="objects.1.mass", value=0.4)
    balls_hand.do("push", body=high, force=[2, 0, 0], time=0.05)
    balls_hand.run(60)
    assert balls_hand.session.course.core.bodies()[2][high, 0] == pytest.approx(2 * 0.05 / 0.4, rel=1e-9)


def test_targets_move_evenly_and_not_faster_than_their_limit(hands):
    axes = hands.session.facts.axes
    start = hands.session.course.core.targets()
    hands.do("targets", values=(start + 0.3).tolist(), time=0.1)
    hands.run(50)
    assert np.allclose(hands.session.course.core.targets(), start + 0.15, atol=1e-9)
    hands.do("targets", values=[0.0] * len(axes), time=0)
    before = hands.session.course.core.targets()
    hands.run(1)
    assert np.abs(hands.session.course.core.targets() - before).max() <= 15e-3 + 1e-12


def test_a_pose_has_the_angles_of_its_file(hands):
    scene = hands.session.course.scene
    claw = dict(zip(scene.axes, poses_of(scene)["claw"]))
    wanted = scene._core.poses()["claw"]
    assert claw["left.index_pip.flexion"] == wanted["index_pip"][0]
    assert claw["right.thumb_cmc.abduction"] == wanted.get("thumb_cmc", [0, 0])[1]


def test_another_person_keeps_time_angles_and_wrists(hands):
    hands.run(400)
    course = hands.session.course
    q, time_, wrists = np.array(course.core.q), course.time, course.core.wrists()
    before = course.scene
    hands.session.input({"scene": {"hands.0.person.stature": 1.95}})
    assert course.scene is not before and course.time == time_
    inside = course.scene.limits
    assert np.allclose(course.core.q, np.clip(q, inside[:, 0], inside[:, 1]), atol=1e-9)
    assert np.allclose(course.core.wrists(), wrists, atol=1e-9)
    length = [hs.Hand(stature=stature, mass=84.5, sex="male").dimensions["length"] for stature in (1.95, 1.755)]
    longer = length[0] / length[1]
    palm = [course.scene.bodies.index(name) for name in ("right.palm", "right.middle_proximal")]
    reach = [np.linalg.norm(core.bodies()[0][palm[1]] - core.wrists()[0, :3])
             for core in (course.core, hs.Simulation(before)._core)]
    assert reach[0] / reach[1] == pytest.approx(longer, rel=0.03)


@pytest.mark.parametrize("engine,step", [("ode", 1e-3), ("articulated", 2e-3), ("articulated", 0.5e-3)])
def test_engine_and_step_are_switched_while_it_runs(hands, engine, step):
    hands.run(300)
    time_ = hands.session.course.time
    hands.session.input({"scene": {"solver.engine": engine, "solver.step": step}})
    course = hands.session.course
    assert (course.scene.engine, course.scene.step) == (engine, step)
    hands.run(100)
    assert course.time == pytest.approx(time_ + 100 * step, abs=1e-9)
    assert all(each.held for each in course.verdicts if each.name == "joint_gap")


# The past and the recording.

def busy(hand):
    """Inputs of every kind."""
    facts = hand.session.facts
    tip = facts.bodies.index("right.index_distal")
    hand.run(137)
    hand.do("pose", name="claw", time=0.3)
    hand.run(63)
    hand.do("spring", id=0, body=tip, point=[0, 0.01, 0], goal=[0.1, 0.05, 0.4])
    hand.run(201)
    hand.do("spring", id=3, body=facts.bodies.index("left.palm"), point=[0, 0, 0], goal=[-0.2, 0, 0.3])
    hand.do("torques", values=[0.01] * len(facts.coordinates))
    hand.run(150)
    hand.do("spring", id=0, release=True)
    hand.do("number", name="gravity", value=[0, 0, -3])
    hand.run(200)
    hand.session.input({"scene": {"solver.engine": "ode"}})
    hand.do("push", body=tip, force=[0, 3, 0])
    hand.run(300)
    hand.session.input({"scene": {"solver.engine": "articulated", "hands.0.person.stature": 1.6}})
    hand.do("targets", release=True)
    hand.run(333)


def test_a_recording_repeats_every_input_to_the_bit(hands):
    busy(hands)
    found = hands.replay()
    assert found.checks >= 2 and found.end == hands.session.course.state_hash()


def test_a_changed_recording_is_found(hands):
    busy(hands)
    course = hands.session.course
    text = hands.session.history.recording().replace(b'"force":[0.0,3.0,0.0]', b'"force":[0.0,3.0,1e-9]')
    with pytest.raises(hs.Error, match="hash") as found:
        Replay(text).run()
    assert found.value.kind == "physics"


def test_the_past_and_the_present_have_their_bits(hands):
    busy(hands)
    session = hands.session
    present, tick = session.course.state_hash(), session.course.tick
    hashes = {}
    for at in (900, 250, 640, 1, 1100):
        session.seek(at)
        hashes[at] = session.course.state_hash()
        assert session.course.tick == at
    for at in (1, 250, 640, 900, 1100):
        session.seek(at)
        assert session.course.state_hash() == hashes[at]
    session.seek(tick)
    assert session.course.state_hash() == present and session.history.present is None


def test_going_on_from_the_past_forgets_what_came_after(hands):
    busy(hands)
    session = hands.session
    session.seek(500)
    hands.run(100)
    hands.do("pose", name="flat")
    hands.run(400)
    assert session.course.tick == 1000 and session.history.present is None
    assert hands.replay().end == session.course.state_hash()
    plain = Hand(session.files.compile({}))
    assert b"stature" not in session.history.recording().split(b"\n", 1)[1]
    del plain


def test_a_minute_is_kept_and_no_more():
    hand = Hand(hs.load(BALLS, {"solver.step": "10 ms"}))
    hand.run(9000)
    session = hand.session
    first = session.history.frames[0][0]
    assert 9000 - KEPT / 0.01 - 30 <= first.tick <= 9000 - KEPT / 0.01
    assert len(session.history.frames) <= KEPT / 0.25 + 2
    session.seek(0)
    assert session.course.tick == first.tick


def test_a_motion_that_diverged_goes_back(balls_hand):
    session = balls_hand.session
    balls_hand.run(300)
    session.input({"numbers": {"gravity": [0, 0, -1e9]}})
    balls_hand.run(2000)
    assert session.course.failed
    session.play(True)
    assert not session.playing
    session.seek(200)
    assert not session.course.failed and session.course.tick == 200
    balls_hand.run(100)
    assert balls_hand.replay().end == session.course.state_hash()


def test_reset_is_the_start(hands):
    start = hands.session.course.state_hash()
    busy(hands)
    session = hands.session
    session.input({"scene": {"hands.0.person.stature": 1.755}})
    hands.do("number", name="gravity", value=[0, 0, -9.80665])
    hands.do("reset")
    hands.run(10)
    assert hands.replay().end == session.course.state_hash()
    plain = hs.Simulation(session.course.scene, watch=True)
    plain.step(substeps=10)
    assert np.array_equal(plain.q, session.course.core.q)
    assert start != session.course.state_hash()


@pytest.mark.parametrize("line", [b"[]", b"{", b'{"at": -1}', b'{"at": 5, "springs": {"0": [1]}}', b'{"at": 5, "push": {"body": "no", "force": [1, 1, 1], "steps": 3}}',
                                  b'{"at": 5, "targets": {"to": [1], "steps": 1}}', b'{"at": 5, "numbers": {"gravity": [1]}}', b'{"at": 5, "push": {"body": "high", "steps": 0}}',
                                  b'{"at": 5, "scene": {"solver.engine": "none"}}', b'{"at": 5, "torques": [1]}', b'{"at": 9, "hash": "0"}', b'{"at": 5, "springs": 3}', b'{"at": 5, "scene": 3}'])
def test_wrong_lines_of_a_recording_end_with_a_reason(balls_hand, line):
    session = balls_hand.session
    balls_hand.run(5)
    text = session.history.recording().rsplit(b"\n", 2)[0] + b"\n" + line + b"\n" + b'{"at": 9, "end": "0"}\n'
    with pytest.raises(hs.Error):
        Replay(text).run()


def test_a_recording_writes_no_file_outside_of_its_folder(balls_hand, tmp_path):
    head = json.loads(balls_hand.session.history.recording().split(b"\n")[0])
    head["files"]["../../outside.yaml"] = head["files"]["resolved.yaml"]
    with pytest.raises(hs.Error, match="folder"):
        Replay(json.dumps(head).encode() + b"\n")


# Commands.

def test_wrong_commands_are_refused_with_key_and_range(hands):
    facts = hands.session.facts
    wrong = [None, [], {}, {"do": "format"}, {"do": ["play"]}, {"do": "play"}, {"do": "play", "on": 1}, {"do": "speed", "value": 0}, {"do": "speed", "value": float("nan")},
             {"do": "speed", "value": True}, {"do": "step", "steps": 10**9}, {"do": "seek", "time": -1}, {"do": "spring", "id": 99}, {"do": "spring", "id": 0, "body": 0},
             {"do": "spring", "id": 0, "body": 10**6, "point": [0, 0, 0], "goal": [0, 0, 0]}, {"do": "spring", "id": 0, "body": 3, "point": [0, 0], "goal": [0, 0, 0]},
             {"do": "spring", "id": 0, "body": 3, "point": [0, 0, 0], "goal": [0, 0, 1e300]}, {"do": "targets", "values": [0]}, {"do": "targets", "values": "0" * 40},
             {"do": "pose", "name": "no"}, {"do": "number", "name": "q", "value": 1}, {"do": "number", "name": "objects.7.mass", "value": 1}, {"do": "number", "name": "gravity", "value": 3},
             {"do": "push", "body": 3, "force": [1e9, 0, 0]}, {"do": "scene"}, {"do": "scene", "engine": "bullet"}, {"do": "scene", "step": 1}, {"do": "scene", "stature": -1},
             {"do": "torques", "values": [1e9] * len(facts.coordinates)}, {"do": "excitations", "values": [0.5]}]
    for message in wrong:
        with pytest.raises(hs.Error) as found:
            read_command(message, facts)
        assert found.value.kind == "input" and "need" in str(found.value)


def test_random_commands_never_end_a_session(hands):
    import random

    draw, names = random.Random(1), list(READERS)
    values = [None, True, 0, 1, -1, 1e308, 0.3, "x", "flat", [], [0, 0, 0], [0.1] * 40, {}, "ode", float("inf")]
    keys = ["on", "steps", "value", "time", "id", "release", "body", "point", "goal", "stiffness", "force", "values", "name", "stature", "mass", "engine", "step"]
    for _ in range(3000):
        message = {"do": draw.choice(names), **{draw.choice(keys): draw.choice(values) for _ in range(draw.randint(0, 6))}}
        try:
            command = read_command(message, hands.session.facts)
        except hs.Error:
            continue
        if command.name != "scene":
            hands.session.send(command)
            hands.session._take()
    hands.run(20)
    assert hands.replay().end == hands.session.course.state_hash()


def test_commands_that_nobody_takes_are_bounded(hands):
    session = hands.session
    with pytest.raises(hs.Error, match="wait"):
        for _ in range(10000):
            session.send(Command("step", {"steps": 1}))
    assert len(session._inbox) <= 256


# Frames.

def test_frames_have_only_what_changed(balls_hand):
    session = balls_hand.session
    balls_hand.run(1)
    first = session._look()
    assert HEAD.unpack_from(encode(first, None))[3] == len(session.facts.bodies)
    assert len(encode(first, first)) == HEAD.size
    balls_hand.run(10)
    later = session._look()
    data = encode(later, first)
    _, tick, time_, bodies, contacts, angles, springs, _, flags = HEAD.unpack_from(data)
    moved = np.flatnonzero((later.poses != first.poses).any(axis=1))
    assert (tick, time_, bodies) == (11, later.time, len(moved))
    assert np.array_equal(np.frombuffer(data, "<f4", 7 * bodies, HEAD.size).reshape(-1, 7), later.poses[moved])
    assert len(data) == HEAD.size + 4 * (7 * bodies + 6 * contacts + angles + 10 * springs) + 2 * (bodies + 2 * contacts + angles)


# In real time.

def test_it_runs_in_real_time_and_at_other_speeds(two_hands):
    with hs.live(two_hands, page=False, play=True) as live:
        for speed, share in ((1, 0.7), (0.1, 0.05), (10, 3)):
            live.do("speed", value=speed)
            begin = live.session.call(lambda s: (time.monotonic(), s.course.time)).result()
            time.sleep(0.5)
            end = live.session.call(lambda s: (time.monotonic(), s.course.time)).result()
            factor = (end[1] - begin[1]) / (end[0] - begin[0])
            # Never faster than asked; slower only where the machine has no time.
            assert factor < 1.1 * speed + 0.05 and factor > share * 0.2


def test_callbacks_come_between_steps_and_see_the_session(two_hands):
    seen = []
    with hs.live(two_hands, page=False) as live:
        live.on_step(lambda session: seen.append(session.course.tick))
        live.do("play", on=True)
        end = time.monotonic() + 20
        while len(seen) < 5 and time.monotonic() < end:
            time.sleep(0.02)
    assert len(seen) >= 5 and seen == sorted(seen)


def test_a_scene_is_built_anew_while_the_old_one_runs(two_hands):
    with hs.live(two_hands, page=False, play=True) as live:
        live.do("scene", stature=1.6)
        live.do("scene", stature=9 / 5)
        end = time.monotonic() + 30
        while live.state["overrides"].get("hands.0.person.stature") != 1.8 and time.monotonic() < end:
            time.sleep(0.02)
        assert live.state["overrides"]["hands.0.person.stature"] == 1.8 and not live.state["failed"]


# Tracked hands.

@pytest.fixture(scope="module")
def filter_of(request):
    return HandFilter(hs.load("grasp_power_can", engine="articulated"), 0)


def moving(filter_, seed, rate=90.0, seconds=5.0):
    """Times, poses of a hand that turns, goes and bends, each axis at 0.4 to 1 Hz."""
    draw = np.random.default_rng(seed)
    size = len(filter_.axes)
    middle, reach = (filter_._low + filter_._high) / 2, np.minimum((filter_._high - filter_._low) * 0.4, 0.7)
    phase, often = draw.uniform(0, 6, size), draw.uniform(0.4, 1.0, size)

    def pose(t):
        turn = turned(np.array([0.3 * np.sin(t), 0.2, 0.5 * np.cos(2 * t)]), np.array([1.0, 0, 0, 0]))
        return np.concatenate(([0.1 * np.sin(2 * t), 0.05 * np.cos(3 * t), 0.3], turn, middle + reach * np.sin(2 * np.pi * often * t + phase)))
    return np.arange(0, seconds, 1 / rate), pose


def errors_of(times, poses, seed=1, scene=None):
    """Of the angles of a filter whose frames have 2 mm of noise, against those DELAY before: 13 ms [deg]."""
    filter_, draw, out = HandFilter(scene or hs.load("grasp_power_can", engine="articulated"), 0), np.random.default_rng(seed), []
    angles = np.array(poses)[:, 7:]
    for t, pose in zip(times, poses):
        assert filter_.update(filter_.points(pose) + draw.normal(0, 2e-3, (21, 3)), t)
        if t > 0.5:
            out.append(filter_.late_angles() - [np.interp(t - DELAY, times, column) for column in angles.T])
    filter_.finish()
    assert filter_.noise == pytest.approx(2e-3, rel=0.15)
    return np.degrees(np.sqrt(np.mean(np.square(out))))


THREE = [(1.755, "male"), (1.6, "female"), (1.9, "male")]


def of_person(stature, sex):
    return hs.load("grasp_power_can", {"hands.0.person.stature": stature, "hands.0.person.sex": sex}, engine="articulated")


@pytest.mark.parametrize("stature,sex", THREE)
def test_angles_of_a_grasp_are_within_2_4_degrees_at_2_mm_noise_with_13_ms_delay(stature, sex):
    scene = of_person(stature, sex)
    simulation, filter_ = hs.Simulation(scene), HandFilter(scene, 0)
    index, times, poses = [scene.coordinates.index(axis) for axis in filter_.axes], [], []
    while simulation.time < 4:
        times.append(simulation.time)
        poses.append(np.concatenate((simulation._core.wrists()[0], np.array(simulation.q)[index])))
        simulation.step(substeps=11)
    assert errors_of(times, poses, scene=scene) <= 2.4


# Joints that each move on their own, at 0.4 to 1 Hz by up to 40 deg. Six motions and noises on average; a small hand's short
# bones tell less (docs/live.md). The limit of the second person was 2.6 until MCPs abducted by 20 deg and DIPs bent back by 10; 2.7 was chosen
# after its result, 2.61: angles end at the stops, and stops that lie farther out tell less.
@pytest.mark.parametrize("stature,sex,limit", [(*THREE[0], 2.5), (*THREE[1], 2.7), (*THREE[2], 2.5)])
def test_angles_that_move_apart_from_each_other_are_within_2_5_degrees(stature, sex, limit):
    scene = of_person(stature, sex)
    filter_, squares = HandFilter(scene, 0), []
    for seed in range(1, 7):
        times, pose = moving(filter_, seed)
        squares.append(errors_of(times, [pose(t) for t in times], seed, scene)**2)
    assert np.sqrt(np.mean(squares)) <= limit


def minimum_jerk(filter_, seed, seconds=5.0):
    """Joints that go to random angles within 0.25 to 1.2 s and rest there up to 0.8 s, each on its own."""
    draw, times = np.random.default_rng(seed), np.arange(0, seconds, 1 / 90)
    out = np.zeros((len(times), len(filter_.axes)))
    for axis, (low, high) in enumerate(zip(filter_._low, filter_._high)):
        inside = (low + 0.1 * (high - low), min(high - 0.1 * (high - low), low + 0.1 * (high - low) + 1.6))
        begin, at = -draw.uniform(0, 1), draw.uniform(*inside)
        while begin < seconds:
            span, goal = draw.uniform(0.25, 1.2), draw.uniform(*inside)
            u = np.clip((times - begin) / span, 0, 1)
            out[times >= begin, axis] = (at + (goal - at) * (10 * u**3 - 15 * u**4 + 6 * u**5))[times >= begin]
            begin, at = begin + span + draw.uniform(0, 0.8), goal
    return times, np.concatenate((np.tile([0, 0, 0.3, 1, 0, 0, 0], (len(times), 1)), out), axis=1)


@pytest.mark.parametrize("stature,sex", THREE)
def test_angles_of_joints_that_go_and_rest_are_within_2_5_degrees(stature, sex):
    scene = of_person(stature, sex)
    filter_ = HandFilter(scene, 0)
    assert np.sqrt(np.mean([errors_of(*minimum_jerk(filter_, seed), seed, scene)**2 for seed in range(1, 5)])) <= 2.5


def test_the_delay_of_angles_is_13_ms_at_any_rate():
    # Without noise, at an even speed of 1 rad/s: the angles are those of 13 ms before; of 200 Hz those of two frames before.
    filter_ = HandFilter(hs.load("grasp_power_can", engine="articulated"), 0)
    start = (filter_._low + filter_._high) / 2
    for rate, delay in ((30, DELAY), (60, DELAY), (90, DELAY), (200, 0.010)):
        filter_.lose()
        for t in np.arange(0, 0.5, 1 / rate):
            filter_.update(filter_.points(np.concatenate(([0, 0, 0.3, 1, 0, 0, 0], start + 0.5 * t))), t)
        assert np.abs(filter_.late_angles() - (start + 0.5 * (t - delay))).max() < 2e-3


def test_the_filter_is_the_textbook_s_over_its_state_and_past():
    """Oracle: the same model as one dense Kalman filter (Kalman 1960) whose state also has the angles of two frames before."""
    from handsim._live import tracker as T

    filter_ = HandFilter(hs.load("grasp_power_can", engine="articulated"), 0)
    n, m = filter_._size, filter_._size - 6
    times, pose = moving(filter_, 3)
    draw = np.random.default_rng(3)
    P = mean = before = None
    for k, t in enumerate(times[:25]):
        points = filter_.points(pose(t)) + draw.normal(0, 2e-3, (21, 3))
        filter_.finish()
        if k == 0:
            filter_.update(points, t)
            P = np.zeros((3 * n + 2 * m,) * 2)
            P[:3 * n, :3 * n] = filter_._spread
            before = np.concatenate((filter_.pose[7:], filter_.pose[7:]))
            continue
        # Prediction: constants of the time between, and the newest angles into the past.
        dt, decay = t - times[k - 1], np.exp(-(t - times[k - 1]) / T.KEPT)
        F3 = np.array([[1, dt, T.KEPT * (dt - T.KEPT * (1 - decay))], [0, 1, T.KEPT * (1 - decay)], [0, 0, decay]])
        Q3 = np.array([[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]])
        F = np.zeros_like(P)
        F[:3 * n, :3 * n] = np.kron(F3, np.eye(n))
        F[3 * n:3 * n + m, 6:n] = F[3 * n + m:, 3 * n:3 * n + m] = np.eye(m)
        P = F @ P @ F.T
        P[:3 * n, :3 * n] += np.kron(Q3, np.diag(filter_._density))
        at = filter_.predicted(dt)
        before = np.concatenate((filter_.pose[7:], before[:m]))
        # Measurement: derivatives of the points by differences.
        H = np.zeros((63, len(P)))
        for j in range(n):
            step = np.zeros(n)
            step[j] = 1e-6
            ends = [np.concatenate((at[:3] + s * step[:3], turned(s * step[3:6], at[3:7]), at[7:] + s * step[6:])) for s in (1, -1)]
            H[:, j] = (filter_.points(ends[0]) - filter_.points(ends[1])).ravel() / 2e-6
        R = filter_.noise**2 * np.eye(63)
        gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        change = gain @ (filter_._sized(points) - filter_.points(at)).ravel()
        P = P - gain @ H @ P
        filter_.update(points, t)
        inside = np.abs(at[7:] + change[6:n] - np.clip(at[7:] + change[6:n], filter_._low, filter_._high)) == 0
        assert np.allclose(filter_.pose[:3], at[:3] + change[:3], atol=1e-8)
        assert np.allclose(filter_.pose[7:][inside], (at[7:] + change[6:n])[inside], atol=1e-7)
        before = np.clip(before + change[3 * n:], np.tile(filter_._low, 2), np.tile(filter_._high, 2))
        assert np.allclose(filter_._last.ravel(), before, atol=1e-7)
    filter_.finish()
    assert np.allclose(filter_._spread, P[:3 * n, :3 * n], rtol=1e-5, atol=1e-9 * np.abs(P).max())
    assert np.allclose(filter_._shared, P[:3 * n, 3 * n:], rtol=1e-5, atol=1e-9 * np.abs(P).max())


def test_without_noise_the_filter_follows_exactly():
    filter_ = HandFilter(hs.load("grasp_power_can", engine="articulated"), 0)
    times, pose = moving(filter_, 4)
    for t in times:
        filter_.update(filter_.points(pose(t)), t)
    assert np.abs(filter_.pose[7:] - pose(times[-1])[7:]).max() < 0.02 and filter_.scale == pytest.approx(1, abs=1e-6)


def test_a_hand_of_another_size_has_the_same_angles():
    filter_ = HandFilter(hs.load("grasp_power_can", engine="articulated"), 0)
    times, pose = moving(filter_, 5)
    for t in times:
        filter_.update(1.15 * filter_.points(pose(t)), t)
    assert filter_.scale == pytest.approx(1.15, abs=1e-3) and np.abs(filter_.pose[7:] - pose(times[-1])[7:]).max() < 0.02


def test_points_that_are_missing_or_wild_are_left_out():
    filter_ = HandFilter(hs.load("grasp_power_can", engine="articulated"), 0)
    times, pose = moving(filter_, 6)
    for k, t in enumerate(times):
        points = filter_.points(pose(t))
        points[4 + k % 10] = np.nan
        points[8 + k % 7] += 0.2
        filter_.update(points, t)
    assert np.abs(filter_.pose[7:] - pose(times[-1])[7:]).max() < 0.1


def test_names_of_three_trackers_are_the_same_points():
    points = np.arange(26 * 3).reshape(26, 3).astype(float).tolist()
    wanted = points_of(points)
    assert wanted.shape == (21, 3) and wanted[0, 0] == 3 and wanted[5, 0] == 21 and wanted[20, 0] == 75
    assert np.array_equal(points_of(points[1:]), wanted)
    from handsim._live.streams import KEYPOINTS, OPENXR, WEBXR

    for names in (KEYPOINTS, OPENXR, WEBXR):
        assert np.array_equal(points_of(dict(zip(names, wanted.tolist()))), wanted)


def packed(side, points, t):
    return PACKED.pack(b"HSH1", side, len(points), 0, t) + np.array(points, dtype="<f4").tobytes()


def test_a_packed_frame_is_the_json_frame():
    points = np.random.default_rng(1).normal(size=(26, 3)).astype(np.float32)
    points[7] = np.nan
    found = read_packed(packed(0, points, 1.5) + packed(1, points[:21], 1.5))
    assert found["t"] == 1.5 and set(found["hands"]) == {"right", "left"}
    joints = found["hands"]["right"]["joints"]
    assert np.isnan(joints[7]).all() and np.array_equal(joints[8], points[8])
    assert np.array_equal(points_of(joints), points_of([None if i == 7 else row for i, row in enumerate(points.tolist())]), equal_nan=True)


def test_forged_frames_are_counted_and_do_nothing(can):
    session = Session(can)
    follower = Follower(session)
    draw = np.random.default_rng(3)
    whole = packed(0, np.zeros((21, 3)), 0.0)
    wrong = [b"", b"{", b"[]", b"{}", b'{"hands": {}}', b'{"hands": {"right": {}}}', b'{"hands": {"third": {"joints": []}}}', b'{"t": "now", "hands": {"right": {"joints": []}}}',
             b'{"hands": {"right": {"joints": [[0, 0]]}}}', b'{"hands": {"right": {"joints": ' + json.dumps([["x"] * 3] * 21).encode() + b"}}}", b"[" * 5000, b"HSH1", whole[:-1], whole + b"HSH1",
             b"x" * 20000, PACKED.pack(b"HSH1", 7, 21, 0, 0.0) + bytes(252), PACKED.pack(b"HSH1", 0, 255, 0, 0.0)]
    for data in wrong:
        follower.data(data)
    assert follower.faults == len(wrong)
    for _ in range(300):
        spoilt = bytearray(whole)
        for _ in range(draw.integers(1, 8)):
            spoilt[draw.integers(len(spoilt))] = draw.integers(256)
        follower.data(bytes(spoilt))
    session._take()
    session._steps(50)
    follower.close()
    assert not session.course.failed and np.isfinite(session.course.core.q).all()


@pytest.mark.parametrize("kind", ["packed", "json", "names"])
def test_a_stream_over_udp_moves_the_hand(can, kind):
    from handsim._live.measure import free_port
    from handsim._live.streams import OPENXR

    filter_, port = HandFilter(can, 0), free_port()
    angles = np.clip([0.6 if axis.endswith("flexion") else 0.0 for axis in filter_.axes], filter_._low, filter_._high)
    points = filter_.points(np.concatenate(([0, 0, 0.3, 1, 0, 0, 0], angles)))
    with hs.live(can, page=False, stream=[f"udp://127.0.0.1:{port}"]) as live, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as to:
        wrist = live.session.view.wrists[0, :3].copy()
        for k in range(900):  # a busy machine takes the newest of several frames: as many as it needs
            data = packed(0, points, k / 90) if kind == "packed" else json.dumps({"t": k / 90, "hands": {"right": {
                "joints": points.tolist() if kind == "json" else dict(zip(OPENXR, points.tolist()))}}}).encode()
            to.sendto(data, ("127.0.0.1", port))
            if k == 0:  # before the scene's own motion moves the wrist
                end = time.monotonic() + 20
                while live.session.call(lambda s: s.course.controls["wrists"]).result(20) is None and time.monotonic() < end:
                    time.sleep(0.01)
                live.do("play", on=True)
            if k >= 60 and live._follower.frames > 30:
                break
            time.sleep(1 / 90)
        found = live.session.call(lambda s: (s.course.controls["targets"], s.course.core.wrists()[0, :3])).result(20)
        follower = live._follower
        assert follower.frames > 30 and follower.faults == 0, follower.last_fault
    wanted = [angle for axis, angle in zip(filter_.axes, angles) if axis in live.session.facts.axes]
    assert np.allclose(found[0].ends[1], wanted, atol=0.05)
    # The first frame is where the wrist is.
    assert np.allclose(found[1], wrist, atol=1e-3)
    assert len(live.session.latencies) > 5


def frames_of(scene, rate=90, end=4.0):
    """A simulated grasp as a tracker sees it: times and points, without noise."""
    simulation, filter_ = hs.Simulation(scene), HandFilter(scene, 0)
    index, steps, out = [scene.coordinates.index(axis) for axis in filter_.axes], round(1 / rate / scene.step), []
    while simulation.time < end:
        out.append((simulation.time, filter_.points(np.concatenate((simulation._core.wrists()[0], np.array(simulation.q)[index])))))
        simulation.step(substeps=steps)
    return steps, out


class InStep:
    """A follower whose frames come in step with the simulated time."""

    def __init__(self, scene):
        self.session = Session(scene)
        self.follower = Follower(self.session)
        self.follower.close()  # no clock
        self.follower.origin = "world"
        self.rates = []

    def frame(self, t, points):
        self.follower.message({"t": t, "hands": {"right": {"joints": points.tolist()}}})
        self.session._take()

    def run(self, steps):
        for _ in range(steps):
            self.session._steps(1)
            self.rates.append(np.abs(np.array(self.session.course.core.u)).max())
        self.session._publish(time.monotonic())


def test_no_joint_is_faster_than_20_rad_per_s_when_200_ms_of_frames_are_missing():
    # Hands that go through every pose without an object, whose contact could push joints; gaps at many times.
    scene = hs.load("every_pose", engine="articulated")
    simulation, filter_, frames = hs.Simulation(scene), HandFilter(scene, 0), []
    index, steps = [scene.coordinates.index(axis) for axis in filter_.axes], round(1 / 90 / scene.step)
    while simulation.time < 7:
        frames.append((simulation.time, filter_.points(np.concatenate(([0, 0, 0.3, 1, 0, 0, 0], np.array(simulation.q)[index])))))
        simulation.step(substeps=steps)
    draw, fastest = np.random.default_rng(7), []
    for first in range(60, len(frames) - 60, 74):
        drive = InStep(scene)
        for k in range(first - 40, first + 60):
            t, points = frames[k]
            if first <= k < first + 18:  # 200 ms
                follower = drive.follower
                follower._use(follower._hands["right"], follower._hands["right"].filter.predicted(t - frames[first - 1][0]))
                follower._send(time.monotonic(), 0.01)
                drive.session._take()
            else:
                drive.frame(t, points + draw.normal(0, 2e-3, points.shape))
            drive.run(steps)
        fastest.append(max(drive.rates[40 * steps:]))
    assert len(fastest) >= 6 and max(fastest) < 20


@pytest.fixture(scope="module")
def other_hand():
    """Of the median man, with bones that are 15 % shorter."""
    lengths = hs.Hand(stature=1.755, mass=84.5, sex="male").segments
    bones = {name: 0.85 * length for name, length in zip(lengths["name"], lengths["length"]) if name != "palm"}
    return HandFilter(hs.load("every_pose", {"hands.0.person": {"stature": 1.755, "mass": 84.5, "sex": "male", "bones": bones}}, engine="articulated"), 0)


def streamed(filter_, seconds, shown=lambda points, pose: points, side="right", scene="every_pose", still=None, **hand):
    """A follower in step that has seen a moving hand for so long, or one with the angles `still`, the errors of its angles after 4 s [rad], shape (frames, axes),
    and what the session tells."""
    session = Session(hs.load(scene, engine="articulated"))
    follower = Follower(session)
    times, pose = moving(filter_, 5, seconds=seconds)
    poses, out = [pose(t) if still is None else np.concatenate((pose(0.0)[:7], still)) for t in times], []
    angles, tracked = np.array(poses)[:, 7:], follower._hands[side]
    for t, each in zip(times, poses):
        follower.message({"t": float(t), "hands": {side: {"joints": shown(filter_.points(each), each), **hand}}})
        if t > 3.2:
            tracked.measured.close()
        if t > 4:
            out.append(tracked.filter.late_angles() - [np.interp(t - DELAY, times, column) for column in angles.T])
    follower.close()
    return np.array(out), session


def dorsal(points, pose):
    """The wrist's point 20 mm dorsal of the joint."""
    w, x, y, z = pose[3:7]
    out = points.copy()
    out[0] += 0.02 * np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return out


# Oracle: the angles of the hand that is streamed, every axis in every frame. The bound is the goal, 5 deg; without measuring, errors are 30 deg.
def test_a_hand_of_other_proportions_is_measured_in_its_first_seconds(other_hand, monkeypatch):
    errors, session = streamed(other_hand, 8, lambda points, pose: dorsal(points, pose).tolist())
    assert np.degrees(np.abs(errors).max()) < 5
    found = session.tracked["right"]
    assert 3 <= found["seconds"] < 4 and found["points"] is None and any("wrist by" in each for each in session.notices)
    monkeypatch.setattr("handsim._live.measured.MOMENTS", ())
    assert np.degrees(np.abs(streamed(other_hand, 5, lambda points, pose: dorsal(points, pose).tolist())[0]).max()) > 15


# Oracle: the angles of the hand that is streamed; it keeps one posture, so that places of points explain it as well as angles do. The bound, of means over 1 s
# without the noise of single frames, is that of a hand that moves; when all places were fitted at once, they were up to 36 deg off.
@pytest.mark.parametrize("share", [0.15, 0.5, "any", "other"])
def test_a_still_hand_of_other_proportions_is_measured(other_hand, share):
    low, high = other_hand._low, other_hand._high
    at = np.random.default_rng(len(share)).uniform(0.15, 0.85, len(low)) if isinstance(share, str) else np.where([axis.endswith("flexion") for axis in other_hand.axes], share, 0.5)
    noise = np.random.default_rng(1)
    errors, session = streamed(other_hand, 5, lambda points, pose: (dorsal(points, pose) + noise.normal(0, 2e-3, points.shape)).tolist(), still=low + at * (high - low))
    assert np.degrees(np.abs(errors.mean(axis=0)).max()) < 5 and np.degrees(np.sqrt(np.mean(errors**2))) < 3
    assert any("(wrist by 20 mm)" in each for each in session.notices), session.notices


# Oracle: what a hand that keeps one posture cannot tell is more than what one that moves cannot.
def test_what_frames_do_not_tell_of_a_hand_is_said():
    from handsim._live.measured import find, shipped

    scene = hs.load("every_pose", engine="articulated")
    filter_, noise = HandFilter(scene, 0), np.random.default_rng(1)
    times, pose = moving(filter_, 5, rate=20.0, seconds=3.0)
    told = [set(find(scene, 0, shipped("mano", ""), list(times), np.array([filter_.points(each) for each in poses]) + noise.normal(0, 2e-3, (len(times), 21, 3))).state["assumed"])
            for poses in ([pose(t) for t in times], [pose(0.0)] * len(times))]
    assert told[0] < told[1] and "point wrist" in told[1] - told[0], told


# Oracle: the moments that are said, and the number of frames that are kept.
@pytest.mark.parametrize("assumed, times", [(["index_distal"], [3, 10, 30, 90]), ([], [3, 10])])
def test_a_hand_is_measured_while_something_of_it_is_assumed(monkeypatch, assumed, times):
    from handsim._live import measured as module

    asked = []
    monkeypatch.setattr(module, "find", lambda scene, hand, layout, frames, points: asked.append(frames) or module.Found(object(), {"assumed": assumed}, []))
    of = module.Measured()
    for k in range(120 * 30):
        if of.add(np.zeros((21, 3)), k / 30):
            of.start(None, 0, None)
            of.close()
    assert [frames[-1] - frames[0] for frames in asked] == pytest.approx(times, abs=0.4)
    assert all(40 <= len(frames) <= 400 for frames in asked)


# Oracle: the convention whose order, names and number the points have.
@pytest.mark.parametrize("name, listed", [("mano_joints", True), ("openxr", True), ("openxr", False), ("webxr", True)])
def test_a_stream_tells_its_convention(other_hand, name, listed):
    from handsim._live.measured import shipped

    layout = shipped(name, "")

    def shown(points, _):
        if not listed:
            return dict(zip(layout.names, points.tolist()))
        out = np.repeat(points[9:10], layout.size, axis=0)
        out[layout.picked] = points
        return out.tolist()

    errors, session = streamed(other_hand, 4.1, shown)
    found = session.tracked["right"]
    assert found["points"] == name and ("names" if not listed else "order" if name == "mano_joints" else "number") in found["by"]
    assert np.isfinite(errors).all()


# Oracle: which hand it is.
@pytest.mark.parametrize("side", ["right", "left"])
def test_a_hand_that_is_streamed_as_the_other_one_is_noticed(side):
    scene = hs.load("every_pose", engine="articulated")
    other = HandFilter(scene, next(i for i, name in enumerate(scene.hands) if name != side))
    _, session = streamed(other, 3.4, lambda points, _: points.tolist(), side)
    assert "under the wrong name" in session.tracked[side]["trouble"] and session.tracked[side]["trouble"] in session.notices
    own = HandFilter(scene, scene.hands.index(side))
    _, session = streamed(own, 3.4, lambda points, _: points.tolist(), side)
    assert "trouble" not in session.tracked[side]


def test_doubtful_points_of_a_stream_count_as_not_seen():
    scene = hs.load("every_pose", engine="articulated")
    follower, filter_ = Follower(Session(scene)), HandFilter(scene, 0)
    points = filter_.points(np.concatenate(([0, 0, 0.3, 1, 0, 0, 0], np.full(len(filter_.axes), 0.2))))
    spoilt = points + np.where(np.arange(21) == 8, 0.015, 0)[:, None]
    sure = [0.2 if i == 8 else 0.9 for i in range(21)]
    for joints, confidence in ((spoilt, sure), (points, None)):
        follower.message({"t": 0.0, "hands": {"right": {"joints": joints.tolist(), "confidence": confidence}}})
        found = follower._hands["right"].filter.points(follower._hands["right"].filter.pose)
        assert np.abs(found - points)[:8].max() < 2e-3
        follower._hands["right"].filter.lose()
    follower.message({"t": 1.0, "hands": {"right": {"joints": points.tolist(), "confidence": 0.1}}})
    assert follower._hands["right"].filter.time is None
    with pytest.raises(hs.Error, match="confidence: got .*need a number from 0 to 1"):
        follower.message({"t": 1.1, "hands": {"right": {"joints": points.tolist(), "confidence": [0.5]}}})
    follower.close()


def test_a_lost_hand_relaxes_slowly(can):
    session = Session(can)
    follower = Follower(session)
    _, frames = frames_of(can, end=0.3)
    for t, points in frames:
        follower.message({"t": t, "hands": {"right": {"joints": points.tolist()}}})
    end = time.monotonic() + 20
    while not follower._hands["right"].lost and time.monotonic() < end:
        time.sleep(0.01)
    assert follower._hands["right"].lost
    follower.close()
    session._take()
    event = session.course.controls["targets"]
    assert event.steps >= 1000  # over 1 s
    assert session.course.controls["targets"].ends[1][session.facts.axes.index("right.index_mcp.flexion")] == pytest.approx(0.35)


PERSONS = [(1.5, 54, "female"), (1.62, 63, "male"), (1.68, 60, "female"), (1.78, 76, "male"), (1.9, 87, "female")]


def test_a_streamed_grasp_lifts_the_can_in_9_of_10():
    lifted = []
    for trial in range(10):
        stature, mass, sex = PERSONS[trial % 5]
        scene = hs.load("grasp_power_can", {"hands.0.person.stature": stature, "hands.0.person.mass": mass, "hands.0.person.sex": sex}, engine="articulated")
        drive, draw = InStep(scene), np.random.default_rng(trial)
        steps, frames = frames_of(scene)
        for t, points in frames:
            drive.frame(t, points + draw.normal(0, 2e-3, points.shape))
            drive.run(steps)
        can = drive.session.facts.bodies.index("can")
        lifted.append(float(drive.session.view.poses[can, 2]) - 0.352)
    # The shipped scene lifts by 250 mm.
    assert sum(0.2 < height < 0.3 for height in lifted) >= 9, lifted


# The server, attacked.

def get(url, **headers):
    request = urllib.request.Request(url, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, answer.read(), answer.headers
    except urllib.error.HTTPError as error:
        return error.code, error.read(), error.headers


@pytest.fixture
def live(two_hands):
    with hs.live(two_hands, play=True) as out:
        yield out


def memory():
    gc.collect()
    with open("/proc/self/statm") as of:
        return int(of.read().split()[1]) * resource.getpagesize()


def goes_on(live):
    """The simulation still steps in real time, and a page still gets views."""
    begin = live.session.call(lambda s: s.course.tick).result(20)
    status, text, _ = get(live.url)
    assert status == 200 and b"handsimLive" in text
    end = time.monotonic() + 20
    while live.session.call(lambda s: s.course.tick).result(20) < begin + 100:
        assert time.monotonic() < end and not live.state["failed"]
        time.sleep(0.01)


@needs_server
def test_only_who_has_token_host_and_origin_comes_in(live):
    base = live.url.partition("?")[0]
    port = live.url.split(":")[2].split("/")[0]
    assert get(live.url)[0] == 200
    for url in (base, base + "?token=", base + "?token=" + "x" * 32, base + "?token=%ff%00", base + "save/recording", base + "socket"):
        assert get(url)[0] == 403
    assert get(live.url, Host="evil.example")[0] == 403
    assert get(live.url, Host=f"evil.example:{port}")[0] == 403
    assert get(live.url, Origin="http://evil.example")[0] == 403
    socket_url = live.url.replace("/?", "/socket?")
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode()}
    assert get(socket_url, **upgrade)[0] == 403
    assert get(socket_url, Origin="null", **upgrade)[0] == 403
    assert get(socket_url, Origin=f"http://127.0.0.1:{port}@evil.example", **upgrade)[0] == 403
    headers = get(live.url)[2]
    assert "default-src 'none'" in headers["Content-Security-Policy"] and headers["Referrer-Policy"] == "no-referrer"


@needs_server
def test_it_listens_on_the_loopback_address_only(live):
    port = int(live.url.split(":")[2].split("/")[0])
    out = subprocess.run(["ss", "-ltnH", f"sport = :{port}"], capture_output=True, text=True).stdout
    if out:
        assert all(line.split()[3].startswith("127.0.0.1:") for line in out.splitlines())
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.2", port), 1)


def opened(live, origin=None):
    """A socket after the WebSocket's handshake."""
    from urllib.parse import urlsplit

    url = urlsplit(live.url)
    out = socket.create_connection((url.hostname, url.port), 10)
    out.settimeout(10)
    out.sendall((f"GET /socket?{url.query} HTTP/1.1\r\nHost: {url.netloc}\r\nOrigin: {origin or 'http://' + url.netloc}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                 f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}\r\n\r\n").encode())
    head = b""
    while b"\r\n\r\n" not in head:
        piece = out.recv(4096)
        if not piece:
            break
        head += piece
    return out, head


def masked(data, opcode=1, fin=True):
    size = len(data)
    head = bytes([(0x80 if fin else 0) | opcode]) + (bytes([0x80 | size]) if size < 126 else bytes([0xFE]) + struct.pack(">H", size) if size < 65536 else bytes([0xFF]) + struct.pack(">Q", size))
    return head + bytes(4) + data


@needs_server
def test_forged_messages_close_their_page_and_nothing_else(live):
    before = memory()
    draw = np.random.default_rng(5)
    bad = [masked(b"x" * 70000), masked(b"\xff\xfe"), masked(b"{}", opcode=2), masked(b"{}", opcode=7), masked(b"a" * 60000, fin=False) * 4, b"\x81\xff" + struct.pack(">Q", 1 << 62) + bytes(4),
           b"\x81\x02{}", masked(b"x" * 200, opcode=9), masked(b"", opcode=8), masked(b"[" * 60000), bytes(draw.integers(0, 256, 5000, dtype=np.uint8)), masked(b'{"do":"play"}') * 200,
           masked(b'{"do": "spring", "id": 1e999}') * 100, masked(b"null") * 100]
    for data in bad:
        out, head = opened(live)
        assert head.startswith(b"HTTP/1.1 101")
        try:
            out.sendall(data)
            out.settimeout(0.3)
            for _ in range(200):
                if not out.recv(65536):
                    break
        except OSError:
            pass
        out.close()
    goes_on(live)
    assert memory() - before < 100e6
    assert live._server.pages == set() or time.sleep(1) or len(live._server.pages) == 0


@needs_server
def test_requests_that_are_none_do_nothing(live):
    port = int(live.url.split(":")[2].split("/")[0])
    for data in (b"\x00" * 1000, b"GET " + b"a" * 100000 + b" HTTP/1.1\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n", b"\x16\x03\x01" + os.urandom(500),
                 b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 20000 + b"\r\n", b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", b"GET /../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", port), 5) as out:
            out.settimeout(3)
            try:
                out.sendall(data)
                answer = out.recv(200)
            except OSError:
                continue
            assert not answer.startswith(b"HTTP/1.1 200")
    goes_on(live)


@needs_server
def test_a_thousand_connections_leave_it_running(live):
    port = int(live.url.split(":")[2].split("/")[0])
    page, head = opened(live)
    assert head.startswith(b"HTTP/1.1 101")
    held = []
    for _ in range(1000):
        try:
            held.append(socket.create_connection(("127.0.0.1", port), 2))
        except OSError:
            break
    assert len(live._server._handlers.connections) <= 64
    ticks = [live.session.call(lambda s: s.course.tick).result(20)]
    time.sleep(0.3)
    assert live.session.call(lambda s: s.course.tick).result(20) > ticks[0]
    assert page.recv(1000)
    for each in held:
        each.close()
    page.close()
    end = time.monotonic() + 20
    while len(live._server._handlers.connections) > 2 and time.monotonic() < end:
        time.sleep(0.05)
    goes_on(live)


@needs_server
def test_connections_that_say_nothing_are_closed(live, monkeypatch):
    import handsim._live.server as server

    monkeypatch.setattr(server, "PATIENCE", 0.3)
    port = int(live.url.split(":")[2].split("/")[0])
    with socket.create_connection(("127.0.0.1", port), 5) as out:
        out.settimeout(10)
        out.sendall(b"GET / HT")
        assert out.recv(10) == b""


@needs_server
def test_more_pages_than_eight_are_refused(live):
    pages = [opened(live) for _ in range(9)]
    assert [head.startswith(b"HTTP/1.1 101") for _, head in pages].count(True) == 8
    for each, _ in pages:
        each.close()


@needs_server
def test_a_slow_reader_gets_less_and_holds_nobody_up(live):
    slow, head = opened(live)
    assert head.startswith(b"HTTP/1.1 101")
    slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    before, begin = memory(), live.session.call(lambda s: (s.course.tick, time.monotonic())).result(20)
    time.sleep(3)
    tick, now = live.session.call(lambda s: (s.course.tick, time.monotonic())).result(20)
    assert tick - begin[0] > 100
    assert memory() - before < 50e6
    slow.close()
    goes_on(live)


@needs_server
def test_a_tab_that_closes_lets_go(live):
    page, _ = opened(live)
    body = live.session.facts.bodies.index("right.index_distal")
    page.sendall(masked(json.dumps({"do": "spring", "id": 2, "body": body, "point": [0, 0, 0], "goal": [0, 0, 1]}).encode()))
    end = time.monotonic() + 20
    while "2" not in live.session.course.controls["springs"] and time.monotonic() < end:
        time.sleep(0.01)
    assert "2" in live.session.course.controls["springs"]
    page.close()
    while live.session.course.controls["springs"] and time.monotonic() < end:
        time.sleep(0.01)
    assert not live.session.course.controls["springs"]


@needs_server
def test_saved_files_are_those_of_other_commands(live, tmp_path):
    live.do("play", on=False)
    save = {}
    for what in ("recording", "snapshot", "scene"):
        status, data, headers = get(live.url.replace("/?", f"/save/{what}?"))
        assert status == 200 and "attachment" in headers["Content-Disposition"]
        (tmp_path / what).write_bytes(data)
        save[what] = data
    tick, hash_ = live.session.call(lambda s: (s.course.tick, s.course.state_hash())).result(20)
    done = subprocess.run([sys.executable, "-m", "handsim", "live", "--replay", str(tmp_path / "recording")], capture_output=True, text=True)
    assert done.returncode == 0 and hash_ in done.stdout, done.stdout + done.stderr
    again = hs.load(tmp_path / "scene")
    assert np.allclose(hs.Simulation(again).q, live.session.course.core.q, atol=1e-6)
    assert get(live.url.replace("/?", "/save/passwd?"))[0] == 409


# The command line.

def command(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "live", *words], capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("words,said", [([], "no scene"), (["grasp_power_cann"], "nearest"), (["two_hands", "--set", "x"], "KEY=VALUE"), (["two_hands", "--set", "solver.stepp=1"], "stepp"),
                                        (["grasp_power_can", "--stream", "tcp://x"], "udp://"), (["grasp_power_can", "--stream", "udp://127.0.0.1:5005?origin=moon"], "origin"),
                                        (["--replay", "/nonexistent"], "/nonexistent"), (["two_hands", "--nonsense"], "--help"), (["two_hands", "--address", "192.0.2.1"], "192.0.2.1")])
def test_wrong_words_end_with_a_reason_and_status_2(words, said):
    done = command(*words)
    assert done.returncode == 2 and said in done.stderr and "Traceback" not in done.stderr, done.stderr


def test_without_aiohttp_there_is_one_sentence(tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import importlib.util as u\nfind = u.find_spec\nu.find_spec = lambda name, *rest: None if name == 'aiohttp' else find(name, *rest)\n")
    done = subprocess.run([sys.executable, "-m", "handsim", "live", "two_hands"], capture_output=True, text=True, timeout=60,
                          env={**os.environ, "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"})
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "aiohttp" in done.stderr
