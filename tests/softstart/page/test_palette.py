"""The colours of strategies on the page: told apart by colour-blind readers, and seen on the paper."""

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import softstart.page
from softstart import compare
from softstart.controller.finding import ready_controller_names
from softstart.page.duty_frames import duty_view
from softstart.page.frames import FrameBuilder
from softstart.page.session import Session
from softstart.views.drawing import STRATEGIES
from softstart.views.traces import trade_off_figure

COLOURS = 13  # of strategies: the shipped ones and one more, as an optimum
WEB = Path(softstart.page.__file__).parent / "web"
# G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, IEEE Trans. Visualization and Computer Graphics 15 (2009)
# 1291-1298, table 1, severity 1.0: what is seen of linear RGB
SIGHT = {
    "full": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
# B. Ottosson, A perceptual color space for image processing (2020): linear RGB to Oklab
CONES = [[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
         [0.0883024619, 0.2817188376, 0.6299787005]]  # fmt: skip
LAB = [[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
       [0.0259040371, 0.7827717662, -0.8086757660]]  # fmt: skip
NOTICED = 0.02  # distance in Oklab of two large areas that can just be told apart


def linear(tone):
    value = np.array([int(tone[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def seen(tone, sight):
    cones = np.array(CONES) @ np.clip(np.array(SIGHT[sight]) @ linear(tone), 0.0, 1.0)
    return np.array(LAB) @ np.cbrt(cones)


def palette(name):
    return [pair[["LIGHT", "DARK"].index(name)] for pair in STRATEGIES]


def tones(name):
    """Of this name in the style sheet, on light and dark paper."""
    return re.findall(rf"--{name}: (#[0-9a-f]{{6}});", (WEB / "style.css").read_text("utf-8"))


def contrast(tone, paper):
    light = sorted(float(linear(one) @ [0.2126, 0.7152, 0.0722]) for one in (tone, paper))
    return (light[1] + 0.05) / (light[0] + 0.05)


@pytest.mark.parametrize("name", ["LIGHT", "DARK"])
@pytest.mark.parametrize("sight", sorted(SIGHT))
def test_any_two_strategies_are_told_apart(name, sight):
    assert len(ready_controller_names()) <= COLOURS == len(palette(name))
    nearest = min(
        float(np.linalg.norm(seen(one, sight) - seen(other, sight)))
        for one, other in combinations(palette(name), 2)
    )
    assert nearest > (6.5 if sight == "full" else 4.0) * NOTICED  # lines are thin


@pytest.mark.parametrize("name", ["LIGHT", "DARK"])
def test_lines_are_seen_on_the_paper(name):
    paper = tones("paper")[["LIGHT", "DARK"].index(name)]
    assert min(contrast(tone, paper) for tone in palette(name)) >= 3.0  # WCAG 2.2, 1.4.11


@pytest.mark.parametrize("name", ["LIGHT", "DARK"])
@pytest.mark.parametrize("other", ["warn", "ink"])
def test_no_strategy_looks_like_a_limit_or_the_motor_torque(name, other):
    """Red is an error, a limit, and what exceeds it; the torque of the motor is drawn in ink."""
    one = seen(tones(other)[["LIGHT", "DARK"].index(name)], "full")
    assert min(float(np.linalg.norm(seen(tone, "full") - one)) for tone in palette(name)) > 6.5 * NOTICED


def test_a_strategy_has_the_same_colour_wherever_it_is_drawn():
    import matplotlib.colors

    found = compare("crane-4amtkf", ["ramp", "direct"])
    figure = trade_off_figure([(row.name, 1.0, row.run.k_dyn) for row in found.rows])
    drawn = {line.get_label(): matplotlib.colors.to_hex(line.get_color()) for line in figure.axes[0].lines}
    colours = FrameBuilder(Session()).main_frame()["colours"]
    for name in ("ramp", "direct"):
        assert drawn[name] == colours[name][0]
    session = Session()
    session.select("ramp")
    assert duty_view(session.inputs, None, 0)["colours"] == colours["ramp"]
