"""Quantities: what is read, how exactly, and what is refused with which remedy."""

import contextlib
import math
import re
import subprocess
import sys
from decimal import Decimal

import numpy as np
import pint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import quantities
from softstart.errors import InputError
from softstart.quantities import QUANTITIES, TYPED, shortest, to_si, values_in

READ = [
    ("90°", "rad", math.pi / 2),
    ("0.88 krpm", "rad/s", 880 * 2 * math.pi / 60),
    ("5 rad·s⁻¹", "rad/s", 5.0),
    ("0.035 kg·m²", "kg*m^2", 0.035),
    *((f"2 {one}", "kg*m^2", 2.0) for one in ("kgm2", "kg-m2", "Nms²")),
    *((f"2 {one}", "kg*m^2", 2e-4) for one in ("kgcm2", "kgcm²")),
    *((f"2 {one}", "kg*m^2", 2e-7) for one in ("g*cm2", "gcm2")),
    *((f"1460 {one}", "rad/s", 1460 * math.pi / 30) for one in ("1/min", "min⁻¹", "U/min")),
    ("0.1 kgf*m*s^2", "kg*m^2", 0.980665),
    ("1.5 Nms/rad", "N*m*s/rad", 1.5),  # not the plural of Nm/rad
    ("1 lbf*ft", "N*m", 1.3558179483314004),
    # pounds and ounces of torque are force, those of inertia mass: 0.45359237 kg, 9.80665 m/s2, 0.3048 m
    *((f"1 {one}", "N*m", 0.45359237 * 9.80665 * 0.3048) for one in ("lb-ft", "ft-lb", "lb ft", "ft·lbs")),
    *((f"1 {one}", "N*m", 0.45359237 * 9.80665 * 0.0254) for one in ("in-lb", "lb·in", "lbf-in")),
    *((f"1 {one}", "N*m", 0.45359237 / 16 * 9.80665 * 0.0254) for one in ("oz-in", "in.oz", "ozf*in")),
    ("1 lb-ft/deg", "N*m/rad", 0.45359237 * 9.80665 * 0.3048 * 180 / math.pi),
    ("1 lb-ft^2", "kg*m^2", 0.45359237 * 0.3048**2),
    ("1 oz-in²", "kg*m^2", 0.45359237 / 16 * 0.0254**2),
    ("1 lb-in-s^2", "kg*m^2", 0.45359237 * 9.80665 * 0.0254),
    ("1 lb-ft", "kg*m", 0.45359237 * 0.3048),  # an imbalance is a mass on a radius
    # a flywheel moment GD^2 is a weight on the square of a diameter: J = G/g (D/2)^2
    *((f"0.14 {one}", "kg*m^2", 0.035) for one in ("kgf*m^2", "kp m²", "kgfm2")),
    ("0.14 N*m^2", "kg*m^2", 0.14 / 9.80665 / 4),
    *((f"350{one} kg*m^2", "kg*m^2", 0.035) for one in ("x10^-4", " x 10^-4", "×10⁻⁴", "·10^-4", "x10-4")),
    ("-2.5x10^+2 N*m", "N*m", -250.0),
    ("1 N*m/rpm", "N*m*s/rad", 60 / (2 * math.pi)),
    ("1 hp", "W", 745.6998715822702),
    ("\N{MINUS SIGN}5 N*m", "N*m", -5.0),
    (3, "rad", 3.0),
    (np.float32(0.5), "rad", 0.5),
    (Decimal("0.5"), "rad", 0.5),
    (np.array(0.5), "rad", 0.5),
]


@pytest.mark.parametrize(("value", "unit", "expected"), READ, ids=str)
def test_is_read(value, unit, expected):
    found = to_si(value, unit)
    assert type(found) is float
    assert found == pytest.approx(expected, rel=1e-15)


REFUSED = [
    ("5 N*m", "N*m/rad", 'N*m is a torque, but a stiffness is per angle; write "5 N*m/rad" or "5 N*m/deg"'),
    ("5 N*m/rad", "N*m", 'N*m/rad is a stiffness, not a torque; write "5 N*m"'),
    ("5 lbf*ft^2", "kg*m^2", "a flywheel moment; write GD^2 in kgf*m^2, and WK^2 in lb*ft^2"),
    ("5 lb", "N*m", "lb is a mass, not a torque"),
    ("5x10 N*m", "N*m", '"x10 N*m" is no unit'),
    ("5e1x10^2 N*m", "N*m", '"x10^2 N*m" is no unit'),
    ("5 ms at output", "s", '"at output" does not apply here; leave it out'),
    ("5 radd", "rad", 'unknown unit "radd" (did you mean "rad"?)'),
    ("5 %", "rad", '"%" is no unit'),
    ("5 rad^99", "rad", '"rad^99" is no unit'),
    ("0,5 rad", "rad", "a comma may divide decimals or thousands"),
    ("rad", "rad", "this is not a number with a unit"),
    ("", "rad", "this is not a number with a unit"),
    (math.nan, "rad", "this is not a number"),
    ("1e999 rad", "rad", "it must be finite"),
    ("1e-323 mrad", "rad", "the number is too small"),
    (10**400, "rad", "the number is too large"),
    (True, "rad", "true and false are not quantities"),
    (None, "rad", "there is no value"),
    ({}, "rad", "a table is not a quantity"),
    ([], "rad", "an empty list holds no value"),
]


@pytest.mark.parametrize(("value", "unit", "reason"), REFUSED, ids=lambda v: str(v)[:30])
def test_is_refused(value, unit, reason):
    with pytest.raises(InputError) as error:
        to_si(value, unit, name="key")
    (sentence,) = error.value.sentences
    assert sentence.startswith("key")
    assert reason in sentence
    assert sentence.endswith(".")


@pytest.mark.parametrize("quantity", QUANTITIES.values(), ids=str)
def test_the_example_of_each_quantity_is_one(quantity):
    assert to_si(quantity.example, quantity.unit) > 0


def test_arrays_keep_their_shape_and_name_the_bad_element():
    found = to_si([["1 deg", 2], [0.5, "1 rad"]], "rad")
    np.testing.assert_allclose(found, [[math.pi / 180, 2], [0.5, 1]], rtol=1e-15)
    with pytest.raises(InputError, match=r'^gap\[1, 0\] = "1 m": m is a length'):
        to_si([["1 deg", 2], ["1 m", 1]], "rad", name="gap")
    with pytest.raises(InputError, match=r"^gap\[2\] = nan: this is not a number"):
        to_si(np.array([0.0, 1.0, math.nan]), "rad", name="gap")
    with pytest.raises(InputError, match=r"^gap\[0\] = True"):
        to_si(np.array([True]), "rad", name="gap")


def test_infinity_only_where_it_is_let_through():
    assert to_si("inf N*m/s", "N*m/s", infinite=True) == math.inf
    assert to_si(math.inf, "N*m/s", infinite=True) == math.inf
    with pytest.raises(InputError, match="not a number"):
        to_si(math.nan, "N*m/s", infinite=True)


def test_quantities_of_a_users_own_pint_registry():
    registry = pint.UnitRegistry()
    assert to_si(registry.Quantity(880, "rpm"), "rad/s") == pytest.approx(880 * math.pi / 30)
    np.testing.assert_allclose(
        to_si(registry.Quantity([1, 2], "N*m/deg"), "N*m/rad"), [57.29577951, 114.591559]
    )
    with pytest.raises(InputError, match="is a length"):
        to_si(registry.Quantity(1, "m"), "rad")


@given(
    st.sampled_from(sorted(QUANTITIES)),
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(1, 99_999),
    st.integers(0, 3),
)
def test_the_shortest_text_is_read_back_to_the_bit(unit, number, count, decimals):
    assert to_si(shortest(number, unit), unit) == number
    for one in TYPED.get(unit, ()):
        typed = f"{count / 10**decimals} {one}"
        text = shortest(to_si(typed, unit), unit)
        assert to_si(text, unit) == to_si(typed, unit)
        assert len(text) <= max(9, len(typed), len("99.99 N*m/arcmin"))


@settings(deadline=None)  # the first example imports pint
@given(st.integers(-(10**6), 10**6), st.sampled_from(["m", "µ", "n", "k"]))
def test_decimal_prefixes_are_correctly_rounded(number, prefix):
    exponent = {"m": "e-3", "µ": "e-6", "n": "e-9", "k": "e3"}[prefix]
    assert to_si(f"{number} {prefix}s", "s") == float(f"{number}{exponent}")


@settings(deadline=None)  # the first example imports pint
@given(
    st.text("0123456789.eE+-*/^() Nmradskgf1°µ²⁻·_%,inf", max_size=14), st.sampled_from(sorted(QUANTITIES))
)
def test_any_text_is_read_or_refused(text, unit):
    for value in (text, f"5 {text}"):
        with contextlib.suppress(InputError):
            assert math.isfinite(to_si(value, unit))


def test_ordinary_units_do_not_import_pint():
    code = (
        "import sys; from softstart.quantities import to_si; to_si(1.0, 'rad'); to_si('2', 'rad');"
        "to_si('62 N*m', 'N*m'); to_si('880 rpm', 'rad/s'); assert 'pint' not in sys.modules;"
        "to_si('1 kgf*m', 'N*m'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_ordinary_units_are_those_of_pint(monkeypatch):
    known = dict(quantities.ORDINARY)
    monkeypatch.setattr(quantities, "ORDINARY", {})
    for (written, unit), factor in known.items():
        assert to_si(f"1 {written}", unit) == factor
    for unit in set(QUANTITIES) - {"1"}:
        assert to_si(f"0.37 {unit}", unit) == to_si(f"0.37 ({unit})", unit) == 0.37


def test_every_unit_has_the_size_that_pint_has_by_itself():
    """In its own list, where angles have no dimension and the base unit of mass is the kilogram."""
    theirs = pint.UnitRegistry()
    called = {"PS": "metric_horsepower", "kp": "kgf", "h": "hour"} | dict.fromkeys(("U", "r", "rev"), "turn")
    lines = [line for line in quantities._DEFINITIONS.splitlines() if "- =" not in line]
    names = {name for line in lines for name in re.findall(r"[^\W\d]\w*(?= =|$)", line)}
    assert len(names) > 50
    for name in names | set(quantities._USUAL.split()):
        size, dimensions = quantities.read_unit(name)
        exact = theirs.Quantity(1.0, called.get(name, name)).to_base_units().magnitude
        assert size / 1000.0 ** dict(dimensions).get("[mass]", 0.0) == pytest.approx(exact, rel=1e-12), name
    assert to_si("3600 arcsec", "rad") == to_si("60 arcmin", "rad") == pytest.approx(math.pi / 180, rel=1e-15)


# each can be read in two ways, or has a mark too many
DOUBTFUL = {
    "1.5, 2,5": '"1.5, 2, 5" for 3 values, or "1.5, 2.5" for 2',
    "0,5 rad,1 rad": '"0.5 rad, 1 rad"',
    "1,500; 2,000": "may divide thousands",
    "1.000,5": '"1.000, 5" for 2 values, or "1000.5" for 1',
    "1,5; 2.5": "has a comma",
    "1,,2": "a place in the list is empty",
    "1," * 5000 + "1": "a comma may divide values or decimals",
}


@pytest.mark.parametrize("text", DOUBTFUL, ids=lambda text: text[:20])
def test_a_list_that_can_be_read_in_two_ways_is_refused(text):
    with pytest.raises(InputError) as error:
        values_in(text, "--gaps")
    (sentence,) = error.value.sentences
    assert sentence.startswith("--gaps = ")
    assert DOUBTFUL[text] in sentence
    assert len(sentence) < 400
