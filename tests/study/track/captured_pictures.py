#!/usr/bin/env python3
"""Pictures of tracked hands of captured sequences beside the points that were tracked: eight frames of each on a sheet.

usage: captured_pictures.py OUT [SEQUENCE...]

OUT is the folder that captured.py has written. The points are balls of 4 mm: red those of the right hand, blue those of the left one. Writes OUT/SEQUENCE.png.
The sequences are no part of the project, and no picture of them is.
"""
from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import handsim as hs
import numpy as np
from captured import table
from handsim._shipped import data_path

FRAMES = 8
INKS = {"right": "#c82020", "left": "#2050d0"}


def rotation(q: np.ndarray) -> dict[str, Any]:
    angle = 2 * np.arccos(np.clip(q[0], -1, 1))
    return {"axis": (q[1:] / max(np.linalg.norm(q[1:]), 1e-12)).tolist(), "angle": float(angle)} if angle > 1e-9 else {"axis": [0, 0, 1], "angle": 0.0}


def scene_of(out: Path, points: dict[str, np.ndarray], k: int, start: float, rate: float) -> tuple[dict[str, Any], np.ndarray]:
    """Of a frame: hands in their poses, and their points."""
    hands, objects, places = [], [], []
    for side in ("right", "left"):
        axes, rows = table(out / f"{side}.mot")
        _, wrists = table(out / f"{side}_wrist.csv")
        angles, poses = np.array(rows, float), np.array(wrists, float)
        at = int(np.argmin(np.abs(angles[:, 0] + start - k / rate)))
        if abs(angles[at, 0] + start - k / rate) > 0.5 / rate:
            continue
        pose: dict[str, list[float]] = {}
        for axis, angle in zip(axes[1:], np.radians(angles[at, 1:])):
            pose.setdefault(axis.split(".")[1], []).append(float(angle))
        hands.append({"model": str(data_path() / "handmodels/anatomical.yaml"), "person": str(out / "person.yaml"), "side": side, "pose": pose,
                      "wrist": {"mount": "fixed", "position": poses[at, 1:4].tolist(), "rotation": rotation(poses[at, 4:])}})
        for i, place in enumerate(points[side][k]):
            objects.append({"name": f"{side}_{i}", "shape": "sphere", "radius": 0.004, "static": True, "position": place.tolist(), "color": INKS[side]})
            places.append(place)
    return ({"title": "points", "hands": hands, "objects": objects, "effects": ["gravity", "joint_stops", "passive_tissue"], "duration": "10 ms",
             "solver": {"engine": "ode", "method": "world_step", "step": "1 ms"}, "pictures": {"hands": "both", "floor": False}}, np.array(places))


def main() -> None:
    folder, names = Path(sys.argv[1]), sys.argv[2:] or ["s1_box_grab_01", "s2_ketchup_use_01", "s4_mixer_grab_01", "s5_phone_grab_01"]
    for name in names:
        recording = json.loads((folder / name / "keypoints.json").read_text())
        points = {side: np.array([next(hand["points"] for hand in frame["hands"] if hand["side"] == side) for frame in recording["frames"]], float)
                  for side in ("right", "left")}
        out = folder / name / "tracked"
        start = json.loads((out / "summary.json").read_text())["start_s"]
        seen = [k for k in range(len(points["right"])) if all(points[side][k].any() for side in points)]
        pictures = []
        for k in np.array(seen)[np.linspace(0, len(seen) - 1, FRAMES + 2).astype(int)[1:-1]]:
            scene, places = scene_of(out, points, int(k), start, recording["rate"])
            middle = places.mean(axis=0)
            away = max(0.35, 2.2 * float(np.linalg.norm(places - middle, axis=1).max()))
            camera = (middle + away * np.array([0.25, -0.75, 0.6]), middle, 0.6)
            pictures.append((f"{k / recording['rate']:.2f} s", hs.load(scene).draw(size=(640, 480), camera=camera)))
        hs.save_png(hs.contact_sheet([each for _, each in pictures], [each for each, _ in pictures], name, 2560), folder / f"{name}.png")
        print(folder / f"{name}.png", flush=True)


if __name__ == "__main__":
    main()
