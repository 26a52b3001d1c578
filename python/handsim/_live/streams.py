"""Tracked hands that drive a session: frames from UDP, standard input or the page's socket.

A frame has 21 points (camera trackers), 25 (WebXR), 26 (OpenXR) or those of the stream's convention, of one hand or two, as JSON or
packed (docs/live.md). What the hand's own bones are, and where the points lie on it, is measured from its first seconds (`measured`).
"""
from __future__ import annotations

import json
import math
import socket
import struct
import sys
import threading
import time
from typing import Any, Mapping, Optional, Sequence
from urllib.parse import parse_qs, urlsplit

import numpy as np
from numpy.typing import NDArray

from .._errors import Error, input_error
from .._shipped import find_file
from .commands import Command, is_number, shown
from .measured import KEYPOINTS, Found, Layout, Measured, guessed, shipped
from .session import Session
from .tracker import LONGEST_GAP, HandFilter

Array = NDArray[np.float64]
LARGEST_FRAME = 1 << 14
"""Bytes."""
PACKED = struct.Struct("<4sBBHd")
"""``HSH1``, hand (0 right, 1 left), number of points, 0, time [s]; then float32 x y z of each point [m]."""
SIDES = ("right", "left")
TIMESTAMP = 35
"""SO_TIMESTAMPNS of Linux: the kernel says when a datagram came."""
RELAX = 1.0
"""A hand that is lost opens to its rest within this time [s]."""
REST = 0.35
"""Flexion of a hand at rest [rad]."""
PRESS = {"thumb_cmc.flexion": 0.12, "thumb_cmc.abduction": -0.35, "thumb_mcp.flexion": 0.18, "thumb_ip.flexion": 0.16,
         **{f"{finger}_{joint}.flexion": angle for finger in ("index", "middle", "ring", "little")
            for joint, angle in (("mcp", 0.12), ("pip", 0.35), ("dip", 0.35))}}
"""A camera sees where fingers are and not how they press. While thumb or palm and a finger touch an object, targets lie so far
beyond the tracked angles [rad], as those of the shipped power grasp do; times the stream's `press`."""
OPENING = 0.5
"""A hand whose fingers open faster than this on average does not press [rad/s]."""
FINISH_AFTER = 0.003
"""A frame, what only the next one needs [s]."""
PRESS_TIME = 0.2
"""In which it begins [s]."""
WRIST_SPEED = 2.0
"""Largest, of a driven wrist that follows [m/s]."""

LEAST_CONFIDENCE = 0.5
"""A point with less was not seen; chosen, as for `handsim track`."""
FIRST = 10
"""Frames of 21 points without names, by whose bones their order is guessed."""

FINGERS = ("thumb", "index", "middle", "ring", "little")
# Of 26 and 25 points those that cameras have: no palm, no metacarpals of fingers.
OF_26 = [1, 2, 3, 4, 5, *(i for first in (7, 12, 17, 22) for i in range(first, first + 4))]
PICKED = {21: list(range(21)), 25: [i - 1 for i in OF_26], 26: OF_26}
OPENXR = ["wrist", "thumb_metacarpal", "thumb_proximal", "thumb_distal", "thumb_tip",
          *(f"{finger}_{joint}" for finger in FINGERS[1:] for joint in ("proximal", "intermediate", "distal", "tip"))]
WEBXR = ["wrist", "thumb-metacarpal", "thumb-phalanx-proximal", "thumb-phalanx-distal", "thumb-tip",
         *(f"{finger}-finger-{joint}" for finger in ("index", "middle", "ring", "pinky")
           for joint in ("phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"))]


def _names_of(joints: Mapping[str, Any], layout: Optional[Layout]) -> list[str]:
    return max(([layout.names] if layout else []) + [KEYPOINTS, OPENXR, WEBXR], key=lambda names: sum(name in joints for name in names))


def points_of(joints: Any, layout: Optional[Layout] = None) -> Array:
    """The 21 points of a list or of a mapping by name [m]. :param layout: of a list; else by its length. :raises Error: of kind input"""
    picks = {layout.size: layout.picked} if layout else PICKED
    if isinstance(joints, Mapping):
        names = _names_of(joints, layout)
        if not any(name in joints for name in names):
            raise input_error("joints", ", ".join(map(str, list(joints)[:3])) or "no name", "names of cameras, OpenXR or WebXR")
        joints = [joints.get(name) for name in names]
        picks = PICKED
    if not isinstance(joints, (list, np.ndarray)) or len(joints) not in picks:
        raise input_error("joints", f"{len(joints)} points" if isinstance(joints, (list, np.ndarray)) else type(joints).__name__,
                          f"{layout.size} points, or a mapping by name" if layout else "21, 25 or 26 points, or a mapping by name")
    picked = picks[len(joints)]
    if isinstance(joints, np.ndarray):
        return np.where((np.abs(joints) < 1e3).all(axis=1, keepdims=True), joints, np.nan)[picked]
    out = np.full((21, 3), np.nan)
    for row, i in enumerate(picked):
        point = joints[i]
        if point is None:
            continue
        if not isinstance(point, (list, tuple)) or len(point) != 3 or any(type(x) not in (int, float) for x in point):
            raise input_error(f"joints.{i}", shown(point), "x, y, z [m], or null for a point that was not seen")
        if all(is_number(x) and abs(x) < 1e3 for x in point):
            out[row] = point
    return out


def layout_of(joints: Any) -> Optional[Layout]:
    """By names or number of the points; None for 21 without names."""
    if isinstance(joints, Mapping):
        names = _names_of(joints, None)
        style = {OPENXR[1]: "openxr", WEBXR[1]: "webxr"}.get(names[1])
        return shipped(style, "its names") if style else Layout.of(None, "its names")
    style = {25: "webxr", 26: "openxr"}.get(len(joints))
    return shipped(style, f"the number of its points, {len(joints)}") if style else None


def doubtful(points: Array, joints: Any, sure: Any, picked: Sequence[int]) -> Array:
    """Points of which the tracker is not sure are not seen.

    :param sure: of all, or a list of a number for each of `joints`
    :raises Error: of kind input
    """
    if sure is None:
        return points
    numbers = [sure] * len(joints) if not isinstance(sure, list) else sure
    if len(numbers) != len(joints) or isinstance(sure, list) and isinstance(joints, Mapping) or not all(is_number(each) and 0 <= each <= 1 for each in numbers):
        raise input_error("confidence", shown(sure), "a number from 0 to 1, or a list of one for each point of a list")
    if not isinstance(sure, list):
        return points if sure >= LEAST_CONFIDENCE else np.full_like(points, np.nan)
    return np.where(np.array(sure, float)[list(picked)][:, None] >= LEAST_CONFIDENCE, points, np.nan)


def read_packed(data: bytes) -> dict[str, Any]:
    """The frame of a packed text. :raises Error: of kind input"""
    hands: dict[str, Any] = {}
    at, moment = 0, None
    while at < len(data):
        try:
            magic, side, count, _, moment = PACKED.unpack_from(data, at)
            if magic != b"HSH1" or side > 1 or count not in (21, 25, 26):
                raise ValueError
            with np.errstate(invalid="ignore"):  # a signalling NaN
                points = np.frombuffer(data, "<f4", 3 * count, at + PACKED.size).reshape(count, 3).astype(float)
        except (struct.error, ValueError):
            raise input_error("frame", f"{len(data)} bytes that are no packed frame", "HSH1, hand, 21, 25 or 26 points") from None
        at += PACKED.size + 12 * count
        hands[SIDES[side]] = {"joints": points}
    return {"t": moment, "hands": hands}


class Tracked:
    """A hand of the scene and what drives it."""

    def __init__(self, session: Session, index: int) -> None:
        facts = session.facts
        self.index = index
        self.filter = HandFilter(facts.scene, index)
        self.layout: Optional[Layout] = None
        """Of the stream's points; None until it is known."""
        self.first: list[Array] = []
        """Frames from which the layout is guessed."""
        self.measured = Measured()
        self.name = facts.scene.hands[index]
        places = {axis: i for i, axis in enumerate(facts.axes)}
        pairs = [(i, places[axis]) for i, axis in enumerate(self.filter.axes) if axis in places]
        self.angles = np.array([i for i, _ in pairs], dtype=int)
        self.axes = np.array([place for _, place in pairs], dtype=int)
        self.rest = np.array([REST if axis.endswith("flexion") and "thumb" not in axis else 0.0 for axis in self.filter.axes])
        self.wrist = next((i for i, name in enumerate(facts.scene.wrists) if name.startswith(self.name + ".")), None)
        self.offset: Optional[Array] = None
        plain = [axis.partition(".")[2] for axis in self.filter.axes]
        self.press = np.array([PRESS.get(axis, 0.0) for axis in plain])
        self.flexes = np.array([axis.endswith("flexion") and "thumb" not in axis for axis in plain])
        self.share = 0.0
        """Of the press, that acts."""
        self.heard = 0.0
        self.period = 1 / 60
        self.lost = True


class Follower:
    """Turns frames into targets of joints and poses of driven wrists. :raises Error: of kind input for a wrong stream"""

    def __init__(self, session: Session, streams: Sequence[str] = ()) -> None:
        self.session = session
        self.origin, self.up, self.press = "first", "z", 1.0
        self.stated: Optional[Layout] = None
        """The convention of the stream's points, where it is said."""
        self.faults, self.frames = 0, 0
        self.last_fault = ""
        self._sources: list[Any] = []
        self._lock = threading.Lock()
        self._closed, self._fresh = threading.Event(), threading.Event()
        self._facts = session.facts
        self._hands = self._find_hands()
        self._targets: Optional[Array] = None
        self._wrists: Optional[Array] = None
        self._sockets: list[socket.socket] = []
        try:
            for each in streams:
                self._open(each)
        except BaseException:
            for heard in self._sockets:
                heard.close()
            raise
        self._watch = threading.Thread(target=self._keep_watch, name="handsim live gaps", daemon=True)
        self._watch.start()

    def _find_hands(self) -> dict[str, Tracked]:
        out: dict[str, Tracked] = {}
        for i, name in enumerate(self._facts.scene.hands):
            side = "left" if name.startswith("left") else "right"
            out.setdefault(side, Tracked(self.session, i))
        if not out or not self._facts.axes:
            raise input_error("stream", "a scene without hands that are controlled", "one with hands and control")
        return out

    def _open(self, stream: str) -> None:
        url = urlsplit(stream)
        options = {key: values[-1] for key, values in parse_qs(url.query).items()}
        for key, known in {"origin": ("first", "world"), "up": ("z", "y")}.items():
            if key in options:
                if options[key] not in known:
                    raise input_error("stream", f"{key}={options[key]}", f"{key} as one of {', '.join(known)}")
                setattr(self, key, options.pop(key))
        if "points" in options:
            self.stated = Layout.of(find_file(options.pop("points"), "points", "handmodels/points"), "points=")
        if "press" in options:
            try:
                self.press = float(options.pop("press"))
            except ValueError:
                self.press = math.nan
            if not 0 <= self.press <= 3:
                raise input_error("stream", stream, "press from 0 to 3")
        if options:
            raise input_error("stream", stream, "no other options than origin, up, points and press")
        if url.scheme == "udp":
            try:
                port, host = url.port, url.hostname
            except ValueError:
                port, host = None, None
            if not port or not host:
                raise input_error("stream", stream, "udp://127.0.0.1:PORT")
            heard = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
            try:
                heard.bind((host, port))
            except OSError as error:
                heard.close()
                raise input_error("stream", f"{stream} ({error.strerror})", "a free port of this machine") from None
            heard.settimeout(0.2)
            if sys.platform == "linux":
                heard.setsockopt(socket.SOL_SOCKET, TIMESTAMP, 1)
            self._sockets.append(heard)
            self._sources.append(lambda: self._udp(heard))
            if not host.startswith("127.") and host != "::1":
                print(f"warning: {host} is open to other machines: whoever reaches it can move the hands", file=sys.stderr)
        elif stream.partition("?")[0] == "stdin":
            self._sources.append(self._stdin)
        elif stream.partition("?")[0] != "ws":
            raise input_error("stream", stream, "udp://127.0.0.1:PORT, stdin or ws")

    def start(self) -> None:
        for source in self._sources:
            threading.Thread(target=source, name="handsim live stream", daemon=True).start()

    def close(self) -> None:
        self._closed.set()
        self._watch.join()
        for tracked in self._hands.values():
            tracked.measured.close()

    def _udp(self, heard: socket.socket) -> None:
        with heard:
            while not self._closed.is_set():
                try:
                    data, extra, _, _ = heard.recvmsg(LARGEST_FRAME + 1, 64)
                except socket.timeout:
                    continue
                born = time.monotonic()
                for _, kind, text in extra:
                    if kind == TIMESTAMP and len(text) == 16:
                        seconds, part = struct.unpack("qq", text)
                        born -= min(1.0, max(0.0, time.time() - seconds - 1e-9 * part))
                self.data(data, born)

    def _stdin(self) -> None:
        source = sys.stdin.buffer
        while not self._closed.is_set():
            line = source.readline(LARGEST_FRAME + 1)
            if not line:
                return
            self.data(line)

    def data(self, data: bytes, born: Optional[float] = None) -> None:
        """A frame as it came, and when it came by `time.monotonic`; one that is wrong is counted and left out."""
        try:
            if len(data) > LARGEST_FRAME:
                raise input_error("frame", f"more than {LARGEST_FRAME} bytes", "fewer")
            if data[:4] == b"HSH1":
                self.message(read_packed(data), born)
            else:
                self.message(json.loads(data), born)
        except Exception as error:  # whatever a stranger's frame does, the next one is read
            self.faults += 1
            self.last_fault = str(error)[:300]

    def message(self, message: Mapping[str, Any], born: Optional[float] = None) -> None:
        """A frame ``{"t": seconds, "hands": {"right": {"joints": [...]}}}``. :raises Error: of kind input"""
        born = time.monotonic() if born is None else born
        hands = message.get("hands") if isinstance(message, Mapping) else None
        if not isinstance(hands, Mapping) or not hands or not set(hands) <= set(SIDES):
            raise input_error("hands", shown(hands), "an object with right, left or both")
        moment = message.get("t")
        if moment is None:
            moment = born
        if not is_number(moment):
            raise input_error("t", shown(moment), "seconds")
        with self._lock:
            self._refresh()
            read = {side: self._read(self._hands.get(side), hand) for side, hand in hands.items()}
            for side, points in read.items():
                tracked = self._hands.get(side)
                if tracked is not None:
                    self._follow(tracked, points, float(moment), born)
            self.frames += 1
            self._send(born, 0.004)
        self._fresh.set()

    def _refresh(self) -> None:
        """The scene may have been built anew."""
        facts = self.session.facts
        if facts is self._facts:
            return
        before = self._hands
        self._facts = facts
        self._hands = self._find_hands()
        for side, old in before.items():
            if side in self._hands:
                new = self._hands[side]
                new.offset, new.layout = old.offset, old.layout
                if new.filter.axes == old.filter.axes:  # the same model: what was measured holds
                    new.measured, new.filter = old.measured, old.filter
        self._targets = self._wrists = None

    def _read(self, tracked: Optional[Tracked], hand: Any) -> Array:
        """The 21 points of a hand, of which the layout becomes known meanwhile. :raises Error: of kind input"""
        joints = hand.get("joints") if isinstance(hand, Mapping) else None
        layout = self.stated or (tracked.layout if tracked else None)
        if layout and not self.stated and isinstance(joints, (list, np.ndarray)) and len(joints) != layout.size:
            layout = None  # another tracker
        points = points_of(joints, layout)
        picked = layout.picked if layout else PICKED.get(0 if joints is None else len(joints), PICKED[21])
        points = doubtful(points, joints, hand.get("confidence"), picked)
        if tracked is None or tracked.layout is layout is not None:
            return points
        layout = layout or layout_of(joints)
        if layout is None:
            tracked.first.append(points)
            if len(tracked.first) < FIRST:
                return points
            layout, tracked.first = guessed(np.array(tracked.first)), []
            if layout.picked != PICKED[21]:  # angles up to now are of points in another order
                tracked.filter.lose()
                points = points[layout.picked]
        tracked.layout, tracked.measured = layout, Measured()
        return points

    def _take(self, tracked: Tracked, found: Found) -> None:
        """What was measured of a hand, in place of frames that are scaled."""
        self.session.tracked = {**self.session.tracked, tracked.name: found.state}
        for text in found.warnings:
            self.session.notice(text)
        if found.fit is not None:
            tracked.filter, tracked.offset = HandFilter(self._facts.scene, tracked.index, found.fit), None

    def _follow(self, tracked: Tracked, points: Array, moment: float, born: float) -> None:
        if self.up == "y":
            points = np.stack((points[:, 0], -points[:, 2], points[:, 1]), axis=1)
        found, tracked.measured.found = tracked.measured.found, None
        if found is not None:
            self._take(tracked, found)
        if tracked.layout is not None and tracked.measured.add(points, moment):
            tracked.measured.start(self._facts.scene, tracked.index, tracked.layout)
        gap, before = born - tracked.heard, tracked.filter.time
        if not tracked.filter.update(points, moment):
            return
        if 1e-3 < gap < 0.1:
            tracked.period += 0.1 * (gap - tracked.period)
        # By the frames' own time: frames that come late press no longer than they show.
        self._press(tracked, 0.0 if before is None else min(max(moment - before, 0.0), 0.1))
        tracked.heard, tracked.lost = born, False
        pose = tracked.filter.pose.copy()
        pose[7:] = tracked.filter.late_angles() + tracked.share * self.press * tracked.press
        self._use(tracked, pose)

    def _press(self, tracked: Tracked, dt: float) -> None:
        """Begins or ends to press."""
        touch = {name[len(tracked.name) + 1:].partition("_")[0].partition(".")[0] for name in self.session.view.touch
                 if name.startswith(tracked.name + ".")}
        holds = bool(touch & {"thumb", "palm"}) and bool(touch & set(FINGERS[1:]))
        on = holds and float(np.mean(tracked.filter.rates[6:][tracked.flexes])) > -OPENING
        tracked.share = min(1.0, tracked.share + dt / PRESS_TIME) if on else max(0.0, tracked.share - 2 * dt / PRESS_TIME)

    def _use(self, tracked: Tracked, pose: Array) -> None:
        view = self.session.view
        if self._targets is None:
            self._targets = view.targets.copy()
        self._targets[tracked.axes] = pose[7:][tracked.angles]
        if tracked.wrist is None:
            return
        if self._wrists is None:
            self._wrists = view.wrists.copy()
        if tracked.offset is None:
            tracked.offset = self._wrists[tracked.wrist, :3] - pose[:3] if self.origin == "first" else np.zeros(3)
        self._wrists[tracked.wrist, :3] = pose[:3] + tracked.offset
        self._wrists[tracked.wrist, 3:] = pose[3:7]

    def _send(self, born: float, ramp: float) -> None:
        """Targets and wrists, each within the time of a ramp [s]."""
        try:
            values: dict[str, Any] = {"born": born}
            if self._targets is not None:
                values["targets"] = {"values": self._targets.tolist(), "time": ramp}
            if self._wrists is not None:
                way = math.sqrt(float(np.max(np.sum((self._wrists[:, :3] - self.session.view.wrists[:, :3])**2, axis=1))))
                values["wrists"] = {"values": self._wrists.tolist(), "time": max(ramp, way / WRIST_SPEED)}
            if len(values) > 1:
                self.session.send(Command("tracked", values, "tracked"))
        except Error as error:
            self.last_fault = str(error)

    def _keep_watch(self) -> None:
        """Predicts over gaps; a hand without frames for long relaxes. Ends the work on a frame when its step is under way."""
        while not self._closed.is_set():
            if self._fresh.wait(0.008):
                self._fresh.clear()
                self._closed.wait(FINISH_AFTER)
            try:
                with self._lock:
                    self._bridge(time.monotonic())
            except Exception as error:
                self.session.report(error)

    def _bridge(self, now: float) -> None:
        for tracked in self._hands.values():
            tracked.filter.finish()
            gap = now - tracked.heard
            if tracked.lost or gap < 2.5 * tracked.period:
                continue
            if gap < LONGEST_GAP:
                pose = tracked.filter.predicted(gap)
                pose[7:] += tracked.share * self.press * tracked.press
                self._use(tracked, pose)
                self._send(now, 0.01)
            else:
                tracked.lost = True
                tracked.filter.lose()
                if self._targets is not None:
                    self._targets[tracked.axes] = tracked.rest[tracked.angles]
                self._wrists = None
                tracked.share = 0.0
                self._send(now, RELAX)
