"""The command as a process: what it imports, what reaches which stream, and how it ends or is stopped."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import re
import signal
import subprocess
import sys

import click
import pytest

from softstart import __version__
from softstart.cli.commands import COMMANDS, cli, first_sentences
from softstart.cli.running import COMPILING, working

HEAVY = ("casadi", "control", "matplotlib", "nicegui", "numba", "scipy.linalg", "xarray")
INTERRUPTED = "softstart: interrupted; no incomplete file was left behind.\n"
LIGHT = {
    "": 0,
    "--help": 0,
    "--version": 0,
    "completion bash": 0,
    "drives crane-4amtkf": 0,
    "compare --nothing": 2,
    "compare nowhere.toml": 2,
    "compare wrong.toml": 2,
    "compare --set gap=-1": 2,
    "simulate good.toml --controller dirct": 2,
    "compare --out good.toml": 2,
    "optimize --start-time 0": 2,
    "pareto --start-times 1:2": 2,
    **{f"{name} --help": 0 for name in COMMANDS},
}


def test_quick_answers_import_nothing_heavy_and_a_start_only_what_it_needs(place):
    """One process gives them all: what one of them imports, the others' lines show, too."""
    program = (
        "import json, sys; from softstart.cli import main\n"
        "for line in json.loads(sys.argv[1]):\n"
        "    code = main(line.split())\n"
        f"    print('ended', code, [name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"
    )
    start = "compare good.toml --controllers direct --json"
    words = [sys.executable, "-c", program, json.dumps([*LIGHT, start])]
    ended = subprocess.run(words, capture_output=True, text=True, check=True)
    told = [line for line in ended.stderr.splitlines() if line.startswith("ended ")]
    assert dict(zip(LIGHT, told[:-1], strict=True)) == {
        line: f"ended {code} []" for line, code in LIGHT.items()
    }
    assert told[-1] == "ended 0 ['numba', 'scipy.linalg']"  # neither pictures nor design tools


def test_greeting_help_and_version(run):
    ended = run()
    assert all(name in COMMANDS for name in re.findall(r"softstart ([a-z]+)", ended.out))
    assert run("--version").out == f"softstart {__version__}\n"
    told = run("--help").out
    assert all(f"  {command} " in told for command in COMMANDS)
    context = click.Context(cli, **cli.context_settings)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command.get_help_option(click.Context(command, parent=context)).opts == ["-h", "--help"]
        assert command.name == name
        assert first_sentences(COMMANDS[name])[f"{name}_command"] == command.help.split("\n\n")[0]
        assert all(one.help for one in command.params if isinstance(one, click.Option))
        assert "{" not in command.get_help(click.Context(command))  # no placeholder is left


def test_a_reader_that_goes_away_is_no_failure_to_talk_about(command, place):
    process = subprocess.Popen([*command, "drives"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
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
    clock = iter(range(0, 1000, 11))  # s, as it is looked at
    monkeypatch.setattr("softstart.cli.running.time.monotonic", lambda: next(clock))
    with working("looking") as tell:
        for number in range(7):
            tell(f"point {number}")
    assert capfd.readouterr() == (
        "",
        "softstart: point 2 ... (33 s)\nsoftstart: point 5 ... (66 s)\n",
    )


def test_on_a_terminal_progress_goes_to_standard_error(command, place):
    leader, follower = pty.openpty()
    process = subprocess.Popen(
        [*command, "compare", "--controllers", "direct", "--json"], stdout=subprocess.PIPE, stderr=follower,
        env=os.environ | {"TERM": "xterm", "COLUMNS": "100"},
    )  # fmt: skip
    os.close(follower)
    shown = b""
    with contextlib.suppress(OSError):  # the other end is closed
        while part := os.read(leader, 4096):
            shown += part
    os.close(leader)
    out, _ = process.communicate()
    assert process.returncode == 0
    assert json.loads(out)["strategies"][0]["controller"] == "direct"
    assert b"starting the drive" in shown


# ---- stopping ----------------------------------------------------------------------------------------


BEGIN = """
import os, signal, sys, time
import softstart.errors
from softstart.cli import main
from softstart.cli.commands import cli

@cli.command()
def work():
    {work}

sys.argv = ["softstart", "work"]
sys.exit(main())
"""
STUCK = """
    import ctypes
    from pathlib import Path
    from softstart.parallel import Worker
    from softstart.store import PartStore, Target, fresh_folder
    worker = Worker()
    with PartStore(Target("to", Path("kept"), "test"), {{}}, []), fresh_folder(Path(".")):
        print(worker.pid, sorted(path.name for path in Path(".").iterdir()), file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.{name})
        for _ in range(3):  # as compiled code does: no instruction of Python in between
            try:
                ctypes.CDLL(None).sleep(600)
            except KeyboardInterrupt:
                pass
"""


def ended(work: str, name: str) -> subprocess.CompletedProcess[str]:
    code = BEGIN.format(work=work.format(name=name).strip())
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def test_a_stop_that_becomes_another_error_in_a_library_ends_the_command() -> None:
    work = 'os.kill(os.getpid(), signal.{name})\n    raise softstart.errors.InputError("no drive")'
    done = ended(work, "SIGINT")
    assert (done.returncode, done.stdout, done.stderr) == (130, "", INTERRUPTED)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_what_does_not_stop_is_ended_with_all_that_it_has_begun(tmp_path, monkeypatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    done = ended(STUCK, name)
    began, sentence = done.stderr.splitlines()
    assert "kept" in began
    assert began.count(".part") == 1
    assert (done.returncode, f"{sentence}\n") == (130, INTERRUPTED)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.kill(int(began.split()[0]), 0)


def test_while_it_begins_there_is_no_traceback_either() -> None:
    code = (
        "import os, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, *others):\n"
        "        if name == 'click':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder())\n"
        "from softstart.cli import main\n"
        "sys.exit(main())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", INTERRUPTED)
