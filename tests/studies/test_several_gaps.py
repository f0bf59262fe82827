"""`softstart study several-gaps`: a small version against single optima."""

import pytest

from softstart import optimize, simulate
from softstart.study import Verdict
from softstart_studies.several_gaps import Extent, chain, claims, find, table

pytestmark = pytest.mark.slow  # all wait for the study


@pytest.fixture(scope="module")
def found():
    """One start time, two strategies beside it."""
    return find(Extent((0.60,), ("direct", "s-curve")), lambda doing: None)


def test_the_row_is_that_of_single_optima(found):
    (row,) = found.rows
    assert row.best.k_dyn == pytest.approx(optimize(chain(), 0.60).k_dyn, rel=1e-9)
    assert row.best.bound.k_dyn < row.best.k_dyn
    assert table(found).rows[0][0] == 0.60


def test_the_claims_hold_here(found):
    said = claims(found)
    assert said[0].verdict is Verdict.CONFIRMED
    assert said[1].verdict is Verdict.CONFIRMED
    assert simulate(chain(), "s-curve").k_dyn > found.rows[0].best.k_dyn
