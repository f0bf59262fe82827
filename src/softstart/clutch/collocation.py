"""The optimal law by direct collocation: CasADi and IPOPT, from the linear law, with no formula in common.

States z = phiM - phic, wM, wc and the work W, at Radau points of third degree; one torque an interval before
tM, MM behind it, the slip time free:

    minimise W(tau1)   subject to   cp z <= P, wM <= w0, wM(tau1) = w0, 0 <= M <= MM (and nondecreasing)

It finds a local optimum, without a bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.clutch.engagement import engage
from softstart.clutch.least_work import Slip
from softstart.clutch.model import Clutch
from softstart.errors import SimulationError

__all__ = ["Collocated", "collocated"]


DEGREE = 3


@dataclass(frozen=True, eq=False)
class Collocated:
    """What IPOPT found: work in J, slip time in s, torques in N m of equal intervals up to tM."""

    slip_work: float
    slip_time: float
    torques: Vector


def collocated(
    clutch: Clutch, P: float, law_class: str = "any", intervals: int = 60, after: int = 40
) -> Collocated:
    """A local optimum of the friction work with T <= P (N m) up to the lock-up.

    Raises SimulationError with IPOPT's verdict if it finds none.
    """
    import casadi as ca

    slip = Slip.of(clutch)
    guess = engage(clutch.replace(law="linear", law_times=None, law_torques=None))
    opti: Any = ca.Opti()
    rest = opti.variable()
    shares = opti.variable(intervals)
    opti.subject_to(opti.bounded(0.0, shares, 1.0))
    opti.subject_to(opti.bounded(slip.period, rest, 3.0 * (guess.slip_time - slip.tM)))
    if law_class == "nondecreasing":
        opti.subject_to(shares[1:] >= shares[:-1])
    points = np.append(0.0, ca.collocation_points(DEGREE, "radau"))
    slopes = np.array([[np.polyder(_basis(points, j))(x) for x in points[1:]] for j in range(DEGREE + 1)])
    # states by their scales: T/MM, wM/w0, wc/w0, W/(I w0^2)
    size = slip.I * slip.w0**2
    number = intervals + after
    X = opti.variable(4, number * DEGREE + 1)
    opti.subject_to(X[:, 0] == 0)
    # one function for the slopes, one matrix for the polynomials: the graph stays small
    x, share = ca.MX.sym("x", 4), ca.MX.sym("share")
    f = ca.Function("f", [x, share], [ca.vertcat(
        slip.cp * slip.w0 / slip.MM * (x[1] - x[2]),
        slip.MM / (slip.IM * slip.w0) * (share - x[0]),
        (slip.MM * x[0] - slip.Mc) / (slip.Ic * slip.w0),
        share * slip.MM * slip.w0 * (1 - x[1]) / size,
    )])  # fmt: skip
    for k in range(number):
        own = X[:, k * DEGREE : (k + 1) * DEGREE + 1]
        h = slip.tM / intervals if k < intervals else rest / after
        torque = shares[k] if k < intervals else 1.0
        for j in range(DEGREE):
            opti.subject_to(own @ slopes[:, j] == h * f(own[:, j + 1], torque))
    opti.subject_to(X[0, 1:] <= P / slip.MM)
    opti.subject_to(X[1, 1:] <= 1.0)
    opti.subject_to(X[1, -1] == 1.0)
    opti.minimize(X[3, -1])
    edges = np.append(
        np.linspace(0.0, slip.tM, intervals + 1), np.linspace(slip.tM, guess.slip_time, after + 1)[1:]
    )
    times = np.append(0.0, (edges[:-1, None] + np.diff(edges)[:, None] * points[None, 1:]).ravel())
    traces = guess.at(times)
    opti.set_initial(
        X[:3, :], np.vstack([traces["T"] / slip.MM, traces["wM"] / slip.w0, traces["wc"] / slip.w0])
    )
    opti.set_initial(X[3, :], np.linspace(0.0, guess.slip_work / size, times.size))
    opti.set_initial(shares, (np.arange(intervals) + 0.5) / intervals)
    opti.set_initial(rest, guess.slip_time - slip.tM)
    opti.solver(
        "ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 1000, "tol": 1e-9}
    )
    try:
        found = opti.solve()
    except RuntimeError as error:
        raise SimulationError(f"IPOPT found no law at {P:.6g} N m: {opti.return_status()}.") from error
    return Collocated(
        float(found.value(X[3, -1])) * size,
        slip.tM + float(found.value(rest)),
        np.asarray(found.value(shares)) * slip.MM,
    )


def _basis(points: Vector, j: int) -> np.poly1d:
    """Lagrange polynomial that is 1 at point j and 0 at the others."""
    others = np.delete(points, j)
    return np.poly1d(others, r=True) / float(np.prod(points[j] - others))
