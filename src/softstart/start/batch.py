"""Many machines in one call of the kernel: the same bits as one start at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.controller.base import Controller, ReadyControllers, SetUp
from softstart.drive import PARAMETERS, Drive, Limits, Machine
from softstart.drive.machine_table import MachineTable, each_of
from softstart.kernel import records as rec
from softstart.parallel import checked_workers
from softstart.start.kernel_input import MAX_EVENTS, KernelInput, concatenate, kernel_input, zeros
from softstart.start.results import (
    Figures,
    StartResults,
    figures,
    limit_margins,
    run_set_ups,
    worst_position,
)

if TYPE_CHECKING:
    import xarray

Indices = NDArray[np.int64]
Machines = MachineTable | Sequence[Machine]


@dataclass(frozen=True, eq=False)
class Batch:
    """Machines as input of the kernel, written once for many calls: a start for each position of each."""

    shaft_names: tuple[str, ...]
    places: NDArray[np.int64]  # [k, i]: the start of machine i from its position k, or from its last one
    positions: Indices  # how many positions each machine has
    starts: KernelInput
    permissible: Matrix  # torques of the shafts of each machine, N m
    limits: Limits  # with an array for each limit
    limited: bool = False  # whether a time limit was given

    def results(
        self,
        set_ups: Iterable[SetUp],
        which: Indices | slice = slice(None),
        *,
        until: float | None = None,
        time_limit: Vector | float | None = None,
        workers: int = 1,
        settled: bool = False,
        give_up: tuple[Vector, Vector] | None = None,
    ) -> StartResults:
        """The results of machines `which[i]` in place i, of several positions the worst; or of all.

        With `settled` starts under torque strategies are followed on until their load has settled. `give_up`:
        a torque in N m and a time in s for each start, see `KernelInput.given_up`.
        The set-ups of the controller serve all places, one each, or as many in a row.
        """
        ready, sizes = ReadyControllers.of(set_ups), self.positions[which]
        # all of a million starts are not copied
        single = isinstance(which, slice) and len(self.places) == 1
        each = [slice(None)] if single else self.places[: int(sizes.max(initial=1)), which]
        chosen = (self.starts.take(places) for places in each)
        if time_limit is not None:
            chosen = (starts.with_limits(time_limit) for starts in chosen)
        if ready.regulations:
            given = self.limited or time_limit is not None
            chosen = (starts.regulated(ready.regulations, given) for starts in chosen)
        if settled:
            chosen = (starts.watched() for starts in chosen)
        if give_up is not None:
            chosen = (starts.given_up(*give_up) for starts in chosen)
        results = [run_set_ups(starts, ready, until, workers) for starts in chosen]
        if len(results) == 1:
            return results[0]
        worst = worst_position(results)
        worst.starts["position"][sizes == 1] = 0.0
        return worst

    def figures(
        self,
        set_ups: Iterable[SetUp],
        base: Vector | float,
        which: Indices | slice = slice(None),
        *,
        until: float | None = None,
        time_limit: Vector | float | None = None,
        workers: int = 1,
        settled: bool = False,
        give_up: tuple[Vector, Vector] | None = None,
    ) -> Figures:
        """Figures by name of the same starts. `base` is M12avg in N m, one or one a start."""
        results = self.results(
            set_ups, which, until=until, time_limit=time_limit, workers=workers, settled=settled,
            give_up=give_up,
        )  # fmt: skip
        values = self.read(results, base, which, until)
        if settled and "settled_time" not in values:  # none has settled
            values["settled_time"] = (np.full(results["settled"].shape, np.nan), "s", "")
        return values

    def read(
        self,
        results: StartResults,
        base: Vector | float,
        which: Indices | slice = slice(None),
        until: float | None = None,
    ) -> Figures:
        """The figures in these results."""
        values, names = figures(results, base, until), self.shaft_names
        means = np.broadcast_to(np.asarray(base, dtype=np.float64), results.starts.shape)
        status = values.pop("status")
        if len(names) > 1:
            unfinished = np.isnan(values["k_dyn"][0])
            peaks = np.where(unfinished[:, None], np.nan, results.peaks)
            for k, name in enumerate(names):
                values[f"k_dyn_{k + 1}"] = (peaks[:, k] / means, "1", f"K_dyn of {name}")
            for k, name in enumerate(names):
                values[f"peak_torque_{k + 1}"] = (peaks[:, k], "N*m", f"largest |T| of {name}")
            used = 100.0 * np.nan_to_num(peaks / self.permissible[which]).max(axis=1)
            meaning = "largest |T| over what its shaft permits"
            values["used_torque"] = (np.where(unfinished, np.nan, used), "%", meaning)
        every: Any = (self.limits.shaft_torque, self.limits.start_time)
        torque, time_limit = (None if most is None else most[which] for most in every)
        limits = replace(self.limits, shaft_torque=torque, start_time=time_limit)
        return {**values, **limit_margins(values, limits), "status": status}


def figure_columns(shaft_names: tuple[str, ...]) -> Figures:
    """The names of all figures, with units and meanings, of starts of machines with these shafts."""
    count, zero = len(shaft_names), np.zeros(1, dtype=np.int64)
    results = StartResults(np.zeros(1, rec.NOTES), np.zeros((1, count), rec.SHAFT_NOTES))
    results.starts["release_time"] = math.nan
    limits = Limits(shaft_torque=np.ones(1), used_torque=1.0)  # type: ignore[arg-type]
    starts, permissible = zeros((), count + 1), np.ones((1, count))
    return Batch(shaft_names, zero[None], zero + 1, starts, permissible, limits).read(results, 1.0)


def prepared(machines: Machines, time_limit: float | None = None, max_events: int = MAX_EVENTS) -> Batch:
    """Machines that go through one call of the kernel; InputError for machines that do not match.

    >>> from softstart.controller import make_controller
    >>> crane, direct = Drive.load("crane-4amtkf"), make_controller("direct")
    >>> batch = prepared([crane, crane.replace(gap=2.0)])
    >>> batch.results([direct.set_up(crane)]).peaks.round(2).tolist()
    [[164.81], [257.18]]
    """
    parts = machines.parts if isinstance(machines, MachineTable) else tuple(machines)
    inputs = [
        [kernel_input(placed, time_limit, max_events) for placed in part.positions.values()] for part in parts
    ]
    counts = [len(positions[0].machines) for positions in inputs]
    sizes = [len(positions) for positions in inputs]
    positions = np.repeat(sizes, counts)
    begins = np.cumsum([0, *(size * count for size, count in zip(sizes, counts, strict=True))])
    places = np.empty((int(positions.max()), positions.size), dtype=np.int64)
    first = np.repeat(begins[:-1], counts) + np.concatenate([np.arange(count) for count in counts])
    for k, place in enumerate(places):
        place[:] = first + np.minimum(k, positions - 1) * np.repeat(counts, counts)
    starts = concatenate([placed for positions in inputs for placed in positions])
    permissible = np.concatenate([np.atleast_2d(part.permissible_torques) for part in parts])
    limits, limited = _limits_of(parts), time_limit is not None
    return Batch(parts[0].shaft_names, places, positions, starts, permissible, limits, limited)


def _limits_of(parts: Sequence[Machine]) -> Limits:
    """The limits of each machine; one without a limit may have any figure."""

    def every(name: str) -> Any:
        values = [getattr(part.limits, name) for part in parts]
        if all(value is None for value in values):
            return None
        columns = zip(parts, (math.inf if value is None else value for value in values), strict=True)
        return np.concatenate([each_of(part, value) for part, value in columns])

    return Limits(every("shaft_torque"), every("start_time"), used_torque=parts[0].limits.used_torque)


def simulate_many(
    machines: Machines,
    controller: Controller,
    until: float | None,
    fitted_to: Machine | MachineTable | None,
    base: Machine | MachineTable | None,
    time_limit: float | None,
    max_events: int,
    workers: int | None = None,
) -> xarray.Dataset:
    """`simulate` for records or a list of machines; see there.

    The dimension is `start` for a list and for one-dimensional fields, `axis_0`, `axis_1`, ... otherwise;
    the fields that differ become coordinates. Machines with several shafts have `k_dyns` and `peak_torques`
    too, with the dimension `shaft`.
    """
    batch = prepared(machines, time_limit, max_events)
    if isinstance(machines, MachineTable):
        shape, means = machines.shape, machines.mean_torque
        dims = ("start",) if len(shape) == 1 else tuple(f"axis_{i}" for i in range(len(shape)))
        coordinates: dict[str, object] = {
            name: (dims, values.copy()) for name, values in machines.fields.items()
        }
        shaft_names = {machines.parts[0].shaft_names}
    else:
        shape, dims = (len(machines),), ("start",)
        means = np.array([machine.mean_torque for machine in machines], dtype=np.float64)
        coordinates = {"drive": (dims, [machine.name for machine in machines])}
        coordinates |= {name: (dims, values) for name, values in _different(machines)}
        shaft_names = {machine.shaft_names for machine in machines}
    figures = batch.figures(
        controller.set_ups(fitted_to or machines), means if base is None else base.mean_torque,
        until=until, workers=checked_workers(workers),
    )  # fmt: skip
    data: dict[str, Any] = {
        name: (dims, values.reshape(shape), *text)
        for name, (values, *text) in figures.items()
        if name.rstrip("0123456789")[-1] != "_"
    }
    if (count := len(batch.shaft_names)) > 1:
        for name, plural in (("k_dyn", "k_dyns"), ("peak_torque", "peak_torques")):
            columns = [figures[f"{name}_{k + 1}"][0].reshape(shape) for k in range(count)]
            _, unit, meaning = figures[name]
            data[plural] = ((*dims, "shaft"), np.stack(columns, axis=-1), unit, f"{meaning}, of each shaft")
        if len(shaft_names) == 1:
            coordinates["shaft"] = (("shaft",), list(batch.shaft_names))
    return _dataset(data, coordinates)


def _different(machines: Sequence[Machine]) -> Iterator[tuple[str, list[object]]]:
    """The parameters in which drives of a list differ; of chains they are not known by name."""
    for name in PARAMETERS if all(isinstance(one, Drive) for one in machines) else ():
        values = [getattr(machine, name) for machine in machines]
        if name != "name" and not PARAMETERS[name].many and any(value != values[0] for value in values):
            yield name, values


def _dataset(data: Mapping[str, Any], coordinates: Mapping[str, object]) -> xarray.Dataset:
    import xarray

    return xarray.Dataset(
        {name: (dims, values, {"units": unit, "long_name": meaning})
         for name, (dims, values, unit, meaning) in data.items()},
        coords=coordinates,
    )  # fmt: skip
