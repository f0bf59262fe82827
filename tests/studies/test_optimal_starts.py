"""`softstart study optimal-starts`: a part of it against plant and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from softstart import TorqueProfile, optimize, simulate
from softstart.study import Verdict
from softstart_studies.crane import TARGET
from softstart_studies.optimal_starts import find, limits, present
from softstart_studies.optimal_starts.drives import Extent, crane, direct_time
from softstart_studies.optimal_starts.limits import any_contacts_bound

PART = Extent(
    gaps=(0.5,),
    multiples=(0.9, 1.2),
    points=3,
    controllers=("direct", "reduced-two-stage", "current-limit-feedback"),
)


pytestmark = pytest.mark.slow  # all wait for the study


@pytest.fixture(scope="module")
def found():
    """A part of the study."""
    return find(PART, lambda text: None)


@pytest.fixture(scope="module")
def result(found):
    return present(found, lambda text: None)


def test_profiles_are_those_of_the_anchor_and_end_in_step(found):
    short, start = found.profiles
    assert (short.run, short.point.status) == (None, "INFEASIBLE")
    assert short.point.shortest_start_time > 0.9 * direct_time(0.5)
    assert start.point.k_dyn == pytest.approx(0.90924724, abs=1e-6)  # DESIGN's anchor
    end = start.run.at(start.point.start_time)
    assert [float(end[name]) for name in ("w1", "w2")] == pytest.approx([TARGET, TARGET], rel=1e-8)
    assert start.run.contacts == 1
    assert 0.0 <= start.run.u.min() <= start.run.u.max() <= 62.0
    assert start.run.peak_torque / crane().mean_torque == pytest.approx(start.point.k_dyn, rel=1e-12)


def test_the_front_falls_and_holds_its_bound(found):
    (front,) = found.fronts
    k = np.array([point.k_dyn for point in front.points])
    low = np.array([point.k_dyn_lower_bound for point in front.points])
    assert np.all(np.diff(k) < 0.0)
    assert np.all(low <= k)
    assert np.all(k < 1.005 * low)


def test_controllers_lie_above_both_limits(found):
    (front,) = found.fronts
    assert len(front.controllers) == 3
    for one in front.controllers:
        assert one.k_dyn > any_contacts_bound(front, one)
        if one.optimum.found:
            assert one.optimum.k_dyn >= any_contacts_bound(front, one) * (1.0 - 1e-9)
            assert one.ratio > 1.0


def test_a_stricter_terminal_is_never_gentler(found):
    (one,) = found.endings
    for terminal in ("synchronous", "steady"):
        for cost in one.cost(terminal).values():
            assert cost >= 1.0 - 5e-4  # what the linear program's grid may be worth
    last, k_dyn = list(one.k_dyn("steady").items())[-1]
    assert k_dyn >= one.k_dyn("synchronous")[last]


@pytest.mark.parametrize("gap", [0.5, 2.0])
def test_landmarks(gap):
    one = limits.limit(gap)
    best = optimize(
        crane(gap), one.time_of_one * (1.0 + 1e-6), terminal="reached"
    )  # the hold is just within Ms
    assert (best.method, best.k_dyn) == ("closed-form", pytest.approx(1.0, abs=1e-5))
    idle = simulate(crane(gap), "profile", 1.0, parameters={"profile": TorqueProfile([0.0], [0.0])})
    assert idle.stages[1].peak_torque / crane(gap).mean_torque == pytest.approx(one.floor, rel=1e-9)


def test_verdicts(result):
    said = {claim.statement: claim.verdict for claim in result.claims}
    assert len(said) == len(result.claims)
    for beginning, verdict in (
        ("Pulse, coast, hold is optimal", Verdict.CONFIRMED),
        ("K_dyn below 1 is possible", Verdict.CONFIRMED),
        ("Method 2 of [G] is close", Verdict.REFUTED),
        ("No controller gets below", Verdict.CONFIRMED),
        ("Reached is up to 5 % below", Verdict.REFUTED),
        ("The optimum is invariant to the gap", Verdict.REFUTED),
    ):
        (found,) = [verdict for statement, verdict in said.items() if statement.startswith(beginning)]
        assert found is verdict, beginning
