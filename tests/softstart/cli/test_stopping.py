"""Ctrl-C and TERM end a command even where the first one is lost in compiled code."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

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
TURNED = """
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as stop:
        raise SystemError("returned a result with an exception set") from stop
"""
CLEANS_UP = """
    try:
        os.kill(os.getpid(), signal.{name})
        time.sleep(1)
    finally:
        time.sleep(1.2)  # longer than it takes until a stop is repeated
        print("clean", file=sys.stderr)
"""


def ended(work: str, name: str) -> subprocess.CompletedProcess[str]:
    code = BEGIN.format(work=work.format(name=name).strip())
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=15,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@pytest.mark.parametrize(("work", "name"), [(LOST, "SIGINT"), (LOST, "SIGTERM"), (TURNED, "SIGINT")])
def test_a_stop_that_was_lost_is_repeated(work: str, name: str) -> None:
    done = ended(work, name)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "softstart: interrupted; no incomplete file was left behind.\n"


def test_what_cleans_up_is_not_stopped_again() -> None:
    done = ended(CLEANS_UP, "SIGINT")
    assert done.returncode == 130
    assert done.stderr.startswith("clean\n")
