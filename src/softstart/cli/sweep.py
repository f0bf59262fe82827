"""`softstart sweep`: the starts of a whole grid, on this machine or on a cluster."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli import options
from softstart.cli.commands import Command, Reading
from softstart.cli.completion import axes as axes_known
from softstart.cli.completion import files_only
from softstart.cli.running import Attributed, answering, working
from softstart.drive import PARAMETERS
from softstart.errors import InputError, Mistakes
from softstart.late import late
from softstart.quantities import values_in
from softstart.views.markdown import kept_state

if TYPE_CHECKING:
    from softstart.chain.machines import Machine
    from softstart.drive import Drive
    from softstart.sweeping import grid as grids
    from softstart.sweeping import maker as makers
    from softstart.sweeping import summary as summaries
    from softstart.sweeping.entry import Progress
    from softstart.views import sweeps as views
else:  # no numba for a help, a wrong option or the Tab key
    grids, makers = late("softstart.sweeping.grid"), late("softstart.sweeping.maker")
    summaries, views = late("softstart.sweeping.summary"), late("softstart.views.sweeps")

RESULTS = "sweep.zarr"
MOST_VALUES = 1_000_000  # of a range


@click.command(cls=Command)
@options.drive_argument(options.read_machine)
@options.controller_option(
    "--controller", "NAME", "The controller, unless several are an axis: --axis controller=direct,ramp.",
    read=lambda name, option: options.check_name(name, option, "several are an axis: --axis controller="),
)  # fmt: skip
@click.option("--axis", "axes", metavar="KEY=VALUES", multiple=True, required=True, shell_complete=axes_known,
    help="Axis of the grid: a parameter of the drive, shaft.gap=0.25:4:100 (from:to:count, with :log for "
    "geometric spacing), 1x:4x:7 (multiples of the drive's) or load.kind=active,reactive, or of the "
    "controller, controller.torque='10 N*m,20 N*m'. Of a chain shaft.gap is the sum of all gaps, "
    "shaft[2].gap or mass[crane].inertia one part. May be repeated.")  # fmt: skip
@options.param_option("Set a parameter of the controller for all starts. May be repeated.")
@options.set_option
@options.fitted_to_option
@options.until_option
@click.option("--figures", metavar="A,B,...", type=Reading(options.read_list),
    help="Figures to save, for example k_dyn,start_time; the status is always saved.")  # fmt: skip
@options.workers_option
@options.scheduler_option
@click.option("--chunk", metavar="N", type=options.count(),
    help="Largest number of starts that are computed and written at once.")  # fmt: skip
@click.option(
    "--netcdf", metavar="FILE", shell_complete=files_only(".nc"), help="Also write the results as netCDF."
)
@options.json_option
@options.out_option(
    f"Write the results chunk by chunk into DIR/{RESULTS}, with figure, table and report.md; an "
    "interrupted command resumes. Without it only a summary is printed."
)
def sweep(
    *, drive: Machine, controller: str | None, axes: tuple[str, ...], params: dict[str, str],
    fitted_to: Drive | None, as_json: bool, out: str | None, **asked: Any,
) -> None:  # fmt: skip
    """Simulate a grid of drives and controllers of any size.

    DRIVE is a TOML file or the name of a shipped drive or chain (see: softstart drives); by default the crane
    drive of the literature. The results are a Zarr store that xarray opens.
    """
    asked = {name: value for name, value in asked.items() if value is not None}
    begin, last = time.monotonic(), None

    def progress(now: Progress) -> None:
        nonlocal last
        last = now
        show(str(now))

    with (
        kept_state(out, RESULTS, "finished chunks") as to,
        answering(as_json, out) as answer,
        options.named_as_options(),
    ):
        with working("starting the first drive ...") as show:
            with Attributed():
                grid = read_axes(axes, makers.Maker(controller or "", params, options.code_allowed()), drive)
                results = softstart.sweep(
                    drive, controller, grid, parameters=params, fitted_to=fitted_to, to=to,
                    progress=progress, allow_code=options.code_allowed(), **asked,
                )  # fmt: skip
            show("summing up")
            summary = summaries.summarise(results)
        data = {
            "drive": drive.name,
            "fitted_to": fitted_to.name if fitted_to else None,
            "controller": controller,
            "axes": views.axis_summary(results),
            **summary.summary(),
            "cells": views.cells(results).to_dict("records") if summary.starts <= views.MOST_SHOWN else None,
            "seconds": time.monotonic() - begin,
            "computed": last.done - last.before if last else 0,
            "results": None if to is None else str(to),
        }
        answer(lambda: data, views.sweep_sheet(results, summary, drive, fitted_to))
    if last and not as_json:
        print(views.pace(last))


def read_axes(texts: Sequence[str], maker: makers.Maker, machine: Machine | None = None) -> dict[str, Any]:
    """The grid of several --axis over a drive or chain; all mistakes at once.

    >>> from softstart.sweeping.maker import Maker
    >>> grid = read_axes(["shaft.gap=0.5:2:4", "load.inertia=700 kg*cm^2, 0.175"], Maker("direct"))
    >>> grid["gap"], grid["load_inertia"].tolist()
    ([0.5, 1.0, 1.5, 2.0], [0.07, 0.175])
    """
    split = options.read_params(texts, "--axis", "shaft.gap=0.25:4:100 or load.inertia=0.07,0.175")
    mistakes = Mistakes()
    parameters: makers.Parameters | None = None  # none where the controllers are wrong
    grid: dict[str, Any] = {}
    with mistakes.noted():
        if "controller" in split:
            names = values_in(split["controller"], "controller", whole=True)
            for name in names:
                options.check_name(name, "--axis controller")
            parameters = maker.common_parameters(names)
        elif maker.given:
            parameters = maker.parameters()
    for key, values in split.items():
        with mistakes.noted("--axis "):
            name, read = _read(key, values, parameters, machine)
            if name in grid:
                raise InputError(f"{key}: this parameter is an axis already, by its other name.")
            grid[name] = read
    mistakes.settle()
    return grid


def _read(
    key: str, text: str, parameters: makers.Parameters | None, machine: Machine | None
) -> tuple[str, Any]:
    """The name and the values of an axis."""
    owner, name = grids.target_of(key) or ("unknown", "")
    if text.count(":") not in (2, 3) or owner == "controller" or ".py" in text:
        counts = owner == "drive" and name in PARAMETERS and PARAMETERS[name].limit.startswith("a whole")
        whole = counts or owner in ("controller", "unknown")
        column = grids.read_column(key, values_in(text, key, whole=whole), parameters, machine)
        return column.name, column.values
    ends, values = options.read_range(text, key, MOST_VALUES)
    column = grids.read_column(key, ends, parameters, machine)
    if not column.numeric:
        raise InputError(f'{key} = "{text}": these values are names; write them with commas between.')
    return column.name, values(*column.values.tolist())
