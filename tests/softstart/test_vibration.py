"""Natural frequencies, shapes and nodes against independent computations; the two masses, and refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal, getcontext
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import eigh
from tests.twin import chain_of

from softstart import Drive, simulate
from softstart.chain import Chain, Mass, Motor, Shaft, natural_vibration, reduce_chain
from softstart.errors import InputError
from softstart.vibration import elastic_frequencies, shapes
from softstart.views.chains import frequencies_table

Vector = NDArray[np.float64]


def stiffness_matrix(c: Vector) -> Vector:
    K = np.zeros((c.size + 1, c.size + 1))
    for k, stiffness in enumerate(c):
        K[k : k + 2, k : k + 2] += stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return K


def random_chain(rng: np.random.Generator, n: int, decades: float) -> tuple[Vector, Vector]:
    return 10 ** rng.uniform(-decades, decades, n), 10 ** rng.uniform(-decades, decades, n - 1)


def test_frequencies_of_equal_masses_and_springs() -> None:
    """Closed form: 2 sqrt(c/J) sin(k pi/(2 n))."""
    n = 200
    found = elastic_frequencies(np.full(n, 0.25), np.full(n - 1, 9.0))
    exact = [2.0 * 6.0 * math.sin(k * math.pi / (2 * n)) for k in range(1, n)]
    np.testing.assert_allclose(found, exact, rtol=1e-14)


def count_below(J: list[Decimal], c: list[Decimal], square: Decimal) -> int:
    """How many natural frequencies, the rigid one among them, lie below: signs of the pivots of K - w^2 J."""
    count, pivot = 0, Decimal(0)
    for k in range(len(J)):
        diagonal = (c[k - 1] if k else 0) + (c[k] if k < len(c) else 0) - square * J[k]
        pivot = Decimal(diagonal) - (c[k - 1] * c[k - 1] / pivot if k else 0)
        count += pivot < 0
    return count


@pytest.mark.parametrize("seed", range(2))
def test_frequencies_keep_their_digits_over_many_decades(seed: int) -> None:
    """80 digits: each frequency lies within 4e-15 of itself; a dense solver keeps none of the lowest."""
    getcontext().prec = 80
    rng = np.random.default_rng(seed)
    J, c = random_chain(rng, 9, 5.0)
    exact_J, exact_c = [Decimal(float(x)) for x in J], [Decimal(float(x)) for x in c]
    for i, w in enumerate(elastic_frequencies(J, c)):
        low, high = (Decimal(float(w)) * Decimal(1 + side) for side in (-4e-15, 4e-15))
        assert count_below(exact_J, exact_c, low * low) <= i + 1 < count_below(exact_J, exact_c, high * high)


@pytest.mark.parametrize("decades", [1.0, 6.0])
def test_shapes_are_orthogonal_and_give_their_frequency_back(decades: float) -> None:
    rng = np.random.default_rng(3)
    for n in (2, 3, 8, 20, 40):
        J, c = random_chain(rng, n, decades)
        omega = elastic_frequencies(J, c)
        x = shapes(J, c, omega)
        assert np.abs(x).max(axis=1) == pytest.approx(np.ones(n - 1))
        normal = x * np.sqrt(J) / np.sqrt((x * x) @ J)[:, None]
        np.testing.assert_allclose(normal @ normal.T, np.eye(n - 1), atol=1e-12)
        np.testing.assert_allclose(normal @ np.sqrt(J) / math.sqrt(J.sum()), 0.0, atol=1e-12)  # no momentum
        rayleigh = np.sqrt((np.diff(x, axis=1) ** 2 @ c) / ((x * x) @ J))
        np.testing.assert_allclose(rayleigh, omega, rtol=1e-12)


def test_torques_balance_every_mass_and_nodes_rest() -> None:
    """J Omega^2 x is what the shaft behind carries more than the one before; mode m has m nodes."""
    vibration = natural_vibration(Chain.load("tractor-like"))
    arrays = vibration.chain.at_motor_shaft()
    rows = zip(vibration.Omega, vibration.shape, vibration.torque, vibration.nodes, strict=True)
    for m, (Omega, x, torque, nodes) in enumerate(rows):
        inertial = arrays.J * Omega**2 * x
        scale = np.abs(inertial).max() + 1e-300
        np.testing.assert_allclose(np.diff(torque, prepend=0.0, append=0.0), inertial, atol=1e-12 * scale)
        np.testing.assert_allclose(torque, arrays.c * (x[:-1] - x[1:]), atol=1e-9 * scale)
        assert len(nodes) == m
        for node in nodes:
            before, after = x[node.shaft : node.shaft + 2]
            assert before + node.share * (after - before) == pytest.approx(0.0, abs=1e-15)


def test_rigid_joints_move_as_one_mass() -> None:
    rigid = Chain(
        [Mass(1), Mass(2), Mass(3), Mass(4)],
        [Shaft(5), Shaft(gap=0.1, restitution=0.5, ratio=2), Shaft("inf")],
    )
    one = Chain([Mass(1), Mass(2 + (3 + 4) / 4)], [Shaft(5)])
    vibration = natural_vibration(rigid)
    np.testing.assert_allclose(vibration.Omega, natural_vibration(one).Omega, rtol=1e-15)
    assert vibration.shape[1, 1] == vibration.shape[1, 2] == vibration.shape[1, 3]
    assert vibration.torque[1, 2] == pytest.approx(-(4 / 4) * vibration.Omega[1] ** 2 * vibration.shape[1, 3])
    with pytest.raises(InputError, match="nothing vibrates"):
        natural_vibration(Chain([Mass(1), Mass(1)], [Shaft("inf")]))


# two masses --------------------------------------------------------------------------------------------


@given(st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_two_masses_have_frequency_node_inertia_gap_and_load_of_the_chain(seed: int) -> None:
    """Frequency and node of the drive, as a chain, against a dense solver for the whole one."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 10))
    masses = [Mass(x, torque=float(rng.uniform(0, 5))) for x in 10 ** rng.uniform(-2, 1, n)]
    shafts = [Shaft(x, gap=float(rng.uniform(0, 0.1))) for x in 10 ** rng.uniform(1, 5, n - 1)]
    chain = Chain(masses, shafts, Motor(100.0), target_speed=10.0)
    drive = reduce_chain(chain, force=True).to_drive()
    arrays = chain.at_motor_shaft()
    squares, modes = eigh(stiffness_matrix(arrays.c), np.diag(arrays.J))
    first, last = modes[[0, -1], 1]
    assert drive.Omega == pytest.approx(math.sqrt(squares[1]), rel=1e-6)
    two = natural_vibration(chain_of(drive)).shape[1]
    assert two[1] / two[0] == pytest.approx(last / first, rel=1e-5)
    assert pytest.approx(arrays.J.sum(), rel=1e-12) == drive.J1 + drive.J2
    assert drive.gap == pytest.approx(arrays.gap.sum(), rel=1e-12)
    assert drive.Mc == pytest.approx(arrays.Mc.sum(), rel=1e-12)


def test_the_damping_of_the_mode_is_kept() -> None:
    """Decay rate of the first elastic mode, from the eigenvalues of the damped systems."""
    chain = Chain.load("tractor-like")
    decays = []
    for one in (chain, chain_of(reduce_chain(chain).to_drive())):
        arrays = one.at_motor_shaft()
        n = arrays.J.size
        K, D = stiffness_matrix(arrays.c), stiffness_matrix(arrays.d)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / arrays.J[:, None], -D / arrays.J[:, None]]])
        values = np.linalg.eigvals(A)
        elastic = values[values.imag > 1.0]
        decays.append(elastic[np.argmin(elastic.imag)].real)
    assert decays[1] == pytest.approx(decays[0], rel=2e-3)  # light damping: first order


def test_motor_behind_the_load() -> None:
    """The same chain named from the other end is the same drive."""
    there = Chain.load("crane-4-mass").brought_to("motor")
    back = Chain(
        there.masses[::-1],
        there.shafts[::-1],
        there.motor,
        load_mass="crane",
        target_speed=there.target_speed,
    )
    one, other = reduce_chain(there).to_drive(), reduce_chain(back).to_drive()
    for name in ("J1", "J2", "c", "gap", "Mc"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-9)


@pytest.mark.parametrize("reverse", [False, True], ids=["motor first", "motor last"])
def test_the_gear_may_sit_anywhere_and_the_output_torque_is_the_same(reverse: bool) -> None:
    """20:1 as one gear or two, before or behind each shaft: the same values seen from the motor."""

    def built(ratios: tuple[float, float], sides: tuple[Any, Any]) -> Chain:
        speeds = np.cumprod([1.0, *(1.0 / one for one in ratios)])
        masses = [Mass(J / w**2) for J, w in zip([0.03, 0.02, 0.16], speeds, strict=True)]
        masses[-1] = masses[-1].replace(torque=7.16 / speeds[-1], kind="active")
        shafts = []
        for k, (c, gap) in enumerate([(4000.0, 0.1), (400.0, 0.3)]):
            w = speeds[k + (sides[k] == "after")]
            ratio = 1.0 / ratios[k] if reverse else ratios[k]
            side = {"before": "after", "after": "before"}[sides[k]] if reverse else sides[k]
            shafts.append(Shaft(c / w**2, gap=gap * w, ratio=ratio, side=side))
        if reverse:
            masses, shafts = masses[::-1], shafts[::-1]
        load = f"mass {1 if reverse else 3}"
        motor = Motor(62.0, mass=f"mass {3 if reverse else 1}")
        return Chain(masses, shafts, motor, load_mass=load, target_speed="880 rpm")

    plain = reduce_chain(built((1.0, 1.0), ("before", "before"))).to_drive()
    assert plain.gear is None
    torque = 20.0 * simulate(plain, "direct").peak_torque
    for ratios in ((20.0, 1.0), (1.0, 20.0), (4.0, 5.0), (40.0, 0.5)):
        for sides in (("before", "before"), ("after", "after"), ("before", "after")):
            drive = reduce_chain(built(ratios, sides)).to_drive()
            assert drive.gear_ratio == pytest.approx(20.0, rel=1e-14)
            there = Drive.from_toml(drive.to_toml())  # as `reduce --out` writes it
            assert simulate(there, "direct").peak_torque_at_output == pytest.approx(torque, rel=1e-9)


def test_the_output_torque_of_the_reduced_drive_is_that_in_the_shaft_of_the_output() -> None:
    """Two masses are no approximation: the shaft behind the gear carries this torque in the chain."""
    shaft = Shaft("150 kN*m/rad", gap="0.025 rad", ratio=20, side="after")
    chain = Chain(
        [Mass(0.035), Mass(70, torque=143.2, kind="active")], [shaft], Motor(62), target_speed="880 rpm"
    )
    own = simulate(chain, "ramp").peak_torques[0] / chain.at_motor_shaft().torque_ratio[0]
    drive = reduce_chain(chain).to_drive()
    assert simulate(drive, "ramp").peak_torque_at_output == pytest.approx(own, rel=1e-9)
    assert drive.at_output["stiffness"] == pytest.approx(150e3, rel=1e-12)
    assert drive.at_output["load_torque"] == pytest.approx(143.2, rel=1e-12)


EQUAL = Chain([Mass(1), Mass(1), Mass(1)], [Shaft(100), Shaft(100)])  # Omega = 10 and 10 sqrt(3) rad/s
# [R]: w(1)^2 >> w^2 of the halves; here a light inner mass on a soft spring
SOFT = Chain([Mass(1), Mass(0.9), Mass(1e-3), Mass(1)], [Shaft(100), Shaft(1e4, gap=0.1), Shaft(1e4)])
BEYOND = Chain([Mass(1), Mass(1), Mass(100)], [Shaft(1000), Shaft(1)], Motor(1.0), load_mass="mass 2")


@pytest.mark.parametrize(
    ("chain", "options", "said"),
    [
        (EQUAL, {}, r"the second mode .* 17\.3205 rad/s.* = 3 is below the 10.*--force"),
        (SOFT, {}, "with open gaps the piece mass 1 - mass 2 vibrates at"),
        (BEYOND, {"force": True}, "does not lie between the motor"),
        (replace(BEYOND, load_mass="mass 1"), {}, "motor and load are the same mass"),
        (EQUAL, {"factor": 0.5}, "1 or more"),
    ],
)
def test_refused_where_two_masses_are_too_few(chain: Chain, options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        reduce_chain(chain, **options)


def test_a_reduction_that_is_forced_says_so() -> None:
    forced = reduce_chain(EQUAL, force=True)
    assert forced.forced
    assert forced.least_ratio == pytest.approx(3.0, rel=1e-12)
    assert not reduce_chain(EQUAL, factor=2.0).forced


# a mass at rest ----------------------------------------------------------------------------------------

TEXTBOOK = Chain(
    [Mass(5.0, name="A"), Mass(11.0, name="B"), Mass("inf", name="C")],
    [Shaft(0.1e6), Shaft(0.2e6)],
    Motor(100.0),
    load_mass="B",
    target_speed="100 rpm",
)


def turned(chain: Chain) -> Chain:
    """The same chain from its other end: ratios inverted, shafts on the other side of their gears."""
    shafts = [
        one.replace(ratio=1.0 / one.ratio, side="after" if one.side == "before" else "before")
        for one in chain.shafts[::-1]
    ]
    return replace(chain, masses=chain.masses[::-1], shafts=tuple(shafts))


def test_a_chain_held_at_its_end_is_reduced_as_it_is() -> None:
    """Eigenvalues of [[0.1, -0.1], [-0.1, 0.3]] MN m/rad and diag(5, 11): with the wall, not without it."""
    K = 1e6 * np.array([[0.1, -0.1], [-0.1, 0.3]])
    exact = np.sqrt(eigh(K, np.diag([5.0, 11.0]), eigvals_only=True))
    assert exact == pytest.approx([98.3394, 193.9126], abs=1e-4)
    free = math.sqrt(0.1e6 * (1 / 5 + 1 / 11))
    for chain in (TEXTBOOK, turned(TEXTBOOK)):
        vibration = natural_vibration(chain)
        assert list(vibration.modes) == [1, 2]
        assert [mode["Omega"] for mode in vibration.summary()["modes"]] == pytest.approx(exact, rel=1e-12)
        with pytest.raises(InputError, match=r"held at rest by C vibrates at 98\.3394 rad/s.*--force"):
            reduce_chain(chain)
        found = reduce_chain(chain, force=True)
        assert found.forced
        assert found.least_ratio == pytest.approx((exact[0] / free) ** 2, rel=1e-12)
        assert found.vibration.Omega[1:] == pytest.approx(exact, rel=1e-12)
        assert (found.whole.Omega, found.reduced.Omega) == pytest.approx((exact[0], free), rel=1e-12)
        assert math.isnan(found.whole.node)
        assert found.chain is chain
        assert chain.warnings[0].startswith("C stays at rest")
        columns = zip(*frequencies_table(vibration).rows, strict=True)
        assert [list(one) for one in columns][1:3] == [["1", "2"], ["98.339", "193.913"]]
    both = [Mass("inf", name="wall"), *TEXTBOOK.masses]
    with pytest.raises(InputError, match="one mass may stay at rest"):
        Chain(both, [Shaft(1.0), *TEXTBOOK.shafts], Motor(1.0, mass="A"), load_mass="B")
    with pytest.raises(InputError, match="same mass"):
        reduce_chain(Chain([Mass(1.0), Mass("inf")], [Shaft(5.0)], Motor(1.0)), force=True)


@given(st.integers(0, 10**6), st.booleans())
@settings(max_examples=25, deadline=None)
def test_frequencies_with_a_mass_at_rest_at_either_end_of_gears(seed: int, at_motor: bool) -> None:
    """A dense solver in the angles of each mass's shaft, with every gear and side, unit and order."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    J, ratios = 10 ** rng.uniform(-1, 1, n), rng.choice([0.5, 1.0, 3.0, 7.0], n)
    c, sides = 10 ** rng.uniform(2, 4, n), rng.choice(["before", "after"], n)
    masses = [Mass(f"{1e4 * one:.17g} kg*cm^2", name=f"m{i}") for i, one in enumerate(J)]
    wall = Mass("inf", name="wall")
    shafts = [Shaft(one, ratio=i, side=side) for one, i, side in zip(c, ratios, sides, strict=True)]
    chain = Chain([wall, *masses] if at_motor else [*masses, wall], shafts)
    K = np.zeros((n + 1, n + 1))
    for k in range(n):  # the spring sees (angle before)/ratio - angle after on the slow side, [R]
        row = np.zeros(n + 1)
        row[k], row[k + 1] = (1.0 / ratios[k], -1.0) if sides[k] == "after" else (1.0, -ratios[k])
        K += c[k] * np.outer(row, row)
    free = slice(1, None) if at_motor else slice(0, n)
    exact = np.sqrt(eigh(K[free, free], np.diag(J), eigvals_only=True))
    for one in (chain, turned(chain)):
        vibration = natural_vibration(one)
        assert vibration.Omega[list(vibration.modes)] == pytest.approx(exact, rel=1e-8)
