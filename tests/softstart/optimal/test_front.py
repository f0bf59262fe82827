"""The curve of the least K_dyn over the start time, and its saved state."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from tests.kept import parts_in
from tests.softstart.optimal.drives import CRANE, QUICK

from softstart import InputError, optimize, simulate
from softstart.controller import ready_controller_names
from softstart.optimal.front import (
    ControllerPoint,
    Front,
    FrontPoint,
    _monotone,
    pareto,
)

TIMES = [0.33, 0.29, 0.31]


class StopError(Exception):
    """Ends a sweep from within its progress."""


@pytest.fixture(scope="module")
def front() -> Front:
    """Three points of the crane drive, and all controllers."""
    return pareto(CRANE, TIMES)


def test_each_point_is_the_optimum_of_its_start_time(front: Front) -> None:
    assert [point.start_time_bound for point in front.points] == sorted(TIMES)
    for point in front.points:
        assert point.start_time is not None
        assert point.k_dyn is not None
        assert point.k_dyn_lower_bound is not None
        assert point.start_time <= point.start_time_bound
        assert point.k_dyn_lower_bound <= point.k_dyn * (1 + 1e-9)
        assert point.optimality_gap_percent == pytest.approx(
            100 * (point.k_dyn / point.k_dyn_lower_bound - 1)
        )
        assert point.contacts == 1
        alone = optimize(CRANE, point.start_time_bound, terminal="reached")
        assert point.k_dyn == pytest.approx(alone.k_dyn, rel=1e-6)
    k_dyn = [point.k_dyn for point in front.points]
    assert k_dyn == sorted(k_dyn, reverse=True)  # type: ignore[type-var]


def test_a_start_that_arrives_early_counts_for_every_longer_time() -> None:
    """K_dyn never rises with the time allowed; each keeps the bound of its own time."""

    def point(t: float, k_dyn: float | None, bound: float) -> FrontPoint:
        if k_dyn is None:
            return FrontPoint(t, "reached", "NOT_FOUND", "the method failed")
        return FrontPoint(t, "reached", "OPTIMAL", "", k_dyn, bound, f"of {t}", start_time=t, time=(0.0, t))

    found = [
        FrontPoint(0.1, "reached", "INFEASIBLE", ""),
        point(0.2, 3.0, 2.5),
        point(0.3, 3.5, 2.6),
        point(0.4, None, 0.0),
        point(0.5, 2.8, 2.4),
        point(0.6, 2.9, 2.0),
    ]
    points = list(_monotone(found))
    assert [p.k_dyn for p in points] == [None, 3.0, 3.0, 3.0, 2.8, 2.8]
    assert [p.k_dyn_lower_bound for p in points[1:]] == [2.5, 2.6, None, 2.4, 2.0]
    assert [p.start_time for p in points[1:]] == [0.2, 0.2, 0.2, 0.5, 0.5]
    assert all((p.k_dyn or 0.0) >= (p.k_dyn_lower_bound or 0.0) for p in points[1:])


def test_controllers_are_judged_at_their_own_start_time(front: Front) -> None:
    assert [one.name for one in front.controllers] == list(ready_controller_names())
    judged = 0
    for one in front.controllers:
        run = simulate(CRANE, one.name)
        assert (one.k_dyn, one.start_time) == (run.k_dyn, run.start_time)
        assert one.optimum is not None
        assert (one.optimum.terminal, one.optimum.start_time_bound) == ("reached", run.start_time)
        if one.ratio is not None:
            judged += 1
            assert one.ratio >= 1.0 - 1e-4
            assert one.k_dyn >= (one.optimum.k_dyn_lower_bound or 0.0)
            assert one.ratio == pytest.approx(one.k_dyn / (one.optimum.k_dyn or math.nan))
    assert judged >= 4


def beside(name: str, k_dyn: float, start_time: float, least: float) -> ControllerPoint:
    point = FrontPoint(start_time, "reached", "OPTIMAL", "", k_dyn=least)
    return ControllerPoint(name, k_dyn, start_time, "", point)


def test_a_controller_as_quick_as_any_start_is_not_the_best_of_all() -> None:
    """Where direct has the shortest start time its ratio is 1 however hard it starts.

    Figures of conveyor-11kw and crane-4amtkf; what takes more than twice the time is no match either.
    """
    direct = beside("direct", 1.655, 0.8715, 1.655)
    hold, late = beside("pulse-coast-hold", 0.983, 0.9079, 0.974), beside("late", 0.3, 1.8, 0.2)
    steep = beside("reduced-first-stage", 2.387, 0.8717, 2.343)
    assert [one.ratio for one in (direct, hold)] == [1.0, pytest.approx(1.009, abs=1e-3)]
    for named, some in ((hold, (direct, steep, late, hold)), (direct, (direct,)), (steep, (steep,))):
        front = Front(CRANE, "reached", (), some)
        assert front.gentlest is named
    some = (direct, steep, late, hold, ControllerPoint("no start", 0.1, math.nan, "", None))
    curve = (FrontPoint(0.9, "reached", "OPTIMAL", "", k_dyn=0.98),)
    _, sentence = Front(CRANE, "reached", curve, some).conclusions
    assert sentence.endswith(": pulse-coast-hold, 0.983 in 0.9079 s; optimum at that time: 0.974.")
    assert Front(CRANE, "reached", (), some[-1:]).gentlest is None


def test_start_times_that_are_too_short_are_marked() -> None:
    front = pareto(QUICK, [0.06, 0.05, 0.1], controllers=[])
    assert [point.status for point in front.points] == ["INFEASIBLE", "INFEASIBLE", "OPTIMAL"]
    for point in front.points[:2]:
        assert point.shortest_start_time == pytest.approx(simulate(QUICK, "direct").start_time, rel=1e-3)
        assert point.k_dyn is None
        assert f"{point.shortest_start_time:.6g}" in point.status_text
        assert f"{point.start_time_bound:g} s" in point.status_text
    assert front.shortest_start_time == front.points[0].shortest_start_time


def test_a_sweep_that_was_stopped_goes_on_where_it_was(tmp_path: Path, front: Front) -> None:
    kept = tmp_path / "deep" / "front.sqlite"
    asked: list[str] = []

    def stops(doing: str) -> None:
        asked.append(doing)
        if len(asked) == 3:
            raise StopError

    options: dict[str, Any] = {"controllers": [], "save_to": kept}
    with pytest.raises(StopError):
        pareto(CRANE, TIMES, **options, progress=stops)
    before = parts_in(kept)
    assert len(before) == 2

    again: list[str] = []
    second = pareto(CRANE, TIMES, **options, progress=again.append)
    assert len(again) == 1
    assert "0.29 s" in again[0]
    by_time = {point.start_time_bound: point for point in second.points}
    for record in before:
        assert by_time[record["start_time_bound"]] == FrontPoint.of_record(record)  # its computing time too

    pareto(CRANE, [0.33, 0.3], **options, progress=again.append)  # further start times join the file
    assert len(again) == 2
    for kept_point, fresh in zip(second.points, front.points, strict=True):
        assert kept_point.k_dyn == pytest.approx(fresh.k_dyn, rel=1e-6)


@pytest.fixture(scope="module")
def kept_point(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What is saved of a front of one point."""
    path = tmp_path_factory.mktemp("kept") / "front.sqlite"
    pareto(CRANE, [0.32], controllers=[], save_to=path)
    return path.read_bytes()


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"drive": CRANE.replace(gap=0.6)}, "drive"),
        ({"terminal": "steady"}, "terminal"),
        ({"base": CRANE}, "base drive"),
    ],
)
def test_points_of_other_inputs_are_refused_and_kept(
    tmp_path: Path, kept_point: bytes, change: dict[str, Any], names: str
) -> None:
    kept = tmp_path / "front.sqlite"
    kept.write_bytes(kept_point)
    options: dict[str, Any] = {"drive": CRANE, "controllers": [], "save_to": kept}
    with pytest.raises(InputError, match=f"contains a Pareto curve with another {names}; ") as refused:
        pareto(start_times=[0.32], **options | change)
    assert len(refused.value.sentences) == 1
    assert kept.read_bytes() == kept_point


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"start_times": []}, "the list is empty"),
        ({"start_times": [0.3, -1.0, math.nan]}, "start_times = -1.0"),
        ({"controllers": ["dirct"]}, "did you mean"),
        ({"drive": 5}, "give one Drive"),
    ],
)
def test_bad_input(options: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        pareto(**{"drive": CRANE, "start_times": [0.3], "controllers": []} | options)


def test_start_times_if_none_are_given() -> None:
    """From hardly more than the shortest start, which is under constant torque where there is no gap."""
    direct = simulate(QUICK, "direct").start_time
    times = [point.start_time_bound for point in pareto(QUICK, controllers=[]).points]
    assert times[0] == pytest.approx(1.02 * direct, rel=1e-3)
    assert times[-1] == pytest.approx(1.6 * direct)
    shares = [(time - times[0]) / (times[-1] - times[0]) for time in times]
    assert shares == pytest.approx([(k / 11) ** 2 for k in range(12)])  # closer where the curve is steep
