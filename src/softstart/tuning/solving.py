"""Tuning a controller over gaps and load inertias: `tune`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softstart.chain.machines import MachineLike
from softstart.drive import Drive, Duty
from softstart.drive.data_sheet import DataSheet
from softstart.errors import InputError
from softstart.parallel import Pool, checked_workers, usable_workers
from softstart.start.comparison import Uncertain
from softstart.start.demand import ControllerLike
from softstart.store import PartStore, Target
from softstart.tuning.gains import GainSearch, Progress, StartCounter, best_gains
from softstart.tuning.outcome import Tuning
from softstart.tuning.problem import tuning_problem
from softstart.tuning.ranges import Free
from softstart.tuning.tables import (
    CellOptimum,
    between_table,
    cell_optima,
    price_table,
    robust_outcome,
    schedule_table,
)
from softstart.tuning.trials import Part, Trials

GENERATIONS = 60


def tune(
    drive: MachineLike | Uncertain | DataSheet,
    controller: ControllerLike,
    gaps: object = None,
    inertias: object = None,
    *,
    parameters: Mapping[str, object] | None = None,
    free: Free = None,
    metric: str = "k_dyn",
    start_time: float | str | None = None,
    duty: Duty | str | bool | None = None,
    stop: str | None = None,
    cycles: int = 2,
    tolerances: Mapping[str, Any] | None = None,
    quantile: float = 1.0,
    schedule: bool = True,
    robust: bool = True,
    certified: bool | None = None,
    seed: int = 0,
    restarts: int = 3,
    population: int | None = None,
    generations: int = GENERATIONS,
    workers: int | None = None,
    scheduler: str | None = None,
    save_to: str | Path | None = None,
    progress: Progress | None = None,
) -> Tuning:
    """Find the gains of a controller for each gap and load inertia, and one set of gains for all.

    *Schedule*: the best gains of each cell of the grid, the controller set up for that cell's drive. *Robust
    set*: one set of gains, set up for the nominal drive, that is best over all cells. Candidates are ranked
    by feasibility (start time within its bound), then excess, then metric; where the worst start is the same
    (within 1e-6), by the mean over the starts. The defaults are a candidate everywhere, so that no cell
    becomes worse by this rule, unless the range of a gain leaves them out.

    Parameters
    ----------
    drive : Drive, Chain, Identification, DataSheet, str or path
        The nominal drive or chain, or its name or file. A chain starts itself, and the controller is set up
        for its two masses. With an identification every candidate is judged by the drive found and by 100
        drives that its logs leave possible; gaps and inertias are then those of the drive, if none are given.
        Of a data sheet without any stiffness every candidate is judged at both ends of what is usual, and set
        up for the stiff end.
    controller : str or Controller
        A name, `path/to/file.py:ClassName`, a class, or an object.
    gaps, inertias : iterable, optional
        Gaps in rad and load inertias in kg m2: numbers, texts with a unit, multiples of the drive's own as
        "2x", or inertias as multiples of the motor's as "5 J1"; of a drive with a gear also "9 arcmin at
        output". By default 0.5, 1, 2 and 4 times its gap, and
        0.4, 1 and 2 times its load inertia. Those of a chain are the sum of all its gaps at the motor shaft,
        widened alike, and the inertia of its load mass.
    parameters : mapping, optional
        Parameters of a controller given by name. What is given is not tuned, unless it is `free`.
    free : iterable or mapping, optional
        Names of the parameters to tune, or name -> (low, high) with ends in SI, with a unit, or as multiples
        of the default ("0.5x", "2x"). By default all that the controller says may be tuned, within the ranges
        that it names.
    metric : str
        The figure of a start that is minimised (of a chain also `k_dyn_2`, that of its second shaft).
        "margin" is made large: the least share left of the limits of shaft torque and start time (of a chain
        the permissible torque of each shaft); the tables have its complement `limit_share`.
    start_time : float or str, optional
        Bound on the start time in s, or as a multiple of that of `direct` in the same cell ("1.2x"); under a
        strategy that holds the speed it is a bound on the settled time. By default each start is to be no
        slower than with the controller's own defaults; for the margin to a permissible start time there is
        no other bound.
    duty : Duty, path or bool, optional
        Every candidate carries the machines through a duty instead of a start: itself, its file or, if True,
        that of the machine. The metric is then one of the duty: `k_dyn` of all steps, `k_dyn_step_2`, that of
        its second step, `damage` of a cycle; the bound is on the longest time of its starts and reversals,
        where these reach their set speeds with the defaults.
    stop, cycles : optional
        As in `run_duty`.
    tolerances : mapping, optional
        What drives may be off by, unknown to the controller, see `tuning_scenarios`: a parameter -> "10 %", a
        quantity, or a list of values; of a chain also one mass or shaft ("shaft[2].gap").
    quantile : float
        Share of the starts that metric and bound are judged by; 1 is the worst case.
    schedule, robust : bool
        Which of the two questions to answer.
    certified : bool, optional
        Whether to compute each cell's optimum within the same time and its lower bound (only of `k_dyn`).
        By default that of drives; that of a chain takes longer. There is none of a duty.
    seed, restarts, population, generations : int
        Of the search. The same ones give the same bits, whoever computes.
    workers, scheduler, progress : optional
        As in `sweep`; `progress` is called with a text.
    save_to : str or Path, optional
        A file in which the searches are kept while they run, from which the same call goes on.

    Returns
    -------
    Tuning
        The schedule, the robust set, and the price of robustness, over `gap` and `load_inertia`.

    Raises
    ------
    InputError
        For bad input, and for a file in `save_to` that holds something else.
    SimulationError
        For workers that cannot go on; finished parts are kept.

    Examples
    --------
    >>> from softstart import Drive, tune
    >>> crane = Drive.load("crane-4amtkf")
    >>> options = {"free": ["torque"], "certified": False, "workers": 1}
    >>> tuned = tune(crane, "reduced-first-stage", ["1x"], ["1x"], **options)
    >>> cell = tuned.schedule.isel(gap=0, load_inertia=0)
    >>> bool(cell.k_dyn <= cell.k_dyn_default), tuned.robust.agreement
    (True, 3)

    References
    ----------
    R. Storn, K. Price: Differential evolution - a simple and efficient heuristic for global optimization over
    continuous spaces, J. Global Optim. 11 (1997) 341-359, doi:10.1023/A:1008202821328.
    """
    wanted = [name for name, asked in (("schedule", schedule), ("robust", robust)) if asked]
    if not wanted:
        raise InputError("schedule = False, robust = False: set one of them to True.")
    search = {"seed": seed, "restarts": restarts, "population": population, "generations": generations}
    problem = tuning_problem(
        drive, controller, gaps, inertias, parameters=parameters, free=free, metric=metric,
        start_time=start_time, tolerances=tolerances, quantile=quantile, search=search,
        duty=duty, stop=stop, cycles=cycles,
    )  # fmt: skip
    if certified and problem.plan is not None:
        raise InputError("certified = True: an optimum is that of a single start; leave it out for a duty.")
    certified = isinstance(problem.drive, Drive) and problem.plan is None if certified is None else certified
    log = StartCounter(progress, "starts" if problem.plan is None else "duties")
    log.tell(f"{log.what} with the defaults")
    sides = {name: Trials(problem, robust=name == "robust") for name in wanted}
    searches: dict[str, tuple[Trials, GainSearch]] = {}
    target = None if save_to is None else Target("save_to", Path(save_to), "tuning")
    with PartStore(target, problem.inputs(), ["part"]) as parts:
        threads = next(iter(sides.values())).compiled
        count = usable_workers(problem, "the controller", workers, scheduler, threads)
        with Pool(count, threads=threads, scheduler=scheduler, describe=_described) as pool:
            for name, trials in sides.items():
                _, gains = searches.get("schedule", (None, None))
                searches[name] = trials, best_gains(trials, pool, parts, log, gains)
        optima = {}
        if certified and metric == "k_dyn":
            with Pool(checked_workers(workers, scheduler), scheduler=scheduler, describe=_described) as pool:
                optima = cell_optima(pool, sides.values(), parts, log)
    scheduled = searches.get("schedule")
    return Tuning(
        problem,
        scheduled and schedule_table(*scheduled),
        robust_outcome(*searches["robust"]) if robust else None,
        price_table(searches, optima),
        scheduled and between_table(*scheduled),
        log.starts,
        log.seconds,
    )


def _described(task: Part | CellOptimum) -> str:
    if isinstance(task, CellOptimum):
        return f"the optimum of cell {task.cell + 1}"
    return f"candidates from number {task.which.start + 1} on"
