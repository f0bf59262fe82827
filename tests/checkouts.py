"""Compare two checkouts of softstart, number by number.

    python tests/checkouts.py OLD NEW                   every number must be equal
    python tests/checkouts.py OLD NEW --rtol 1e-9       where arithmetic changes
    python tests/checkouts.py OLD NEW --only starts optima
    python tests/checkouts.py OLD NEW --speed           how long the new one takes, as a ratio
    python tests/checkouts.py --list                    what is compared

Each part runs in a process of its own for each checkout, with that checkout's sources first on the path, and
uses nothing but the names in `softstart.__all__` and the commands, so that it outlives any change of layout.
A difference is relative to the value, or to the largest of the array that it stands in, or to 1e-3 in SI
units if that is more. Traces are taken at the same 101 instants of both runs; texts and written tables (CSV,
TOML) are compared number by number too. Every larger difference is listed, the largest first, those of one
array in one line. Nothing is stored. Computing times and versions are left out. Exit code 1 if any is listed.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import io
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

Values = Iterator[tuple[str, Any]]
Compared = tuple[str, Any, Any, float]
ROOTS = ("src", "controllers", "studies")
DRIVES = (
    "crane-4amtkf", "crane-4amtkf-light", "crane-4amtkf-worn", "crane-4amtkf-light-worn", "nordin-servo-60kw",
    "servo-axis-small", "hoist-15kw", "conveyor-11kw", "long-travel-3kw",
)  # fmt: skip
CHAINS = ("crane-4-mass", "tractor-like")
CLUTCHES = ("paper-c", "tractor-pto")
LAWS = ("linear", "quadratic-concave", "quadratic-convex", "exponential")
# keys of results that say how long a computer took, or on what it ran
UNCOMPARED = {"seconds", "elapsed", "computing_time", "duration_of_search", "time_taken", "python", "version"}
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
SMALL = 1e-3  # smaller values are compared as if they were so large


def ready() -> list[str]:
    """The shipped controllers that need no parameter."""
    listed = json.loads(command("controllers", "--json")[1])["controllers"]
    return [one["name"] for one in listed if one["name"] != "profile"]


def instants(end: float) -> np.ndarray:
    """Up to the end, which may differ in its last digits, and off the instants at which controllers act."""
    return np.linspace(0.0, 0.99731 * float(f"{end:.6g}"), 101)


def run_of(label: str, start: Callable[[], Any]) -> Values:
    """Summary, events and traces of one start, or its refusal."""
    run = outcome(start)
    if isinstance(run, str):
        yield label, run
        return
    yield label, run.summary()
    yield f"{label} events", [[event.time, event.kind] for event in run.events]
    yield f"{label} traces", run.at(instants(run.end_time))


def starts() -> Values:
    """Each shipped drive under each controller: one start with its traces, and a batch of 45."""
    from softstart import Drive, simulate

    for name in DRIVES:
        drive = Drive.load(name)
        gaps, inertias = np.linspace(0.0, 4.0, 9) * drive.gap, np.geomspace(0.4, 2.5, 5) * drive.J2
        others = [drive.replace(gap=float(g), load_inertia=float(J2)) for g in gaps for J2 in inertias]
        for controller in ready():
            label = f"{name} {controller}"
            yield from run_of(label, lambda d=drive, k=controller: simulate(d, k))
            for key, values in simulate(others, controller, fitted_to=drive).data_vars.items():
                yield f"{label} batch {key}", values.values
    drive = Drive.load("crane-4amtkf").replace(torque_lag=0.004, damping=1.5, load_kind="reactive")
    others = [("lag", drive)]
    for law in ("no-pull", "dead-zone", "modelica"):
        changes = {"contact_law": law, "encoder_lines": 1024, "torque_noise": 0.2, "computing_delay": 5e-4}
        with contextlib.suppress(ValueError):  # a law that one of the two does not have
            others.append((law, drive.replace(**changes)))
    for label, other in others:
        for controller in ready():
            yield from run_of(f"{label} {controller}", lambda d=other, k=controller: simulate(d, k))


def optima() -> Values:
    """Optimal starts by every method, for every terminal, and the verdicts on too short a time."""
    from softstart import Drive, InfeasibleError, optimize

    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    lagging = crane.replace(torque_lag=0.005)
    cases: list[tuple[str, Drive, float | None, dict[str, Any]]] = [
        ("formula", crane, 0.2883042, {}),
        ("program", crane, 0.2522662, {}),
        ("lp", crane, 0.2883042, {"method": "lp"}),
        ("collocation", crane, 0.2883042, {"method": "collocation"}),
        ("steady", crane, 0.30, {"terminal": "steady"}),
        ("reached", crane, 0.26, {"terminal": "reached"}),
        ("reactive", crane.replace(load_kind="reactive"), 0.27, {}),
        ("damped", crane.replace(damping=2.0), 0.28, {}),
        ("lag", lagging, 0.30, {}),
        ("rate", lagging.replace(torque_rate=2000.0, load_kind="reactive"), 0.33, {}),
        ("curve", crane, 0.32, {"torque_speed": [(0.0, 62.0), (40.0, 62.0), (80.0, 40.0)]}),
        ("smooth", crane, 0.30, {"smoothness": 1e-4}),
        ("heat", crane, 0.30, {"minimise": "heat", "k_dyn": 1.0}),
        ("quickest", crane, None, {"minimise": "start_time", "k_dyn": 1.2}),
        ("worn", Drive.load("crane-4amtkf-worn"), 0.50, {}),
        ("servo", Drive.load("servo-axis-small"), 0.10, {}),
        ("too short", crane, 0.20, {}),
        ("too short, lag", lagging, 0.22, {}),
    ]
    for label, drive, start_time, terms in cases:
        try:
            best = optimize(drive, start_time, **terms)
        except InfeasibleError as error:
            yield label, [str(error), error.verdict]
            continue
        except Exception as error:  # a refusal is a result as well
            yield label, f"{type(error).__name__}: {error}"
            continue
        yield label, best.summary()
        if best.profile is not None:
            yield f"{label} profile", [best.profile.time, best.profile.torque]


def robust() -> Values:
    """One profile for several drives; a small front."""
    from softstart import Drive, optimize, pareto

    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    yield "several", optimize(crane, 0.2883042, scenarios=[crane.replace(gap=1.0)]).summary()
    yield "front", pareto(crane, [0.26, 0.28, 0.32]).summary()


def chains() -> Values:
    """Shipped chains: vibration, reduction, starts with traces, verification."""
    import softstart
    from softstart import Chain, natural_vibration, reduce_chain, verify_on_chain

    start: Any = getattr(softstart, "simulate_chain", softstart.simulate)  # one word for both, later
    for name in CHAINS:
        chain = Chain.load(name)
        yield f"{name} toml", chain.to_toml()
        yield f"{name} vibration", natural_vibration(chain).summary()
        yield f"{name} reduced", outcome(lambda c=chain: reduce_chain(c).summary())
        for controller in ready():
            yield from run_of(f"{name} {controller}", lambda c=chain, k=controller: start(c, k))
    crane = Chain.load("crane-4-mass")
    terms: dict[str, Any] = {"method": "modal"} if "method" in signature(reduce_chain).parameters else {}
    drive = reduce_chain(crane, **terms).to_drive()  # the lever rule stood beside it once
    for controller in ("direct", "ramp"):
        yield f"verification {controller}", verify_on_chain(crane, drive, controller).summary()


def machines() -> Values:
    """Shipped clutches under each law and their optimal laws, the shipped engine, linear views."""
    from softstart import Clutch, Drive, Engine, balance, engage, linear_view
    from softstart_studies.paper_c import optimize_engagement

    for name in CLUTCHES:
        clutch = Clutch.load(name)
        yield f"{name} toml", clutch.to_toml()
        for law in LAWS:
            run = engage(clutch.replace(law=law))
            yield f"{name} {law}", run.summary()
            yield f"{name} {law} traces", run.at(instants(run.t[-1]))
    yield "optimal laws", optimize_engagement(Clutch.load("paper-c"), points=4).summary()
    engine = Engine.load("vaz-11113")
    yield "engine toml", engine.to_toml()
    yield "balance", balance(engine).summary()
    for controller in ready():
        yield f"linear {controller}", linear_view(Drive.load("crane-4amtkf"), controller).summary()


def tuning() -> Values:
    """Tuned gains and sweeps on small grids, on one process and on two."""
    from softstart import Drive, sweep, tune

    crane = Drive.load("crane-4amtkf")
    for workers in (1, 2):
        found = tune(
            crane, "shaped", gaps=[0.5, 1.0], inertias=["5 J1", "2 J1"], generations=12, restarts=2,
            tolerances={"stiffness": "10 %"}, certified=False, workers=workers,
        )  # fmt: skip
        yield f"tune {workers}", found.summary()
    found = tune(crane, "ramp", gaps=[0.5], inertias=["5 J1"], generations=10, restarts=1, workers=1)
    yield "tune with the optimum", found.summary()
    for workers in (1, 2):
        grid = {"gap": [0.0, 0.5, 1.0], "controller": ["ramp", "shaped"], "load.inertia": [0.07, 0.175]}
        results = sweep(crane, None, grid, workers=workers, chunk=5)
        for key, values in results.data_vars.items():
            yield f"sweep {workers} {key}", values.values


def commands() -> Values:
    """Each command's --json, and the tables and parameter files that it writes with --out."""
    crane = ("--set", "start.target_speed=60")
    lines: list[tuple[str, ...]] = [
        *(("compare", name) for name in DRIVES),
        ("compare", "--fitted-to", "crane-4amtkf-worn"),
        ("simulate", "crane-4amtkf", "--controller", "ramp", "--param", "time=200 ms"),
        ("optimize", "--start-time", "1.2x", *crane),
        ("optimize", "--start-time", "0.9x", *crane),
        ("pareto", "--start-times", "1.1x,1.3x", "--controllers", "direct,ramp", *crane),
        ("tune", "--controller", "ramp", "--gaps", "0.5,1", "--inertias", "5J1", "--restarts", "1",
         "--no-optimum"),
        ("sweep", "--controller", "ramp", "--axis", "shaft.gap=0.5:2:4"),
        ("linear", "--controller", "state-feedback"),
        ("linear", "--controller", "current-limit-feedback"),
        *(("reduce", name) for name in CHAINS),
        ("reduce", "--verify", "direct,shaped"),
        *(("clutch", name) for name in CLUTCHES),
        ("clutch", "--optimal", "--points", "3"),
        ("balance", "--speed", "4500rpm"),
        ("drives",),
        ("controllers",),
        ("study",),
        ("study", "paper-b"),
        ("compare", "crane-4amtk"),
        ("simulate", "crane-4amtkf", "--controller", "ramp", "--set", "shaft.gap=-1"),
    ]  # fmt: skip
    for words in lines:
        label = " ".join(words)
        yield label, command(*words, "--json")
        if words[0] in ("drives", "controllers", "study"):
            continue
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "out"
            command(*words, "--out", str(out))
            for path in sorted(out.rglob("*")) if out.is_dir() else ():
                if path.suffix in (".csv", ".toml", ".c"):
                    yield f"{label} > {path.name}", path.read_text()
                elif path.is_file() and ".zarr" not in str(path):
                    yield f"{label} > {path.name}", "there"


PARTS: dict[str, Callable[[], Values]] = {
    part.__name__: part for part in (starts, optima, robust, chains, machines, tuning, commands)
}


def speed() -> Values:
    """Least time in s of three runs of each: batches of starts, single starts, chains."""
    import softstart
    from softstart import Chain, Drive, simulate

    start: Any = getattr(softstart, "simulate_chain", simulate)
    crane, chain = Drive.load("crane-4amtkf"), Chain.load("crane-4-mass")
    damped = crane.replace(damping=1.5, torque_lag=0.002)
    work: dict[str, Callable[[], Any]] = {
        "start direct": lambda: [simulate(crane, "direct") for _ in range(200)],
        "chain ramp": lambda: [start(chain, "ramp") for _ in range(3)],
    }
    for label, drive in (("batch", crane), ("batch damped", damped)):
        drives = [drive.replace(gap=gap) for gap in np.linspace(0.1, 2.0, 500).tolist()]
        for name in ready():
            work[f"{label} {name}"] = lambda d=drives, k=name, f=drive: simulate(d, k, fitted_to=f)
    for label, run in work.items():
        run()  # compiled and loaded
        times = []
        for _ in range(3):
            begun = time.perf_counter()
            run()
            times.append(time.perf_counter() - begun)
        yield label, min(times)


def race(old: Path, new: Path, rounds: int = 4) -> int:
    """Run `speed` on both checkouts in turns and print old over new: above 1, the new one is faster."""
    least: list[dict[str, float]] = [{}, {}]
    for turn in range(rounds):
        for which in (0, 1) if turn % 2 else (1, 0):
            for label, took in results_of([(old, new)[which]], "speed")[0].items():
                least[which][label] = min(took, least[which].get(label, took))
    for label, before in least[0].items():
        print(f"{label:32} {before:9.4f} s {least[1][label]:9.4f} s  ratio {before / least[1][label]:.3f}")
    return 0


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
    if isinstance(value, str):
        with contextlib.suppress(ValueError):
            if value.lstrip().startswith("{"):
                return plain(json.loads(value))
        return value
    if isinstance(value, bool | int | float | None):
        return value
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "": plain(value.ravel().tolist())}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items() if str(k) not in UNCOMPARED}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return plain({f.name: getattr(value, f.name) for f in dataclasses.fields(value)})
    return str(value)


def results_of(checkouts: Sequence[Path], part: str) -> list[dict[str, Any]]:
    """The results of one part on each of the checkouts, which run side by side."""

    def results(checkout: Path) -> dict[str, Any]:
        path = os.pathsep.join(str(checkout / root) for root in ROOTS)
        environment = os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "100"}
        words = [sys.executable, str(Path(__file__).resolve()), "--part", part]
        run = subprocess.run(words, env=environment, cwd="/", stdout=subprocess.PIPE, text=True, check=False)
        found = dict(map(json.loads, run.stdout.splitlines()))
        return found | ({"exit code": f"{run.returncode} on {checkout}"} if run.returncode else {})

    with ThreadPoolExecutor() as pool:
        return list(pool.map(results, checkouts))


def numeric(value: Any) -> bool:
    """Whether `value` is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def compared(old: Any, new: Any, place: str = "", scale: float = SMALL) -> Iterator[Compared]:
    """Each value: its place, the old one, the new one, and how large the difference is in relative terms.

    >>> [one[3] for one in compared([0.0, 100.0], [0.5, 100.0])]
    [0.005, 0.0]
    """
    if isinstance(old, dict) and isinstance(new, dict):
        for key in {**old, **new}:
            yield from compared(old.get(key, "(none)"), new.get(key, "(none)"), f"{place}.{key}")
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield place, f"{len(old)} values", f"{len(new)} values", math.inf
        else:
            largest = max((abs(v) for v in (*old, *new) if numeric(v)), default=0.0)
            for index, (one, other) in enumerate(zip(old, new, strict=True)):
                yield from compared(one, other, f"{place}[{index}]", max(largest, SMALL))
    elif numeric(old) and numeric(new):
        yield place, old, new, abs(old - new) / max(scale, abs(old), abs(new))
    elif isinstance(old, str) and isinstance(new, str) and NUMBER.split(old) == NUMBER.split(new):
        for one, other in zip(NUMBER.findall(old), NUMBER.findall(new), strict=True):
            yield from compared(float(one), float(other), place)
    else:
        same = old == new or repr(old) == repr(new)  # both are not a number
        yield place, old, new, 0.0 if same else math.inf


def compare(old: Path, new: Path, parts: Sequence[str], rtol: float) -> int:
    """Run the parts on both checkouts and print each difference above `rtol`; returns how many there are."""
    listed: dict[str, tuple[float, str, int]] = {}
    for part in parts:
        begun, values, within, above = time.monotonic(), 0, 0.0, 0
        before, after = results_of((old, new), part)
        for place, one, other, size in compared(before, after, part):
            values += 1
            if size <= rtol:
                within = max(within, size)
                continue
            above += 1
            name = re.sub(r"\[\d+\]", "", place)
            largest, line, count = listed.get(name, (-1.0, "", 0))
            if size > largest:
                largest, line = size, f"{place}: {str(one)[:200]} -> {str(other)[:200]}"
            listed[name] = largest, line, count + 1
        took = time.monotonic() - begun
        print(f"{part}: {len(before)} results, {values} values, {above} differ by more than", end=" ")
        print(f"{rtol:g}, the others by {within:.1e} at most, {took:.0f} s", flush=True)
    for size, line, count in sorted(listed.values(), reverse=True):
        print(f"{size:9.1e}  {line}" + (f" (largest of {count})" if count > 1 else ""))
    return len(listed)


def main() -> int:
    """Read the command line; see the module."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("old", nargs="?", type=Path)
    parser.add_argument("new", nargs="?", type=Path)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="parts", metavar="PART")
    parser.add_argument("--rtol", type=float, default=0.0, help="relative difference that is no difference")
    parser.add_argument("--speed", action="store_true", help="compare times instead of numbers")
    parser.add_argument("--list", action="store_true", help="what is compared")
    parser.add_argument("--part", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.part:
        out = sys.stdout
        with contextlib.redirect_stdout(sys.stderr):
            for label, value in (PARTS | {"speed": speed})[given.part]():
                out.write(json.dumps([label, plain(value)]) + "\n")
        return 0
    if given.list:
        for name, part in PARTS.items():
            print(f"{name:10} {(part.__doc__ or '').strip()}")
        return 0
    if given.old is None or given.new is None:
        parser.error("give two checkouts: OLD NEW")
    if given.speed:
        return race(given.old.resolve(), given.new.resolve())
    return int(compare(given.old.resolve(), given.new.resolve(), given.only, given.rtol) > 0)


if __name__ == "__main__":
    sys.exit(main())
