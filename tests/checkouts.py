"""Compare two checkouts of softstart: every number must be equal to the bit.

    python tests/checkouts.py OLD NEW                   compare all parts
    python tests/checkouts.py OLD NEW --only starts,optima
    python tests/checkouts.py OLD NEW --speed           how long the new one takes, as a ratio
    python tests/checkouts.py --list                    what is compared

Each part runs in a process of its own for each checkout, with that checkout's sources first on the path, and
uses nothing but the names in `softstart.__all__` and the commands, so that it outlives any change of layout.
Floats are compared as hexadecimal text, arrays by a checksum of their bytes, written tables (CSV, TOML)
by their text. Nothing is stored. Computing times and versions are left out. Exit code 1 if anything differs.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import io
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Values = Iterator[tuple[str, Any]]
ROOTS = ("src", "controllers", "studies")
DRIVES = (
    "crane-4amtkf",
    "crane-4amtkf-light",
    "crane-4amtkf-worn",
    "crane-4amtkf-light-worn",
    "nordin-servo-60kw",
    "servo-axis-small",
    "hoist-15kw",
    "conveyor-11kw",
    "long-travel-3kw",
)
CHAINS = ("crane-4-mass", "tractor-like")
CLUTCHES = ("paper-c", "tractor-pto")
LAWS = ("linear", "quadratic-concave", "quadratic-convex", "exponential")
# keys of results that say how long a computer took, or on what it ran
UNCOMPARED = {"seconds", "elapsed", "computing_time", "duration_of_search", "time_taken", "python", "version"}
TRACES = ("t", "phi1", "phi2", "w1", "w2", "u", "T")
CHAIN_TRACES = ("t", "phi", "w", "twist", "T", "u")


def ready(names: Sequence[str] = ()) -> list[str]:
    """The shipped controllers that need no parameter."""
    listed = json.loads(command("controllers", "--json")[1])["controllers"]
    return [one["name"] for one in listed if one["name"] != "profile" and (not names or one["name"] in names)]


def starts() -> Values:
    """Each shipped drive under each controller: one start with its traces, a batch, and the plain twin."""
    from softstart import Drive, simulate
    from softstart.controller import make_controller
    from softstart.drive import library

    for name in sorted({*DRIVES} & {*library.names()}, key=DRIVES.index):  # an older checkout has fewer
        drive = Drive.load(name)
        for controller in ready():
            run = simulate(drive, controller)
            yield f"{name} {controller}", run.summary()
            for trace in TRACES:
                yield f"{name} {controller} {trace}", getattr(run, trace)
            yield f"{name} {controller} events", [(e.time, e.kind) for e in run.events]
            gaps = np.linspace(0.0, 4.0, 9)[:, None] * float(drive.gap)
            inertias = np.geomspace(0.4, 2.5, 5) * float(drive.J2)
            batch = simulate(drive.replace(gap=gaps, load_inertia=inertias), controller, fitted_to=drive)
            for key, values in batch.data_vars.items():
                yield f"{name} {controller} batch {key}", values.values
    drive = Drive.load("crane-4amtkf").replace(torque_lag=0.004, damping=1.5, load_kind="reactive")
    for controller in ready():
        yield f"lag {controller}", simulate(drive, controller).summary()
        made = make_controller(controller)
        if hasattr(made, "as_plain"):
            yield f"plain {controller}", simulate(drive, made.as_plain(drive)).summary()
    for law in ("no-pull", "dead-zone", "modelica"):
        other = drive.replace(contact_law=law, encoder_lines=1024, torque_noise=0.2, computing_delay=5e-4)
        for controller in ready():
            yield f"{law} {controller}", simulate(other, controller).summary()


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
    """One profile for several drives, blind and with a sensor of the contact; a small front."""
    from softstart import Drive, optimize_robust, pareto

    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    drives = [crane.replace(gap=gap) for gap in (0.5, 1.0)]
    yield "blind", optimize_robust(drives, 0.2883042).summary()
    yield "sensor", optimize_robust(drives, 0.2883042, react_to_contact=True).summary()
    yield "front", pareto(crane, [0.26, 0.28, 0.32]).summary()


def chains() -> Values:
    """Shipped chains: vibration, reduction, starts with traces, verification."""
    from softstart import Chain, natural_vibration, reduce_chain, simulate, verify_on_chain

    for name in CHAINS:
        chain = Chain.load(name)
        yield f"{name} toml", chain.to_toml()
        yield f"{name} vibration", natural_vibration(chain).summary()
        for method in ("lever", "modal"):
            yield f"{name} {method}", outcome(lambda c=chain, m=method: reduce_chain(c, method=m).summary())
        for controller in ready():
            run = outcome(lambda c=chain, k=controller: simulate(c, k))
            if isinstance(run, str):
                yield f"{name} {controller}", run
                continue
            yield f"{name} {controller}", run.summary()
            for trace in CHAIN_TRACES:
                yield f"{name} {controller} {trace}", getattr(run, trace)
    crane = Chain.load("crane-4-mass")
    drive = reduce_chain(crane).to_drive()
    for controller in ("direct", "ramp"):
        yield f"verification {controller}", verify_on_chain(crane, drive, controller).summary()


def machines() -> Values:
    """Shipped clutches under each law and their optimal laws, the shipped engine, linear views."""
    from softstart import Clutch, Drive, Engine, balance, engage, linear_view, optimize_engagement

    for name in CLUTCHES:
        clutch = Clutch.load(name)
        yield f"{name} toml", clutch.to_toml()
        for law in LAWS:
            run = engage(clutch.replace(law=law))
            yield f"{name} {law}", run.summary()
            yield f"{name} {law} traces", run.at(run.t)
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
        ("reduce", "--method", "modal"),
        *(("clutch", name) for name in CLUTCHES),
        ("clutch", "--optimal", "--points", "3"),
        ("balance", "--speed", "4500rpm"),
        ("drives",),
        ("controllers",),
        ("study", "--list"),
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
    from softstart import Chain, Drive, simulate, simulate

    crane = Drive.load("crane-4amtkf")
    chain = Chain.load("crane-4-mass")
    damped = crane.replace(damping=1.5)

    def batch(drive: Drive, starts: int) -> Drive:
        return drive.replace(gap=np.linspace(0.1, 2.0, starts))

    work: dict[str, Callable[[], Any]] = {
        "batch direct": lambda: simulate(batch(crane, 100_000), "direct"),
        "batch direct, damped": lambda: simulate(batch(damped, 10_000), "direct"),
        "start direct": lambda: [simulate(crane, "direct") for _ in range(200)],
        "start ramp with traces": lambda: [simulate(crane, "ramp").T for _ in range(20)],
        "chain direct": lambda: [simulate(chain, "direct") for _ in range(3)],
        "chain ramp": lambda: [simulate(chain, "ramp") for _ in range(3)],
    }
    for name in ready():
        if name != "direct":
            work[f"batch {name}"] = lambda k=name: simulate(batch(crane, 1500), k)
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
            text = run_part((old, new)[which], "speed").communicate()[0]
            for label, value in map(json.loads, text.splitlines()):
                took = float.fromhex(value)
                least[which][label] = min(took, least[which].get(label, took))
    for label, before in least[0].items():
        print(f"{label:28} {before:9.4f} s {least[1][label]:9.4f} s  ratio {before / least[1][label]:.3f}")
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


def frozen(value: Any) -> Any:
    """`value` as JSON in which equal text means equal bits."""
    if isinstance(value, str):
        with contextlib.suppress(ValueError):
            if value.lstrip().startswith("{"):
                return frozen(json.loads(value))
        return value
    if isinstance(value, bool | int | None):
        return value
    if isinstance(value, float):
        return float(value).hex()
    if isinstance(value, np.generic):
        return frozen(value.item())
    if isinstance(value, np.ndarray):
        if value.dtype == object or value.dtype.kind in "US":
            return frozen(value.tolist())
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()[:16]
        about = float(np.nansum(value)).hex() if value.dtype.kind == "f" else ""
        return f"{value.dtype} {value.shape} {digest} sum {about}"
    if isinstance(value, Mapping):
        return {str(k): frozen(v) for k, v in value.items() if str(k) not in UNCOMPARED}
    if isinstance(value, list | tuple):
        return [frozen(one) for one in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return frozen({f.name: getattr(value, f.name) for f in dataclasses.fields(value)})
    return str(value)


def run_part(checkout: Path, part: str) -> subprocess.Popen[str]:
    """Start one part on one checkout; its standard output holds one JSON line for each value."""
    path = os.pathsep.join(str(checkout / root) for root in ROOTS)
    environment = os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "100"}
    words = [sys.executable, str(Path(__file__).resolve()), "--part", part]
    return subprocess.Popen(words, env=environment, cwd="/", stdout=subprocess.PIPE, text=True)


def differences(old: Any, new: Any, where: str = "") -> Iterator[str]:
    """The places at which two frozen values differ."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in {**old, **new}:
            if key not in old or key not in new:
                yield f"{where}.{key}: only in the {'old' if key in old else 'new'} checkout"
            else:
                yield from differences(old[key], new[key], f"{where}.{key}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (one, other) in enumerate(zip(old, new, strict=True)):
            yield from differences(one, other, f"{where}[{index}]")
    elif old != new:
        yield f"{where}: {_shown(old)} -> {_shown(new)}"


def _shown(value: Any) -> str:
    text = str(value)
    with contextlib.suppress(ValueError):
        if isinstance(value, str) and "0x" in value and "sum" not in value:
            return repr(float.fromhex(value))
    return text if len(text) < 300 else text[:300] + " ..."


def compare(old: Path, new: Path, parts: Sequence[str]) -> int:
    """Run the parts on both checkouts, side by side, and print what differs; returns how many do."""
    bad = total = 0
    for part in parts:
        begun = time.monotonic()
        runs = [run_part(checkout, part) for checkout in (old, new)]
        texts = [run.communicate()[0] for run in runs]
        for checkout, run in zip((old, new), runs, strict=True):
            if run.returncode != 0:
                print(f"{part}: failed on {checkout} with exit code {run.returncode}")
                bad += 1
        found = [dict(json.loads(line) for line in text.splitlines()) for text in texts]
        differing = [
            f"{part}: {label}{place}"
            for label in {**found[0], **found[1]}
            for place in differences(found[0].get(label), found[1].get(label))
        ]
        for line in differing[:40]:
            print(line)
        if len(differing) > 40:
            print(f"{part}: and {len(differing) - 40} more")
        bad += len(differing)
        total += len(found[0])
        took = time.monotonic() - begun
        print(f"{part}: {len(found[0])} results, {len(differing)} differences, {took:.0f} s", flush=True)
    print(f"{total} results compared, {bad or 'none'} different")
    return bad


def main() -> int:
    """Read the command line; see the module."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("old", nargs="?", type=Path)
    parser.add_argument("new", nargs="?", type=Path)
    parser.add_argument("--only", default=",".join(PARTS), help="parts, with commas between")
    parser.add_argument("--speed", action="store_true", help="compare times instead of numbers")
    parser.add_argument("--list", action="store_true", help="what is compared")
    parser.add_argument("--part", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.part:
        out = sys.stdout
        with contextlib.redirect_stdout(sys.stderr):
            for label, value in (PARTS | {"speed": speed})[given.part]():
                out.write(json.dumps([label, frozen(value)]) + "\n")
        return 0
    if given.list:
        for name, part in PARTS.items():
            print(f"{name:10} {(part.__doc__ or '').strip()}")
        return 0
    if given.old is None or given.new is None:
        parser.error("give two checkouts: OLD NEW")
    unknown = [part for part in given.only.split(",") if part not in PARTS]
    if unknown:
        parser.error(f"--only: no part {', '.join(unknown)}; there are {', '.join(PARTS)}")
    if given.speed:
        return race(given.old.resolve(), given.new.resolve())
    return int(compare(given.old.resolve(), given.new.resolve(), given.only.split(",")) > 0)


if __name__ == "__main__":
    sys.exit(main())
