#!/usr/bin/python3
"""Measures the skin of hands: size and volume, how far it passes through itself in poses, and times.

skin_figures.py OUT.json: the table of docs/pictures.md (./dev docs skin). Length, breadth and girth at the knuckles are compared with
the shapes', which have the person's; of 8 shipped persons and 100 drawn ones. Passing through itself: a point of the skin is inside another
part where the winding number just outside of it is 1; its depth is the distance to the nearest triangle of another body, less the depth
of the two bodies' own shapes in each other. Bodies that a joint connects overlap by design and are left out.
"""
import json
import sys
import time
from pathlib import Path

import numpy as np
import yaml

import handsim as hs
from handsim._model import compose, turned

ROOT = Path(__file__).parents[2]
PERSONS = ["child", "giant", "large_man", "large_woman", "median_man", "median_woman", "small_man", "small_woman"]
DENSITY = 1148  # of a hand [kg/m^3]
ANGLES = np.linspace(0, 2 * np.pi, 90, endpoint=False)


def poses_of(hand, q):
    poses = hand.poses(q)
    return np.concatenate([poses.position, poses.quaternion], axis=1)


def capsules(hand, poses):
    """Ends and radius of each shape of the hand, with its row among the bodies."""
    out = []
    for shape in hand._model.shapes:
        if shape.kind == "capsule" and shape.body in hand._model.hands[0].bodies:
            row = hand._model.hands[0].bodies.index(shape.body)
            x = compose(poses[row], shape.pose)
            along = turned(x[3:], [0, 0, shape.length / 2])
            out.append((x[:3] - along, x[:3] + along, shape.radius, row, shape.part))
    return out


def sizes(hand):
    """Differences of length, breadth and girth from the shapes' [m], and mass of the skin's volume over the hand's."""
    q = np.zeros(len(hand.coordinates))
    mesh, shapes = hand.mesh(q), capsules(hand, poses_of(hand, q))
    centre = dict(zip(hand.joints["name"], hand.joints["centre"]))
    index, little = centre["index_mcp.flexion"], centre["little_mcp.flexion"]
    line = little - index
    turn = -np.arctan2(line[1], line[0])
    matrix = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    y = (matrix @ index)[1]
    points = mesh.vertices @ matrix.T
    owner = np.array(hand.bodies)[np.argmax(mesh.weights, axis=1)]
    faces = mesh.faces[~np.array([owner[face[0]].startswith("thumb") for face in mesh.faces])].astype(int)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    cut = (a[:, 1] < y) != (b[:, 1] < y)
    section = (a + ((y - a[:, 1]) / (b[:, 1] - a[:, 1] + 1e-30))[:, None] * (b - a))[cut][:, [0, 2]]
    directions = np.stack([np.cos(ANGLES), np.sin(ANGLES)])
    of_skin, of_shapes = (section @ directions).max(axis=0), np.full(len(ANGLES), -1.0)
    for first, second, radius, _, part in shapes:
        if part != "thumb":
            middle = (first + np.linspace(0, 1, 101)[:, None] * (second - first)) @ matrix.T
            room = radius**2 - (y - middle[:, 1])**2
            near = middle[room > 0][:, [0, 2]] @ directions + np.sqrt(room[room > 0])[:, None]
            of_shapes = np.maximum(of_shapes, near.max(axis=0, initial=-1))
    a, b, c = (np.clip(mesh.vertices, [-1, 0, -1], 1)[mesh.faces[:, k].astype(int)] for k in range(3))
    girth = lambda support: support.sum() * 2 * np.pi / len(ANGLES)
    return [mesh.vertices[:, 1].max() - max(max(first[1], second[1]) + radius for first, second, radius, _, _ in shapes),
            of_skin[0] + of_skin[45] - of_shapes[0] - of_shapes[45], girth(of_skin) - girth(of_shapes),
            DENSITY * np.sum(np.cross(a, b) * c) / 6 / hand.dimensions["mass"] - 1]


def winding(points, a, b, c):
    """Of the closed surface about each point (van Oosterom and Strackee 1983)."""
    out = np.zeros(len(points))
    for i, point in enumerate(points):
        x, y, z = a - point, b - point, c - point
        lx, ly, lz = (np.sqrt(np.einsum("ij,ij->i", v, v)) for v in (x, y, z))
        dot = lambda u, v: np.einsum("ij,ij->i", u, v)
        over = lx * ly * lz + dot(x, y) * lz + dot(y, z) * lx + dot(z, x) * ly
        out[i] = np.sum(np.arctan2(dot(x, np.cross(y, z)), over)) / (2 * np.pi)
    return out


def to_segments(first, second, third, fourth):
    """Least distance of two segments, by samples of both."""
    a, b = (p + np.linspace(0, 1, 60)[:, None] * (q - p) for p, q in ((first, second), (third, fourth)))
    return np.sqrt(((a[:, None] - b[None])**2).sum(axis=2).min())


def to_triangles(point, a, b, c):
    """Least distance to triangles, by 28 points of each."""
    weights = np.array([[i, k, 6 - i - k] for i in range(7) for k in range(7 - i)]) / 6
    samples = np.einsum("wk,kij->wij", weights, np.stack([a, b, c]))
    return np.sqrt(((samples - point)**2).sum(axis=2).min())


def passes(hand, q):
    """The depth beyond the shapes' own [m], and the two bodies."""
    mesh, poses = hand.mesh(q), poses_of(hand, q)
    shapes = capsules(hand, poses)
    owner = np.argmax(mesh.weights, axis=1)
    a, b, c = (mesh.vertices[mesh.faces[:, k].astype(int)] for k in range(3))
    face_owner = owner[mesh.faces[:, 0].astype(int)]
    normals = np.zeros_like(mesh.vertices)
    for k in range(3):
        np.add.at(normals, mesh.faces[:, k].astype(int), np.cross(b - a, c - a))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    parent = hand.segments["parent"]
    joined = lambda i, k: i == k or parent[i] == k or parent[k] == i
    # Only points that are near the shapes of another body.
    near = np.zeros(len(owner), bool)
    for first, second, radius, row, _ in shapes:
        along = second - first
        share = np.clip((mesh.vertices - first) @ along / (along @ along), 0, 1)
        gap = np.linalg.norm(mesh.vertices - first - share[:, None] * along, axis=1) - radius
        near |= (gap < 0.003) & np.array([not joined(i, row) for i in range(len(hand.bodies))])[owner]
    worst = (0.0, "", "")
    candidates = np.nonzero(near)[0]
    inside = winding(mesh.vertices[candidates] + 3e-4 * normals[candidates], a, b, c) > 0.5
    own = {}
    for i in candidates[inside]:
        others = [k for k in range(len(hand.bodies)) if not joined(owner[i], k)]
        within = np.isin(face_owner, others) & (np.linalg.norm(a - mesh.vertices[i], axis=1) < 0.02)
        if not within.any():
            continue
        nearest = np.argmin(np.linalg.norm((a + b + c)[within] / 3 - mesh.vertices[i], axis=1))
        pair = (owner[i], face_owner[within][nearest])
        if pair not in own:
            own[pair] = max((r + s - to_segments(p, q, u, v) for p, q, r, m, _ in shapes for u, v, s, n, _ in shapes if (m, n) == pair), default=0)
        depth = to_triangles(mesh.vertices[i], a[within], b[within], c[within]) - max(own[pair], 0)
        worst = max(worst, (depth, hand.bodies[pair[0]], hand.bodies[pair[1]]))
    return worst


def angles(hand, poses, name):
    q, pose = dict.fromkeys(hand.coordinates, 0.0), {}
    while name:
        pose = {**poses[name], **pose}
        name = pose.pop("like", None)
    for joint, value in pose.items():
        for axis, degrees in zip(("flexion", "abduction"), value if isinstance(value, list) else [value]):
            q[f"{joint}.{axis}"] = np.radians(degrees)
    return np.array([q[name] for name in hand.coordinates])


def times():
    """CPU time to make a skin, least of 12 persons, and of a frame over one of the shapes [s]."""
    made = []
    for person in hs.draw_persons(12, seed=7):
        hand = hs.Hand(**person)
        begin = time.process_time()
        hs._core.skins(hand.scene._core)
        made.append(time.process_time() - begin)
    frame = {}
    for look in ("shapes", "skin"):
        scene = hs.load("every_pose", {"pictures.hands": look, "pictures.size": [640, 480]})
        frames = [hs.Simulation(scene).frame()]
        took = {}
        for count in (2, 22) * 3:
            begin = time.process_time()
            scene.draw_frames(frames * count)
            took[count] = min(took.get(count, 9e9), time.process_time() - begin)
        frame[look] = (took[22] - took[2]) / 20
    return min(made), frame


def main():
    figures = {"persons": {name: sizes(hs.Hand(person=name)) for name in PERSONS},
               "drawn": [sizes(hs.Hand(**person)) for person in hs.draw_persons(100, seed=1)]}
    hand = hs.Hand(person="median_man")
    poses = yaml.safe_load((ROOT / "controllers/poses.yaml").read_text())["poses"]
    figures["poses"] = {name: passes(hand, angles(hand, poses, name)) for name in poses}
    figures["triangles"] = len(hand.mesh().faces)
    figures["make_s"], figures["frame_s"] = times()
    Path(sys.argv[1]).write_text(json.dumps(figures, indent=1, default=float))
    for name, (depth, one, other) in figures["poses"].items():
        print(f"{name}: {1e3 * depth:.1f} mm {one} {other}")
    for name in ("persons", "drawn"):
        rows = np.array(list(figures[name].values()) if name == "persons" else figures[name])
        print(name, "length, breadth, girth at most", *(f"{1e3 * x:.2f} mm" for x in np.abs(rows[:, :3]).max(axis=0)),
              f"mass {100 * rows[:, 3].min():.1f} to {100 * rows[:, 3].max():.1f} %")
    print(f"made in {1e3 * figures['make_s']:.0f} ms, frame", {key: f"{1e3 * value:.1f} ms" for key, value in figures["frame_s"].items()})


if __name__ == "__main__":
    main()
