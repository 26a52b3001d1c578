#!/usr/bin/env python3
"""Fits the forces of handmodels/muscles.yaml together: of finger flexors and extensors, interossei, lumbricals, the thumb and the wrist.

    PYTHONPATH=build/release/python python3 tests/hand/fit_forces.py [--fit]

prints what people have beside the hand of today, and with --fit beside the least-squares fit, and the factors on the forces. Targets are
grips by the span of a dynamometer, the posture of the wrist and a blocked ulnar nerve, shares of the fingers, forces of fingertips,
of single fingers that press, of the thumb and of pinches, and moments of the wrist while the fingers are free. Each is a linear program:
activations of 0 to 1, moments of the joints balance, those of the wrist too (python/handsim/_statics.py). Contacts of a
grip are those of a simulation that closes the fingers on the bar; there only normal forces count, and fingers have no common drive: the grips
of `handsim validate` have both since, so that this fit is of an older rule.
Priors are 0.3 of the logarithm for finger flexors and 0.4 to 0.6 for others. The shipped forces are the fit of 2026-11-27 from the forces of before, with friction at the bar, and then: finger flexors, wrist extensors and EDC3 to
EDM times 1.3, with which the simulated grip (`grip_force` of handsim validate) is the norm's; FDP2 at half and FDS2 at 200 N; ECRB and
ECRL in the ratio of their areas; DI1 140 N, PI1 as before, other interossei times 1.04. With the ligaments of the MCPs and `spill` all but
the extensors of the fingers are the fit of 2026-11-28 from there."""
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares, linprog

import handsim as hs
from handsim._statics import Statics
from handsim.compare import _alone

ROOT = Path(__file__).parents[2]
FINGERS = ("index", "middle", "ring", "little")
TILT, HEEL, PALM, FRICTION = np.radians(55), 0.045, 0.0165, 0.6
HAND = _alone(hs.load(str(ROOT / "config/muscle_poses.yaml"), {"hands.0.wrist.mount": "universal", "hands.0.without": {"spill": 0}}), "median_man")
STATICS = Statics(HAND)
NAMES, MUSCLES = list(STATICS.names), list(HAND.muscles)
AWAY = np.array([0, np.sin(TILT), -np.cos(TILT)])


def turned(quaternion):
    w, x, y, z = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def rows(*starts):
    return [i for i, name in enumerate(NAMES) if name.startswith(starts)]


def posture(angles, wrist):
    q = np.zeros(len(NAMES))
    for name, angle in {**angles, "wrist.flexion": wrist[0], "wrist.deviation": wrist[1]}.items():
        q[NAMES.index(name)] = np.radians(angle)
    return q


class Program:
    """The largest sum of gains. columns: torques of a newton of each force; across: held by the palm's friction."""

    def __init__(self, q, columns, gains, balanced, across=None, owners=None):
        self.muscles, self.rest = STATICS.moments(q)
        self.columns, self.gains, self.rows, self.across, self.owners = np.array(columns).T, np.array(gains, dtype=float), balanced, across, owners
        low, high = (np.abs(q - np.asarray(stops)) < 1e-6 for stops in (STATICS.low, STATICS.high))
        gives = {i: STATICS._gives(q, i) for i in balanced}
        self.held = [(None if high[i] else gives[i][0], None if low[i] else gives[i][1]) for i in balanced]

    def solve(self, factors):
        forces, muscles, held = self.columns.shape[1], len(MUSCLES), len(self.rows)
        zero = np.zeros(muscles + held)
        equal = np.hstack([self.columns[self.rows], -(self.muscles * factors)[self.rows], -np.eye(held)])
        walls = np.array([np.r_[np.zeros(forces), spill, np.zeros(held)] for spill in STATICS.spills] +
                         ([] if self.across is None else [np.r_[sign * self.across - FRICTION * self.gains, zero] for sign in (1, -1)]))
        found = linprog(-np.r_[self.gains, zero], A_eq=equal, b_eq=self.rest[self.rows], A_ub=walls, b_ub=np.zeros(len(walls)),
                        bounds=[(0, None)] * forces + [(0, 1)] * muscles + self.held, method="highs")
        return (0.0, np.zeros(muscles), {}) if found.x is None else (
            -found.fun, found.x[forces:forces + muscles],
            {f: sum(g * x for g, x, o in zip(self.gains, found.x, self.owners) if o == f) for f in FINGERS} if self.owners else {})


def edges(q, body, point, normal, friction):
    """Torques of the edges of a cone of friction, each of a newton along the normal [body's frame], and the forces [H]."""
    R = turned(HAND.poses(q).quaternion[list(HAND.bodies).index(body)])
    n = R @ normal
    first = np.cross(n, [1, 0, 0] if abs(n[0]) < 0.7 else [0, 1, 0])
    first /= np.linalg.norm(first)
    out = []
    for turn in 2 * np.pi * np.arange(8 if friction else 1) / 8:
        force = n + friction * (np.cos(turn) * first + np.sin(turn) * np.cross(n, first))
        torque = HAND.jacobian(q, (body, point))[:3].T @ force
        torque[rows("wrist")] = 0
        out.append((torque, force))
    return out


def touches(span):
    """Where the fingers touch the bar: body, point and normal in its frame; and the coordinates."""
    bar = np.array([0, HEEL, -PALM]) + (span - 0.010) * AWAY
    simulation = hs.Simulation(hs.load(str(ROOT / "config/muscle_grip.yaml"), {"objects.0.position": [float(x) for x in bar]}))
    simulation.step(substeps=2000)
    q = np.zeros(len(NAMES))
    for name, angle in zip(simulation.scene.coordinates, simulation.q):
        if name.removeprefix("right.") in NAMES:
            q[NAMES.index(name.removeprefix("right."))] = angle
    poses, out = HAND.poses(q), []
    for a, b, point, normal in zip(simulation.contacts.a, simulation.contacts.b, simulation.contacts.position, simulation.contacts.normal):
        a, normal = (b, -normal) if a == "handle" else (a, normal)
        body = a.split(".")[1]
        if body.startswith(FINGERS):
            i = list(HAND.bodies).index(body)
            R = turned(poses.quaternion[i])
            out.append((body, R.T @ (point - poses.position[i]), R.T @ normal))
    return out, q


def grip(where, wrist):
    found, q = where
    q = q.copy()
    q[rows("wrist")] = np.radians(wrist)
    palm = turned(HAND.poses(q).quaternion[0])
    columns, gains, across, owners = [], [], [], []
    for body, point, normal in found:
        for torque, force in edges(q, body, point, normal, 0):
            columns.append(-torque)
            gains.append(force @ palm @ AWAY)
            across.append(force @ palm @ np.cross([1, 0, 0], AWAY))
            owners.append(body.split("_")[0])
    return Program(q, columns, gains, rows(*FINGERS, "wrist"), np.array(across), owners)


def tip(finger, direction, angles, friction=0, segment=None):
    q = posture(angles, (-20, 0))
    row = HAND.tips.row(HAND.tips["name"].index(finger + "_tip"))
    body, point = (segment, np.zeros(3)) if segment else (row["body"], np.asarray(row["position"]))
    along = {"palmar": (0, 0, -1), "dorsal": (0, 0, 1), "distal": (0, 1, 0), "ulnar": (1, 0, 0), "radial": (-1, 0, 0)}[direction]
    forces = edges(q, body, point, np.array(along, dtype=float), friction)
    return Program(q, [torque for torque, _ in forces], [1.0] * len(forces), rows(finger, "wrist"))


def pinch(angles):
    q = posture(angles, (-20, 0))
    ends = [STATICS.round_end(finger) for finger in ("thumb", "index")]
    places = [HAND.position(q, end) for end in ends]
    normal = (places[1] - places[0]) / np.linalg.norm(places[1] - places[0])
    meet = 0.5 * sum(place + side * STATICS.radius(body) * normal for place, (body, _), side in zip(places, ends, (1, -1)))
    sides = [edges(q, body, STATICS.within_body(q, body, meet), turned(HAND.poses(q).quaternion[list(HAND.bodies).index(body)]).T @ normal, 0.6)
             for body, _ in ends]
    return Program(q, [a[0] - b[0] for a, b in zip(*sides)], [1.0] * 8, rows("thumb", "index", "wrist"))


def moment(axis, sign):
    q = posture({f"{f}_{joint}.flexion": angle for f in FINGERS for joint, angle in (("mcp", 45), ("pip", 40), ("dip", 20))}, (0, 0))
    q[[NAMES.index("thumb_mcp.flexion"), NAMES.index("thumb_ip.flexion")]] = np.radians(20)
    torque = np.zeros(len(NAMES))
    torque[NAMES.index(axis)] = sign
    return Program(q, [torque], [1.0], rows("wrist", "thumb", *FINGERS))


INDEX = {"index_mcp.flexion": 45, "index_pip.flexion": 45, "index_dip.flexion": 10}
PINCH = {"thumb_cmc.flexion": 11, "thumb_cmc.abduction": -1, "thumb_mcp.flexion": 20, "thumb_ip.flexion": 25, "index_mcp.flexion": 54,
         "index_pip.flexion": 47, "index_dip.flexion": 27}
KEY, THUMB = {"thumb_mcp.flexion": 20, "thumb_ip.flexion": 20}, {"thumb_mcp.flexion": 15, "thumb_ip.flexion": -15}
SPANS = {span: touches(span / 1000) for span in (35, 43.5, 48, 52.5, 60, 73, 86)}
PROGRAMS = {**{f"grip, {span} mm": grip(where, (-35, -7)) for span, where in SPANS.items()},
            **{f"grip, wrist {flexion}": grip(SPANS[48], (flexion, deviation)) for flexion, deviation in ((-15, -7), (0, 0), (20, 0), (30, 0), (60, 0))},
            **{f"index, {way}": tip("index", way, INDEX) for way in ("palmar", "dorsal", "ulnar", "radial", "distal")},
            **{f"{f} presses": tip(f, "palmar", {f"{f}_mcp.flexion": 20, f"{f}_pip.flexion": 30, f"{f}_dip.flexion": 15}) for f in FINGERS},
            "tip pinch": pinch(PINCH), "key pinch": tip("thumb", "palmar", KEY, 0.6, "thumb_distal"),
            **{f"thumb, {way}": tip("thumb", way, THUMB, 0, "thumb_proximal") for way in ("palmar", "dorsal", "radial", "ulnar")},
            "wrist flexion": moment("wrist.flexion", 1), "wrist extension": moment("wrist.flexion", -1),
            "wrist radial": moment("wrist.deviation", 1), "wrist ulnar": moment("wrist.deviation", -1)}
ULNAR = "ADP LU4 LU5 DI1 PI1 DI2 DI3 PI2 DI4 PI3 ADM FDM".split()
PEOPLE = {"grip, 48 mm": (525, 20), "grip, 60 mm": (500, 60), "index, palmar": (27.9, 4.1), "index, dorsal": (7.5, 1.5), "index, ulnar": (22.9, 7.8),
          "index, radial": (14.7, 5), "index, distal": (24, 8), "index presses": (40, 12), "middle presses": (30, 9), "ring presses": (26, 7.8),
          "little presses": (17, 5.1), "tip pinch": (77, 17), "key pinch": (108, 24), "thumb, palmar": (104, 13.7),
          "thumb, dorsal": (69.4, 9.2), "thumb, radial": (57.7, 7.6), "thumb, ulnar": (67.4, 8.9), "wrist flexion": (12.2, 3.7),
          "wrist extension": (7.1, 2.1), "wrist radial": (11, 2), "wrist ulnar": (9.5, 2.2), "15 over 35 deg extended": (0.71, 0.05),
          "20 deg flexed over neutral": (0.675, 0.1), "30 deg flexed": (0.66, 0.1), "60 deg flexed": (0.44, 0.1), "ulnar block": (0.73, 0.1),
          "share, index": (0.286, 0.04), "share, middle": (0.338, 0.043), "share, ring": (0.243, 0.045), "share, little": (0.129, 0.049)}
GROUPS = [[m] for m in MUSCLES if not m.startswith(("LU", "DI2", "DI3", "DI4", "PI2", "PI3", "ADM", "FDM"))] + [
    ["LU2", "LU3", "LU4", "LU5"], ["DI2", "DI3", "DI4", "PI2", "PI3"], ["ADM", "FDM"]]
PRIOR = [0.3 if g[0].startswith(("FDP", "FDS")) else 0.4 if g[0] in ("FPL", "EPL", "EPB", "APL", "APB", "FPB", "OP", "ADP") else 0.6 for g in GROUPS]


def factors_of(x):
    out = np.ones(len(MUSCLES))
    for group, log in zip(GROUPS, x):
        out[[MUSCLES.index(m) for m in group]] = np.exp(log)
    return out


def values(factors):
    out = {name: program.solve(factors)[0] for name, program in PROGRAMS.items()}
    whole, _, fingers = PROGRAMS["grip, 48 mm"].solve(factors)
    neutral = max(out["grip, wrist 0"], 1)
    out["15 over 35 deg extended"] = out["grip, wrist -15"] / max(whole, 1)
    for angle, name in ((20, "20 deg flexed over neutral"), (30, "30 deg flexed"), (60, "60 deg flexed")):
        out[name] = out[f"grip, wrist {angle}"] / neutral
    out["ulnar block"] = PROGRAMS["grip, 48 mm"].solve(factors * [m not in ULNAR for m in MUSCLES])[0] / max(whole, 1)
    return {**out, **{f"share, {f}": force / max(whole, 1) for f, force in fingers.items()}}


def main():
    before, after, x = values(np.ones(len(MUSCLES))), {}, np.zeros(len(GROUPS))
    if "--fit" in sys.argv:
        def residual(x):
            found = values(factors_of(x))
            return np.r_[[(found[name] - value) / spread for name, (value, spread) in PEOPLE.items()], x / PRIOR]

        x = least_squares(residual, x, diff_step=0.02, max_nfev=12).x
        after = values(factors_of(x))
    print(f"{'':28} {'before':>8} {'after':>8}   people")
    for name, value in before.items():
        people = " +- ".join(f"{each:g}" for each in PEOPLE.get(name, ()))
        print(f"{name:28} {value:8.3g} {after.get(name, float('nan')):8.3g}   {people}")
    if after:
        print("factors:", ", ".join(f"{'/'.join(group)} {np.exp(log):.2f}" for group, log in zip(GROUPS, x)))


if __name__ == "__main__":
    main()
