"""The size of the house: a budget for each room, and no import circle.

A number here may fall without a word. Raising one needs a sentence beside it that says what for.
"""

from __future__ import annotations

import ast
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = ("src", "controllers", "studies")

# room of src/softstart: lines, files, modules with a single importer, imports inside functions
BUDGET = {
    # 110 lines: lists and whole numbers as people type them, in one place; 180: checksums of what is kept,
    # folders of killed processes, the end of a process that does not stop
    # 40 and a file: the language of what is shown; 30: the collector of sentences, which cli had
    # 75: the units in which people see angles and speeds
    # 25 lines: linear algebra on one thread, three times as quick where others compute too
    "(top)": (2775, 12, 0, 0),
    "balancing": (2020, 7, 0, 0),
    # 150 lines: damping ratios, mean torque and K_dyn of a chain, permissible torques; 180: where its start
    # begins, settled times, starts from an unknown position, as a drive has them; 370 and a file that
    # __init__ alone imports: batches, and spans of masses that move alone
    # 285 and a file: sensitivities of starts, for the optimum
    # 250 and a file: lives of its shafts; 15: spans and records that compile once
    # 170: how far two masses are off in K_dyn; 9: chains told from drives by their text, which the page has
    # 9: units of what is shown, as a drive has them
    # 440 and a file: drives and chains by the same words (`machines`, 65 lines from the page), and batches
    # of chains that are written once for many calls, for tuning and sweeps
    # 6: names of the exchange between plant and controller, one a line
    # 307: load curves by speed or angle, ground, torque at t = 0
    "chain": (6834, 18, 4, 0),
    # 140 and a file: `init`; 30: `fatigue` of a chain
    # 60: a report is printed to A4
    # 250 and a file: `identify`; 40: optima of chains
    # 15: a torque constant; 20: folders of identifications; 65: wear
    # 20: two masses of a chain where they are enough
    # 33: options that read their own values; 7: chains where a drive goes; 10: no option is a value
    "cli": (4900, 22, 1, 0),  # 50 lines: a stop signal ends compiled code too; 130: the command `fatigue`
    "clutch": (2380, 10, 5, 0),
    # texts with choices; other parameters of a controller that stands; 60: the order of effort
    # 12: the address of a step is looked up once, not for each start
    "controller": (1282, 5, 0, 0),
    # where a start begins: positions, brake, reversal; 160 lines and a file: what the machine withstands
    # 30 lines: S-N curves; 50: one limit and what a figure leaves of it
    # 420 and a file: `DataSheet`, from plates and drawings to a drive
    # 3: names of the frictions
    # 1: names of limits are sentences too
    # 10: units of what is shown
    "drive": (1620, 6, 1, 0),  # 5: a reactive load may be anywhere; 55: friction of motor and load
    # the drive from logs of its starts, and experiments that tell it
    # 165: measurement files, whose channels have instants of their own; currents; units given by the user
    # 100: identifications kept on disk, drawn by the intervals that are shown
    # 20: the mean correlation of encoder errors
    # 350 and a file: wear of the gap over the years
    # 135 and a file: chains through their reduction
    # 150: torques designed by CasADi, and one that leaves the load at rest
    # 170: friction, which may be 0; ends of intervals along bent valleys
    # 20: units of another scale; 90: intervals over all valleys of a likelihood, "known" by information
    # 25: a drive is written without digits that its logs do not tell
    # 65: no bias by the torque error, ends of intervals about the torque error that is likely there
    # 240 and a file: exact responses to torque errors
    # 140: the likelihood itself, with its derivatives, in fits and at the ends of intervals
    # 35: when a count ended, instead of samples on it
    # 70: largest shaft torque and travel of an experiment over all start positions
    "identification": (3865, 10, 4, 0),
    # columns.py: one reader of CSV files instead of four; files are checked first; 50: quantities that may be
    # words, former names of keys
    "input": (1510, 6, 0, 0),
    # 5: viscous friction; 245: the loop of a whole chain, its gaps closed and open
    "linear": (2370, 8, 1, 0),
    # ends before the bound; shared bounds; 230: brake, unknown position; 80: two methods where a bound is far
    # 250 and a file: the quickest start that keeps the limits
    # 930 and a file: the certificate of the whole start, behind lag, rate limit and friction
    # 130 and two files: open-loop starts of chains, for their optimum
    # 210: HiGHS from the last basis, rate limits in the certificate, cells where they are open
    # 1000 and six files: the optimum on a chain (starts, problem, search, seeds) and its bounds
    # 110: starts with several contacts, and those of shipped strategies, beside the answer of the programs
    # 25: rows of programs as plain entries; 50: multipliers of the rate limit by a compiled
    # recursion, not by a program; 84: `Problem.casadi`
    # 28: HiGHS takes programs as arrays and starts from the last basis
    # 75: the torque-speed curve kept after t_f and by the exact start; a steady end without load torque
    # 30: the certificate stops where programs no longer raise it, and tries no more multipliers than it needs
    # 55: chains: searches around the best start, linear programs by the interior point method
    # 125 and a file: whole_dual.py, the curve before the contact, the exact minimum behind a limited rate
    # 110: the least start time of a K_dyn, by the search that keeps limits; 60: bounds kept, least heat
    # 25: torque above the linear one at its price, and the demand that holds a steady end
    # 42: multipliers and weights of the demand of one start, for the page from the statement to the proof
    # 10: what load curves and ground leave of bounds and terminal conditions
    # 505 and a file: chains by collocation, an independent check of their linear programs
    # 277: points of a front share answers and proofs
    # 60: the gap of a load at rest in closed form
    # 5: points of a front serve the report; 20: programs solved without scaling, windings of a load at rest
    # 15: the lowest cells are brought to a level before others are brought to the next
    "optimal": (13030, 37, 11, 0),
    # undo and redo; parameters of strategies; `links`: the bench in the address; 60: settled, flags, limits
    # 10: the window of the plots
    # 110 and a file: the form of the data sheet
    # 150 and a file: a log is identified
    # 3: fields of friction
    # 4: angles and speeds of copied commands in deg, arcmin or rpm
    # 90: jobs in every tab of a browser, after a reload too
    # 220 and a file: start positions, limits and life are checked; limits are fields
    # 465: a chain in place of the drive: its fields, sliders, traces of all shafts, stages of all gaps, map
    # 111: a start that is kept as a reference, and goes with link and undo; values in their unit
    # 65: angles and speeds in the units of the user; a log of a chain
    "page": (5630, 21, 3, 0),
    # a motor held by its brake; `terms`: rates decades apart; 60: demands cut off at the limits;
    # 50: turning points; 10: the longest start; 260: lags far longer than a span, torques far faster than
    # the spring; 60: functions compiled apart
    # 291 and a file: friction of the motor; viscous friction, which couples three speeds in one series
    # 6: what passes between plant and controller is a file of its own, compiled without the loop of starts
    # 2: numbers of a single drive are not broadcast one by one
    "plant": (3179, 16, 2, 0),
    # 40: life of the shaft line; 350 and two files: page 1, project file, revisions, sources,
    # names of functions of inverters, what is assumed; 370 and a file: the report of a chain
    # 15: lives of its shafts, parameters with their units
    # 630 and a file: sentences are templates, a value a line; translations of them
    # 165: limit, optimum and parameter sheet of a chain; 110: sheets that keep the rule; 30: the ramp of a
    # gear backlash function; 120: units of the user, indices and spaces as printers set them; 5: the gentlest
    # start known as a line
    "reporting": (4875, 16, 4, 0),
    "stages": (680, 6, 1, 0),
    # the worst of several positions, release of a brake, torque cut off; 500 and a file: `fatigue`; 60:
    # silent controllers are named, figures of long starts are taken in turns; 450 and a file: settled times,
    # margins to limits, the rule of what is recommended, that reporting and views had
    # 10: what notebooks show
    # 20: damage of cycles, for chains too
    # 80: intervals of starts whose drive is known within intervals
    # 15: friction in the energy balance
    # 5: the watch of controllers ends without a race
    # 60: sentences of the recommendation are templates
    # 15: margins of chains by the rule of drives
    # 1: the names of the exchange between plant and controller have a module of their own
    "start": (2956, 10, 1, 0),  # 30: what starts of drives and of chains have in common; 50: margins
    # 100 lines: damaged chunks and descriptions are found, named and made again; 20: margins to limits
    # 1: a summary reads each figure once
    # 110: chains
    "sweeping": (1901, 8, 0, 0),
    # 40: drives drawn from an identification as scenarios
    # 80: chains
    "tuning": (2460, 10, 1, 0),  # 15: the margin to limits
    # small cells beside a large one; where a start begins, torque cut off, in words; 180 and a file: lives
    # 20: what a sensor of the start position is worth; 120: starts, sweeps and gains against limits
    # 70: starts and comparisons of chains
    # 75 and a file: results as notebooks show them; 190 and a file: identifications and plans
    # 10: the worst of several positions, named by the page and the report too
    # 40: optima of chains; 75: lives of the shafts of a chain
    # 90: wear
    # 5: what designed a torque
    # 6: friction
    # 15: whether two masses are enough
    # 130: what a report shows of a view is said by templates; 10: how a command answers, which each had
    # 16: units in which a machine is seen; colours of shafts; 15: gains, sweeps and loops of chains
    # 15: the lower bound of a start time
    "views": (5460, 19, 6, 0),
}


def modules() -> dict[str, Path]:
    """All modules of the three roots by dotted name."""
    found = {}
    for source in SOURCES:
        for path in (ROOT / source).rglob("*.py"):
            parts = path.relative_to(ROOT / source).with_suffix("").parts
            found[".".join(parts).removesuffix(".__init__")] = path
    return found


MODULES = modules()


@cache
def tree(name: str) -> ast.Module:
    """A module's syntax tree; parsed by the worker that asks, not by each that collects this file."""
    return ast.parse(MODULES[name].read_text(encoding="utf-8"))


def imported(name: str, node: ast.AST) -> set[str]:
    """Modules of the house that an import statement in module `name` names."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names} & set(MODULES)
    if not isinstance(node, ast.ImportFrom):
        return set()
    base = node.module or ""
    targets = {f"{base}.{a.name}" if f"{base}.{a.name}" in MODULES else base for a in node.names}
    return targets & (set(MODULES) - {name})


@cache
def graph() -> dict[str, set[str]]:
    """What each module imports: at the top, within functions, for type checkers only."""
    return {name: set().union(*(imported(name, node) for node in ast.walk(tree(name)))) for name in MODULES}


def room(name: str) -> str:
    """The folder of src/softstart in which a module stands."""
    parts = MODULES[name].relative_to(ROOT / "src" / "softstart").parts
    return parts[0] if len(parts) > 1 else "(top)"


OWN = [name for name in MODULES if name.split(".")[0] == "softstart"]
ROOMS = {room(name) for name in OWN}


def measured(one: str) -> tuple[int, int, int, int]:
    """Lines, files, modules with a single importer, imports inside functions of a room."""
    importers = Counter(target for targets in graph().values() for target in targets)
    names = [name for name in OWN if room(name) == one]
    kinds = ast.FunctionDef | ast.AsyncFunctionDef
    functions = (node for name in names for node in ast.walk(tree(name)) if isinstance(node, kinds))
    inner = {id(n) for f in functions for n in ast.walk(f) if isinstance(n, ast.Import | ast.ImportFrom)}
    lines = sum(len(MODULES[name].read_text(encoding="utf-8").splitlines()) for name in names)
    return lines, len(names), sum(importers[name] == 1 for name in names), len(inner)


def test_every_room_has_a_budget() -> None:
    assert set(BUDGET) == ROOMS


@pytest.mark.parametrize("one", sorted(BUDGET))
def test_a_room_keeps_its_budget(one: str) -> None:
    over = [
        f"{now} {what} where {most} are allowed"
        for what, now, most in zip(
            ("lines", "files", "modules with one importer", "imports inside functions"),
            measured(one),
            BUDGET[one],
            strict=True,
        )
        if now > most
    ]
    assert not over, f"{one}: {'; '.join(over)}: make it simpler, or raise the number with a reason"


def test_no_module_reaches_itself() -> None:
    """No circle of imports, even through functions and types."""
    left = {name: set(targets) for name, targets in graph().items()}
    while free := [name for name, targets in left.items() if not targets & left.keys()]:
        for name in free:
            del left[name]
    # what is left are circles and what imports them; drop what nothing left imports
    while free := [n for n in left if not any(n in targets for m, targets in left.items() if m != n)]:
        for name in free:
            del left[name]
    assert not left, f"these import one another: {', '.join(sorted(left))}"
