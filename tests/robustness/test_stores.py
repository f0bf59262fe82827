"""Damaged stores and kills: results on disk give the right numbers or a sentence, whatever happens to them.

    python tests/robustness/test_stores.py --damages 200 --kills 60 --seed 1

Damages: a small sweep, tuning and limit curve are computed once. Each time a copy is damaged (bits flipped,
files cut, emptied, lengthened, deleted, exchanged, taken from another sweep, replaced by a folder, a pipe or
a link) and the same call made again in a process of its own, twice. The numbers must be those of the
undamaged store, to the bit, or the store must be refused in a sentence; after the first call nothing is
damaged any more.

Kills: commands with --out are ended at random instants by KILL, TERM or INT, several times in one folder.
TERM and INT must end them in time, with a sentence and nothing left behind; the same command then goes on
to the numbers of an undisturbed run, and what KILL left is gone.

Prints a line for each violation and at the end the counts; the exit code is 1 if there is a violation. Under
pytest a small number of each is tried. Needs Linux (/proc).
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray  # noqa: F401 - before the first fork
import zarr  # noqa: F401

from softstart import Drive, InputError, pareto, records, simulate, sweep, tune
from softstart.errors import DamagedWarning

LIMIT = 10.0  # s: longer is a hang; more on a machine that does much else (--limit)
CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
GRID = {
    "gap": np.linspace(0.25, 4.0, 6),
    "load_inertia": np.linspace(0.07, 0.35, 4),
    "controller": ["ramp", "direct"],
}
CHUNK = 4  # starts
MEMBER = "SOFTSTART_ROBUSTNESS"  # in the environment of a killed command and of all that it starts

# damages ------------------------------------------------------------------------------------------------

Counts = Counter[str]
Answer = dict[str, Any]  # "numbers": a digest of all results; "before", "done": parts; "told": sentences


def swept(place: Path, drive: Drive = CRANE) -> Answer:
    """The sweep in `place`."""
    told: list[Any] = []
    found = sweep(drive, None, GRID, to=place / "a.zarr", chunk=CHUNK, workers=1, progress=told.append)
    numbers = {str(name): found[name].values.tolist() for name in (*found.data_vars, *found.coords)}
    units = {str(name): dict(found[name].attrs) for name in found.data_vars}
    return {"numbers": repr((numbers, units)), "computed": told[-1].done - told[0].before}


def tuned(place: Path) -> Answer:
    """The tuning in `place`."""
    options = {
        "free": ["torque"],
        "certified": False,
        "workers": 1,
        "generations": 3,
        "population": 8,
        "restarts": 3,
    }
    found = tune(CRANE, "reduced-first-stage", ["1x"], ["1x", "2x"], save_to=place / "a.sqlite", **options)
    return {"numbers": repr({**found.summary(), "seconds": 0, "starts": 0}), "computed": found.starts}


def limited(place: Path) -> Answer:
    """The limit curve in `place`."""
    times = [0.2, 0.2883042, 0.31, 0.33]
    found = pareto(CRANE, times, terminal="synchronous", controllers=["direct"], save_to=place / "a.sqlite")
    points = [{**point.summary(), "seconds": 0} for point in found.points]
    return {"numbers": repr((points, [one.summary() for one in found.controllers])), "computed": 0}


KINDS = {"sweep": swept, "tune": tuned, "pareto": limited}


def flipped(file: Path, chance: random.Random, bits: int = 1) -> None:
    """Single bits."""
    content = bytearray(file.read_bytes())
    for _ in range(bits if content else 0):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    file.write_bytes(content)


def blanked(file: Path, chance: random.Random) -> None:
    """A block of zeros, as after a power failure."""
    content = bytearray(file.read_bytes())
    first = chance.randrange(len(content) + 1)
    last = min(len(content), first + chance.randrange(1, 512))
    content[first:last] = bytes(last - first)
    file.write_bytes(content)


def cut(file: Path, chance: random.Random) -> None:
    """Truncated."""
    os.truncate(file, chance.randrange(file.stat().st_size or 1))


def lengthened(file: Path, chance: random.Random) -> None:
    """With more at its end."""
    file.write_bytes(file.read_bytes() + chance.randbytes(chance.randrange(1, 40)))


def exchanged(file: Path, chance: random.Random) -> None:
    """With another file of the store."""
    home = next(one for one in file.parents if one.name == "store")
    others = [one for one in home.rglob("*") if one.is_file() and one != file]
    if others:
        other = chance.choice(others)
        content = file.read_bytes()
        file.write_bytes(other.read_bytes())
        other.write_bytes(content)


def replaced(file: Path, chance: random.Random) -> None:
    """Something that is no file."""
    file.unlink()
    kind = chance.choice([Path.mkdir, os.mkfifo, "nowhere", file.name])
    if isinstance(kind, str):
        file.symlink_to(kind)
    else:
        kind(file)


def foreign(file: Path, chance: random.Random) -> None:
    """The file of the same name of another computation."""
    home = next(one for one in file.parents if (one / "store").is_dir())
    other = home / "other" / file.relative_to(home / "store")
    if other.is_file():
        shutil.copyfile(other, file)


def removed(file: Path, chance: random.Random) -> None:
    """Deleted, or its whole folder."""
    if chance.random() < 0.2 and file.parent.name != "store":
        shutil.rmtree(file.parent)
    else:
        file.unlink()


def sealed_off(file: Path, chance: random.Random) -> None:
    """Without rights (which root has all the same)."""
    file.chmod(0)


DAMAGES: dict[Callable[..., None], int] = {
    flipped: 6, cut: 2, removed: 2, exchanged: 3, foreign: 2, replaced: 2, lengthened: 1, blanked: 2,
    sealed_off: 1,
}  # fmt: skip


def apart(work: Callable[[Path], Answer], place: Path, limit: float = 300.0) -> Answer:
    """`work(place)` in a fork of this process, which never used threads; why it failed under "failure"."""
    answer = place / "answer"
    child = os.fork()
    if not child:
        signal.alarm(int(limit))
        try:
            with warnings.catch_warnings(record=True, action="always") as told:
                try:
                    given = work(place / "store")
                except InputError as error:
                    given = {"refused": list(error.sentences)}
                given["told"] = [str(one.message) for one in told if one.category is DamagedWarning]
        except BaseException:
            given = {"failure": traceback.format_exc()}
        answer.write_bytes(pickle.dumps(given))
        os._exit(0)
    begin = time.monotonic()
    _, status = os.waitpid(child, 0)
    given = (
        pickle.loads(answer.read_bytes())
        if status == 0
        else {"failure": f"a hang or crash: wait status {status}"}
    )
    return {"seconds": time.monotonic() - begin, **given}


def damaged(
    count: int, chance: random.Random, home: Path, counts: Counter[str], limit: float
) -> Iterator[str]:
    """Damage stores; the violations."""
    simulate(CRANE, "ramp")  # compiled before the first fork
    simulate(records(CRANE, gap=[0.5, 2.0]), "reduced-first-stage")
    true = {}
    for kind, work in KINDS.items():
        place = home / kind
        (place / "store").mkdir(parents=True)
        true[kind] = apart(work, place)
        assert "numbers" in true[kind], true[kind]
        shutil.copytree(place / "store", place / "pristine")
        shutil.rmtree(place / "store")
        (place / "store").mkdir()
    apart(lambda place: swept(place, CRANE.replace(damping=1.0)), home / "sweep")
    (home / "sweep" / "store").rename(home / "sweep" / "other")
    for number in range(count):
        kind = chance.choice(["sweep", "sweep", "tune", "pareto"])
        place, work = home / kind, KINDS[kind]
        shutil.rmtree(place / "store", ignore_errors=True)
        shutil.copytree(place / "pristine", place / "store")
        file = chance.choice(sorted(one for one in (place / "store").rglob("*") if one.is_file()))
        damage = chance.choices(list(DAMAGES), list(DAMAGES.values()))[0]
        what = f"damage {number}, {kind}: {file.relative_to(place / 'store')} {damage.__name__}"
        damage(file, chance)
        first = apart(work, place, limit)
        counts["damages"] += 1
        counts["slowest, s"] = max(counts["slowest, s"], round(first["seconds"]))
        if "refused" in first:
            counts["refused"] += 1
            if not first["refused"][0].startswith(("to = ", "save_to = ")):
                yield f"{what}: refused without naming the store: {first['refused']}"
            continue
        if "failure" in first:
            yield f"{what}: {first['failure']}"
            continue
        counts["named"] += bool(first["told"])
        counts["made again without a word"] += bool(first["computed"] and not first["told"])
        if first["numbers"] != true[kind]["numbers"]:
            yield f"{what}: WRONG NUMBER"
        if (
            kind == "sweep"
            and first["computed"] > 2 * CHUNK
            and damage is not removed
            and damage is not replaced
        ):
            yield f"{what}: {first['computed']} starts were computed again, of {GRID['gap'].size * 8}"
        again = apart(work, place, limit)
        if (
            again.get("numbers") != true[kind]["numbers"]
            or again["told"]
            or again["computed"] > (0 if kind == "sweep" else 10**9)
        ):
            about = {key: value for key, value in again.items() if key != "numbers"}
            yield f"{what}: the store is damaged still: {about}"
        if left := leftovers(place):
            yield f"{what}: left behind: {left}"


def leftovers(place: Path) -> list[str]:
    """Temporary files and folders below."""
    found = (str(one.relative_to(place)) for one in place.rglob("*"))
    return [one for one in found if one.endswith((".part", ".partial", "-journal"))]


# kills --------------------------------------------------------------------------------------------------

GRIDS = "--axis shaft.gap=0.25:4:30 --axis load.inertia=0.07:0.35:100"
COMMANDS = {
    "compare": "compare --controllers direct,ramp --json --out {}",
    "sweep": f"sweep --controller current-limit-feedback {GRIDS} --chunk 200 --json --out {{}}",
    "tune": "tune --controller ramp --gaps 1x --inertias 1x --restarts 2 --no-optimum --json --out {}",
    "pareto": "pareto --set start.target_speed=60 --set motor.torque_lag=0.002 --start-times 0.3:0.4:3 "
    "--controllers direct --json --out {}",
    "optimize": "optimize --start-time 1.2x --set start.target_speed=60 --json --out {}",
}
RUN = (sys.executable, "-c", "import sys; from softstart.cli import main; sys.exit(main())")
PASSING = ("seconds", "computed", "results", "starts", "out")  # in the JSON of a run, and its own


def begun(kind: str, folder: Path, member: str) -> subprocess.Popen[str]:
    """The command in a process of its own; files take what it prints, which no reader holds up."""
    with (folder.parent / "out").open("w") as out, (folder.parent / "err").open("w") as err:
        return subprocess.Popen(
            [*RUN, *COMMANDS[kind].format(folder).split()], stdout=out, stderr=err, text=True,
            env={**os.environ, MEMBER: member},
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509
        )  # fmt: skip


def members(member: str) -> list[int]:
    """Processes that a command has started, itself among them, which have not ended."""
    found = []
    for one in Path("/proc").iterdir():
        try:
            if one.name.isdigit() and f"{MEMBER}={member}\0".encode() in (one / "environ").read_bytes():
                found += (
                    [int(one.name)] if "Z" not in (one / "stat").read_text().rpartition(")")[2][:3] else []
                )
        except OSError:
            continue
    return found


def plain(value: Any) -> Any:
    """JSON without what differs from run to run."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items() if key not in PASSING}
    return [plain(one) for one in value] if isinstance(value, list) else value


def killed(
    count: int, chance: random.Random, home: Path, counts: Counter[str], limit: float
) -> Iterator[str]:
    """Kill commands; the violations."""
    true, lasts = {}, {}
    done = episodes = 0
    while done < count:
        kind = list(COMMANDS)[episodes % len(COMMANDS)]
        episodes += 1
        place = Path(tempfile.mkdtemp(dir=home))
        folder = place / "results"
        if kind not in true:
            begin = time.monotonic()
            assert begun(kind, folder, "none").wait() == 0, (place / "err").read_text()
            lasts[kind] = time.monotonic() - begin
            true[kind] = plain(json.loads((place / "out").read_text()))
            shutil.rmtree(folder)
        for _ in range(min(chance.randint(1, 3), count - done)):
            number = chance.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
            instant = chance.uniform(0.2, 1.0) * lasts[kind]
            what = f"kill {done}, {kind}: {number.name} after {instant:.2f} s"
            member = f"{os.getpid()}-{done}"
            process = begun(kind, folder, member)
            try:
                process.wait(instant)
            except subprocess.TimeoutExpired:
                process.send_signal(number)
                counts["kills"] += 1
                done += 1
            else:
                continue
            begin = time.monotonic()
            try:
                code = process.wait(limit)
            except subprocess.TimeoutExpired:
                yield f"{what}: it did not end within {limit} s"
                process.kill()
                code = process.wait()
            lasted = time.monotonic() - begin
            said = (place / "err").read_text()
            if "Traceback" in said or "a bug in softstart" in said:
                yield f"{what}: {said}"
            if number != signal.SIGKILL:
                counts["slowest end, ms"] = max(counts["slowest end, ms"], round(1000 * lasted))
                if code not in (0, 130, -number):
                    yield f"{what}: exit code {code}: {said}"
                if left := leftovers(place):
                    yield f"{what}: left behind: {left}"
                if left := members(member):
                    yield f"{what}: processes left: {left}"
            while members(member) and time.monotonic() - begin < limit:
                time.sleep(0.05)
            if left := members(member):
                yield f"{what}: processes left after {limit} s: {left}"
        process = begun(kind, folder, "none")
        if process.wait() != 0:
            yield f"{kind} after kills: {(place / 'err').read_text()}"
        elif plain(json.loads((place / "out").read_text())) != true[kind]:
            yield f"{kind} after kills: WRONG NUMBER"
        if left := leftovers(place):
            yield f"{kind} after kills: left behind: {left}"
        shutil.rmtree(place)


def attacked(damages: int, kills: int, seed: int, limit: float) -> tuple[Counter[str], list[str]]:
    """Counts and violations of so many attacks."""
    counts: Counter[str] = Counter()
    violations = []
    with tempfile.TemporaryDirectory() as home:
        for attack, count in ((damaged, damages), (killed, kills)):
            for violation in attack(count, random.Random(seed), Path(home), counts, limit) if count else ():
                print(violation, flush=True)
                violations.append(violation)
    return counts, violations


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc and forks")
def test_damaged_stores_and_kills() -> None:
    """A few of each, in a process of its own: forks and threads do not go together."""
    line = [sys.executable, __file__, "--damages", "24", "--kills", "2", "--limit", "60"]
    done = subprocess.run(line, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def main() -> int:
    """Attack as asked for on the command line."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    for name, usual in (("damages", 200), ("kills", 60), ("seed", 0)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds after which it is a hang")
    asked = parser.parse_args()
    counts, violations = attacked(asked.damages, asked.kills, asked.seed, asked.limit)
    print(
        ", ".join(f"{name}: {count}" for name, count in counts.items()),
        f"violations: {len(violations)}",
        sep="; ",
    )
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
