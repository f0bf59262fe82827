"""The curve of the least K_dyn over the start time, and its saved state."""

import csv
import json
import math
from itertools import pairwise
from typing import Any

import pytest

from softstart import Drive, InputError, simulate
from softstart.controller import ready_controller_names
from softstart.optimal.front import ControllerPoint, FrontPoint, _monotone, default_start_times, pareto
from softstart.optimal.lp.rows import Limits
from softstart.optimal.problem import Problem
from softstart.optimal.shortest import shortest_start_time
from softstart.optimal.solving import optimize

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
TIMES = [0.33, 0.29, 0.31]


class StopError(Exception):
    """Ends a sweep from within its progress."""


def told(front):
    return [(point.start_time_bound, point.k_dyn, point.k_dyn_lower_bound) for point in front.points]


@pytest.fixture(scope="module")
def front():
    """Three points of the crane drive, and all controllers."""
    return pareto(CRANE, TIMES)


def test_each_point_is_the_optimum_of_its_start_time(front):
    assert [point.start_time_bound for point in front.points] == sorted(TIMES)
    for point in front.points:
        assert point.start_time <= point.start_time_bound
        assert point.k_dyn_lower_bound <= point.k_dyn * (1 + 1e-9)
        assert point.gap_percent == pytest.approx(100 * (point.k_dyn / point.k_dyn_lower_bound - 1))
        assert point.contacts == 1
    alone = optimize(CRANE, TIMES[0], terminal="reached")
    assert front.points[-1].k_dyn == pytest.approx(alone.k_dyn, rel=1e-6)
    k = [point.k_dyn for point in front.points]
    assert k == sorted(k, reverse=True)


def test_a_start_that_arrives_early_counts_for_every_longer_time() -> None:
    """By construction K_dyn never rises with the time allowed, nor does its bound."""

    def point(t: float, k_dyn: float | None, bound: float) -> FrontPoint:
        if k_dyn is None:
            return FrontPoint(t, "reached", "NOT_FOUND", "the method failed")
        return FrontPoint(t, "reached", "OPTIMAL", "", k_dyn, bound, f"of {t}", start_time=t, time=(0.0, t))

    found = {
        ("reached", one.start_time_bound): one
        for one in (
            FrontPoint(0.1, "reached", "INFEASIBLE", ""),
            point(0.2, 3.0, 2.5),
            point(0.3, 3.5, 2.6),
            point(0.4, None, 0.0),
            point(0.5, 2.8, 2.4),
            point(0.6, 2.9, 2.0),
        )
    }
    made = dict(_monotone(found, "reached", sorted((t for _, t in found), reverse=True)))
    points = [made[t] for t in sorted(made)]
    assert [p.k_dyn for p in points] == [None, 3.0, 3.0, 3.0, 2.8, 2.8]
    assert [p.k_dyn_lower_bound for p in points[1:]] == [2.6, 2.6, 2.4, 2.4, 2.0]
    assert [p.start_time for p in points[1:]] == [0.2, 0.2, 0.2, 0.5, 0.5]
    assert points[0] is found["reached", 0.1]
    assert points[2].why == "the start for 0.2 s is gentler, and may arrive early"
    assert points[3].status == "OPTIMAL"
    assert all(p.k_dyn >= p.k_dyn_lower_bound for p in points[1:])


def test_controllers_are_judged_at_their_own_start_time(front):
    assert [one.name for one in front.controllers] == list(ready_controller_names())
    for one in front.controllers:
        run = simulate(CRANE, one.name)
        assert (one.k_dyn, one.start_time) == (run.k_dyn, run.start_time)
        assert (one.optimum.terminal, one.optimum.start_time_bound) == ("reached", run.start_time)
    ramp = next(one for one in front.controllers if one.name == "ramp")
    least = optimize(CRANE, ramp.start_time, terminal="reached")
    assert ramp.ratio == pytest.approx(ramp.k_dyn / least.k_dyn, rel=1e-6)
    assert ramp.ratio > 1.0


def test_no_controller_beats_the_lower_bound(front):
    judged = [one for one in front.controllers if one.ratio is not None]
    assert len(judged) >= 4
    for one in judged:
        if one.optimum.bound_kind == "momentum" or simulate(CRANE, one.name).contacts == 1:
            assert one.k_dyn >= one.optimum.k_dyn_lower_bound


def test_a_controller_quicker_than_any_single_contact_has_no_optimum(front):
    direct = next(one for one in front.controllers if one.name == "direct")
    assert simulate(CRANE, "direct").contacts > 1
    assert direct.optimum.status == "INFEASIBLE"
    assert direct.start_time < front.shortest_start_time < min(point.start_time for point in front.points)


def test_start_times_that_are_too_short_are_marked():
    front = pareto(CRANE, [0.2, 0.1, 0.3], terminal="synchronous", controllers=[])
    short = front.points[:2]
    assert [point.status for point in front.points] == ["INFEASIBLE", "INFEASIBLE", "OPTIMAL"]
    shortest = shortest_start_time(Problem(CRANE, minimise="start_time"))
    for point in short:
        assert point.shortest_start_time == pytest.approx(shortest, rel=1e-3)
        assert point.k_dyn is None
        assert f"{point.shortest_start_time:.6g}" in point.status_text
        assert f"{point.start_time_bound:g} s" in point.status_text
    assert front.shortest_start_time == short[0].shortest_start_time


def test_a_sweep_that_was_stopped_goes_on_where_it_was(tmp_path, front):
    kept = tmp_path / "deep" / "front.jsonl"
    asked = []

    def stops(doing):
        asked.append(doing)
        if len(asked) == 3:
            raise StopError

    options = {"controllers": [], "save_to": kept}
    with pytest.raises(StopError):
        pareto(CRANE, TIMES, **options, progress=stops)
    assert len(kept.read_text("utf-8").splitlines()) == 3  # what was asked, and two points
    before = [json.loads(line) for line in kept.read_text("utf-8").splitlines()[1:]]

    again = []
    second = pareto(CRANE, TIMES, **options, progress=again.append)
    assert len(again) == 1
    assert "0.29 s" in again[0]
    by_time = {point.start_time_bound: point for point in second.points}
    for record in before:
        assert record.pop("sha256")
        assert by_time[record["start_time_bound"]] == FrontPoint.of_record(record)  # its computing time too

    pareto(CRANE, TIMES, **options, progress=again.append)
    assert len(again) == 1
    pareto(CRANE, [0.33, 0.3], **options, progress=again.append)  # further start times join the file
    assert len(again) == 2
    for kept_point, fresh in zip(told(second), told(front), strict=True):
        assert kept_point == pytest.approx(fresh, rel=1e-6)


@pytest.fixture(scope="module")
def kept_point(tmp_path_factory):
    """What is saved of a front of one point."""
    path = tmp_path_factory.mktemp("kept") / "front.jsonl"
    pareto(CRANE, [0.32], controllers=[], save_to=path)
    return path.read_bytes()


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"drive": CRANE.replace(gap=0.6)}, "drive"),
        ({"terminal": "steady"}, "terminal"),
        ({"method": "lp"}, "method"),
        ({"smoothness": 1e-4}, "smoothness"),
        ({"base": CRANE}, "base drive"),
    ],
)
def test_points_of_other_inputs_are_refused_and_kept(tmp_path, kept_point, change, names):
    kept = tmp_path / "front.jsonl"
    kept.write_bytes(kept_point)
    options = {"drive": CRANE, "controllers": [], "save_to": kept}
    before = kept.read_bytes()
    with pytest.raises(InputError, match=f"holds a limit curve with another {names}; ") as refused:
        pareto(start_times=[0.32], **options | change)
    assert len(refused.value.sentences) == 1
    assert kept.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("not json\n", "this file holds something else than a limit curve; name another file"),
        ("[1]\n", "this file holds something else than a limit curve; name another file"),
        ('{"k_dyn": 1}\n', "this file holds something else than a limit curve; name another file"),
        ('{"inputs": {}, "key": ""}\n{"a": 1}\n', "no checksum or a wrong one: this file was damaged"),
    ],
)
def test_a_file_that_holds_something_else_is_refused(tmp_path, text, says):
    (tmp_path / "notes").write_text(text)
    with pytest.raises(InputError, match=says):
        pareto(CRANE, [0.3], controllers=[], save_to=tmp_path / "notes")
    assert (tmp_path / "notes").read_text() == text
    assert [path.name for path in tmp_path.iterdir()] == ["notes"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"start_times": []}, "the list is empty"),
        ({"start_times": [0.3, -1.0, math.nan]}, "start_times = -1.0"),
        ({"start_times": [True]}, "start_times = True"),
        ({"terminal": "stedy"}, "terminal = 'stedy'"),
        ({"method": "guess"}, "method"),
        ({"controllers": ["dirct"]}, "did you mean"),
        ({"drive": "crane-4amtkf"}, "give a Drive"),
    ],
)
def test_bad_input(options, says):
    with pytest.raises(InputError, match=says):
        pareto(**{"drive": CRANE, "start_times": [0.3], "controllers": []} | options)


def test_table(tmp_path, front):
    front.to_csv(tmp_path / "front.csv")
    with (tmp_path / "front.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["what"] for row in rows] == ["optimum"] * 3 + [one.name for one in front.controllers]
    assert [row["status"] for row in rows[:3]] == ["OPTIMAL"] * 3
    assert [float(row["k_dyn"]) for row in rows[:3]] == [point.k_dyn for point in front.points]
    for row, one in zip(rows[3:], front.controllers, strict=True):
        assert row["ratio"] == ("" if one.ratio is None else repr(one.ratio))
    assert json.dumps(front.summary())


def test_default_start_times():
    times = default_start_times(CRANE, "synchronous")
    shortest = shortest_start_time(Problem(CRANE, minimise="start_time"))
    assert times[0] == pytest.approx(1.02 * shortest)
    assert times[-1] == pytest.approx(1.6 * simulate(CRANE, "direct").start_time)
    assert len(times) == 12
    assert times == sorted(times)
    unknown = default_start_times(CRANE.replace(start_position="unknown"))
    assert len(unknown) == 6


def test_a_controller_that_never_starts_has_no_ratio():
    one = ControllerPoint("weak", 0.5, math.nan, "not reached", None)
    assert one.ratio is None
    assert one.summary()["optimum_status"] is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drive", "most"),
    [(CRANE.replace(torque_lag=0.005, damping=1.0), 14.0), (Drive.load("nordin-servo-60kw"), 7.0)],
    ids=["lag", "servo"],
)
def test_a_front_of_20_points_takes_few_programs(
    drive: Drive, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Points share answers and proofs: 20 of them need less than 20 times the variables solved for one."""
    solved, numbers = Limits.solved, [0]

    def counted(self: Limits, *given: Any, **options: Any) -> Any:
        numbers[0] += self.cost.size
        return solved(self, *given, **options)

    monkeypatch.setattr(Limits, "solved", counted)
    times = default_start_times(drive, "reached", 20)
    numbers[0] = 0
    front = pareto(drive, times, controllers=[])
    of_front, numbers[0] = numbers[0], 0
    one = pareto(drive, times[10:11], controllers=[]).points[0]
    assert of_front < most * numbers[0]
    assert all(point.found for point in front.points)
    again = front.points[10]
    assert again.k_dyn == pytest.approx(one.k_dyn, rel=3e-4)
    k_dyn = [point.k_dyn or math.inf for point in front.points]
    assert all(b <= a for a, b in pairwise(k_dyn))
    for point in front.points:
        assert point.k_dyn_lower_bound is not None
        assert point.k_dyn is not None
        assert point.k_dyn_lower_bound <= point.k_dyn * (1.0 + 1e-9)
    assert (again.gap_percent or 0.0) < 1.5 * (one.gap_percent or 0.0) + 0.1
