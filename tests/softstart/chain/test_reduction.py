"""The reduction: its theorem on random chains, the formulas of [R], the modal method, and what is refused."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import eigh

from softstart import Drive, InputError, compare
from softstart.chain import Chain, Mass, Motor, Reduction, Shaft, natural_vibration, reduce_chain
from softstart.chain.reduction import FACTOR, pieces

Vector = NDArray[np.float64]


def dense(chain: Chain) -> Vector:
    """The elastic frequencies by a dense solver."""
    arrays = chain.at_motor_shaft()
    K = np.zeros((arrays.J.size, arrays.J.size))
    for k, c in enumerate(arrays.c):
        K[k : k + 2, k : k + 2] += c * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return cast("Vector", np.sqrt(eigh(K, np.diag(arrays.J), eigvals_only=True)[1:]))


def row(J: list[float], c: list[float]) -> Chain:
    return Chain([Mass(x) for x in J], [Shaft(x) for x in c])


def random_row(rng: np.random.Generator) -> Chain:
    n = int(rng.integers(3, 10))
    return row((10 ** rng.uniform(-2, 1, n)).tolist(), (10 ** rng.uniform(1, 5, n - 1)).tolist())


def test_five_hundred_random_chains_keep_their_frequencies_within_the_reported_error() -> None:
    """What is reported is the error against a dense solver, and it is below the bound before the fact."""
    rng = np.random.default_rng(1)
    met = 0
    while met < 500:
        chain = random_row(rng)
        whole = dense(chain)
        up_to = float(whole[min(int(rng.integers(0, 3)), whole.size - 1)]) * 1.001
        found = reduce_chain(chain, up_to=up_to)
        if not found.steps:
            continue
        met += 1
        after = dense(found.reduced)
        assert found.least_ratio >= FACTOR
        for i, kept in enumerate(found.frequencies):
            assert kept.whole == pytest.approx(whole[i], rel=1e-9)
            assert kept.reduced == pytest.approx(after[i], rel=1e-9)
            assert kept.error == pytest.approx(after[i] / whole[i] - 1.0, abs=1e-9)
            assert abs(kept.error) <= kept.bound + 1e-12
        for step in found.steps:
            assert all(abs(e) <= b + 1e-12 for e, b in zip(step.errors, step.bounds, strict=True))


@given(st.integers(0, 10**6), st.integers(2, 6))
@settings(max_examples=80, deadline=None)
def test_squared_periods_move_by_no_more_than_those_of_the_partial_systems(seed: int, to: int) -> None:
    """The theorem behind the bound holds for every frequency, far outside the condition too."""
    chain = random_row(np.random.default_rng(seed))
    to = min(to, len(chain.masses) - 1)
    found = reduce_chain(chain, to, force=True)
    allowed = sum(1.0 / step.Omega**2 for step in found.steps)
    whole = natural_vibration(chain).Omega[1:]
    after = natural_vibration(found.reduced).Omega[1:]
    change = np.abs(1.0 / after**2 - 1.0 / whole[: after.size] ** 2)
    assert np.all(change <= allowed * (1.0 + 1e-12) + 1e-12 / whole[: after.size] ** 2)


@given(st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_inertia_compliance_and_gap_of_the_whole_are_kept(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plain = random_row(rng)
    shafts = [Shaft(s.stiffness, gap=float(rng.uniform(0, 0.1))) for s in plain.shafts]
    masses = [Mass(m.inertia, torque=float(rng.uniform(0, 5))) for m in plain.masses]
    chain = Chain(masses, shafts, Motor(100.0), target_speed=10.0)
    for method in ("lever", "modal"):
        found = reduce_chain(chain, method=method, force=True)  # type: ignore[arg-type]
        before, after = found.figures
        assert after.inertia == pytest.approx(before.inertia, rel=1e-12)
        assert after.gap == pytest.approx(before.gap, rel=1e-12)
        drive = found.to_drive()
        assert pytest.approx(before.inertia, rel=1e-12) == drive.J1 + drive.J2
        assert drive.Mc == pytest.approx(sum(mass.torque for mass in masses), rel=1e-12)
        assert drive.Omega == pytest.approx(natural_vibration(found.reduced).Omega[1], rel=1e-12)


@given(*[st.floats(0.01, 10.0)] * 4, st.floats(10, 1e4), st.floats(10, 1e4))
@settings(max_examples=50, deadline=None)
def test_four_masses_to_two_are_the_formulas_of_the_paper(
    I1: float, I2: float, I3: float, I4: float, c1: float, c3: float
) -> None:
    """[R]: 1/C = 1/c1 + 1/c3, I_I = I1 + (I2 + I3) C/c3, I_II = I4 + (I2 + I3) C/c1; the gap stays."""
    chain = Chain(
        [Mass(I1), Mass(I2), Mass(I3), Mass(I4)], [Shaft(c1), Shaft(gap=0.3, restitution=1.0), Shaft(c3)]
    )
    found = reduce_chain(chain, 2, force=True)
    if [step.kind for step in found.steps] != ["joint", "mass"]:
        return  # a pair swings higher than the inner mass: another way is better there
    C = 1.0 / (1.0 / c1 + 1.0 / c3)
    first, last = found.reduced.masses
    assert first.inertia == pytest.approx(I1 + (I2 + I3) * C / c3, rel=1e-12)
    assert last.inertia == pytest.approx(I4 + (I2 + I3) * C / c1, rel=1e-12)
    assert found.reduced.shafts[0].stiffness == pytest.approx(C, rel=1e-12)
    assert found.reduced.shafts[0].gap == pytest.approx(0.3, rel=1e-12)


def test_a_pair_goes_to_its_centre_of_mass() -> None:
    """By hand: masses 1 and 3 over c = 4: centre 3/4 of the way, compliances 1/c grow by 3/16 and 1/16."""
    chain = Chain(
        [Mass(50), Mass(1), Mass(3), Mass(50)],
        [Shaft(1, gap=0.1), Shaft(400, gap=0.04, damping=8), Shaft(2, gap=0.2)],
    )
    found = reduce_chain(chain, 3, force=True)
    assert found.steps[0].kind == "pair"
    left, right = found.reduced.shafts
    assert found.reduced.masses[1].inertia == 4.0
    assert found.reduced.masses[1].name == "mass 2 + mass 3"
    assert 1.0 / left.stiffness == pytest.approx(1.0 + 0.75 / 400, rel=1e-12)
    assert 1.0 / right.stiffness == pytest.approx(0.5 + 0.25 / 400, rel=1e-12)
    assert left.gap == pytest.approx(0.1 + 0.75 * 0.04, rel=1e-12)
    assert left.damping / left.stiffness**2 == pytest.approx(0.75 * 8 / 400**2, rel=1e-12)


def test_dampers_in_series_add_up_as_complex_stiffness_says() -> None:
    """1/(c + i w d) of springs in series, for w towards 0."""
    chain = Chain([Mass(1), Mass(1e-9), Mass(1)], [Shaft(3, damping=0.2), Shaft(7, damping=0.5)])
    one = reduce_chain(chain, 2).reduced.shafts[0]
    w = 1e-4
    exact = 1.0 / (1.0 / complex(3, 0.2 * w) + 1.0 / complex(7, 0.5 * w))
    assert complex(one.stiffness, one.damping * w) == pytest.approx(exact, rel=1e-8)


@given(st.integers(0, 10**6))
@settings(max_examples=40, deadline=None)
def test_the_modal_method_keeps_frequency_inertia_and_node(seed: int) -> None:
    chain = random_row(np.random.default_rng(seed))
    found = reduce_chain(chain, method="modal", force=True)
    before, after = found.figures
    assert after.Omega == pytest.approx(before.Omega, rel=1e-12)
    assert after.node == pytest.approx(before.node, rel=1e-9)
    assert after.inertia == pytest.approx(before.inertia, rel=1e-12)


def test_the_modal_method_keeps_the_damping_of_the_mode() -> None:
    """Decay rate of the first elastic mode, from the eigenvalues of the damped systems."""
    chain = Chain.load("tractor-like")
    found = reduce_chain(chain, method="modal")
    assert _decay(found.reduced) == pytest.approx(_decay(chain), rel=2e-3)  # light damping: first order


def _decay(chain: Chain) -> float:
    arrays = chain.at_motor_shaft()
    n = arrays.J.size
    B = np.eye(n)[:-1] - np.eye(n, k=1)[:-1]
    K, D = B.T @ np.diag(arrays.c) @ B, B.T @ np.diag(arrays.d) @ B
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / arrays.J[:, None], -D / arrays.J[:, None]]])
    values = np.linalg.eigvals(A)
    values = values[values.imag > 1.0]
    return float(-values[np.argmin(values.imag)].real)


def test_the_crane_chain_gives_about_the_crane_drive() -> None:
    crane = Drive.load("crane-4amtkf")
    drive = reduce_chain(Chain.load("crane-4-mass"), 2).to_drive()
    for name in ("J1", "J2", "c", "gap", "Mc", "Ms", "maximum_torque", "target_speed"):
        assert getattr(drive, name) == pytest.approx(getattr(crane, name), rel=1e-3), name
    assert drive.assumed == Chain.load("crane-4-mass").assumed
    best = compare(drive, ["direct", "reduced-first-stage"])
    assert best.rows[0].run.k_dyn == pytest.approx(compare(crane, ["direct"]).rows[0].run.k_dyn, rel=2e-3)


def test_motor_behind_the_load() -> None:
    """The same chain named from the other end is the same drive."""
    chain = Chain.load("crane-4-mass")
    there = chain.brought_to("motor")
    back = Chain(
        there.masses[::-1],
        there.shafts[::-1],
        there.motor,
        load_mass="crane",
        target_speed=there.target_speed,
    )
    for method in ("lever", "modal"):
        one: Reduction = reduce_chain(chain, method=method)  # type: ignore[arg-type]
        other: Reduction = reduce_chain(back, method=method)  # type: ignore[arg-type]
        for name in ("J1", "J2", "c", "gap", "Mc"):
            assert getattr(other.to_drive(), name) == pytest.approx(getattr(one.to_drive(), name), rel=1e-9)


def test_the_motor_and_the_load_stay_apart() -> None:
    chain = Chain.load("tractor-like")
    reduced = reduce_chain(chain, 2, force=True).reduced
    assert "flywheel" in reduced.masses[0].name
    assert "18 track and tractor" in reduced.masses[1].name
    assert reduced.motor is not None
    assert reduced.motor_index == 0


def test_refused_where_a_partial_system_swings_too_low() -> None:
    chain = Chain.load("tractor-like")
    with pytest.raises(InputError, match=r"swings at 206\.66 rad/s.* = 8\.94 is below the 10.*--force"):
        reduce_chain(chain, 2)
    forced = reduce_chain(chain, 2, force=True)
    assert forced.forced
    assert forced.least_ratio == pytest.approx(8.937, rel=1e-3)
    far = reduce_chain(chain, up_to=70.0)
    assert not far.forced
    assert len(far.reduced.masses) == 3


def test_refused_where_a_piece_between_the_gaps_swings_too_low() -> None:
    """[R]: w(1)^2 >> w^2 of the halves; here a light inner mass on a soft spring."""
    chain = Chain([Mass(1), Mass(0.9), Mass(1e-3), Mass(1)], [Shaft(100), Shaft(1e4, gap=0.1), Shaft(1e4)])
    assert [names for names, _ in pieces(chain)] == [("mass 1", "mass 2"), ("mass 3", "mass 4")]
    with pytest.raises(InputError, match="with open gaps the piece mass 1 - mass 2"):
        reduce_chain(chain, 2)


def test_refused_where_the_node_is_not_between_motor_and_load() -> None:
    chain = Chain([Mass(1), Mass(1), Mass(100)], [Shaft(1000), Shaft(1)], Motor(1.0), load_mass="mass 2")
    with pytest.raises(InputError, match="does not lie between the motor"):
        reduce_chain(chain, method="modal", force=True)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"to": 1}, "from 2 to 4"),
        ({"to": 5}, "from 2 to 4"),
        ({"method": "levr"}, "'lever' or 'modal'"),
        ({"to": 3, "method": "modal"}, "gives two masses"),
        ({"factor": 0.5}, "1 or more"),
        ({"up_to": 1.0}, "lowest elastic frequency"),
        ({"to": 2, "up_to": 700.0}, "more than 2 masses"),
    ],
)
def test_what_cannot_be_asked(options: dict[str, object], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        reduce_chain(Chain.load("crane-4-mass"), **options)  # type: ignore[arg-type]


def test_no_drive_without_motor_or_target() -> None:
    with pytest.raises(InputError, match="starting torque"):
        reduce_chain(row([1, 1e-6, 1], [1, 1]), 2).to_drive()
    chain = Chain([Mass(1), Mass(1e-6), Mass(1)], [Shaft(1), Shaft(1)], Motor(5.0))
    with pytest.raises(InputError, match="target_speed"):
        reduce_chain(chain, 2).to_drive()
    with pytest.raises(InputError, match="two masses"):
        reduce_chain(Chain.load("crane-4-mass"), 3, force=True).to_drive()


def test_notes_say_what_is_left_out() -> None:
    chain = Chain(
        [Mass(1), Mass(1e-3, torque=1, kind="reactive", damping=0.1), Mass(1, torque=2)],
        [Shaft(10), Shaft(10, efficiency=0.9)],
    )
    notes = " ".join(reduce_chain(chain, 2).notes)
    assert "both kinds" in notes
    assert "damping to the ground" in notes
    assert "0.9" in notes


def test_reduction_is_deterministic() -> None:
    chain = Chain.load("tractor-like")
    assert reduce_chain(chain, up_to=70.0).summary() == reduce_chain(chain, up_to=70.0).summary()
