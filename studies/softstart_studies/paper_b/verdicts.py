"""What [B] claims, and the number that decides each."""

from __future__ import annotations

import numpy as np

from softstart.balancing import Balance, Counterweights
from softstart.balancing.design import free_force
from softstart.balancing.engine import ORDERS, largest_of_orders, shaking_of_crank
from softstart.study import Claim, Verdict
from softstart_studies.paper_b.orders import series_difference
from softstart_studies.paper_b.tables import curves
from softstart_studies.paper_b.vaz import (
    FORCE,
    MOMENTS,
    RADIUS,
    RPM,
    TUNING,
    VAZ,
    balanced,
    first_order,
    left_at_load,
    pressure_needed,
    sine_at_corners,
)

TINY = 1e-9  # N or N m: rounding


def tiny(value: float) -> str:
    """A number that is zero but for rounding.

    >>> tiny(0.0), tiny(2.8e-14)
    ('0', '3e-14')
    """
    return f"{value:.0e}" if value else "0"


def claims(found: Balance | None = None) -> list[Claim]:
    """All of them.

    >>> len(claims())
    10
    """
    found = found or balanced()
    return [
        forces_vanish(found),
        gas_orders(),
        inertia_orders(),
        formula_4(),
        formula_5(),
        speed_dependence(found),
        fixed_arm(found),
        variable_arm(found),
        inertia_alone(found),
        all_orders(found),
    ]


def forces_vanish(found: Balance) -> Claim:
    """Counterweights and shafts against the first-order force."""
    i = found.tuning_index
    none, fixed = found.residual("none"), found.residual("fixed-h")
    whole = shaking_of_crank(VAZ.cylinders, VAZ.masses, Counterweights(0.0, 0.0))[0]
    bare = largest_of_orders(whole)[1] * found.tuning_speed**2
    return Claim(
        "Two shafts against the crank and counterweights for half of the reciprocating masses balance the "
        "centrifugal forces and the first-order inertia force completely.",
        Verdict.CONFIRMED if fixed.first_order_force.max() < TINY else Verdict.REFUTED,
        f"First order at 4500 rpm: {bare:.0f} N without anything, {none.first_order_force[i]:.0f} N with "
        f"the counterweights, {tiny(fixed.first_order_force[i])} N with the shafts too. The even orders "
        f"stay: up to {fixed.force[i]:.0f} N.",
    )


def gas_orders() -> Claim:
    """Which orders of the gas torque there are."""
    harmonics = np.abs(VAZ.gas_harmonics(TUNING * RPM, 1.0))
    halves = float(harmonics[1::2].max())
    return Claim(
        "(2): the gas torque of z evenly firing cylinders has the orders k z/2 only.",
        Verdict.CONFIRMED if halves < TINY < harmonics[2] else Verdict.REFUTED,
        f"Two cylinders: orders 1, 2, 3 of {harmonics[2]:.1f}, {harmonics[4]:.1f}, {harmonics[6]:.1f} N m; "
        f"the orders 1/2, 3/2 .. of at most {tiny(halves)} N m. In (2) the sums of A and B are those of "
        "one cylinder, times z.",
    )


def inertia_orders() -> Claim:
    """The inertia torque as a sum of sines."""
    ratio = VAZ.cylinders.crank.ratio
    difference = series_difference(ratio)
    phi = np.linspace(0.0, 2.0 * np.pi, 97)
    w = TUNING * RPM
    harmonics = w**2 * VAZ.inertia_harmonics
    series = (np.exp(1j * np.outer(phi, ORDERS)) @ harmonics).real
    error = float(np.abs(series - VAZ.inertia_torque(phi, w)).max())
    return Claim(
        "(3): the inertia torque is a sum of sines, m r^2 w^2 sum B_k sin k(phi + theta (i-1)).",
        Verdict.CONFIRMED if error < 1e-8 and difference < 1e-12 else Verdict.REFUTED,
        f"24 orders meet the exact crank drive within {tiny(error)} N m; B_k by FFT and by the power "
        f"series in lambda = {ratio:.4f} differ by {tiny(difference)}. B_1 = {-harmonics[2].imag:.1f} N m "
        "at 4500 rpm.",
    )


def formula_4() -> Claim:
    """The balancing force."""
    shafts, given = abs(free_force(VAZ)), FORCE / RPM**2
    whole, mass = 2.0 * shafts, given / RADIUS
    return Claim(
        "(4): the two-shaft mechanism makes F_b = 4.98e-4 n^2 N.",
        Verdict.PARTLY,
        f"That is m r = {given:.4f} kg m, {mass:.2f} kg on 35.5 mm. With the masses assumed the whole "
        f"first-order force has {whole:.4f} kg m ({100 * (given / whole - 1):+.0f} %), so (4) fits shafts "
        f"and counterweights together. The shafts alone carry half, {shafts:.4f} kg m; for (4) to be "
        f"theirs a cylinder would need {mass:.2f} kg of reciprocating mass instead of "
        f"{VAZ.masses.reciprocating:g} kg.",
    )


def formula_5() -> Claim:
    """The balancing moment, both readings."""
    sine = first_order()[1]
    low, high = sine_at_corners()
    moments = [(name, moment * TUNING**2) for name, moment in MOMENTS]
    readings = [(name, moment, 1e-5 * pressure_needed(moment)) for name, moment in moments]
    within = [name for name, moment, _ in readings if low <= moment <= high]
    said = "; ".join(
        f"read with {name} it is {moment:.1f} N m, which needs a mean indicated pressure of {pressure:.1f} "
        "bar"
        for name, moment, pressure in readings
    )
    assumed = 1e-5 * VAZ.indicated_work(TUNING * RPM, 1.0) / VAZ.displacement
    h = [1e3 * moment / FORCE for _, moment in MOMENTS]
    return Claim(
        "(5): at the tuning speed the shafts' moment 2.099e-5 n^2 (or e-6) N m balances the first-order "
        "reaction torque.",
        Verdict.PARTLY if within else Verdict.REFUTED,
        f"By (4) and (5) h is {h[0]:.1f} or {h[1]:.2f} mm. The model has {sine:.1f} N m ({low:.0f} to "
        f"{high:.0f} over the corners of what is assumed); (5) {said}. Assumed are {assumed:.1f} bar.",
    )


def speed_dependence(found: Balance) -> Claim:
    """How gas and inertia depend on the speed."""
    one = curves(found)
    spread = float(100.0 * np.ptp(one.gas) / one.gas.mean())
    light = abs(VAZ.gas_harmonics(TUNING * RPM, 0.0)[2])
    full = abs(VAZ.gas_harmonics(TUNING * RPM, 1.0)[2])
    return Claim(
        "Inertia and balancing moments grow with n^2, the gas moment hardly depends on n.",
        Verdict.PARTLY if spread > 5.0 or light < 0.5 * full else Verdict.CONFIRMED,
        f"The first two exactly. The gas moment of first order is {one.gas.min():.0f} to "
        f"{one.gas.max():.0f} N m over the speeds at full load (the assumed torque curve), {spread:.0f} % "
        f"of its mean, while that of inertia grows from {one.inertia.min():.1f} to "
        f"{one.inertia.max():.1f}; but it depends on the load: {full:.0f} N m at full load, {light:.0f} at "
        "load 0 (4500 rpm).",
    )


def fixed_arm(found: Balance) -> Claim:
    """A fixed arm is complete at one speed."""
    i = found.tuning_index
    none, fixed, both = (found.residual(name) for name in ("none", "fixed-h", "fixed-h-e"))
    assert fixed.height is not None
    assert both.offset is not None
    left, with_both = fixed.first_order_moment[i], both.first_order_moment
    elsewhere = np.delete(with_both, i)
    cosine, sine, amplitude = first_order()
    equal_amplitude = float(np.hypot(cosine, sine - amplitude))
    return Claim(
        "With h fixed, the balance of the first-order reaction torque is complete at the tuning speed only.",
        Verdict.CONFIRMED if left < TINY else Verdict.PARTLY,
        f"At 4500 rpm h = {1e3 * fixed.height[i]:.1f} mm leaves {left:.1f} of "
        f"{none.first_order_moment[i]:.1f} N m: the sine goes, the cosine that the gas has stays (with M_b "
        f"equal in amplitude instead, {equal_amplitude:.1f}). Shafts moved sideways too, by e = "
        f"{1e3 * both.offset[i]:.1f} mm, leave {tiny(with_both[i])} there and at least "
        f"{elsewhere.min():.1f}, at most {with_both.max():.0f} N m at the other speeds computed.",
    )


def variable_arm(found: Balance) -> Claim:
    """An arm over the speed."""
    variable, both = found.residual("variable-h"), found.residual("variable-h-e")
    assert variable.height is not None
    low, high = 1e3 * variable.height[[0, -1]]
    moment, with_both = variable.first_order_moment, both.first_order_moment
    without, left = left_at_load(0.0, TUNING, sideways=True)
    return Claim(
        "Moved so that h = h(n), the shafts balance it completely over the whole speed range.",
        Verdict.CONFIRMED if moment.max() < TINY else Verdict.PARTLY,
        f"h(n) alone leaves {moment.min():.0f} to {moment.max():.0f} N m, the cosine; h(n) and e(n) leave "
        f"{tiny(with_both.max())}. It takes {low:.0f} mm at 850 rpm and {high:.0f} mm at 5600 rpm, and holds "
        f"at one load: set for full load, they leave {left:.0f} N m at load 0 and 4500 rpm, where no shafts "
        f"at all leave {without:.0f}.",
    )


def inertia_alone(found: Balance) -> Claim:
    """Designed for the inertia only."""
    names = ("none", "inertia-only", "fixed-h", "fixed-h-e")
    none, alone, fixed, both = (found.residual(n).first_order_moment[found.tuning_index] for n in names)
    return Claim(
        "A balancer must be designed for the reaction torque of inertia and gas together.",
        Verdict.CONFIRMED if alone > fixed else Verdict.REFUTED,
        f"First order at 4500 rpm: {none:.1f} N m without shafts, {alone:.1f} with an arm for the inertia "
        f"alone, {fixed:.1f} with h for both, {tiny(both)} with h and e.",
    )


def all_orders(found: Balance) -> Claim:
    """Not in [B]: what the mounts feel."""
    i = found.tuning_index
    none, fixed, both = (found.residual(name) for name in ("none", "fixed-h", "fixed-h-e"))
    gain = fixed.moment[i] / none.moment[i]
    return Claim(
        "(Not in [B].) With its first order gone the reaction torque is small.",
        Verdict.REFUTED if both.moment[i] > 0.5 * none.moment[i] else Verdict.CONFIRMED,
        f"Largest alternating moment at 4500 rpm with all orders: {none.moment[i]:.0f} N m without shafts, "
        f"{fixed.moment[i]:.0f} with h ({100 * (gain - 1):+.0f} %), {both.moment[i]:.0f} with h and e: the "
        f"second order alone is {abs(VAZ.torque_harmonics(TUNING * RPM)[4]):.0f} N m.",
    )
