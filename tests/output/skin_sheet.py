#!/usr/bin/python3
"""Draws hands with and without skin: eight persons, the poses of poses.yaml, the ten grasps.

skin_sheet.py OUT.png: the picture of docs/pictures.md. Grasps are drawn 2 s after their start, when they have closed.
"""
import sys

import numpy as np
import yaml
from PIL import Image
from skin_figures import PERSONS, ROOT, angles

import handsim as hs
from handsim._pictures import contact_sheet

SIZE = (300, 225)


def of_hand(person, q=None, view="palmar"):
    """Two pictures of a right hand: with skin, and its shapes."""
    out = []
    for look in ("skin", "shapes"):
        hand = {"model": str(hs.data_path() / "handmodels/anatomical.yaml"), "person": str(hs.data_path() / f"config/persons/{person}.yaml"),
                "side": "right", "wrist": {"mount": "fixed", "position": [0, 0, 0.2]}}
        scene = hs.load({"title": person, "hands": [hand], "duration": "1 s", "pictures": {"hands": look}})
        sim = hs.Simulation(scene)
        if q is not None:
            sim.reset(q=np.clip(q, *scene.limits.T), u=0 * q)
        out.append(scene.draw_frames([sim.frame()], size=SIZE, view=view)[0])
    return out


def of_grasp(name):
    out = []
    for look in ("skin", "shapes"):
        sim = hs.Simulation(name, {"pictures.hands": look}, contact_forces=False)
        sim.step(substeps=round(2 / sim.scene.step))
        out.append(sim.draw(size=SIZE))
    return out


def main():
    poses = yaml.safe_load((ROOT / "controllers/poses.yaml").read_text())["poses"]
    hand = hs.Hand(person="median_man")
    grasps = sorted(path.stem for path in (ROOT / "config").glob("grasp_*.yaml"))
    pairs = {**{name: of_hand(name, view="dorsal") for name in PERSONS},
             **{name: of_hand("median_man", angles(hand, poses, name), "three_quarter" if "count" in name else "radial") for name in poses},
             **{name: of_grasp(name) for name in grasps}}
    pictures = [np.hstack(pair) for pair in pairs.values()]
    sheet = contact_sheet(pictures, [name.replace("_", " ") for name in pairs], "hands in their skin, and their shapes", 1200)
    # Of 256 colours, dithered: a third of the bytes, and no eye sees it.
    picture = Image.fromarray(sheet)
    palette = picture.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=3)
    picture.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG).save(sys.argv[1], optimize=True)


if __name__ == "__main__":
    main()
