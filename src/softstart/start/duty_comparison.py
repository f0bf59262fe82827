"""Strategies side by side through a duty: `compare_duty`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from softstart.chain.machines import MachineLike, as_machine
from softstart.controller.base import label_of
from softstart.drive import Duty
from softstart.errors import InputError, SimulationError
from softstart.results import OneLine, Result
from softstart.start.comparison import make_controllers
from softstart.start.demand import ControllerLike
from softstart.start.duty import DutyRun, StepRun, duty_of, run_duty
from softstart.start.duty_life import DutyLife
from softstart.start.fatigue import check_shafts, curve_of, life_ratio, with_estimated_damping
from softstart.start.metrics import REFERENCE
from softstart.start.recommendation import Margin


@dataclass(frozen=True, eq=False, repr=False)
class DutyRow(OneLine):
    """One strategy through a duty.

    Attributes
    ----------
    name : str
        Name of the strategy.
    run : DutyRun or None
        The duty under it; None if it cannot be finished.
    reason : str
        Why it cannot be finished, a sentence; else empty.
    life : DutyLife or None
        The lives of the shafts; None if they cannot be computed.
    relative : float
        Life of the shaft that gains least over its life under `direct`; NaN if either is not known.
    """

    name: str
    run: DutyRun | None
    reason: str = ""
    life: DutyLife | None = None
    relative: float = math.nan

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient of the worst step; infinite if the duty cannot be finished."""
        return math.inf if self.run is None else self.run.k_dyn

    @property
    def margins(self) -> tuple[tuple[StepRun | None, Margin], ...]:
        """The margins of all steps and of the life, see `DutyRun.margins`."""
        return () if self.run is None else self.run.margins(self.life)

    @property
    def limits_kept(self) -> bool | None:
        """Whether all limits are kept, a required life too; None without any."""
        return all(margin.kept for _, margin in self.margins) if self.margins else None

    def summary(self) -> dict[str, object]:
        """The figures under the names used everywhere."""
        if self.run is None:
            return {"controller": self.name, "reason": self.reason}
        life = None if self.life is None else self.life.summary()
        also = {"limits_kept": self.limits_kept, "life": life, "relative_life": self.relative, "reason": ""}
        return {**self.run.summary(), **also}


@dataclass(frozen=True, eq=False, repr=False)
class DutyComparison(Result, view="duties.duty_comparison_sheet"):
    """Strategies side by side through a duty. It is returned by `compare_duty`.

    Attributes
    ----------
    drive : Drive or Chain
        The machine, with the damping that was estimated if so.
    duty : Duty
        One cycle.
    rows : tuple of DutyRow
        One for each strategy, in the order given.
    no_life : str
        Why there are no lives, a sentence; else empty.
    estimate : mapping of str to int
        Numbers of gears and couplings from which the damping is estimated; empty if it is given.

    Examples
    --------
    >>> from softstart import Duty, DutyStep, compare_duty
    >>> duty = Duty([DutyStep("start"), DutyStep("hold", time=1), DutyStep("stop")])
    >>> table = compare_duty("conveyor-11kw", ["direct", "ramp"], duty)
    >>> [(row.name, row.run.worst.step.do, round(row.k_dyn, 3)) for row in table.rows]
    [('direct', 'start', 1.857), ('ramp', 'start', 1.159)]
    """

    drive: Any  # a Machine
    duty: Duty
    rows: tuple[DutyRow, ...]
    no_life: str = ""
    estimate: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def ranked(self) -> tuple[DutyRow, ...]:
        """The rows, the lowest K_dyn of the worst step first, duties that cannot be finished last."""
        return tuple(sorted(self.rows, key=lambda row: row.k_dyn))

    @property
    def finished(self) -> tuple[DutyRow, ...]:
        """The rows of duties that can be finished, in the order given."""
        return tuple(row for row in self.rows if row.run is not None)

    def summary(self) -> dict[str, object]:
        """Everything as plain data, for JSON."""
        return {
            **self.drive.identity,
            "no_life": self.no_life,
            "damping_estimated_from": dict(self.estimate) or None,
            "strategies": [row.summary() for row in self.rows],
        }


def compare_duty(
    drive: MachineLike,
    controllers: Sequence[ControllerLike] | ControllerLike | None = None,
    duty: Duty | str | None = None,
    *,
    stop: str | None = None,
    cycles: int = 2,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
    fitted_to: MachineLike | None = None,
    slope: float | None = None,
    estimate_damping: Mapping[str, int] | None = None,
    progress: Callable[[str], None] | None = None,
) -> DutyComparison:
    """A machine through cycles of a duty under each strategy: K_dyn of each step, limits and life.

    Parameters
    ----------
    drive : Drive, Chain, str or path
        The machine.
    controllers : sequence of str or Controller, optional
        Each as in `simulate`. By default all installed controllers that need no parameter, and those that
        are given parameters.
    duty : Duty or path, optional
        One cycle; by default that of the machine's file.
    stop, cycles, fitted_to : as in `run_duty`.
    parameters : mapping, optional
        A controller's name -> its parameters (SI numbers or strings with a unit).
    slope, estimate_damping : as in `fatigue`.
    progress : callable, optional
        It is called with a text before each strategy.

    Returns
    -------
    DutyComparison
        A row for each strategy; that of a duty that cannot be finished gives the reason.

    Raises
    ------
    InputError
        Bad input; all its mistakes at once.
    SimulationError
        If the duty cannot be finished under any of the strategies.

    Examples
    --------
    >>> from softstart import compare_duty
    >>> compare_duty("conveyor-11kw", ["ramp"])
    Traceback (most recent call last):
    softstart.errors.InputError: duty is missing: ...
    """
    machine = as_machine(drive)
    if estimate_damping is not None:
        machine = with_estimated_damping(machine, estimate_damping)
    curve_of(machine, slope)  # a wrong slope is told before anything is computed
    cycle, made = duty_of(machine, duty), make_controllers(controllers, parameters or {})
    runs: list[tuple[str, DutyRun | InputError | SimulationError]] = []
    for controller in made:
        name = label_of(controller)
        if progress is not None:
            progress(f"duty under {name}")
        runs.append((name, _tried(machine, controller, cycle, stop, cycles, fitted_to)))
    failures = [run for _, run in runs if not isinstance(run, DutyRun)]
    if len(failures) == len(runs):
        raise next((one for one in failures if isinstance(one, InputError)), failures[0])
    no_life, reference = "", None
    try:
        check_shafts(machine)
    except InputError as error:
        no_life = str(error)
    else:
        named = dict(runs).get(REFERENCE)
        direct = named or _tried(machine, REFERENCE, cycle, stop, cycles, fitted_to)
        reference = direct.life(slope) if isinstance(direct, DutyRun) else None
    rows = tuple(_row(name, run, slope, reference, not no_life) for name, run in runs)
    return DutyComparison(machine, cycle, rows, no_life, dict(estimate_damping or {}))


def _tried(
    machine: Any, controller: ControllerLike, duty: Duty, stop: str | None, cycles: int,
    fitted_to: MachineLike | None,
) -> DutyRun | InputError | SimulationError:  # fmt: skip
    """The duty under a strategy, or why it cannot be finished."""
    try:
        return run_duty(machine, controller, duty, stop=stop, cycles=cycles, fitted_to=fitted_to)
    except (InputError, SimulationError) as error:
        return error


def _row(
    name: str, run: DutyRun | InputError | SimulationError, slope: float | None, reference: DutyLife | None,
    lasts: bool,
) -> DutyRow:  # fmt: skip
    if not isinstance(run, DutyRun):
        return DutyRow(name, None, " ".join(str(run).split()))
    if not lasts:
        return DutyRow(name, run)
    life, ratio = run.life(slope), math.nan
    if reference is not None:
        pairs = zip(reference.shafts, life.shafts, strict=True)
        ratio = min(life_ratio(first.damage, own.damage) for first, own in pairs)
    return DutyRow(name, run, "", life, ratio)
