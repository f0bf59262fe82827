"""Compare two checkouts of softstart, number by number.

    python tests/checkouts.py OLD NEW                   every number must be equal
    python tests/checkouts.py OLD NEW --rtol 1e-9       where arithmetic changes
    python tests/checkouts.py OLD NEW --only starts optima
    python tests/checkouts.py OLD NEW --renamed tests/renames.toml

Each part runs in a process of its own for each checkout, with that checkout's sources first on the path, and
uses nothing but the names in `softstart.__all__` and the commands, so that it outlives any change of layout.
A difference is relative to the value, or to the largest of the array that it stands in, or to 1e-3 in SI
units if that is more. Traces are taken at the same 101 instants of both runs; texts and written tables (CSV,
TOML) are compared number by number too. Every larger difference is listed, the largest first, those of one
array in one line. Computing times and versions are left out. Exit code 1 if any is listed.

`--renamed TABLE` names a TOML file with the tables `json` (keys of results), `parameters` (of controllers)
and `python` (names of the API), each `old = "new"`; "" is a key that is gone. This file uses the new names;
the old checkout is called by the old ones. Texts with other words and equal numbers are then counted only.
A checkout with a `.venv` of its own runs in that, with its entry points.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import io
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

Values = Iterator[tuple[str, Any]]
Compared = Iterator[tuple[str, Any, Any, float]]
CHAINS, CLUTCHES = ("crane-4-mass", "tractor-like"), ("paper-c", "tractor-pto")
# keys of results that say how long a computer took, or on what it ran
UNCOMPARED = {"seconds", "elapsed", "computing_time", "duration_of_search", "time_taken", "python", "version"}
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
SMALL = 1e-3  # smaller values are compared as if they were so large


def listed(command_name: str) -> list[str]:
    """The names of the shipped drives, or of the controllers that need no parameter."""
    found = json.loads(command(command_name, "--json")[1])[command_name]
    return [one["name"] for one in found if one["name"] != "profile"]


def run_of(label: str, start: Callable[[], Any]) -> Values:
    """Summary, events and traces of one start, or its refusal."""
    run = outcome(start)
    yield label, run if isinstance(run, str) else run.summary()
    if not isinstance(run, str):
        yield f"{label} events", [[event.time, event.kind] for event in run.events]
        # up to the end, which may differ in its last digits, and off the instants at which controllers act
        yield f"{label} traces", run.at(np.linspace(0.0, 0.99731 * float(f"{run.end_time:.6g}"), 101))


def starts() -> Values:
    """Each drive and chain under each controller: a start with its traces; of drives also a batch of 45."""
    from softstart import Chain, Drive, simulate

    for name in listed("drives"):
        drive = Drive.load(name)
        gaps, inertias = np.linspace(0.0, 4.0, 9) * drive.gap, np.geomspace(0.4, 2.5, 5) * drive.J2
        others = [drive.replace(gap=float(g), load_inertia=float(J2)) for g in gaps for J2 in inertias]
        for controller in listed("controllers"):
            label = f"{name} {controller}"
            yield from run_of(label, lambda d=drive, k=controller: simulate(d, k))
            for key, values in simulate(others, controller, fitted_to=drive).data_vars.items():
                yield f"{label} batch {key}", values.values
    for name in CHAINS:
        chain = Chain.load(name)
        for controller in listed("controllers"):
            yield from run_of(f"{name} {controller}", lambda c=chain, k=controller: simulate(c, k))
    drive = Drive.load("crane-4amtkf").replace(torque_lag=0.004, damping=1.5, load_kind="reactive")
    for law in ("no-pull", "dead-zone", "modelica"):
        other = drive.replace(contact_law=law, encoder_lines=1024, torque_noise=0.2, computing_delay=5e-4)
        for controller in listed("controllers"):
            yield from run_of(f"{law} {controller}", lambda d=other, k=controller: simulate(d, k))


def optima() -> Values:
    """Optimal starts for every terminal and limit, verdicts on too short a time, several drives."""
    from softstart import Drive, optimize, pareto

    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    lagging = crane.replace(torque_lag=0.005)
    cases: list[tuple[str, Drive, float | None, dict[str, Any]]] = [
        ("program", crane, 0.2522662, {}),
        ("steady", crane, 0.30, {"terminal": "steady"}),
        ("reached", crane, 0.26, {"terminal": "reached"}),
        ("damped", crane.replace(damping=2.0), 0.28, {}),
        ("rate", lagging.replace(torque_rate=2000.0, load_kind="reactive"), 0.33, {}),
        ("curve", crane, 0.32, {"torque_speed": [(0.0, 62.0), (40.0, 62.0), (80.0, 40.0)]}),
        ("smooth", crane, 0.30, {"smoothness": 1e-4}),
        ("heat", crane, 0.30, {"minimise": "heat", "k_dyn": 1.0}),
        ("quickest", crane, None, {"minimise": "start_time", "k_dyn": 1.2}),
        ("servo", Drive.load("servo-axis-small"), 0.10, {}),
        ("too short, lag", lagging, 0.22, {}),
        ("several", crane, 0.2883042, {"scenarios": [crane.replace(gap=1.0)]}),
    ]
    for label, drive, start_time, terms in cases:
        best = outcome(lambda d=drive, t=start_time, o=terms: optimize(d, t, **o))
        yield label, best if isinstance(best, str) else best.summary()
        if not isinstance(best, str) and best.profile is not None:
            yield f"{label} profile", [best.profile.time, best.profile.torque]
    yield "front", pareto(crane, [0.26, 0.28, 0.32]).summary()


def commands() -> Values:
    """Each command's --json, and the tables and parameter files that it writes with --out."""
    crane = ("--set", "start.target_speed=60")
    lines: list[tuple[str, ...]] = [
        *(("compare", name) for name in listed("drives")),
        ("simulate", "crane-4amtkf", "--controller", "ramp", "--param", "time=200 ms"),
        ("optimize", "--start-time", "1.2x", *crane),
        ("optimize", "--start-time", "0.9x", *crane),
        ("pareto", "--start-times", "1.1x,1.3x", "--controllers", "direct,ramp", *crane),
        ("tune", "--controller", "ramp", "--gaps", "0.5", "--inertias", "5J1", "--no-optimum"),
        ("sweep", "--controller", "ramp", "--axis", "shaft.gap=0.5:2:4"),
        *(("linear", "--controller", name) for name in listed("controllers")),
        *(("reduce", name) for name in CHAINS),
        ("reduce", "--verify", "direct,shaped"),
        *(("clutch", name) for name in CLUTCHES),
        ("clutch", "--optimal", "--points", "3"),
        ("balance", "--speed", "4500rpm"),
        ("study", "paper-b"),
        ("simulate", "crane-4amtkf", "--controller", "ramp", "--set", "shaft.gap=-1"),
    ]  # fmt: skip
    for words in lines:
        label = " ".join(words)
        yield label, command(*words, "--json")
        with tempfile.TemporaryDirectory() as folder:
            command(*words, "--out", f"{folder}/out")
            for path in sorted(Path(folder).rglob("*")):
                if path.suffix in (".csv", ".toml", ".c"):
                    yield f"{label} > {path.name}", path.read_text()


PARTS: dict[str, Callable[[], Values]] = {part.__name__: part for part in (starts, optima, commands)}


def outcome(work: Callable[[], Any]) -> Any:
    """What `work` returns, or the refusal as text."""
    try:
        return work()
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def command(*words: str) -> tuple[int, str]:
    """Exit code and standard output of a command (bad input: its sentence), run in this process."""
    from softstart.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(list(words))
    return code, out.getvalue() if code in (0, 3) else err.getvalue()


def plain(value: Any) -> Any:
    """`value` as JSON: floats keep all their bits."""
    if isinstance(value, str) and value.lstrip().startswith("{"):
        with contextlib.suppress(ValueError):
            return plain(json.loads(value))
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items() if str(k) not in UNCOMPARED}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value if isinstance(value, str | bool | int | float | None) else str(value)


def table_of_names(path: Path | None) -> dict[str, str]:
    """Old names and the new ones, of keys, parameters and Python."""
    tables = {} if path is None else tomllib.loads(path.read_text(encoding="utf-8"))
    # `Run.told` is the attribute `told`, whatever class it is of
    return {
        old.rpartition(".")[2]: new.rpartition(".")[2]
        for table in tables.values()
        for old, new in table.items()
    }


def call_by_old_names(names: dict[str, str]) -> None:
    """Define the parts again as an older checkout knows them: each new name of the API is the old one."""
    for function in (run_of, starts, optima, commands):
        source = inspect.getsource(function)
        for old, new in names.items():
            source = re.sub(rf"\b{new}\b", old, source) if new else source
        exec(compile(source, function.__name__, "exec"), globals())
    PARTS.update(starts=globals()["starts"], optima=globals()["optima"], commands=globals()["commands"])


def results_of(checkout: Path, part: str, renamed: Path | None = None) -> dict[str, Any]:
    """The results of one part on a checkout; of an older one by the old names of the table `renamed`."""
    path = os.pathsep.join(str(checkout.resolve() / root) for root in ("src", "controllers", "studies"))
    environment = os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "100"}
    python = checkout.resolve() / ".venv" / "bin" / "python"
    words = [
        str(python if python.exists() else sys.executable),
        str(Path(__file__).resolve()),
        "--part",
        part,
    ]
    words += [] if renamed is None else ["--renamed", str(renamed.resolve())]
    run = subprocess.run(words, env=environment, cwd="/", stdout=subprocess.PIPE, text=True, check=False)
    found = dict(map(json.loads, run.stdout.splitlines()))
    return found | ({"exit code": f"{run.returncode} on {checkout}"} if run.returncode else {})


def same_form(old: str, new: str, renamed: Mapping[str, str] | None) -> bool:
    """Whether two texts have the same words; or, with names `renamed`, as many numbers between theirs."""
    if renamed is None:
        return NUMBER.split(old) == NUMBER.split(new)
    return len(NUMBER.findall(old)) == len(NUMBER.findall(new)) and "(none)" not in (old, new)


def numeric(value: Any) -> bool:
    """Whether `value` is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def by_new_keys(old: dict[str, Any], new: dict[str, Any], renamed: Mapping[str, str]) -> dict[str, Any]:
    """`old` with the keys of `new`, where the table says which those are; without those that are gone.

    >>> by_new_keys({"doubts": 1, "k_dyn": 2, "gone": 3}, {"warnings": 1}, {"doubts": "warnings", "gone": ""})
    {'warnings': 1, 'k_dyn': 2}
    """
    keys = {key: key if key in new else renamed.get(key, key) for key in old}
    return {keys[key]: value for key, value in old.items() if keys[key]}


def compared(
    old: Any, new: Any, place: str = "", scale: float = SMALL, renamed: Mapping[str, str] | None = None
) -> Compared:
    """Each value: its place, the old one, the new one, and how large the difference is in relative terms.

    Texts that differ in words alone are -1 apart where names are `renamed`.

    >>> [one[3] for one in compared([0.0, 100.0], [0.5, 100.0])]
    [0.005, 0.0]
    >>> [one[3] for one in compared({"told": "2 rad"}, {"drive": "2 rad!"}, renamed={"told": "drive"})]
    [-1.0, 0.0]
    """
    if isinstance(old, dict) and isinstance(new, dict):
        old = by_new_keys(old, new, renamed or {})
        for key in {**old, **new}:
            values = old.get(key, "(none)"), new.get(key, "(none)")
            yield from compared(*values, f"{place}.{key}", renamed=renamed)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        largest = max((abs(v) for v in (*old, *new) if numeric(v)), default=0.0)
        for index, (one, other) in enumerate(zip(old, new, strict=True)):
            yield from compared(one, other, f"{place}[{index}]", max(largest, SMALL), renamed)
    elif numeric(old) and numeric(new):
        yield place, old, new, abs(old - new) / max(scale, abs(old), abs(new))
    elif isinstance(old, str) and isinstance(new, str) and same_form(old, new, renamed):
        if NUMBER.split(old) != NUMBER.split(new):
            yield place, old, new, -1.0
        for one, other in zip(NUMBER.findall(old), NUMBER.findall(new), strict=True):
            yield from compared(float(one), float(other), place)
    else:
        same = old == new or repr(old) == repr(new)  # both are not a number
        yield place, old, new, 0.0 if same else math.inf


def main() -> int:
    """Read the command line, run the parts on both checkouts, print each larger difference."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("checkouts", nargs="*", type=Path, metavar="OLD NEW")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART")
    parser.add_argument("--rtol", type=float, default=0.0, help="relative difference that is no difference")
    parser.add_argument("--renamed", type=Path, metavar="TABLE", help="old and new names, a TOML file")
    parser.add_argument("--part", help=argparse.SUPPRESS)
    given = parser.parse_args()
    names = table_of_names(given.renamed)
    if given.part:
        if names:
            call_by_old_names(names)
        out = sys.stdout
        with contextlib.redirect_stdout(sys.stderr):
            for label, value in PARTS[given.part]():
                out.write(json.dumps([label, plain(value)]) + "\n")
        return 0
    if len(given.checkouts) != 2:
        parser.error("give two checkouts: OLD NEW")
    differing: dict[str, tuple[float, str]] = {}
    for part in given.only:
        with ThreadPoolExecutor() as pool:
            before, after = pool.map(results_of, given.checkouts, (part, part), (given.renamed, None))
        values = list(compared(before, after, part, renamed=names if given.renamed else None))
        above = [one for one in values if not one[3] <= given.rtol]
        reworded = sum(one[3] < 0.0 for one in values)
        line = f"{part}: {len(before)} results, {len(values)} values, {len(above)} differ"
        print(line + (f", {reworded} texts with other words" if reworded else ""), flush=True)
        for place, one, other, size in above:
            line = f"{place}: {str(one)[:200]} -> {str(other)[:200]}"
            name = re.sub(r"\[\d+\]", "", place)
            differing[name] = max(differing.get(name, (-1.0, "")), (size, line))
    for size, line in sorted(differing.values(), reverse=True):
        print(f"{size:9.1e}  {line}")
    return int(bool(differing))


if __name__ == "__main__":
    sys.exit(main())
