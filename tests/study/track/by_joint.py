#!/usr/bin/env python3
"""Errors of `handsim track` by joint: a made recording of known angles, and the same as other trackers would have it.

usage: by_joint.py [--out FILE.json]

The recording is that of config/bench.yaml, both hands, 626 frames: exact; with 2 mm of normal noise in every coordinate; and with fingers that are 15 %
shorter and a wrist point 20 mm dorsal of the joint, without a convention and without a person, exact and with the noise. Prints a table of the RMS
difference of the angles from the true ones, both hands and all axes of a kind of joint together [deg], and writes it as JSON:
{recording: {joint: RMS}}.
"""
from __future__ import annotations

import argparse
import csv
import json
import tempfile
from pathlib import Path

import numpy as np

import handsim as hs

ROOT = Path(__file__).resolve().parents[3]
FINGERS = ("index", "middle", "ring", "little")
SHORTER = 0.85   # of the bones of the fingers
DORSAL = 20e-3   # of the wrist point [m]
JOINTS = ("wrist", "thumb_cmc", "thumb_mcp", "thumb_ip", "mcp.flexion", "mcp.abduction", "pip", "dip")
RECORDINGS = ("exact", "2 mm", "other points, exact", "other points, 2 mm")


def kind(axis: str) -> str:
    """Of an axis such as `index_mcp.flexion`."""
    joint, coordinate = axis.split(".")
    if joint.startswith("thumb"):
        return joint
    joint = joint.rsplit("_", 1)[-1]
    return f"{joint}.{coordinate}" if joint == "mcp" else joint


def recorded(folder: Path, share: float) -> Path:
    """Keypoints and true angles of a hand whose fingers have this share of their length."""
    person = hs.Hand(person=str(ROOT / "config/persons/median_woman.yaml"), side="right")
    bones = {str(name): share * float(length) for name, length in zip(person.segments["name"], person.segments["length"])
             if str(name).startswith(FINGERS)}
    wanted = {f"hands.{hand}.person": {"stature": 1.627, "mass": 66.9, "sex": "female", "bones": bones} for hand in (0, 1)}
    hs.load(ROOT / "config/bench.yaml", wanted if share != 1 else None).run(out=folder)
    return folder


def with_dorsal_wrist(source: Path, target: Path) -> None:
    """Moves the wrist point along the back of the hand's own axes: the normal of wrist and knuckles."""
    with source.open(newline="") as file:
        head, *rows = csv.reader(file)
    values = np.array(rows, float)
    column = {name.split("[")[0]: i for i, name in enumerate(head)}
    point = lambda name: values[:, [column[f"{name}.{axis}"] for axis in "xyz"]]
    for side, sign in (("right", 1.0), ("left", -1.0)):
        wrist = point(f"{side}.wrist")
        normal = sign * np.cross(point(f"{side}.index_mcp") - wrist, point(f"{side}.little_mcp") - wrist)
        values[:, [column[f"{side}.wrist.{axis}"] for axis in "xyz"]] += DORSAL * normal / np.linalg.norm(normal, axis=1, keepdims=True)
    with target.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(head)
        writer.writerows([repr(float(value)) for value in row] for row in values)


def errors(points: Path, truth: Path, **options: object) -> dict[str, float]:
    squares: dict[str, list[float]] = {}
    for hand in hs.study.track(points, truth=truth, **options).summary["hands"]:
        for axis, error in hand["difference_by_axis_rms_deg"].items():
            squares.setdefault(kind(axis), []).append(error**2)
    return {joint: float(np.sqrt(np.mean(squares[joint]))) for joint in JOINTS if joint in squares}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plain, other = recorded(folder / "plain", 1), recorded(folder / "other", SHORTER)
        with_dorsal_wrist(other / "markers.csv", other / "points.csv")
        person = ROOT / "config/persons/median_woman.yaml"
        found = dict(zip(RECORDINGS, (
            errors(plain / "markers.csv", plain / "trajectory.mot", person=person),
            errors(plain / "markers.csv", plain / "trajectory.mot", person=person, noise=2e-3),
            errors(other / "points.csv", other / "trajectory.mot"),
            errors(other / "points.csv", other / "trajectory.mot", noise=2e-3))))
    print("| joint |", " | ".join(RECORDINGS), "|")
    for joint in found["exact"]:
        print(f"| {joint} |", " | ".join(f"{found[recording][joint]:.2g}" for recording in RECORDINGS), "|")
    if arguments.out:
        arguments.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
