"""``handsim track --convention-from REC...``: where a tracker's points lie on the hand, from recordings of several people.

One recording cannot tell a long hand from points that lie far out. So the hands of all people are held to the survey's mean adult at
first, and where their points lie is averaged; then each hand has its size by these places, the sizes are scaled to the survey's mean
again, and the places are found anew for hands of these sizes. Whoever fits a convention should judge it by other people's recordings.
"""
from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any, Mapping, NamedTuple, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _track
from ._errors import input_error
from ._files import check_target, ended, path_of, read_options, write_file
from ._shipped import find_file

Array = NDArray[np.float64]
ADULT = {"stature": 1.690, "mass": 75.1, "sex": "unknown"}
"""Between the survey's mean man and woman."""
LENGTH, BREADTH = 0.1867, 0.0829
"""Of that hand [m]."""
ROUNDS = 3
MOST = 1000
"""Recordings."""
TWICE = 2.0
"""Deviations between recordings that are written as the spread, at least LEAST."""
LEAST: Mapping[bool, Array] = {True: np.array([0.03, 0.03, 0.12]), False: np.array([0.4, 0.1, 0.4])}
"""Spread of a point of the palm, of another."""
HELD = 0.05
"""Of LEAST: spread with which sizes are found."""
MARK = "# The places of the points: handsim track --convention-from"
"""The first line of a file that the command has written, which it may write again."""
POINT = re.compile(r"(\s*- \{name: *([\w-]+), *segment: *(\w+), *at: *)\[([^]]*)\](, *spread: *)\[([^]]*)\](\}.*)")


class Point(NamedTuple):
    name: str
    palm: bool
    spread: Array


def points_of(text: str, file: Path) -> dict[str, Point]:
    """The points of a convention, a line for each. :raises Error: of kind input"""
    found = [POINT.fullmatch(line) for line in text.splitlines()]
    out = {each[2]: Point(each[2], each[3] == "palm", np.array(each[6].split(","), float)) for each in found if each}
    if not out:
        raise input_error(str(file), "no point", "a convention with a line {name: , segment: , at: , spread: } for each point, as the shipped ones have")
    return out


def written(text: str, at: Mapping[str, Array], spread: Mapping[str, Array], digits: int = 4) -> str:
    """A convention's text with these places."""
    def line(found: "re.Match[str]") -> str:
        place, deviation = (", ".join(f"{x:.{digits}g}" for x in of[found[2]]) for of in (at, spread))
        return f"{found[1]}[{place}]{found[5]}[{deviation}]{found[7]}"
    return POINT.sub(line, text)


def fit(recordings: Sequence[Path], start: Path) -> str:
    """The text of the convention that fits recordings, one of each person. :param start: order of points, axes, and how far they may lie off"""
    text = start.read_text(encoding="utf-8")
    points = points_of(text, start)
    with tempfile.TemporaryDirectory() as folder:
        convention, person = Path(folder) / "points.yaml", Path(folder) / "person.yaml"

        def places(sizes: Sequence[Mapping[str, Any]]) -> list[dict[str, Array]]:
            out = []
            for recording, size in zip(recordings, sizes):
                person.write_text("title: held\n" + "".join(f"{key}: {value}\n" for key, value in size.items()))
                found = _track.track(_track.Asked(recording, person, points=start, fit_bones=False))
                used = [feature.partition(".")[2] for feature in found.hands[0].features]
                out.append(dict(zip(used, found.shares)))
            return out

        def sizes() -> list[dict[str, Any]]:
            least: dict[str, Array] = {name: np.where(point.spread > 0, HELD * LEAST[point.palm], 0.0) for name, point in points.items()}
            convention.write_text(written(text, mean, least))
            found = [_track.track(_track.Asked(each, points=convention)).size for each in recordings]
            length, breadth = (1e3 * np.array([each[f"hand_{key}"] for each in found]) for key in ("length", "breadth"))  # [mm]
            length *= LENGTH / np.exp(np.log(length).mean())
            breadth *= BREADTH / np.exp(np.log(breadth).mean())
            return [{**ADULT, "hand_length": a, "hand_breadth": b} for a, b in zip(length, breadth)]

        every = places([ADULT] * len(recordings))
        for _ in range(ROUNDS - 1):
            mean = {name: np.asarray(np.mean([each[name] for each in every], axis=0)) for name in points}
            every = places(sizes())
    mean = {name: np.asarray(np.mean([each[name] for each in every], axis=0)) for name in points}
    spread: dict[str, Array] = {
        name: np.where(point.spread > 0, np.maximum(TWICE * np.std([each[name] for each in every], axis=0, ddof=int(len(every) > 1)), LEAST[point.palm]), 0.0)
        for name, point in points.items()}
    return written(text, mean, spread)


USAGE = """handsim track --convention-from RECORDING... --out FILE

Fits where a tracker's points lie on the hand, from a recording of each of several people (docs/motion.md), and writes the convention for --points.

  --convention-from RECORDING...  the recordings
  --out FILE                      of the convention; replaces one that this has written
  --points NAME                   convention that it starts from: order of the points, axes, and how far they may lie off; mediapipe

Example: handsim track --convention-from ann.json bob.json eve.json --points mediapipe --out mine.yaml
"""


def _work(options: dict[str, Any]) -> int:
    recordings = [path_of("RECORDING", each) for each in options["RECORDING"]]
    start = find_file(options.get("--points", "mediapipe"), "--points", "handmodels/points")
    out = check_target("--out", options["--out"], "convention", [*recordings, start])
    text = fit(recordings, start)
    write_file(out, f"{MARK}\n{text.removeprefix(MARK).lstrip()}".encode())
    print(f"{out}: the places of the points on the hand; judge it by other people's recordings")
    return 0


def main(words: Sequence[str]) -> int:
    """``track --convention-from`` of the command line. :returns: the exit status"""
    if any(each in ("-h", "--help") for each in words):
        print(USAGE, end="")
        return 0
    return ended(lambda: _work(read_options("track", words, "RECORDING", ("--convention-from",), ("--points", "--out"), ("--out",), most=MOST)))
