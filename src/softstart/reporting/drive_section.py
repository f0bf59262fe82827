"""The drive: its scheme and its data."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softstart.drive import PARAMETERS, Drive
from softstart.reporting.markup import Html, html, table, tag
from softstart.reporting.resolution import rated_torque
from softstart.reporting.scheme import scheme
from softstart.reporting.values import RPM, digits, short, unit
from softstart.start import metrics

if TYPE_CHECKING:
    from softstart.reporting.figure_list import Figures
    from softstart.reporting.result import Report

HIDDEN = ("name", "source", "noise_seed", "encoder_phase")


def drive_section(report: Report, figures: Figures) -> Html:
    """Scheme, data, and what follows from them."""
    drive = report.drive
    prefix = figures.prefix()
    caption = (
        "The drive, everything brought to the motor shaft. The height of a disc goes with the fourth root "
        "of its "
        "inertia; spring and gap are drawn to one scale of angles, the spring as long as the shaft is "
        "twisted by "
        "the starting torque. The shaft carries torque only while the gap is closed on a flank."
    )
    return html(
        figures.ready(scheme(drive, prefix), caption),
        tag("h3", "Data", class_="page"),
        _data(drive),
        tag("p", "Source of the data: ", str(drive.source), ".") if drive.source else None,
        tag("h3", "What follows from them"),
        _derived(drive),
    )


def _data(drive: Drive) -> Html:
    rows = []
    for parameter in PARAMETERS.values():
        value = getattr(drive, parameter.name)
        if value is None or value == "" or parameter.name in HIDDEN:
            continue
        text = short(value) if isinstance(value, float) else str(value)
        other = ""
        if parameter.unit == "rad/s":
            other = f"{short(float(f'{value * RPM:.6g}'))} rpm"
        elif parameter.unit == "rad":
            other = f"{short(float(f'{math.degrees(value):.4g}'))}°"
        rows.append(
            [
                parameter.meaning,
                parameter.symbol,
                text,
                unit(parameter.unit).replace(" ", "\N{NO-BREAK SPACE}"),
                other,
            ]
        )
    return table(
        ["parameter", "symbol", "value", "unit", "that is"], rows,
        caption="Data of the drive, at the motor shaft", text_columns=(0, 1, 3),
    )  # fmt: skip


def _derived(drive: Drive) -> Html:
    rated, meant = rated_torque(drive)
    rows = [
        [
            "mean shaft torque under the starting torque: K_dyn = 1",
            digits(float(metrics.base_torque(drive))),
            "N m",
        ],
        ["elastic frequency with the gap closed", digits(float(drive.Omega) / (2.0 * math.pi)), "Hz"],
        ["elastic period", digits(1e3 * float(drive.elastic_period)), "ms"],
        ["twist of the shaft under the starting torque", digits(float(drive.Ms / drive.c)), "rad"],
        [f"100 % of torque in the parameter sheets: the {meant}", digits(rated), "N m"],
    ]
    return table(["figure", "value", "unit"], rows, caption="Derived figures", text_columns=(0, 2))
