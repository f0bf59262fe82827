"""Many starts in one call: records of machines that differ in some values, with the bits of each alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import Drive, InputError, SimulationError, compare, records, simulate
from softstart.chain import Chain
from softstart.chain.machines import varied
from softstart.controller import make_controller, ready_controller_names
from softstart.drive.records import Records
from softstart.start.batch import prepared

CRANE = Drive.load("crane-4amtkf")


def test_turns_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    many, ramp = records(CRANE, gap=np.linspace(0.1, 4.0, 41)), make_controller("ramp")
    whole = prepared(many).notes(ramp.set_ups(many))
    monkeypatch.setattr(
        "softstart.start.batch._parts", lambda count: [slice(i, i + 7) for i in range(0, count, 7)]
    )
    parts = prepared(many).notes(ramp.set_ups(many))
    assert parts.starts.tobytes() == whole.starts.tobytes()
    assert parts.shafts.tobytes() == whole.shafts.tobytes()


@pytest.mark.parametrize("role", ["fitted_to", "base"])
def test_a_drive_of_another_shape_is_refused(role: str) -> None:
    other = records(CRANE, load_inertia=np.linspace(0.1, 0.2, 3))
    with pytest.raises(InputError, match=role):
        simulate(records(CRANE, gap=[0.5, 2.0]), "ramp", **{role: other})


def test_a_start_exactly_at_its_limits_keeps_them() -> None:
    run = simulate(CRANE, "direct")
    for factor, keeps in ((1.0, 1.0), (1.0 - 1e-9, 0.0), (1.0 + 1e-9, 1.0)):
        for name, value in (("start_time", run.start_time), ("torque", run.peak_torque)):
            limited = CRANE.replace(**{f"permissible_{name}": factor * value})
            assert simulate([limited], "direct").keeps_limits.item() == keeps, (name, factor)


def test_a_controller_that_wants_to_be_asked_for_ever_is_stopped() -> None:
    with pytest.raises(SimulationError, match="control instants"):
        simulate(CRANE, "ramp", parameters={"period": 1e-9}, max_events=50_000)


def test_a_thousand_starts_have_the_closed_form() -> None:
    gaps = np.linspace(0.01, 4.0, 1000)
    data = simulate(records(CRANE, gap=gaps), "direct")
    # [G](17), the closed form on every one
    impact = CRANE.c / CRANE.Omega * np.sqrt(gaps * (62 * 0.175 + 7.16 * 0.035) / (0.035 * 0.175))
    mean = (62 * 0.175 + 7.16 * 0.035) / 0.21
    np.testing.assert_allclose(data.k_dyn, 1.0 + np.sqrt(1.0 + (impact / mean) ** 2), rtol=1e-12)
    assert not np.isnan(data.start_time).any()


def test_comparison_rows_are_the_single_starts() -> None:
    table = compare(
        CRANE, ["direct", "reduced-two-stage"], parameters={"reduced-two-stage": {"torque": 15.5}}
    )
    direct, reduced = table.rows
    assert direct.time_lost == 0.0
    assert reduced.time_lost == reduced.run.start_time - direct.run.start_time
    worn = simulate(CRANE.replace(gap=2.0), "reduced-two-stage", parameters={"torque": 15.5}, fitted_to=CRANE)
    assert reduced.k_dyn_worn_gap == pytest.approx(worn.k_dyn, rel=1e-12)
    light = Drive.load("crane-4amtkf-light")
    assert direct.k_dyn_light_load == simulate(light, "direct", base=CRANE, fitted_to=CRANE).k_dyn
    assert [row.name for row in table.recommendation.best] == ["direct"]  # the other needs a sensor


CHAIN = Chain.load("crane-4-mass")
FIGURES = ("k_dyn", "start_time", "contacts", "impact_speed", "peak_time", "end_time")


def assert_bits_of_single_starts(many: Records, controller: str) -> list[float]:
    found: Any = simulate(many, controller)
    runs = [simulate(one, controller).summary() for one in many.elements()]
    for name in FIGURES:
        np.testing.assert_array_equal(found[name].values.ravel(), [run[name] for run in runs], name)
    return [run["k_dyn"] for run in runs]


def test_fields_in_si_of_one_shape() -> None:
    many = records(CRANE, gap=["30 deg", 2], load_inertia=[["700 kg*cm^2"], [0.175], [0.2]], damping=0.5)
    assert many.machine == CRANE
    assert (many.shape, len(many), list(many.fields)) == ((3, 2), 6, ["gap", "load_inertia"])
    assert many.fields["gap"].tolist() == [[math.radians(30), 2.0]] * 3
    each = list(many.elements())
    assert [one.gap for one in each] == [math.radians(30), 2.0] * 3
    assert each[5] == CRANE.replace(gap=2.0, load_inertia=0.2, damping=0.5)
    assert all(type(one) is Drive and isinstance(one.gap, float) for one in each)
    assert repr(many) == f"<Records of {CRANE.name}: gap, load_inertia of shape (3, 2)>"
    found: Any = simulate(many, "reduced-two-stage")
    assert found.k_dyn.dims == ("axis_0", "axis_1")
    assert found.load_inertia.values.tolist() == many.fields["load_inertia"].tolist()
    _, other = records(CRANE.replace(maximum_torque=None), starting_torque=[62, 80]).elements()
    assert other.maximum_torque == 80.0  # derived for each
    assert other.replace(starting_torque=100).maximum_torque == 100


def test_records_differ_in_further_fields_and_an_angle_may_move_with_its_gap() -> None:
    many = records(records(CRANE, gap=[[0.5], [2.0]]), damping=[0.1, 0.2], load_torque=3.0)
    assert [(one.gap, one.damping, one.load_torque) for one in many.elements()] == [
        (0.5, 0.1, 3.0), (0.5, 0.2, 3.0), (2.0, 0.1, 3.0), (2.0, 0.2, 3.0),
    ]  # fmt: skip
    chains = records(records(CHAIN, gap=[0.5, 1.0], load_torque=99.0), shaft_2_stiffness=[[4e5], [5e5]])
    assert list(chains.elements()) == [
        CHAIN.with_values({"gap": gap, "load_torque": 99.0, "shaft_2_stiffness": c})
        for c in (4e5, 5e5)
        for gap in (0.5, 1.0)
    ]
    assert chains.fields["gap"].tolist() == [[0.5, 1.0], [0.5, 1.0]]
    flank = CRANE.replace(start_position=0.25)
    assert [one.theta0 for one in records(flank, gap=[0.5, 1.0]).elements()] == [0.25, 0.25]
    assert list(varied(flank, {"gap": [0.5, 3.0]}).elements()) == [flank.with_gap(0.5), flank.with_gap(3.0)]


def some(least: float, most: float) -> st.SearchStrategy[float]:
    return st.just(0.0) | st.floats(least, most)


STARTS: dict[str, st.SearchStrategy[Any]] = {
    "gap": some(1e-3, 3.0),
    "load_inertia": st.floats(0.02, 1.0),
    "stiffness": st.floats(50.0, 5000.0),
    "damping": some(1e-3, 1.5),
    "load_torque": some(0.1, 30.0),
    "torque_lag": some(1e-4, 0.01),
    "start_position": some(-0.3, -0.001) | st.floats(0.001, 0.3),
    "motor_friction": some(0.1, 5.0),
    "motor_viscous_friction": some(1e-4, 0.02),
    "load_viscous_friction": some(1e-4, 0.03),
    "noise_seed": st.integers(0, 3),
}


@settings(max_examples=25, deadline=None)
@given(st.data())
def test_every_figure_has_the_bits_of_a_single_start(data: st.DataObject) -> None:
    names = sorted(data.draw(st.sets(st.sampled_from(sorted(STARTS)), min_size=1, max_size=4)))
    size = data.draw(st.integers(1, 3))
    fields = {one: np.array(data.draw(st.lists(STARTS[one], min_size=size, max_size=size))) for one in names}
    if data.draw(st.booleans()):  # one field along an axis of its own
        fields[names[0]] = fields[names[0]][:, None]
    kind = data.draw(st.sampled_from(["active", "reactive"]))
    drive = CRANE.replace(load_kind=kind, torque_noise=0.5)
    controller = data.draw(st.sampled_from(sorted(ready_controller_names())))
    assert_bits_of_single_starts(records(drive, **fields), controller)


def test_noise_positions_and_brakes_have_the_bits_of_single_starts() -> None:
    noisy = records(CRANE, torque_noise=1.0, noise_seed=[0.0, 1.0, 2.0], torque_lag=0.002)
    assert len(set(assert_bits_of_single_starts(noisy, "current-limit-feedback"))) == 3
    hoist = CRANE.replace(load_torque=40.0, brake="motor", start_position="hanging", damping=0.3)
    for release in ("torque", 0.05):
        hanging = records(hoist, load_torque=[30.0, 40.0], gap=[0.05, 0.2], release=release)
        assert_bits_of_single_starts(hanging, "state-feedback")
    unknown = records(CRANE, load_kind="reactive", start_position="unknown", gap=[0.2, 0.5, 2.0])
    assert_bits_of_single_starts(unknown, "ramp")
    found: Any = simulate(unknown, "ramp")
    assert found.position.values.tolist() == [simulate(one, "ramp").position for one in unknown.elements()]


def test_controllers_bases_parameters_and_limits_of_each() -> None:
    many = records(CRANE, gap=[0.5, 2.0], permissible_torque=[100.0, 200.0], permissible_start_time=1.0)
    fitted, base = records(CRANE, gap=[0.4, 1.0]), records(CRANE, load_inertia=[0.1, 0.3])
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


def test_chains_answer_to_the_words_of_a_drive_and_of_their_parts() -> None:
    many = records(
        "crane-4-mass", gap=[[0.5], [1.0]], shaft_2_stiffness=["4e5 N*m/rad", 5e5], load_torque=100
    )
    assert list(many.fields) == ["gap", "shaft_2_stiffness"]
    each = list(many.elements())
    assert each[3] == CHAIN.with_values({"gap": 1.0, "shaft_2_stiffness": 5e5, "load_torque": 100.0})
    found: Any = simulate(many, "ramp")
    assert found.k_dyns.dims == ("axis_0", "axis_1", "shaft")
    assert found.gap.values.tolist() == [[0.5, 0.5], [1.0, 1.0]]
    runs = [simulate(one, "ramp") for one in each]
    assert found.k_dyn.values.ravel().tolist() == [run.k_dyn for run in runs]
    assert found.k_dyns.values.reshape(4, 3).tolist() == [run.k_dyns.tolist() for run in runs]


@pytest.mark.parametrize(
    ("machine", "fields", "said"),
    [
        (CRANE, {"gapp": [0.5]}, 'gapp = [0.5]: a drive has no parameter "gapp"; did you mean gap?'),
        (CHAIN, {"shaft_7_gap": [0.5]}, 'a chain has no parameter "shaft_7_gap"'),
        (CRANE, {"gap": [1, 2, 3], "damping": [1, 2]}, "damping has shape (2,), gap has shape (3,): arrays"),
        (CHAIN, {"gap": [1, 2, 3], "load_inertia": [60, 70]}, "gap has shape (3,), load_inertia has shape"),
        (CRANE, {"gap": [0.5, math.nan]}, "gap[1] = nan: "),
        (CRANE, {"gap": [[0.5, -1.0]]}, "gap[0, 1] = -1.0: the total angular gap must be 0 or more"),
        (CHAIN, {"shaft_2_gap": [0.5, "1 m"]}, "shaft_2_gap[1] = "),
        (CRANE.replace(maximum_torque=None), {"starting_torque": [62, 5, 70], "load_torque": [[7.0], [8.0]]},
         "starting_torque[1] = 5 N*m: the starting torque cannot move the load against load_torque[0, 0]"),
        (CRANE, {"rated_torque": [23.0, 30.0]}, "rated_torque[1] = 30 N*m"),
        (CHAIN, {}, "records: all fields are single values"),
    ],
)  # fmt: skip
def test_what_no_machine_can_have(machine: Any, fields: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as caught:
        records(machine, **fields)
    assert said in str(caught.value)
    assert len(caught.value.sentences) == 1
    if "gapp" in fields:  # all mistakes at once
        with pytest.raises(InputError) as caught:
            records(machine, **fields, load_inertia=[-1.0], stiffness=["soft"])
        assert len(caught.value.sentences) == 3


@pytest.mark.parametrize("kind", ["active", "reactive"])
@pytest.mark.parametrize("strategy", ["direct", "reduced-two-stage"])
def test_strides_over_repeated_contacts_keep_every_bit(strategy: str, kind: str) -> None:
    """A batch takes repeated contacts in one stride, a recorded start goes through each: the same bits."""
    rng = np.random.default_rng(11)
    count = 40
    drives = records(
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
