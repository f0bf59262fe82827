"""What is done when a process is ended at once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from threading import Event

import pytest

from softstart.input.files import write_whole
from softstart.parallel import DiedError, Worker
from softstart.store import PartStore, Target, fresh_folder

# the handler of a signal begins the end in the main thread, another thread carries it out a moment later
LEFT = """
from softstart.stopping import STOPPING, at_stop, stop_now

try:
    with at_stop(lambda: print("before", flush=True)):
        pass
    fails = at_stop(lambda: 1 / 0)
    with at_stop(lambda: print("outer", flush=True)), fails, at_stop(lambda: print("inner", flush=True)):
        STOPPING.set()
        raise KeyboardInterrupt
except KeyboardInterrupt:
    stop_now(130)
"""


def test_what_is_left_while_the_process_is_being_ended_is_still_done():
    done = subprocess.run(
        [sys.executable, "-c", LEFT], check=False, capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stdout.split(), done.stderr) == (130, ["inner", "outer"], "")


# the end comes as soon as something is made, before anything that follows
AT_ONCE = """
import sqlite3, sys, threading, time
from pathlib import Path
from softstart.input.files import write_whole
from softstart.stopping import stop_now
from softstart.store import PartStore, Target, fresh_folder

def stopped(function):
    def call(*given, **options):
        made = function(*given, **options)
        if threading.active_count() == 1:
            threading.Thread(target=stop_now, args=(130,)).start()
            time.sleep(0.5)
        return made
    return call

def forever(*_):
    time.sleep(600)

{name} = stopped({name})
{work}
"""
FOLDER = "with fresh_folder(Path()): forever()"
PARTS = "with PartStore(Target('to', Path('a', 'b', 'kept'), 'test'), {}, []): forever()"
FILE = "write_whole(Path('file'), forever)"


@pytest.mark.parametrize(
    ("name", "work"),
    [("Path.mkdir", FOLDER), ("Path.mkdir", PARTS), ("sqlite3.connect", PARTS), ("Path.open", FILE)],
)
def test_what_is_made_as_the_end_comes_is_not_left_behind(tmp_path: Path, name: str, work: str) -> None:
    code = AT_ONCE.format(name=name, work=work)
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, cwd=tmp_path, timeout=300
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_made_once_the_end_has_come(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    come = Event()
    come.set()
    for place in ("stopping", "parallel"):
        monkeypatch.setattr(f"softstart.{place}.STOPPING", come)
    with pytest.raises(KeyboardInterrupt), fresh_folder(tmp_path):
        pass
    with pytest.raises(KeyboardInterrupt), PartStore(Target("to", tmp_path / "a" / "kept", "test"), {}, []):
        pass
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "file", lambda stream: stream.write("text"))
    with pytest.raises(DiedError):
        Worker()
    assert list(tmp_path.iterdir()) == []
