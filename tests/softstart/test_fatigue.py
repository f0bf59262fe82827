"""Life of the shaft line: rainflow after ASTM E1049, located turning points, damage, impacts, wear."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from tests.softstart.kernel.test_against_oracle import case, run_of

from softstart import Drive, InputError, Run, fatigue, simulate
from softstart.drive import SNCurve
from softstart.start.fatigue import (
    damage_of,
    damped,
    impacts,
    rainflow_cycles,
    torque_turning_points,
    worst_damage,
)

CRANE = Drive.load("crane-4amtkf").replace(damping=1.0)
HOIST = Drive.load("hoist-15kw")
# the history of ASTM E1049, figures 6 and 7: A to I
HISTORY = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]


def counts(cycles: Any) -> dict[float, float]:
    found: dict[float, float] = {}
    for size, _, count in cycles.tolist():
        found[size] = found.get(size, 0.0) + count
    return found


def test_the_example_of_astm_e1049() -> None:
    """Figure 6: one pass. Figure 7: the history repeated, counted from D, its largest value, on."""
    assert counts(rainflow_cycles(HISTORY)) == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}
    assert counts(rainflow_cycles(HISTORY, repeated=True)) == {3.0: 1.0, 4.0: 1.0, 7.0: 1.0, 9.0: 1.0}


def test_a_curve_of_several_points_is_straight_in_logarithms_and_goes_on_beyond_them() -> None:
    curve = SNCurve(None, ((300.0, 1e3), (200.0, 1e4), (100.0, 1e6), (80.0, 5e7)))
    T, N = np.log([[80.0, 100.0, 200.0, 300.0], [5e7, 1e6, 1e4, 1e3]])
    first, last = (N[1] - N[0]) / (T[1] - T[0]), (N[3] - N[2]) / (T[3] - T[2])
    for torque in (60.0, 80.0, 90.0, 100.0, 150.0, 200.0, 250.0, 300.0, 400.0):
        x = math.log(torque)
        exact = float(np.interp(x, T, N)) + first * min(x - T[0], 0.0) + last * max(x - T[3], 0.0)
        assert float(curve.cycles(torque)) == pytest.approx(math.exp(exact), rel=1e-12)
        assert float(curve.torque(math.exp(exact))) == pytest.approx(torque, rel=1e-12)


def test_a_repeated_history_may_begin_anywhere() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        history = rng.normal(size=rng.integers(2, 30)).tolist()
        cycles = rainflow_cycles(history, repeated=True)
        assert set(cycles[:, 2]) <= {1.0}
        turn = int(rng.integers(len(history)))
        np.testing.assert_array_equal(rainflow_cycles(history[turn:] + history[:turn], repeated=True), cycles)
        assert cycles[0, 0] == max(history) - min(history)


def dense(run: Run, points: int) -> Any:
    """Reversals of T of a trace of so many points and of both sides of every event."""
    edges = np.concatenate([run.trajectory.spans[:, 0], np.nextafter(run.trajectory.spans[1:, 0], 0.0)])
    t = np.unique(np.concatenate([np.linspace(0.0, run.end_time, points), edges, [run.end_time]]))
    T = run.at(t)["T"]
    steps = np.diff(T)
    keep = np.flatnonzero(steps)
    turns = keep[1:][np.sign(steps[keep[1:]]) != np.sign(steps[keep[:-1]])]
    return T[np.concatenate([[0], turns, [T.size - 1]])]


@pytest.mark.parametrize("seed", [4, 14, 23, 119])  # the last one without a gap
def test_turning_points_are_those_of_a_dense_trace(seed: int) -> None:
    """Random drives, laws, lags and torques, damped; all cycles above a millionth of the largest."""
    drawn = case(seed)
    drawn["d"] = drawn["d"] or 0.05 * drawn["c"] / math.sqrt(
        drawn["c"] / drawn["J1"] + drawn["c"] / drawn["J2"]
    )
    run = run_of(drawn)
    points = torque_turning_points(run)
    sampled = rainflow_cycles(dense(run, 300_000))
    located = rainflow_cycles(points[:, 1])
    scale = located[0, 0]
    large = [one[one[:, 0] > 1e-6 * scale] for one in (located, sampled)]
    assert large[0].shape == large[1].shape
    np.testing.assert_allclose(large[0][:, 0], large[1][:, 0], atol=1e-7 * scale)
    assert np.abs(points[:, 1]).max() == pytest.approx(run.peak_torque, rel=1e-14)
    assert (np.diff(points[:, 0]) >= 0.0).all()
    rises = np.diff(points[:, 1])
    assert (rises[1:] * rises[:-1] < 0.0).all()


@pytest.mark.parametrize("slope", [3.0, 20.0])
def test_equivalent_torque_and_starts(slope: float) -> None:
    """One cycle of it does the damage of the start; Miner's sum written out."""
    drive = CRANE.replace(
        fatigue_slope=slope, fatigue_torque="90 N*m", fatigue_cycles=2e6, starts_per_hour=60,
        required_life="20000 h",
    )  # fmt: skip
    run = simulate(drive, "direct")
    (row,) = fatigue(run).rows
    ranges, _, number = rainflow_cycles(torque_turning_points(run)[:, 1], repeated=True).T
    damage = sum(n * (r / 90.0) ** slope / 2e6 for n, r in zip(number, ranges, strict=True))
    assert row.starts == pytest.approx(1.0 / damage, rel=1e-12)
    assert row.equivalent_torque == pytest.approx(90.0 * (2e6 * damage) ** (1.0 / slope), rel=1e-12)
    assert row.hours == pytest.approx(row.starts / 60.0)
    assert row.years == pytest.approx(row.hours / 8766.0)
    assert row.equivalent_torque >= ranges[0]


def test_a_steady_torque_does_no_damage() -> None:
    run = simulate(HOIST.replace(release=1.0), "direct", until=0.5)  # held by its brake all the time
    assert worst_damage(run, SNCurve(6.6)).damage == 0.0
    (row,) = fatigue(run).rows
    assert (row.relative, row.equivalent_torque, row.impacts) == (math.inf, 0.0, 0)


def test_energy_of_impacts_is_what_a_rigid_contact_loses() -> None:
    """Without rebound, stiffer and stiffer: all that the start dissipates is the energy of the impact."""
    errors = []
    for c in (1e6, 1e8, 1e10):
        stiff = CRANE.replace(stiffness=c, start_position="opposite-flank")
        run = simulate(stiff.replace(damping=float(2.0 * 20.0 * c / stiff.Omega)), "direct", until=0.04)
        assert run.contacts == 1
        errors.append(abs(impacts(run).sum() / run.energy.dissipated - 1.0))
    assert errors[-1] < 1e-8
    assert all(after < 0.02 * before for before, after in pairwise(errors))  # as the elastic energy, 1/c


def test_energy_of_the_first_impact_in_closed_form() -> None:
    """The motor crosses half the gap while the load falls: dw12^2 = 2 (Ms/J1 + Mc/J2) gap/2, [G](10)."""
    run = simulate(CRANE, "direct")
    square = (62.0 / 0.035 + 7.16 / 0.175) * 0.5
    inertia = 0.035 * 0.175 / 0.21
    assert impacts(run)[0] == pytest.approx(0.5 * inertia * square, rel=1e-12)
    assert run.impact_speed**2 == pytest.approx(square, rel=1e-12)
    held = CRANE.replace(brake="motor", release=1.0, start_position="mid-gap")
    falling = simulate(held, "direct", until=0.9)
    assert impacts(falling)[0] == pytest.approx(0.5 * 0.175 * falling.impact_speed**2, rel=1e-12)


def test_wear() -> None:
    """A start that never opens the gap lasts as long worn; else Miner's sum over a finer grid of gaps."""
    limits = {"fatigue_slope": 6.6, "fatigue_torque": 200, "fatigue_cycles": 2e6, "starts_per_hour": 60}
    hoist = HOIST.replace(**limits, required_life="20000 h")
    row = fatigue(simulate(hoist, "s-curve"), worn_gap="20 deg").rows[0]
    assert row.worn_hours == pytest.approx(row.hours, rel=1e-9)
    assert row.worn_relative == pytest.approx(row.relative, rel=1e-9)

    found = fatigue(simulate(CRANE, "s-curve"), worn_gap=2.0).rows[0]
    gaps = np.linspace(0.5, 2.0, 257)

    def mean(name: str) -> float:
        runs = [simulate(CRANE.with_gap(gap), name, fitted_to=CRANE) for gap in gaps.tolist()]
        d = np.array([damage_of(run, SNCurve(6.6)).damage for run in runs])
        return float(np.mean(0.5 * (d[1:] + d[:-1])))

    assert found.worn_relative == pytest.approx(mean("direct") / mean("s-curve"), rel=0.01)
    assert 0.0 < found.wear_error < 0.01


def test_an_unknown_position_counts_with_its_most_damaging_start() -> None:
    drive = CRANE.replace(load_kind="reactive", start_position="unknown")
    row = fatigue(simulate(drive, "s-curve")).rows[0]
    each = {
        name: damage_of(run, SNCurve(6.6)).damage
        for name, run in simulate(drive, "s-curve").positions.items()
    }
    assert row.run.position == max(each, key=lambda name: each[name])


def test_damping_is_estimated_only_where_there_is_none() -> None:
    plain = Drive.load("crane-4amtkf")
    found = fatigue(simulate(plain, "s-curve"), estimate_damping={"gears": 3, "couplings": 2})
    assert found.drive.damping_ratio == pytest.approx(0.04)
    lower, upper = found.rows[0].relative_range
    lives = (lower, found.rows[0].relative, upper)
    for factor, life in zip((0.5, 1.0, 2.0), lives, strict=True):
        other = damped(plain, {"gears": 3, "couplings": 2}, factor)
        assert other.damping_ratio == pytest.approx(0.04 * factor)
        assert fatigue(simulate(other, "s-curve")).rows[0].relative == pytest.approx(life, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "more", "said"),
    [
        ({}, {"estimate_damping": {"gears": 3}}, "each shaft has a damping of its own, 1 N m s/rad"),
        ({"damping": 0.0}, {"estimate_damping": {"teeth": 3}}, "numbers of gears and couplings"),
        ({}, {"worn_gap": 0.4}, "wear widens the gap"),
        ({}, {"slope": 0.0}, "the slope m of an S-N curve"),
        ({"fatigue_torque": [200.0, 100.0], "fatigue_cycles": [1e4, 1e6]}, {"slope": 5.0}, "leave out one"),
    ],
)
def test_bad_input_is_refused(change: dict[str, Any], more: dict[str, Any], said: str) -> None:
    run = simulate(CRANE.replace(**change), "direct")
    with pytest.raises(InputError, match=re.escape(said)):
        fatigue(run, **more)


def test_runs_of_several_drives_are_refused() -> None:
    with pytest.raises(InputError, match="different drives"):
        fatigue([simulate(CRANE, "direct"), simulate(HOIST, "direct")])
