"""Many machines through a duty: the figures of `run_duty`, to the bit, for sweeps and tuning."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart import formulas
from softstart.arrays import Indices, Vector
from softstart.controller.base import Controller, SetUp
from softstart.drive import Drive, Duty, Machine
from softstart.drive.machine_table import MachineTable
from softstart.errors import InputError
from softstart.quantities import check_whole, show
from softstart.start.duty import StepRun, carried_out, checked_stop, duty_of, duty_run
from softstart.start.duty_cycle import StepError
from softstart.start.results import Figures, has_margin
from softstart.start.status import Status

RECORDED = ("impact_energy", "damage")  # figures that need a record of the whole duty: twice the time
UNITS = {
    "k_dyn": ("1", "dynamic coefficient of the whole duty, [G](16)"),
    "peak_torque": ("N*m", "largest |T| of the duty"),
    "used_torque": ("%", "largest |T| over what its shaft permits"),
    "start_time": ("s", "longest time of a start or reversal until the load has its set speed"),
    "cycle_time": ("s", "how long the last cycle takes"),
    "contacts": ("1", "how often a gap closes in the last cycle"),
    "impact_energy": ("J", "kinetic energy of the relative motion at all impacts of the last cycle"),
    "damage": ("1", "Miner's sum of one cycle for the shaft with the largest, from the second cycle on"),
    "margin": ("1", "smallest remaining share of the limits of shaft torque and start time"),
    "keeps_limits": ("1", "1 where these limits are kept, else 0"),
    "status": ("", "how the duty ended"),
}


@dataclass(frozen=True, eq=False)
class DutyPlan:
    """A duty as many machines are to carry it out: one cycle, the stop of steps that name none, how often."""

    duty: Duty
    stop: str | None = None
    cycles: int = 2

    @classmethod
    def of(
        cls, machine: Machine, duty: Duty | str | bool | None, stop: str | None = None, cycles: int = 2
    ) -> DutyPlan | None:
        """The arguments of `sweep` and `tune`, read: True for the duty of the machine, None for starts."""
        if duty is None or duty is False:
            if stop is not None:
                raise InputError(f"stop = {show(stop)}: a single start has no stop; give a duty as well.")
            return None
        check_whole(cycles, "cycles")
        return cls(duty_of(machine, None if duty is True else duty), stop, cycles)

    @property
    def count(self) -> int:
        """How many cycles are carried out: one where the duty ends in motion."""
        return 1 if self.duty.ends_moving else self.cycles

    def inputs(self) -> dict[str, Any]:
        """All of it as plain data: what saved results belong to."""
        return {"duty": self.duty.to_toml(), "stop of the duty": self.stop, "cycles of the duty": self.cycles}

    def words(self) -> str:
        """All of it in a line.

        >>> from softstart import DutyStep
        >>> DutyPlan(Duty([DutyStep("start"), DutyStep("stop", by="coast")]), cycles=1).words()
        'start, stop by coast; 1 cycle'
        """
        steps = ", ".join(f"{one.do} by {one.by}" if one.by else one.do for one in self.duty.steps)
        stop = f"; stops by {self.stop}" if self.stop else ""
        return f"{steps}{stop}; {self.count} cycle{'s' if self.count > 1 else ''}"

    def check(self, machine: Machine, controller: Controller, design: Drive) -> str:
        """How steps stop that do not say it; InputError for what this machine or strategy cannot do."""
        return checked_stop(machine, controller, design, self.duty, self.stop)

    def figure_columns(self, shaft_names: Sequence[str]) -> dict[str, tuple[str, str]]:
        """Unit and meaning of each figure by name, of machines with these shafts."""
        columns = {}
        several = shaft_names if len(shaft_names) > 1 else ()
        for name, column in UNITS.items():
            if name != "used_torque" or several:
                columns[name] = column
            if name == "k_dyn":
                for number, step in enumerate(self.duty.steps, start=1):
                    columns[f"k_dyn_step_{number}"] = ("1", f"K_dyn of step {number}, {step.do}")
            if name in ("k_dyn", "peak_torque"):
                what = "K_dyn" if name == "k_dyn" else "largest |T|"
                for k, shaft in enumerate(several, start=1):
                    columns[f"{name}_{k}"] = (column[0], f"{what} of {shaft}")
        return columns


@dataclass(frozen=True, eq=False)
class DutyBatch:
    """Machines that each carry out a duty, as `Batch` holds those that start.

    >>> from softstart import DutyStep, run_duty
    >>> from softstart.controller import make_controller
    >>> drive, direct = Drive.load("conveyor-11kw"), make_controller("direct")
    >>> duty = Duty([DutyStep("jog", time=0.2, by="coast")])
    >>> figures = DutyBatch((drive,), DutyPlan(duty)).figures(direct.set_ups(drive), drive.mean_torque)
    >>> figures["k_dyn"][0].tolist() == [run_duty(drive, direct, duty).k_dyn], figures["status"][0].tolist()
    (True, ['CARRIED_OUT'])
    """

    machines: tuple[Machine, ...]
    plan: DutyPlan
    recorded: bool = False  # for the figures RECORDED, which are NaN without it

    @classmethod
    def of(cls, table: MachineTable, plan: DutyPlan, figures: Iterable[str]) -> DutyBatch:
        """The machines of a table, for these figures."""
        return cls(tuple(table.elements()), plan, not set(RECORDED).isdisjoint(figures))

    def figures(
        self,
        set_ups: Iterable[SetUp],
        base: Vector | float,
        which: Indices | slice = slice(None),
        **options: object,
    ) -> Figures:
        """Figures by name of machines `which[i]` in place i, as `Batch.figures`; its options are of starts.

        Figures of a duty that could not be carried out are NaN; its status says how it ended.
        """
        ready = list(set_ups)
        places = np.arange(len(self.machines))[which]
        rows = [
            self._figures_of(self.machines[place], *ready[i * len(ready) // len(places)])
            for i, place in enumerate(places.tolist())
        ]
        machine = self.machines[0]
        columns = self.plan.figure_columns(machine.shaft_names)
        if not any(has_margin(one.limits) for one in self.machines):
            del columns["margin"], columns["keeps_limits"]
        values = {name: np.array([row.get(name, math.nan) for row in rows]) for name in columns}
        for name in columns:
            if name.startswith("k_dyn"):  # of torques
                k_dyn = formulas.dynamic_coefficient(np.nan_to_num(values[name]), base)
                values[name] = np.where(np.isnan(values[name]), np.nan, k_dyn)
        return {name: (values[name], *column) for name, column in columns.items()}

    def _figures_of(self, machine: Machine, controller: Controller, design: Drive) -> dict[str, float | str]:
        """The figures of one machine that is carried through the duty; see `_of_steps`."""
        plan, damage = self.plan, math.nan
        stop = plan.check(machine, controller, design)
        try:
            if self.recorded:
                run = duty_run(machine, controller, design, plan.duty, stop, plan.count)
                executed: Sequence[StepRun] = run.executed
                damage = run.life().worst.damage
            else:
                steps = carried_out(machine, controller, design, plan.duty, stop, plan.count)
                executed = [one for one, _ in steps]
        except StepError as error:
            return {"status": error.status.name}
        figures = dict(_of_steps(machine, executed))
        return {**figures, "damage": damage, "status": Status.CARRIED_OUT.name}


def _of_steps(machine: Machine, executed: Sequence[StepRun]) -> Iterator[tuple[str, float]]:
    """Figures of the steps of all cycles, by name; in place of each K_dyn its torque, N m."""
    of_shafts = np.max([one.peak_torques for one in executed], axis=0)
    peak, last = float(of_shafts.max()), [one for one in executed if one.cycle == executed[-1].cycle]
    yield from (("k_dyn", peak), ("peak_torque", peak))
    for number in {one.number for one in executed}:
        yield f"k_dyn_step_{number}", max(one.peak_torque for one in executed if one.number == number)
    for k, torque in enumerate(of_shafts.tolist(), start=1):
        yield from ((f"k_dyn_{k}", torque), (f"peak_torque_{k}", torque))
    times = [one.start_time for one in executed if one.step.do in ("start", "reverse")]
    yield "start_time", float(np.max(times)) if times else math.nan
    yield "cycle_time", last[-1].end - last[0].begin
    yield "contacts", float(sum(one.contacts for one in last))
    yield "impact_energy", float(np.sum([one.impact_energy for one in last]))
    used = 100.0 * float(np.nan_to_num(of_shafts / machine.permissible_torques).max())
    yield "used_torque", used
    if has_margin(machine.limits):
        limited = {"peak_torque": peak, "used_torque": used}
        # a start that is ended before has no start time
        if reached := [time for time in times if not math.isnan(time)]:
            limited["start_time"] = max(reached)
        margin = float(machine.limits.margin(limited))
        yield from (("margin", margin), ("keeps_limits", float(margin >= 0.0)))
