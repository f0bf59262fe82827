"""Many starts in one call: labels, broadcasting, the controller of one drive on another."""

from __future__ import annotations

import numpy as np
import pytest

from softstart import Drive, InputError, SimulationError, compare, records, simulate
from softstart.controller import make_controller
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


def test_a_list_may_mix_kinds() -> None:
    drives = [CRANE, CRANE.replace(load_kind="reactive"), CRANE.replace(contact_law="dead-zone", damping=0.5)]
    data = simulate(drives, "direct")
    assert [float(k) for k in data.k_dyn] == [simulate(drive, "direct").k_dyn for drive in drives]
    assert list(data.load_kind.values) == ["active", "reactive", "active"]


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


@pytest.mark.parametrize(
    ("strategy", "kind", "until"),
    [
        ("direct", "active", None),
        ("reduced-first-stage", "reactive", None),
        ("reduced-two-stage", "reactive", 0.9),
        ("reduced-two-stage", "active", None),
    ],
)
def test_strides_over_repeated_contacts_keep_every_bit(strategy: str, kind: str, until: float | None) -> None:
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
    data = simulate(drives, strategy, until)
    names = ("k_dyn", "start_time", "contacts", "gap_events", "end_time", "k_dyn_first_contact", "peak_time")
    for i, drive in enumerate(drives.elements()):
        run = simulate(drive, strategy, until)
        single = dict(run.summary(), gap_events=run.recorded.notes["gap_events"])
        for name in names:
            np.testing.assert_equal(float(data[name][i]), float(single[name]), err_msg=f"{name}, start {i}")
    assert float(data.contacts.max()) > 10
