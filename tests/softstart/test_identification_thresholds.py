"""Deviations, intervals and thresholds of identification, each against a calculation by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2
from scipy.stats import t as student
from tests.softstart.test_identification import REVERSE, TRUTH, fit_of

from softstart import InputError, Log
from softstart.arrays import Vector
from softstart.identification import solving
from softstart.identification.fitting import RIPPLE, ErrorScales, FitPoint, Fitter, LogLinearization
from softstart.identification.model import LogModel
from softstart.identification.planning import simulated_log
from softstart.identification.solving import (
    _check_inertia,
    _correlations,
    _effects,
    _scale_warning,
    _slow_torque,
    _whiteness,
    model_mismatch,
)
from softstart.identification.unknowns import Unknown, unknowns_of

PLACED = TRUTH.replace(start_position="mid-gap")


def gaussian(shape: tuple[int, ...], seed: int = 7) -> Vector:
    return np.random.default_rng(seed).standard_normal(shape)


# ---- a straight line, whose intervals are known ---------------------------------------------------------


def line(count: int, width: int, size: float) -> tuple[Fitter, FitPoint]:
    """Least squares with errors of one unknown size, as a fit whose V is the ripple squared.

    `largest_torque` is such that the size expected beforehand is the true one.
    """
    jacobian = 100.0 * gaussian((count, width))
    residual = gaussian((count,), 8)
    residual -= jacobian @ np.linalg.lstsq(jacobian, residual, rcond=None)[0]
    residual *= size * math.sqrt((count - width) / float(residual @ residual))
    spot = LogLinearization(np.zeros(count), residual, np.eye(count), np.ones(count), np.eye(count), jacobian)
    model: Any = SimpleNamespace(log=SimpleNamespace(torque=np.array([size / RIPPLE])))
    fitter = Fitter([model], [Unknown("gap", "power", 0.0, -9.0, 9.0)] * width)
    return fitter, FitPoint(np.zeros(width), ErrorScales(0.0, size), (spot,))


@pytest.mark.parametrize(("count", "width"), [(12, 3), (60, 5)])
def test_intervals_of_a_straight_line_are_those_of_student(count: int, width: int) -> None:
    """Half of each is t sqrt(s^2 (J'J)^-1), with s^2 and t of count - width degrees of freedom."""
    size = 0.7
    fitter, best = line(count, width, size)
    # what is known of the size beforehand, a factor of 3, is worth half a degree of freedom: 0.5/ln(3)^2
    freedom = count - width + 0.5 / math.log(3.0) ** 2
    quantile = float(student.ppf(0.975, freedom))
    expected = freedom * math.log1p(quantile**2 / freedom)
    assert fitter.threshold(best) == pytest.approx(expected, rel=2e-3)  # of second differences over 0.1
    # of three times that size: 1 for what is known beforehand, and ln V and squares of each degree
    more = fitter.restricted(best.spots, ErrorScales(0.0, 3.0 * size)) - fitter.restricted(
        best.spots, best.sizes
    )
    assert more == pytest.approx(1.0 + (count - width) * (2.0 * math.log(3.0) - 8.0 / 9.0), rel=1e-6)
    jacobian = best.spots[0].jacobian
    deviations = size * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    assert fitter.half_widths(best) == pytest.approx(
        quantile * deviations, rel=0.02
    )  # sizes in steps of 10 %
    assert np.sqrt(np.diag(fitter.covariance(best))) == pytest.approx(deviations, rel=1e-3)


def test_correlations_are_those_of_the_values() -> None:
    """Of v(x) to first order: D (J'V^-1 J + W)^-1 D, where a position falls as its number rises."""
    size, x = 0.7, np.array([0.9, 0.2, 0.6])
    fitter, best = line(12, 3, size)
    unknowns = [
        Unknown("gap", "power", 0.9, 0.0, 9.0, 0.3, power=0.5),
        Unknown("stiffness", "logarithm", 0.2, -9.0, 9.0),
        Unknown("position", "position", 0.6, 0.0, 1.0, log=0),
    ]  # fmt: skip
    # as little as the samples tell, what is known beforehand counts
    jacobian = best.spots[0].jacobian
    covariance = np.linalg.inv(jacobian.T @ jacobian / size**2 + np.diag([one.weight for one in unknowns]))
    ends = [[one.value(at + step) for one, at in zip(unknowns, x, strict=True)] for step in (-1e-6, 1e-6)]
    slopes = np.diff(ends, axis=0)[0] / 2e-6
    of_values = covariance * np.outer(slopes, slopes)
    deviations = np.sqrt(np.diag(of_values))
    expected = of_values / np.outer(deviations, deviations)
    found = _correlations(replace(fitter, unknowns=unknowns), best._replace(x=x))
    assert found == pytest.approx(expected, rel=1e-6)
    assert np.sign(found[2, :2]).tolist() == (-np.sign(covariance[2, :2])).tolist()


def test_the_most_likely_torque_error_is_that_of_the_normal_equations() -> None:
    """Least squares of r + G e over the noise and of e over the ripple, with r about e = 0."""
    response, residual, sizes = gaussian((9, 6)), gaussian((9,), 3), ErrorScales(1.3, 0.4)
    eigenvalues, vectors = np.linalg.eigh(response @ response.T)
    spot = LogLinearization(
        np.zeros(6), vectors.T @ residual, vectors.T, np.maximum(eigenvalues, 0.0), response
    )
    normal = response.T @ response / 1.3**2 + np.eye(6) / 0.4**2
    expected = -np.linalg.solve(normal, response.T @ residual / 1.3**2)
    assert spot.likely_error(spot.residual, sizes) == pytest.approx(expected, rel=1e-9)


def test_innovations_are_independent_of_unit_size_and_of_what_came_before() -> None:
    response, sizes = gaussian((9, 6)), ErrorScales(1.3, 0.4)
    eigenvalues, vectors = np.linalg.eigh(response @ response.T)
    spot = LogLinearization(np.zeros(6), np.zeros(9), vectors.T, np.maximum(eigenvalues, 0.0), response)
    each = np.array([spot._replace(residual=column).innovations(sizes) for column in vectors]).T
    covariance = 1.3**2 * np.eye(9) + 0.4**2 * response @ response.T
    assert each @ covariance @ each.T == pytest.approx(np.eye(9), abs=1e-9)
    assert np.triu(each, 1) == pytest.approx(0.0, abs=1e-9)


# ---- what is known --------------------------------------------------------------------------------------


def test_known_is_an_interval_below_a_factor_of_three() -> None:
    """Upper over lower end is exp(2 half) of a logarithm; a gap, by its root, has twice the share of x."""
    stiffness = Unknown("stiffness", "logarithm", 5.0, 3.0, 7.0)
    assert stiffness.known(5.0, 0.5 * math.log(2.99))
    assert not stiffness.known(5.0, 0.5 * math.log(3.01))
    gap = Unknown("gap", "power", 1.0, 0.1, 3.0, 0.08, power=0.5)
    assert gap.share(1.0, 0.1) == pytest.approx(0.2)
    assert gap.known(1.0, 0.25 * math.log(2.99))
    assert not gap.known(1.0, 0.25 * math.log(3.01))
    place = Unknown("position", "position", 0.7, 0.0, 1.0)
    assert place.known(0.7, 0.249)
    assert not place.known(0.7, 0.251)
    friction = Unknown("motor_friction", "power", 0.5, 0.0, 3.0)
    assert friction.known(0.5, 0.499)
    assert not friction.known(0.5, 0.501)
    assert [stiffness.limited(x) for x in (3.003, 3.005, 6.997, 6.995)] == [True, False, True, False]


@pytest.mark.parametrize(
    ("share", "refused"), [(0.99 / 25, True), (1.01 / 25, False), (24.9, False), (25.1, True)]
)
def test_an_inertia_is_believed_within_a_factor_of_25(share: float, refused: bool) -> None:
    """Of the rotor alone, and of rotor and load: 40 N m and a constant acceleration."""
    whole = float(TRUTH.J1 if share < 1.0 else TRUTH.J1 + TRUTH.J2)
    time = np.arange(100) * 1e-3
    log = Log(time, np.full(100, 40.0), speed=40.0 / (share * whole) * time)
    if not refused:
        return _check_inertia(log, TRUTH)
    with pytest.raises(InputError, match="check the units of the columns"):
        _check_inertia(log, TRUTH)
    return None


@pytest.mark.parametrize(("ratio", "doubted"), [(0.199, True), (0.201, False), (4.98, False), (5.02, True)])
def test_inertias_five_times_off_are_doubted(ratio: float, doubted: bool) -> None:
    found = TRUTH.replace(motor_inertia=ratio * TRUTH.J1, load_inertia=ratio * TRUTH.J2)
    assert bool(_scale_warning(TRUTH, found)) == doubted


# ---- what the model has not -----------------------------------------------------------------------------


@pytest.mark.parametrize(("share", "stated"), [(0.055, True), (0.065, False)])
def test_a_torque_error_above_six_per_cent_is_no_ripple(share: float, stated: bool) -> None:
    """Of 40.3 N m, at the true drive; 146 samples tell its size within 6 %."""
    log = simulated_log(TRUTH, REVERSE, log_period=4e-3, ripple=40.3 * share, seed=4)
    fitter, x = fit_of(log, TRUTH, -0.6, -0.2 * log.count)
    point = fitter.linearized(x, [np.zeros(log.time.size)], ErrorScales(1.0, 2.0))
    point = fitter.with_derivatives(point)
    assert point.sizes.ripple == pytest.approx(40.3 * share, rel=0.1)
    assert any("a torque error of" in note for note in model_mismatch(fitter, point)) != stated


@pytest.mark.parametrize(("count", "size", "named"), [(3, 5.1, True), (3, 4.9, False), (2, 5.1, False)])
def test_samples_five_deviations_off_are_named_from_three_on(count: int, size: float, named: bool) -> None:
    """Of 73 samples, of which 2 + 0.5 % may be: what is left is half a deviation, but in some of them."""
    log = simulated_log(TRUTH, REVERSE, log_period=8e-3, ripple=1.0, seed=4)
    fitter, x = fit_of(log, TRUTH, -0.6, -0.2 * log.count)
    point = fitter.linearized(x, [np.zeros(log.time.size)], ErrorScales(1.0, 1.0))
    point = fitter.with_derivatives(point)
    spot = point.spots[0]
    left = 0.5 * gaussian((spot.residual.size,))
    left[[20, 37, 60][:count]] = size
    # the samples of these innovations: V = L L', L left
    covariance = spot.rotation.T * spot.variance(point.sizes) @ spot.rotation
    spot = spot._replace(residual=spot.rotation @ np.linalg.cholesky(covariance) @ left)
    assert spot.innovations(point.sizes) == pytest.approx(left, abs=1e-6)
    told = f"simulated log: {count} samples more than 5 standard deviations off"
    assert any(told in note for note in model_mismatch(fitter, point._replace(spots=(spot,)))) == named


@pytest.mark.parametrize(
    ("chance", "limit", "words"),
    [("_slow_torque", 1e-5, "a torque that changes slowly"), ("_whiteness", 1e-4, "errors not independent")],
)
def test_what_has_a_chance_below_its_limit_is_named(
    chance: str, limit: float, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = simulated_log(TRUTH, REVERSE, log_period=8e-3, ripple=1.0, seed=4)
    fitter, x = fit_of(log, TRUTH, -0.6, -0.2 * log.count)
    point = fitter.with_derivatives(fitter.linearized(x, [np.zeros(log.time.size)], ErrorScales(1.0, 1.0)))
    for share, named in ((0.99, True), (1.01, False)):
        monkeypatch.setattr(solving, chance, lambda *_, share=share: share * limit)
        assert any(words in note for note in model_mismatch(fitter, point)) == named


@pytest.mark.parametrize(("deviations", "named"), [(3.9, False), (4.1, True)])
def test_an_effect_of_four_deviations_is_named_with_its_size(deviations: float, named: bool) -> None:
    """An offset of the torque: what is left is its shape, so many deviations of its size."""
    log = simulated_log(PLACED, REVERSE, log_period=8e-3, ripple=1.0, seed=3)
    unknowns = unknowns_of(["gap", "load_inertia"], PLACED, [log], [False])
    fitter = Fitter([LogModel.of(log, PLACED)], unknowns)
    x = np.array([one.guess for one in unknowns])
    point = fitter.linearized(x, [np.zeros(log.time.size)], ErrorScales(1.0, 1.0))
    point = fitter.with_derivatives(point, point)
    spot = point.spots[0]
    root = np.sqrt(spot.variance(point.sizes))
    jacobian = point.white[1]
    # a torque of 1 N m in all samples, less what the parameters explain of it
    shape = spot.rotation @ spot.response @ np.ones(log.time.size) / root
    shape -= jacobian @ np.linalg.lstsq(jacobian, shape, rcond=None)[0]
    deviation = 1.0 / float(np.linalg.norm(shape))
    left = spot._replace(residual=-deviations * deviation * shape * root)
    notes = _effects(fitter, point._replace(spots=(left,)))
    assert bool(notes) == named
    if named:
        size, error = deviations * deviation, 2.0 * deviation
        assert f"an offset of the torque signal of {size:.3g} +- {error:.2g} N m" in notes[0]
        turned = replace(fitter, models=[replace(fitter.models[0], log=log.changed(sign=-1.0))])
        # of a log that was turned round the signal has the other sign
        assert f"of {-size:.3g} +-" in _effects(turned, point._replace(spots=(left,)))[0]


@pytest.mark.parametrize(("gain", "named"), [(3.9, False), (4.1, True)])
def test_a_fit_that_another_step_makes_better_by_four_is_none(gain: float, named: bool) -> None:
    """What is left is a multiple of the first derivative: a step along it gains its whole square."""
    log = simulated_log(TRUTH, REVERSE, log_period=16e-3, ripple=1.0, seed=4)
    fitter, x = fit_of(log, TRUTH, -0.6, -0.2 * log.count)
    point = fitter.with_derivatives(fitter.linearized(x, [np.zeros(log.time.size)], ErrorScales(1.0, 1.0)))
    spot, derivative = point.spots[0], point.white[1][:, 0]
    root = np.sqrt(spot.variance(point.sizes))
    left = spot._replace(residual=math.sqrt(gain) * derivative / np.linalg.norm(derivative) * root)
    notes = model_mismatch(fitter, point._replace(spots=(left,), drift=np.zeros(x.size)))
    assert any("The fit improves" in note for note in notes) == named


def test_the_chance_of_correlations_is_that_of_ljung_and_box() -> None:
    """Of 1, -1, 1, ...: r_k = (-1)^k (n - k)/n, so Q = (n + 2)/n sum(n - k), of two lags for n = 8."""
    left = np.tile([1.0, -1.0], 4)
    assert _whiteness(left) == pytest.approx(math.exp(-0.5 * 10.0 / 8.0 * (7.0 + 6.0)), rel=1e-12)


def test_the_chance_of_a_slow_torque_is_that_of_its_waves() -> None:
    """Of 100 samples that answer to their own torque alone: twenty waves, and one of 50 explains the rest."""
    count, sizes = 100, ErrorScales(0.0, 2.0)
    waves = np.cos(math.pi * np.outer(np.arange(count) + 0.5, [3.0, 50.0]) / count)
    waves /= np.linalg.norm(waves, axis=0)
    residual = 2.0 * (5.0 * waves[:, 0] + 30.0 * waves[:, 1])
    spot = LogLinearization(
        np.zeros(count), residual, np.eye(count), np.ones(count), np.eye(count), waves[:, 1:]
    )
    assert _slow_torque(spot, sizes) == pytest.approx(float(chi2.sf(25.0, 20)), rel=1e-6)
