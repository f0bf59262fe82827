"""What lies between drive and controller: encoder edges, noise, and the dead time of the computer."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from tests import twin

from softstart import Command, Drive, InputError, PlainController, SimulationError, TorqueProfile, simulate
from softstart.controller import make_controller
from softstart.kernel.motor import encoder_count, gauss

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
LAGGING = CRANE.replace(torque_lag=0.002, torque_rate=20_000.0)
COUNT = encoder_count(CRANE.encoder_lines)


@dataclass(frozen=True)
class Watch(PlainController):
    """Constant torque; keeps what it is given."""

    torque: float = 20.0
    seen: tuple = ()

    def step(self, measured, state):
        self.seen[0].append(measured)
        return Command(self.torque, measured.time + 0.001)


def watched(drive, until=0.02, torque=20.0):
    seen = []
    run = simulate(drive, Watch(torque, (seen,)), until)
    return run, seen


# the encoder ---------------------------------------------------------------------------------------------


@given(phase=st.floats(0.0, 1.0))
@settings(max_examples=30)
def test_the_encoder_counts_edges_from_zero_on(phase):
    run, seen = watched(CRANE.replace(encoder_phase=phase))
    assert seen[0].motor_angle == 0.0
    for measured in seen[1:]:
        phi1 = float(run.at(measured.time)["phi1"])
        # edges lie at (k + 1/2 - phase) counts; the reading is the number of those passed
        first = (0.5 - phase) if phase < 0.5 else (1.5 - phase)
        passed = math.floor(phi1 / COUNT - first) + 1
        assert measured.motor_angle / COUNT == pytest.approx(passed, abs=1e-6)


# noise ---------------------------------------------------------------------------------------------------


def test_the_noise_is_standard_normal_and_white():
    drawn = np.array([gauss(7.0, float(i)) for i in range(20_000)])
    # the 1e-4 levels of the tests: this seed is fixed, so the outcome never changes
    assert stats.kstest(drawn, "norm").pvalue > 1e-4
    for lag in (1, 2, 3, 10):
        assert abs(np.corrcoef(drawn[lag:], drawn[:-lag])[0, 1]) < 4.0 / math.sqrt(drawn.size)
    other = np.array([gauss(8.0, float(i)) for i in range(20_000)])
    for lag in range(4):
        assert abs(np.corrcoef(drawn[lag:], other[: other.size - lag])[0, 1]) < 4.0 / math.sqrt(drawn.size)


def test_noise_lies_on_the_measured_torque_alone():
    run, seen = watched(CRANE.replace(torque_noise=0.5, noise_seed=3), until=0.5)
    clean, before = watched(CRANE, until=0.5)
    assert np.array_equal(run.T, clean.T)
    error = np.array([a.motor_torque - b.motor_torque for a, b in zip(seen, before, strict=True)])
    assert [m[:3] for m in seen] == [m[:3] for m in before]  # time, angle, speed
    assert error == pytest.approx([0.5 * gauss(3.0, float(i)) for i in range(error.size)], abs=1e-12)


# dead time -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("drive", [CRANE, LAGGING.replace(load_kind="reactive", damping=1.5)])
@pytest.mark.parametrize("delay", [0.0004, 0.0123])
def test_a_dead_time_shifts_a_profile_in_time(drive, delay):
    times, torques = [0.0, 0.02, 0.02, 0.05, 0.09], [10.0, 40.0, 5.0, 60.0, 62.0]
    profile = TorqueProfile(times, torques)
    later = TorqueProfile([0.0, delay, *(t + delay for t in times)], [0.0, 0.0, *torques])
    one = simulate(drive.replace(computing_delay=delay), "profile", parameters={"profile": profile})
    two = simulate(drive, "profile", parameters={"profile": later})
    assert one.k_dyn == pytest.approx(two.k_dyn, rel=1e-11)
    assert one.start_time == pytest.approx(two.start_time, rel=1e-11)
    assert [e.kind for e in one.events] == [e.kind for e in two.events]


@dataclass(frozen=True)
class Late(PlainController):
    """A sampled controller whose answers are sent some samples late by itself."""

    twin: PlainController
    samples: int
    initial_state: ClassVar[tuple[float, ...]] = ()

    @property
    def sensors(self):
        return self.twin.sensors

    def step(self, measured, state):
        waiting, inner = state[: self.samples] or (0.0,) * self.samples, state[self.samples :]
        answer = self.twin.step(measured, inner)
        waiting = (*waiting, answer.torque)
        again = min(answer.ask_again, measured.time + 0.001)  # its last answer has still to be sent
        return Command(waiting[0], again, (*waiting[1:], *answer.state))


@pytest.mark.parametrize("samples", [1, 5])
def test_a_dead_time_of_whole_samples_is_a_queue_of_answers(samples):
    drive, name = LAGGING, "current-limit-feedback"
    late = Late(twin.plain(make_controller(name, {"period": 0.001}), drive), samples)
    own = simulate(drive, late, 0.15)
    delayed = simulate(drive.replace(computing_delay=samples * 0.001), name, 0.15, fitted_to=drive)
    # instants k h + d and (k + 1) h differ by rounding, so times and torques agree to that alone
    assert delayed.k_dyn == pytest.approx(own.k_dyn, rel=1e-9)
    at = np.linspace(0.0, 0.15, 301)
    assert delayed.at(at)["T"] == pytest.approx(own.at(at)["T"], abs=1e-7)


def test_more_answers_on_their_way_than_there_is_room_for_is_an_error():
    with pytest.raises(SimulationError, match="computing_delay"):
        simulate(CRANE.replace(computing_delay=0.05), "current-limit-feedback")


@pytest.mark.parametrize(
    ("key", "value"),
    [("encoder_phase", 1.5), ("torque_noise", -1.0), ("noise_seed", 0.5), ("computing_delay", -1)],
)
def test_impossible_values_are_refused(key, value):
    with pytest.raises(InputError, match=rf"^{key} = "):
        CRANE.replace(**{key: value})
