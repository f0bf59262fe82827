"""`softstart study optimal-starts`: a part of it against plant and closed forms."""

from __future__ import annotations

import pytest

from softstart import TorqueProfile, optimize, simulate
from softstart.study import Verdict
from softstart_studies.optimal_starts import find, limits, present
from softstart_studies.optimal_starts.drives import Extent, crane

PART = Extent(
    gaps=(0.5,),
    multiples=(0.9, 1.2),
    points=3,
    controllers=("direct", "reduced-two-stage", "current-limit-feedback"),
)


pytestmark = pytest.mark.slow  # all wait for the study


@pytest.mark.parametrize("gap", [0.5, 2.0])
def test_landmarks(gap):
    one = limits.limit(gap)
    best = optimize(
        crane(gap), one.time_of_one * (1.0 + 1e-6), terminal="reached"
    )  # the hold is just within Ms
    assert (best.method, best.k_dyn) == ("closed-form", pytest.approx(1.0, abs=1e-5))
    idle = simulate(crane(gap), "profile", 1.0, parameters={"profile": TorqueProfile([0.0], [0.0])})
    assert idle.stages[1].peak_torque / crane(gap).mean_torque == pytest.approx(one.floor, rel=1e-9)


def test_verdicts():
    result = present(find(PART, lambda text: None), lambda text: None)
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
