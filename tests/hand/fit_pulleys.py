#!/usr/bin/env python3
"""What the flexors' paths gain where a pulley is torn: the rows `pulleys` of handmodels/muscles.yaml, on standard output.

Beyond the MCP a tendon is straight lines in the plane of flexion, from each edge of a pulley to the next; between bones it
leaves the bone (bowstring). Pulleys hold it as far from the bone's axis as its arm is at the next joint at 0 deg, in proportion
between two joints. A3 and A5 hang on the palmar plates, which give way: they are no guides. About the MCP, where A1 and the
palmar plate are as long as the tendon's turn, the arm is constant while A1 holds. Without a pulley the line runs from the edge
before it to the edge behind it. What the tendon is then shorter, over the range of the joints that the line crosses, is fitted by
least squares with the terms of a path: an arm's polynomial for each joint, and products of two angles. A joint that is bent
backwards holds the tendon itself: nothing is gained there.

python3 tests/hand/fit_pulleys.py
"""
import itertools
import pathlib
import re

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
HAND = 0.178  # the hand of muscles.yaml [m]
FINGERS = {"index": (2, (0.245, 0.143)), "middle": (3, (0.266, 0.170)), "ring": (4, (0.244, 0.165)),
           "little": (5, (0.204, 0.117))}  # Buchholz 1992: proximal and middle phalanx over hand length
RANGES = {"mcp": (-45, 90), "pip": (0, 100), "dip": (0, 80)}  # anatomical.yaml [deg]
# Edges that guide the tendon: bone (0: proximal phalanx; the palm is below 0) and share of its length. 8, 17 and 6.7 mm wide.
EDGES = {"palm": [(0, -0.35)], "A1": [(0, 0.06)], "A2": [(0, 0.12), (0, 0.52)], "A4": [(1, 0.35), (1, 0.60)]}
ENDS = {"FDP": (2, 0.1), "FDS": (1, 0.25)}  # where they reach bone; of the distal phalanx as a share of the middle one's length
# Torn: what is left before and behind, and the joints that the new line crosses.
TORN = {"A2": (("A2",), ("pip",), ("FDP", "FDS")), "A4": (("A4",), ("pip", "dip"), ("FDP",)),
        "A1_A2": (("A1", "A2"), ("mcp", "pip"), ("FDP", "FDS"))}
TERMS = 5


def arms_at_zero(muscle):
    """Of the MCP, PIP and (FDP) DIP [m]."""
    row = re.search(rf"name: {muscle}, .*\n.*", (ROOT / "handmodels/muscles.yaml").read_text()).group(0)
    return [float(each) for each in re.findall(r"_(?:mcp|pip|dip)\.flexion: \[([-\d.e]+)", row)]


def guides(muscle, finger, torn=()):
    """Places along the straight finger from the MCP, and heights [m]; from A1 on while it holds."""
    proximal, middle = (HAND * each for each in FINGERS[finger][1])
    starts = [0, proximal, proximal + middle]
    arms = arms_at_zero(muscle)
    end = ENDS[muscle[:3]]
    left = {name: both for name, both in EDGES.items() if name not in torn and (name != "palm" or "A1" in torn)}
    edges = [edge for both in left.values() for edge in both if edge < end]
    places = [starts[bone] + share * (proximal if bone == 0 else middle) for bone, share in [*edges, end]]
    return [(x, float(np.interp(x, starts[:len(arms)], arms))) for x in places]


def length(path, finger, angles):
    """Of the lines at angles of MCP, PIP and DIP [m]."""
    proximal, middle = (HAND * each for each in FINGERS[finger][1])
    points = []
    for x, height in path:
        origin, turned, before = np.zeros(2), 0.0, 0.0
        for start, angle in zip((0, proximal, proximal + middle), angles):
            if x >= start:
                origin = origin + (start - before) * np.array([np.cos(turned), np.sin(turned)])
                before, turned = start, turned - angle
        bone = np.array([np.cos(turned), np.sin(turned)])
        points.append(origin + (x - before) * bone + height * np.array([bone[1], -bone[0]]))
    return float(sum(np.linalg.norm(b - a) for a, b in zip(points, points[1:])))


def gained(muscle, finger, torn, angles):
    """Excursion that the torn pulleys add between straight joints and these angles of MCP, PIP and DIP [m]."""
    def excursion(path, q, wraps):
        return (arms_at_zero(muscle)[0] * q[0] if wraps else 0) - length(path, finger, q) + length(path, finger, np.zeros(3))

    bent = np.maximum(angles, 0)
    return (excursion(guides(muscle, finger, torn), bent, "A1" not in torn) -
            excursion(guides(muscle, finger), bent, True))


def terms(q):
    pairs = [(a, b) for a in range(len(q)) for b in range(a)]
    return ([q[j] ** k / k for j in range(len(q)) for k in range(1, TERMS + 1)] +
            [q[a] ** n * q[b] ** m for a, b in pairs for n in (1, 2) for m in (1, 2)])


def fit(muscle, finger, name):
    """Coefficients of `terms` of the joints that the line crosses, and the largest error over the grid [m]."""
    torn, joints, _ = TORN[name]
    grid = np.array(list(itertools.product(*(np.radians(np.linspace(*RANGES[j], 15)) for j in joints))))
    where = [list(RANGES).index(j) for j in joints]
    wanted = np.zeros(len(grid))
    for i, q in enumerate(grid):
        angles = np.zeros(3)
        angles[where] = q
        wanted[i] = gained(muscle, finger, torn, angles)
    A = np.array([terms(q) for q in grid])
    found = np.linalg.lstsq(A, wanted, rcond=None)[0]
    return found, float(np.abs(A @ found - wanted).max())


def main():
    worst = 0.0
    print("pulleys:")
    for name, (_, joints, kinds) in TORN.items():
        for finger, (number, _) in FINGERS.items():
            for kind in kinds:
                found, error = fit(f"{kind}{number}", finger, name)
                worst = max(worst, error)
                axes = [f"{finger}_{j}.flexion" for j in joints]
                rounded = [round(float(c), 6) + 0.0 for c in found]
                arms = ", ".join(f"{axis}: {rounded[TERMS * i:TERMS * (i + 1)]}" for i, axis in enumerate(axes))
                products = "" if len(axes) < 2 else ", products: [" + ", ".join(
                    f"{{axes: [{axes[1]}, {axes[0]}], power_a: {n}, power_b: {m}, factor: {rounded[2 * TERMS + i]}}}"
                    for i, (n, m) in enumerate(itertools.product((1, 2), (1, 2)))) + "]"
                print(f"  - {{name: {name}, finger: {finger}, tendon: {kind}{number}, arms: {{{arms}}}{products}}}")
    print(f"# largest error of a fit: {1e3 * worst:.2f} mm")


if __name__ == "__main__":
    main()
