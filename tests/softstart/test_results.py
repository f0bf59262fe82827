"""A result that is printed is one line that says what came out, however much it holds."""

import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import softstart
from softstart import (
    Chain,
    Clutch,
    Drive,
    Project,
    TorqueProfile,
    compare,
    engage,
    fatigue,
    natural_vibration,
    reduce_chain,
    simulate,
)  # fmt: skip
from softstart.errors import InputError
from softstart.optimal.front import ControllerPoint, Front, FrontPoint
from softstart.results import OneLine, Result
from softstart.views.numbers import TextTable
from softstart.views.sheet import Sheet, as_html

CRANE = Drive.load("crane-4amtkf").replace(damping=0.3)
KNOTS = tuple(np.linspace(0.0, 1.0, 500).tolist())
POINT = FrontPoint(0.4, "reached", "OPTIMAL", "", 1.01, 1.0, "momentum", "all", time=KNOTS, torque=KNOTS)


def printed():
    chain, run = Chain.load("crane-4-mass"), simulate(CRANE, "ramp")
    both = compare(CRANE, ["direct", "ramp"])
    front = Front(CRANE, "reached", (POINT,) * 20, (ControllerPoint("ramp", 1.2, 0.4, "", POINT),) * 9)
    yield from (run, both, both.rows[0], both.recommendation, front, POINT, front.controllers[0])
    yield from (lives := fatigue([run]), lives.rows[0], TorqueProfile(KNOTS, KNOTS))
    yield from (natural_vibration(chain), reduce_chain(chain), engage(Clutch.load("paper-c")))


def test_a_result_is_printed_in_one_line():
    for result in printed():
        text = repr(result)
        assert str(result) == text
        assert text.startswith(f"<{type(result).__name__}: ")
        assert len(text) < 600
        assert "\n" not in text
        assert "array(" not in text


def test_the_line_of_a_comparison_and_of_a_front_has_their_figures():
    assert repr(compare(CRANE, ["direct", "ramp"])).endswith(" (ramp) to 2.901 (direct)>")
    front = Front(CRANE, "reached", (POINT,), (ControllerPoint("ramp", 1.2, 0.4, "", POINT),))
    assert repr(front).endswith("Minimum K_dyn 1.010 in 0.4 s.>")
    assert "K_dyn 1.01, K_dyn lower bound 1, " in repr(POINT)
    assert repr(replace(POINT, time=KNOTS[:3])).endswith(", time [3], torque [500]>")


def test_what_is_no_strategy_is_told_all_forms_of_one():
    for given in (3, tuple(np.zeros(1000) for _ in range(3))):
        with pytest.raises(InputError, match=r"^controller = .*a function of time\.$") as refused:
            simulate(CRANE, given)
        assert len(str(refused.value)) < 300
    assert repr(compare(CRANE, "direct")).startswith("<Comparison: 1 strategy on ")
    assert repr(Project.new("crane-4amtkf", "hoist-15kw")) == "<Project: crane-4amtkf: 2 machines>"


def test_no_result_prints_its_arrays():
    """A dataclass makes a repr of its own unless it is told not to."""
    house = Path(softstart.__file__).parent
    for path in house.rglob("*.py"):
        if re.search(r"^class \w+\((OneLine|Result)", path.read_text("utf-8"), re.MULTILINE):
            import_module(".".join(("softstart", *path.relative_to(house).with_suffix("").parts)))
    found = [*OneLine.__subclasses__(), *Result.__subclasses__()]
    assert len(found) > 25
    own = {one.__name__ for one in found if "__repr__" in vars(one)}
    assert own == {"Result", "Run", "Comparison", "Optimum", "LinearView", "Report", "ParameterSheet"}


def test_a_result_draws_its_main_panel_on_given_axes():
    figure, (left, right) = plt.subplots(1, 2)
    run, both = simulate(CRANE, "ramp"), compare(CRANE, ["direct", "ramp"])
    assert run.plot(ax=left) is figure
    assert both.plot(ax=right) is figure
    assert left.get_ylabel() == "torque, N m"
    assert right.get_xlabel() == "settled time, s"
    assert len(both.plot().axes) == 2
    with pytest.raises(InputError, match=r"^ax: the figure of Fatigue has several axes; leave ax out"):
        fatigue([run]).plot(ax=left)
    plt.close("all")


def test_a_result_with_rows_is_a_dataframe():
    run, both = simulate(CRANE, "ramp"), compare(CRANE, ["direct", "ramp"])
    assert list(both.to_dataframe()["controller"]) == ["ramp", "direct"]
    assert list(fatigue([run]).to_dataframe()["controller"]) == ["ramp"]
    front = Front(CRANE, "reached", (POINT,), (ControllerPoint("ramp", 1.2, 0.4, "", POINT),))
    assert list(front.to_dataframe()["what"]) == ["optimum", "ramp"]
    traces = run.to_dataframe()
    assert (traces["T [N*m]"].to_numpy() == run.T).all()
    with pytest.raises(InputError, match=r"^to_dataframe: <Vibration: .* has no rows"):
        natural_vibration(Chain.load("crane-4-mass")).to_dataframe()


def test_a_table_that_is_too_wide_goes_on_below_its_keys():
    """Each column is there once, beside the keys, which name the row."""
    cells = {key: [f"{key}-{i}" for i in range(3)] for key in ("gap", "J2", *"abcdefgh")}
    sheet = Sheet("title", tables=[TextTable.of("Gains", cells, keys=2)])
    text = as_html(sheet, width=200.0)
    blocks = re.findall(r"<table><caption>(.*?)</caption><thead><tr>(.*?)</tr>", text)
    headings = [re.findall(r">(\w+)</th>", row) for _, row in blocks]
    assert [title for title, _ in blocks] == ["Gains"] + ["Gains, continued"] * (len(blocks) - 1)
    assert all(row[:2] == ["gap", "J2"] for row in headings)
    assert [one for row in headings for one in row[2:]] == list("abcdefgh")
    assert as_html(sheet).count("<table>") == 1
    untitled = as_html(Sheet("title", tables=[TextTable.of("", cells, keys=2)]), width=200.0)
    assert set(re.findall(r"<caption>(.*?)</caption>", untitled)) <= {"", "continued"}
    assert "continued" in untitled
