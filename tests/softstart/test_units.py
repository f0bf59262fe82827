"""Units and shaft in which a person sees results: read, shown, typed, and refused in one sentence."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softstart import Chain, Drive, InputError
from softstart.input.gear import NO_GEAR, NO_OUTPUT, Gear
from softstart.input.parameters import at_motor
from softstart.quantities import RefusedError, Units, parse
from softstart.views.numbers import seen, seen_at, units_of

GEAR = Gear(38.1, 0.95)
CRANE = Drive.load("crane-4amtkf")


def test_each_unit_of_torque_is_that_of_stiffness_and_damping_too() -> None:
    for text, size in (("kNm", 1000.0), ("kN m", 1000.0), ("ft-lb", 1.3558179483314), ("N*m", 1.0)):
        units = Units.read(f"{text}, deg")
        for si in ("N*m", "N*m/s", "N*m/rad", "N*m*s/rad"):
            assert units.shown(size, si) == pytest.approx(1.0, rel=1e-14)
            assert parse(f"1 {units.of(si)}", si) == pytest.approx(size, rel=1e-14)
        assert (units.of("kg*m^2"), units.of("N*m/A"), units.angle) == ("kg*m^2", "N*m/A", "deg")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("furlong", '"furlong" is no unit of an angle, a speed or a torque, and no shaft; write for example'),
        ("Nm/rad", '"Nm/rad" is no unit'),
        ("at wheel", '"at wheel" is no unit'),
        ("deg, arcmin", '"arcmin" is the second of its kind; name one'),
        ("at motor, at output", '"at output" is the second of its kind; name one'),
        ("mm on 0 mm", "the diameter of the pitch circle must be above 0"),
    ],
)
def test_nonsense_is_refused_in_one_sentence(text: str, said: str) -> None:
    with pytest.raises(RefusedError) as refused:
        Units.read(text, gear=GEAR)
    assert refused.value.reason.startswith(said)
    with pytest.raises(InputError) as error:
        CRANE.replace(units=text, gear_ratio=38.1)
    assert len(error.value.sentences) == 1
    assert said in str(error.value)


def test_without_a_gear_and_of_a_chain_there_is_no_output() -> None:
    with pytest.raises(InputError) as error:
        CRANE.replace(units="rpm, at output")
    assert error.value.sentences == (f'units = "rpm, at output": {NO_GEAR}.',)
    with pytest.raises(InputError) as error:
        Chain.load("crane-4-mass").replace(units="at the output shaft")
    assert NO_OUTPUT in str(error.value)
    assert units_of(CRANE.replace(units="at motor")) == units_of(CRANE)


@given(
    st.floats(1.0, 200.0), st.floats(0.5, 1.0), st.floats(-1e3, 1e3),
    st.sampled_from(["rad, rad/s", "arcmin, rpm, kN m", "deg, lbf ft", "mm on 80 mm"]),
)  # fmt: skip
def test_what_is_shown_is_read_back(ratio: float, efficiency: float, value: float, text: str) -> None:
    """A value that is seen at the output, typed there, is the same at the motor shaft, to rounding."""
    gear = Gear(ratio, efficiency)
    units = Units.read(f"{text}, at output", gear=gear)
    assert Units.read(units.text, gear=gear) == units
    for name in ("load_torque", "stiffness", "gap", "load_inertia", "target_speed"):
        parameter = Drive.PARAMETERS[name]
        typed = units.typed(repr(float(units.shown(value, parameter.unit))), parameter.unit)
        back = at_motor(parameter, typed, gear) if parameter.at_output else None
        if back is not None:
            assert typed.endswith(" at output")
            assert back == pytest.approx(value, rel=1e-8, abs=1e-300)
        assert units.shown(value, parameter.unit) * units.size(parameter.unit) == pytest.approx(
            gear.to_output(value, parameter.unit), rel=1e-14
        )
        digits = units.rounded(value, parameter.unit, 4)
        assert digits == pytest.approx(value, rel=5.1e-4, abs=1e-300)


@given(
    st.floats(1.5, 200.0).map(lambda x: float(f"{x:.4g}")),
    st.one_of(
        st.integers(1, 59).map(lambda n: f"{n} arcmin"), st.integers(1, 9).map(lambda n: f"{n} deg"),
        st.integers(1, 400).map(lambda n: f"{n / 1000!r} rad"),
    ),
    st.booleans(),
)  # fmt: skip
def test_an_angle_without_a_named_unit_is_shown_as_it_was_given(ratio: float, text: str, file: bool) -> None:
    """At the output, where it was given; also from the file of the drive, which has it at the motor."""
    drive = CRANE.replace(gear_ratio=ratio, gap=f"{text} at output", start_position="mid-gap")
    drive = seen_at(Drive.from_toml(drive.to_toml()) if file else drive, "output")
    assert seen(drive.gap, "rad", units_of(drive)) == text
    assert units_of(drive.replace(units="deg, at output")).angle == "deg"  # where one is named, that
    given_at_motor = CRANE.replace(gear_ratio=37.3, gap="4 deg", units="at output")
    assert units_of(given_at_motor).angle == "deg"


def test_ratio_1_changes_the_label_alone() -> None:
    units = units_of(CRANE.replace(units="at output", gear_ratio=1.0))
    for si in ("N*m", "rad", "rad/s", "kg*m^2", "N*m/rad"):
        assert units.shown(0.7, si) == units_of(CRANE).shown(0.7, si)
    assert (units.at, units_of(CRANE).at) == (", at the output", "")


def test_multiples_lists_and_what_is_at_output_already_stay_as_typed() -> None:
    units = Units.read("arcmin, kN m, at output", gear=GEAR)
    for text in ("2x", "5 J1", "9 arcmin at output", "1, 2", "", "friction"):
        assert units.typed(text, "rad") == text
    assert units.typed("1.6e-3", "N*m") == "1.6e-3 kN*m at output"
    assert units.typed("20", "s") == "20"


def test_a_figure_of_a_start_is_at_the_output() -> None:
    """Axes and data of the figure, against the traces through the gear; torques of either sign alike.

    The line of the limit is at what the data sheet says, and as far from the peak as the margin says.
    """
    from softstart import TorqueProfile, simulate
    from softstart.start.recommendation import margins_of
    from softstart.views.traces import run_figure

    drive = CRANE.replace(
        gear_ratio=38.1, gear_efficiency=0.95, units="arcmin, rpm, kN m, at output", damping=0.3,
        permissible_output_torque=6400.0, minimum_torque=-50.0,
    )  # fmt: skip
    brakes = TorqueProfile([0.0, 0.3, 0.3, 0.6], [62.0, 62.0, -50.0, -50.0])
    run = simulate(drive, "profile", parameters={"profile": brakes}, until=0.6)
    assert run.T.min() < -1.0 < 1.0 < run.T.max()
    figure = run_figure(run)
    torque, speed, twist = figure.axes
    assert figure.get_suptitle().endswith(", at the output")
    assert [panel.get_ylabel() for panel in figure.axes] == ["torque, kN m", "speed, rpm", "twist, arcmin"]
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in torque.lines}
    assert torque.lines[1].get_ydata() == pytest.approx(38.1 * 0.95 * run.T / 1000.0, rel=1e-12)
    assert lines["permissible"] == pytest.approx([6.4, 6.4], rel=1e-12)
    (margin,) = (one for one in margins_of(run) if one.name == "output torque")
    assert 1.0 - np.abs(torque.lines[1].get_ydata()).max() / 6.4 == pytest.approx(margin.share, abs=1e-3)
    assert speed.lines[1].get_ydata() == pytest.approx(run.w2 / 38.1 * 30.0 / math.pi, rel=1e-12)
    assert twist.lines[0].get_ydata() == pytest.approx(run.twist[:, 0] / 38.1 * 10800.0 / math.pi, rel=1e-12)
