"""Starts of whole chains: `simulate_chain` under a controller, `verify_on_chain` beside the reduced drive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from softstart.balancing.periodic_torque import PeriodicTorque
from softstart.chain.kernel_records import Numbers, numbers
from softstart.chain.model import Chain
from softstart.chain.reduction import reduce_chain
from softstart.chain.run import ChainRecorder, ChainRun
from softstart.controller.base import Controller
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.plant import layout
from softstart.start import metrics
from softstart.start.engine import MAX_EVENTS, check_limits, ended, run_one
from softstart.start.run import Run, worst_run
from softstart.start.simulation import simulate


def simulate_chain(
    chain: Chain | str,
    controller: str | Controller | None,
    until: float | None = None,
    *,
    fitted_to: Drive | Chain | None = None,
    parameters: Mapping[str, object] | None = None,
    base: Drive | Chain | None = None,
    time_limit: float | None = None,
    max_events: int = MAX_EVENTS,
    excitation: Mapping[str | int, PeriodicTorque] | None = None,
) -> ChainRun:
    """Simulate the start of a chain under a controller, exactly.

    Between two events the chain is linear: its Taylor series are summed to the last digit, and events are
    certified first roots of them. A shaft without a gap is a spring that pulls too. A gear with losses passes
    on its share of the torque in the direction of the power, and holds its mass at rest in between
    (`softstart.chain.kernel_series`). Rigid gaps close by impacts, angular momentum kept; those that pile up
    are followed to their known end, when the flanks press.

    Parameters
    ----------
    chain : Chain or str
        A chain, or the name or file of one.
    controller : str, Controller or None
        A name, `path/to/file.py:ClassName`, or a Controller object; None leaves the motor off.
    until : float, optional
        End of the run, s; by default one elastic period after the load mass has its target speed.
    fitted_to : Drive or Chain, optional
        The drive from which the controller's own defaults are derived: by default, and of a chain, the modal
        reduction to two masses, whatever its error.
    parameters : mapping, optional
        Parameters of a controller given by name: SI numbers or strings with a unit.
    base : Drive or Chain, optional
        The drive to whose mean torque K_dyn refers, if not `fitted_to`; without both it refers to the mean
        torque of the chain itself (`Chain.mean_torque`).
    time_limit : float, optional
        Time after which a start that has not reached its target speed ends as not reached, s.
    max_events : int
        Largest number of events and of control instants; more of them is an error, not a result.
    excitation : mapping, optional
        Periodic torques, N m, by the names (or indices) of the masses on which they act, each at the speed
        of its own shaft.

    Returns
    -------
    ChainRun
        Traces, events, peaks and energy: angles, speeds and torques in SI at the motor shaft.

    Raises
    ------
    InputError
        For bad input, and where nothing would end the run.
    SimulationError
        If the start cannot be finished; with the reason, see `Status`.

    Examples
    --------
    >>> run = simulate_chain("crane-4-mass", "direct")
    >>> round(run.k_dyn, 2), round(run.start_time, 4)
    (6.3, 0.3708)

    References
    ----------
    Everything at one shaft: [R], docs/theory/reduction.md; K_dyn: [G] (16); the Taylor series and the
    location of events: docs/theory/numerics.md.
    """
    if isinstance(chain, str):
        chain = Chain.load(chain)
    until, time_limit, max_events = check_limits(until, time_limit, max_events, "chain")
    for name, other in (("fitted_to", fitted_to), ("base", base)):
        if isinstance(other, Chain) or other is None:
            continue
        if not (isinstance(other, Drive) and other.shape == ()):
            raise InputError(f"{name} = {other!r}: give a single Drive, or a Chain.")
    made = None if controller is None else make_controller(controller, parameters)
    if len(chain.positions) > 1:
        check_end(chain, made, until, numbers(chain, excitation, time_limit, max_events))
        told = fitted_to or (None if made is None else chain)
        return worst_run(
            {
                name: simulate_chain(
                    one, made, until, fitted_to=told, base=base or fitted_to or chain,
                    time_limit=time_limit, max_events=max_events, excitation=excitation,
                )
                for name, one in chain.positions.items()
            },
            chain=chain,
        )  # fmt: skip
    given = numbers(chain, excitation, time_limit, max_events)
    check_end(chain, controller, until, given)
    fitted, own = None, None
    if made is None:
        recorder = ChainRecorder(given, 0)
        recorder.begin(math.inf if until is None else until)
        recorder.x[layout.ASK_AT] = math.inf
        while (reason := recorder.advance()) == layout.BUFFER_FULL:
            recorder.grow()
    else:
        nominal = fitted_to or chain
        fitted, own = made.set_up(nominal if isinstance(nominal, Drive) else drive_of(nominal))
        recorder = ChainRecorder(given, int(fitted.sensors))
        reason = run_one(fitted, own, recorder, until)
    status = ended(recorder.x, reason, until, max_events, f"Chain {chain.name}")
    return ChainRun(chain, fitted, base or fitted_to, status, given, recorder.finished(), own)


def drive_of(chain: Chain) -> Drive:
    """The two-mass drive for which a controller is set up where none is named: the modal reduction."""
    try:
        return reduce_chain(chain, 2, method="modal", force=True).to_drive().assumed
    except InputError as error:
        sentences = [*error.sentences, "Name the drive for which the controller is set up (fitted_to)."]
        raise InputError(sentences) from None


def check_end(chain: Chain, controller: object, until: float | None, given: Numbers) -> None:
    """A run needs an end."""
    if controller is not None and chain.motor is None:
        raise InputError(
            "[motor] is missing: a controller needs one; add it to the chain, or give None as the controller."
        )
    if until is not None or given.p[layout.TIME_LIMIT] < math.inf:
        return
    if controller is None or chain.target_speed is None:
        raise InputError(
            "until is missing: without motor and target speed nothing else ends the run; give it in s."
        )
    arrays = chain.at_motor_shaft()
    load = float((arrays.Mc / arrays.efficiency_from_motor).sum())
    lossy = " and through its gears" if (arrays.efficiency < 1.0).any() else ""
    raise InputError(
        f"starting_torque: it is not above the load torques, {load:.6g} N*m at the motor "
        f"shaft{lossy}, so the load may never reach its target speed; give until or time_limit."
    )


@dataclass(frozen=True, eq=False)
class Verification:
    """A controller set up for the drive, on drive and chain; K_dyn over the drive's mean torque."""

    drive: Run
    chain: ChainRun

    @property
    def name(self) -> str:
        """Name of the controller."""
        return self.drive.controller_name

    @property
    def worst_shaft(self) -> int:
        """The index of the shaft between motor and load with the largest torque at the motor shaft."""
        return max(self.chain.chain.at_motor_shaft().path, key=lambda k: self.chain.peak_torques[k])

    @property
    def worst_place(self) -> str:
        """Between which masses it is."""
        return self.chain.chain.shaft_names[self.worst_shaft]

    @property
    def worst_k_dyn(self) -> float:
        """Its largest torque over the mean torque of the drive."""
        return float(metrics.k_dyn(float(self.chain.peak_torques[self.worst_shaft]), self.drive.drive))

    @property
    def chain_k_dyn(self) -> float:
        """K_dyn of the chain's shaft beside the motor."""
        return float(self.chain.k_dyns[self.chain.motor_shaft])

    @property
    def error(self) -> float:
        """How far the K_dyn of the drive is from that of the chain's shaft beside the motor, as a share."""
        return self.drive.k_dyn / self.chain_k_dyn - 1.0

    def summary(self) -> dict[str, Any]:
        """Both side by side, as plain data."""
        return {
            "controller": self.name,
            "k_dyn": self.drive.k_dyn,
            "peak_torque": self.drive.peak_torque,
            "start_time": self.drive.start_time,
            "chain_k_dyn": self.chain_k_dyn,
            "chain_peak_torque": float(self.chain.peak_torques[self.chain.motor_shaft]),
            "chain_start_time": self.chain.start_time,
            "k_dyn_error": self.error,
            "worst_k_dyn": self.worst_k_dyn,
            "worst_shaft": self.worst_place,
            "gear_losses": self.chain.energy.gears,
            "chain": self.chain.summary(),
        }


def verify_on_chain(
    chain: Chain | str,
    drive: Drive,
    controller: str | Controller,
    until: float | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Verification:
    """Run a controller that is set up for `drive` on that drive and on the chain it represents.

    Parameters
    ----------
    chain : Chain or str
        The whole chain, or the name or file of one.
    drive : Drive
        The two-mass drive to which it is reduced, a single one.
    controller : str or Controller
        A name, `path/to/file.py:ClassName`, or a Controller object.
    until : float, optional
        End of both runs, s; by default each ends one elastic period after its own start time.
    parameters : mapping, optional
        Parameters of a controller given by name: SI numbers or strings with a unit.

    Returns
    -------
    Verification
        Both runs, and the shaft between motor and load with the largest torque. K_dyn of both refers to
        the mean torque of `drive`.

    Raises
    ------
    InputError
        For bad input, as a batch of drives or a chain without a motor.
    SimulationError
        If one of the two starts cannot be finished.

    Examples
    --------
    >>> from softstart.chain import Chain, reduce_chain
    >>> chain = Chain.load("crane-4-mass")
    >>> found = verify_on_chain(chain, reduce_chain(chain, to=2).to_drive(), "s-curve")
    >>> found.worst_place, found.chain.k_dyn > found.drive.k_dyn
    ('rotor - pinion', True)

    References
    ----------
    What a reduction keeps: [R], docs/theory/reduction.md; how to use it: docs/howto/reduce-a-driveline.md.
    """
    if drive.shape != ():
        raise InputError(f"{drive.name}: a batch of shape {drive.shape}; give a single drive.")
    made = make_controller(controller, parameters)
    whole = simulate_chain(chain, made, until, fitted_to=drive, base=drive)
    return Verification(simulate(drive, made, until), whole)
