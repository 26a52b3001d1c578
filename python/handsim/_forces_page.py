"""One HTML page of forces on an object: hands, object and arrows that can be turned, curves with bands, figures. It needs nothing beside itself."""
from __future__ import annotations

import html
import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._forces import STATES, Asked, Result, Solver
from ._forces_files import Figures, margin, touching
from ._objects import Link, Thing, hull_faces

Array = NDArray[np.float64]
MOST = 300
"""Frames in the page; a longer recording has every second, third, ..."""
SHARP = 0.8
"""Cosine between two faces below which their edge is drawn."""
DOTS = 400
"""Points of a link's surface that are drawn."""
INKS = ("#1b6ca8", "#c8553d", "#3a7d44", "#8a5a9e", "#b5834f", "#4a4a4a")
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>TITLE</title>
<style>body{font:14px/1.45 "DejaVu Sans",sans-serif;margin:1.2em auto;max-width:1100px;color:#222}canvas{border:1px solid #ccc;width:100%;display:block}
table{border-collapse:collapse;margin:.6em 0}td,th{padding:.15em .8em;text-align:right;border-bottom:1px solid #ddd}td:first-child,th:first-child{text-align:left}
input{width:100%}.note{color:#555}</style>
<h1>TITLE</h1><p class="note">NOTE</p>
<canvas id="view" width="1100" height="460"></canvas><input id="at" type="range" min="0" value="0" aria-label="frame"><p id="now"></p>
<canvas id="curves" width="1100" height="560"></canvas>FIGURES
<script>
const D=DATA;const view=document.getElementById('view'),curves=document.getElementById('curves'),at=document.getElementById('at'),now=document.getElementById('now');
at.max=D.times.length-1;let turn=0.6,tilt=0.35,grab=null;
function moved(q,p){const[x,y,z,w,a,b,c]=q,t=[2*(b*p[2]-c*p[1]),2*(c*p[0]-a*p[2]),2*(a*p[1]-b*p[0])];
 return[x+p[0]+w*t[0]+b*t[2]-c*t[1],y+p[1]+w*t[1]+c*t[0]-a*t[2],z+p[2]+w*t[2]+a*t[1]-b*t[0]];}
function place(p,c,s){const x=p[0]-c[0],y=p[1]-c[1],z=p[2]-c[2],u=x*Math.cos(turn)+y*Math.sin(turn),v=-x*Math.sin(turn)+y*Math.cos(turn);
 return[view.width/2+s*u,view.height/2-s*(z*Math.cos(tilt)+v*Math.sin(tilt))];}
function line(g,a,b){g.beginPath();g.moveTo(...a);g.lineTo(...b);g.stroke();}
function draw(){const k=+at.value,g=view.getContext('2d'),c=D.centre[k],s=1900;g.clearRect(0,0,view.width,view.height);g.lineCap='round';
 g.lineWidth=1;g.strokeStyle=g.fillStyle='#b09560';D.links.forEach((o,l)=>{const q=D.poses[k][l],on=p=>place(moved(q,p),c,s);
  for(const[i,j]of o.edges)line(g,on(o.corners[i]),on(o.corners[j]));for(const p of o.points){const r=on(p);g.fillRect(r[0]-1,r[1]-1,2,2);}});
 g.globalAlpha=.45;for(const b of D.bones[k]){g.lineWidth=Math.max(2,2*s*b[6]*.8);g.strokeStyle='#d9b8a0';line(g,place(b.slice(0,3),c,s),place(b.slice(3,6),c,s));}g.globalAlpha=1;
 for(const f of D.arrows[k]){const a=place(f.slice(0,3),c,s),e=[0,1,2].map(i=>f[i]+f[3+i]*D.scale),b=place(e,c,s),w=Math.atan2(b[1]-a[1],b[0]-a[0]);
  g.strokeStyle=g.fillStyle=D.inks[f[6]];g.lineWidth=3;line(g,a,b);g.beginPath();g.moveTo(...b);
  for(const d of[2.6,-2.6])g.lineTo(b[0]+9*Math.cos(w+d),b[1]+9*Math.sin(w+d));g.fill();}
 now.textContent=D.times[k].toFixed(2)+' s, '+D.states[k]+': '+D.fingers.map((n,i)=>D.normal[k][i]>0.01?n+' '+D.normal[k][i].toFixed(2)+' N':'').filter(x=>x).join(', ')
  +'; residual '+(100*D.share[k]).toFixed(1)+' % of the weight';plot(k);}
function panel(g,top,high,most,unit,series){const L=60,W=curves.width-L-190,T=D.times,n=T.length-1,t=x=>L+W*(x-T[0])/((T[n]-T[0])||1),y=v=>top+high-high*Math.min(v,most)/most;
 g.strokeStyle='#ddd';g.lineWidth=1;g.fillStyle='#444';g.font='12px DejaVu Sans,sans-serif';
 for(let i=0;i<5;i++){const v=most*i/4;line(g,[L,y(v)],[L+W,y(v)]);g.fillText(v.toPrecision(2),14,y(v)+4);}g.fillText(unit,14,top-8);
 for(let i=0;i<=5;i++){const x=T[0]+(T[n]-T[0])*i/5;g.fillText(x.toFixed(1)+' s',t(x)-12,top+high+16);}
 series.forEach((s,r)=>{g.strokeStyle=g.fillStyle=s.ink;if(s.low){g.globalAlpha=.18;g.beginPath();s.low.forEach((v,i)=>g.lineTo(t(T[i]),y(v)));
   for(let i=n;i>=0;i--)g.lineTo(t(T[i]),y(s.high[i]));g.fill();g.globalAlpha=1;}
  g.lineWidth=1.7;g.beginPath();s.values.forEach((v,i)=>g.lineTo(t(T[i]),y(v)));g.stroke();g.fillText(s.name,L+W+12,top+14+17*r);});return t;}
function plot(k){const g=curves.getContext('2d');g.clearRect(0,0,curves.width,curves.height);
 const col=(m,i)=>m.map(r=>r[i]),F=D.fingers.map((n,i)=>({name:n,ink:D.inks[i],values:col(D.normal,i),low:D.low?col(D.low,i):null,high:D.high?col(D.high,i):null}));
 const top=Math.max(.1,...D.normal.flat(),...(D.high?D.high.flat():[])),t=panel(g,30,250,top,'normal force [N]',F);
 panel(g,350,170,Math.max(.2,Math.min(1,...[Math.max(...D.share)])),'residual, share of the weight',[{name:'residual',ink:'#c8553d',values:D.share},{name:'limit 10 %',ink:'#888',values:D.times.map(()=>.1)}]);
 g.strokeStyle='#222';g.lineWidth=1;line(g,[t(D.times[k]),30],[t(D.times[k]),520]);}
at.oninput=draw;view.onmousedown=e=>grab=[e.clientX,e.clientY];onmouseup=()=>grab=null;
onmousemove=e=>{if(grab){turn+=(e.clientX-grab[0])/150;tilt+=(e.clientY-grab[1])/150;grab=[e.clientX,e.clientY];draw();}};
at.value=D.start;draw();
</script></html>
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


def _data(thing: Thing, of: Solver, found: Result) -> dict[str, Any]:
    rows = np.arange(0, len(found.times), max(1, math.ceil(len(found.times) / MOST)))
    fingers = [i for i in range(len(found.fingers)) if found.by_finger[:, i].max(initial=0) > 1e-3]
    segments = touching(found)
    bones, arrows = [], []
    for row in rows:
        own = []
        for k, each in enumerate(of.motions):
            if of.hands.tracked[k][row]:
                shapes = of.hands.shapes[k]
                balls = shapes.balls(shapes.bodies(each.q[row], each.wrist[row]))
                ends = np.append(shapes.first[1:], len(balls)) - 1
                own += [[*_rounded(np.concatenate([balls[a], balls[b]]), 4), round(float(shapes.radii[a]), 4)] for a, b in zip(shapes.first, ends)]
        bones.append(own)
        arrows.append([[*_rounded(np.concatenate([found.centre[row, i], found.force[row, i]]), 4), fingers.index(int(of.finger[i]))]
                       for i in segments if found.normal[row, i] > 1e-3])
    strongest = float(np.linalg.norm(found.force, axis=2).max(initial=1e-9))
    bands = None if found.bands is None else found.bands[rows][:, fingers]
    return {"times": _rounded(found.times[rows], 4), "states": [STATES[found.state[row]] for row in rows], "share": _rounded(found.share[rows], 4),
            "fingers": [found.fingers[i] for i in fingers], "inks": [INKS[k % len(INKS)] for k in range(len(fingers))],
            "normal": _rounded(found.by_finger[rows][:, fingers], 3), "low": None if bands is None else _rounded(bands[..., 0], 3),
            "high": None if bands is None else _rounded(bands[..., 1], 3), "centre": _rounded(of.of.centre[rows], 4), "links": [_drawn(link) for link in thing.links],
            "poses": _rounded(found.places[rows], 5),
            "bones": bones, "arrows": arrows, "scale": 0.08 / strongest, "start": int(np.argmax(found.by_finger[rows].sum(axis=1)))}


def page(thing: Thing, asked: Asked, of: Solver, found: Result) -> bytes:
    figures = Figures(found)
    title = html.escape(f"Forces on {thing.name}")
    note = (f"{len(found.times)} frames, {figures.lifted} lifted; residual at most 10 % of the weight in {100 * figures.enough:.0f} % of these. " if figures.lifted else
            f"{len(found.times)} frames, none lifted. ")
    note += ("Arrows are forces on the object. Drag to turn. " + ("" if found.bands is None else "Bands: 5 to 95 %. ")
             + "How hard opposite fingers squeeze does not show in motion: it is what people take.")
    rows = "".join(f"<tr><td>{html.escape(finger)}</td><td>{peak:.2f}</td><td>{mean:.2f}</td></tr>" for finger, (peak, mean) in figures.fingers.items())
    table = (f"<table><tr><th>finger</th><th>peak [N]</th><th>mean [N]</th></tr>{rows}</table><p>Margin against slip {margin(found, asked):.3g} with friction "
             f"{asked.friction:g}; effort {100 * figures.effort:.0f} % of the strength about an axis.</p>")
    data = json.dumps(_data(thing, of, found), separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return PAGE.replace("TITLE", title).replace("NOTE", note).replace("FIGURES", table).replace("DATA", data).encode()
