"""One run of IPOPT on a transcribed problem, cold or from a full primal-dual solution."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from softstart.optimal.collocation.scaling import Numbers
from softstart.optimal.collocation.transcription import Transcribed

Vector = NDArray[np.float64]

QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "error_on_fail": False}
ACCURACY = {
    "ipopt.tol": 1e-8,
    "ipopt.constr_viol_tol": 1e-9,
    "ipopt.acceptable_tol": 1e-7,
    "ipopt.acceptable_constr_viol_tol": 1e-9,
    "ipopt.acceptable_iter": 8,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.max_iter": 200,
    "ipopt.max_resto_iter": 30,
    "ipopt.mu_strategy": "monotone",
}
# s of computing time a variable: 200 iterations take half of it, only a search that is lost in restoration
# takes more.
PATIENCE = 2e-3
NEAR = {  # from a solution on a coarser mesh
    "ipopt.mu_strategy": "monotone",
    "ipopt.bound_push": 1e-4,
    "ipopt.bound_frac": 1e-4,
}
WARM = {
    "ipopt.warm_start_init_point": "yes",
    "ipopt.mu_strategy": "monotone",
    "ipopt.warm_start_bound_push": 1e-9,
    "ipopt.warm_start_bound_frac": 1e-9,
    "ipopt.warm_start_slack_bound_push": 1e-9,
    "ipopt.warm_start_slack_bound_frac": 1e-9,
    "ipopt.warm_start_mult_bound_push": 1e-9,
}
INTERRUPTED = ("User_Requested_Stop", "NonIpopt_Exception_Thrown")  # how CasADi tells of a Ctrl-C


@dataclass(frozen=True, eq=False)
class Solution:
    """Where IPOPT ended, with the multipliers of bounds and conditions."""

    transcribed: Transcribed
    p: Numbers
    parameters: Vector
    x: Vector
    lam_x: Vector
    lam_g: Vector
    value: float  # objective
    reason: str  # IPOPT's own word
    violation: float
    iterations: int

    @property
    def found(self) -> bool:
        return self.reason in ("Solve_Succeeded", "Solved_To_Acceptable_Level")

    def read(self) -> tuple[Vector, float, float, Vector, Vector]:
        """Durations, peak, heat, states (4 n, states), demands (n, 2), in the units of scaling.py."""
        durations, peak, heat, states, demands = self.transcribed.readout(self.x, self.parameters)
        return (
            np.array(durations).ravel(),
            float(peak),
            float(heat),
            np.array(states).T,
            np.array(demands).T,
        )


@lru_cache(maxsize=32)
def _solver(transcribed: Transcribed, mu: float, full: bool, adaptive: bool) -> Any:
    """The solver of a program; `mu` above 0: begun near, at barrier parameter; `full`: with multipliers."""
    options: dict[str, Any] = {**QUIET, **ACCURACY}
    options["ipopt.max_cpu_time"] = PATIENCE * max(1000, len(transcribed.slots))
    if adaptive:
        options["ipopt.mu_strategy"] = "adaptive"
    if mu > 0.0:
        options |= {**(WARM if full else NEAR), "ipopt.mu_init": mu}
    return ca.nlpsol("start", "ipopt", transcribed.nlp, options)


def run(
    transcribed: Transcribed,
    p: Numbers,
    parameters: Vector,
    x: Vector,
    multipliers: tuple[Vector, Vector] | None = None,
    mu: float = 0.0,
    adaptive: bool = False,
) -> Solution:
    """Solve from x; `mu` above 0: x is near, begin at this barrier parameter; with multipliers very near.

    `adaptive`: another course of the barrier parameter, mostly slower; it may end where the usual one fails.
    """
    lbx, ubx, lbg, ubg = transcribed.limits(parameters)
    given: dict[str, Any] = {"x0": x, "p": parameters, "lbx": lbx, "ubx": ubx, "lbg": lbg, "ubg": ubg}
    if multipliers is not None:
        given |= {"lam_x0": multipliers[0], "lam_g0": multipliers[1]}
    solver = _solver(transcribed, mu, multipliers is not None, adaptive)
    try:
        out = solver(**given)
    except RuntimeError as error:
        if "KeyboardInterrupt" in str(error):
            raise KeyboardInterrupt from error
        raise
    stats = solver.stats()
    if stats["return_status"] in INTERRUPTED:
        raise KeyboardInterrupt
    g, low, high = (np.array(a).ravel() for a in (out["g"], lbg, ubg))
    violation = float(np.max(np.maximum(low - g, g - high), initial=0.0))
    return Solution(
        transcribed,
        p,
        parameters,
        np.array(out["x"]).ravel(),
        np.array(out["lam_x"]).ravel(),
        np.array(out["lam_g"]).ravel(),
        float(out["f"]),
        str(stats["return_status"]),
        violation,
        int(stats["iter_count"]),
    )
