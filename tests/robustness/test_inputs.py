"""Hostile inputs over all commands: each ends soon, with a known exit code and one clear message.

An attack is a command line with the files it needs, drawn from a seed. Wrong is an exit code other than 0, 2,
3 and 130, a traceback or a warning, a hang, a message of more than a screenful, control characters on the
terminal, an option that no command has, files left behind, a number in the JSON that is not finite, and any
answer where only refusal is right. `--size 20`: twenty times as many.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import re
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import click
import pytest

from softstart.balancing import Engine
from softstart.balancing.engine import LIBRARY as ENGINES
from softstart.chain import Chain
from softstart.chain.elements import LIBRARY as CHAINS
from softstart.cli.commands import COMMANDS, cli
from softstart.cli.main import main
from softstart.clutch.model import LIBRARY as CLUTCHES
from softstart.clutch.model import Clutch
from softstart.drive import PARAMETERS, library

CRANE = "crane-4amtkf"
LONGEST = 120.0  # s of one command: a hang
MOST_TEXT = 20_000  # characters that a failed command may print

# The quickest form of each command; hostile words are added to it.
QUICK = {
    "compare": "compare --controllers direct,ramp",
    "simulate": f"simulate {CRANE} --controller ramp",
    "fatigue": "fatigue --controllers direct,ramp --set damping=1",
    "duty": "duty conveyor-11kw --duty travel-crane --controller ramp",
    "optimize": "optimize --start-time 1.2x",
    "pareto": "pareto --start-times 1.2x --controllers direct",
    "tune": "tune --controller ramp --gaps 1x --inertias 1x --only robust --restarts 1 --no-optimum",
    "sweep": "sweep --controller ramp --axis shaft.gap=0.5,1.5",
    "linear": "linear --controller state-feedback",
    "reduce": "reduce --no-starts",
    "clutch": "clutch",
    "balance": "balance",
    "report": "report --json --budget 0 --controllers direct,ramp",
    "sheet": f"sheet {CRANE} --controller ramp",
    "project": "project show nowhere.toml",
    "serve": "serve nowhere.toml --no-browser",
    "init": "init --set load.machine=rotor --set motor.rated_speed=1430rpm --set load.inertia=1",
    "identify": f"identify nowhere.csv --drive {CRANE}",
    "wear": "wear found-2024 found-2026",
    "plan": f"plan {CRANE} --set load.kind=reactive --standard",
    "export": f"export {CRANE} --controller direct --as st --out made",
    "drives": "drives",
    "controllers": "controllers",
    "study": "study",
    "completion": "completion",
}
# they write files or wait for an answer, take a search of minutes, or look for a scheduler
LEFT_OUT = {
    "--out", "--ask", "--netcdf", "--pdf", "--confirm", "--limits", "--optimum", "--worst-case",
    "--scheduler", "--chunk", "--drive",
}  # fmt: skip
PATHS = {
    "drive": [p.path for p in PARAMETERS.values()],
    "chain": [
        p.path.replace(".", "[1].", 1) if t.many else p.path for t in Chain.TABLES for p in t.parameters
    ],
    "clutch": [p.path for t in Clutch.TABLES for p in t.parameters],
    "engine": [p.path for t in Engine.TABLES for p in t.parameters],
}
KIND = {"simulate": "drive", "reduce": "chain", "clutch": "clutch", "balance": "engine"}
SHIPPED: dict[str, Callable[[], str]] = {
    "drive": lambda: library.text(CRANE),
    "chain": lambda: CHAINS.text("crane-4-mass"),
    "clutch": lambda: CLUTCHES.text("paper-c"),
    "engine": lambda: ENGINES.text("vaz-11113"),
}

# Words that a hand, a script or a spreadsheet may put where a value belongs.
WORDS = [
    "", " ", "nan", "inf", "-inf", "1e308", "5e-324", "-1", "0", "-0.0", "1e999", "1" + "0" * 5000, "0x10",
    "1e", "--", "-", ".", ",", ";", "=", "a=b", "0,5", "1,500", "1.234,5", "0,5; 1", "1;;2", ",1", "1:2",
    "0:1:0", "1:2:99999999", "2:1:3", "1x:2x", "0x", "-1x", "1.2X", "nanx", "true", "[1, 2]", "{}", '"1"',
    "0.5 rad", "0.5 m", "50 Hz", "-5 %", "1e300 kN*m", "1 " + "*".join(["m"] * 1000), "1 rad^9",
    "1 " + "(" * 500 + "rad" + ")" * 500, "½", "٣", "1\u00a0rad", "−5", "0.5 рад", "😀", "\u202e5",
    "\x1b[31m5", "5\n6", "\ud800", "a" * 20_000, "../..", "/dev/zero", "/etc/passwd", ".", "~", "ramp",
    "direct,direct", "RAMP", "steady", "heat", "time=0.2", "time=0,2", "time=1e308", "torque=0.5%",
    "0:62,90:40", "0:62;90,5:40", "gap=0.5,1", "shaft.gap=0,5", "gap=1:2:3", "stiffness=10%",
    "load.inertia=1e308", "load.inertia=-1", "gap=1e-300", "__class__", "ramp\x00", "*", "own.py:Own",
    "own.py", "gains.toml", "none.csv", "%s", "{0}", "$(date)",
]  # fmt: skip
# The same as TOML.
LITERALS = [
    "nan", "-inf", "1e308", "5e-324", "-1", "0", "1" + "0" * 5000, "true", "[]", "[1, 2]", "[[1], [2, 3]]",
    "{a = 1}", '""', '"0,5 rad"', '"5 xyzzy"', '"62 N"', "1979-05-27", "0xff", '"\\u0000"', '"\\u001b[31m"',
    '"' + "a" * 9000 + '"', '"1 ' + "*".join(["kg"] * 2000) + '"', "[" * 500 + "]" * 500, "'''\n\n'''",
]  # fmt: skip


@dataclass
class Attack:
    """One command line: its words, the files it needs, and whether only a refusal is right."""

    words: list[str]
    files: dict[str, bytes | Callable[[Path], None]] = field(default_factory=dict)
    refused: bool = False


@cache
def option_names(command: str = "") -> dict[str, bool]:
    """The options of a command, or of all, and whether each is a flag."""
    context = click.Context(cli, **cli.context_settings)
    which = [command] if command else cli.list_commands(context)
    commands = [cli.get_command(context, name) for name in which] + ([] if command else [cli])
    parameters = [one for command in commands for one in command.get_params(context)]
    names = {name: one for one in parameters for name in (*one.opts, *one.secondary_opts)}
    return {name: getattr(one, "is_flag", False) for name, one in names.items() if name[0] == "-"}


# ---- drawing attacks -------------------------------------------------------------------------------------


def options(rng: random.Random) -> Attack:
    """Any options with any words."""
    command = rng.choice(list(QUICK))
    known = {name: flag for name, flag in option_names(command).items() if name not in LEFT_OUT}
    words = QUICK[command].split()
    for _ in range(rng.choice((1, 1, 2, 3))):
        option = rng.choice([*known, rng.choice(("--nosuch", "-x", "--", "--jso"))])
        words += [option] if known.get(option) or rng.random() < 0.03 else [option, rng.choice(WORDS)]
    if rng.random() < 0.2:
        words.insert(1, rng.choice(WORDS))
    return Attack(words, {"own.py": b"raise SystemExit(7)\n", "gains.toml": b"kind = 'robust set'\n"})


def values(rng: random.Random) -> Attack:
    """One key of a machine with a value that it should not have, from the command line."""
    command = rng.choice((*KIND, "compare", "linear", "optimize"))
    path = rng.choice(PATHS[KIND.get(command, "drive")])
    return Attack([*QUICK[command].split(), "--set", f"{path}={rng.choice(WORDS + LITERALS)}", "--json"])


def texts(rng: random.Random) -> Attack:
    """A shipped file, damaged as editors, disks and programs damage files, or with a key or value wrong."""
    command = rng.choice(list(KIND))
    text = SHIPPED[KIND[command]]()
    at = rng.randrange(len(text))
    deep = ".".join(["a"] * rng.choice((30, 3000, 60_000)))
    lines = text.splitlines()
    index = rng.choice([i for i, line in enumerate(lines) if re.match(r"\w+ = ", line)])
    key = lines[index].partition(" =")[0]
    wrong = lines[index].replace(key, rng.choice((key[:-1], key.upper(), f"a.{key}", '"\\u001b"')), 1)
    one = rng.choice((wrong, *(f"{key} = {literal}" for literal in rng.sample(LITERALS, 5))))
    damages: list[str | bytes] = [
        *["\n".join([*lines[:index], one, *lines[index + 1 :]])] * 6,
        text.encode("utf-16"),
        text.encode("utf-8-sig"),
        text.replace("\n", "\r"),
        text[:at] + chr(rng.randrange(0x2FFF)) + text[at:],
        text[:at],
        text.encode() + b"\xff\xfe",
        rng.randbytes(2000),
        "\n" * 100_000,
        text + text,
        f"{text}\n{deep} = 1\n",
        f"{text}\n[{deep}]\n",
        "\n".join(f"key{i} = {i}" for i in range(20_000)) + "\n" + text,
        text + "\n".join(f"\n[table{i}]\nx = 1" for i in range(5_000)),
        text + "x = [" + "0," * 400_000 + "]",
        "name = '" + "x" * 500_000 + "'\n" + text.replace("name =", "title =", 1),
    ]
    damaged = rng.choice(damages)
    words = [command, "mine.toml", *QUICK[command].split()[2:], "--json"]
    return Attack(words, {"mine.toml": damaged.encode() if isinstance(damaged, str) else damaged})


def special_files(rng: random.Random) -> Attack:
    """Something that is no ordinary file, wherever a file is named."""
    makers: dict[str, Callable[[Path], None]] = {
        "pipe": os.mkfifo,
        "folder": lambda path: path.mkdir(),
        "loop": lambda path: path.symlink_to(path.name),
        "dangling": lambda path: path.symlink_to("nowhere"),
        "zero": lambda path: path.symlink_to("/dev/zero"),
        "large": lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 3 * 2**30),
    }
    kind = rng.choice(list(makers))
    start = f"simulate {CRANE} --controller"
    line = rng.choice((
        "simulate {}.toml --controller ramp", "compare {}.toml", "compare --fitted-to {}.toml",
        f"{start} {{}}.toml", f"{start} {{}}.csv", f"{start} {{}}.py:Own",
        f"{start} profile --param file={{}}.csv", f"{start} profile --param file={{}}.toml",
        "reduce {}.toml", "clutch {}.toml", "clutch --law {}.csv", "balance {}.toml",
        "serve {}.toml --no-browser", "optimize {}.toml --start-time 1.2x", "drives {}.toml",
        "controllers {}.py",
    )).format(kind)  # fmt: skip
    (suffix,) = re.findall(rf"{kind}(\.toml|\.csv|\.py)", line)
    return Attack(line.split(), {kind + suffix: makers[kind]}, refused=True)


# ---- running and judging ---------------------------------------------------------------------------------


class TimeUp(BaseException):
    """The command took too long."""


def ended(words: Sequence[str]) -> tuple[int | None, str, str]:
    """Exit code and what is printed of the command in this process; no code where it had to be stopped."""

    def stop(number: int, frame: object) -> None:
        raise TimeUp

    out, err = io.StringIO(), io.StringIO()
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, LONGEST)
    code: int | None = None
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                code = main(list(words))
            except TimeUp:
                pass
            except BaseException as error:  # what the interpreter would print, and its exit code
                print(f"Traceback: {type(error).__name__}: {error}"[:500], file=sys.stderr)
                code = 1
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    return code, out.getvalue(), err.getvalue()


def judged(attack: Attack, folder: Path) -> list[str]:
    """What is wrong with how the attack ended in an empty folder."""
    for path, content in attack.files.items():
        if callable(content):
            content(Path(path))
        else:
            Path(path).write_bytes(content)
    before = set(folder.rglob("*"))
    code, out, err = ended(attack.words)
    left = {path for path in set(folder.rglob("*")) - before if "__pycache__" not in path.parts}
    typed = " ".join(attack.words)
    named = {name for name in re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z]", err) if name not in typed}
    wrong = {
        f"exit {code}": code not in (0, 2, 3, 130),
        "traceback": "Traceback" in out + err or "bug in softstart" in out + err,
        "memory": "not enough memory" in out + err,
        "warning": "Warning" in err,
        "no sentence": code in (2, 3) and not err.startswith("softstart: "),
        "long message": len(err) > MOST_TEXT or (code != 0 and len(out) > MOST_TEXT),
        "output beside a refusal": code == 2 and out != "",
        "control characters": re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]", out + err) is not None,
        "not refused": attack.refused and code == 0,
        "options that do not exist": not named <= option_names().keys(),
        f"left behind {left}": bool(left),
    }
    found = [name for name, so in wrong.items() if so]
    if code == 0 and "--json" in attack.words and "--help" not in attack.words:
        try:
            json.loads(out, parse_constant=int)  # which refuses NaN and infinity
        except ValueError:
            found.append("no JSON")
    return found


def test_every_command_is_attacked() -> None:
    assert set(QUICK) == set(COMMANDS)


@pytest.mark.parametrize("kind", [options, values, texts, special_files])
def test_hostile_inputs_end_well(
    kind: Callable[[random.Random], Attack],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    pytestconfig: pytest.Config,
) -> None:
    rng = random.Random(kind.__name__)
    bad = []
    for number in range(10 * pytestconfig.getoption("size")):
        attack = kind(rng)
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.chdir(folder)
        monkeypatch.setattr(tempfile, "tempdir", str(folder))
        if wrong := judged(attack, folder):
            bad.append((wrong, [word[:60] for word in attack.words]))
        monkeypatch.undo()
    assert not bad
