"""The worked example of [G]: its drives, its reduced torques, and what every part of the study asks."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from scipy.optimize import brentq

from softstart import Drive, MachineTable, Run, TorqueProfile, formulas, simulate
from softstart.arrays import Vector
from softstart.controller import Controller, make_controller
from softstart_studies.crane import CRANE, published

Method = Literal[1, 2]

GAP_1, GAP_2 = 0.5, 2.0  # rad, new and worn
LIGHT, HEAVY = 2, 5  # J2'/J1, J2''/J1
BASE = CRANE.mean_torque  # N m: K_dyn refers to that of J2'' = 5 J1 for all curves of fig. 2
SHARE = 0.25  # M1/Ms where one reduced torque stands for all, as in the check table
TORQUE = SHARE * float(CRANE.Ms)
RATIOS: Vector = np.linspace(0.0, 1.0, 101)[1:]  # the axis of figs. 2-4
METHODS: tuple[Method, Method] = (1, 2)
CONTROLLERS = {1: "reduced-first-stage", 2: "reduced-two-stage"}


def crane(ratio: float = HEAVY, gap: float = GAP_1) -> Drive:
    """The drive of [G] with J2 = ratio J1 and this total gap in rad.

    >>> crane(2, 2.0).J2, crane(2, 2.0).gap
    (0.07, 2.0)
    """
    return CRANE.replace(load_inertia=ratio * CRANE.J1, gap=gap)


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


def k_dyn(ratio: float, gap: float, r: Any, method: Method, base: float | None = BASE) -> Any:
    """K_dyn of stage 2 by the closed form, on the base of J2'' = 5 J1 or, with None, on that of the drive.

    >>> round(k_dyn(2, 0.5, 1.0, 1), 4), round(k_dyn(2, 0.5, 1.0, 1, None), 4)
    (2.7157, 3.2834)
    """
    return closed_form(crane(ratio, gap), r, method, base).k_dyn


def ratio_where(value: float, ratio: float, gap: float, method: Method) -> float:
    """The ratio M1/Ms at which the closed form of this method gives this K_dyn.

    >>> round(ratio_where(2.0, 5, 0.5, 2), 3)
    0.524
    """
    return float(brentq(lambda r: k_dyn(ratio, gap, r, method) - value, 0.0, 1.0, xtol=1e-14))


def simulated(drive: Drive, r: float, method: Method) -> Run:
    """The whole start by the plant, torque r Ms in stage 1 (method 1) or in stages 1 and 2 (method 2).

    >>> round(simulated(crane(), 0.25, 2).k_dyn_first_contact, 4)
    1.2677
    """
    return simulate(drive, published(CONTROLLERS[method], torque=r * float(drive.Ms)), base=CRANE)


def many(drives: MachineTable, controller: Controller) -> tuple[Vector, Vector]:
    """K_dyn of first contact and of the whole start of a batch; controller and base of the new drive.

    >>> from softstart import machine_table
    >>> [k.round(4).tolist() for k in many(machine_table(CRANE, gap=[0.5, 2.0]), published("direct"))]
    [[3.1179, 4.8654], [3.1179, 4.8654]]
    """
    results = simulate(drives, controller, fitted_to=CRANE, base=CRANE)
    return np.asarray(results["k_dyn_first_contact"]), np.asarray(results["k_dyn"])


def ways() -> dict[str, Controller]:
    """How the torque M1 = Ms/4 is raised: at an instant, or a delay after the acceleration has dropped.

    The instant is t1 + t2 of the new drive: what [G] warns of. (15) is the length of stage 2, as [G]
    proposes; (14) half of it: at the peak of stage 2 the shaft carries the torque, the gap stays closed.
    """
    new = closed_form(CRANE, SHARE, 2)
    instant, length = float(new.open_duration + new.contact_duration), float(new.contact_duration)
    at_instant = TorqueProfile.steps([0.0, instant, 60.0], [TORQUE, float(CRANE.Ms)])
    return {
        "instant": make_controller("profile", {"profile": at_instant}),
        "delay (15)": published("acceleration-delay", torque=TORQUE),
        "delay (14)": published("acceleration-delay", torque=TORQUE, delay=0.5 * length),
    }
