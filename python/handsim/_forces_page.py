"""One HTML page of forces on an object: hands, object and arrows that can be turned, curves with bands, figures. It needs nothing beside itself."""
from __future__ import annotations

import html
import json
import math
from typing import Any, NamedTuple, Sequence

import numpy as np
from numpy.typing import NDArray

from ._forces import STATES, Result
from ._forces_files import Figures, margin, strength_text
from ._forces_frames import Asked, Solver
from ._objects import Link, Thing, hull_faces

Array = NDArray[np.float64]
MOST = 300
"""Frames in the page; a longer recording has every second, third, ..."""
SHARP = 0.8
"""Cosine between two faces below which their edge is drawn."""
DOTS = 400
"""Points of a link's surface that are drawn."""
INKS = ("#1b6ca8", "#c8553d", "#3a7d44", "#8a5a9e", "#b5834f", "#4a4a4a")
PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>TITLE</title>
<style>
body { font: 14px/1.45 "DejaVu Sans", sans-serif; margin: 1.2em auto; max-width: 1100px; color: #222 }
canvas { border: 1px solid #ccc; width: 100%; display: block }
table { border-collapse: collapse; margin: .6em 0 }
td, th { padding: .15em .8em; text-align: right; border-bottom: 1px solid #ddd }
td:first-child, th:first-child { text-align: left }
input { width: 100% }
.note { color: #555 }
</style>
<h1>TITLE</h1>
<p class="note">NOTE</p>
<canvas id="view" width="1100" height="460"></canvas>
<input id="frame" type="range" min="0" value="0" aria-label="frame">
<p id="now"></p>
<canvas id="curves" width="1100" height="560"></canvas>
FIGURES
<script>
const data = DATA;
const view = document.getElementById('view'), curves = document.getElementById('curves');
const slider = document.getElementById('frame'), now = document.getElementById('now');
const pixels = 1900;  // for each metre
let turn = 0.6, tilt = 0.35, grab = null;

// A point of a link's frame in the world.
function moved([x, y, z, w, a, b, c], p) {
  const t = [2 * (b * p[2] - c * p[1]), 2 * (c * p[0] - a * p[2]), 2 * (a * p[1] - b * p[0])];
  return [x + p[0] + w * t[0] + b * t[2] - c * t[1],
          y + p[1] + w * t[1] + c * t[0] - a * t[2],
          z + p[2] + w * t[2] + a * t[1] - b * t[0]];
}

function place(p, centre) {
  const [x, y, z] = p.map((value, i) => value - centre[i]);
  const across = x * Math.cos(turn) + y * Math.sin(turn), away = -x * Math.sin(turn) + y * Math.cos(turn);
  return [view.width / 2 + pixels * across, view.height / 2 - pixels * (z * Math.cos(tilt) + away * Math.sin(tilt))];
}

function line(g, a, b) {
  g.beginPath();
  g.moveTo(...a);
  g.lineTo(...b);
  g.stroke();
}

function arrow(g, a, b) {
  const way = Math.atan2(b[1] - a[1], b[0] - a[0]);
  g.lineWidth = 3;
  line(g, a, b);
  g.beginPath();
  g.moveTo(...b);
  for (const side of [2.6, -2.6]) g.lineTo(b[0] + 9 * Math.cos(way + side), b[1] + 9 * Math.sin(way + side));
  g.fill();
}

function scene(k) {
  const g = view.getContext('2d'), on = p => place(p, data.centre[k]);
  g.clearRect(0, 0, view.width, view.height);
  g.lineCap = 'round';
  g.lineWidth = 1;
  g.strokeStyle = g.fillStyle = '#b09560';
  data.links.forEach((link, i) => {
    const at = p => on(moved(data.poses[k][i], p));
    for (const [a, b] of link.edges) line(g, at(link.corners[a]), at(link.corners[b]));
    for (const [x, y] of link.points.map(at)) g.fillRect(x - 1, y - 1, 2, 2);
  });
  g.globalAlpha = 0.45;
  g.strokeStyle = '#d9b8a0';
  for (const bone of data.bones[k]) {
    g.lineWidth = Math.max(2, 1.6 * pixels * bone[6]);
    line(g, on(bone.slice(0, 3)), on(bone.slice(3, 6)));
  }
  g.globalAlpha = 1;
  for (const force of data.arrows[k]) {
    g.strokeStyle = g.fillStyle = data.inks[force[6]];
    arrow(g, on(force.slice(0, 3)), on([0, 1, 2].map(i => force[i] + data.scale * force[3 + i])));
  }
}

// Curves over time; returns the place of a time.
function panel(g, top, high, most, title, series) {
  const left = 60, wide = curves.width - left - 190, times = data.times, last = times.length - 1;
  const x = time => left + wide * (time - times[0]) / (times[last] - times[0] || 1);
  const y = value => top + high - high * Math.min(value, most) / most;
  g.strokeStyle = '#ddd';
  g.lineWidth = 1;
  g.fillStyle = '#444';
  g.font = '12px DejaVu Sans, sans-serif';
  g.fillText(title, 14, top - 8);
  for (let i = 0; i < 5; i++) {
    line(g, [left, y(most * i / 4)], [left + wide, y(most * i / 4)]);
    g.fillText((most * i / 4).toPrecision(2), 14, y(most * i / 4) + 4);
  }
  for (let i = 0; i <= 5; i++) {
    const time = times[0] + (times[last] - times[0]) * i / 5;
    g.fillText(time.toFixed(1) + ' s', x(time) - 12, top + high + 16);
  }
  series.forEach((each, row) => {
    g.strokeStyle = g.fillStyle = each.ink;
    if (each.low) {
      g.globalAlpha = 0.18;
      g.beginPath();
      each.low.forEach((value, i) => g.lineTo(x(times[i]), y(value)));
      for (let i = last; i >= 0; i--) g.lineTo(x(times[i]), y(each.high[i]));
      g.fill();
      g.globalAlpha = 1;
    }
    g.lineWidth = 1.7;
    g.beginPath();
    each.values.forEach((value, i) => g.lineTo(x(times[i]), y(value)));
    g.stroke();
    g.fillText(each.name, left + wide + 12, top + 14 + 17 * row);
  });
  return x;
}

function plot(k) {
  const g = curves.getContext('2d'), column = (rows, i) => rows && rows.map(row => row[i]);
  const fingers = data.fingers.map((name, i) => ({name, ink: data.inks[i], values: column(data.normal, i),
                                                  low: column(data.low, i), high: column(data.high, i)}));
  const most = Math.max(0.1, ...(data.high || data.normal).flat(), ...data.normal.flat());
  g.clearRect(0, 0, curves.width, curves.height);
  const x = panel(g, 30, 250, most, 'normal force [N]', fingers);
  panel(g, 350, 170, Math.max(0.2, Math.min(1, Math.max(...data.share))), 'residual, share of the weight',
        [{name: 'residual', ink: '#c8553d', values: data.share}, {name: 'limit 10 %', ink: '#888', values: data.times.map(() => 0.1)}]);
  g.strokeStyle = '#222';
  g.lineWidth = 1;
  line(g, [x(data.times[k]), 30], [x(data.times[k]), 520]);
}

function draw() {
  const k = Number(slider.value), forces = data.normal[k];
  const pressing = data.fingers.map((name, i) => [name, forces[i]]).filter(each => each[1] > 0.01);
  now.textContent = data.times[k].toFixed(2) + ' s, ' + data.states[k] + ': '
    + pressing.map(([name, force]) => name + ' ' + force.toFixed(2) + ' N').join(', ')
    + '; residual ' + (100 * data.share[k]).toFixed(1) + ' % of the weight';
  scene(k);
  plot(k);
}

slider.oninput = draw;
view.onmousedown = event => { grab = [event.clientX, event.clientY]; };
onmouseup = () => { grab = null; };
onmousemove = event => {
  if (!grab) return;
  turn += (event.clientX - grab[0]) / 150;
  tilt += (event.clientY - grab[1]) / 150;
  grab = [event.clientX, event.clientY];
  scene(Number(slider.value));
};
slider.max = data.times.length - 1;
slider.value = data.start;
draw();
</script>
</html>
"""


def _rounded(values: Array, digits: int) -> Any:
    return np.round(np.nan_to_num(values), digits).tolist()


def _drawn(link: Link) -> dict[str, Any]:
    """Sharp edges of its hulls, with their ends, and some points of its surface; in its own frame."""
    ends: dict[tuple[float, ...], int] = {}
    edges = []
    for corners in link.corners:
        faces = hull_faces(corners)
        a, b, c = (corners[faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
        sides: dict[tuple[int, int], list[int]] = {}
        for row, face in enumerate(faces.tolist()):
            for i in range(3):
                low, high = sorted((face[i], face[(i + 1) % 3]))
                sides.setdefault((low, high), []).append(row)
        edges += [[ends.setdefault(tuple(_rounded(corners[at], 5)), len(ends)) for at in pair] for pair, rows in sides.items()
                  if len(rows) < 2 or normals[rows[0]] @ normals[rows[1]] < SHARP]
    step = max(1, len(link.points) // DOTS)
    return {"corners": list(ends), "edges": edges, "points": _rounded(link.points[::step], 4)}


class Drawn(NamedTuple):
    """Frames of a recording that are drawn."""

    found: Result
    bones: list[Any]
    """By frame: round places of the hands that are ends of their shapes."""
    centre: Array
    """Of mass of the object, by frame."""
    finger: NDArray[np.intp]
    """By segment: its finger among `Result.fingers`."""


def drawn(of: Solver, found: Result, rows: NDArray[np.intp]) -> Drawn:
    bones = []
    for row in rows:
        own = []
        for k, each in enumerate(of.motions):
            if of.hands.tracked[k][row]:
                shapes = of.hands.shapes[k]
                balls = shapes.balls(shapes.bodies(each.q[row], each.wrist[row]))
                ends = np.append(shapes.first[1:], len(balls)) - 1
                own += [[*_rounded(np.concatenate([balls[a], balls[b]]), 4), round(float(shapes.radii[a]), 4)] for a, b in zip(shapes.first, ends)]
        bones.append(own)
    return Drawn(found.rows(rows), bones, of.of.centre[rows], of.finger)


def joined(parts: Sequence[Drawn]) -> Drawn:
    """Of parts of a recording, one after the other."""
    first = parts[0].found
    columns = {name: np.concatenate([getattr(part.found, name) for part in parts]) for name, value in first._asdict().items()
               if isinstance(value, np.ndarray) and name != "unsure"}
    return Drawn(first._replace(**columns), [each for part in parts for each in part.bones], np.concatenate([part.centre for part in parts]), parts[0].finger)


def every(count: int) -> int:
    """Of so many frames every which is drawn."""
    return max(1, math.ceil(count / MOST))


def _data(thing: Thing, of: Drawn, figures: Figures) -> dict[str, Any]:
    found = of.found
    fingers, segments = [i for i, own in enumerate(figures.pressing) if own], figures.touching
    arrows = [[[*_rounded(np.concatenate([found.centre[row, i], found.force[row, i]]), 4), fingers.index(int(of.finger[i]))]
               for i in segments if found.normal[row, i] > 1e-3] for row in range(len(found.times))]
    strongest = float(np.linalg.norm(found.force, axis=2).max(initial=1e-9))
    bands = None if found.bands is None else found.bands[:, fingers]
    return {"times": _rounded(found.times, 4), "states": [STATES[state] for state in found.state], "share": _rounded(found.share, 4),
            "fingers": [found.fingers[i] for i in fingers], "inks": [INKS[k % len(INKS)] for k in range(len(fingers))],
            "normal": _rounded(found.by_finger[:, fingers], 3), "low": None if bands is None else _rounded(bands[..., 0], 3),
            "high": None if bands is None else _rounded(bands[..., 1], 3), "centre": _rounded(of.centre, 4), "links": [_drawn(link) for link in thing.links],
            "poses": _rounded(found.places, 5),
            "bones": of.bones, "arrows": arrows, "scale": 0.08 / strongest, "start": int(np.argmax(found.by_finger.sum(axis=1)))}


def _thinned(count: int) -> str:
    return "" if every(count) == 1 else f"; one of {every(count)} is drawn"


def page(thing: Thing, asked: Asked, of: Drawn, figures: Figures) -> bytes:
    found = of.found
    title = html.escape(f"Forces on {thing.name}")
    note = f"{figures.frames} frames, {figures.lifted} lifted{_thinned(figures.frames)}. "
    if figures.lifted:
        note += f"Residual at most 10 % of the weight in {100 * figures.enough:.0f} % of these. "
    note += ("Arrows are forces on the object. Drag to turn. " + ("" if found.bands is None else "Bands: 5 to 95 %. ")
             + "How hard opposite fingers squeeze does not show in motion: it is what people take.")
    rows = "".join(f"<tr><td>{html.escape(finger)}</td><td>{peak:.2f}</td><td>{mean:.2f}</td></tr>"
                   for finger, (peak, mean) in figures.fingers.items())
    table = (f"<table><tr><th>finger</th><th>peak [N]</th><th>mean [N]</th></tr>{rows}</table><p>Margin against slip {margin(figures, asked):.3g} with friction "
             f"{asked.friction:g}; {strength_text(asked, figures)}.</p>")
    data = json.dumps(_data(thing, of, figures), separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return PAGE.replace("TITLE", title).replace("NOTE", note).replace("FIGURES", table).replace("DATA", data).encode()
