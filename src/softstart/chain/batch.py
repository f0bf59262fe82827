"""Many starts of chains in one call, on several cores: the same bits as one start at a time."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.chain import kernel_start as kernel
from softstart.chain.kernel_records import SHAFT, Numbers, numbers
from softstart.chain.model import Chain
from softstart.chain.run import ChainRecorder, mean_torque_of
from softstart.chain.simulation import check_end, drive_of
from softstart.controller.base import Controller, Sensor, SetUp, rows_of
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.plant import layout
from softstart.plant.exchange import N_MEASURED, NEW_STATE
from softstart.processes import Pool
from softstart.start.batch import Figures, figures, margins
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
    "gap_events",
)
LATEST = ("start_time", "torque_excess", "torque_excess_time")  # of several positions the largest counts

Rows = NDArray[np.int64]


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
    batch = prepared(listed, time_limit, max_events)
    for i, chain in enumerate(listed):
        check_end(chain, made, until, batch.p[batch.begins[i]])
    nominal = fitted_to if fitted_to is None or isinstance(fitted_to, Drive) else drive_of(fitted_to)
    set_ups = [made.set_up(one) for one in (map(drive_of, listed) if nominal is None else [nominal])]
    count = workers or os.cpu_count() or 1
    means = np.array([mean_torque_of(base or fitted_to or chain) for chain in listed])
    found = batch.figures(np.arange(len(listed)), set_ups, means, until=until, workers=count)
    data: dict[str, Any] = {
        name: ("start", values, {"units": unit, "long_name": meaning})
        for name, (values, unit, meaning) in found.items()
        if name in (*FIGURES, "status")
    }
    for name, unit, meaning in (
        ("peak_torques", "N*m", "largest |T| of each shaft"),
        ("k_dyns", "1", "K_dyn of each shaft"),
    ):
        columns = [found[f"{name[:-1]}_{k + 1}"][0] for k in range(len(listed[0].shafts))]
        data[name] = (("start", "shaft"), np.stack(columns, axis=1), {"units": unit, "long_name": meaning})
    names = {chain.shaft_names for chain in listed}
    coordinates = {"shaft": list(names.pop())} if len(names) == 1 else {}
    return xarray.Dataset(data, coords={"chain": ("start", [chain.name for chain in listed]), **coordinates})


def prepared(
    chains: Sequence[Chain], time_limit: float | None = None, max_events: int = MAX_EVENTS
) -> ChainBatch:
    """Chains that go through one call of the kernel; InputError for chains that do not match."""
    each = [list(chain.positions.values()) for chain in chains]
    given = [numbers(one, None, time_limit, max_events) for several in each for one in several]
    if len({(one.count, one.place) for one in given}) > 1:
        raise InputError(
            "chains: starts in one call have the same number of masses, and motors and loads on the same "
            "ones; sort the chains by that."
        )
    return ChainBatch(
        tuple(chains),
        np.cumsum([0, *(len(several) for several in each)]),
        given[0],
        np.stack([one.p for one in given]),
        # as words of 8 bytes: stacking records compares their fields for each
        np.stack([one.masses.view(np.int64) for one in given]).view(given[0].masses.dtype),
        np.stack([one.shafts.view(np.int64) for one in given]).view(given[0].shafts.dtype),
        np.stack([chain.at_motor_shaft().permissible for chain in chains]),
    )


@dataclass(frozen=True, eq=False)
class ChainBatch:
    """Chains as rows of the kernel, written once for many calls: a row for each position of each chain.

    `begins` has the first row of each chain, and one more at the end; `permissible` the torques of shafts.
    """

    chains: tuple[Chain, ...]
    begins: Rows
    first: Numbers
    p: layout.Matrix
    masses: Any
    shafts: Any
    permissible: layout.Matrix

    def figures(
        self,
        which: Rows,
        set_ups: Iterable[SetUp],
        base: Any,
        time_limit: float | None = None,
        *,
        until: float | None = None,
        workers: int = 1,
    ) -> Figures:
        """Figures by name of the starts of chains `which`, of several positions the worst.

        The set-ups of the controller serve all places in `which`, one each, or as many in a row. `base` is
        M12avg in N m, one or one a start.
        """
        spans = [np.arange(self.begins[i], self.begins[i + 1]) for i in which.tolist()]
        owners = np.repeat(np.arange(which.size), [span.size for span in spans])
        rows = np.concatenate(spans)
        results, ends = self._notes(rows, owners, set_ups, time_limit, until, workers)
        return self._read(which, spans, owners, results, ends, base, until)

    def named(self) -> Figures:
        """The names of all figures, with units and meanings, of starts that are not made."""
        one, owners = np.array([0]), np.zeros(1, np.int64)
        nothing = np.zeros((1, layout.N_X)), np.zeros((1, self.first.count - 1), SHAFT)
        return self._read(one, [one], owners, *nothing, 1.0, None)

    def _read(
        self,
        which: Rows,
        spans: list[Rows],
        owners: Rows,
        results: layout.Matrix,
        ends: Any,
        base: Any,
        until: float | None,
    ) -> Figures:
        """The figures in the kernel's notes; `spans` are the rows of each start."""
        torques, at = np.abs(ends["peak"]), np.arange(owners.size)
        worst = torques.argmax(axis=1)
        results[:, layout.PEAK], results[:, layout.PEAK_TIME] = (
            torques[at, worst],
            ends["peak_time"][at, worst],
        )
        means = np.broadcast_to(np.asarray(base, dtype=np.float64), which.shape)
        found = figures(results, means[owners], until)
        good = ~np.isnan(found["k_dyn"][0])
        begins = np.cumsum([0, *(span.size for span in spans[:-1])])
        if owners.size > which.size:
            # the position with the largest torque, or one whose start could not be finished
            ranked = np.where(good, torques.max(axis=1), np.inf)
            ends_at = np.append(begins[1:], owners.size)
            chosen = np.array([i + int(ranked[i:j].argmax()) for i, j in zip(begins, ends_at, strict=True)])
        else:
            chosen = at
        torques[~good] = math.nan
        latest = {
            name: (np.maximum.reduceat(found[name][0], begins) if name in LATEST else found[name][0][chosen])
            for name in FIGURES
        }
        kept: Figures = {name: (latest[name], *found[name][1:]) for name in FIGURES}
        largest = np.maximum.reduceat(torques, begins, axis=0)
        names = self.chains[0].shaft_names
        for k, place in enumerate(names):
            kept[f"k_dyn_{k + 1}"] = (largest[:, k] / means, "1", f"K_dyn of {place}")
        for k, place in enumerate(names):
            kept[f"peak_torque_{k + 1}"] = (largest[:, k], "N*m", f"largest |T| of {place}")
        used = 100.0 * np.nan_to_num(largest / self.permissible[which]).max(axis=1)
        kept["used_torque"] = (
            np.where(np.isnan(kept["k_dyn"][0]), np.nan, used),
            "%",
            "largest |T| over what its shaft permits",
        )
        kept |= margins(kept, self.chains[0].limits)
        return {**kept, "status": (found["status"][0][chosen], *found["status"][1:])}

    def _notes(
        self,
        rows: Rows,
        owners: Rows,
        set_ups: Iterable[SetUp],
        time_limit: float | None,
        until: float | None,
        workers: int,
    ) -> tuple[layout.Matrix, Any]:
        """The kernel's notes of the starts of these rows, and their shafts as they are at the end."""
        p = self.p[rows]
        if time_limit is not None:
            p[:, layout.TIME_LIMIT] = time_limit
        results, ends = np.empty((rows.size, layout.N_X)), np.zeros((rows.size, self.first.count - 1), SHAFT)
        end = math.inf if until is None else until
        masses, shafts = self.masses[rows], self.shafts[rows]
        prepared = rows_of(set_ups)
        count = len(prepared) if isinstance(prepared, list) else len(prepared[1])
        turns = owners * count // (int(owners[-1]) + 1)
        if isinstance(prepared, list):
            for row, turn in enumerate(turns.tolist()):
                ready, own = prepared[turn]
                one = replace(self.first, p=p[row], masses=masses[row], shafts=shafts[row])
                recorder = ChainRecorder(one, int(ready.sensors), rows=0)
                recorder.x[layout.STATUS] = run_one(ready, own, recorder, end)
                results[row], ends[row] = recorder.x, recorder.start.shafts
            return results, ends
        made, vectors = prepared
        numbers_of = vectors[turns] if len(vectors) > 1 else vectors
        step, sees = type(made).kernel, int(made.sensors)

        def run(part: slice) -> None:
            scratch = self.first.start()._replace(p=np.zeros(layout.N_P))  # each thread writes into its own
            with watched(made):
                kernel.run_many(
                    step, p[part], masses[part], shafts[part],
                    numbers_of[part] if len(numbers_of) > 1 else numbers_of, sees,
                    bool(made.sensors & Sensor.STAGE), end, results[part], ends[part], scratch,
                    np.zeros(N_MEASURED), np.zeros(made.state_size), np.zeros(NEW_STATE + made.state_size),
                )  # fmt: skip

        parts = [slice(i, i + TURN) for i in range(0, rows.size, TURN)]
        if workers == 1 or len(parts) == 1:
            for part in parts:
                run(part)
        else:
            with Pool(min(workers, len(parts)), threads=True) as pool:
                for _ in pool.results(run, iter(parts)):
                    pass
        return results, ends
