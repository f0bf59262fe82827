"""Hostile inputs over all commands: each ends soon, with a known exit code and one clear message.

By hand, each input in a process of its own:

    python tests/robustness/test_inputs.py --inputs 1500 --seed 1

An attack is a command line with the files it needs, drawn by `attacks` from a seed. `judged` says what is
wrong with how it ended: an exit code other than 0, 2, 3 and 130, a traceback or a warning, a hang, a message
of more than a screenful, control characters on the terminal, an option that no command has, files left
behind, a number in the JSON that is not finite. Where the truth is known - the same numbers in another
notation - an answer other than that of the plain notation is a wrong number, and where only refusal is right
(`refused`), so is any answer.

The suite runs a few dozen of them in this process.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import random
import re
import resource
import signal
import socket
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import click
import pytest

from softstart.balancing.engine import LIBRARY as ENGINES
from softstart.balancing.engine import TABLES as ENGINE_TABLES
from softstart.chain.elements import LIBRARY as CHAINS
from softstart.chain.elements import TABLES as CHAIN_TABLES
from softstart.cli.commands import COMMANDS, cli
from softstart.cli.main import main
from softstart.clutch.model import LIBRARY as CLUTCHES
from softstart.clutch.model import Clutch
from softstart.drive import PARAMETERS, library

CRANE = "crane-4amtkf"
LONGEST = 10.0  # s of one command, of the processor
ON_THE_CLOCK = 40.0  # s of one command, where others use the machine too
MOST_MEMORY = 3 * 2**30  # B, of one command
MOST_TEXT = 20_000  # letters that a failed command may print
CODES = {0, 2, 3, 130}

SHEET = (
    "load.machine=rotor", "motor.power=3 kW", "motor.speed=1430 rpm", "motor.inertia=0.01", "load.inertia=1",
    "coupling.stiffness=900",
)  # fmt: skip
# The quickest form of each command; hostile words are added to it.
QUICK: dict[str, list[str]] = {
    "compare": ["compare", "--controllers", "direct,ramp"],
    "simulate": ["simulate", CRANE, "--controller", "ramp"],
    "fatigue": ["fatigue", "--controllers", "direct,ramp", "--set", "damping=1"],
    "optimize": ["optimize", "--start-time", "1.2x"],
    "pareto": ["pareto", "--start-times", "1.2x", "--controllers", "direct"],
    "tune": [
        "tune", "--controller", "ramp", "--gaps", "1x", "--inertias", "1x", "--only", "robust", "--restarts",
        "1", "--no-optimum",
    ],
    "sweep": ["sweep", "--controller", "ramp", "--axis", "shaft.gap=0.5,1.5"],
    "linear": ["linear", "--controller", "state-feedback"],
    "reduce": ["reduce", "--no-starts"],
    "clutch": ["clutch"],
    "balance": ["balance"],
    "report": ["report", "--json", "--budget", "0", "--controllers", "direct,ramp"],
    "serve": ["serve", "nowhere.toml", "--no-browser"],
    "init": ["init", *(f"--set={one}" for one in SHEET)],
    "identify": ["identify", "nowhere.csv", "--drive", CRANE],
    "wear": ["wear", "found-2024", "found-2026"],
    "plan": ["plan", CRANE, "--set", "load.kind=reactive", "--standard"],
    "drives": ["drives"],
    "controllers": ["controllers"],
    "study": ["study"],
    "completion": ["completion"],
}  # fmt: skip
OPTIONS: dict[str, list[str]] = {
    "compare": ["--controllers", "--set", "--fitted-to", "--param", "--until", "--json"],
    "simulate": ["--controller", "--param", "--set", "--fitted-to", "--until", "--json"],
    "fatigue": [
        "--controllers", "--set", "--fitted-to", "--param", "--slope", "--worn-gap", "--estimate-damping",
        "--json",
    ],
    "optimize": [
        "--start-time", "--terminal", "--minimise", "--max-k-dyn", "--max-heat", "--torque-speed",
        "--smoothness", "--gaps", "--inertias", "--load-torques", "--set", "--json",
    ],
    "pareto": [
        "--start-times", "--terminal", "--torque-speed", "--controllers", "--workers", "--set",
    ],
    "tune": [
        "--gaps", "--inertias", "--free", "--param", "--metric", "--start-time", "--tolerance", "--quantile",
        "--only", "--seed", "--restarts", "--workers", "--set", "--json",
    ],
    "sweep": [
        "--axis", "--controller", "--param", "--set", "--fitted-to", "--until", "--workers", "--figures",
        "--allow-code",
    ],
    "linear": ["--controller", "--param", "--set", "--json"],
    "reduce": [
        "--factor", "--force", "--set", "--verify", "--no-starts", "--param", "--json",
    ],
    "clutch": ["--law", "--set", "--until", "--optimal", "--points", "--nondecreasing", "--json"],
    "balance": ["--speed", "--set", "--json"],
    "report": ["--controllers", "--set", "--param", "--resolution", "--budget", "--project"],
    "serve": ["--set", "--port", "--host", "--token", "--expose"],
    "init": ["--set", "--json"],
    "identify": ["--columns", "--torque-is", "--free", "--restarts", "--controllers", "--set", "--json"],
    "wear": ["--dates", "--worn-gap", "--json"],
    "plan": [
        "--log-period", "--ripple", "--free", "--max-torque", "--max-travel", "--wanted", "--set", "--json",
    ],
    "drives": ["--json"],
    "controllers": ["--json"],
    "study": ["--json"],
    "completion": ["--help"],
}  # fmt: skip
FLAGS = {
    "--allow-code", "--json", "--force", "--no-starts", "--optimal", "--nondecreasing", "--expose",
    "--help",
}  # fmt: skip
PATHS = {
    "drive": [p.path for p in PARAMETERS.values()],
    "chain": [
        p.path.replace(".", "[1].", 1) if t.many else p.path for t in CHAIN_TABLES for p in t.parameters
    ],
    "clutch": [p.path for t in Clutch.TABLES for p in t.parameters],
    "engine": [p.path for t in ENGINE_TABLES for p in t.parameters],
}  # fmt: skip
KIND = {"reduce": "chain", "clutch": "clutch", "balance": "engine"}
SHIPPED: dict[str, Callable[[], str]] = {
    "drive": lambda: library.text(CRANE),
    "chain": lambda: CHAINS.text("crane-4-mass"),
    "clutch": lambda: CLUTCHES.text("paper-c"),
    "engine": lambda: ENGINES.text("vaz-11113"),
}

# Words that a hand, a script or a spreadsheet may put where a value belongs.
WORDS = [
    "", " ", "nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "5e-324", "1e30", "-1", "0", "-0.0",
    "1e999", "9" * 400, "1" + "0" * 5000, "0x10", "1_000", "1e", "--", "-", "+", ".", ",", ";", ":", "=",
    "==", "a=b", "0,5", "0,07", "1,500", "1.234,5", "1,234.5", "0,1,0,2", "0,5; 1", "1;;2", "1,,2", ",1",
    "1:2", "1:2:3:4", "0:1:0", "1:2:99999999", "2:1:3", "1x:2x", "x", "0x", "-1x", "1.2X", "nanx",
    "1e400x", "true", "[1, 2]", "{}", "'1'", '"1"', "[[1]]", "1979-05-27", "0.5 rad", "0.5 m", "62 N",
    "50 Hz", "5 %", "-5 %", "1e300 kN*m", "1 " + "*".join(["m"] * 1000), "1 " + "/".join(["kg"] * 3000),
    "1 rad^9", "1 ((((((((((rad))))))))))", "1 " + "(" * 500 + "rad" + ")" * 500, "rad", "½", "٣",
    "1\u00a0rad", "−5", "0.5 рад", "一", "😀", "\u202e5", "\x1b[31m5", "5\n6", "5\t", "\ud800",
    "a" * 20_000, "../..", "/dev/zero", "/dev/null", "/etc/passwd", ".", "~", "ramp", "direct,ramp",
    "direct,direct", "nosuch", "RAMP", "steady", "reached", "collocation", "heat", "ramp.time=0.2",
    "time=0.2", "time=0,2", "time=1e308", "time=nan", "k_dyn", "torque=0.5%", "0:62,90:40",
    "0:62;90,5:40", "gap=0.5,1", "shaft.gap=0,5", "gap=1:2:3", "stiffness=10%", "stiffness=1,5 %",
    "robust", "load.inertia=0,07", "load.inertia=1e308", "load.inertia=-1", "gap=1e-300", "__class__",
    "ramp\x00", "*", "own.py:Own", "own.py", "none.py:X", "gains.toml", "none.toml", "none.csv", "%s",
    "{0}", "$(date)", "`id`",
]  # fmt: skip
# The same as TOML.
LITERALS = [
    "nan", "inf", "-inf", "1e308", "-1e308", "5e-324", "-1", "0", "1" + "0" * 400, "1" + "0" * 5000,
    "true", "[]", "[1, 2]", "[[1]]", "[[1, 2], [3]]", "{}", "{a = 1}", '""', '"0,5 rad"', '"1,500"',
    '"nan"', '"5 xyzzy"', '"62 N"', "1979-05-27", "07:32:00", "0xff", "0b1", '"\\u0000"',
    '"\\u001b[31m"', '"😀"', '"' + "a" * 9000 + '"', '"1 ' + "*".join(["kg"] * 2000) + '"',
    "[" * 500 + "]" * 500, "'''\n\n'''", '["0,5", "1"]', "[true]", "1e400",
]  # fmt: skip


@dataclass
class Attack:
    """One command line: its words, the files it needs, and what is known of the right answer."""

    about: str
    words: list[str]
    files: dict[str, bytes | Callable[[Path], None]] = field(default_factory=dict)
    truth: list[str] = field(
        default_factory=list
    )  # a command whose JSON is the right answer, if there is one
    refused: bool = False  # whether only a refusal is right


# ---- drawing attacks -------------------------------------------------------------------------------------


def attacks(seed: int, count: int) -> Iterator[Attack]:
    """So many attacks, of all kinds in turn."""
    rng = random.Random(seed)
    kinds = (options, values, texts, keys, special_files, profiles, laws, notations, names, gains)
    for number in range(count):
        yield kinds[number % len(kinds)](rng)


def options(rng: random.Random) -> Attack:
    """Any options with any words."""
    command = rng.choice(list(OPTIONS))
    words = list(QUICK[command])
    for _ in range(rng.choice((1, 1, 2, 3))):
        option = rng.choice([*OPTIONS[command], rng.choice(("--nosuch", "-x", "--", "--jso"))])
        words += [option] if option in FLAGS or rng.random() < 0.03 else [option, rng.choice(WORDS)]
    if rng.random() < 0.2:
        words.insert(1, rng.choice(WORDS))
    return Attack(
        "options", words, {"own.py": b"raise SystemExit(7)\n", "gains.toml": b"kind = 'robust set'\n"}
    )


def values(rng: random.Random) -> Attack:
    """One key of a file with a value that it should not have, from the command line."""
    command = rng.choice(("simulate", "compare", "reduce", "clutch", "balance", "linear", "optimize"))
    path = rng.choice(PATHS[KIND.get(command, "drive")])
    return Attack("values", [*QUICK[command], "--set", f"{path}={rng.choice(WORDS + LITERALS)}", "--json"])


def texts(rng: random.Random) -> Attack:
    """A shipped file, damaged as an editor, a disk or a program damages files."""
    command = rng.choice(("simulate", "reduce", "clutch", "balance"))
    text = SHIPPED[KIND.get(command, "drive")]()
    at = rng.randrange(len(text))
    deep = ".".join(["a"] * rng.choice((30, 3000, 60_000)))
    damages: list[str | bytes] = [
        text.encode("utf-16"),
        text.encode("utf-8-sig"),
        text.replace("\n", "\r\n"),
        text.replace("\n", "\r"),
        text[:at] + "\0" + text[at:],
        text[:at] + chr(rng.randrange(1, 0x2FFF)) + text[at:],
        text[:at],
        text[:at] + text[at + 1 :],
        text.encode() + b"\xff\xfe",
        rng.randbytes(2000),
        "",
        "\n" * 100_000,
        text + text,
        f"{text}\n{deep} = 1\n",
        f"{text}\n[{deep}]\n",
        "\n".join(f"key{i} = {i}" for i in range(20_000)) + "\n" + text,
        text + "\n".join(f"\n[table{i}]\nx = 1" for i in range(5_000)),
        text + "x = [" + "0," * 400_000 + "]",
        text + "#" + " " * 3_000_000,
        "name = '" + "x" * 500_000 + "'\n" + text.replace("name =", "title =", 1),
    ]
    damaged = rng.choice(damages)
    words = [command, "mine.toml", *QUICK[command][2:], "--json"]
    return Attack("texts", words, {"mine.toml": damaged.encode() if isinstance(damaged, str) else damaged})


def keys(rng: random.Random) -> Attack:
    """A shipped file with one value replaced by another TOML value, or with a key misspelt."""
    command = rng.choice(("simulate", "reduce", "clutch", "balance"))
    lines = SHIPPED[KIND.get(command, "drive")]().splitlines()
    index = rng.choice([i for i, line in enumerate(lines) if re.match(r"\w+ = ", line)])
    key = lines[index].partition(" =")[0]
    if rng.random() < 0.2:
        lines[index] = lines[index].replace(
            key, rng.choice((key[:-1], key.upper(), f"a.{key}", '"\\u001b"', key * 99)), 1
        )
    else:
        lines[index] = f"{key} = {rng.choice(LITERALS)}"
    words = [command, "mine.toml", *QUICK[command][2:], "--json"]
    return Attack("keys", words, {"mine.toml": "\n".join(lines).encode()})


def special_files(rng: random.Random) -> Attack:
    """Something that is no ordinary file, wherever a file is named."""
    makers: dict[str, Callable[[Path], None]] = {
        "pipe": os.mkfifo,
        "folder": lambda path: path.mkdir(),
        "loop": lambda path: path.symlink_to(path.name),
        "dangling": lambda path: path.symlink_to("nowhere"),
        "zero": lambda path: path.symlink_to("/dev/zero"),
        "terminal": lambda path: path.symlink_to("/dev/tty"),
        "socket": _socket,
        "large": lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 3 * 2**30),
    }
    where: list[Callable[[str], list[str]]] = [
        lambda name: ["simulate", f"{name}.toml", "--controller", "ramp"],
        lambda name: ["compare", f"{name}.toml"],
        lambda name: ["compare", "--fitted-to", f"{name}.toml"],
        lambda name: ["simulate", CRANE, "--controller", f"{name}.toml"],
        lambda name: ["simulate", CRANE, "--controller", f"{name}.csv"],
        lambda name: ["simulate", CRANE, "--controller", f"{name}.py:Own"],
        lambda name: ["simulate", CRANE, "--controller", "profile", "--param", f"file={name}.csv"],
        lambda name: ["simulate", CRANE, "--controller", "profile", "--param", f"file={name}.toml"],
        lambda name: ["reduce", f"{name}.toml"],
        lambda name: ["clutch", f"{name}.toml"],
        lambda name: ["clutch", "--law", f"{name}.csv"],
        lambda name: ["balance", f"{name}.toml"],
        lambda name: ["serve", f"{name}.toml", "--no-browser"],
        lambda name: ["optimize", f"{name}.toml", "--start-time", "1.2x"],
        lambda name: ["drives", f"{name}.toml"],
        lambda name: ["controllers", f"{name}.py"],
    ]
    kind = rng.choice(list(makers))
    words = rng.choice(where)(kind)
    found = re.search(rf"{kind}\.(toml|csv|py)", " ".join(words))
    assert found is not None
    return Attack(f"special files: {kind}", words, {found.group(): makers[kind]}, refused=True)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(path.name)  # the current folder is that of the attack: paths of sockets are short


def _knots(rng: random.Random) -> list[tuple[float, float]]:
    times = [0.0, 0.05, 0.125, 0.3]
    return [(t, round(rng.uniform(15.0, 62.0), 2)) for t in times[: rng.randint(2, 4)]]


def _dialect(rng: random.Random, rows: Sequence[tuple[float, float]], header: tuple[str, str]) -> bytes:
    """The numbers as some program writes them."""
    separator, mark = rng.choice((",", ";", "\t", ", ", " ", "|")), rng.choice((".", ".,", ","))[-1]
    quote = rng.choice(("", "", "", '"'))
    form = rng.choice(("{:g}", "{:.3f}", "{:.6e}", "{:+g}", "{:09.4f}"))
    lines = [separator.join(quote + form.format(x).replace(".", mark) + quote for x in row) for row in rows]
    if rng.random() < 0.5:
        lines.insert(0, separator.join(header))
    if rng.random() < 0.2:
        lines = [line + separator for line in lines]
    if rng.random() < 0.2:
        lines = [f"# {rng.choice(('a comment', '1;2', '1,2'))}", "", *lines, ""]
    if rng.random() < 0.15:
        lines = [f"{line}{separator}{i}" for i, line in enumerate(lines)]
    text = rng.choice(("\n", "\n", "\r\n", "\r")).join(lines)
    return (rng.choice(("", "", "\ufeff")) + text).encode(rng.choice(("utf-8", "utf-8", "utf-8", "utf-16")))


def profiles(rng: random.Random) -> Attack:
    """A torque profile in some program's dialect: read as it is meant, or refused."""
    rows = _knots(rng)
    play = ["simulate", CRANE, "--json", "--controller", "profile", "--param"]
    files = {
        "mine.csv": _dialect(rng, rows, rng.choice((("time", "torque"), ("t [s]", "u [N*m]")))),
        "true.csv": "".join(f"{t!r},{u!r}\n" for t, u in [("time", "torque"), *rows])
        .replace("'", "")
        .encode(),
    }
    return Attack("profiles", [*play, "file=mine.csv"], files, truth=[*play, "file=true.csv"])


def laws(rng: random.Random) -> Attack:
    """The law of a clutch, or a list of it, likewise."""
    rows = [(0.0, 0.0), (0.25, 150.5), (0.5, 300.25), (1.0, 700.125)]
    files = {
        "mine.csv": _dialect(rng, rows, ("t [s]", "M [N*m]")),
        "true.csv": "".join(f"{t!r},{u!r}\n" for t, u in rows).encode(),
    }
    words = ["clutch", "--json", "--law"]
    return Attack("laws", [*words, "mine.csv"], files, truth=[*words, "true.csv"])


def notations(rng: random.Random) -> Attack:
    """The same numbers in another notation: one value, or a list."""
    number = rng.choice((0.5, 0.07, 1.5, 0.25, 1.234, 12.5))
    text = f"{number!r}"
    comma = text.replace(".", ",")
    forms = [text, comma, f"+{text}", f" {text} ", f"{text}e0", f"{comma} rad", f"{text} rad", f"{text}rad"]
    second = rng.choice((1.0, 2.0, 2.5))
    other = f"{second:g}"
    between = rng.choice((",", ", ", ";", "; "))
    pairs = [(text, other), (comma, other.replace(".", ","))]
    if between != ",":  # "12.5,2,5" is a list with points: who mixes both marks in one list is not understood
        pairs += [(text, other.replace(".", ",")), (comma, other)]
    listed = between.join(rng.choice(pairs))
    axis = ["sweep", "--controller", "direct", "--json", "--axis"]
    start = ["simulate", CRANE, "--controller", "direct", "--json", "--set"]
    optimum = ["optimize", "--start-time", "1.4x", "--json", "--set"]
    reduced = ["reduce", "--json", "--no-starts", "--factor"]
    kinds = [
        ([*start, f"shaft.gap={rng.choice(forms)}"], [*start, f"shaft.gap={text}"]),
        ([*start, f"shaft.gap={rng.choice(forms)}"], [*start, f"shaft.gap={text}"]),
        ([*axis, f"shaft.gap={listed}"], [*axis, f"shaft.gap={text}, {other}"]),
        ([*optimum, f"gap={rng.choice(forms)}"], [*optimum, f"gap={text}"]),
        (["clutch", "--json", "--until", comma], ["clutch", "--json", "--until", text]),
        (["balance", "--json", "--speed", f"{comma}krpm"], ["balance", "--json", "--speed", f"{text}krpm"]),
        ([*reduced, f"{comma}e1"], [*reduced, f"{text}e1"]),
    ]
    words, truth = rng.choice(kinds)
    return Attack("notations", words, truth=truth)


def names(rng: random.Random) -> Attack:
    """A drive with a hostile name, shown and written."""
    name = rng.choice(
        ("😀 drive", "\u202eevird", "<script>alert(1)</script>", "x" * 3000, "x" * 120, "a\tb", "$x$ & 50 %",
         "$\\frac{1}{0}$", "\x1b[2J", "机器", "नमस्ते", "../../x", "%(name)s", "{0.__class__}", "| a | b |",
         "`rm`", "\u0000", "\ue000")
    )  # fmt: skip
    text = re.sub(r"(?m)^name = .*$", lambda _: f"name = {json.dumps(name)}", library.text(CRANE))
    out = rng.choice(([], ["--out", "out"], ["--json"]))
    base = rng.choice((["compare", "mine.toml", "--controllers", "ramp"],
                       ["simulate", "mine.toml", "--controller", "ramp"]))  # fmt: skip
    return Attack("names", [*base, *out], {"mine.toml": text.encode()})


def gains(rng: random.Random) -> Attack:
    """Files of tuned gains, damaged, or with code in place of a controller."""
    drive = "\n".join(
        line.replace("[", "[drive.", 1) if line.startswith("[") else line
        for line in library.text(CRANE).splitlines()
    )
    controller = rng.choice(
        ("ramp", "own.py:Own", "/elsewhere/own.py", "nosuch", "", "gains.toml", "ramp\\u0000")
    )
    robust = (
        f'kind = "robust set"\ncontroller = "{controller}"\n[parameters]\n'
        f"time = {rng.choice(LITERALS)}\n[drive]\n"
    )
    gaps = rng.choice(("[0.5]", "[0.5, 0.5]", "[-1]", "[nan]", "[]", "0.5", '["0,5"]', "[1e308]", "[[0.5]]"))
    value = rng.choice(("0.1", "-1", "nan", "1e308", "0", '"0,1"', "[0.1]", "5e-324"))
    schedule = (
        f'kind = "gain schedule"\ncontroller = "{controller}"\ngaps = {gaps}\nload_inertias = [0.175]\n'
        f'[gains.time]\nscale = "{rng.choice(("linear", "logarithmic", "x"))}"\nvalues = [[{value}]]\n'
    )
    last = rng.choice(("", "0,5,0,175,0,1", "x,y,z", "1,2", "0.5,0.175,1"))
    table = (
        f'# softstart gain schedule\n# controller: {controller}\n# gains: {{"time": "linear"}}\n'
        f"# fixed: {{}}\ngap,load_inertia,time\n0.5,0.175,{value}\n{last}\n"
    )
    file, text = rng.choice((("gains.toml", robust + drive), ("gains.toml", schedule), ("gains.csv", table)))
    code = b"import pathlib\npathlib.Path('ran').touch()\nraise SystemExit(5)\n"
    words = ["simulate", CRANE, "--json", "--controller", file]
    return Attack("gains", words, {file: text.encode(), "own.py": code}, refused=".py" in controller)


# ---- running and judging ---------------------------------------------------------------------------------


class TimeUp(BaseException):
    """The command took too long."""


@dataclass
class Ended:
    """How a command ended; `code` is None where it had to be stopped."""

    code: int | None
    out: str
    err: str
    seconds: float


def run_here(words: Sequence[str], longest: float = ON_THE_CLOCK) -> Ended:
    """The command in this process, stopped after `longest` s."""

    def stop(number: int, frame: object) -> None:
        raise TimeUp

    out, err = io.StringIO(), io.StringIO()
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, longest)
    begun = time.process_time()
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
    return Ended(code, out.getvalue(), err.getvalue(), time.process_time() - begun)


def run_apart(words: Sequence[str]) -> Ended:
    """The command in a fork of this process with bounded memory, killed where it does not end."""
    with tempfile.TemporaryFile() as kept:
        begun = time.monotonic()
        child = os.fork()
        if child == 0:
            try:
                os.setpgid(0, 0)
                resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY + _size(), resource.RLIM_INFINITY))
                ended = run_here(words)
                report = [ended.code, ended.out[:5_000_000], ended.err[:5_000_000], ended.seconds]
                kept.write(json.dumps(report).encode())
                kept.flush()
            finally:
                os._exit(0)
        while os.waitpid(child, os.WNOHANG) == (0, 0):
            if time.monotonic() - begun > ON_THE_CLOCK + 5.0:
                os.killpg(child, signal.SIGKILL)
                os.waitpid(child, 0)
                break
            time.sleep(0.002)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        kept.seek(0)
        report = kept.read()
    if not report:
        return Ended(None, "", "killed", time.monotonic() - begun)
    return Ended(*json.loads(report))


def _size() -> int:
    """Address space of this process in B."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def snapshot(folder: Path) -> set[str]:
    """All names below a folder, caches of Python aside."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if "__pycache__" not in path.parts}


def judged(attack: Attack, run: Callable[[Sequence[str]], Ended]) -> tuple[Ended, list[str]]:
    """How the attack ended in an empty folder, and what is wrong with that."""
    home = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        folder, scratch = Path(name) / "here", Path(name) / "scratch"
        folder.mkdir()
        scratch.mkdir()
        os.chdir(folder)
        before_tmp, tempfile.tempdir = tempfile.tempdir, str(scratch)
        try:
            for path, content in attack.files.items():
                if callable(content):
                    content(Path(path))
                else:
                    Path(path).write_bytes(content)
            before = snapshot(folder)
            ended = run(attack.words)
            left = snapshot(folder) - before - ({"out"} if ended.code == 0 else set())
            left = {
                path
                for path in left
                if not (ended.code == 0 and path.startswith("out/") and ".part" not in path)
            }
            left |= {f"scratch/{path}" for path in snapshot(scratch)}
            wrong = _wrong(attack, ended, left)
            if attack.truth and ended.code == 0:
                true = run(attack.truth)
                if _numbers(ended.out) != _numbers(true.out):
                    wrong.append("wrong number")
        finally:
            tempfile.tempdir = before_tmp
            os.chdir(home)
    return ended, wrong


def _wrong(attack: Attack, ended: Ended, left: set[str]) -> list[str]:
    wrong = []
    said = ended.out + ended.err
    if ended.code is None or ended.seconds > LONGEST:
        wrong.append("hang")
    elif ended.code not in CODES:
        wrong.append(f"exit {ended.code}")
    if "Traceback" in said or "bug in softstart" in said:
        wrong.append("traceback")
    if "not enough memory" in said:
        wrong.append("memory")
    if "Warning" in ended.err:
        wrong.append("warning")
    if ended.code in (2, 3) and not ended.err.startswith("softstart: "):
        wrong.append("no sentence")
    if len(ended.err) > MOST_TEXT or (ended.code != 0 and len(ended.out) > MOST_TEXT):
        wrong.append("long message")
    if ended.code == 2 and ended.out:
        wrong.append("output beside a refusal")
    if re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]", said):
        wrong.append("control characters")
    if attack.refused and ended.code == 0:
        wrong.append("not refused")
    typed = " ".join(attack.words)
    named = {name for name in re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z]", ended.err) if name not in typed}
    if unknown := named - option_names():
        wrong.append(f"options that do not exist: {', '.join(sorted(unknown))[:80]}")
    if left:
        wrong.append(f"left behind: {', '.join(sorted(left))[:80]}")
    if ended.code == 0 and "--json" in attack.words and "--help" not in attack.words:
        try:
            json.loads(ended.out, parse_constant=lambda name: 1 / 0)
        except (ValueError, ZeroDivisionError):
            wrong.append("no JSON")
    return wrong


@cache
def option_names() -> frozenset[str]:
    """The options of all commands, as a remedy may name them."""
    context = click.Context(cli, **cli.context_settings)
    commands = [cli.get_command(context, name) for name in cli.list_commands(context)]
    parameters = [one for command in (cli, *commands) for one in command.get_params(context)]
    return frozenset(name for one in parameters for name in (*one.opts, *one.secondary_opts))


def _numbers(text: str) -> list[float]:
    """All numbers of a JSON text, in order, but for the name of a file and times of the clock."""
    found: list[float] = []

    def take(one: Any, key: str = "") -> None:
        if isinstance(one, dict):
            for inner, value in one.items():
                take(value, inner)
        elif isinstance(one, list):
            for value in one:
                take(value, key)
        elif isinstance(one, float | int) and not isinstance(one, bool) and "seconds" not in key:
            found.append(math.nan if one is None else one)

    take(json.loads(text))
    return found


# ---- the suite, and by hand ------------------------------------------------------------------------------


def test_every_command_is_attacked() -> None:
    assert set(QUICK) == set(OPTIONS) == set(COMMANDS)


@pytest.mark.parametrize("number", range(6))
def test_hostile_inputs_end_well(number: int) -> None:
    bad = []
    for attack in attacks(seed=number, count=10):
        ended, wrong = judged(attack, run_here)
        if wrong:
            bad.append((wrong, attack.words, ended.code, ended.err[:300]))
    assert not bad


def by_hand() -> int:
    """Run many, each in a process of its own; print what ended badly, and the counts."""
    parser = argparse.ArgumentParser(description=by_hand.__doc__)
    parser.add_argument("--inputs", type=int, default=1500, help="how many")
    parser.add_argument("--seed", type=int, default=1, help="which")
    parser.add_argument("--only", help="one number: that attack alone, with all it prints")
    given = parser.parse_args()
    for words in QUICK.values():  # compiled and imported once, before the forks
        run_here(words, 300.0)
    codes: Counter[str] = Counter()
    failures: Counter[str] = Counter()
    slowest = 0.0
    begun = time.monotonic()
    for number, attack in enumerate(attacks(given.seed, given.inputs)):
        if given.only and int(given.only) != number:
            continue
        ended, wrong = judged(attack, run_apart)
        codes[str(ended.code)] += 1
        slowest = max(slowest, ended.seconds)
        failures.update(one.partition(":")[0] for one in wrong)
        if wrong or given.only:
            words = [word if len(word) < 60 else f"{word[:40]}...({len(word)})" for word in attack.words]
            said = (ended.err if not given.only else ended.out + ended.err).strip()
            print(
                f"{number:5} {attack.about}: {'; '.join(wrong)}\n      {words}\n      {said[-300:]!r}",
                flush=True,
            )
    print(f"\n{given.inputs} inputs in {time.monotonic() - begun:.0f} s, the slowest took {slowest:.1f} s")
    print(f"exit codes: {dict(sorted(codes.items()))}")
    print(f"what went wrong: {dict(failures.most_common()) or 'nothing'}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(by_hand())
