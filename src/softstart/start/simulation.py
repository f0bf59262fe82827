"""One start, or many, under one controller: `simulate`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypedDict, Unpack, overload

from softstart.chain.machines import MachineLike, as_machine
from softstart.chain.model import Chain
from softstart.controller.base import Controller, label_of, period_of
from softstart.drive.machine import Machine
from softstart.drive.machine_table import MachineTable
from softstart.errors import InputError
from softstart.quantities import number_in, show
from softstart.start.batch import Machines, simulate_many
from softstart.start.demand import ControllerLike, as_controller
from softstart.start.engine import check_limits, ended, run_one
from softstart.start.kernel_input import MAX_EVENTS, KernelInput, kernel_input
from softstart.start.metrics import REFERENCE
from softstart.start.run import Run, worst_run
from softstart.start.trajectory import StartRecorder

if TYPE_CHECKING:
    import xarray

    from softstart.chain.periodic_torque import PeriodicTorque

DEFAULT_DRIVE = "crane-4amtkf"
FIELD_WEAKENING = 2.0  # times the rated speed: the largest set speed
Time = float | str | None  # s, or with a unit
DriveCommand = tuple[float | str, int, float | str]  # time, run, set speed


class SimulateOptions(TypedDict, total=False):
    """The keyword arguments of `simulate`, described there."""

    parameters: Mapping[str, object] | None
    fitted_to: MachineLike | MachineTable | None
    base: MachineLike | MachineTable | None
    time_limit: Time
    max_events: int
    excitation: Mapping[str | int, PeriodicTorque] | None
    commands: Sequence[DriveCommand]
    workers: int | None


@overload
def simulate(
    drive: Machines, controller: ControllerLike, until: Time = None, **options: Unpack[SimulateOptions]
) -> xarray.Dataset: ...


@overload
def simulate(
    drive: MachineLike = DEFAULT_DRIVE, controller: ControllerLike | None = REFERENCE, until: Time = None,
    **options: Unpack[SimulateOptions],
) -> Run: ...  # fmt: skip


def simulate(
    drive: MachineLike | Machines = DEFAULT_DRIVE,
    controller: ControllerLike | None = REFERENCE,
    until: Time = None,
    *,
    parameters: Mapping[str, object] | None = None,
    fitted_to: MachineLike | MachineTable | None = None,
    base: MachineLike | MachineTable | None = None,
    time_limit: Time = None,
    max_events: int = MAX_EVENTS,
    excitation: Mapping[str | int, PeriodicTorque] | None = None,
    commands: Sequence[DriveCommand] = (),
    workers: int | None = None,
) -> Run | xarray.Dataset:
    """Simulate the start of a drive under a controller, exactly.

    Between two events a machine is linear: its Taylor series are summed to the last digit, and events are
    certified first roots of them. There is no step size and no output grid. A drive whose start position is
    unknown is started from both flanks and from mid-gap by the same controller, which is not told where;
    peaks, impacts and times are each the worst of the three (see `Run`). A shaft without a gap is a spring
    that pulls too; rigid gaps close by impacts, angular momentum kept; those that pile up are followed to
    their known end.

    Parameters
    ----------
    drive : Drive, Chain, MachineTable, sequence of machines, str or path, optional
        A drive, a chain, a table of one (`machine_table`), a list of drives or of chains (with the same
        number of masses, their motors and loads on the same ones), or the name or file of a drive or chain.
        By default the crane travel drive of [G].
    controller : str, Controller, subclass of it, TorqueProfile, pair of arrays, function or None
        A name, `path/to/file.py:ClassName`, a file of tuned gains, a class, or a Controller object; a torque
        over time as a TorqueProfile, as two arrays (t in s, u in N m), or as a function t -> u, which is
        sampled every 1 ms; None leaves the motor off. By default `direct`.
    until : float or str, optional
        End of the run, s or with a unit ("300 ms"). By default one elastic period 2 pi/Omega after the start
        time, the instant at which the load first has its target speed.
    parameters : mapping, optional
        Parameters of a controller given by name: SI numbers or strings with a unit.
    fitted_to : Drive or Chain, optional
        The machine from which the controller's own defaults are derived, if not `drive`: what happens to a
        controller set up for one drive when the gap has worn or the load changed. Of a chain it is the modal
        reduction to two masses, whatever its error; in a list of chains that takes longer than a start. For
        records also records of the same shape.
    base : Drive or Chain, optional
        The machine to whose mean torque K_dyn refers, if not `drive`; or records likewise.
    time_limit : float or str, optional
        Time after which a start that has not reached its target speed ends as not reached, s or with a unit.
    max_events : int
        Largest number of events and of control instants of one start; more of them is an error, not a
        result.
    excitation : mapping, optional
        Periodic torques, N m, by the names (or indices) of the masses on which they act, each at the speed
        of its own shaft; of a single chain.
    commands : sequence of (time, run, set_speed), optional
        Changes of what the drive is commanded, which the controller sees at its next sample: time in s, run 1
        or 0 (stop), set speed in rad/s. Before the first one it is (0, 1, target speed). Of a single machine,
        with `until`; a strategy that cannot stop or reverse refuses such a command.
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
    >>> ramp = simulate("crane-4amtkf", ([0.0, 0.1], [0.0, 62.0]), until="0.6 s")
    >>> round(ramp.k_dyn, 4), ramp.status.success
    (2.1647, True)

    References
    ----------
    K_dyn: [G] (16); everything at one shaft: [R].
    """
    several = (list, tuple, MachineTable)
    machine: Machine | Machines = drive if isinstance(drive, several) else as_machine(drive)
    strategy = None if controller is None else as_controller(controller, parameters)
    until, time_limit, max_events = check_limits(until, time_limit, max_events, "drive")
    fitted, reference = _beside("fitted_to", fitted_to, machine), _beside("base", base, machine)
    if excitation and not isinstance(machine, Chain):
        raise InputError("excitation: it acts on the masses of one chain; start several one at a time.")
    if commands and not isinstance(machine, Machine):
        raise InputError("commands: they are of one machine; start several one at a time.")
    if not isinstance(machine, Machine):
        listed = machine.parts if isinstance(machine, MachineTable) else machine
        if not (listed and all(isinstance(each, Machine) for each in listed)):
            raise InputError("drive: give a list of Drives or of Chains, not empty.")
        if strategy is None:
            raise InputError("controller is missing: many starts need one.")
        return simulate_many(machine, strategy, until, fitted, reference, time_limit, max_events, workers)
    assert not isinstance(fitted, MachineTable)
    assert not isinstance(reference, MachineTable)
    positions = machine.positions
    inputs = {name: kernel_input(at, time_limit, max_events, excitation) for name, at in positions.items()}
    check_end(machine, strategy, until, next(iter(inputs.values())))
    ready, design = (None, None) if strategy is None else strategy.set_up((fitted or machine).design_drive)
    start = f"{machine.name}, controller {'no motor torque' if ready is None else label_of(ready)}"
    runs = {}
    changes = check_commands(commands, strategy, machine, until)
    regulation = None if ready is None or design is None else ready.regulation(design)
    for name, machine_input in inputs.items():
        if regulation is not None:
            machine_input = machine_input.regulated([regulation], time_limit is not None)  # noqa: PLW2901
        machine_input = machine_input.guarded(0.0 if ready is None else period_of(ready))  # noqa: PLW2901
        recorder = StartRecorder(machine_input, 0 if ready is None else int(ready.sensors))
        reason = run_one(ready, design, recorder, until, changes)
        status = ended(recorder.state, reason, until, max_events, start)
        runs[name] = Run(positions[name], ready, reference, status, recorder.finished(), design)
    return worst_run(runs, machine) if len(runs) > 1 else next(iter(runs.values()))


def _beside(name: str, other: object, machines: object) -> Machine | MachineTable | None:
    """A machine given beside the simulated ones: a single one, or for a table of them another table."""
    if other is None:
        return None
    if isinstance(other, MachineTable):
        shape = machines.shape if isinstance(machines, MachineTable) else ()
        if other.shape != shape or not isinstance(machines, MachineTable):
            raise InputError(
                f"{name}: a table of shape {other.shape} does not match starts of shape {shape}; give a "
                "single machine, or a table of the same shape."
            )
        return other
    return as_machine(other, name)


def check_commands(
    commands: Sequence[DriveCommand], controller: Controller | None, machine: Machine, until: float | None
) -> list[DriveCommand]:
    """The changes of command, in SI; InputError for those that the controller cannot follow."""
    if not commands:
        return []
    if controller is None or until is None:
        missing = "controller" if controller is None else "until"
        raise InputError(
            f"commands: {missing} is missing; commands change what a controller follows until then."
        )
    name, last, changes = label_of(controller), 0.0, list[DriveCommand]()
    speeds = (machine.target_speed, getattr(machine.motor, "rated_speed", None))
    known = [speed for speed in speeds if speed is not None]
    for time, run, set_speed in commands:
        where = f"commands: ({show(time)}, {show(run)}, {show(set_speed)})"
        at, speed = number_in("s", time, "commands"), number_in("rad/s", set_speed, "commands")
        if not last < at < until:
            raise InputError(f"{where}: times rise from 0 to the end of the run at {until:g} s.")
        if run not in (0, 1):
            raise InputError(f"{where}: run is 1, or 0 to stop.")
        reverses = run == 1 and speed * (machine.target_speed or 1.0) < 0.0
        if (run == 0 and not controller.can_stop) or (reverses and not controller.can_reverse):
            verb = "reverse" if reverses else "stop"
            raise InputError(f"{where}: {name} cannot {verb} the drive; use one that can, as speed-ramp.")
        if known and abs(speed) > FIELD_WEAKENING * max(known):
            raise InputError(
                f"{where}: the set speed is above {FIELD_WEAKENING:g} times the rated or target speed, "
                f"{max(known):.4g} rad/s; in field weakening the motor lacks the torque assumed here."
            )
        changes.append((at, int(run), speed))
        last = at
    return changes


def check_end(machine: Machine, controller: object, until: float | None, start: KernelInput) -> None:
    """A run needs an end, and a controller a motor."""
    if controller is not None and machine.motor is None:
        raise InputError(
            "[motor] is missing: a controller needs one; add it to the chain, or give None as the controller."
        )
    if until is not None or start.machine.time_limit < float("inf"):
        return
    if controller is None or machine.target_speed is None:
        raise InputError(
            "until is missing: without motor and target speed nothing else ends the run; give it in s."
        )
    assert isinstance(machine, Chain)  # a drive whose load holds its motor cannot be made
    arrays = machine.at_motor_shaft()
    load = float((arrays.Mc / arrays.efficiency_from_motor).sum())
    lossy = " and through its gears" if (arrays.efficiency < 1.0).any() else ""
    curves = ", nor do load curves over speed drive it" if start.curves.size else ""
    raise InputError(
        f"starting_torque: it is not above the load torques, {load:.6g} N*m at the motor "
        f"shaft{lossy}{curves}, so the load may never reach its target speed; give until or time_limit."
    )
