"""The command as a process: what it imports, how it ends, what reaches which stream."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
import time

import click
import pytest

from softstart import __version__
from softstart.cli.commands import COMMANDS, cli
from softstart.cli.running import COMPILING, WRITTEN, working

HEAVY = ("casadi", "control", "matplotlib", "nicegui", "numba", "scipy.linalg", "xarray")
QUICK = 0.5  # s of processor time that a help may take, with starting Python
SLOW = """
import time
from softstart import Command, PlainController

class Slow(PlainController):
    def step(self, measured, state):
        open("began", "w").close()
        time.sleep(0.02)
        return Command(62.0, measured.time + 0.001)
"""

DIRECT = ("--controllers", "direct")
OLD = f"# old\n\n{WRITTEN}0.1"

LIGHT = {
    "greeting": ([], 0),
    "help": (["--help"], 0),
    "help of a command": (["compare", "--help"], 0),
    "version": (["--version"], 0),
    "completion": (["completion", "bash"], 0),
    "drives": (["drives"], 0),
    "one drive": (["drives", "crane-4amtkf"], 0),
    "bad usage": (["compare", "--nothing"], 2),
    "no drive file": (["compare", "nowhere.toml"], 2),
    "bad drive file": (["compare", "wrong.toml"], 2),
    "bad setting": (["compare", "--set", "gap=-1"], 2),
    "unknown controller": (["simulate", "good.toml", "--controller", "dirct"], 2),
    "bad output": (["compare", "--out", "good.toml"], 2),
    "help of optimize": (["optimize", "--help"], 0),
    "help of pareto": (["pareto", "--help"], 0),
    "bad bound of an optimum": (["optimize", "--start-time", "0"], 2),
    "bad terminal of an optimum": (["optimize", "--start-time", "1", "--terminal", "x"], 2),
    "bad range of start times": (["pareto", "--start-times", "1:2"], 2),
}


def test_quick_answers_import_nothing_heavy(place):
    """One process gives them all: what one of them imports, the others' lines show, too."""
    helps = {f"help of {name}": ([name, "--help"], 0) for name in COMMANDS}
    program = (
        "import json, sys; from softstart.cli import main\n"
        "for words in json.loads(sys.argv[1]):\n"
        "    code = main(words)\n"
        f"    print('ended', code, [name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"
    )
    asked = LIGHT | helps
    ended = subprocess.run(
        [sys.executable, "-c", program, json.dumps([words for words, _ in asked.values()])],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    told = [line for line in ended.stderr.splitlines() if line.startswith("ended ")]
    expected = {what: f"ended {code} []" for what, (_, code) in asked.items()}
    assert dict(zip(asked, told, strict=True)) == expected


@pytest.mark.parametrize(
    "arguments", [["simulate", "good.toml", "--controller", "direct", "--json"], ["compare", *DIRECT]]
)
def test_a_start_needs_neither_pictures_nor_design_tools(arguments, place):
    program = (
        "import sys; from softstart.cli import main; code = main(); "
        "print([n for n in ('casadi', 'matplotlib', 'xarray') if n in sys.modules], file=sys.stderr); "
        "sys.exit(code)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stderr.splitlines()[-1]) == (0, "[]")
    if "--json" in arguments:
        assert json.loads(ended.stdout)["controller"] == "direct"


def test_help_is_quick(command, place):
    def took() -> float:  # of processor time, so that a busy machine does not count
        begun = os.times().children_user + os.times().children_system
        subprocess.run([*command, "--help"], stdout=subprocess.DEVNULL, check=True)
        return os.times().children_user + os.times().children_system - begun

    assert min(took() for _ in range(3)) < QUICK


def test_greeting_names_three_things_and_each_is_there(spawn):
    ended = spawn()
    assert (ended.returncode, ended.stderr) == (0, "")
    assert all(len(line) <= 80 for line in ended.stdout.splitlines())
    things = re.findall(r"^  softstart (\w+)", ended.stdout, flags=re.MULTILINE)
    assert len(things) == 3
    for name in [*things, *re.findall(r"softstart ([a-z]+)", ended.stdout)]:
        assert name in COMMANDS
    assert "softstart init --out mine.toml" in ended.stdout


def test_help_and_version(run):
    assert run("--version").out == f"softstart {__version__}\n"
    told = run("--help").out
    commands = ("compare", "simulate", "optimize", "pareto", "drives", "controllers", "study")
    for words in (*commands, "softstart completion", "130"):
        assert words in told
    for command in commands:
        assert run(command, "-h").out.startswith(f"Usage: softstart {command}")


def test_the_listed_help_of_each_command_is_its_own():
    context = click.Context(cli, **cli.context_settings)
    for name, (_, sentence) in COMMANDS.items():
        command = cli.get_command(context, name)
        assert command.get_help_option(click.Context(command, parent=context)).opts == ["-h", "--help"]
        assert (command.name, " ".join(command.help.split("\n\n")[0].split())) == (name, sentence)
        assert "{" not in command.get_help(click.Context(command))  # no placeholder is left


def test_streams_and_exit_codes_of_a_process_that_fails(spawn):
    bad = spawn("compare", "wrong.toml", "--json")
    assert (bad.returncode, bad.stdout) == (2, "")
    lost = spawn("simulate", "good.toml", "--controller", "own.py:Nan", "--json")
    assert (lost.returncode, lost.stdout) == (3, "")


def test_a_reader_that_goes_away_is_no_failure_to_talk_about(command, place):
    process = subprocess.Popen(
        [*command, "simulate", "good.toml", "--controller", "direct"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait() == 141


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a disk that is always full")
def test_full_disk(command, place):
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [*command, "drives"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert ended.returncode == 2
    assert ended.stderr == "softstart: the output could not be written: No space left on device.\n"


@pytest.mark.parametrize(("stop", "there_before"), [(signal.SIGINT, False), (signal.SIGTERM, True)])
def test_interrupted_write_leaves_nothing(command, place, stop, there_before):
    (place / "slow.py").write_text(SLOW)
    if there_before:
        (place / "results").mkdir()
        (place / "results" / "report.md").write_text(OLD)
    process = subprocess.Popen(
        [*command, "simulate", "good.toml", "--controller", "slow.py:Slow", "--out", "results"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not (place / "began").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert list(place.rglob("*.part"))
    process.send_signal(stop)
    out, err = process.communicate()
    assert (process.returncode, out) == (130, "")
    assert err == "softstart: interrupted; no incomplete file was left behind.\n"
    assert not list(place.rglob("*.part"))
    if there_before:
        assert [path.name for path in (place / "results").iterdir()] == ["report.md"]
        assert (place / "results" / "report.md").read_text() == OLD
    else:
        assert not (place / "results").exists()


def test_interrupted_between_files_leaves_whole_files_only(run, place, monkeypatch):
    written = []

    def stop(folder):
        written.extend(folder.iterdir())
        raise KeyboardInterrupt

    monkeypatch.setattr("softstart.views.sheet.export", lambda shown, folder, command: stop(folder))
    code, out, err = run("simulate", "good.toml", "--controller", "direct", "--out", "results")
    assert (code, out) == (130, "")
    assert "interrupted" in err
    assert not (place / "results").exists()
    assert not list(place.rglob("*.part"))


def test_compiling_is_announced_once(capfd, monkeypatch):
    from numba import njit

    monkeypatch.setattr("softstart.cli.running._SAID", [])
    for said in (1, 0):
        with working("compiling"):
            print("this is no output")
            for _ in range(2):
                assert njit(lambda x: x + 1.0)(1.0) == 2.0
        out, err = capfd.readouterr()
        assert out == ""
        assert err.count(COMPILING) == said


def test_in_a_pipe_progress_is_a_line_now_and_then(capfd, monkeypatch):
    with working("looking") as tell:
        tell("first")
    assert capfd.readouterr() == ("", "")
    monkeypatch.setattr("softstart.cli.running.EVERY", 0.2)
    with working("looking") as tell:
        for number in range(12):
            time.sleep(0.05)
            tell(f"point {number}")
    out, err = capfd.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert 2 <= len(lines) <= 3
    assert all(re.fullmatch(r"softstart: point \d+ \.\.\. \([01] s\)", line) for line in lines)


def test_on_a_terminal_progress_goes_to_standard_error(command, place):
    leader, follower = pty.openpty()
    process = subprocess.Popen(
        [*command, "compare", "--controllers", "direct", "--json"], stdout=subprocess.PIPE, stderr=follower,
        env=os.environ | {"TERM": "xterm", "COLUMNS": "100"},
    )  # fmt: skip
    os.close(follower)
    shown = b""
    while True:
        try:
            part = os.read(leader, 4096)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        shown += part
    os.close(leader)
    out = process.stdout.read()
    process.stdout.close()
    assert process.wait() == 0
    assert json.loads(out)["strategies"][0]["controller"] == "direct"
    assert b"starting the drive" in shown
