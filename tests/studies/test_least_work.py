"""Optimal engagement laws: what is proved lies below every law, what is found above it and near it."""

from __future__ import annotations

import numpy as np
import pytest

from softstart.clutch import LAWS, Clutch, engage
from softstart.errors import InputError
from softstart_studies.paper_c import optimize_engagement
from softstart_studies.paper_c.fronts import pulse_and_pause, two_steps
from softstart_studies.paper_c.least_work import Search, Slip

PAPER = Clutch.load("paper-c")
SLIP = Slip(PAPER)
CLASSES = ("any", "nondecreasing")
STEPS = 60


@pytest.fixture(scope="module")
def fronts():
    return {name: optimize_engagement(PAPER, 2, law_class=name) for name in CLASSES}


@pytest.fixture(scope="module")
def searches():
    made = {name: Search(PAPER, name, STEPS) for name in CLASSES}
    for search in made.values():
        search.least_work(1.15 * SLIP.Tm)
    return made


def random_laws(count, nondecreasing, seed=7):
    """Laws on a grid of their own: anything, bang-bang, and near to the best; and their engagements."""
    random = np.random.default_rng(seed)
    edges = np.linspace(0.0, SLIP.tM, 38)
    for i in range(count):
        shares = random.random(37) ** random.choice([0.3, 1.0, 3.0])
        if i % 3 == 1:
            shares = np.round(shares)
        if i % 3 == 2:
            best = np.where((edges[:-1] > 0.12) & (edges[:-1] < 0.28), 0.0, 1.0)
            shares = np.clip(best + 0.1 * random.standard_normal(37), 0.0, 1.0)
        yield edges, (np.sort(shares) if nondecreasing else shares) * SLIP.MM


def engaged(edges, M):
    times, torques = np.repeat(edges, 2)[1:-1].tolist(), np.repeat(M, 2).tolist()
    return engage(PAPER.with_table([*times, SLIP.tM], [*torques, SLIP.MM]))


# what is proved --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law_class", CLASSES)
def test_no_engaged_law_lies_below_its_bound(law_class, searches):
    search = searches[law_class]
    tried = 0
    for law in random_laws(9, law_class == "nondecreasing", seed=11):
        run = engaged(*law)
        if run.slip_time - SLIP.tM >= SLIP.period:
            tried += 1
            assert run.slip_peak_torque >= SLIP.Tm
            assert run.slip_work >= search.work_bound(run.slip_peak_torque)
    assert tried >= 6


def test_energy_gives_the_work_of_every_law():
    # the formula on which all of this stands, against the simulation's integral of M (w0 - wM)
    for edges, M in random_laws(3, False, seed=5):
        run = engaged(edges, M)
        matrix, free = SLIP.at_tM(edges)
        end = run.at(run.slip_time * (1.0 - 1e-15))
        s, p, q = run.slip_time - SLIP.tM, float(end["T"][0]) - SLIP.Tm, SLIP.cp * float(end["v"][0]) / SLIP.B
        assert matrix[:3] @ M + free[:3] == pytest.approx(SLIP.state(s, p, q), rel=1e-10)
        assert float(SLIP.work(matrix[3] @ M + free[3], s, p, q)) == pytest.approx(run.slip_work, rel=1e-11)


# what is found ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law_class", CLASSES)
def test_bound_and_optimum_and_known_laws_are_in_order(law_class, fronts):
    front = fronts[law_class]
    works = [point.slip_work for point in front.points]
    assert works == sorted(works, reverse=True)
    for point in front.points:
        assert point.work_bound <= point.slip_work <= point.work_bound * (1.0 + 3e-4)
        assert point.run.energy.residual < 1e-12
        assert max(point.torques) <= SLIP.MM
        assert min(point.torques) >= 0.0
        if law_class == "nondecreasing":
            assert np.all(np.diff(point.torques) >= -1e-9 * SLIP.MM)
    assert {law["law"] for law in front.laws} == set(LAWS)
    for law in front.laws:
        assert law["work_bound"] <= law["least_work"] <= law["slip_work"]
        assert law["least_peak"] == front.points[0].peak_torque <= law["peak_torque"]


def test_a_freer_class_costs_no_more(fronts):
    for free, rising in zip(fronts["any"].points, fronts["nondecreasing"].points, strict=True):
        assert free.work_bound <= rising.slip_work
        assert free.slip_work <= rising.slip_work


@pytest.mark.parametrize(("law_class", "law"), [("any", pulse_and_pause), ("nondecreasing", two_steps)])
def test_simple_laws_bring_the_shaft_to_rest_and_lie_between_bound_and_optimum(law_class, law, fronts):
    run = engage(PAPER.with_table(*law(PAPER)))
    t = np.linspace(0.5, run.slip_time, 200)
    assert run.at(t)["T"] == pytest.approx(np.full(200, PAPER.mean_torque), rel=1e-12)
    assert run.slip_peak_torque == pytest.approx(PAPER.mean_torque, rel=1e-12)
    assert run.locked_peak_torque == pytest.approx(PAPER.mean_torque, rel=1e-12)
    first = fronts[law_class].points[0]
    assert first.peak_torque == pytest.approx(SLIP.Tm, rel=1e-9)
    assert first.work_bound <= run.slip_work <= first.slip_work * (1.0 + 1e-6)


def test_another_clutch_with_a_table_of_its_own():
    clutch = Clutch(
        clutch_inertia=0.4, load_inertia=1.0, clutch_torque=100.0, load_torque=10.0,
        stiffness=200.0, drive_speed=150.0, engagement_time=0.6,
        law="table", law_times=[0, 0.2, 0.5], law_torques=[0, 70, 100],
    )  # fmt: skip
    front = optimize_engagement(clutch, 2, steps=100)
    assert [law["law"] for law in front.laws] == [*LAWS, "table"]
    for law in front.laws:
        assert law["work_bound"] <= law["least_work"] * (1.0 + 1e-12)
        assert law["least_work"] <= law["slip_work"] * (1.0 + 1e-3)


# what is refused -------------------------------------------------------------------------------------------


def test_what_the_optimum_does_not_cover_is_refused_at_once():
    with pytest.raises(InputError) as caught:
        optimize_engagement(PAPER.replace(gap=0.1, damping=1.0, load_kind="reactive"))
    assert [one.split(" = ")[0] for one in caught.value.sentences] == ["gap", "damping", "load_kind"]
    with pytest.raises(InputError, match="engagement_time = 4: with full torque"):
        optimize_engagement(PAPER.replace(engagement_time=4.0))
