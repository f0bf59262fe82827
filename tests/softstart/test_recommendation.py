"""Settled times, flags, limits and the one recommendation of compare, page and report."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from softstart import Command, Drive, InputError, PlainController, compare, simulate
from softstart.controller import Effort
from softstart.controller.finding import ready_controller_names
from softstart.drive import library
from softstart.start import metrics
from softstart.start.fatigue import fatigue
from softstart.start.recommendation import _pareto_set, flags

CRANE = Drive.load("crane-4amtkf")
HOIST = Drive.load("hoist-15kw")
POSITIONS = ("mid-gap", "driving-flank", "opposite-flank")


def test_settled_agrees_with_a_dense_search_on_random_drives():
    rng = np.random.default_rng(14)
    later = 0
    for _ in range(30):
        drive = CRANE.replace(
            load_inertia=CRANE.J1 * 10.0 ** rng.uniform(-0.3, 1.0), gap=rng.uniform(0.02, 2.0),
            load_torque=rng.uniform(0.0, 40.0), target_speed=rng.uniform(20.0, 90.0),
            damping=rng.choice([0.0, 0.2]), start_position=str(rng.choice(POSITIONS)),
        )  # fmt: skip
        run = simulate(drive, str(rng.choice(["direct", "s-curve", "reduced-first-stage"])))
        long = simulate(drive, run.controller, until=run.settling_end)
        times = np.linspace(run.start_time, run.settling_end, 20_001)
        step = times[1] - times[0]
        low = np.flatnonzero(long.at(times.clip(0.0, long.end_time))["w2"]
                             < (1.0 - metrics.SETTLED_BAND) * drive.target_speed)  # fmt: skip
        if low.size and low[-1] == times.size - 1:
            assert math.isnan(run.settled_time)
            continue
        dense = times[low[-1]] if low.size else run.start_time
        assert dense - 1e-9 <= run.settled_time <= dense + step + 1e-9
        later += run.settled_time > run.start_time
    assert later >= 2


def test_no_shipped_strategy_is_slow_on_a_shipped_drive_without_a_flag():
    for name in library.names():
        drive = Drive.load(name)
        hangs = drive.load_kind == "active" and drive.Mc != 0.0
        for position in ("mid-gap", "unknown", *(["hanging"] if hangs else [])):
            started = drive.replace(start_position=position)
            direct = simulate(started, "direct")
            assert not flags(direct, direct)
            for one in ready_controller_names():
                run = simulate(started, one)
                words = {flag.word.split()[0] for flag in flags(run, direct)}
                slow = run.settled_time > 2.0 * direct.settled_time
                assert slow == ("slow" in words), (name, position, one)
                assert (run.k_dyn > 1.001 * direct.k_dyn) == ("K_dyn" in words)
                assert not math.isnan(run.settled_time)


def test_thresholds_of_flags_and_of_what_another_strategy_beats():
    """Slow beyond twice the time of direct; harder by 0.1 %; no gain below 0.1 %; as quick within 1e-4."""

    def run(k_dyn, settled_time=1.0):
        return SimpleNamespace(k_dyn=k_dyn, settled_time=settled_time, start_time=1.0, drive=CRANE)

    for found, word in ((run(1.0009), ""), (run(1.0011), "K_dyn"), (run(1.0, 1.999), ""),
                        (run(1.0, 2.001), "slow")):  # fmt: skip
        assert [one.word.split()[0] for one in flags(found, run(1.0))] == [word] * bool(word)
    direct = SimpleNamespace(run=run(2.0), effort=Effort.CONTACTOR)
    for k, time, names in (
        (1.9981, 1.5, "d"),
        (1.9979, 1.5, "dr"),
        (1.0, 1.00011, "dr"),
        (1.0, 1.00009, "r"),
    ):
        other = SimpleNamespace(run=run(k, time), effort=Effort.RAMPS)
        best = _pareto_set([other, direct])
        assert "".join("d" if one is direct else "r" for one in best) == names


def test_flagged_strategies_are_never_recommended():
    """A torque that swings with the shaft is harder than direct."""

    class Swinging(PlainController):
        name = "swinging"

        def step(self, measured, state):
            n = round(2.0 * measured.time / HOIST.elastic_period)
            return Command(250.0 if n % 2 == 0 else 100.0, 0.5 * (n + 1) * HOIST.elastic_period)

    found = compare(HOIST, ["direct", "s-curve", Swinging()])
    flagged = {row.name: row.flags for row in found.rows if row.flags}
    assert any("K_dyn" in flag.word for flag in flagged["swinging"])
    assert not {row.name for row in found.recommendation.best} & set(flagged)


def test_without_limits_no_other_strategy_beats_those_that_are_named():
    for drive in (CRANE, HOIST, Drive.load("crane-4amtkf-light-worn")):
        found = compare(drive)
        best = found.recommendation.best
        assert found.recommendation.recommended is None
        for row in found.rows:
            if row.flags or row.effort is Effort.SENSOR:
                assert row not in best
                continue
            for other in best:
                better = row.run.k_dyn < 0.999 * other.run.k_dyn
                assert not (better and row.run.settled_time < other.run.settled_time)
            assert row in best or any(
                other.run.k_dyn <= row.run.k_dyn / 0.999
                and other.run.settled_time <= row.run.settled_time * 1.0001
                for other in best
            )
        for row in best:
            assert f"{row.name}, " in found.recommendation.text
    first, second = best[0].run, best[1].run
    change, longer = second.k_dyn - first.k_dyn, 1e3 * (second.settled_time - first.settled_time)
    assert f"({change:+.3f} K_dyn for {longer:+.3g} ms)" in found.recommendation.text


def test_with_limits_the_simplest_that_keeps_them_in_the_worst_case():
    drive = CRANE.replace(permissible_torque=180.0, permissible_start_time=0.6)
    found = compare(drive)
    chosen = found.recommendation.recommended
    # the simplest as it is; simpler still is an S-curve that is set for these limits
    as_it_is = next(row for row in found.rows if row.name == "speed-ramp")
    assert chosen.name == "s-curve"
    for row in (as_it_is, chosen):
        worn = simulate(CRANE.with_gap(2.0), row.controller, fitted_to=CRANE, base=CRANE)
        torque, time = row.margins(drive.limits)
        assert (torque.case, torque.value) == ("gap x4", worn.peak_torque)
        assert torque.share == pytest.approx(1.0 - worn.peak_torque / 180.0)
        assert torque.kept
        assert time.kept
        assert bool(row.setting) == (row is chosen)
    for row in found.rows:
        if row.effort.order < chosen.effort.order:
            assert any(not one.kept for one in row.margins(drive.limits))
            assert f"{row.name}, " in found.recommendation.text.partition("Simpler ones do not")[2]
    # the drive as it is asks for less
    new = compare(drive, worst_case=())
    assert new.recommendation.recommended.name == "direct"
    assert all(one.case == "" for row in new.rows for one in row.margins(drive.limits))
    with pytest.raises(InputError, match=r'there are "gap x4" and "J2 x0\.4"'):
        compare(drive, ["direct"], worst_case=["gap"])


def test_limits_that_nothing_keeps():
    found = compare(CRANE.replace(permissible_torque=20.0), ["direct", "shaped"])
    assert found.recommendation.recommended is None
    assert found.recommendation.text.startswith(
        "No strategy keeps the limits. Nearest: shaped, shaft torque "
    )
    assert found.recommendation.shown == ()


def test_a_limit_that_decides_nothing_is_doubted_where_it_decides():
    """The permissible torque of the output taken for that of the motor shaft: every start keeps it."""
    crane = Drive.load("crane-4amtkf")
    for torque, doubted in ((9.9, False), (10.1, True)):
        table = compare(crane.replace(permissible_torque=torque * crane.starting_torque), ["direct"])
        assert table.recommendation.recommended.name == "direct"
        assert ("check it before you rely on this" in table.recommendation.text) == doubted


def test_the_life_is_a_limit_like_the_others():
    """Hours of operation times starts per hour, over the starts to failure, in the worst case."""
    aged = HOIST.replace(
        starts_per_hour=60.0, required_life="20000 h", fatigue_slope=6.6, fatigue_torque=90.0,
        fatigue_cycles=2e6,
    )  # fmt: skip
    found = compare(aged, ["direct", "shaped", "s-curve"], worst_case=())
    lives = fatigue([row.run for row in found.rows])
    for row, life in zip(found.rows, lives.rows, strict=True):
        (margin,) = row.margins(aged.limits)
        assert margin.value == pytest.approx(100.0 * 60.0 * 20000.0 / life.starts, rel=1e-12)
        assert margin.kept == (life.hours >= 20000.0)
    assert found.recommendation.recommended.name == "direct"
    # an undamped shaft has no life that means anything: that is said, and decides nothing
    undamped = compare(aged.replace(damping=0.0), ["direct", "s-curve"])
    assert undamped.recommendation.recommended is None
    assert "The life is not checked: without damping" in undamped.recommendation.text
