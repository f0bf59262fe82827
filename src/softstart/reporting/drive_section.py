"""The drive: its scheme as SVG, drawn from its numbers, and its data.

In the scheme the height of a disc goes with the fourth root of its inertia, as that of steel discs of one
thickness. The lengths of the spring and of the gap share one scale of angles: the twist of the shaft under
the starting torque, Ms/c, and the gap, from a least length on that their labels need.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from softstart.reporting.markup import Figures, Html, html, table, tag
from softstart.reporting.project import Project
from softstart.reporting.resolution import rated_torque
from softstart.start.fatigue import HOURS_PER_YEAR
from softstart.views import chain_schemes
from softstart.views.printed import RPM, at_output, digits, short, unit, units_of

HIDDEN = ("name", "source", "assumed", "units", "noise_seed", "encoder_phase")
_AXIS, _TALLEST, _LEAST = 150.0, 170.0, 60.0  # px
_ANGLES, _LEAST_COIL, _SHORTEST_SHAFT, _LEAST_GAP = 260.0, 40.0, 150.0, 8.0  # px
_LABEL = 124.0  # px: what the gap and its label need at least
_LETTER = 0.62  # of the size of a font: width of a letter, amply
_APART = 22.0  # px between labels
_INK, _GREY, _ORANGE, _BLUE = "#222222", "#666666", "#B34D00", "#00598C"
_FONT = "DejaVu Sans, Helvetica, Arial, sans-serif"
_text = partial(chain_schemes.text, size=14, colour=_INK)
_line = partial(chain_schemes.line, colour=_INK, width=2)
_polyline = partial(chain_schemes.polyline, colour=_INK, width=2)


def drive_section(drive: Any, project: Project, figures: Figures) -> Html:
    """Scheme, data, and what follows from them."""
    caption = (
        "The drive, everything brought to the motor shaft. The height of a disc goes with the "
        "fourth root of its inertia; spring and gap are drawn to one scale of angles, the spring "
        "as long as the shaft is twisted by the starting torque. The shaft carries torque only "
        "while the gap is closed on a flank."
    )
    return html(
        figures.shown("scheme", lambda: scheme(drive, "scheme"), caption),
        _data(drive, project),
        tag("p", f"Source of the data: {drive.source}.") if drive.source else None,
        _derived(drive),
    )


def _data(drive: Any, project: Project) -> Html:
    """What is known of the drive and from where; in a sentence what is absent."""
    rows, absent = [], list[str]()
    sourced, units, ratio = bool(project.sources), units_of(drive), drive.gear_ratio
    for path, (parameter, value) in drive.by_path().items():
        if value is None or value == "" or parameter.name in HIDDEN:
            continue
        source = project.source_of(path)
        if value == parameter.default and not source:
            absent += [parameter.meaning] if value == 0.0 else []
            continue
        values = value if isinstance(value, tuple) else (value,)
        seen = [units.shown(one, parameter.unit) if isinstance(one, float) else one for one in values]
        text = ", ".join(short(one) if isinstance(one, float) else str(one) for one in seen)
        of, other = unit(units.of(parameter.unit)), ""
        if isinstance(value, str):
            of = ""
        elif path == "limits.life":
            hours = value / 3600.0
            text, of, other = digits(hours / HOURS_PER_YEAR, 3), "years", f"{short(hours)} h"
        elif of != unit(parameter.unit):
            other = f"{digits(value)} {unit(parameter.unit)}"
        elif parameter.unit == "rad/s":
            other = f"{short(float(f'{value * RPM:.6g}'))} rpm"
        elif parameter.unit == "rad":
            other = f"{short(float(f'{math.degrees(value):.4g}'))}°"
        there = at_output(drive, seen[0], parameter.unit) if isinstance(seen[0], float) else ""
        there = f"{there} {of}" if there else ""
        row = [parameter.meaning, parameter.symbol, text, of.replace(" ", "\N{NO-BREAK SPACE}"), other]
        rows.append([*row, *([there] if ratio else []), *([source or "not stated"] if sourced else [])])
    heads = ["parameter", "symbol", "value", "unit", "that is"]
    heads += [*(["at the output shaft"] if ratio else []), *(["source"] if sourced else [])]
    texts = [index for index, head in enumerate(heads) if head in ("parameter", "symbol", "unit", "source")]
    none = f"Not given, and therefore none: {'; '.join(absent)}." if absent else None
    behind = (
        f"At the output shaft: torques times the gear ratio i = {short(float(ratio))}, inertias, stiffness "
        "and damping times i², angles and speeds divided by i; without losses."
        if ratio
        else None
    )
    return html(
        table(
            heads, rows, caption="Data of the drive, at the motor shaft", text_columns=texts, class_="data"
        ),
        *(tag("p", one, class_="small") for one in (behind, none) if one),
    )


def _derived(drive: Any) -> Html:
    (rated, basis), units = rated_torque(drive.design_drive), units_of(drive)
    mean, two = float(drive.mean_torque), drive.lumped
    twist = units.shown(float(drive.motor.starting_torque / two.c), "rad")
    found = [
        f"mean shaft torque under the starting torque (K_dyn = 1) {digits(mean)} N m",
        f"elastic frequency with the gap closed {digits(1.0 / float(drive.elastic_period))} Hz",
        f"elastic period {digits(1e3 * float(drive.elastic_period))} ms",
        f"twist of the shaft under the starting torque {digits(twist)} {units.angle}",
        f"100 % of torque in the parameter sheets: the {basis}, {digits(rated)} N m",
    ]
    return tag("p", f"What follows from them: {'; '.join(found)}.")


def scheme(drive: Any, prefix: str) -> Html:
    """The scheme as an <svg> element."""
    two, motor = drive.lumped, drive.motor
    J1, J2, gap, c, d, Mc = map(float, (two.J1, two.J2, two.gap, two.c, two.d, two.Mc))
    units = units_of(drive)
    tallest = max(J1, J2)
    high1, high2 = (max(_LEAST, _TALLEST * (J / tallest) ** 0.25) for J in (J1, J2))
    windup = float(motor.starting_torque) / c
    coil = max(_LEAST_COIL, _ANGLES * windup / (windup + gap))
    kind = "active" if two.active else "reactive"
    damper = f"d = {short(d)} N m s/rad" if d > 0.0 else ""
    inertia = f"{short(J1)} kg m²"  # is wider than its disc, and beside the damper's label
    spring = max(_SHORTEST_SHAFT, coil + 24.0, _width(damper) + max(_width(inertia) - 64.0, 2.0 * _APART))
    opening = max(_LEAST_GAP, _ANGLES * gap / (windup + gap)) if gap > 0.0 else 0.0
    parts: list[str] = []
    most, load = f"up to {short(float(motor.maximum_torque))} N m", f"{short(Mc)} N m, {kind}"
    x = max(120.0, 40.0 + _width(most, 12))
    parts += _disc(x, high1, "#D6E6F2", "J1", "motor", inertia)
    parts += _torque(x - 34.0, "u", most, _ORANGE, left=True)
    parts.append(_text(x + 32.0, _AXIS - 0.5 * high1 - 12.0, "phi1, w1"))
    x += 64.0
    parts += _shaft(x, spring, coil, c, damper)
    x += spring + 24.0
    if gap > 0.0:
        seen = short(float(f"{units.shown(gap, 'rad'):.4g}"))
        label = f"gap {seen} {units.angle}"
        room = max(opening + 36.0, _LABEL, _width(label) + 2.0 * _APART)
        parts += _claw(x, room, opening, float(drive.design_drive.theta0) / gap, label)
        x += room
    else:
        parts.append(_line(x, _AXIS, x + 60.0, _AXIS))
        parts.append(_text(x + 30.0, _AXIS - 14.0, "no gap"))
        x += 60.0
    parts += _disc(x, high2, "#E3EFE0", "J2", "load", f"{short(J2)} kg m²")
    parts += _torque(x + 98.0, "Mc", load, _BLUE, left=False)
    parts.append(_text(x + 32.0, _AXIS - 0.5 * high2 - 12.0, "phi2, w2"))
    width = x + max(64.0 + 150.0, 98.0 + 18.0 + _width(load, 12))
    title = (
        f"Two masses and a gap: motor J1 = {short(J1)} kg m², shaft c = {short(c)} N m/rad, gap "
        f"{digits(units.shown(gap, 'rad'))} {units.angle}, load J2 = {short(J2)} kg m², load torque "
        f"Mc = {short(Mc)} N m"
    )
    head = tag("title", title, id=f"{prefix}-title")
    return Html(
        f'<svg class="scheme" viewBox="0 0 {width:.0f} 300" role="img" aria-labelledby="{prefix}-title" '
        f'font-family="{_FONT}" font-size="14">{head}' + "".join(parts) + "</svg>"
    )


def _disc(x: float, high: float, colour: str, symbol: str, name: str, value: str) -> list[str]:
    box = f'x="{x:.1f}" y="{_AXIS - 0.5 * high:.1f}" width="64" height="{high:.1f}"'
    low = _AXIS + 0.5 * high
    return [
        f'<rect {box} fill="{colour}" stroke="{_INK}" stroke-width="2"/>',
        _text(x + 32.0, _AXIS + 5.0, symbol),
        _text(x + 32.0, low + 20.0, name, colour=_GREY),
        _text(x + 32.0, low + 39.0, value),
    ]


def _width(text: str, size: int = 14) -> float:
    """How wide a text may be, px."""
    return _LETTER * size * len(text)


def _shaft(x: float, length: float, coil: float, c: float, damper: str) -> list[str]:
    """A spring, and below it a damper if there is damping."""
    lead, turns = 0.5 * (length - coil), max(3, round(coil / 16.0))
    step = coil / (2 * turns)
    points = [(x, _AXIS), (x + lead, _AXIS)]
    points += [(x + lead + (k + 0.5) * step, _AXIS + (14.0 if k % 2 else -14.0)) for k in range(2 * turns)]
    points += [(x + length - lead, _AXIS), (x + length + 24.0, _AXIS)]
    parts = [_polyline(points), _text(x + 0.5 * length + 12.0, _AXIS - 26.0, f"c = {short(c)} N m/rad")]
    if damper:
        middle, low, left, right = x + 0.5 * length, _AXIS + 48.0, x + 6.0, x + length - 6.0
        parts += [
            _polyline([(left, _AXIS), (left, low), (middle - 6.0, low)]),
            _polyline([(middle + 14.0, low - 12.0), (middle - 14.0, low - 12.0), (middle - 14.0, low + 12.0),
                       (middle + 14.0, low + 12.0)]),
            _line(middle - 6.0, low - 9.0, middle - 6.0, low + 9.0, width=4),
            _polyline([(middle - 6.0, low), (right, low), (right, _AXIS)]),
            _text(middle, low + 32.0, damper),
        ]  # fmt: skip
    return parts


def _claw(start: float, room: float, opening: float, place: float, label: str) -> list[str]:
    """A claw of the motor's side between two flanks of the load's, where the start finds it."""
    x = start + 0.5 * (room - opening - 12.0)
    left, right = x + 3.0, x + opening + 9.0
    middle = 0.5 * (left + right) + min(max(place, -0.5), 0.5) * opening
    top, flank = _AXIS - 44.0, _AXIS + 34.0
    return [
        _polyline([(start + room, _AXIS), (right, _AXIS)]),
        # the left flank leaves room for the shaft that passes it
        _polyline([(right, flank), (right, top), (left, top), (left, _AXIS - 10.0)]),
        _polyline([(left, _AXIS + 10.0), (left, flank)]),
        _line(start - 24.0, _AXIS, middle, _AXIS),
        _line(middle, _AXIS - 28.0, middle, _AXIS + 28.0, width=6),
        _line(left, flank + 14.0, right, flank + 14.0, colour=_GREY, width=1),
        *(_line(at, flank + 6.0, at, flank + 22.0, colour=_GREY, width=1) for at in (left, right)),
        _text(0.5 * (left + right), flank + 40.0, label),
    ]


def _torque(x: float, symbol: str, value: str, colour: str, *, left: bool) -> list[str]:
    bend, tip = (-1.0, 1.0) if left else (1.0, -1.0)
    start, end = _AXIS + 34.0, _AXIS - 34.0
    if not left:
        start, end = end, start
    arc = f"M {x:.1f} {start} A 42 42 0 0 1 {x:.1f} {end}"
    head = [(x + bend * 9.0, end + tip * 6.0), (x, end), (x + bend * -3.0, end + tip * 12.0)]
    at = x + bend * 24.0
    return [
        f'<path d="{arc}" fill="none" stroke="{colour}" stroke-width="2.5"/>',
        _polyline(head, colour=colour, width=2.5),
        _text(at, _AXIS + 5.0, symbol, colour=colour, anchor="end" if left else "start"),
        _text(
            x + (12.0 if left else 0.0),
            _AXIS + 62.0,
            value,
            size=12,
            colour=colour,
            anchor="end" if left else "start",
        ),
    ]
