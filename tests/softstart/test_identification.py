"""Identification: the model of a log, its covariances, the fit, what is unknown, what is refused, plans."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.stats import chi2
from tests.softstart.optimal.drives import random_unknown

from softstart import (
    Drive,
    Identification,
    InputError,
    Log,
    Run,
    compare,
    identify,
    plan_experiments,
    simulate,
)
from softstart.arrays import Vector
from softstart.controller import make_controller
from softstart.identification.fitting import ErrorScales, Fitter
from softstart.identification.model import FILTER, LogModel, filtered
from softstart.identification.planning import Experiment, VirtualTest, simulated_log, stepped_torque
from softstart.identification.unknowns import unknowns_of
from softstart.profile import TorqueProfile
from softstart.views.identification import estimates_table

TRUTH = Drive.load("crane-4amtkf").replace(
    damping=0.3,
    torque_lag=0.004,
    load_kind="reactive",
    gap=0.08,
    start_position="unknown",
    encoder_lines=1024,
)
GUESS = TRUTH.replace(
    gap=0.2, stiffness=200, load_inertia=0.4, motor_inertia=0.02, load_torque=12, damping=0.9
)
REVERSE = "two levels, then reverse"
NAMES = ("motor_inertia", "load_inertia", "stiffness", "gap", "damping", "load_torque", "torque_lag")


@pytest.fixture(scope="module")
def log() -> Log:
    return simulated_log(TRUTH, REVERSE, log_period=2e-3, ripple=1.0, seed=3)


def played(profile: TorqueProfile, position: float, until: float) -> Run:
    """A start of the true drive under this torque."""
    drive = TRUTH.replace(start_position=position, minimum_torque=-100.0, maximum_torque=100.0)
    return simulate(drive, make_controller("profile", {"profile": profile}), until=until)


def demanded(log: Log, torque: Vector | None = None) -> Run:
    """A start of the true drive under the demand of a log, or under another one at its instants."""
    held = log.torque if torque is None else torque
    profile = TorqueProfile(np.repeat(log.time, 2)[1:], np.repeat(held, 2)[:-1])
    return played(profile, -0.6 * 0.04, float(log.time[-1]))


# ---- the model ------------------------------------------------------------------------------------------


def test_the_model_is_the_plant_under_the_torque_of_the_log(log: Log) -> None:
    run = demanded(log)
    angle = run.at(log.time)["phi1"] - run.at([0.0])["phi1"]
    signal = LogModel.of(log, TRUTH.replace(start_position="mid-gap")).signals([{"position": -0.6}])[0]
    assert np.max(np.abs(signal - angle)) < 1e-12


def test_a_measured_torque_is_joined_by_lines() -> None:
    time = np.linspace(0.0, 0.3, 61)
    torque = 30.0 * np.sin(8.0 * time) ** 2 + 8.0
    free = TRUTH.replace(gap=200.0, start_position="mid-gap")  # the motor alone
    speed = LogModel.of(Log(time, torque, speed=time**1.5), free).signals([{}])[0]
    assert speed == pytest.approx(cumulative_trapezoid(torque, time, initial=0.0) / 0.035, rel=1e-12)


VISCOUS = {"motor_friction": 1.0, "motor_viscous_friction": 0.02, "load_viscous_friction": 0.02}


@pytest.mark.parametrize(
    ("kind", "changes", "values"),
    [
        ("demand", {}, {"computing_delay": 1.7e-3}),
        ("speed", {"torque_lag": 0.0}, {}),
        ("measured", {"contact_law": "dead-zone"}, {}),
        ("demand", {"contact_law": "modelica", "torque_rate": 2000.0}, {"gap": 0.02}),
        ("measured", {"damping": 0.0, "load_kind": "active"}, {}),
        ("demand", {"motor_friction": 5.0, "load_torque": 12.0}, {}),
        ("speed", VISCOUS, {}),
    ],
)
def test_responses_to_torque_errors_are_those_of_finite_differences(
    log: Log, changes: dict[str, Any], values: dict[str, float], kind: str
) -> None:
    """Across impacts, parting flanks, breakaway and stops of load and motor."""
    time = log.time[::3]
    signal: dict[str, Any] = {"speed" if kind == "speed" else "angle": time**2.1}
    blank = Log(time, log.torque[::3], torque_is="measured" if kind == "measured" else "demand", **signal)
    model = LogModel.of(blank, TRUTH.replace(**changes, start_position="mid-gap"))
    values = {"position": -0.6} | values | ({"speed_filter": 3e-3} if kind == "speed" else {})
    response = model.responses(values)
    differences = []
    for error in 1e-5 * np.eye(time.size):
        ahead, back = (model.signals([values], sign * error)[0] for sign in (1.0, -1.0))
        differences.append((ahead - back) / 2e-5)
    assert response == pytest.approx(np.array(differences).T, abs=1e-6 * float(np.max(np.abs(response))))


def fit_of(log: Log, drive: Drive, position: float, offset: float) -> tuple[Fitter, Vector]:
    """The fit of a log, and its numbers at the true drive."""
    unknowns = unknowns_of(NAMES, drive, [log], [True])
    own = {"position": position, "offset": offset}
    x = [one.number(own.get(one.name, float(getattr(drive, one.name, 0.0)))) for one in unknowns]
    return Fitter([LogModel.of(log, drive.replace(start_position="mid-gap"))], unknowns), np.array(x)


@pytest.mark.parametrize(("experiment", "lines"), [("start", 64.0), (REVERSE, 1024.0)])
def test_the_truth_is_as_likely_as_the_covariance_says(experiment: str, lines: float) -> None:
    """Of 16 logs of 4 ms: weighted squares, and what the best linear step takes off them, are chi-square."""
    drive = TRUTH.replace(encoder_lines=lines)
    squares, steps, sizes, numbers = [], [], [], []
    for seed in range(16):
        generator = np.random.default_rng([seed, 5])
        position, phase = generator.uniform(-1.0, 1.0), generator.uniform()
        log = simulated_log(
            drive, experiment, log_period=4e-3, ripple=1.0, position=position, phase=phase, seed=seed
        )
        fitter, x = fit_of(log, drive, position, (phase - 0.5) * log.count)
        point = fitter.linearized(x, (np.zeros(log.time.size),), ErrorScales(1.0, 1.0))
        point = fitter.with_derivatives(point, point)
        residual, jacobian = point.white
        covariance, pull = fitter.covariance(point), jacobian.T @ residual
        squares.append(residual @ residual)
        sizes.append(residual.size)
        steps.append(pull @ covariance @ pull)
        numbers.append(np.trace(covariance @ jacobian.T @ jacobian))
    assert 0.8 < np.sum(squares) / np.sum(sizes) < 1.1
    assert chi2.sf(np.sum(steps), np.sum(numbers)) > 1e-3
    assert np.sum(steps) > 0.6 * np.sum(numbers)


def test_a_filter_of_the_speed_is_exact_for_lines() -> None:
    time = np.linspace(0.0, 0.2, 101)
    lag = 0.013
    exact = 5.0 * (time - lag * (1.0 - np.exp(-time / lag)))
    assert filtered(time, 5.0 * time, lag) == pytest.approx(exact, abs=1e-12)
    uneven = np.sort(np.concatenate([time, time[1:-1] + 0.0007]))
    assert filtered(uneven, 5.0 * uneven, lag)[-1] == pytest.approx(exact[-1], abs=1e-12)


# ---- the fit --------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_other_units_of_torque_scale_what_they_must_and_nothing_else(log: Log) -> None:
    found, off = identify(log, GUESS, searches=3), 0.9
    low = identify(Log(log.time, off * log.torque, angle=log.values, torque_is="demand"), GUESS, searches=3)
    for name in NAMES:
        scale = 1.0 if name in ("gap", "torque_lag") else off
        assert low[name].value == pytest.approx(scale * found[name].value, rel=0.2 * found[name].half_width)
    strategies = ["direct", "s-curve", "pulse-coast-hold"]
    right = compare(found.drive, strategies)
    for row, other in zip(compare(low, strategies, worst_case=()).rows, right.rows, strict=True):
        lower, upper = row.intervals["k_dyn"]
        assert lower <= row.run.k_dyn <= upper
        assert row.run.k_dyn == pytest.approx(other.run.k_dyn, rel=0.02)


@pytest.mark.slow
def test_a_start_alone_leaves_the_gap_unknown_and_names_what_would_tell_it() -> None:
    start = simulated_log(TRUTH, "start", log_period=2e-3, ripple=1.0, seed=4)
    alone = identify(start, GUESS, searches=3)
    assert not alone["gap"].known
    assert alone["gap"].lower < 0.08 < alone["gap"].upper
    assert "position" in alone["gap"].reason
    assert any(note.startswith("Unknown: gap") and "softstart plan" in note for note in alone.notes)
    assert alone["motor_inertia"].known


@pytest.mark.slow
def test_friction_that_the_drive_has_not_is_named_and_one_option_finds_it() -> None:
    rubbed = simulated_log(
        TRUTH.replace(motor_friction=1.0), REVERSE, log_period=2e-3, ripple=1.0, seed=7, position=0.2
    )
    notes = identify(rubbed, TRUTH, searches=1).notes
    (note,) = [one for one in notes if "Coulomb friction of the motor" in one]
    assert "--free +motor.friction" in note
    size, error = (float(note.split(sign)[1].split()[0]) for sign in ("motor of ", "+- "))
    assert abs(size - 1.0) < 1.5 * error
    found = identify(rubbed, TRUTH, free=["+motor.friction"], searches=1)
    assert {one.name for one in found.shared} == {*NAMES, "motor_friction"}
    assert found["motor_friction"].known
    assert found["motor_friction"].lower < 1.0 < found["motor_friction"].upper
    assert len(found.notes) == 1  # nothing is left that the model has not


@pytest.mark.slow
def test_the_lift_and_the_friction_of_an_inclined_belt_are_told_apart_by_a_reversal() -> None:
    belt = Drive.load("crane-4amtkf").replace(
        load_kind="active", load_torque=8.0, load_friction=4.0, gap=0.08, damping=0.3, encoder_lines=1024,
        start_position="mid-gap",
    )  # fmt: skip
    there_and_back = Experiment(
        "", *stepped_torque(np.array([0.15, 0.15, 0.25]), np.array([40.0, 15.0, -30.0])), {}, 0.0, 0.0
    )
    log = simulated_log(belt, there_and_back, log_period=3e-3, ripple=1.0)
    notes = identify(log, belt.replace(load_friction=0.0, load_torque=12.0), searches=1).notes
    assert any("--free +load.friction" in note for note in notes)
    found = identify(log, belt.replace(load_friction=2.0, load_torque=12.0), searches=2)
    for name in ("load_torque", "load_friction", "gap", "load_inertia"):
        one = found[name]
        assert one.known, name
        assert abs(one.value - float(getattr(belt, name))) < one.upper - one.lower, name  # twice the interval


def test_the_ends_of_an_interval_are_where_the_log_is_less_likely(log: Log) -> None:
    """Against fits at fixed values from the best x: at each end L is larger by that of Student's t."""
    fitter, x = fit_of(log, TRUTH, -0.6, -float(log.values[0]))
    best = fitter.most_likely(x)
    best = fitter.with_likelihood(best, best)
    names = [one.name for one in fitter.unknowns]
    for i, sign in itertools.product((names.index("gap"), names.index("position")), (-1.0, 1.0)):
        half = float(fitter.half_widths(best)[i])
        x = best.x.copy()
        x[i] = fitter.end(i, sign, half, best, ())
        begin = fitter.linearized(x, best.errors, best.sizes)
        other = fitter.with_likelihood(fitter.minimized(begin, i, best), best)
        assert other.value - best.value == pytest.approx(fitter.threshold(best), rel=0.12)


@pytest.fixture(scope="module")
def coarse() -> Log:
    return simulated_log(TRUTH, REVERSE, log_period=4e-3, ripple=1.0, seed=3)


def test_where_another_machine_made_the_log_no_interval_is_stated(coarse: Log, tmp_path: Path) -> None:
    """One with a cogging torque."""
    states = demanded(coarse, coarse.torque - 8.0 * np.sin(5.0 * coarse.values)).at(coarse.time)
    angle = np.floor((states["phi1"] - states["phi1"][0]) / coarse.count + 0.3) * coarse.count
    found = identify(Log(coarse.time, coarse.torque, angle=angle, torque_is="demand"), TRUTH, searches=1)
    assert not found.stated
    assert any("Unmodelled effects are likely" in note for note in found.notes)
    assert any("without confidence intervals" in note for note in found.notes)
    assert not any(one.known for one in found.estimates)
    found.save(tmp_path)
    read = Identification.load(tmp_path)
    assert all(math.isnan(one.upper) for one in read.estimates)
    with pytest.raises(InputError, match="has no confidence intervals"):
        read.draws()


def test_an_interval_that_ends_with_the_search_is_not_known(coarse: Log) -> None:
    """The search goes to a twelfth of the guess, which is 0.2 % below the truth here."""
    guess = TRUTH.replace(motor_inertia=12.0 * 0.998 * TRUTH.motor_inertia)
    found = identify(coarse, guess, free=["motor_inertia", "position"], searches=1)
    assert found["motor_inertia"].value == pytest.approx(TRUTH.motor_inertia, rel=0.01)
    assert not found["motor_inertia"].known
    assert any("motor_inertia: at the limit of the search. Remedy: start" in note for note in found.notes)
    assert "at the limit of the search" in [cell for row in estimates_table(found).rows for cell in row]


def test_a_wrong_unit_of_speed_is_noticed(log: Log) -> None:
    rpm = demanded(log).at(log.time)["w1"] * 30.0 / math.pi
    bad = Log(log.time, log.torque, speed=rpm, torque_is="demand")
    assert any("check the units of the log" in note for note in identify(bad, TRUTH, searches=1).notes)


@pytest.mark.slow
def test_a_filtered_speed_is_named_or_found(log: Log) -> None:
    fine = np.linspace(0.0, float(log.time[-1]), 16 * (log.time.size - 1) + 1)
    behind = filtered(fine, demanded(log).at(fine)["w1"], 0.01)[::16]
    slow = Log(log.time, log.torque, speed=behind, torque_is="demand")
    notes = identify(slow, TRUTH, searches=1).notes
    assert any("not independent" in note for note in notes)
    with_filter = identify(slow, GUESS, free=[*NAMES, "position", FILTER], searches=3)
    assert with_filter[FILTER].value == pytest.approx(0.01, rel=0.02)
    assert with_filter["gap"].value == pytest.approx(0.08, rel=0.02)


# ---- logs -----------------------------------------------------------------------------------------------


def test_an_angle_may_wrap_and_lack_samples(log: Log) -> None:
    values = np.mod(log.values + 1.0, 2.0 * math.pi)
    values[50] = math.nan
    read = Log(log.time, log.torque, angle=values, torque_is="demand")
    assert "wraps" in " ".join(read.notes)
    kept = np.isfinite(read.values)
    assert np.flatnonzero(~kept).tolist() == [50]
    assert read.values[kept] - read.values[0] == pytest.approx(log.values[kept] - log.values[0], abs=1e-9)


def test_a_speed_of_encoder_differences_is_summed_to_the_angle(log: Log) -> None:
    speed = simulated_log(TRUTH, REVERSE, log_period=2e-3, ripple=1.0, seed=3, signal="speed")
    read = speed.integrated(float(TRUTH.encoder_lines))
    assert (speed.kind, read.kind) == ("speed", "angle")
    assert np.diff(read.values) == pytest.approx(np.diff(log.values), abs=1e-9)
    assert "integrated to the angle" in " ".join(read.notes)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda t, u, y: (t[::-1], u, y), "time does not rise"),
        (lambda t, u, y: (t, -u, y), "has the wrong sign"),
        (lambda t, u, y: (t[:10], u[:10], y[:10]), "10 samples; a fit needs 30 or more"),
        (lambda t, u, y: (t, u, 0.0 * y), "the angle never changes"),
        (lambda t, u, y: (t[100:], u[100:], y[100:]), "begin the log at standstill"),
        (lambda t, u, y: (np.where(t > 0.3, t + 1.0, t), u, y), "there is no sample from"),
        (lambda t, u, y: (t, np.where((t > 0.1) & (t < 0.11), math.nan, u), y), "cut the log there"),
    ],
)
def test_logs_that_cannot_be_used_are_refused(log: Log, change, sentence: str) -> None:
    time, torque, angle = change(log.time, log.torque, log.values)
    with pytest.raises(InputError, match=sentence):
        Log(time, torque, angle=angle, torque_is="demand")


@pytest.mark.parametrize(
    ("periods", "first", "refused"), [(19, 0.19, False), (21, 0.0, True), (1, 0.21, True)]
)
def test_holes_of_20_periods_and_a_fifth_of_the_speed_are_too_much(
    periods: int, first: float, refused: bool
) -> None:
    time = np.arange(200) * 1e-3
    time[100:] += (periods - 1) * 1e-3
    speed = 100.0 * np.maximum(time / time[-1], first)
    if not refused:
        assert Log(time, np.full(200, 40.0), speed=speed).time.size == 200
        return
    with pytest.raises(
        InputError, match="there is no sample from" if periods > 1 else "the motor turns at 21"
    ):
        Log(time, np.full(200, 40.0), speed=speed)


def test_what_cannot_be_found_is_refused(log: Log) -> None:
    demand, measured, slow = (
        Log(factor * log.time, log.torque, angle=log.values, torque_is=torque_is)  # type: ignore[arg-type]
        for factor, torque_is in ((1.0, "demand"), (1.0, "measured"), (1e3, "demand"))
    )
    for each, free, sentence in (
        (demand, ["gpa"], "did you mean gap"),
        (demand, ["position"], "nothing to identify"),
        (demand, [FILTER, "gap"], "an angle has no speed filter"),
        (measured, ["gap", "torque_lag"], "log the demand"),
        (slow, None, "check the units"),
    ):
        with pytest.raises(InputError, match=sentence):
            identify(each, TRUTH, free=free)


# ---- plans ----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_planned_torque_tells_no_less_and_keeps_its_limits() -> None:
    planned = plan_experiments(TRUTH.replace(permissible_torque=70.0), log_period="8 ms", ripple=1.0)
    one = planned["planned"]
    allowed = [other for other in planned.experiments[:-1] if other.peak <= 70.0]
    assert one.score < min(other.score for other in allowed)
    peaks = [played(one.profile, 0.04 * place, one.end).peak_torque for place in np.linspace(-1.0, 1.0, 257)]
    assert 0.999 * one.peak <= max(peaks) <= one.peak <= 70.0
    assert np.max(np.abs(one.profile.torque)) <= TRUTH.starting_torque
    assert any(one.end == pytest.approx(other.end, rel=1e-12) for other in planned.experiments[:-1])


def test_peak_and_travel_are_those_of_the_worst_position() -> None:
    """Torques under which a contact that is only just made has a peak a thousandth of the gap wide."""
    drive = random_unknown(7).replace(load_kind="reactive", load_torque=2.0)
    bench = VirtualTest(drive, 1e-3, 1.0, NAMES[:5])
    generator = np.random.default_rng(9)
    durations = np.full(11, 0.8 * float(drive.elastic_period))
    played = stepped_torque(durations, generator.uniform(-1.0, 1.0, 11) * float(drive.Ms))
    places = np.concatenate([np.linspace(-1.0, 1.0, 1501), generator.uniform(-1.0, 1.0, 500)])
    found, coarse = (
        bench.peaks_and_travels(*played, places),
        bench.peaks_and_travels(*played, np.linspace(-1.0, 1.0, 65)),
    )
    most = bench.worst_peak_and_travel(*played)
    for i in range(len(most)):
        assert 0.998 * most[i] <= found[i].max() <= (1.0 + 1e-9) * most[i]
    assert max(1.0 - float(coarse[i].max()) / most[i] for i in range(len(most))) > 0.005  # of an even grid


def test_peak_and_travel_are_those_of_a_simulation() -> None:
    profile, end = stepped_torque(np.full(4, 0.1), np.array([30.0, -20.0, -40.0, 25.0]))
    run = played(profile, 0.0, end)
    angles = run.at(np.linspace(0.0, end, 20001))["phi2"]
    peak, travel, _ = VirtualTest(TRUTH, 1e-3, 1.0, NAMES).peaks_and_travels(profile, end, np.zeros(1))
    assert peak[0] == pytest.approx(run.peak_torque, rel=1e-12)
    assert travel[0] == pytest.approx(np.max(np.abs(angles - angles[0])), rel=1e-4)


def test_bounds_of_a_plan_at_the_output(monkeypatch: pytest.MonkeyPatch) -> None:
    """20 turns of the motor for one of the output; a permissible torque goes with losses as any other."""
    bounds = {}
    monkeypatch.setattr(VirtualTest, "experiment", lambda *_: SimpleNamespace(peak=1.0))
    monkeypatch.setattr(VirtualTest, "optimised", lambda self, standard, *most: bounds.update(most=most))
    geared = TRUTH.replace(gear_ratio=20.0, gear_efficiency=0.8)
    plan_experiments(geared, max_torque="1.6 kN*m at output", max_travel="0.5 turn at output")
    assert bounds["most"] == pytest.approx((1600.0 / 20.0 / 0.8, 20.0 * math.pi), rel=1e-14)
    plan_experiments(geared, max_torque="80 N*m", max_travel="10 turn")
    assert bounds["most"] == pytest.approx((80.0, 20.0 * math.pi), rel=1e-14)
    for name, value in (("max_torque", "1.6 kN*m at output"), ("max_travel", "1 turn at output")):
        with pytest.raises(InputError, match=re.escape(f'{name} = "{value}": without gear.ratio')):
            plan_experiments(TRUTH, **{name: value})
    with pytest.raises(InputError, match=r"max_travel = -1\.0: give a value above 0"):
        plan_experiments(TRUTH, max_travel="-1 rad")


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"wanted": ["gpa"]}, "did you mean gap"),
        ({"free": ["gap", "motor.friction"]}, "it is 0 in the drive; give a guess of it"),
        pytest.param({"max_torque": "0.01 N*m"}, "raise the limit", marks=pytest.mark.slow),
    ],
)
def test_plans_that_cannot_be_are_refused(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        plan_experiments(TRUTH, log_period="8 ms", **given)
