"""Which tracker a recording is of, by what its file has: a word of its own, names, number and order of the points.

Nothing here is about the motion: the beginning of the file is enough. What is wrong in the file is said by its reader.
"""
from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Iterator, Mapping, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import input_error
from ._shipped import data_path

Array = NDArray[np.float64]
BONES: Mapping[str, tuple[float, float, float, float]] = {
    "thumb": (0.112, 0.251, 0.196, 0.158), "index": (0.460, 0.245, 0.143, 0.097), "middle": (0.446, 0.266, 0.170, 0.108),
    "ring": (0.419, 0.244, 0.165, 0.107), "little": (0.407, 0.204, 0.117, 0.093)}
"""From the wrist to the tip, in hand lengths, of the anatomical hand of the median woman."""
JOINTS: Mapping[str, tuple[str, ...]] = {finger: ("wrist", *(f"{finger}_{joint}" for joint in (("cmc", "mcp", "ip", "tip") if finger == "thumb"
                                                                                              else ("mcp", "pip", "dip", "tip")))) for finger in BONES}
HAND = 187.0
"""Length of a hand to which distances are scaled [mm]."""
GOOD, CLEAR = 16.0, 0.65
"""RMS difference from the bones of a hand up to which an order may be that of the points [mm], and its share of that of other orders."""
READ, FRAMES = 1 << 22, 200
"""Of the file [bytes], of it."""
POINT = re.compile(r"\s*- \{name: *([\w-]+)(?:, *segment: *(\w+))?.*\}.*")
SAID = re.compile(r'"(tracker|convention|device|source)"\s*:\s*"([^"]{1,80})"')
WORDS = {"mediapipe": "mediapipe", "mano": "mano", "openxr": "openxr", "webxr": "webxr", "leap": "leap", "aria": "aria"}
NUMBER = re.compile(r"[0-9]+")


class Sample(NamedTuple):
    """The beginning of a recording, of one hand."""

    names: list[str]
    """As the file has them; of points without names their numbers."""
    listed: bool
    """Points have no names."""
    points: Array
    """Shape (frames, names, 3); NaN where nothing was seen."""
    said: Optional[tuple[str, str]] = None
    """Key and word by which the file names its tracker."""


class Guess(NamedTuple):
    """What the points are taken for."""

    name: Optional[str]
    """Of a shipped convention; None: of none."""
    by: str
    """Why; of several that it may be, which."""

    def told(self) -> str:
        """For people; empty where nothing is to be said."""
        if self.name:
            return f"points: as {self.name} has them, by {self.by} (--points names another convention)"
        return f"points: {self.by}" if self.by else ""


def _floats(texts: Sequence[str]) -> list[float]:
    out = []
    for text in texts:
        try:
            out.append(float(text))
        except ValueError:
            out.append(np.nan)
    return out


def _of_columns(columns: Mapping[str, Sequence[int]], rows: Sequence[Sequence[str]]) -> Optional[Sample]:
    """:param columns: of x, y and z, by name; the hand with more points is looked at"""
    hands = {side: {name.partition(".")[2]: at for name, at in columns.items() if name.startswith(side) and len(at) == 3} for side in ("right.", "left.")}
    one = max(hands.values(), key=len)
    if not one:
        return None
    listed = all(NUMBER.fullmatch(name) for name in one)
    names = sorted(one, key=int) if listed else list(one)
    points = np.array([[_floats([row[i] if i < len(row) else "" for i in one[name]]) for name in names] for row in rows])
    return Sample(names, listed, points.reshape(len(rows), len(names), 3))


def _of_csv(lines: Sequence[str]) -> Optional[Sample]:
    columns: dict[str, list[int]] = {}
    for i, label in enumerate(lines[0].split(",")):
        stem, _, part = label.partition("[")[0].rpartition(".")
        if part in ("x", "y", "z"):
            columns.setdefault(stem, []).append(i)
    return _of_columns(columns, [line.split(",") for line in lines[1:]])


def _of_trc(lines: Sequence[str]) -> Optional[Sample]:
    between = "," if "\t" not in lines[0] else "\t"  # spreadsheets save it with commas
    names = lines[3].split(between) if len(lines) > 3 else []
    return _of_columns({name: [i, i + 1, i + 2] for i, name in enumerate(names) if i >= 2 and name},
                       [line.split(between) for line in lines[5:] if line.strip(", \t")])


def _frames(text: str) -> Iterator[Any]:
    """Of a file of which the end may be cut off."""
    decoder = json.JSONDecoder()
    key = re.search(r'"frames"\s*:\s*\[', text)
    at = key.end() if key else text.find("[") + 1
    for _ in range(FRAMES):
        begin = re.compile(r"[\s,]*").match(text, at)
        try:
            frame, at = decoder.raw_decode(text, begin.end() if begin else at)
        except ValueError:
            return
        yield frame


def _place(point: Any) -> list[float]:
    x: Any = [point.get(axis) for axis in "xyz"] if isinstance(point, dict) else point
    return [float(each) if isinstance(each, (int, float)) else np.nan for each in x[:3]] if isinstance(x, list) and len(x) >= 3 else [np.nan] * 3


def _of_json(text: str, end: str) -> Optional[Sample]:
    said = SAID.search(text[:1 << 16]) or SAID.search(end)
    names: Optional[list[str]] = None
    listed, points = False, []
    for frame in _frames(text):
        hands = frame.get("hands") if isinstance(frame, dict) else None
        for hand in hands if isinstance(hands, list) else []:
            given: Any = hand.get("points") if isinstance(hand, dict) else None
            if names is None and isinstance(given, (list, dict)):
                listed = isinstance(given, list)
                names = [str(i) for i in range(len(given))] if listed else list(given)
            if names is not None and isinstance(given, list if listed else dict) and (not listed or len(given) == len(names)):
                points.append([_place(each) for each in (given if isinstance(given, list) else map(given.get, names))])
    if names is None:
        return None
    return Sample(names, listed, np.array(points, dtype=float).reshape(len(points), len(names), 3), (said[1], said[2]) if said else None)


def sample(recording: Path) -> Optional[Sample]:
    """None for a file that is none, or has no hand by the names of sides."""
    try:
        with open(recording, "rb") as file:
            text = file.read(READ).decode("utf-8-sig", "replace")
            file.seek(max(0, recording.stat().st_size - (1 << 16)))
            end = file.read().decode("utf-8", "replace")
    except OSError:
        return None
    lines = text.splitlines()[:FRAMES]
    kind = recording.suffix.lower()
    if not lines:
        return None
    return _of_json(text, end) if kind == ".json" else _of_trc(lines) if kind == ".trc" else _of_csv(lines) if kind == ".csv" else None


def _joint(name: str, segment: Optional[str]) -> Optional[str]:
    """The keypoint of a point of a convention; None for one that is none of the 21."""
    finger, _, last = name.partition("_")
    if name == "wrist" or last == "tip":
        return name
    if segment == "palm":
        return name if name == "thumb_cmc" else f"{finger}_mcp" if last in ("mcp", "proximal") else None
    if segment is None:
        return None
    return {f"{finger}_middle": f"{finger}_pip", f"{finger}_distal": f"{finger}_dip",
            "thumb_metacarpal": "thumb_cmc", "thumb_proximal": "thumb_mcp", "thumb_distal": "thumb_ip"}.get(segment)


def points_of(convention: Path) -> dict[str, Optional[str]]:
    """Names of the points of a convention in their order, and which of the 21 keypoints each is."""
    try:
        found = [POINT.fullmatch(line) for line in convention.read_text(encoding="utf-8").splitlines()]
    except (OSError, UnicodeDecodeError):
        return {}
    return {each[1]: _joint(each[1], each[2]) for each in found if each}


def shipped() -> dict[str, dict[str, Optional[str]]]:
    """The points of the shipped conventions."""
    return {file.stem: points_of(file) for file in sorted((data_path() / "handmodels/points").glob("*.yaml"))}


def off(points: Array, joints: Sequence[Optional[str]]) -> float:
    """RMS difference of the lengths of the bones from those of a hand of the length that fits best [mm], in an order; inf where it cannot be said.

    :param points: shape (frames, points, 3), in any unit
    :param joints: the keypoint of each point
    """
    at = {joint: i for i, joint in enumerate(joints) if joint}
    bones = [(at[a], at[b], share) for finger, chain in JOINTS.items() for a, b, share in zip(chain, chain[1:], BONES[finger]) if a in at and b in at]
    if len(bones) < 12 or not len(points):
        return float("inf")
    lengths = np.stack([np.linalg.norm(points[:, a] - points[:, b], axis=1) for a, b, _ in bones], axis=1)
    lengths = lengths[np.isfinite(lengths).all(axis=1) & (lengths.sum(axis=1) > 0)]
    if not len(lengths):
        return float("inf")
    shares = np.array([share for *_, share in bones])
    sizes = lengths @ shares / (shares @ shares)
    return float(HAND * np.sqrt(np.mean((lengths / sizes[:, None] - shares)**2)))


def _orders(of: Sample, every: Mapping[str, Mapping[str, Optional[str]]]) -> dict[str, float]:
    """How far bones are off, by convention of so many points [mm]."""
    return {name: off(of.points, list(points.values())) for name, points in every.items() if len(points) == len(of.names)}


def _clearest(orders: Mapping[str, float]) -> Optional[float]:
    """How far the bones of the best order are off, where it is that of a hand and others are not."""
    best = min(orders.values(), default=float("inf"))
    return best if best <= GOOD and all(each <= best * 1.001 or CLEAR * each >= best for each in orders.values()) else None


def _several(names: Sequence[str], what: str) -> Guess:
    return Guess(None, f"{what} as {' and '.join(names)} have them: taken as joint centres until the fit says otherwise, as the file does not say which "
                 "(--points names the tracker)")


def _by_names(of: Sample, every: Mapping[str, Mapping[str, Optional[str]]]) -> Guess:
    plain = {_core.plain_name(name) for name in of.names}
    may = [name for name, points in every.items() if plain <= set(points) and name != "mano_joints"]  # of names no order counts
    for style, name in (("xr_hand_", "openxr"), ("phalanx", "webxr"), ("_finger_", "mediapipe")):
        written = next((each for each in of.names if style in each.lower()), None)
        if written and name in may:
            return Guess(name, f"names such as {written}")
    may = [name for name in may if plain == set(every[name])] or may
    if len(may) == 1 and len(plain) > 3:
        own = [each for each in of.names if sum(_core.plain_name(each) in points for points in every.values()) == 1] or of.names
        return Guess(may[0], f"its {len(of.names)} names, such as {own[0]}")
    return _several(may, f"{len(of.names)} names") if may else Guess(None, "")


def guess(of: Optional[Sample]) -> Guess:
    """Of a recording of which nobody has said the tracker."""
    if of is None:
        return Guess(None, "")
    every = shipped()
    orders = _orders(of, every) if of.listed else {}
    best = _clearest(orders)
    word = next((name for part, name in WORDS.items() if of.said and part in of.said[1].lower()), None)
    if word and of.said:
        by = f'"{of.said[0]}": "{of.said[1]}"'
        if word == "mano" and best is not None and orders.get("mano_joints") == best:
            return Guess("mano_joints", f"{by} and the order of its points")
        return Guess(word, by)
    if not of.listed:
        return _by_names(of, every)
    may = [name for name, each in orders.items() if best is None or each <= best * 1.001]
    if len(may) == 1 and len(orders) == 1:
        return Guess(may[0], f"the number of its points, {len(of.names)}")
    if len(may) == 1 and best is not None:
        rest = min(each for name, each in orders.items() if name != may[0])
        return Guess(may[0], f"the order of its points: bones are {best:.0f} mm off those of a hand, {rest:.0f} mm or more in other orders")
    return _several(may, f"{len(of.names)} points") if may else Guess(None, "")


def check_order(recording: Path, of: Optional[Sample], said: str, points: Mapping[str, Optional[str]]) -> None:
    """:param said: whose order it is, for the message; `points`: of it. :raises Error: of kind input where it is another one's"""
    if of is None:
        return
    joints = [points.get(_core.plain_name(name)) for name in of.names] if not of.listed else list(points.values())
    if len(joints) != len(of.names):
        return
    own, orders = off(of.points, joints), _orders(of, shipped())
    best = min(orders.values(), default=float("inf"))
    if np.isfinite(own) and own > GOOD and best <= min(GOOD, CLEAR * own):
        names = " or ".join(name for name, each in orders.items() if each <= best * 1.001)
        raise input_error(str(recording),
                          f"points in another order than {said}: bones are {own:.0f} mm off those of a hand, and {best:.0f} mm in the order of {names}",
                          f"--points {names}" if of.listed else "names for the points in that order")
