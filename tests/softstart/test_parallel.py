"""Work done aside: results, errors, deaths, ends, and scripts that need no guard."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from softstart.errors import InputError, SimulationError
from softstart.parallel import DiedError, Pool, Progress, Worker, single_threaded_blas

HERE = Path(__file__).parent
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are killed by signals")


@pytest.fixture
def importable(monkeypatch: pytest.MonkeyPatch) -> Any:
    """This file as a module that workers can import too."""
    monkeypatch.syspath_prepend(str(HERE))
    import test_parallel

    return test_parallel


def environment() -> tuple[str, int, int]:
    """Threads of linear algebra, the process, and the group that it leads."""
    return os.environ["OPENBLAS_NUM_THREADS"], os.getpid(), os.getpgrp()


def printing(number: int) -> int:
    print("this is not an answer")
    os.write(1, b"nor this")
    return number + len(sys.stdin.read())


def failing(kind: str) -> Any:
    if kind == "input":
        raise InputError(["gap = -1: a gap is 0 or more.", "c = 0: it must be above 0."])
    if kind == "local":
        raise type("LocalError", (Exception,), {})("of a class that nobody else knows")
    if kind == "unsendable":
        return lambda: None
    os.kill(os.getpid(), signal.SIGKILL)
    return None


def sleeping(file: str) -> None:
    other = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(600)"])
    Path(file).write_text(f"{os.getpid()} {other.pid}")
    time.sleep(600)


def reporting(*, progress: Progress) -> str:
    progress(0.5, "half of it")
    progress.part([1, 2])
    return "done"


def dies_once(file: str) -> int:
    if not Path(file).exists():
        Path(file).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 7


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def started(file: Path) -> list[int]:
    """The two processes of `sleeping`, once they run."""
    until(lambda: file.exists() and " " in file.read_text())
    return [int(word) for word in file.read_text().split()]


def until(what: Callable[[], bool]) -> None:
    """Wait for what comes on any machine: processes end that would else sleep for ten minutes."""
    latest = time.monotonic() + 300.0
    while not what():
        assert time.monotonic() < latest
        time.sleep(0.01)


def test_a_worker_runs_functions_one_after_another(importable: Any) -> None:
    worker = Worker()
    try:
        threads, pid, group = worker.run(importable.environment)
        assert (threads, pid, group) == ("1", worker.pid, worker.pid)
        assert worker.run(importable.printing, 4) == 4
        os.kill(pid, signal.SIGINT)  # Ctrl-C is for the parent
        assert worker.receive(0.05) is None
        worker.submit(importable.reporting, reports=True)
        found = [worker.receive() for _ in range(3)]
        assert [(one.kind, one.content) for one in found if one] == [
            ("progress", (0.5, "half of it")), ("part", [1, 2]), ("result", "done")
        ]  # fmt: skip
    finally:
        worker.kill()
    assert not alive(pid)
    with pytest.raises(DiedError):
        worker.run(importable.printing, 4)


@pytest.mark.parametrize(
    ("kind", "error", "text"),
    [
        ("input", InputError, "gap = -1"),
        ("local", RuntimeError, "LocalError: of a class that nobody else knows"),
        ("unsendable", Exception, "lambda"),
        ("kill", DiedError, "signal 9"),
    ],
)
def test_what_goes_wrong_reaches_the_caller(importable: Any, kind: str, error: Any, text: str) -> None:
    worker = Worker()
    try:
        with pytest.raises(error, match=text) as caught:
            worker.run(importable.failing, kind)
        if kind == "input":
            assert len(caught.value.sentences) == 2
            assert "Traceback" in "".join(caught.value.__notes__)
    finally:
        worker.kill()


def test_an_end_takes_all_that_was_started(importable: Any, tmp_path: Path) -> None:
    worker, file = Worker(quiet=True), tmp_path / "started"
    worker.submit(importable.sleeping, str(file))
    pids = started(file)
    worker.kill()
    until(lambda: not any(map(alive, pids)))


PARENT = """
import sys, time
sys.path.insert(0, sys.argv[1])
import test_parallel
from softstart.parallel import Worker
worker = Worker()
worker.submit(test_parallel.sleeping, sys.argv[2])
time.sleep(600)
"""


def test_workers_end_with_a_parent_that_was_killed(tmp_path: Path) -> None:
    file = tmp_path / "started"
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(HERE), str(file)])
    try:
        pids = started(file)
    finally:
        parent.kill()
        parent.wait()
    until(lambda: not any(map(alive, pids)))


def test_a_pool_tries_the_task_of_a_dead_process_once_more(importable: Any, tmp_path: Path) -> None:
    with Pool(2) as pool:
        tasks = [str(tmp_path / name) for name in "ab"]
        assert sorted(pool.results(importable.dies_once, tasks)) == [(task, 7) for task in tasks]
        with pytest.raises(SimulationError, match=r"died 2 times \(signal 9\) while it computed kill"):
            list(pool.results(importable.failing, ["kill"]))


def test_a_pool_that_is_left_stops_what_runs(importable: Any, tmp_path: Path) -> None:
    files, pids = [tmp_path / name for name in "ab"], []

    def tasks() -> Any:
        yield from map(str, files)
        pids.extend(started(file)[0] for file in files)
        raise KeyboardInterrupt

    with Pool(2) as pool, pytest.raises(KeyboardInterrupt):
        list(pool.results(importable.sleeping, tasks()))
    assert len(pids) == 2
    assert not any(map(alive, pids))


def test_libraries_of_linear_algebra_compute_on_one_thread_and_then_as_before() -> None:
    def threads() -> list[int]:
        return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]

    with threadpool_limits(2, user_api="blas"):
        before = threads()
        assert set(before) == {2}
        assert set(single_threaded_blas(threads)()) == {1}
        assert threads() == before


def test_a_command_has_set_one_thread_before_numpy_is_imported() -> None:
    code = "import os, sys, softstart.cli; print('numpy' in sys.modules, os.environ['OMP_NUM_THREADS'])"
    given = {key: value for key, value in os.environ.items() if "THREADS" not in key}
    told = subprocess.run([sys.executable, "-c", code], env=given, capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["False", "1"]


@pytest.mark.slow
def test_a_plain_script_needs_no_guard(tmp_path: Path) -> None:
    """It may even make the controller that its workers play."""
    script = tmp_path / "mine.py"
    script.write_text(
        "from softstart import Command, PlainController, sweep\n"
        "class Full(PlainController):\n"
        "    def step(self, measured, state):\n"
        "        return Command(62.0)\n"
        "print(sweep('crane-4amtkf', Full(), {'gap': [0.5, 1.0]}, chunk=1).k_dyn.size)\n"
    )
    line = [sys.executable, "-W", "error", str(script)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "2\n")
