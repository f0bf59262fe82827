"""An engagement by scipy's DOP853 with events: another formulation, another integrator, no formula shared."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp


@dataclass
class Outcome:
    slip_time: float
    peak: float
    work: float
    end: np.ndarray
    reslips: int


def torque_of(clutch):
    """M(t) written out anew from [C]."""
    MM, tM, kind = clutch.clutch_torque, clutch.engagement_time, clutch.law
    if kind == "table":
        times, torques = np.array(clutch.law_times), np.array(clutch.law_torques)
        return lambda t: float(np.interp(t, times, torques)), sorted(set(clutch.law_times) - {0.0})
    shapes = {
        "linear": lambda x: x,
        "quadratic-concave": lambda x: 2 * x - x * x,
        "quadratic-convex": lambda x: x * x,
        "exponential": lambda x: (
            math.expm1(x * tM / clutch.time_constant) / math.expm1(tM / clutch.time_constant)
        ),
    }
    return lambda t: MM * shapes[kind](t / tM) if t < tM else MM, [tM]


def integrate(clutch, until: float, finest: float = 0.3) -> Outcome:
    """From rest to `until`: y = theta, wM, wc, friction work.

    Events are seen where their function has changed its sign between two steps, of `finest/B` at most: a slip
    or a touch that begins and ends within one is not; take a smaller share then.
    """
    IM, Ic, c, d = clutch.clutch_inertia, clutch.load_inertia, clutch.stiffness, clutch.damping
    w0, Mc, half = clutch.drive_speed, clutch.load_torque, 0.5 * clutch.gap
    torque, corners = torque_of(clutch)
    slip, side = 1, (0 if half else 2)  # side 2: no gap, the shaft pulls and pushes
    load = None if clutch.load_kind == "active" or Mc == 0.0 else 0

    def shaft(y, side):
        if side == 0:
            return 0.0
        offset = 0.0 if side == 2 else side * half
        return c * (y[0] - offset) + d * (y[1] - y[2])

    t, y = 0.0, np.zeros(4)
    slip_time, peak, reslips = math.nan, 0.0, 0
    for _ in range(400):
        if t >= until:
            break
        stop = min([x for x in corners if x > t * (1 + 1e-15)] + [until])
        R = Mc if load is None else Mc * load

        def slopes(t, y, slip=slip, side=side, load=load, R=R):
            M, T = torque(t), shaft(y, side)
            wM, wc = y[1], y[2]
            aM = 0.0 if slip == 0 else (slip * M - T) / IM
            ac = 0.0 if load == 0 else (T - R) / Ic
            heat = 0.0 if slip == 0 else slip * M * (w0 - wM)
            return [wM - wc, aM, ac, heat]

        events = []

        def event(name, g, events=events):
            g.terminal, g.direction = True, 1.0
            events.append((name, g))

        if slip:
            event("sync", lambda t, y, s=slip: s * (y[1] - w0))
        else:
            event("over", lambda t, y, side=side: shaft(y, side) - torque(t))
            event("under", lambda t, y, side=side: -shaft(y, side) - torque(t))
        if side in (1, -1):
            event("open", lambda t, y, side=side: -side * shaft(y, side))
        elif side == 0:
            # pressed in without torque counts as open until the flank pushes again
            for s in (1, -1):
                event(
                    f"touch{s}",
                    lambda t, y, s=s: min(s * y[0] - half, c * (s * y[0] - half) + d * s * (y[1] - y[2])),
                )
        if load in (1, -1):
            event("stop", lambda t, y, load=load: -load * y[2])
        elif load == 0:
            event("go1", lambda t, y, side=side: shaft(y, side) - Mc)
            event("go-1", lambda t, y, side=side: -shaft(y, side) - Mc)
        turn = lambda t, y, side=side: slope_of_torque(t, y, side)  # noqa: E731

        def slope_of_torque(t, y, side, slopes=slopes):
            f = slopes(t, y)
            return 0.0 if side == 0 else c * f[0] + d * (f[1] - f[2])

        found = solve_ivp(
            slopes, (t, stop), y, "DOP853", rtol=3e-12, atol=1e-12 * w0,
            events=[*(g for _, g in events), turn],
            max_step=finest / clutch.B,  # a short touch is not stepped over
        )  # fmt: skip
        peak = max(peak, abs(shaft(y, side)), abs(shaft(found.y[:, -1], side)))
        for extreme in found.y_events[-1]:
            peak = max(peak, abs(shaft(extreme, side)))
        t, y = float(found.t[-1]), found.y[:, -1].copy()
        if found.status != 1:
            t = stop
            # a corner of the law may make the clutch slip: looked at by the next span's events
            if slip == 0 and abs(shaft(y, side)) > torque(t + 1e-15):
                slip = int(math.copysign(1, shaft(y, side)))
                reslips += 1
            continue
        name = next(n for (n, _), hits in zip(events, found.t_events, strict=False) if hits.size)
        if name == "sync":
            y[1] = w0
            slip = 0 if abs(shaft(y, side)) <= torque(t) else -slip
            if slip == 0 and math.isnan(slip_time):
                slip_time = t
        elif name in ("over", "under"):
            slip, reslips = (1 if name == "over" else -1), reslips + 1
        elif name == "open":
            side = 0
        elif name.startswith("touch"):
            side = int(name.removeprefix("touch"))
            if slip == 0 and abs(shaft(y, side)) > torque(t):  # a damped impact is a step of the torque
                slip, reslips = int(math.copysign(1, shaft(y, side))), reslips + 1
            if load == 0 and abs(shaft(y, side)) > Mc:  # and a load at rest is torn off at once
                load = int(math.copysign(1, shaft(y, side)))
        elif name == "stop":
            load, y[2] = 0, 0.0
            if abs(shaft(y, side)) > Mc:
                load = int(math.copysign(1, shaft(y, side)))
        else:
            load = int(name.removeprefix("go"))
    else:
        raise AssertionError("too many spans")
    return Outcome(slip_time, peak, float(y[3]), y, reslips)
