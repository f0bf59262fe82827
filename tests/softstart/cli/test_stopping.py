"""Ctrl-C and TERM end a command even where the first one is lost in compiled code."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest
from tests.patience import patient

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are sent signals")

SAID = "softstart: interrupted; no incomplete file was left behind.\n"
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
BECOMES_ANOTHER_ERROR = """
    os.kill(os.getpid(), signal.{name})
    raise softstart.errors.InputError("no drive")  # as a library that clears the error of a callback
"""
STUCK = """
    import ctypes
    from pathlib import Path
    from softstart.parallel import Worker
    from softstart.store import Records, Target, fresh_folder
    worker = Worker()
    with Records(Target("to", Path("kept"), "test"), {{}}, []), fresh_folder(Path(".")):
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


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("work", [LOST, IN_A_CALLBACK, BECOMES_ANOTHER_ERROR])
def test_a_stop_that_libraries_lose_ends_the_command(work: str, name: str) -> None:
    done = ended(work, name)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == SAID


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_what_does_not_stop_is_ended_with_all_that_it_has_begun(tmp_path, monkeypatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    done = ended(STUCK, name)
    began, sentence = done.stderr.splitlines()
    assert "kept" in began
    assert began.count(".part") == 1
    assert (done.returncode, sentence) == (130, "softstart: interrupted; no incomplete file was left behind.")
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
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", SAID)
