"""The scheme: a row of discs, springs and gaps to the scales it states, and the shapes below them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softstart.chain import Chain, Mass, Shaft
from softstart.chain.elements import LIBRARY
from softstart.vibration import natural_vibration


def drawn(chain: Chain) -> tuple[Any, Any]:
    """The panels of the scheme and of the shapes."""
    return tuple(natural_vibration(chain).plot().axes)  # type: ignore[return-value]


def colour(line: Any) -> str:
    return str(line.get_color())


@pytest.mark.parametrize("name", LIBRARY.names())
def test_everything_is_named_and_inside(name: str) -> None:
    chain = Chain.load(name)
    row, shapes = drawn(chain)
    said = [one.get_text() for one in row.texts]
    assert all(mass.name in said for mass in chain.masses)
    title = " ".join(row.figure.get_suptitle().split())
    assert f"assumed: {chain.assumed}" in title
    assert len(row.patches) == len(chain.masses)
    row.figure.draw_without_rendering()
    inside = row.figure.bbox
    for one in row.texts:
        box = one.get_window_extent()
        assert inside.x0 <= box.x0 < box.x1 <= inside.x1
    vibration = natural_vibration(chain)
    middles = [one.get_x() + 0.5 * one.get_width() for one in row.patches]
    first = next(line for line in shapes.get_lines() if str(line.get_label()).startswith("mode 1"))
    assert first.get_xdata() == pytest.approx(middles)
    assert first.get_ydata() == pytest.approx(vibration.shape[1])


def test_gaps_are_to_scale() -> None:
    """The distance of the two stops, less the least one."""
    row, _ = drawn(Chain([Mass(1)] * 3, [Shaft(1, gap=0.1), Shaft(1, gap=0.3)]))
    stops = [line.get_xdata()[0] for line in row.get_lines() if colour(line) == "#D55E00"]
    first, second = np.diff(stops)[::2] - 3.0
    assert second / first == pytest.approx(3.0)
