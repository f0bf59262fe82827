"""Commands of run and set speed during a run: when they are seen, what they may be, and what they change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from tests.softstart.speed_loop import SpeedLoop
from tests.twin import PlainTwin

from softstart import Command, Drive, InputError, Measured, PlainController, Run, machine_table, simulate

CRANE = Drive.load("crane-4amtkf")
BOTH_WAYS = CRANE.replace(minimum_torque=-62.0, maximum_torque=62.0, torque_lag=0.005)
TARGET = CRANE.target_speed
# down to half, backwards, stop, forwards again; the last change lies on a sample
CHANGES = ((0.7, 1, TARGET / 2.0), (1.1004, 1, -TARGET), (2.3, 0, 0.0), (3.0, 1, TARGET))


@dataclass(frozen=True)
class Witness(PlainController):
    """Keeps what it has measured in its state, which grows."""

    name: ClassVar[str] = "witness"
    can_stop: ClassVar[bool] = True
    can_reverse: ClassVar[bool] = True
    period: float = 0.001

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        row = (measured.time, measured.run, measured.set_speed, measured.command_time)
        seen.append((*row, len(state)))
        return Command(20.0, state=(*state, measured.time))


seen: list[tuple[float, ...]] = []


class LikeTheLoop(PlainTwin):
    """The twin of `SpeedLoop`."""

    can_stop: ClassVar[bool] = True
    can_reverse: ClassVar[bool] = True


def test_a_change_is_seen_at_the_next_sample_and_the_state_is_passed_on() -> None:
    seen.clear()
    changes = ((0.0105, 1, 30.0), (0.02, 0, 30.0), (0.0305, 1, -5.0))
    simulate(CRANE, Witness(), until=0.04, commands=changes)
    table = np.array(seen)
    assert table[:, 0] == pytest.approx(0.001 * np.arange(len(table)), abs=1e-15)  # no sample more, none less
    assert table[:, 4].tolist() == list(range(len(table)))  # the state is passed on through changes
    every = ((0.0, 1, TARGET), *changes)
    for time, run, set_speed, since, _ in seen:
        at, *told = next(change for change in reversed(every) if change[0] <= time + 1e-12)
        assert [run, set_speed] == told
        assert since == pytest.approx(time - at, abs=1e-15)


def test_a_start_without_commands_is_to_run_at_its_target_speed_from_the_beginning() -> None:
    seen.clear()
    simulate(CRANE, Witness(), until=0.005)
    assert all(row[1:4] == (1.0, TARGET, row[0]) for row in seen)


def bits(run: Run) -> tuple[bytes, bytes]:
    return run.trajectory.states.tobytes(), run.trajectory.events.tobytes()


def test_compiled_and_plain_have_the_same_bits() -> None:
    loop = SpeedLoop().fitted(BOTH_WAYS)
    twin = LikeTheLoop(loop, tuple(loop.vector(BOTH_WAYS).tolist()))
    runs = [simulate(BOTH_WAYS, one, until=3.9, commands=CHANGES) for one in (loop, twin)]
    assert bits(runs[0]) == bits(runs[1])


def test_the_drive_follows() -> None:
    run = simulate(BOTH_WAYS, SpeedLoop(), until=3.9, commands=CHANGES)
    ends = run.at([0.69, 1.1, 2.29, 2.99, 3.9])["w2"] / TARGET
    assert ends == pytest.approx([1.0, 0.5, -1.0, 0.0, 1.0], abs=0.05)


def test_a_change_to_what_is_commanded_already_changes_no_step_of_a_strategy_that_does_not_look() -> None:
    """The run is cut there, so that its last digits may differ, but nothing else."""

    class Blind(Witness):
        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            return Command(min(400.0 * measured.time, 62.0))

    once, cut = (
        simulate(CRANE, Blind(), until=0.5, commands=changes) for changes in ((), ((0.2003, 1, TARGET),))
    )
    times = np.linspace(0.0, 0.5, 301)
    for name in ("w1", "w2", "T"):
        whole = once.at(times)[name]
        assert np.abs(cut.at(times)[name] - whole).max() < 1e-10 * np.abs(whole).max()
    assert cut.k_dyn == pytest.approx(once.k_dyn, rel=1e-12)


def test_mirrored_commands_give_the_mirrored_run() -> None:
    """Limits and load are symmetrical, the start is in mid-gap, the first sample demands no torque."""
    drive = BOTH_WAYS.replace(start_position=0.0, load_kind="reactive")
    first, mirrored = (
        simulate(
            drive, SpeedLoop(inertia=0.0), until=1.6, commands=((0.0005, 1, sign * TARGET), (0.8, 0, 0.0))
        )
        for sign in (1.0, -1.0)
    )
    times = np.linspace(0.0, 1.6, 401)
    one, other = first.at(times), mirrored.at(times)
    for name in ("w1", "w2", "T", "u"):
        scale = np.abs(one[name]).max()
        assert np.abs(one[name] + other[name]).max() < 1e-7 * scale, name


def test_refusals() -> None:
    def refused(words: str, controller: object, **options: object) -> None:
        with pytest.raises(InputError, match=words) as error:
            simulate(CRANE, controller, **{"until": 1.0, **options})  # type: ignore[call-overload]
        assert len(error.value.sentences) == 1

    loop = SpeedLoop()
    refused("direct cannot stop", "direct", commands=[(0.5, 0, 10.0)])
    refused("ramp cannot reverse", "ramp", commands=[(0.5, 1, -10.0)])
    refused("cannot stop", "take-up", commands=[(0.2, 1, 10.0), (0.5, 0, 0.0)])
    refused("times rise", loop, commands=[(0.5, 1, 10.0), (0.5, 1, 20.0)])
    refused("times rise", loop, commands=[(0.5, 1, 10.0), (0.4, 1, 20.0)])
    refused("times rise", loop, commands=[(0.0, 1, 10.0)])
    refused("times rise", loop, commands=[(1.0, 1, 10.0)])
    refused("until is missing", loop, commands=[(0.5, 1, 10.0)], until=None)
    refused("controller is missing", None, commands=[(0.5, 1, 10.0)])
    refused("run is 1, or 0", loop, commands=[(0.5, 2, 10.0)])
    refused("commands", loop, commands=[("soon", 1, 10.0)])
    refused("commands", loop, commands=[(0.5, 1, float("nan"))])
    refused("commands", loop, commands=[(0.5, 1, float("inf"))])
    for many in (machine_table(CRANE, gap=[0.5, 1.0]), [CRANE, CRANE]):
        with pytest.raises(InputError, match="of one machine"):
            simulate(many, loop, until=1.0, commands=[(0.5, 1, 10.0)])


def test_units_and_one_more_start_after_a_stop() -> None:
    """Times and speeds take units; a strategy that can stop is asked on after a stop."""
    one = simulate(BOTH_WAYS, SpeedLoop(), until=1.5, commands=[("700 ms", 0, 0.0), (1.2, 1, "955 rpm")])
    two = simulate(
        BOTH_WAYS, SpeedLoop(), until=1.5, commands=[(0.7, 0, 0.0), (1.2, 1, 955.0 * np.pi / 30.0)]
    )
    assert bits(one) == bits(two)
    assert one.at(1.19)["w2"] == pytest.approx(0.0, abs=0.03 * TARGET)
    assert one.at(1.5)["w2"] == pytest.approx(0.6 * TARGET, abs=0.03 * TARGET)
