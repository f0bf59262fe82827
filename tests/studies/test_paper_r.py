"""`softstart study paper-r`: its own integrator against closed forms, and the numbers of its verdicts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import Drive
from softstart.chain import Chain, natural_vibration
from softstart.study import Verdict
from softstart.vibration import elastic_frequencies
from softstart_studies.paper_r import findings, four_to_two, tables
from softstart_studies.paper_r.findings import free, scale_gaps, tractor
from softstart_studies.paper_r.lever import error_bound, lever

CRANE = Drive.load("crane-4amtkf")


# motions ----------------------------------------------------------------------------------------------


def test_energy_and_momentum_are_kept_through_hundreds_of_contacts():
    motion, arrays = free(tractor()).motion, tractor().at_motor_shaft()
    energy = 0.5 * (motion.w**2 @ arrays.J) + 0.5 * (motion.torque**2 @ (1.0 / arrays.c))
    assert np.ptp(energy) / energy[0] < 1e-12
    assert np.abs(motion.w @ arrays.J).max() < 1e-11


def test_without_gaps_the_chain_swings_in_its_mode():
    run = findings.plain()
    vibration = natural_vibration(tractor())
    assert run.Omega == pytest.approx(float(vibration.Omega[1]), rel=1e-6)
    np.testing.assert_allclose(run.shape / run.shape[-1], vibration.shape[1], atol=1e-5)
    assert run.amplitude[-1] == pytest.approx(
        abs(vibration.shape[1, -1] / vibration.shape[1, 0]) * math.radians(2.0), rel=1e-4
    )
    assert abs(run.beside) < 3e-4  # the mean over 60 periods counts both ends: one sample of 3841


# the tables --------------------------------------------------------------------------------------------


def test_table_2_follows_from_table_1_but_for_two_cells():
    cells = tables.cells()
    assert len(cells) == 18
    assert [cell.printed for cell in cells if cell.follows == "no"] == ["0.253", "0.192"]
    for cell in cells:
        if cell.recomputed is not None:
            assert f"{cell.recomputed:.3f}" == cell.printed


def test_the_shipped_chain_has_the_gaps_of_table_2():
    arrays = Chain.load("tractor-like").at_motor_shaft()
    np.testing.assert_allclose(arrays.gap[-6:], tables.gaps_of(1), rtol=1e-12)
    np.testing.assert_allclose(arrays.speed_ratio[-6:], tables.RATIOS[1], rtol=1e-12)


# four to two -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.1, 1.0])
def test_the_error_of_four_masses_is_that_of_a_dense_solver(share):
    from scipy.linalg import eigh

    found = four_to_two.error_map(np.array([share]), np.array([2.0]))
    I1, inner, I4 = 1.0, share * 6.0, 5.0
    c1, c3 = 3.0, 1.5
    K = np.array([[c1, -c1, 0], [-c1, c1 + c3, -c3], [0, -c3, c3]])
    exact = math.sqrt(eigh(K, np.diag([I1, inner, I4]), eigvals_only=True)[1])
    first, last = I1 + inner / c3, I4 + inner / c1  # C = 1
    assert found.lever[0, 0] == pytest.approx(math.sqrt(1 / first + 1 / last) / exact - 1.0, rel=1e-9)
    pieces = min(c1 * (1 / I1 + 2 / inner), c3 * (1 / I4 + 2 / inner))
    assert found.ratio[0, 0] == pytest.approx(pieces / exact**2, rel=1e-9)


# the lever rule ----------------------------------------------------------------------------------------


@given(st.integers(0, 10**6), st.integers(2, 6))
@settings(max_examples=40, deadline=None)
def test_squared_periods_move_by_no_more_than_those_of_the_partial_systems(seed: int, to: int) -> None:
    """The theorem behind the bound, for every frequency, far outside the condition too."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 10))
    J, c = 10 ** rng.uniform(-2, 1, n), 10 ** rng.uniform(1, 5, n - 1)
    found = lever(J, c, min(to, n - 1))
    whole, after = elastic_frequencies(J, c), elastic_frequencies(found.J, found.c)
    whole = whole[: after.size]
    allowed = np.sum(1.0 / found.squares)
    change = np.abs(1.0 / after**2 - 1.0 / whole**2)
    assert np.all(change <= allowed * (1.0 + 1e-12) + 1e-12 / whole**2)
    assert np.all(np.abs(after / whole - 1.0) <= error_bound(whole, found.squares) * (1.0 + 1e-9) + 1e-12)
    assert found.J.sum() == pytest.approx(J.sum(), rel=1e-12)


@given(*[st.floats(0.01, 10.0)] * 4, st.floats(10, 1e4), st.floats(10, 1e4))
@settings(max_examples=50, deadline=None)
def test_four_masses_to_two_are_the_formulas_of_the_paper(
    I1: float, I2: float, I3: float, I4: float, c1: float, c3: float
) -> None:
    """[R]: 1/C = 1/c1 + 1/c3, I_I = I1 + (I2 + I3) C/c3, I_II = I4 + (I2 + I3) C/c1."""
    found = lever(np.array([I1, I2 + I3, I4]), np.array([c1, c3]), ends=(2, 0))
    if found.squares[0] != pytest.approx((c1 + c3) / (I2 + I3)):
        return  # a pair swings higher than the inner mass: another way is better there
    C = 1.0 / (1.0 / c1 + 1.0 / c3)
    assert pytest.approx([I1 + (I2 + I3) * C / c3, I4 + (I2 + I3) * C / c1], rel=1e-12) == found.J
    assert found.c == pytest.approx([C], rel=1e-12)


def test_motor_and_load_stay_apart() -> None:
    """By hand, although their pair swings highest: a mass at an end takes its part of 1/c along."""
    found = lever(np.array([1.0, 0.1, 0.1, 5.0]), np.array([10.0, 1e4, 10.0]), ends=(2, 1))
    assert pytest.approx([1.1, 5.1]) == found.J
    assert 1.0 / found.c == pytest.approx([1e-4 + 1.0 / 1.1 / 10.0 + 5.0 / 5.1 / 10.0])


# the findings ------------------------------------------------------------------------------------------


def test_gaps_lower_the_frequency_and_more_so_at_small_amplitudes():
    plain = findings.plain().Omega
    found = [free(scale_gaps(tractor(), width)).Omega / plain for width in (1.0, 4.0)]
    assert found == sorted(found, reverse=True)
    assert all(ratio < 1.0 for ratio in found)


def test_a_constant_torque_above_the_alternating_one_locks_all_gaps():
    full = findings.locked(300.0)
    assert full.open_gaps == 0
    assert full.frequency == pytest.approx(1.0, abs=1e-6)
    assert findings.locked(0.0).frequency < 0.9


def test_every_claim_of_the_tables_has_its_verdict():
    verdicts = [Verdict(claim.verdict) for claim in tables.claims()]
    assert verdicts == [Verdict.PARTLY, Verdict.CONFIRMED, Verdict.PARTLY, Verdict.CONFIRMED]
    assert "by choice" in findings.twist().evidence
