"""`softstart sweep`: the starts of a whole grid, on this machine or on a cluster."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli import options
from softstart.cli.completion import one_of
from softstart.cli.options import command, option
from softstart.cli.running import Output, answers, attributed, option_value, working
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.input.gear import BEHIND
from softstart.quantities import values_in
from softstart.views.markdown import kept_state

if TYPE_CHECKING:
    from softstart.controller.recipe import Recipe
    from softstart.drive.machine import Machine
    from softstart.sweeping.entry import SweepProgress
    from softstart.sweeping.grid import Subject

RESULTS = "sweep.zarr"
MOST_VALUES = 1_000_000  # of a range
PACKED = {"zlib": True, "complevel": 1, "shuffle": True}  # in netCDF


@command("sweep")
@options.controller_option("--controller")
@option(
    "--axis grid",
    multiple=True,
    required=True,
    shell_complete=one_of(lambda: ["controller", *options.keys_of(Drive.TABLES)], end="="),
)
@options.param_option
@options.fitted_to_option
@options.until_option
@options.duty_option
@options.stop_option
@options.cycles_option
@option("--figures", options.read_list)
@options.workers_option
@options.scheduler_option
@options.at_option
@option("--chunk", options.count())
@option("--netcdf", type=click.Path(path_type=Path))
@options.of_drive(options.read_machine)
@answers(out=True)
def sweep_command(
    *, drive: Machine, controller: str | None, grid: tuple[str, ...], params: dict[str, str],
    fitted_to: Drive | None, netcdf: Path | None, **arguments: Any,
) -> Output:  # fmt: skip
    """Simulate a grid of drives and controllers of any size.

    DRIVE is a TOML file, also of a project, or the name of a shipped drive or chain (see: softstart drives);
    by default the crane drive of the literature. The results are a Zarr store that xarray opens.

    Options
    -------
    --controller NAME
        The controller, unless several are an axis: --axis controller=direct,ramp.
    --axis KEY=VALUES
        Axis of the grid: a parameter of the drive, shaft.gap=0.25:4:100 (from:to:count, with :log for
        geometric spacing), 1x:4x:7 (multiples of the drive's) or load.kind=active,reactive, or of the
        controller, controller.torque='10 N*m,20 N*m'. Of a chain shaft.gap is the sum of all gaps,
        shaft[2].gap or mass[crane].inertia one part. May be repeated.
    --param KEY=VALUE
        Set a parameter of the controller for all starts. May be repeated.
    --figures A,B,...
        Figures to save, for example k_dyn,start_time, of a duty also k_dyn_step_2 or damage; the status is
        always saved.
    --chunk N
        Largest number of starts that are computed and written at once.
    --netcdf FILE
        Also write the results as netCDF.
    --out DIR
        Write the results chunk by chunk into DIR/sweep.zarr, with figure, table and report.md; an
        interrupted command resumes. Without it only a summary is printed.
    """
    if controller is None and not any(text.partition("=")[0].strip() == "controller" for text in grid):
        raise InputError("controller = None: name one, or several as an axis, --axis controller=direct,ramp.")
    arguments["duty"] = options.typed_duty(drive)
    arguments = {name: value for name, value in arguments.items() if value is not None}
    begin, last = time.monotonic(), None

    def progress(now: SweepProgress) -> None:
        nonlocal last
        last = now
        show(str(now))

    code = options.code_allowed()
    with (
        kept_state(option_value("out"), RESULTS, "finished chunks") as to,
        options.named_as_options(to="--out"),
        working("starting the first drive ...") as show,
        attributed(),
    ):
        from softstart.controller.recipe import Recipe
        from softstart.sweeping.summary import summarise
        from softstart.views import sweeps as views

        if netcdf is not None:
            _check_netcdf(netcdf)
        axes = read_axes(grid, Recipe(controller or "", params, code), drive)
        results = softstart.sweep(
            drive, controller, axes, parameters=params, fitted_to=fitted_to, to=to, progress=progress,
            allow_code=code, **arguments,
        )  # fmt: skip
        show("summing up")
        summary = summarise(results)
        if netcdf is not None:
            part = netcdf.with_name(f"{netcdf.name}.part")  # no incomplete file under the final name
            try:
                results.to_netcdf(part, engine="h5netcdf", encoding=dict.fromkeys(results.data_vars, PACKED))
                part.replace(netcdf)
            finally:
                part.unlink(missing_ok=True)
    data = {
        "drive": drive.name,
        "fitted_to": fitted_to.name if fitted_to else None,
        "controller": controller,
        "duty": results.attrs.get("softstart_duty"),
        "axes": views.axis_summary(results),
        **summary.summary(),
        "cells": views.cells(results).to_dict("records") if summary.starts <= views.MOST_SHOWN else None,
        "seconds": time.monotonic() - begin,
        "computed": last.done - last.before if last else 0,
        "results": None if to is None else str(to),
    }
    if last and not option_value("as_json"):
        pace = views.pace(last)
        # after the answer, which `answers` prints
        click.get_current_context().call_on_close(lambda: print(pace))
    return lambda: data, views.sweep_sheet(results, summary, drive, fitted_to)


def _check_netcdf(path: Path) -> None:
    """Whether the file can be written, found before anything is computed."""
    if find_spec("h5netcdf") is None:
        raise InputError("netcdf: h5netcdf is missing; install it: pip install 'softstart[sweep]'.")
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        raise InputError(f"netcdf = {path}: the file cannot be written; choose another one.")


def read_axes(texts: Sequence[str], recipe: Recipe, machine: Machine) -> dict[str, Any]:
    """The grid of several --axis over a drive or chain.

    >>> from softstart.controller.recipe import Recipe
    >>> texts = ["shaft.gap=0.5:2:4", "load.inertia=700 kg*cm^2, 0.175"]
    >>> grid = read_axes(texts, Recipe("direct"), Drive.load("crane-4amtkf"))
    >>> grid["gap"], grid["load_inertia"]
    ([0.5, 1.0, 1.5, 2.0], [0.07, 0.175])
    """
    from softstart.sweeping.grid import Subject

    split = options.read_params(texts, "--axis", "shaft.gap=0.25:4:100 or load.inertia=0.07,0.175")
    names = values_in(split["controller"], "--axis controller", whole=True) if "controller" in split else []
    checked = tuple(options.check_name(name, "--axis controller") for name in names)
    subject, grid = Subject(machine, recipe, checked), dict[str, Any]()
    for key, values in split.items():
        try:
            name, read = _read(key, values, subject)
        except InputError as error:
            raise InputError(f"--axis {sentence}" for sentence in error.sentences) from None
        if name in grid:
            raise InputError(f"--axis {key}: this parameter is an axis already, by its other name.")
        grid[name] = read
    return grid


def _read(key: str, text: str, subject: Subject) -> tuple[str, Any]:
    """The name and the values of an axis."""

    def end(part: str) -> tuple[float, object]:
        read = subject.coordinate(key, [part])
        if read.dtype.kind == "U":
            raise InputError(f'{key} = "{text}": these values are names; write them with commas between.')
        return float(read.values[0]), (read.name, BEHIND.fullmatch(part) is not None)

    name = subject.name_of(key)
    if text.count(":") not in (2, 3) or name == "controller" or ".py" in text:
        knob = subject.machine.parameter_value(key)
        counts = name == "controller" or (knob and knob.parameter.limit.startswith("a whole"))
        read = subject.coordinate(key, values_in(text, key, whole=bool(counts)))
        return name, read.values.tolist()
    return name, [value for value, _ in options.read_value_list(text, key, end, MOST_VALUES)]
