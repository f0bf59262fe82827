"""Ctrl-C and TERM end a command even where the first one is lost in compiled code."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest
from tests.patience import patient

pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system has no interval timer")

BEGIN = """
import os, signal, sys, time
import click
from softstart.cli import main
from softstart.cli.commands import cli

@cli.command()
def work():
    {work}

sys.argv = ["softstart", "work"]
sys.exit(main())
"""
LOST = """
    try:
        os.kill(os.getpid(), signal.{name})
        time.sleep(1)
    except KeyboardInterrupt:
        pass  # as a callback of a compiled library does
    time.sleep(20)
"""
IN_A_CALLBACK = """
    import weakref
    class Kept: pass
    kept = Kept()
    reference = weakref.ref(kept, lambda _: (os.kill(os.getpid(), signal.{name}), time.sleep(1)))
    del kept  # nothing can catch what is raised there: Python prints it, with its lines
    time.sleep(20)
"""
TURNED = """
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as stop:
        raise SystemError("returned a result with an exception set") from stop
"""
BECOMES_ANOTHER_ERROR = """
    try:
        os.kill(os.getpid(), signal.{name})
        time.sleep(1)
    except KeyboardInterrupt:
        pass
    raise {error}  # as a library that clears the error of a callback and raises its own
"""
ERRORS = (
    "SystemError('NULL result without error')",
    "TypeError('incompatible arguments')",
    "ImportError('core failed to import')",
    "OSError(4, 'interrupted')",
    "__import__('softstart').errors.InputError('no drive')",
)
BECOMES_AN_ANSWER = """
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1)
    except KeyboardInterrupt:
        pass
    click.get_current_context().exit(3)  # nothing was found: the search was cut off
"""
CLEANS_UP = """
    try:
        os.kill(os.getpid(), signal.{name})
        time.sleep(1)
    finally:
        time.sleep(0.8)  # longer than it takes until a stop is repeated
        print("clean", file=sys.stderr)
"""
STUCK = """
    import ctypes
    from pathlib import Path
    from softstart.processes import Worker
    from softstart.store import Target, fresh_folder
    worker = Worker()
    with Target("to", Path("kept"), "test").locked(), fresh_folder(Path(".")):
        print(worker.pid, sorted(path.name for path in Path(".").iterdir()), file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.{name})
        for _ in range(3):  # as compiled code does: no instruction of Python in between
            try:
                ctypes.CDLL(None).sleep(20)
            except KeyboardInterrupt:
                pass
"""


def ended(work: str, name: str) -> subprocess.CompletedProcess[str]:
    code = BEGIN.format(work=work.format(name=name).strip())
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=patient(15.0),
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@pytest.mark.parametrize(
    ("work", "name"),
    [
        (LOST, "SIGINT"),
        (LOST, "SIGTERM"),
        (IN_A_CALLBACK, "SIGINT"),
        (TURNED, "SIGINT"),
        *((BECOMES_ANOTHER_ERROR.replace("{error}", error), "SIGTERM") for error in ERRORS),
        (BECOMES_AN_ANSWER, "SIGINT"),
    ],
)
def test_a_stop_that_was_lost_is_repeated(work: str, name: str) -> None:
    done = ended(work, name)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "softstart: interrupted; no incomplete file was left behind.\n"


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_what_does_not_stop_is_ended_with_all_that_it_has_begun(tmp_path, monkeypatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    done = ended(STUCK, name)
    began, sentence = done.stderr.splitlines()
    assert ".kept.lock" in began
    assert began.count(".part") == 1
    assert (done.returncode, sentence) == (130, "softstart: interrupted; no incomplete file was left behind.")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.kill(int(began.split()[0]), 0)


def test_what_cleans_up_is_not_stopped_again() -> None:
    done = ended(CLEANS_UP, "SIGINT")
    assert done.returncode == 130
    assert done.stderr.startswith("clean\n")


@pytest.mark.parametrize(
    ("code", "out"),
    [
        (
            "class Finder:\n"
            "    def find_spec(self, name, *others):\n"
            "        if name == 'click':\n"
            "            os.kill(os.getpid(), signal.SIGINT)\n"
            "sys.meta_path.insert(0, Finder())\n"
            "from softstart.cli import main\n",
            "",
        ),
        (
            "from softstart.cli import main\n"
            "sys.argv[1:] = ['drives', '--json']\n"
            "main()\n"
            "sys.argv[1:] = []\n"
            "os.kill(os.getpid(), signal.SIGINT)\n",
            "{",
        ),
    ],
)
def test_before_and_after_the_command_there_is_no_traceback_either(code: str, out: str) -> None:
    begin = "import os, signal, sys\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    done = subprocess.run(
        [sys.executable, "-c", begin + code], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")
    assert done.stdout.lstrip().startswith(out)
