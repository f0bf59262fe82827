"""When the load has settled, noted by the kernel: in batches and single starts, of both kinds of strategy."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from tests.softstart.speed_loop import SpeedLoop
from tests.twin import PlainTwin

from softstart import Chain, Drive, Run, simulate
from softstart.controller import make_controller
from softstart.controller.base import Controller, Regulation
from softstart.start.batch import prepared

CRANE = Drive.load("crane-4amtkf")
BAND = 0.02


def random_drive(seed: int) -> Drive:
    """One of any gap, inertia, stiffness, damping, load and motor, at a known or unknown position."""
    rng = np.random.default_rng(seed)
    options: dict[str, Any] = {
        "gap": float(rng.choice([0.0, rng.uniform(0.05, 3.0)])),
        "load_inertia": float(CRANE.J2 * 10.0 ** rng.uniform(-1.0, 0.5)),
        "stiffness": float(CRANE.c * 10.0 ** rng.uniform(-1.0, 0.7)),
        "damping": float(rng.choice([0.0, rng.uniform(0.0, 2.0)])),
        "torque_lag": float(rng.choice([0.0, 0.005])),
        "load_torque": float(rng.uniform(0.5, 20.0)),
    }
    if rng.random() < 0.3 and options["gap"] > 0.0:
        options["start_position"] = "unknown"
    if rng.random() < 0.3:
        options |= {"encoder_lines": 1024, "computing_delay": 0.0007}
    return CRANE.replace(**options)


class Twin(PlainTwin):
    """A plain one that holds the speed."""

    def regulation(self, drive: Drive) -> Regulation | None:
        return self.twin.regulation(drive)  # type: ignore[no-any-return]


def twin_of(controller: Controller, drive: Drive) -> Twin:
    fitted: Any = controller.fitted(drive)
    return Twin(fitted, tuple(fitted.vector(drive).tolist()))


def settled_in_a_batch(machine: Any, controller: Controller, watched: bool = True) -> Any:
    batch = prepared([machine])
    return batch.figures(controller.set_ups([machine]), machine.mean_torque, settled=watched)


STRATEGIES = ("direct", "ramp", "s-curve", "pulse-coast-hold", "take-up", "state-feedback")


@pytest.mark.parametrize("seed", range(12))
def test_a_batch_settles_when_a_run_does(seed: int) -> None:
    """Also the plain twin; and all other figures keep their bits, watched or not."""
    drive = random_drive(seed)
    for controller in (make_controller(STRATEGIES[seed % len(STRATEGIES)]), SpeedLoop()):
        run = simulate(drive, controller)
        watched, unwatched = (settled_in_a_batch(drive, controller, one) for one in (True, False))
        assert watched["settled_time"][0].tobytes() == np.array([run.settled_time]).tobytes()
        twin = settled_in_a_batch(drive, twin_of(controller, drive))
        assert twin["settled_time"][0].tobytes() == watched["settled_time"][0].tobytes()
        for name in unwatched:
            if name != "settled_time":
                assert watched[name][0].tobytes() == unwatched[name][0].tobytes(), name
                assert twin[name][0].tobytes() == unwatched[name][0].tobytes(), name


@pytest.mark.parametrize("name", ["crane-4-mass", "tractor-like"])
def test_chains(name: str) -> None:
    chain = Chain.load(name)
    for controller in map(make_controller, ("direct", "ramp")):
        assert settled_in_a_batch(chain, controller)["settled_time"][0] == [
            simulate(chain, controller).settled_time
        ]


def test_rigid_gaps_make_the_load_speed_jump() -> None:
    """At an impact between two instants of the same time the speed leaves its band or comes into it."""
    text = """
    [[mass]]
    name = "motor"
    inertia = 0.05
    [[shaft]]
    gap = 0.5
    restitution = {restitution}
    [[mass]]
    name = "load"
    inertia = 0.1
    torque = 2
    kind = "reactive"
    [motor]
    starting_torque = 20
    [start]
    load = "load"
    target_speed = {target}
    """
    for restitution in (0.0, 0.5, 0.9):
        whole = simulate(Chain.from_toml(text.format(restitution=restitution, target=20.0)), "direct")
        first = next(event for event in whole.events if event.kind == "impact").time
        jump = float(whole.at(first)["w2"])
        assert float(whole.at(np.nextafter(first, 0.0))["w2"]) == 0.0
        # targets below and above the speed after the first impact: the load passes one of them by a jump
        for share in (0.4, 0.9, 0.9999, 1.0001, 1.3):
            chain = Chain.from_toml(text.format(restitution=restitution, target=share * jump))
            run = simulate(chain, "direct")
            found = settled_in_a_batch(chain, make_controller("direct"))["settled_time"][0]
            assert found.tobytes() == np.array([run.settled_time]).tobytes(), (restitution, share)
            # the load speed until the end of judging, against the floor of 99.9 %
            long = simulate(chain, "direct", until=run.settling_end or run.end_time)
            times = np.linspace(0.0, long.end_time, 20001)
            below = np.flatnonzero(long.at(times)["w2"] < 0.999 * share * jump)
            after = float(times[min(below[-1] + 1, times.size - 1)])
            assert run.settled_time == pytest.approx(max(after, run.start_time), abs=2.0 * times[1])


def out_of_band(run: Run, begin: float, end: float) -> tuple[float, float]:
    """The last instant outside of the band and the first one after it, by bisection of a fine evaluation."""
    target = float(run.drive.target_speed)

    def outside(times: Any) -> Any:
        return np.abs(run.at(times)["w2"] - target) > BAND * target

    for _ in range(4):
        times = np.linspace(begin, end, 20001)
        last = int(np.flatnonzero(outside(times))[-1])
        begin, end = float(times[last]), float(times[last + 1])
    return begin, end


@pytest.mark.parametrize("seed", range(8))
def test_the_band_and_the_overshoot_against_an_evaluation_of_the_run(seed: int) -> None:
    drive = random_drive(100 + seed)
    loop = SpeedLoop(kp=(drive.J1 + drive.J2) * 30.0, tn=0.05 if seed % 2 else 0.2)
    for run in simulate(drive, loop).each:
        target = float(drive.target_speed)
        assert run.regulated
        if not math.isnan(run.settled_time):
            before, after = out_of_band(run, 0.0, run.end_time)
            assert before <= run.settled_time <= after + 1e-12
            assert run.end_time == pytest.approx(max(run.settled_time, 0.5) + 0.2, abs=1e-12)
        times = np.linspace(0.0, run.end_time, 40001)
        speeds = run.at(times)["w2"]
        place = int(speeds.argmax())
        bounds = times[max(place - 1, 0)], times[min(place + 1, times.size - 1)]
        polished = minimize_scalar(
            lambda t, at=run.at: -float(at(t)["w2"]),
            bounds=bounds,
            method="bounded",
            options={"xatol": 1e-12},
        )
        largest = max(float(speeds.max()), -float(polished.fun))
        assert run.overshoot >= float(speeds.max()) / target - 1.0  # not below any point of the grid
        assert run.overshoot == pytest.approx(max(largest / target - 1.0, 0.0), abs=1e-9)


def test_a_load_that_begins_in_its_band_has_settled_at_0() -> None:
    speed = 0.99 * CRANE.target_speed
    turning = CRANE.replace(initial_motor_speed=speed, initial_load_speed=speed, gap=0.0)
    loop = SpeedLoop(ramp_time=1e-3)
    run = simulate(turning, loop)
    assert (run.settled_time, run.status.name) == (0.0, "REACHED")
    assert settled_in_a_batch(turning, loop)["settled_time"][0].tolist() == [0.0]


def test_a_load_that_is_driven_out_of_its_band_has_not_settled_at_0() -> None:
    speed = 0.99 * CRANE.target_speed
    turning = CRANE.replace(initial_motor_speed=speed, initial_load_speed=speed)
    run = simulate(turning, SpeedLoop(ramp_time=0.5))  # the ramp begins at 0, so the drive brakes first
    assert run.settled_time > 0.0
    before, after = out_of_band(run, 0.0, run.end_time)
    assert before <= run.settled_time <= after + 1e-12


@pytest.mark.parametrize("limit", [5.0, 62.0])
def test_a_loop_that_does_not_settle(limit: float) -> None:
    """Too weak for the load, or in a limit cycle: not reached, no time, the same in a batch."""
    loop = SpeedLoop(limit=limit, kp=CRANE.J1 * 20.0, tn=0.02)
    drive = CRANE.replace(minimum_torque=-62.0, maximum_torque=62.0, torque_lag=0.03)
    run = simulate(drive, loop, time_limit=1.5)
    assert run.status.name == "NOT_REACHED"
    assert math.isnan(run.settled_time)
    assert run.end_time == 1.5
    many = simulate([drive, drive.replace(gap=1.0)], loop, time_limit=1.5)
    assert many.status.values.tolist() == ["NOT_REACHED"] * 2
    batch = prepared([drive], time_limit=1.5).figures(loop.set_ups([drive]), drive.mean_torque, settled=True)
    assert math.isnan(batch["settled_time"][0][0])


def test_strategies_of_both_kinds_have_the_figures_that_are_theirs() -> None:
    assert math.isnan(simulate(CRANE, "direct").overshoot)
    figures = settled_in_a_batch(CRANE, SpeedLoop())
    assert {"settled_time", "overshoot"} <= set(figures)
    assert "overshoot" not in settled_in_a_batch(CRANE, make_controller("direct"))


def test_a_longer_stay_ends_the_run_later_and_changes_nothing_before() -> None:
    @dataclasses.dataclass(frozen=True)
    class Longer(SpeedLoop):
        def regulation(self, drive: Drive) -> Regulation:
            return super().regulation(drive)._replace(dwell=0.5)

    short, long = simulate(CRANE, SpeedLoop()), simulate(CRANE, Longer())
    assert long.settled_time == short.settled_time
    assert long.end_time == pytest.approx(short.end_time + 0.3, abs=1e-12)
    times = np.linspace(0.0, 0.99 * short.end_time, 101)
    assert np.abs(long.at(times)["w2"] - short.at(times)["w2"]).max() < 1e-9
