"""The functions behind the pictures, by closed forms: their modules are imported in the browser."""

from __future__ import annotations

import math

import numpy as np
import pytest


def run(page, module, expression, *arguments):
    """An expression that begins with a name of the module; `a` are the arguments."""
    return page.evaluate(
        f"""async (a) => {{
          const known = performance.getEntriesByType("resource").map((one) => one.name);
          const names = await import(known.find((one) => one.endsWith("/{module}.js")));
          return names.{expression};
        }}""",
        list(arguments),
    )


def test_ticks_are_round_and_within_or_enclose(page):
    assert run(page, "numbers", "ticks(0, 1, 5)") == pytest.approx([0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert run(page, "numbers", "ticks(-3, 47, 6)") == [0, 10, 20, 30, 40]
    assert run(page, "numbers", "ticks(-3, 47, 6, true)") == [-10, 0, 10, 20, 30, 40, 50]


def test_contours_lie_on_their_level(page):
    """Marching squares on a paraboloid: along each piece the level is kept to the order of the grid."""
    rows = [[(i / 40) ** 2 + (j / 40) ** 2 for i in range(40)] for j in range(40)]
    rows[5][5] = None
    pieces = run(page, "map", "contour(...a)", rows, 0.25)
    radii = [math.hypot(x, y) / 40 for piece in pieces for x, y in piece]
    assert radii == pytest.approx([0.5] * len(radii), abs=1.0 / 40**2)
    ends = [tuple(np.round(end, 9)) for piece in pieces for end in piece]
    assert sum(ends.count(end) == 1 for end in ends) == 2  # one line, open at the two edges only
