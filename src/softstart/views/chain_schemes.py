"""The scheme of a chain as SVG: discs, springs, gaps and gears, all brought to the motor shaft, to scale.

The height of a disc goes with the fourth root of its inertia, as that of steel discs of one thickness. Along
the row, the length of a spring beyond its least length goes with its compliance: by the centre-of-mass
analogy of [R] compliances are the lengths. The opening of a gap goes with its angle. Below stands the first
elastic shape with its nodes, along the same row.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from html import escape
from itertools import pairwise

import numpy as np

from softstart.chain.model import Chain, ChainArrays
from softstart.vibration import Vibration, natural_vibration

_AXIS, _TALLEST, _THICK = 215.0, 150.0, 16.0  # px: height of the shaft axis, tallest disc, thickness of discs
_SHORTEST, _SPRING, _GAP, _LEAST_GAP = 44.0, 420.0, 90.0, 3.0  # px: springs, and what all gaps share
_LETTER, _LINE = 6.6, 14.0  # px: about what a letter takes in a line of size 12, and a line
_FOLDED, _LONGEST = 18, 28  # letters: longer names are folded at the joints of merged masses, or cut
_SHAPE, _SWING = 430.0, 60.0  # px: zero line of the shape, its largest amplitude
_INK, _STEEL, _RED, _BLUE, _GREY = "#1d2733", "#b9c6d3", "#c2403a", "#2f6da8", "#6b7785"
_FOOT = (
    "At the motor shaft: inertias in kg m2 below the discs, stiffnesses in N m/rad and gaps in rad.",
    (
        "Disc height goes with the fourth root of inertia, spring length with compliance, gaps with their "
        "angle."
    ),
)


def scheme_svg(chain: Chain) -> str:
    """The scheme as the text of an SVG file.

    >>> scheme_svg(Chain.load("crane-4-mass"))[:28]
    '<svg class="scheme" xmlns="h'
    """
    arrays = chain.at_motor_shaft()
    vibration = natural_vibration(chain)
    tall = _TALLEST * (arrays.moving_J / arrays.moving_J.max()) ** 0.25
    tall[np.isinf(arrays.J)] = _TALLEST  # ground
    parts: list[str] = []
    x = 70.0
    middles = []
    tops = []
    for k in range(len(chain.masses)):
        parts += _disc(x, float(tall[k]))
        middle = x + 0.5 * _THICK
        middles.append(middle)
        bottom = _AXIS + 0.5 * _TALLEST
        tops.append(_AXIS - 0.5 * float(tall[k]) - 8.0)
        parts.append(text(middle, bottom + 18.0, _number(float(arrays.J[k])), size=11))
        if k == arrays.motor and chain.motor is not None:
            parts += _arrow(middle, bottom + 30.0, "motor", _RED)
        if arrays.Mc[k] != 0.0:
            parts += _arrow(middle, bottom + 30.0, f"Mc {_number(float(arrays.Mc[k]))} N m", _BLUE)
        x += _THICK
        if k < len(chain.shafts):
            x = _shaft(parts, x, chain, arrays, k)
    parts += _shape(vibration, middles)
    names, right = _names([mass.name for mass in chain.masses], middles, tops)
    parts += names
    width = max(x + 110.0, right + 10.0, 1010.0)
    heading = [text(24.0, 30.0, chain.name, 16, anchor="start")]
    if chain.assumed:
        assumed = f"assumed: {chain.assumed}"
        folded = textwrap.wrap(assumed, int((width - 48.0) / _LETTER), max_lines=2, placeholder=" ...")
        heading += [
            text(24.0, 49.0 + _LINE * i, line, 12, _GREY, anchor="start", whole=assumed)
            for i, line in enumerate(folded)
        ]
    foot = [text(24.0, 523.0 + 15.0 * i, line, 11, _GREY, anchor="start") for i, line in enumerate(_FOOT)]
    return (
        f'<svg class="scheme" xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="550" '
        f'viewBox="0 0 {width:.0f} 550" font-family="DejaVu Sans, Helvetica, Arial, sans-serif">\n'
        f'<rect width="100%" height="100%" fill="white"/>\n'
        + "\n".join([*heading, *parts, *foot])
        + "\n</svg>\n"
    )


def _names(names: Sequence[str], middles: Sequence[float], tops: Sequence[float]) -> tuple[list[str], float]:
    """The names over their discs, slanted where they would meet or leave the page; and where they end."""
    folded = [_folded(name) for name in names]
    halves = [0.5 * _LETTER * max(map(len, lines)) for lines in folded]
    places = list(zip(middles, halves, strict=True))
    meet = any(a + half > b - other for (a, half), (b, other) in pairwise(places))
    parts: list[str] = []
    if len(names) <= 6 and not meet and places[0][0] > places[0][1] + 4.0:
        for name, lines, x, y in zip(names, folded, middles, tops, strict=True):
            for i, line in enumerate(reversed(lines)):
                parts.append(text(x, y - _LINE * i, line, whole=name))
        return parts, max(x + half for x, half in places)
    right = 0.0
    for name, lines, x, y in zip(names, folded, middles, tops, strict=True):
        label = _cut(" + ".join(lines if len(lines) < 3 else (lines[0], "...", lines[-1])))
        parts.append(text(x, y, label, slanted=True, whole=name))
        right = max(right, x + 0.82 * _LETTER * len(label))
    return parts, right


def _folded(name: str) -> list[str]:
    """A long name in lines; of many merged masses the first and the last."""
    lines = name.split(" + ") if len(name) > _FOLDED else [name]
    if len(lines) > 4:
        lines = [lines[0], f"{len(lines) - 2} more", lines[-1]]
    return [_cut(line) for line in lines]


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3].rstrip()}..."


def _disc(x: float, tall: float) -> list[str]:
    return [
        f'<rect x="{x:.1f}" y="{_AXIS - 0.5 * tall:.1f}" width="{_THICK}" height="{tall:.1f}" rx="2" '
        f'fill="{_STEEL}" stroke="{_INK}"/>'
    ]


def _shaft(parts: list[str], x: float, chain: Chain, arrays: ChainArrays, k: int) -> float:
    """Draw spring, gap and gear behind mass k from x on; where the next mass begins."""
    shaft = chain.shafts[k]
    compliance = 1.0 / arrays.c
    start = x
    labels = []
    geared = shaft.ratio != 1.0 or shaft.efficiency < 1.0
    if geared and shaft.side == "after":
        x = _gear(parts, x, shaft.ratio, shaft.efficiency)
    if arrays.rigid[k]:
        parts.append(line(x, _AXIS, x + _SHORTEST, _AXIS, width=5.0))
        x += _SHORTEST
        labels.append("rigid")
    else:
        length = _SHORTEST + _SPRING * float(compliance[k] / compliance.sum())
        x = _spring(parts, x, length)
        labels.append(_number(float(arrays.c[k])))
    if arrays.gap[k] > 0.0:
        opening = _LEAST_GAP + _GAP * float(arrays.gap[k] / arrays.gap.sum())
        x = _jaws(parts, x, opening)
        labels.append(f"gap {_number(float(arrays.gap[k]))}")
    if geared and shaft.side == "before":
        x = _gear(parts, x, shaft.ratio, shaft.efficiency)
    for i, label in enumerate(labels):
        colour = _RED if label.startswith("gap") else _INK
        parts.append(text(0.5 * (start + x), _AXIS + 26.0 + 14.0 * i, label, size=10, colour=colour))
    return x


def _spring(parts: list[str], x: float, length: float) -> float:
    lead, turns = 6.0, max(3, round(length / 14.0))
    step = (length - 2.0 * lead) / (2 * turns)
    points = [(x, _AXIS), (x + lead, _AXIS)]
    points += [(x + lead + (j + 0.5) * step, _AXIS + (7.0 if j % 2 else -7.0)) for j in range(2 * turns)]
    points += [(x + length - lead, _AXIS), (x + length, _AXIS)]
    parts.append(polyline(points))
    return x + length


def _jaws(parts: list[str], x: float, opening: float) -> float:
    """A claw of the shaft behind between two stops of the shaft before."""
    claw, high, low = 5.0, _AXIS - 14.0, _AXIS + 5.0
    right = x + opening + claw
    middle, end = 0.5 * (x + right), right + 6.0
    stem = [(middle, low - 4.0), (middle, _AXIS + 12.0), (end, _AXIS + 12.0), (end, _AXIS)]
    parts.append(polyline([(x, low), (x, high), (right, high), (right, low)], colour=_RED, width=1.8))
    parts.append(polyline(stem))
    box = f'x="{middle - 0.5 * claw:.1f}" y="{high + 4.0}" width="{claw}" height="{low - high - 4.0}"'
    parts.append(f'<rect {box} fill="{_INK}"/>')
    return end


def _gear(parts: list[str], x: float, ratio: float, efficiency: float) -> float:
    """Two wheels in mesh, seen from the side, the ratio of their heights that of the gear (within limits)."""
    shown = min(max(ratio, 0.25), 4.0)
    first, second = 40.0 / (1.0 + shown), 40.0 * shown / (1.0 + shown)
    parts.append(line(x, _AXIS, x + 8.0, _AXIS))
    wheels = ((x + 6.0, _AXIS - 0.5 * first, first), (x + 14.0, _AXIS - 0.5 * second, second))
    for left, top, high in wheels:
        parts.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="7" height="{high:.1f}" fill="white" stroke="{_BLUE}" '
            'stroke-width="1.6" stroke-dasharray="2.5 1.5"/>'
        )
    parts.append(text(x + 13.5, _AXIS + 56.0, f"{_number(ratio)} : 1", size=10, colour=_BLUE))
    if efficiency < 1.0:
        parts.append(text(x + 13.5, _AXIS + 69.0, f"η {efficiency:.3g}", size=10, colour=_BLUE))
    parts.append(line(x + 21.0, _AXIS, x + 27.0, _AXIS))
    return x + 27.0


def _shape(vibration: Vibration, middles: list[float]) -> list[str]:
    """The first elastic shape over the row, with its nodes."""
    shape = vibration.shape[1]
    heights = [_SHAPE - _SWING * float(a) for a in shape]
    parts = [line(middles[0], _SHAPE, middles[-1], _SHAPE, colour=_GREY, width=0.8)]
    for (xa, ya), (xb, yb) in pairwise(zip(middles, heights, strict=True)):
        parts.append(line(xa, ya, xb, yb, colour=_BLUE, width=2.0))
    for x, y in zip(middles, heights, strict=True):
        parts.append(line(x, _SHAPE, x, y, colour=_GREY, width=0.6))
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{_BLUE}"/>')
    for node in vibration.nodes[1]:
        x = middles[node.shaft] + node.share * (middles[node.shaft + 1] - middles[node.shaft])
        parts.append(
            f'<circle cx="{x:.1f}" cy="{_SHAPE}" r="4.5" fill="white" stroke="{_RED}" stroke-width="2"/>'
        )
        parts.append(text(x, _SHAPE + 20.0, "node", size=10, colour=_RED))
    shape = f"first elastic shape, {_number(float(vibration.frequency[1]))} Hz, gaps closed"
    parts.append(text(middles[0], _SHAPE + 72.0, shape, size=12, colour=_BLUE, anchor="start"))
    return parts


def _arrow(x: float, y: float, label: str, colour: str) -> list[str]:
    head = f'<path d="M {x - 7:.1f} {y + 9:.1f} A 9 9 0 1 1 {x + 7:.1f} {y + 9:.1f}" fill="none" '
    tip = f'<path d="M {x + 7:.1f} {y + 9:.1f} l 1 -8 l -7 4 z" fill="{colour}"/>'
    return [f'{head}stroke="{colour}" stroke-width="1.8"/>', tip, text(x, y + 24.0, label, 11, colour)]


def polyline(points: Sequence[tuple[float, float]], *, colour: str = _INK, width: float = 1.4) -> str:
    """A line through points in px."""
    drawn = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
    return f'<polyline points="{drawn}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def line(xa: float, ya: float, xb: float, yb: float, *, colour: str = _INK, width: float = 1.4) -> str:
    """A straight line; px."""
    ends = f'x1="{xa:.1f}" y1="{ya:.1f}" x2="{xb:.1f}" y2="{yb:.1f}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{width}"/>'


def text(
    x: float, y: float, label: str, size: int = 12, colour: str = _INK, *, anchor: str = "middle",
    slanted: bool = False, whole: str = "",
) -> str:  # fmt: skip
    """A text at (x, y) in px; `whole` is shown where the pointer rests on it, if it was cut."""
    turn = f' transform="rotate(-35 {x:.1f} {y:.1f})"' if slanted else ""
    where = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{"start" if slanted else anchor}"'
    title = f"<title>{escape(whole)}</title>" if whole and whole != label else ""
    return f'<text {where} font-size="{size}" fill="{colour}"{turn}>{escape(label)}{title}</text>'


def _number(value: float) -> str:
    for size, letter in ((1e6, "M"), (1e3, "k")):
        if abs(value) >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:.3g}"
