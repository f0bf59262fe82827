"""One start, or many, under one controller: `simulate`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import TYPE_CHECKING, Any, overload

from softstart.chain.machines import MachineLike, load_machine
from softstart.controller.base import Controller
from softstart.controller.finding import make_controller
from softstart.drive.machine import Machine
from softstart.drive.records import Records
from softstart.errors import InputError
from softstart.start.batch import simulate_many
from softstart.start.engine import check_limits, ended, run_one
from softstart.start.kernel_input import MAX_EVENTS, KernelInput, kernel_input
from softstart.start.run import Run, worst_run
from softstart.start.trajectory import StartRecorder

if TYPE_CHECKING:
    import xarray

    from softstart.chain.periodic_torque import PeriodicTorque


@overload
def simulate(
    drive: MachineLike,
    controller: str | Controller | None,
    until: float | None = ...,
    *,
    parameters: Mapping[str, object] | None = ...,
    fitted_to: Any = ...,
    base: Any = ...,
    time_limit: float | None = ...,
    max_events: int = ...,
    excitation: Mapping[str | int, PeriodicTorque] | None = ...,
    workers: int | None = ...,
) -> Run: ...
@overload
def simulate(
    drive: Records | Sequence[Machine],
    controller: str | Controller | None,
    until: float | None = ...,
    *,
    parameters: Mapping[str, object] | None = ...,
    fitted_to: Any = ...,
    base: Any = ...,
    time_limit: float | None = ...,
    max_events: int = ...,
    excitation: Mapping[str | int, PeriodicTorque] | None = ...,
    workers: int | None = ...,
) -> xarray.Dataset: ...
def simulate(
    drive: Any,
    controller: str | Controller | None,
    until: float | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    fitted_to: Any = None,
    base: Any = None,
    time_limit: float | None = None,
    max_events: int = MAX_EVENTS,
    excitation: Mapping[str | int, PeriodicTorque] | None = None,
    workers: int | None = None,
) -> Any:
    """Simulate the start of a drive under a controller, exactly.

    Between two events a machine is linear: its Taylor series are summed to the last digit, and events are
    certified first roots of them. There is no step size and no output grid. A drive whose start position is
    unknown is started from both flanks and from mid-gap by the same controller, which is not told where;
    peaks, impacts and times are each the worst of the three (see `Run`). A shaft without a gap is a spring
    that pulls too; rigid gaps close by impacts, angular momentum kept; those that pile up are followed to
    their known end.

    Parameters
    ----------
    drive : Drive, Chain, Records, sequence of machines, str or path
        A drive, a chain, `records` of one, a list of drives or of chains (with the same number of masses,
        their motors and loads on the same ones), or the name or file of a drive or chain.
    controller : str, Controller or None
        A name, `path/to/file.py:ClassName`, or a Controller object; None leaves the motor off.
    until : float, optional
        End of the run, s. By default one elastic period 2 pi/Omega after the start time, the instant at
        which the load first has its target speed.
    parameters : mapping, optional
        Parameters of a controller given by name: SI numbers or strings with a unit.
    fitted_to : Drive or Chain, optional
        The machine from which the controller's own defaults are derived, if not `drive`: what happens to a
        controller set up for one drive when the gap has worn or the load changed. Of a chain it is the modal
        reduction to two masses, whatever its error; in a list of chains that takes longer than a start. For
        records also records of the same shape.
    base : Drive or Chain, optional
        The machine to whose mean torque K_dyn refers, if not `drive`; or records likewise.
    time_limit : float, optional
        Time after which a start that has not reached its target speed ends as not reached, s.
    max_events : int
        Largest number of events and of control instants of one start; more of them is an error, not a
        result.
    excitation : mapping, optional
        Periodic torques, N m, by the names (or indices) of the masses on which they act, each at the speed
        of its own shaft; of a single chain.
    workers : int, optional
        How many threads compute many starts. By default one for each processor.

    Returns
    -------
    Run or xarray.Dataset
        A Run for one machine. For many a Dataset with one entry for each start:
        dimension `start`, or `axis_0`, `axis_1`, ... for records of more than one dimension; a start that
        cannot be finished has a status of its own and NaN in every figure.

    Raises
    ------
    InputError
        For bad input; all its mistakes at once.
    SimulationError
        If the start of a single drive cannot be finished; with the reason, see `Status`.

    Examples
    --------
    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), "direct")
    >>> round(run.k_dyn, 4), round(run.start_time, 4)
    (3.1179, 0.3735)

    References
    ----------
    K_dyn: [G] (16); everything at one shaft: [R].
    """
    if isinstance(drive, str | os.PathLike):
        drive = load_machine(drive)
    made = None if controller is None else make_controller(controller, parameters)
    until, time_limit, max_events = check_limits(until, time_limit, max_events, "drive")
    for name, other in (("fitted_to", fitted_to), ("base", base)):
        _check_other(name, other, drive)
    if isinstance(drive, list | tuple) and not (drive and all(isinstance(one, Machine) for one in drive)):
        raise InputError("drive: give a list of Drives or of Chains, not empty.")
    if isinstance(drive, list | tuple | Records):
        if made is None:
            raise InputError("controller is missing: many starts need one.")
        if workers is not None and (
            isinstance(workers, bool) or not isinstance(workers, Integral) or workers < 1
        ):
            raise InputError(f"workers = {workers!r}: give a whole number of 1 or more, or leave it out.")
        return simulate_many(drive, made, until, fitted_to, base, time_limit, max_events, workers)
    if not isinstance(drive, Machine):
        raise InputError(
            "drive: give one Drive or Chain, records or a list of them, the path of a file, or a name."
        )
    positions = drive.positions
    given = {name: kernel_input(one, time_limit, max_events, excitation) for name, one in positions.items()}
    check_end(drive, made, until, next(iter(given.values())))
    ready, own = (None, None) if made is None else made.set_up((fitted_to or drive).design_drive)
    of = "no motor torque" if ready is None else ready.name or type(ready).__name__
    runs = {}
    for name, rows in given.items():
        recorder = StartRecorder(rows, 0 if ready is None else int(ready.sensors))
        reason = run_one(ready, own, recorder, until)
        status = ended(recorder.state, reason, until, max_events, f"{drive.name}, controller {of}")
        runs[name] = Run(positions[name], ready, base, status, recorder.finished(), own)
    return worst_run(runs, drive) if len(runs) > 1 else next(iter(runs.values()))


def _check_other(name: str, other: object, drive: object) -> None:
    """A machine given beside the simulated one: a single one, or one for each of several starts."""
    if isinstance(other, Records):
        own = drive.shape if isinstance(drive, Records) else ()
        if other.shape != own:
            raise InputError(
                f"{name}: records of shape {other.shape} do not go with starts of shape {own}; give a single "
                "machine, or records of the same shape."
            )
    elif other is not None and not isinstance(other, Machine):
        raise InputError(f"{name} = {other!r}: give a Drive or a Chain; Drive.load reads one from a file.")


def check_end(machine: Any, controller: object, until: float | None, rows: KernelInput) -> None:
    """A run needs an end, and a controller a motor."""
    if controller is not None and machine.motor is None:
        raise InputError(
            "[motor] is missing: a controller needs one; add it to the chain, or give None as the controller."
        )
    if until is not None or rows.machine["time_limit"] < float("inf"):
        return
    if controller is None or machine.target_speed is None:
        raise InputError(
            "until is missing: without motor and target speed nothing else ends the run; give it in s."
        )
    arrays = machine.at_motor_shaft()
    load = float((arrays.Mc / arrays.efficiency_from_motor).sum())
    lossy = " and through its gears" if (arrays.efficiency < 1.0).any() else ""
    curves = ", nor do load curves over speed drive it" if rows.curves.size else ""
    raise InputError(
        f"starting_torque: it is not above the load torques, {load:.6g} N*m at the motor "
        f"shaft{lossy}{curves}, so the load may never reach its target speed; give until or time_limit."
    )
