"""[G]: reduced torque until the motor's acceleration drops, and for a delay after that."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from softstart.controller import (
    CompiledController,
    Effort,
    Numbers,
    ParameterValues,
    compiled_step,
    parameter,
)
from softstart.controller.compiled import MEASURED, Double, Reply, Vector, as_record, keep_state, record
from softstart.drive import Drive
from softstart.kernel.motor import encoder_count
from softstart_controllers.reduced import (
    closing_speed,
    delay_of,
    mean_under,
    raise_parameter,
    reduced_torque_parameter,
    swing_duration,
)
from softstart_controllers.sampled import (
    full_torque_parameter,
    mean_torque,
    period_parameter,
    timeout_parameter,
)

LONGEST_WINDOW = 30  # samples kept of half a window
RING = 2 * LONGEST_WINDOW + 1
SHORTEST_WINDOW = 2
DROP = 0.3
SMALLEST_DROP = 0.05
ROUNDING_SHARE = 1.0 / 3.0  # of the drop, that the encoder's rounding may feign at the worst
BISECTIONS = 40


class Parameters:
    """Torques, the motor, and the window of the second difference."""

    torque: float
    full_torque: float
    period: Double
    J1: float
    half: int
    stride: int
    threshold: float
    wait: Double
    contact_timeout: Double


class State:
    """The free motor, and the ring of the last differences to it."""

    sample: int
    free_angle: Double
    free_speed: Double
    demand: float
    realised: float
    raise_at: Double
    ring: Vector


PARAMETERS = record(Parameters)
STATE = record(State, ring=RING)
COMMAND = record(Reply, State, ring=RING)


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """The angle lost against a free motor, its second difference, and the wait after contact."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(measured, MEASURED)
    x = as_record(state, STATE)
    y = as_record(command, COMMAND)
    keep_state(state, command)
    t, u = m.time, m.motor_torque
    sample = int(x.sample)
    if sample == 0:
        y.free_angle = m.motor_angle
        y.free_speed = m.motor_speed
        y.raise_at = math.inf
    else:
        a = mean_torque(x.realised, u, x.demand) / p.J1
        y.free_angle = x.free_angle + p.period * (x.free_speed + 0.5 * p.period * a)
        y.free_speed = x.free_speed + p.period * a
        stride = int(p.stride)
        if sample % stride == 0:
            half = int(p.half)
            kept = sample // stride
            lost = y.free_angle - m.motor_angle
            # the slots not yet written are zero: before the start nothing was lost
            middle = x.ring[(kept + RING - half) % RING]
            oldest = x.ring[(kept + RING - 2 * half) % RING]
            y.ring[kept % RING] = lost
            if x.raise_at == math.inf and lost - 2.0 * middle + oldest > p.threshold:
                y.raise_at = t + p.wait
        if y.raise_at == math.inf and t >= p.contact_timeout:
            y.raise_at = t
    waiting = t + 0.5 * p.period < y.raise_at
    y.torque = p.torque if waiting else p.full_torque
    y.ask_again = (sample + 1) * p.period if waiting else math.inf
    y.sample = sample + 1
    y.demand = y.torque
    y.realised = u


def contact_drop(drive: Drive, p: ParameterValues) -> float:
    """A drop that is seen early, and that the load behind the shaft brings about."""
    return min(max(0.5 * mean_under(drive, p.torque) / p.torque, SMALLEST_DROP), DROP)


@dataclass(frozen=True)
class AccelerationDelay(CompiledController):
    """Torque reduced until the acceleration of the motor drops, then for a delay, then Ms.

    *Contact.* The encoder angle phi(t) gives the acceleration over a window of length 2 W,

        a(t) = (phi(t) - 2 phi(t - W) + phi(t - 2 W))/W^2

    and the same difference of the angle which a free motor would have had under the torque realised so far,
    int int u/J1, gives the acceleration a0(t) of an open gap. Contact is seen when a < a0 - drop torque/J1. W
    is the shortest window in which the rounding of the encoder cannot look like that (`window`).

    *Delay.* From contact the torque stays reduced for `delay`, by default until the torque peak, [G](14),
    less the `latency` of the detection, at the nearest sample. After `contact_timeout` it is raised anyway.

    [G] proposes the length of stage 2, (15), twice as long (`raise_at` "end"): then the gap opens again, and
    the second contact is about as hard as the first one of method 1 (`run.k_dyn`, `run.k_dyn_first_contact`).

    Source: [G], conclusions; stages by [G](10), (11), (15).

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), AccelerationDelay())
    >>> run.k_dyn < 1.3, run.contacts
    (True, 1)
    """

    name = "acceleration-delay"
    summary = "reduced until the motor's acceleration drops, kept for a delay, then Ms"
    source = "[G]"
    effort = Effort.STEPS
    time_parameter = "torque"
    settings = ("delay", "full_torque")
    kernel = step

    # fmt: off
    torque: float = reduced_torque_parameter("reduced torque", "above 0")
    full_torque: float = full_torque_parameter("torque after the delay", "0 or more")
    delay: float = parameter("s", "time from contact to full torque",
        lambda drive, p: delay_of(drive, p.torque, p.raise_at),
        "until the torque peak of stage 2, [G](14), or its end, [G](15)", "0 or more", multiples=(0.2, 3.0))
    drop: float = parameter("1",
        "drop of the acceleration that means contact, as a share of torque/J1", contact_drop,
        "0.3, or half the share that a closed drive takes on the mean where that is less, at least 0.05",
        "above 0")
    latency: float = parameter("s", "time from contact to its detection",
        lambda drive, p: detection_latency(drive, p.torque, p.drop, p.period),
        "from the window and the shaft torque of [G](11)", "0 or more")
    contact_timeout: float = timeout_parameter("longest wait for contact")
    period: float = period_parameter()
    raise_at: str = raise_parameter()
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """The window, and the wait from when the contact is seen."""
        half, stride, threshold = window(drive, self.torque, self.drop, self.period)
        delay: Any = self.delay
        wait = max(delay - self.latency, 0.0)
        return {"half": half, "stride": stride, "threshold": threshold, "wait": wait}


def window(drive: Drive, torque: float, drop: float, period: float) -> tuple[int, int, float]:
    """Kept samples in half a window, stride between them in periods, threshold of the difference in rad.

    >>> crane = Drive.load("crane-4amtkf")
    >>> half, stride, threshold = window(crane, 15.386, 0.3, 0.001)
    >>> half, stride, round(threshold / encoder_count(crane.encoder_lines), 1)
    (5, 1, 8.6)
    """
    rounding = 2.0 * encoder_count(drive.encoder_lines)
    a = drop * torque / drive.J1
    samples = max(math.ceil(math.sqrt(rounding / (ROUNDING_SHARE * a)) / period), SHORTEST_WINDOW)
    stride = math.ceil(samples / LONGEST_WINDOW)
    half = math.ceil(samples / stride)
    return half, stride, a * (half * stride * period) ** 2


def detection_latency(drive: Drive, torque: float, drop: float, period: float) -> float:
    """Time in s from contact until the window is at its threshold, at most the length of stage 2.

    The angle lost to the shaft is l(s) = int int T/J1 with T of [G](11), so with x = Omega s

        l(s) = (mean (x^2/2 - 1 + cos x) + (c dw12/Omega)(x - sin x))/(J1 Omega^2)

    l(s) - 2 l(s - W) + l(s - 2 W) = threshold is solved by bisection; half the time between two looks is
    added.

    >>> round(detection_latency(Drive.load("crane-4amtkf"), 15.386, 0.3, 0.001), 4)
    0.0054
    """
    half, stride, threshold = window(drive, torque, drop, period)
    dw12, Omega = closing_speed(drive, torque), drive.Omega
    mean = mean_under(drive, torque)

    impact, unit = drive.c * dw12 / Omega, drive.J1 * Omega**2

    def lost(s: float) -> float:
        if s <= 0.0:
            return 0.0
        angle = Omega * s
        half_sine = math.sin(0.5 * angle)
        swing = mean * (0.5 * angle * angle - 2.0 * half_sine * half_sine)
        return (swing + impact * (angle - math.sin(angle))) / unit

    low, high = 0.0, swing_duration(drive, torque, dw12)
    back = half * stride * period
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if lost(middle) - 2.0 * lost(middle - back) + lost(middle - 2.0 * back) > threshold:
            high = middle
        else:
            low = middle
    return high + 0.5 * stride * period
