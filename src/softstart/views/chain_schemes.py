"""The scheme of a chain as SVG text, and the marks with which the report draws that of a drive."""

from __future__ import annotations

import io
from collections.abc import Sequence
from html import escape

from softstart.chain.model import Chain
from softstart.vibration import natural_vibration
from softstart.views.chains import shapes_figure
from softstart.views.drawing import drawing

_INK = "#1d2733"


def scheme_svg(chain: Chain) -> str:
    """The scheme as the text of an SVG element."""
    written = io.StringIO()
    with drawing():
        shapes_figure(natural_vibration(chain), 0).savefig(written, format="svg", metadata={"Date": None})
    return written.getvalue()[written.getvalue().index("<svg") :]


def polyline(points: Sequence[tuple[float, float]], *, colour: str = _INK, width: float = 1.4) -> str:
    """A line through points in px."""
    drawn = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
    return f'<polyline points="{drawn}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def line(xa: float, ya: float, xb: float, yb: float, *, colour: str = _INK, width: float = 1.4) -> str:
    """A straight line; px."""
    return polyline([(xa, ya), (xb, yb)], colour=colour, width=width)


def text(
    x: float, y: float, label: str, size: int = 12, colour: str = _INK, *, anchor: str = "middle"
) -> str:
    """A text at (x, y) in px."""
    where = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
    return f'<text {where} font-size="{size}" fill="{colour}">{escape(label)}</text>'
