"""`softstart sweep`: the starts of a whole grid, on this machine or on a cluster."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import softstart
from softstart.cli.commands import Command, Reading, typed
from softstart.cli.completion import axes as axes_known
from softstart.cli.completion import files_only
from softstart.cli.options import (
    check_name,
    code_allowed,
    command_line,
    controller_option,
    count,
    drive_argument,
    fitted_to_option,
    json_option,
    named_as_options,
    out_option,
    param_option,
    read_list,
    read_machine,
    scheduler_option,
    set_option,
    until_option,
    workers_option,
)
from softstart.cli.running import Attributed, working
from softstart.drive import PARAMETERS
from softstart.errors import InputError, Mistakes
from softstart.late import late
from softstart.quantities import values_in, whole_number
from softstart.views.markdown import kept_state, output_folder
from softstart.views.terminal import present

if TYPE_CHECKING:
    import xarray

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
AT_MOST = 4.0  # times a second, that the line of progress changes


def _check_controller(given: Mapping[str, Any]) -> None:
    named = any(text.partition("=")[0].strip() == "controller" for text in given["axes"])
    if not named and typed("controller") is None:
        raise InputError(
            "--controller is missing: name one, or make an axis of several, as controller=direct,ramp."
        )


@click.command(cls=Command, checks=[_check_controller])
@drive_argument(read_machine)
@controller_option(
    "--controller",
    "NAME",
    "The controller, unless several are an axis: --axis controller=direct,ramp.",
    read=lambda name, option: check_name(name, option, "several are an axis: --axis controller="),
)
@click.option(
    "--axis",
    "axes",
    metavar="KEY=VALUES",
    multiple=True,
    required=True,
    shell_complete=axes_known,
    help="Axis of the grid: a parameter of the drive, shaft.gap=0.25:4:100 (from:to:count, with :log for "
    "geometric spacing), 1x:4x:7 (multiples of the drive's) or load.kind=active,reactive, or of the "
    "controller, controller.torque='10 N*m,20 N*m'. Of a chain shaft.gap is the sum of all gaps, "
    "shaft[2].gap or mass[crane].inertia one part. May be repeated.",
)
@param_option("Set a parameter of the controller for all starts. May be repeated.")
@set_option
@fitted_to_option
@until_option
@click.option(
    "--figures",
    metavar="A,B,...",
    type=Reading(read_list),
    help="Figures to save, for example k_dyn,start_time; the status is always saved.",
)
@workers_option
@scheduler_option
@click.option(
    "--chunk",
    metavar="N",
    type=count(),
    help="Largest number of starts that are computed and written at once.",
)
@click.option(
    "--netcdf",
    metavar="FILE",
    shell_complete=files_only(".nc"),
    help="Also write the results as netCDF.",
)
@json_option
@out_option(
    f"Write the results chunk by chunk into DIR/{RESULTS}, with figure, table and report.md; an "
    "interrupted command resumes. Without it only a summary is printed."
)
def sweep(
    *,
    drive: Machine,
    controller: str | None,
    axes: tuple[str, ...],
    params: dict[str, str],
    fitted_to: Drive | None,
    figures: list[str] | None,
    as_json: bool,
    out: str | None,
    **asked: Any,
) -> None:
    """Simulate a grid of drives and controllers of any size.

    DRIVE is a TOML file or the name of a shipped drive or chain (see: softstart drives); by default the crane
    drive of the literature. The results are a Zarr store that xarray opens.
    """
    asked |= {"fitted_to": fitted_to, **({} if figures is None else {"figures": figures})}
    begin = time.monotonic()
    with output_folder(out) as folder, kept_state(out, RESULTS, "finished chunks") as to, named_as_options():
        results, last = _computed(drive, controller, params, axes, asked, to)

        with working("summing up ..."):
            summary = summaries.summarise(results)
            if folder is not None:
                views.write_sweep(results, summary, drive, folder, command_line(), fitted_to)

    def data() -> dict[str, Any]:
        return {
            "drive": drive.name,
            "fitted_to": fitted_to.name if fitted_to else None,
            "controller": controller,
            "axes": views.axis_summary(results),
            **summary.summary(),
            "cells": list(views.cell_rows(results)) if summary.starts <= views.MOST_SHOWN else None,
            "seconds": time.monotonic() - begin,
            "computed": last.done - last.before if last else 0,
            "results": None if to is None else str(to),
        }

    present(
        data,
        lambda screen: views.show(screen, drive, fitted_to, results, summary, last),
        as_json,
        out and f"{out}: {RESULTS}, report.md, the figure and the tables",
    )


def _computed(
    drive: Machine,
    controller: str | None,
    values: dict[str, str],
    axes: tuple[str, ...],
    asked: dict[str, Any],
    to: Path | None,
) -> tuple[xarray.Dataset, Progress | None]:
    """The results, and how far it was at the end."""
    with working("starting the first drive ...") as show, Attributed():
        grid = read_axes(axes, makers.Maker(controller or "", values, code_allowed()), drive)
        last: Progress | None = None
        shown = 0.0

        def progress(now: Progress) -> None:
            nonlocal last, shown
            last = now
            if time.monotonic() - shown > 1.0 / AT_MOST:
                shown = time.monotonic()
                show(str(now))

        return softstart.sweep(
            drive,
            controller,
            grid,
            parameters=values,
            to=to,
            progress=progress,
            allow_code=code_allowed(),
            **asked,
        ), last


MOST_VALUES = 1_000_000  # of a range


def read_axes(texts: Sequence[str], maker: makers.Maker, machine: Machine | None = None) -> dict[str, Any]:
    """The grid of several --axis over a drive or chain; all mistakes at once.

    >>> from softstart.sweeping.maker import Maker
    >>> grid = read_axes(["shaft.gap=0.5:2:4", "load.inertia=700 kg*cm^2, 0.175"], Maker("direct"))
    >>> grid["gap"].tolist(), grid["load_inertia"].tolist()
    ([0.5, 1.0, 1.5, 2.0], [0.07, 0.175])
    """
    mistakes = Mistakes()
    split: dict[str, str] = {}
    for text in texts:
        key, equals, values = (part.strip() for part in text.partition("="))
        with mistakes.noted():
            if not (key and equals and values):
                raise InputError(
                    f'--axis "{text}": write a parameter, an equals sign and values, as shaft.gap=0.25:4:100 '
                    "or load.inertia=0.07,0.175."
                )
            if key in split:
                raise InputError(f'--axis "{text}": {key} is an axis already; name it once.')
            split[key] = values
    parameters = _parameters(split, maker, mistakes)
    grid: dict[str, Any] = {}
    for key, values in split.items():
        with mistakes.noted():
            try:
                name, read = _read(key, values, parameters, machine)
            except InputError as error:
                raise InputError([f"--axis {sentence}" for sentence in error.sentences]) from error
            if name in grid:
                raise InputError(f"--axis {key}: this parameter is an axis already, by its other name.")
            grid[name] = read
    mistakes.settle()
    return grid


def _parameters(split: dict[str, str], maker: makers.Maker, mistakes: Mistakes) -> makers.Parameters | None:
    """Those that the controllers have, None if these are wrong."""
    found: makers.Parameters | None = None
    with mistakes.noted():
        if "controller" in split:
            names = _listed("controller", split["controller"])
            for name in names:
                check_name(name, "--axis controller")
            found = maker.common_parameters(names)
        elif maker.given:
            found = maker.parameters()
    return found


def _read(
    key: str, text: str, parameters: makers.Parameters | None, machine: Machine | None
) -> tuple[str, Any]:

    parts = [part.strip() for part in text.split(":")]
    is_range = len(parts) in (3, 4) and key != "controller" and not any(".py" in part for part in parts)
    if not is_range:
        column = grids.read_column(key, _listed(key, text), parameters, machine)
        return column.name, column.values
    column = grids.read_column(key, parts[:2], parameters, machine)
    if not column.numeric:
        raise InputError(f'{key} = "{text}": these values are names; write them with commas between.')
    return column.name, _spaced(key, text, parts, *column.values.tolist())


def _spaced(key: str, text: str, parts: Sequence[str], first: float, last: float) -> Any:

    count = whole_number(parts[2], f'{key} = "{text}": the count', 2, MOST_VALUES)
    if first == last:
        raise InputError(f'{key} = "{text}": both ends are the same; write the one value.')
    if len(parts) == 3:
        return np.linspace(first, last, count)
    if parts[3] != "log":
        raise InputError(f'{key} = "{text}": a range is from:to:count, or from:to:count:log.')
    if not (first > 0.0 and last > 0.0):
        raise InputError(f'{key} = "{text}": the ends of a range in equal ratios (log) are above 0.')
    return np.geomspace(first, last, count)


def _listed(key: str, text: str) -> list[str]:
    owner, name = grids.target_of(key) or ("unknown", "")
    counts = owner == "drive" and name in PARAMETERS and PARAMETERS[name].limit.startswith("a whole number")
    return values_in(text, key, whole=counts or owner in ("controller", "unknown"))
