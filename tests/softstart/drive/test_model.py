"""The drive as a value: defaults, changes, equality, and what follows from the parameters."""

import copy
import dataclasses
import inspect
import math
import pickle
import subprocess
import sys
import typing

import numpy as np
import pytest
from tests.softstart.drive.conftest import GOOD

from softstart.drive import INFORMATIVE_TABLES, PARAMETERS, TABLES, Drive
from softstart.errors import InputError

CRANE = {**GOOD, "target_speed": None, "rated_speed": 92.0}


@pytest.fixture
def crane():
    return Drive(**CRANE)


def test_defaults(crane):
    assert crane.maximum_torque == 62.0
    assert crane.target_speed == 92.0
    assert crane.minimum_torque == crane.torque_lag == crane.damping == crane.theta0 == 0.0
    assert crane.torque_rate == math.inf
    assert crane.encoder_lines == 4096.0
    assert crane.rated_power is None
    assert (crane.load_kind, crane.contact_law, crane.name, crane.source) == (
        "active",
        "no-pull",
        "unnamed drive",
        "",
    )


def test_the_elastic_frequency(crane):
    expected = math.sqrt(368.465 * 0.21 / (0.035 * 0.175))  # [G](8)
    assert crane.Omega == pytest.approx(expected, rel=1e-15)
    assert crane.elastic_period == pytest.approx(2 * math.pi / expected, rel=1e-15)
    assert type(crane.Omega) is float
    assert type(crane.elastic_period) is float


def test_everything_numeric_is_a_float():
    drive = Drive(**CRANE | {"gap": 1, "load_inertia": np.float32(0.5), "damping": np.array(2)})
    numbers = [
        value
        for name, value in drive.values().items()
        if PARAMETERS[name].unit and value is not None and value not in PARAMETERS[name].choices
    ]
    assert all(type(value) is float for value in numbers)


def test_replace_follows_and_checks(crane):
    assert crane.replace(starting_torque=100).maximum_torque == 100
    assert crane.replace(rated_speed=50).target_speed == 50
    assert crane.replace(target_speed=10).replace(target_speed=None).target_speed == 92
    assert crane.replace() == crane
    assert crane.gap == 0.5
    with pytest.raises(InputError, match=r"^gap = -1: the total angular gap must be 0 or more"):
        crane.replace(gap=-1)
    with pytest.raises(InputError, match="did you mean gap"):
        crane.replace(gapp=-1)
    with pytest.raises(InputError, match=r"cannot move the load against load_torque = 7\.16"):
        crane.replace(starting_torque=5)


def test_settings(crane):
    changed = crane.with_settings(
        [
            "load.inertia=0.07",
            "shaft.gap=2 rad",
            "load_kind = reactive",
            'name="a = b"',
            "start.target_speed=500 rpm",
        ]
    )
    assert changed == crane.replace(
        load_inertia=0.07, gap=2, load_kind="reactive", name="a = b", target_speed="500 rpm"
    )
    assert crane.with_settings([]) == crane


def test_frozen(crane):
    with pytest.raises(AttributeError, match=r"replace\(gap=...\)"):
        crane.gap = 2.0
    with pytest.raises(AttributeError):
        del crane.gap
    assert copy.deepcopy(crane) is crane
    assert copy.copy(crane) is crane


def test_a_drive_has_one_value(crane):
    for gap in ([0.5, 2.0], np.array([0.5, 2.0])):
        with pytest.raises(InputError) as caught:
            crane.replace(gap=gap)
        several = "for several use sweep, in Python records(drive, gap=...)"
        assert str(caught.value) == f"gap = [0.5, 2.0]: a drive has one value; {several}."
    with pytest.raises(InputError, match=r"\[shaft\] gap = \[0.5, 2\]: a drive has one value; .* use sweep"):
        Drive.from_toml(crane.to_toml().replace("gap = 0.5", "gap = [0.5, 2]"))


def test_equality_and_hash(crane):
    worn = crane.replace(gap=2)
    assert worn == crane.replace(gap=np.float64(2.0))
    assert hash(worn) == hash(crane.replace(gap="2 rad"))
    assert worn != crane
    assert crane != crane.replace(name="other")
    assert crane != 5
    assert crane.replace(maximum_torque=62) == crane  # given or following: the same drive
    assert crane.replace(start_position=-0.0) == crane.replace(start_position=0.0)
    assert len({crane, Drive(**CRANE), worn}) == 2
    assert pickle.loads(pickle.dumps(worn)) == worn


def test_repr_can_be_evaluated(crane):
    assert eval(repr(crane), {"Drive": Drive}) == crane


def test_the_table_the_fields_and_the_keywords_agree():
    keywords = inspect.signature(Drive).parameters
    fields = {field.name: field for field in dataclasses.fields(Drive)}
    assert list(keywords) == list(fields) == list(PARAMETERS)
    required = {name for name, parameter in PARAMETERS.items() if parameter.required}
    assert required == {name for name, keyword in keywords.items() if keyword.default is keyword.empty}
    assert TABLES == ("motor", "gear", "shaft", "load", "start", "limits", "limits.fatigue")
    assert len({p.path for p in PARAMETERS.values()}) == len(PARAMETERS)
    for parameter in PARAMETERS.values():
        choices = typing.get_args(typing.get_type_hints(Drive)[parameter.name])
        assert not parameter.choices or parameter.unit or parameter.choices == choices


@pytest.mark.parametrize(
    "parameter", [p for p in PARAMETERS.values() if p.unit or p.choices], ids=lambda p: p.name
)
def test_the_example_of_each_parameter_is_valid(crane, parameter):
    # a life needs the starts per hour, a point of an S-N curve torque, cycles and slope
    table = [p for p in PARAMETERS.values() if p.table == parameter.table in INFORMATIVE_TABLES]
    changed = crane.with_settings([f"{p.path}={p.example}" for p in table or [parameter]])
    assert Drive.from_toml(changed.to_toml()) == changed


def test_no_way_in_past_the_checks(crane):
    assert dataclasses.replace(crane, gap="1 rad").gap == 1
    for attempt in (
        lambda: Drive(**CRANE | {"gap": -1}),
        lambda: crane.replace(gap=-1),
        lambda: crane.__replace__(gap=-1),
        lambda: dataclasses.replace(crane, gap=-1),
    ):
        with pytest.raises(InputError) as error:
            attempt()
        assert error.value.__suppress_context__ or error.value.__context__ is None
    with pytest.raises(TypeError, match="0 positional arguments"):
        Drive(5)


def test_the_import_stays_light():
    code = (
        "import sys; from softstart.drive import Drive;"
        "heavy = {'numba', 'control', 'matplotlib', 'scipy', 'pint', 'casadi'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
