#!/usr/bin/env python3
"""What `handsim track` makes of captured sequences of other people's hands, and whether the scenes that it writes run.

usage: captured.py HANDSIM OUT [--points NAME] [--others] [--only NAME...] [--no-smoothing] [--run]

--others tracks the sequences of each person with a convention that is fitted on one sequence of each other person
(`track --convention-from`), in place of --points.

The folder of the sequences is HANDSIM_RECORDINGS: its files are not part of the project, and the tests that need it are skipped
without it. A file NAME.npz has `right` and `left`, (n, 21, 3) in metres at 30 frames a second, zeros where there is no hand. Prints
a row for each sequence and writes OUT/captured.csv:

- length, breadth [mm] and their percentiles among adults (`percentile`);
- rms: of the distances of the 21 points from the fitted ones, over all tracked frames [mm]; then that of the points of each kind of joint;
- thumb: deepest overlap of the thumb's proximal or last segment with the palm or its thenar pad [mm];
- angle: largest over the fingers' PIP and DIP and the thumb's MCP and IP of the RMS difference between the fitted flexion and the
  angle between the points' own bones [deg], and which joint; then that of each joint and its mean (_mean); without frames whose bones bend backwards;
- tips: RMS distance of the fingertips of a hand with the points' own angles from the points' tips, places on the last segments apart [mm];
- overlap: deepest overlap of the two hands [mm], and its time [s];
- check, ode, articulated: exit statuses of `check` and of `run` on both engines of the scene that is written;
- replay: of the runs, the RMS difference of all angles from the tracked ones while nothing touches a hand, and 0.2 s after that [deg].
"""
from __future__ import annotations

import argparse
import csv
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

RATE = 30.0
# Of the sequences' points, in the order of cameras.
ORDER = [0, 13, 14, 15, 16, 1, 2, 3, 17, 4, 5, 6, 18, 10, 11, 12, 19, 7, 8, 9, 20]
# Rows of three points whose bones enclose a joint's angle.
JOINTS = {"thumb_mcp": (1, 2, 3), "thumb_ip": (2, 3, 4),
          **{f"{finger}_{joint}": (first + i, first + i + 1, first + i + 2)
             for finger, first in (("index", 5), ("middle", 9), ("ring", 13), ("little", 17)) for i, joint in enumerate(("pip", "dip"))}}
# Of the points, by kind: rows in the order of cameras.
KINDS = {"wrist": [0], "thumb_cmc": [1], "thumb_mcp": [2], "thumb_ip": [3], "thumb_tip": [4], "mcp": [5, 9, 13, 17], "pip": [6, 10, 14, 18], "dip": [7, 11, 15, 19],
         "tip": [8, 12, 16, 20]}
# Of a finger: its base among the points; how far distal MANO's knuckle lies of the joint (handmodels/points/mano.yaml), and the lengths of the proximal and the
# middle bone (handmodels/anatomical.yaml), in hand lengths.
BONES = {"index": (5, 0.067, 0.245, 0.143), "middle": (9, 0.121, 0.266, 0.170), "ring": (13, 0.110, 0.244, 0.165), "little": (17, 0.096, 0.204, 0.117)}
# Of adults, men and women: means and standard deviations of length and breadth [mm] in the survey of handmodels/anthropometry.yaml
# (Gordon et al. 2014): a mixture of equal parts.
ADULTS = {"length": ((193.1, 10.0), (181.0, 10.0)), "breadth": ((88.3, 4.4), (78.1, 3.9))}


def percentile(dimension: str, value: float) -> float:
    return 50 * sum(0.5 * math.erfc((mean - value) / (deviation * math.sqrt(2))) for mean, deviation in ADULTS[dimension])


def recording(source: Path) -> dict[str, Any]:
    """As JSON of 21 points; frames of zeros stay zeros, as the sequences have them."""
    data = np.load(source)
    hands = {side: data[side][:, ORDER] for side in ("right", "left")}
    return {"rate": RATE, "unit": "m",
            "frames": [{"hands": [{"side": side, "points": np.round(points[k].astype(float), 6).tolist()} for side, points in hands.items()]}
                       for k in range(len(hands["right"]))]}


def table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Columns and rows of a .csv or .mot."""
    lines = path.read_text().splitlines()
    if path.suffix == ".mot":
        lines = lines[lines.index("endheader") + 1:]
    rows = list(csv.reader(lines, delimiter="\t" if path.suffix == ".mot" else ","))
    return rows[0], rows[1:]


def own_angles(points: np.ndarray, right: bool) -> dict[str, np.ndarray]:
    """Flexion between the points' own bones [deg], by joint; NaN where a finger's joint is bent backwards, as no hand's here is."""
    out = {}
    ulnar = points[:, 17] - points[:, 5]
    for joint, (a, b, c) in JOINTS.items():
        u, v = points[:, b] - points[:, a], points[:, c] - points[:, b]
        cosine = np.sum(u * v, axis=1) / (np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))
        out[joint] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        if not joint.startswith("thumb"):
            palmar = np.cross(u, ulnar) * (1 if right else -1)
            out[joint][np.sum(v * palmar, axis=1) < 0] = np.nan
    return out


def differences(source: Path, out: Path, start: float) -> dict[str, np.ndarray]:
    """Of each joint's flexion from the points' own bones [deg], in the frames of both hands. :param start: of the tables in the recording [s]"""
    data = np.load(source)
    found: dict[str, list[np.ndarray]] = {joint: [] for joint in JOINTS}
    for side in ("right", "left"):
        if not (out / f"{side}.mot").exists():
            continue
        names, rows = table(out / f"{side}.mot")
        values = np.array(rows, float)
        frames = np.round((values[:, 0] + start) * RATE).astype(int)
        own = own_angles(data[side][:, ORDER][frames].astype(float), side == "right")
        for joint in JOINTS:
            found[joint].append(values[:, names.index(f"{side}.{joint}.flexion")] - own[joint])
    return {joint: np.concatenate(each) for joint, each in found.items()}


def tips_of_equal_angles(source: Path, length: float) -> float:
    """What it would cost to give the hand's joints the angles of the points' own bones. :param length: of the hand, and the distance returned [mm]"""
    data = np.load(source)
    squares = []
    for side in ("right", "left"):
        points = data[side][:, ORDER].astype(float)
        points = points[np.abs(points).max(axis=(1, 2)) > 0][3:]
        palm = points[:, 9] - points[:, 0]
        palm /= np.linalg.norm(palm, axis=1, keepdims=True)
        for first, distal, *bones in BONES.values():
            own = np.diff(points[:, first:first + 4], axis=1)
            lengths = np.linalg.norm(own, axis=2, keepdims=True)
            own /= lengths
            apart = -1e-3 * length * distal * palm + sum((1e-3 * length * bone - lengths[:, i]) * own[:, i] for i, bone in enumerate(bones))
            apart -= (apart * own[:, 2]).sum(axis=1).mean() * own[:, 2]
            squares.append(np.sum(apart**2, axis=1))
    return 1e3 * float(np.sqrt(np.mean(np.concatenate(squares))))


def measure(handsim: str, source: Path, folder: Path, points: list[str], run: bool) -> dict[str, Any]:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "keypoints.json"
    file.write_text(json.dumps(recording(source)))
    out = folder / "tracked"
    done = subprocess.run([handsim, "track", str(file), "--out", str(out), *points], capture_output=True, text=True)
    (folder / "track.txt").write_text(done.stdout + done.stderr)
    row: dict[str, Any] = {"sequence": source.stem, "status": done.returncode}
    if done.returncode == 2:
        return row
    summary = json.loads((out / "summary.json").read_text())
    row["tracked"] = "/".join(str(hand["tracked"]) for hand in summary["hands"])
    for dimension in ("length", "breadth"):
        row[dimension] = round(summary["person"][f"hand_{dimension}_mm"], 1)
        row[f"{dimension}_percentile"] = round(percentile(dimension, row[dimension]), 1)
    names, rows = table(out / "frames.csv")
    seen = []
    for hand in summary["hands"]:
        begin = names.index(f"{hand['hand']}.status")
        seen += [[float(x or "nan") for x in each[begin + 2:begin + 23]] for each in rows if each[begin] == "tracked"]
    distances = np.array(seen)
    row["rms"] = round(float(np.sqrt(np.nanmean(distances**2))), 2)
    row.update({f"rms_{kind}": round(float(np.sqrt(np.nanmean(distances[:, at]**2))), 1) for kind, at in KINDS.items()})
    row["thumb"] = round(max((pair["deepest_mm"] for hand in summary["hands"] for pair in hand["overlaps"]["pairs"]
                              if ("palm" in pair["where"] or "thenar" in pair["where"])
                              and ("thumb_proximal" in pair["where"] or "thumb_distal" in pair["where"])), default=0.0), 1)
    apart = differences(source, out, summary["start_s"])
    angles = {joint: float(np.sqrt(np.nanmean(each**2))) for joint, each in apart.items()}
    worst = max(angles, key=lambda joint: angles[joint])
    row["tips"] = round(tips_of_equal_angles(source, row["length"]), 1)
    row["angle"], row["joint"] = round(angles[worst], 1), worst
    row.update({joint: round(each, 1) for joint, each in angles.items()})
    row.update({f"{joint}_mean": round(float(np.nanmean(each)), 1) for joint, each in apart.items()})
    if summary.get("hands_overlap"):
        row["overlap"], row["overlap_time"] = (round(summary["hands_overlap"][key], 2) for key in ("deepest_mm", "time_s"))
    if run and done.returncode == 0:
        scene = str(out / "scene.yaml")
        row["check"] = subprocess.run([handsim, "check", scene], capture_output=True).returncode
        for engine in ("ode", "articulated"):
            ran = subprocess.run([handsim, "run", scene, "--engine", engine, "--set", "record.contacts=true", "--quiet", "--out", str(folder / engine)], capture_output=True, text=True)
            (folder / f"{engine}.txt").write_text(ran.stdout + ran.stderr)
            row[engine] = ran.returncode
            if ran.returncode == 0:
                row[f"{engine}_replay"] = round(replay(out, folder / engine), 2)
    return row


def told(rows: list[dict[str, Any]]) -> str:
    """The figures over all sequences, against the goals."""
    rows = [row for row in rows if row["status"] != 2]
    lengths: dict[str, list[float]] = {}
    for row in rows:
        lengths.setdefault(row["sequence"].partition("_")[0], []).append(row["length"])
    out = [f"rms {min(row['rms'] for row in rows)} to {max(row['rms'] for row in rows)} mm, at most 4 in {sum(row['rms'] <= 4 for row in rows)} of {len(rows)}",
           f"thumb {min(row['thumb'] for row in rows)} to {max(row['thumb'] for row in rows)} mm, at most 3 in {sum(row['thumb'] <= 3 for row in rows)}"]
    out += [f"{key} percentile {min(row[f'{key}_percentile'] for row in rows)} to {max(row[f'{key}_percentile'] for row in rows)}" for key in ("length", "breadth")]
    out += [f"{person}: hand length {np.mean(of):.1f} mm, a sequence at most {100 * np.abs(np.array(of) / np.mean(of) - 1).max():.1f} % from it, {len(of)} sequences"
            for person, of in lengths.items()]
    out.append(f"tips of a hand with the points' own angles {np.sqrt(np.mean([row['tips']**2 for row in rows])):.1f} mm off")
    out += [f"{joint} {np.sqrt(np.mean([row[joint]**2 for row in rows])):.1f} deg, mean of sequences {np.mean([row[f'{joint}_mean'] for row in rows]):.1f}" for joint in JOINTS]
    for engine in ("check", "ode", "articulated"):
        if engine in rows[0]:
            out.append(f"{engine} of {sum(row.get(engine) == 0 for row in rows)}")
    return "\n".join(out)


def replay(tracked: Path, run: Path) -> float:
    """RMS difference of a run's angles from the tracked ones, over all axes and both hands, where nothing has touched the hand for 0.2 s [deg]."""
    names, rows = table(run / "trajectory.mot")
    values = np.array(rows, float)
    contacts = table(run / "contacts.csv")
    squares = []
    for side in ("right", "left"):
        if not (tracked / f"{side}.mot").exists():
            continue
        axes, known = table(tracked / f"{side}.mot")
        own = np.array(known, float)
        touch = np.unique([float(row[0]) for row in contacts[1] if row[1].startswith(side) or row[2].startswith(side)] or [-1.0])
        since = values[:, 0] - touch[np.clip(np.searchsorted(touch, values[:, 0], side="right") - 1, 0, None)]
        free = (since > 0.2) | (since < 0)
        # Frames that were tracked, not the gaps between them.
        near = np.abs(values[:, :1] - own[None, :, 0]).min(axis=1) < 0.5 / RATE
        for axis in axes[1:]:
            expected = np.interp(values[:, 0], own[:, 0], own[:, axes.index(axis)])
            squares.append((values[:, names.index(axis)] - expected)[free & near]**2)
    return float(np.sqrt(np.mean(np.concatenate(squares)))) if squares and sum(map(len, squares)) else 0.0


def by_posture(sources: list[Path], out: Path) -> list[str]:
    """How much of the PIPs' difference from the points' own bones a linear function of the finger's flexions explains: with coefficients of the other
    people, and with those of the sequence itself: the RMS that is left [deg]."""
    told = []
    for finger in BONES:
        found = []
        for source in sources:
            start = json.loads((out / source.stem / "tracked/summary.json").read_text())["start_s"]
            for file in (out / source.stem / "tracked").glob("*t.mot"):
                side, (names, rows) = file.stem, table(file)
                values = np.array(rows, float)
                own = own_angles(np.load(source)[side][:, ORDER][np.round((values[:, 0] + start) * RATE).astype(int)].astype(float), side == "right")[f"{finger}_pip"]
                flexions = values[:, [names.index(f"{side}.{finger}_{joint}.flexion") for joint in ("mcp", "pip", "dip")]]
                seen = np.isfinite(own)
                found.append((source.stem.partition("_")[0], np.column_stack((np.ones(seen.sum()), flexions[seen])), (own - flexions[:, 1])[seen]))
        left: dict[str, list[np.ndarray]] = {"others": [], "own": []}
        for person, known, wanted in found:
            others = [each for each in found if each[0] != person]
            for kind, of in (("others", others), ("own", [("", known, wanted)])):
                if of:
                    left[kind].append(wanted - known @ np.linalg.lstsq(np.concatenate([each[1] for each in of]), np.concatenate([each[2] for each in of]), rcond=None)[0])
        told.append(f"{finger}_pip explained by the flexions: left " + ", ".join(
            f"{np.sqrt(np.mean(np.concatenate(each)**2)):.1f} deg by {kind}" for kind, each in left.items() if each))
    return told


def convention(handsim: str, sources: list[Path], person: str, folder: Path) -> Path:
    """Fitted on the first sequence of each person but one."""
    first: dict[str, Path] = {}
    for source in sources:
        first.setdefault(source.stem.partition("_")[0], source)
    files = []
    folder.mkdir(parents=True, exist_ok=True)
    for name, source in first.items():
        if name != person:
            files.append(folder / f"{source.stem}.json")
            files[-1].write_text(json.dumps(recording(source)))
    out = folder / f"without_{person}.yaml"
    subprocess.run([handsim, "track", "--convention-from", *map(str, files), "--points", "mediapipe", "--out", str(out)], check=True, capture_output=True)
    return out


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("handsim")
    parser.add_argument("out", type=Path)
    parser.add_argument("--points")
    parser.add_argument("--others", action="store_true")
    parser.add_argument("--only", nargs="*", default=[""])
    parser.add_argument("--no-smoothing", action="store_true")
    parser.add_argument("--run", action="store_true")
    arguments = parser.parse_args()
    if "HANDSIM_RECORDINGS" not in os.environ:
        print("skipped: HANDSIM_RECORDINGS names no folder of captured sequences")
        return 0
    every = sorted(Path(os.environ["HANDSIM_RECORDINGS"]).glob("*.npz"))
    sources = [each for each in every if each.name.startswith(tuple(arguments.only))]
    rows = []
    others: dict[str, Path] = {}
    for source in sources:
        options = ["--no-smoothing"] if arguments.no_smoothing else []
        points = ["--points", arguments.points] if arguments.points else []
        if arguments.others:
            person = source.stem.partition("_")[0]
            if person not in others:
                others[person] = convention(arguments.handsim, every, person, arguments.out / "conventions")
            points = ["--points", str(others[person])]
        rows.append(measure(arguments.handsim, source, arguments.out / source.stem, [*points, *options], arguments.run))
        print(*(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(arguments.out / "captured.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    print(told(rows))
    print("\n".join(by_posture([source for source, row in zip(sources, rows) if row["status"] != 2], arguments.out)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
