"""The worked example of [G]: its drives, its reduced torques, and what every part of the study asks."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from scipy.optimize import brentq

from softstart import Drive, Records, Run, formulas, simulate
from softstart.arrays import Vector
from softstart.controller import Controller, make_controller

Method = Literal[1, 2]

CRANE = Drive.load("crane-4amtkf")  # J2'' = 5 J1, delta1 = 0.5 rad
GAP_1, GAP_2 = 0.5, 2.0  # rad, new and worn
LIGHT, HEAVY = 2, 5  # J2'/J1, J2''/J1
SHARE = 0.25  # M1/Ms where one reduced torque stands for all, as in the check table
RATIOS: Vector = np.linspace(0.0, 1.0, 101)[1:]  # the axis of figs. 2-4
POINTS: Vector = np.linspace(0.05, 1.0, 20)  # where the plant is asked too
METHODS: tuple[Method, Method] = (1, 2)
RAISED_AT_THE_END = ("reduced-two-stage", "acceleration-delay")  # of stage 2, in [G]
CONTROLLERS = {1: "reduced-first-stage", 2: "reduced-two-stage"}


def crane(ratio: float = HEAVY, gap: float = GAP_1) -> Drive:
    """The drive of [G] with J2 = ratio J1 and this total gap in rad.

    >>> crane(2, 2.0).J2, crane(2, 2.0).gap
    (0.07, 2.0)
    """
    return CRANE.replace(load_inertia=ratio * CRANE.J1, gap=gap)


def base() -> float:
    """Mean torque in N m that K_dyn refers to in fig. 2 of [G]: that of J2'' = 5 J1 for all curves.

    >>> round(base(), 2)
    52.86
    """
    return CRANE.mean_torque


def closed_form(
    drive: Drive, r: Any, method: Method, base: float | None = None, **changed: Any
) -> formulas.TwoStages:
    """Stages 1 and 2 with M1 = r Ms by [G](3), (15), (17), (18); `base` in N m, else that of the drive.

    `changed` are arrays of J2, c or gap, in SI.

    >>> round(closed_form(crane(), 0.25, 2).k_dyn, 4)
    1.2677
    """
    values = {name: getattr(drive, name) for name in ("J1", "J2", "c", "gap", "Ms", "Mc")} | changed
    low = np.asarray(r) * drive.Ms
    return formulas.two_stages(low, drive.Ms if method == 1 else low, **values, base=base)


def published(controller: str, **parameters: object) -> Controller:
    """A strategy as [G] proposes it: reduced torques are raised at the end of stage 2, (15), not its peak.

    >>> published("acceleration-delay").raise_at
    'end'
    """
    if controller in RAISED_AT_THE_END:
        parameters["raise_at"] = "end"
    return make_controller(controller, parameters)


def simulated(drive: Drive, r: float, method: Method, base: Drive | None = None) -> Run:
    """The whole start by the plant, torque r Ms in stage 1 (method 1) or in stages 1 and 2 (method 2).

    >>> round(simulated(crane(), 0.25, 2).k_dyn_first_contact, 4)
    1.2677
    """
    return simulate(drive, published(CONTROLLERS[method], torque=r * float(drive.Ms)), base=base)


def many(drives: Records, controller: str | Controller, **parameters: float) -> tuple[Vector, Vector]:
    """K_dyn of first contact and of the whole start of a batch; controller and base of the new drive.

    >>> from softstart import records
    >>> [k.round(4).tolist() for k in many(records(CRANE, gap=[0.5, 2.0]), "direct")]
    [[3.1179, 4.8654], [3.1179, 4.8654]]
    """
    ready = published(controller, **parameters) if isinstance(controller, str) else controller
    results: Any = simulate(drives, ready, fitted_to=CRANE, base=CRANE)
    return np.asarray(results["k_dyn_first_contact"]), np.asarray(results["k_dyn"])


def ratio_where(k_dyn: float, drive: Drive, method: Method, base: float | None = None) -> float:
    """The ratio M1/Ms at which the closed form of this method gives this K_dyn.

    >>> round(ratio_where(2.0, crane(), 2), 3)
    0.524
    """
    return float(brentq(lambda r: closed_form(drive, r, method, base).k_dyn - k_dyn, 0.0, 1.0, xtol=1e-14))


def percent(ratio: float) -> str:
    """How much more or less than 1, as text.

    >>> percent(1.56), percent(0.827)
    ('+56 %', '-17 %')
    """
    return f"{100 * (ratio - 1):+.0f} %"
