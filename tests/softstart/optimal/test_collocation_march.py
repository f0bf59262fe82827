"""An integration of a start under a torque profile that shares nothing with the plant or the transcription.

`march` is used by the other tests of the collocation; here it is held against the oracle and a closed form.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.oracle import integrate

from softstart import Drive
from softstart.profile import TorqueProfile

LOOKS = 2e4  # per second, at the solution's interpolant


@dataclass
class March:
    """What became of a start: end state, peak, and what was seen on the way."""

    theta: float
    v: float
    w2: float
    u: float
    T: float
    peak: float
    heat: float
    contact: float = math.nan
    opened: int = 0
    load_moves: float = 0.0
    t: np.ndarray = field(default_factory=lambda: np.empty(0))
    torque: np.ndarray = field(default_factory=lambda: np.empty(0))  # realised
    w1: np.ndarray = field(default_factory=lambda: np.empty(0))


def shaft(drive, z, v, closed):
    """T of the drive's contact law."""
    if not closed:
        return 0.0
    spring, damper = drive.c * z, drive.d * v
    if drive.contact_law == "dead-zone":
        return spring + damper
    if drive.contact_law == "modelica":
        return max(0.0, spring + min(spring, damper))
    return max(0.0, spring + damper)


def march(drive: Drive, profile: TorqueProfile, end: float) -> March:
    """DOP853 from knot to knot and from event to event, to `end`. Single contact with the driving flank."""
    half, lag = 0.5 * drive.gap, drive.torque_lag
    knots = [t for t in np.unique(profile.time) if t < end] + [end]
    y = np.array(
        [
            drive.theta0 - half,
            drive.initial_motor_speed - drive.initial_load_speed,
            drive.initial_load_speed,
            0.0,
            0.0,
        ]
    )
    reactive = drive.load_kind == "reactive"
    closed = y[0] > 0.0 or (y[0] == 0.0 and y[1] >= 0.0)
    moving = not reactive or y[2] != 0.0
    out = March(0, 0, 0, 0, 0, 0, 0)
    out.contact = 0.0 if closed else math.nan
    seen: list[np.ndarray] = []
    for begin, stop in itertools.pairwise(knots):
        a = float(profile.at([begin])[0])
        b = (profile._just_before(stop) - a) / (stop - begin)
        t = begin
        while t < stop:

            def demand(s, a=a, b=b, begin=begin):
                return a + b * (s - begin)

            def rates(s, x, closed=closed, moving=moving, demand=demand):
                u = x[3] if lag > 0.0 else demand(s)
                T = shaft(drive, x[0], x[1], closed)
                a2 = (T - drive.Mc) / drive.J2 if moving else 0.0
                du = (demand(s) - x[3]) / lag if lag > 0.0 else 0.0
                return [x[1], (u - T) / drive.J1 - a2, a2, du, (u / drive.Ms) ** 2]

            def touches(s, x):
                return x[0]

            def parts(s, x):
                return x[0] if drive.contact_law == "dead-zone" else drive.c * x[0] + drive.d * x[1]

            def breaks_away(s, x):
                return shaft(drive, x[0], x[1], True) - drive.Mc

            touches.direction, parts.direction, breaks_away.direction = 1, -1, 1
            events = [parts] if closed else [touches]
            if closed and not moving:
                events.append(breaks_away)
            for event in events:
                event.terminal = True
            done = solve_ivp(
                rates, (t, stop), y, "DOP853", events=events, rtol=1e-11, atol=1e-14, dense_output=True
            )
            times = np.linspace(t, done.t[-1], 20 + int(LOOKS * (done.t[-1] - t)))
            x = done.sol(times)
            u = x[3] if lag > 0.0 else demand(times)
            T = [shaft(drive, *pair, closed) for pair in x[:2].T]
            seen.append(np.array([times, u, x[1] + x[2], T]))
            t, y = float(done.t[-1]), done.y[:, -1]
            if done.status != 1:
                break
            which = events[next(i for i, hits in enumerate(done.t_events) if hits.size)]
            if which is touches:
                closed, y[0] = True, 0.0
                out.contact = out.contact if out.contact == out.contact else t
                moving = moving or shaft(drive, y[0], y[1], True) > drive.Mc
            elif which is parts:
                closed = False
                out.opened += 1
            else:
                moving, out.load_moves = True, t
    rows = np.concatenate(seen, axis=1)
    out.t, out.torque, out.w1 = rows[0], rows[1], rows[2]
    out.theta, out.v, out.w2 = float(y[0]) + half, float(y[1]), float(y[2])
    out.u, out.T = float(rows[1, -1]), shaft(drive, y[0], y[1], closed)
    out.peak, out.heat = float(np.max(np.abs(rows[3]))), float(y[4])
    return out


@pytest.mark.parametrize("changes", [{}, {"damping": 1.0}, {"load_kind": "reactive"}, {"torque_lag": 0.004}])
def test_march_agrees_with_the_oracle_under_steps(changes):
    drive = Drive.load("crane-4amtkf").replace(**changes)
    pieces = [(0.0, 62.0), (0.012, 25.0), (0.03, 45.0)]
    ours = march(drive, TorqueProfile.steps([0.0, 0.012, 0.03, 0.1], [62.0, 25.0, 45.0]), 0.045)
    theirs = integrate(
        J1=drive.J1, J2=drive.J2, c=drive.c, d=drive.d, gap=drive.gap, Mc=drive.Mc, kind=drive.load_kind,
        law=drive.contact_law, theta0=0.0, w1_0=0.0, w2_0=0.0, torque_pieces=pieces, lag=drive.torque_lag,
        rate=math.inf, u0=0.0, t_end=0.045,
    )  # fmt: skip
    assert ours.w2 == pytest.approx(theirs.w2, rel=1e-8)
    assert pytest.approx(theirs.T, rel=1e-8) == ours.T
    assert ours.peak == pytest.approx(theirs.peak, rel=1e-5)
    assert ours.opened == 0
    assert len(theirs.contacts) == 1


def test_march_under_a_ramp_in_the_gap_is_a_cubic():
    # J1 w1' = r t, w2' = -Mc/J2: theta = r t^3/(6 J1) + Mc t^2/(2 J2)
    drive = Drive.load("crane-4amtkf")
    ours = march(drive, TorqueProfile([0.0, 0.02], [0.0, 20.0]), 0.02)
    expected = 1000.0 * 0.02**3 / (6 * drive.J1) + drive.Mc * 0.02**2 / (2 * drive.J2)
    assert ours.theta == pytest.approx(expected, rel=1e-10)
