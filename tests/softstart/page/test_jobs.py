"""Jobs: a queue, progress, a cancel that stops, and no process that outlives its server."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from softstart import InputError
from softstart.page.jobs import MISTAKE, NICENESS, OUT_OF_MEMORY, Job, Jobs, JobState
from softstart.stopping import AT_STOP

HERE = Path(__file__).parent


@pytest.fixture
def works(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The functions, importable also in the processes: these get the path of this one."""
    monkeypatch.syspath_prepend(str(HERE))
    import works_for_jobs

    return works_for_jobs


@pytest.fixture
def jobs() -> Iterator[Jobs]:
    jobs = Jobs(limit=1)
    yield jobs
    jobs.end()


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return not Path(f"/proc/{pid}/stat").is_file() or ") Z " not in Path(f"/proc/{pid}/stat").read_text()


def until(what: Callable[[], bool]) -> None:
    latest = time.monotonic() + 300.0  # jobs give way to all others; what is not ended runs for longer
    while not what():
        assert time.monotonic() < latest
        time.sleep(0.01)


def spare(jobs: Jobs) -> int:
    """The process that waits for the next job."""
    until(lambda: jobs._spare is not None)
    assert jobs._spare is not None
    return jobs._spare.pid


def over(*jobs: Job) -> bool:
    until(lambda: all(job.state.over for job in jobs))
    return True


def test_one_after_another_in_processes_of_low_priority(jobs: Jobs, works: Any, tmp_path: Path) -> None:
    log = str(tmp_path / "log")
    begun = [
        jobs.begin(user, line, works.collect, log, line)
        for user, line in (("A", "1"), ("A", "2"), ("B", "3"))
    ]
    until(lambda: begun[0].state is not JobState.WAITING)
    assert [job.ahead for job in begun] == [0, 0, 1]
    assert over(*begun)
    assert Path(log).read_text().split() == ["1", "2", "3"]
    for job in begun:
        assert (job.state, job.share, job.message) == (JobState.DONE, 1.0, "half of it")
        assert job.sentences == ()
        pid, niceness, threads = job.result
        assert (pid, niceness, threads) == (job.pid, min(os.nice(0) + NICENESS, 19), "1")
        assert not alive(pid)
    assert len({job.pid for job in begun} | {os.getpid()}) == 4


def test_two_at_once_and_an_end_with_the_last_tab_and_the_server(works: Any, tmp_path: Path) -> None:
    jobs = Jobs(limit=2)
    try:
        jobs.enter("A", "tab")
        first = jobs.begin("A", "1", works.endless, str(tmp_path / "1"))
        other = jobs.begin("B", "2", works.endless, str(tmp_path / "2"))
        waits = jobs.begin("A", "3", works.endless, str(tmp_path / "3"))
        until(lambda: (tmp_path / "1").exists() and (tmp_path / "2").exists())
        assert waits.state is JobState.WAITING
        waits.cancel()
        assert (waits.state, waits.pid, waits.seconds) == (JobState.CANCELLED, None, 0.0)
        jobs.leave("A", "tab")
        until(lambda: first.state.over)
        assert (first.state, other.state) == (JobState.CANCELLED, JobState.RUNNING)
    finally:
        jobs.end()
    assert other.state is JobState.CANCELLED
    assert not any(alive(job.pid) for job in (first, other) if job.pid)
    with pytest.raises(InputError, match="ending"):
        jobs.begin("A", "late", works.collect, str(tmp_path / "log"), "late")


def test_cancel_ends_even_a_deaf_process(jobs: Jobs, works: Any, tmp_path: Path) -> None:
    endless = jobs.begin("A", "endless", works.endless, str(tmp_path / "started"))
    started = tmp_path / "started"
    until(lambda: started.exists() and len(started.read_text().split()) == 2 and endless.message != "")
    assert (endless.state, endless.share, endless.message) == (JobState.RUNNING, None, "without an end")
    own, other = map(int, started.read_text().split())
    assert endless.pid == own
    assert alive(other)
    os.kill(endless.pid, signal.SIGINT)  # Ctrl-C goes to all processes of a terminal
    time.sleep(0.2)
    assert endless.state is JobState.RUNNING
    endless.cancel()
    until(lambda: endless.state.over)
    assert endless.state is JobState.CANCELLED
    assert not alive(own)
    until(lambda: not alive(other))  # killed too
    endless.cancel()
    assert endless.state is JobState.CANCELLED


@pytest.mark.parametrize(
    ("how", "sentences"),
    [
        ("input", ("gap = -1: a gap is 0 or more.", "load.inertia = 0: it must be above 0.")),
        ("simulation", ("The start cannot be finished.",)),
        ("memory", (OUT_OF_MEMORY,)),
        ("mistake", (MISTAKE,)),
        ("unsendable", (MISTAKE,)),
        ("killed", None),
    ],
)
def test_failures_are_sentences(
    jobs: Jobs, works: Any, how: str, sentences: Any, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR, "softstart.page"):
        job = jobs.begin("A", how, works.failing, how)
        assert over(job)
    assert job.state is JobState.FAILED
    assert job.result is None
    if sentences is None:
        assert "signal 9" in job.sentences[0]
    else:
        assert job.sentences == sentences
    assert ("Traceback" in caplog.text) == (sentences == (MISTAKE,))
    assert "Traceback" not in "".join(job.sentences)


def test_a_process_waits_for_the_next_job(works: Any, tmp_path: Path) -> None:
    """A dead one is replaced unnoticed; none outlives the server."""
    before = len(AT_STOP)
    jobs = Jobs(limit=1, modules=["works_for_jobs"])
    try:
        jobs.warm()
        os.kill(dead := spare(jobs), signal.SIGKILL)
        until(lambda: not alive(dead))
        job = jobs.begin("A", "quick", works.collect, str(tmp_path / "log"), "quick")
        assert over(job)
        assert job.state is JobState.DONE
        last = spare(jobs)
    finally:
        jobs.end()
    assert not alive(last)
    assert len(AT_STOP) == before  # nor does anything wait to be ended


SERVER = """
import sys, time
sys.path.insert(0, sys.argv[1])
import works_for_jobs
from softstart.page.jobs import Jobs
job = Jobs().begin("A", "endless", works_for_jobs.endless, sys.argv[2])
time.sleep(600)
"""


def test_processes_end_with_a_server_that_was_killed(tmp_path: Path) -> None:
    script, started = tmp_path / "server.py", tmp_path / "started"
    script.write_text(SERVER, encoding="utf-8")
    server = subprocess.Popen([sys.executable, str(script), str(HERE), str(started)])
    try:
        until(lambda: started.exists() and bool(started.read_text()))
    finally:
        server.kill()
        server.wait()
    pids = [int(word) for word in started.read_text().split()]
    assert len(pids) == 2
    until(lambda: not any(map(alive, pids)))
