"""Many starts in one call: records of machines that differ in some values, with the bits of each alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from softstart import Drive, InputError, compare, machine_table, simulate
from softstart.chain import Chain
from softstart.chain.machines import varied
from softstart.controller import make_controller
from softstart.drive.machine_table import MachineTable
from softstart.start.batch import prepared

CRANE = Drive.load("crane-4amtkf")


def test_turns_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    many, ramp = machine_table(CRANE, gap=np.linspace(0.1, 4.0, 41)), make_controller("ramp")
    whole = prepared(many).results(ramp.set_ups(many))
    monkeypatch.setattr(
        "softstart.start.results._parts", lambda count: [slice(i, i + 7) for i in range(0, count, 7)]
    )
    parts = prepared(many).results(ramp.set_ups(many))
    assert parts.starts.tobytes() == whole.starts.tobytes()
    assert parts.shafts.tobytes() == whole.shafts.tobytes()


@pytest.mark.parametrize("role", ["fitted_to", "base"])
def test_a_drive_of_another_shape_is_refused(role: str) -> None:
    other = machine_table(CRANE, load_inertia=np.linspace(0.1, 0.2, 3))
    with pytest.raises(InputError, match=role):
        simulate(machine_table(CRANE, gap=[0.5, 2.0]), "ramp", **{role: other})


def test_a_start_exactly_at_its_limits_keeps_them() -> None:
    run = simulate(CRANE, "direct")
    for factor, keeps in ((1.0, 1.0), (1.0 - 1e-9, 0.0), (1.0 + 1e-9, 1.0)):
        for name, value in (("start_time", run.start_time), ("torque", run.peak_torque)):
            limited = CRANE.replace(**{f"permissible_{name}": factor * value})
            assert simulate([limited], "direct").keeps_limits.item() == keeps, (name, factor)


def test_a_start_that_does_not_finish_keeps_no_limit() -> None:
    """Too weak for its load, ended too early, given up: whatever is permitted, as there is no start time."""
    able = CRANE.replace(permissible_torque=1e9, permissible_start_time=1e9)
    weak = make_controller("ramp", {"full_torque": np.array([0.9 * CRANE.Mc, CRANE.Ms])})
    runs: list[Any] = [simulate([able, able], weak), simulate([able], "direct", until=0.1)]
    runs.append(simulate([able], "direct", max_events=3))
    assert np.concatenate([run.status.values for run in runs]).tolist() == [
        "NOT_REACHED", "REACHED", "STOPPED_EARLY", "TOO_MANY_EVENTS"
    ]  # fmt: skip
    assert np.concatenate([run.keeps_limits.values for run in runs]).tolist() == [0.0, 1.0, 0.0, 0.0]
    assert np.concatenate([np.isnan(run.margin.values) for run in runs]).tolist() == [True, False, True, True]


def test_comparison_rows_are_the_single_starts() -> None:
    table = compare(
        CRANE, ["direct", "reduced-two-stage"], parameters={"reduced-two-stage": {"torque": 15.5}}
    )
    direct, reduced = table.rows
    assert direct.settled_lost == 0.0
    assert reduced.settled_lost == reduced.run.settled_time - direct.run.settled_time
    worn = simulate(CRANE.replace(gap=2.0), "reduced-two-stage", parameters={"torque": 15.5}, fitted_to=CRANE)
    assert reduced.k_dyn_worn_gap == pytest.approx(worn.k_dyn, rel=1e-12)
    light = Drive.load("crane-4amtkf-light")
    assert direct.k_dyn_light_load == simulate(light, "direct", base=CRANE, fitted_to=CRANE).k_dyn


CHAIN = Chain.load("crane-4-mass")
FIGURES = ("k_dyn", "start_time", "contacts", "impact_speed", "peak_time", "end_time")


def assert_bits_of_single_starts(many: MachineTable, controller: str) -> list[float]:
    found: Any = simulate(many, controller)
    runs = [simulate(one, controller).summary() for one in many.elements()]
    for name in FIGURES:
        np.testing.assert_array_equal(found[name].values.ravel(), [run[name] for run in runs], name)
    return [run["k_dyn"] for run in runs]


def test_fields_in_si_of_one_shape() -> None:
    many = machine_table(
        CRANE, gap=["30 deg", 2], load_inertia=[["700 kg*cm^2"], [0.175], [0.2]], damping=0.5
    )
    assert many.machine == CRANE
    assert (many.shape, len(many), list(many.fields)) == ((3, 2), 6, ["gap", "load_inertia"])
    assert many.fields["gap"].tolist() == [[math.radians(30), 2.0]] * 3
    each = list(many.elements())
    assert each[5] == CRANE.replace(gap=2.0, load_inertia=0.2, damping=0.5)
    assert all(type(one) is Drive and isinstance(one.gap, float) for one in each)
    _, other = machine_table(CRANE.replace(maximum_torque=None), starting_torque=[62, 80]).elements()
    assert other.maximum_torque == 80.0  # derived for each
    assert other.replace(starting_torque=100).maximum_torque == 100


def test_records_differ_in_further_fields_and_an_angle_may_move_with_its_gap() -> None:
    chains = machine_table(
        machine_table(CHAIN, gap=[0.5, 1.0], load_torque=99.0), shaft_2_stiffness=[[4e5], [5e5]]
    )
    assert list(chains.elements()) == [
        CHAIN.with_values({"gap": gap, "load_torque": 99.0, "shaft_2_stiffness": c})
        for c in (4e5, 5e5)
        for gap in (0.5, 1.0)
    ]
    assert chains.fields["gap"].tolist() == [[0.5, 1.0], [0.5, 1.0]]
    flank = CRANE.replace(start_position=0.25)
    assert [one.theta0 for one in machine_table(flank, gap=[0.5, 1.0]).elements()] == [0.25, 0.25]
    assert list(varied(flank, {"gap": [0.5, 3.0]}).elements()) == [flank.with_gap(0.5), flank.with_gap(3.0)]


def test_noise_friction_positions_and_brakes_have_the_bits_of_single_starts() -> None:
    noisy = machine_table(CRANE, torque_noise=1.0, noise_seed=[0.0, 1.0, 2.0], torque_lag=0.002)
    assert len(set(assert_bits_of_single_starts(noisy, "current-limit-feedback"))) == 3
    rubbed = machine_table(CRANE, motor_friction=[0.0, 2.0], motor_viscous_friction=[[0.0], [0.01]])
    assert_bits_of_single_starts(rubbed, "ramp")
    hoist = CRANE.replace(load_torque=40.0, brake="motor", start_position="hanging", damping=0.3)
    for release in ("torque", 0.05):
        hanging = machine_table(hoist, load_torque=[30.0, 40.0], gap=[0.05, 0.2], release=release)
        assert_bits_of_single_starts(hanging, "state-feedback")
    unknown = machine_table(CRANE, load_kind="reactive", start_position="unknown", gap=[0.2, 0.5, 2.0])
    assert_bits_of_single_starts(unknown, "ramp")
    found: Any = simulate(unknown, "ramp")
    assert found.position.values.tolist() == [simulate(one, "ramp").position for one in unknown.elements()]


def test_controllers_bases_parameters_and_limits_of_each() -> None:
    many = machine_table(CRANE, gap=[0.5, 2.0], permissible_torque=[100.0, 200.0], permissible_start_time=1.0)
    fitted, base = machine_table(CRANE, gap=[0.4, 1.0]), machine_table(CRANE, load_inertia=[0.1, 0.3])
    found: Any = simulate(many, "ramp", fitted_to=fitted, base=base, workers=2)
    times = np.array([0.05, 0.2])
    timed: Any = simulate(many, make_controller("ramp", {"time": times}))
    each = zip(many.elements(), fitted.elements(), base.elements(), strict=True)
    for i, (one, told, of) in enumerate(each):
        run = simulate(one, "ramp", fitted_to=told, base=of)
        assert float(found.k_dyn[i]) == run.k_dyn
        share = min(1.0 - run.peak_torque / one.permissible_torque, 1.0 - run.start_time)
        assert float(found.margin[i]) == pytest.approx(share, rel=1e-12)
        assert float(found.keeps_limits[i]) == (share >= 0.0)
        assert float(timed.k_dyn[i]) == simulate(one, "ramp", parameters={"time": times[i]}).k_dyn


@pytest.mark.parametrize(
    ("machine", "fields", "said"),
    [
        (CRANE, {"gapp": [0.5]}, 'gapp = [0.5]: a drive has no parameter "gapp"; did you mean gap?'),
        (CHAIN, {"shaft_7_gap": [0.5]}, 'a chain has no parameter "shaft_7_gap"'),
        (CRANE, {"gap": [1, 2, 3], "damping": [1, 2]}, "damping has shape (2,), gap has shape (3,): the"),
        (CRANE, {"gap": [[0.5, -1.0]]}, "gap[0, 1] = -1.0: the total angular gap must be 0 or more"),
        (CHAIN, {"shaft_2_gap": [0.5, "1 m"]}, "shaft_2_gap[1] = "),
        (CRANE.replace(maximum_torque=None), {"starting_torque": [62, 5, 70], "load_torque": [[7.0], [8.0]]},
         "starting_torque[1] = 5 N*m: the starting torque cannot move the load against load_torque[0, 0]"),
        (CHAIN, {}, "machine_table: all values are single"),
    ],
)  # fmt: skip
def test_what_no_machine_can_have(machine: Any, fields: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as caught:
        machine_table(machine, **fields)
    assert said in str(caught.value)
    assert len(caught.value.sentences) == 1
    if "gapp" in fields:  # all mistakes at once
        with pytest.raises(InputError) as caught:
            machine_table(machine, **fields, load_inertia=[-1.0], stiffness=["soft"])
        assert len(caught.value.sentences) == 3


@pytest.mark.parametrize("kind", ["active", "reactive"])
@pytest.mark.parametrize("strategy", ["direct", "reduced-two-stage"])
def test_strides_over_repeated_contacts_keep_every_bit(strategy: str, kind: str) -> None:
    """A batch takes repeated contacts in one stride, a recorded start goes through each: the same bits."""
    rng = np.random.default_rng(11)
    count = 40
    drives = machine_table(
        CRANE,
        load_kind=kind,
        gap=rng.uniform(0.01, 4.0, count),
        load_inertia=10 ** rng.uniform(-2, 1, count),
        stiffness=10 ** rng.uniform(1.5, 4, count),
        target_speed=rng.uniform(10.0, 200.0, count),
        start_position=rng.choice([0.0, 0.0, -0.004, 0.003], count),
    )
    assert_bits_of_single_starts(drives, strategy)
    assert float(simulate(drives, strategy).contacts.max()) > 10
