"""The optimal law by direct collocation: CasADi and IPOPT, from the linear law, with no formula in common.

States T, wM, wc and the work W, at Radau points of third degree; one torque an interval before tM, MM behind
it, the slip time free:

    minimise W(tau1)   subject to   T <= P, wM <= w0, wM(tau1) = w0, 0 <= M <= MM (and nondecreasing)

It finds a local optimum, without a bound.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softstart.clutch import Clutch, engage
from softstart.errors import SimulationError

OPTIONS = {"print_level": 0, "sb": "yes", "max_iter": 1000, "tol": 1e-9}


def collocated(
    clutch: Clutch, P: float, law_class: str = "any", intervals: int = 60, after: int = 40
) -> float:
    """The least friction work in J with T <= P (N m) up to the lock-up, as a local optimum.

    Raises SimulationError with IPOPT's verdict if it finds none.
    """
    import casadi as ca

    IM, Ic, cp, w0 = clutch.clutch_inertia, clutch.load_inertia, clutch.stiffness, clutch.drive_speed
    MM, Mc, tM = clutch.clutch_torque, clutch.load_torque, clutch.engagement_time
    guess = engage(clutch.replace(law="linear", law_times=None, law_torques=None))
    scales = np.array([MM, w0, w0, (IM + Ic) * w0**2])
    x, M = ca.MX.sym("x", 4), ca.MX.sym("M")
    T, wM, wc, _ = ca.vertsplit(x * scales)
    slopes = ca.vertcat(cp * (wM - wc), (M - T) / IM, (T - Mc) / Ic, M * (w0 - wM)) / scales
    points = ca.collocation_points(3, "radau")
    slopes_at = ca.Function("slopes", [x, M], [slopes]).map(len(points))
    differentiate, *_ = ca.collocation_coeff(points)

    opti: Any = ca.Opti()
    number = intervals + after
    rest, shares = opti.variable(), opti.variable(intervals)
    X = opti.variable(4, 3 * number + 1)
    for k in range(number):
        h, torque = (tM / intervals, shares[k] * MM) if k < intervals else (rest / after, MM)
        here = X[:, 3 * k : 3 * k + 4]
        opti.subject_to(here @ differentiate == h * slopes_at(here[:, 1:], torque))
    opti.subject_to(X[:, 0] == 0)
    opti.subject_to(X[0, 1:] <= P / MM)
    opti.subject_to(X[1, 1:] <= 1.0)
    opti.subject_to(X[1, -1] == 1.0)
    opti.subject_to(opti.bounded(0.0, shares, 1.0))
    opti.subject_to(opti.bounded(2.0 * np.pi / clutch.B, rest, 3.0 * (guess.slip_time - tM)))
    if law_class == "nondecreasing":
        opti.subject_to(shares[1:] >= shares[:-1])
    opti.minimize(X[3, -1])
    edges = np.append(
        np.linspace(0.0, tM, intervals, endpoint=False), np.linspace(tM, guess.slip_time, after + 1)
    )
    times = np.append(0.0, edges[:-1, None] + np.diff(edges)[:, None] * np.array(points))
    traces = guess.at(times)
    work = guess.slip_work * np.linspace(0.0, 1.0, times.size)
    opti.set_initial(X, np.array([traces["T"], traces["wM"], traces["wc"], work]) / scales[:, None])
    opti.set_initial(shares, (np.arange(intervals) + 0.5) / intervals)
    opti.set_initial(rest, guess.slip_time - tM)
    opti.solver("ipopt", {"print_time": False}, OPTIONS)
    try:
        return float(opti.solve().value(X[3, -1])) * float(scales[3])
    except RuntimeError as error:
        raise SimulationError(f"IPOPT found no law at {P:.6g} N m: {opti.return_status()}.") from error
