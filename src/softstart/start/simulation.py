"""One start, or many, under one controller: `simulate`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, cast, overload, runtime_checkable

from softstart.controller.base import Controller
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.plant.vector import plant_vector
from softstart.start.batch import simulate_many
from softstart.start.engine import MAX_EVENTS, Recorder, check_limits, ended, run_one
from softstart.start.run import Run, worst_run

if TYPE_CHECKING:
    import xarray

# above this module; see softstart.late
models, batches = late("softstart.chain.model"), late("softstart.chain.batch")


@runtime_checkable
class Startable(Protocol):
    """A machine other than a drive that `simulate` and `compare` start: `softstart.chain.Chain`."""

    @property
    def name(self) -> str: ...
    @property
    def positions(self) -> Mapping[str, Any]: ...
    def start(self, controller: str | Controller, until: float | None = ..., **options: Any) -> Any:
        """The start under a controller, with the options of `simulate`."""

    def changed(self, gaps: float = ..., load_inertia: float = ...) -> Any:
        """The machine with so many times its gaps, and its load inertia."""


@overload
def simulate(
    drive: Drive | str,
    controller: str | Controller,
    until: float | None = ...,
    *,
    parameters: Mapping[str, object] | None = ...,
    fitted_to: Drive | None = ...,
    base: Drive | None = ...,
    time_limit: float | None = ...,
    max_events: int = ...,
) -> Run: ...
@overload
def simulate(
    drive: Sequence[Drive],
    controller: str | Controller,
    until: float | None = ...,
    *,
    parameters: Mapping[str, object] | None = ...,
    fitted_to: Drive | None = ...,
    base: Drive | None = ...,
    time_limit: float | None = ...,
    max_events: int = ...,
) -> xarray.Dataset: ...
@overload
def simulate(
    drive: Startable,
    controller: str | Controller,
    until: float | None = ...,
    *,
    parameters: Mapping[str, object] | None = ...,
    fitted_to: Any = ...,
    base: Any = ...,
    time_limit: float | None = ...,
    max_events: int = ...,
) -> Any: ...
def simulate(
    drive: Drive | str | Sequence[Drive] | Startable,
    controller: str | Controller,
    until: float | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    fitted_to: Any = None,
    base: Any = None,
    time_limit: float | None = None,
    max_events: int = MAX_EVENTS,
) -> Any:
    """Simulate the start of a drive under a controller, exactly.

    Between two events the motion is a closed form; events are located to machine precision. There is no
    step size and no output grid. A drive whose start position is unknown is started from both flanks and from
    mid-gap by the same controller, which is not told where; every figure is the worst of the three.

    Parameters
    ----------
    drive : Drive, Chain, sequence of them or str
        A drive, one whose fields hold arrays, a list of drives, a chain (see `simulate_chain`), a list of
        chains (see `simulate_chains`), or the name or file of a drive or chain.
    controller : str or Controller
        A name, `path/to/file.py:ClassName`, or a Controller object.
    until : float, optional
        End of the run, s. By default one elastic period 2 pi/Omega after the start time, the instant at
        which the load first has its target speed.
    parameters : mapping, optional
        Parameters of a controller given by name: SI numbers or strings with a unit.
    fitted_to : Drive, optional
        The drive from which the controller's own defaults are derived, if not `drive`: what happens to a
        controller set up for one drive when the gap has worn or the load changed.
    base : Drive, optional
        The drive to whose mean torque K_dyn refers, if not `drive`.
    time_limit : float, optional
        Time after which a start that has not reached its target speed ends as not reached, s.
    max_events : int
        Largest number of events and of control instants of one start; more of them is an error, not a
        result.

    Returns
    -------
    Run, ChainRun or xarray.Dataset
        A Run for one drive, a ChainRun for a chain. For many a Dataset with one entry for each start:
        dimension `start`, or `axis_0`, `axis_1`, ... for fields of more than one dimension; a start that
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
    [G] (1) to (18); the closed forms, and why no event is missed: docs/theory/stages.md; accuracy:
    docs/theory/numerics.md.
    """
    if isinstance(drive, str):
        drive = cast("Drive | Startable", models.load_machine(drive))
    if not isinstance(drive, Drive) and isinstance(drive, Startable):  # the protocol is slow to look for
        return drive.start(
            controller, until, parameters=parameters, fitted_to=fitted_to, base=base, time_limit=time_limit,
            max_events=max_events,
        )  # fmt: skip
    if isinstance(drive, Sequence) and drive and isinstance(drive[0], Startable):
        return batches.simulate_chains(
            drive, controller, until, fitted_to=fitted_to, parameters=parameters, base=base,
            time_limit=time_limit, max_events=max_events,
        )  # fmt: skip
    made = make_controller(controller, parameters)
    until, time_limit, max_events = check_limits(until, time_limit, max_events, "drive")
    for name, other in (("fitted_to", fitted_to), ("base", base)):
        _check_other(name, other, drive)
    if not isinstance(drive, Drive) or drive.shape != ():
        return simulate_many(drive, made, until, fitted_to, base, time_limit, max_events)
    positions = drive.positions
    if len(positions) > 1:
        told, counted = fitted_to or drive.design_drive, base or drive
        return worst_run(
            {
                name: simulate(
                    one,
                    made,
                    until,
                    fitted_to=told,
                    base=counted,
                    time_limit=time_limit,
                    max_events=max_events,
                )
                for name, one in positions.items()
            },
            drive=drive,
        )
    fitted, own = made.set_up(fitted_to or drive)
    p = plant_vector(drive, time_limit, max_events)[0]
    recorder = Recorder(p, int(fitted.sensors))
    reason = run_one(fitted, own, recorder, until)
    name = fitted.name or type(fitted).__name__
    status = ended(recorder.x, reason, until, max_events, f"Drive {drive.name}, controller {name}")
    return Run(drive, fitted, base or drive, status, p, recorder.x.copy(), *recorder.rows(), told=own)


def _check_other(name: str, other: object, drive: object) -> None:
    """A drive given beside the simulated one: a single one, or one for each start of a batch."""
    if other is None:
        return
    if not isinstance(other, Drive):
        raise InputError(f"{name} = {other!r}: give a Drive; Drive.load reads one from a file or by name.")
    own = drive.shape if isinstance(drive, Drive) else ()
    if other.shape not in {(), own}:
        raise InputError(
            f"{name}: a Drive with fields of shape {other.shape} does not go with starts of shape {own}; "
            "give a single drive or one of the same shape."
        )
