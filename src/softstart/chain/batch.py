"""Many starts of chains in one call, on several cores: the same bits as one start at a time."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.chain import kernel_start as kernel
from softstart.chain.kernel_records import SHAFT, Numbers, numbers
from softstart.chain.model import Chain
from softstart.chain.run import ChainRecorder, mean_torque_of
from softstart.chain.simulation import check_end, drive_of
from softstart.controller.base import CompiledController, Controller, Sensor
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.plant import layout
from softstart.plant.start import N_MEASURED, NEW_STATE
from softstart.processes import Pool
from softstart.start.batch import figures
from softstart.start.engine import MAX_EVENTS, check_limits, run_one, watched

if TYPE_CHECKING:
    import xarray
else:
    xarray = late("xarray")

TURN = 32  # starts that a thread computes at a time
# of the figures of a drive's starts those that starts of chains have
FIGURES = (
    "k_dyn",
    "peak_torque",
    "peak_time",
    "start_time",
    "end_time",
    "torque_excess",
    "torque_excess_time",
    "status",
)


def simulate_chains(
    chains: Sequence[Chain],
    controller: str | Controller,
    until: float | None = None,
    *,
    fitted_to: Drive | Chain | None = None,
    parameters: Mapping[str, object] | None = None,
    base: Drive | Chain | None = None,
    time_limit: float | None = None,
    max_events: int = MAX_EVENTS,
    workers: int | None = None,
) -> xarray.Dataset:
    """Simulate the starts of many chains under a controller: in compiled code, without traces.

    Parameters
    ----------
    chains : sequence of Chain
        Chains with the same number of masses, their motors and loads on the same ones.
    controller : str or Controller
        A name, `path/to/file.py:ClassName`, or a Controller object.
    until : float, optional
        End of each run, s; by default one elastic period after its start time.
    fitted_to : Drive or Chain, optional
        The drive for which the controller is set up in all starts; by default the modal reduction of each
        chain. That takes longer than a start: give it where speed counts.
    parameters : mapping, optional
        Parameters of a controller given by name: SI numbers or strings with a unit.
    base : Drive or Chain, optional
        To whose mean torque K_dyn refers, if not `fitted_to`; without both that of each chain.
    time_limit : float, optional
        Time after which a start that has not reached its target speed ends as not reached, s.
    max_events : int
        Largest number of events and of control instants of one start.
    workers : int, optional
        How many threads compute. By default one for each processor.

    Returns
    -------
    xarray.Dataset
        Dimension `start`, and `shaft` for `k_dyns` and `peak_torques`, N m at the motor shaft. A start that
        cannot be finished has a status of its own and NaN in every figure. Of an unknown position every
        figure is the worst.

    Raises
    ------
    InputError
        For bad input, and for chains that do not match.

    Examples
    --------
    >>> from softstart.chain import Chain, simulate_chains
    >>> crane = Chain.load("crane-4-mass")
    >>> found = simulate_chains([crane, crane.changed(gaps=2.0)], "direct", fitted_to=crane)
    >>> round(float(found.k_dyn[0]), 2), found.k_dyn.size
    (6.3, 2)

    References
    ----------
    docs/theory/numerics.md.
    """
    until, time_limit, max_events = check_limits(until, time_limit, max_events, "chain")
    listed = list(chains) if isinstance(chains, Sequence) and not isinstance(chains, str) else []
    if not listed or not all(isinstance(chain, Chain) for chain in listed):
        raise InputError("chains: give a list of Chains, not empty.")
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise InputError(f"workers = {workers!r}: give a whole number of 1 or more, or leave it out.")
    made = make_controller(controller, parameters)
    owners = [i for i, chain in enumerate(listed) for _ in chain.positions]
    given = [
        numbers(one, None, time_limit, max_events) for chain in listed for one in chain.positions.values()
    ]
    if len({(one.count, one.place) for one in given}) > 1:
        raise InputError(
            "chains: starts in one call have the same number of masses, and motors and loads on the same "
            "ones; sort the chains by that."
        )
    for i, one in zip(owners, given, strict=True):
        check_end(listed[i], made, until, one)
    results = np.empty((len(given), layout.N_X))
    ends = np.zeros((len(given), given[0].count - 1), SHAFT)
    nominal = fitted_to if fitted_to is None or isinstance(fitted_to, Drive) else drive_of(fitted_to)
    _compute(made, listed, owners, given, nominal, until, results, ends, workers or os.cpu_count() or 1)
    return _labelled(listed, owners, results, ends, base or fitted_to, until)


def _compute(
    made: Controller,
    listed: Sequence[Chain],
    owners: Sequence[int],
    given: Sequence[Numbers],
    nominal: Drive | None,
    until: float | None,
    results: layout.Matrix,
    ends: Any,
    workers: int,
) -> None:
    """Fill `results` and `ends`; plain controllers one start at a time."""
    end = math.inf if until is None else until
    set_up = [made.set_up(nominal)] if nominal is not None else [made.set_up(drive_of(one)) for one in listed]
    ready, own = set_up[0]
    if not isinstance(ready, CompiledController):
        for row, (i, one) in enumerate(zip(owners, given, strict=True)):
            ready, own = set_up[i if len(set_up) > 1 else 0]
            recorder = ChainRecorder(one, int(ready.sensors), rows=0)
            recorder.x[layout.STATUS] = run_one(ready, own, recorder, end)
            results[row], ends[row] = recorder.x, recorder.start.shafts
        return
    chosen = set_up if len(set_up) == 1 else [set_up[i] for i in owners]
    vectors = [np.asarray(_vector(one, drive), dtype=np.float64).ravel() for one, drive in chosen]
    parameters = np.ascontiguousarray(np.stack(vectors))
    p = np.stack([one.p for one in given])
    masses, shafts = np.stack([one.masses for one in given]), np.stack([one.shafts for one in given])
    step, sees = type(ready).kernel, int(ready.sensors)

    def run(part: slice) -> None:
        numbers_of = parameters[part] if len(chosen) > 1 else parameters
        scratch = given[0].start()._replace(p=np.zeros(layout.N_P))  # each thread writes into its own
        with watched(ready):
            kernel.run_many(
                step, p[part], masses[part], shafts[part], numbers_of, sees,
                bool(ready.sensors & Sensor.STAGE), end, results[part], ends[part], scratch,
                np.zeros(N_MEASURED), np.zeros(ready.state_size), np.zeros(NEW_STATE + ready.state_size),
            )  # fmt: skip

    with Pool(min(workers, len(given)), threads=True) as pool:
        for _ in pool.results(run, (slice(i, i + TURN) for i in range(0, len(given), TURN))):
            pass


def _vector(ready: Controller, own: Drive) -> layout.Vector:
    """The numbers of a compiled controller for its drive."""
    assert isinstance(ready, CompiledController)
    return ready.vector(own)


def _labelled(
    listed: Sequence[Chain],
    owners: Sequence[int],
    results: layout.Matrix,
    ends: Any,
    base: Drive | Chain | None,
    until: float | None,
) -> xarray.Dataset:
    """The figures of each chain, of its positions the worst."""
    peaks, at = np.abs(ends["peak"]), np.arange(len(owners))
    worst = peaks.argmax(axis=1)
    results[:, layout.PEAK], results[:, layout.PEAK_TIME] = peaks[at, worst], ends["peak_time"][at, worst]
    means = np.array([mean_torque_of(base or chain) for chain in listed])
    found = figures(results, means[list(owners)], until)
    good = ~np.isnan(found["k_dyn"][0])
    rows = [np.flatnonzero(np.array(owners) == i) for i in range(len(listed))]
    # of several positions that with the largest torque, or one whose start could not be finished
    chosen = np.array([row[np.where(good[row], peaks[row].max(axis=1), np.inf).argmax()] for row in rows])
    data: dict[str, Any] = {}
    for name in FIGURES:
        values, unit, meaning = found[name]
        picked = values[chosen]
        if name in ("start_time", "torque_excess", "torque_excess_time"):
            picked = np.array([values[row].max() for row in rows])
        data[name] = ("start", picked, {"units": unit, "long_name": meaning})
    peaks[~good] = math.nan
    largest = np.stack([peaks[row].max(axis=0) for row in rows])
    data["peak_torques"] = (
        ("start", "shaft"),
        largest,
        {"units": "N*m", "long_name": "largest |T| of each shaft"},
    )
    data["k_dyns"] = (
        ("start", "shaft"),
        largest / means[:, None],
        {"units": "1", "long_name": "K_dyn of each shaft"},
    )
    names = {chain.shaft_names for chain in listed}
    coordinates = {"shaft": list(names.pop())} if len(names) == 1 else {}
    return xarray.Dataset(data, coords={"chain": ("start", [chain.name for chain in listed]), **coordinates})
