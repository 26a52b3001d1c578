"""Lines in axes, as SVG: pictures of `handsim compare` and `handsim optimise`."""
from __future__ import annotations

import html
from typing import Sequence

import numpy as np

COLORS = ("#2b6cb0", "#dd6b20")


def axes(title: str, labels: tuple[str, str], limits: tuple[float, float, float, float], drawn: str, ticks: float,
         equal: bool = True) -> str:
    """A picture with axes, as SVG.

    :param labels: of both axes, with their units
    :param limits: left, right, low, high
    :param drawn: SVG in the axes' numbers
    :param ticks: from one line of the grid to the next
    :param equal: both axes have one scale
    """
    left, right, low, high = limits
    width, height = 420.0, 360.0
    per = (width - 70) / (right - left), (height - 80) / (high - low)
    if equal:
        per = (min(per), min(per))
    x0, y0 = 50 + (width - 70 - per[0] * (right - left)) / 2 - per[0] * left, 34 + per[1] * high
    box = (x0 + per[0] * left, 34.0, per[0] * (right - left), per[1] * (high - low))
    lines = []
    for axis in (0, 1):
        start, end = (left, right) if axis == 0 else (low, high)
        for k in range(int(np.ceil(start / ticks)), int(np.floor(end / ticks)) + 1):
            value = k * ticks
            x, y = x0 + per[0] * value, y0 - per[1] * value
            style = "#888" if k == 0 else "#e4e4e4"
            if axis == 0:
                lines.append(f'<line x1="{x:.1f}" y1="{box[1]:.1f}" x2="{x:.1f}" y2="{box[1] + box[3]:.1f}" stroke="{style}"/>'
                             f'<text x="{x:.1f}" y="{box[1] + box[3] + 14:.1f}" text-anchor="middle">{value:g}</text>')
            else:
                lines.append(f'<line x1="{box[0]:.1f}" y1="{y:.1f}" x2="{box[0] + box[2]:.1f}" y2="{y:.1f}" stroke="{style}"/>'
                             f'<text x="{box[0] - 5:.1f}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    bottom = box[1] + box[3] + 30
    return (f'<svg viewBox="0 0 {width:g} {bottom + 12:g}" width="{width:g}" height="{bottom + 12:g}"><text x="{width / 2:g}" y="18" text-anchor="middle" '
            f'font-weight="bold">{html.escape(title)}</text>{"".join(lines)}'
            f'<g transform="translate({x0:.2f} {y0:.2f}) scale({per[0]:.4f} {-per[1]:.4f})">{drawn}</g>'
            f'<text x="{box[0] + box[2] / 2:.1f}" y="{bottom:.1f}" text-anchor="middle">{labels[0]}</text>'
            f'<text transform="translate({box[0] - 34:.1f} {box[1] + box[3] / 2:.1f}) rotate(-90)" text-anchor="middle">{labels[1]}'
            '</text></svg>')


def line(points: Sequence[Sequence[float]], color: str, closed: bool) -> str:
    kind, fill = ("polygon", f'fill="{color}" fill-opacity="0.15"') if closed else ("polyline", 'fill="none"')
    text = " ".join(f"{x:.3f},{y:.3f}" for x, y in points)
    return f'<{kind} points="{text}" {fill} stroke="{color}" stroke-width="2" vector-effect="non-scaling-stroke"/>'


def sheet_of(drawn: Sequence[str], columns: int, legend: str = "") -> str:
    """Pictures in rows, as one SVG; a legend stands above them."""
    top = 30 if legend else 0
    parts = "".join(f'<g transform="translate({430 * (i % columns)} {top + 400 * (i // columns)})">{each}</g>' for i, each in enumerate(drawn))
    width, height = 430 * columns, (40 if legend else 0) + 400 * (-(-len(drawn) // columns))
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" font-family="sans-serif" '
            f'font-size="11"><rect width="100%" height="100%" fill="white"/>{legend}{parts}</svg>')
