"""A reader of a page, who does what it says, in an empty folder.

The first command of a page, and all that need a shell, are typed into one and run the installed `softstart`.
The others run in forks of a process that has imported everything, which saves each about a second.
"""

from __future__ import annotations

import json
import os
import re
import select
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import IO

from tests.docs.shown import among, difference, named
from tests.docs.steps import Step

ROOT = Path(__file__).parents[2]
WATCHED = 5.0  # s for which a long command of which the page shows nothing must go on
PRINTED = 60.0  # s after which it must have printed what the page shows of it
PATIENCE = 300.0  # s for a command that is not called long, on a machine that may be busy
INTERRUPTED = 130
SHELL = re.compile(r"[|&;<>$`*?~{}()\\]")  # what only a shell understands
WARM = """
import contextlib, io, json, os, signal, sys, threading
sys.path.remove("")
import casadi, control, matplotlib.backends.backend_agg, matplotlib.figure, xarray, zarr
from softstart.cli import main
with contextlib.redirect_stdout(io.StringIO()):
    for line in ("compare", "optimize --start-time 1.2x"):
        assert main(line.split()) == 0
for thread in threading.enumerate()[1:]:  # a process with threads is not to be forked
    thread.join()
print("ready", flush=True)
for line in sys.stdin:
    asked = json.loads(line)
    ready, begun = os.pipe()
    child = os.fork()
    if not child:
        os.setsid()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.chdir(asked["folder"])
        for number, name in enumerate(["/dev/null", asked["out"], asked["err"]]):
            os.dup2(os.open(name, os.O_RDWR | os.O_APPEND), number)
        os.close(ready)
        os.close(begun)
        sys.argv = ["softstart", *asked["words"]]
        sys.exit(main())
    os.close(begun)
    os.read(ready, 1)
    os.close(ready)
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@cache
def _warm() -> subprocess.Popen[bytes]:
    """The process that forks; it ends with this one, which holds the other end of its pipe."""
    process = subprocess.Popen(
        [sys.executable, "-c", WARM], cwd=ROOT, env=_environment(), bufsize=0,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    assert process.stdout
    assert process.stdout.readline() == b"ready\n"
    return process


def end_warm() -> None:
    """End the warm process, if there is one."""
    if _warm.cache_info().currsize:
        _warm().communicate()
        _warm.cache_clear()


class Forked:
    """A command that runs in a fork of the warm process, like a Popen."""

    def __init__(self, words: list[str], folder: Path, out: str, err: str) -> None:
        self.returncode: int | None = None
        self.out, self.err = out, err
        warm = _warm()
        assert warm.stdin
        assert warm.stdout
        self.answers = warm.stdout
        asked = {"words": words, "folder": str(folder), "out": out, "err": err}
        warm.stdin.write(json.dumps(asked).encode() + b"\n")
        self.pid = int(self.answers.readline())

    def poll(self, seconds: float = 0.0) -> int | None:
        if self.returncode is None and select.select([self.answers], [], [], seconds)[0]:
            self.returncode = int(self.answers.readline())
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        if self.poll(PATIENCE if timeout is None else timeout) is None:
            raise subprocess.TimeoutExpired("softstart", timeout or PATIENCE)
        return Path(self.out).read_text("utf-8"), Path(self.err).read_text("utf-8")


Process = subprocess.Popen[str] | Forked


@dataclass
class Reader:
    """Does steps in `folder`; `wrong` has a sentence for each that did not go as the page says."""

    folder: Path
    page: str
    wrong: list[str] = field(default_factory=list)
    python: str = ""
    typed: bool = False

    def do(self, step: Step) -> None:
        """One step."""
        if step.kind == "file":
            path = self.folder / step.name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(step.text, encoding="utf-8")
            return
        if problem := self._command(step) if step.kind == "command" else self._python(step):
            first = step.text.strip().splitlines()[0]
            self.wrong.append(f"{self.page}:{step.line}: {first}\n    {problem}")

    def _command(self, step: Step) -> str:
        if step.text.startswith("make"):
            # CI makes them; here it is enough that make knows how
            words = step.text.split("#")[0].split()
            return _ended(_run([words[0], "-n", *words[1:]], ROOT), 0)
        shell = not self.typed or bool(SHELL.search(step.text.partition("#")[0]))
        self.typed = True
        words = ["bash", "-c", step.text] if shell else shlex.split(step.text, comments=True)
        if step.long:
            return _watched(words, self.folder, step.output)
        done = _run(words, self.folder)
        missing = [one for one in named(step.text.rpartition("#")[2].strip()) if not among(one, done.stdout)]
        said = f"not printed: {', '.join(missing)}" if missing else ""
        return _as_shown(done, step) or said

    def _python(self, step: Step) -> str:
        code = step.text
        if ">>>" in code:
            name = self.folder / "session.txt"
            name.write_text(code, encoding="utf-8")
            words = ["-m", "doctest", "-o", "ELLIPSIS", "-o", "NORMALIZE_WHITESPACE", str(name)]
            return _ended(_run([sys.executable, *words], self.folder), 0)
        code = self.python + "\n" + code if step.continued else code
        name = self.folder / "_page_script.py"
        name.write_text(code, encoding="utf-8")
        self.python = code
        if step.long:
            return _watched([sys.executable, str(name)], self.folder, step.output)
        return _as_shown(_run([sys.executable, str(name)], self.folder), step)


def _as_shown(done: subprocess.CompletedProcess[str], step: Step) -> str:
    """What is wrong with a command that has ended."""
    printed = done.stdout + ("\n" + done.stderr if step.exit_code else "")
    problem = _ended(done, step.exit_code)
    return problem if problem or step.output is None else difference(step.output, printed)


def _environment() -> dict[str, str]:
    """That of a new user: this installation first on the path, nothing that changes how output looks."""
    known = {
        k: v for k, v in os.environ.items() if not re.match(r"COLUMNS|LINES|PYTEST|SOFTSTART|FORCE_COLOR", k)
    }
    path = os.pathsep.join([str(Path(sys.executable).parent), known.get("PATH", "")])
    return known | {"PATH": path, "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}


@contextmanager
def _started(words: list[str], folder: Path, stdout: int | IO[str] = subprocess.PIPE) -> Iterator[Process]:
    """The process, in a group of its own that is gone afterwards."""
    if words[0] == "softstart":
        with tempfile.NamedTemporaryFile() as out, tempfile.NamedTemporaryFile() as err:
            told = out.name if isinstance(stdout, int) else stdout.name
            forked = Forked(words[1:], folder, told, err.name)
            try:
                yield forked
            finally:
                if forked.poll() is None:
                    os.killpg(forked.pid, signal.SIGKILL)
                    forked.poll(PATIENCE)
        return
    with subprocess.Popen(
        words, cwd=folder, env=_environment(), text=True, stdin=subprocess.DEVNULL,
        stdout=stdout, stderr=subprocess.PIPE, start_new_session=True,
        preexec_fn=_hears_ctrl_c,  # noqa: PLW1509 - there are no threads here
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


def _hears_ctrl_c() -> None:
    """As from a terminal: what is started in the background by a shell is deaf to it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _run(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    with _started(words, folder) as process:
        try:
            out, err = process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            out, err = process.communicate()
            err += f"not done after {PATIENCE:g} s: mark it <!-- long: ... -->"
        code = process.returncode
    assert code is not None
    return subprocess.CompletedProcess(words, code, out, err)


def _ended(done: subprocess.CompletedProcess[str], code: int) -> str:
    if done.returncode != code:
        last = "\n    ".join(done.stderr.strip().splitlines()[-6:])
        return f"exit code {done.returncode} instead of {code}: {last}"
    return ""


def _watched(words: list[str], folder: Path, shown: str | None) -> str:
    """Start, see it at work, interrupt: a command of softstart then ends with 130.

    Where the page shows what it prints, being at work is to have printed that.
    """
    if words[0] == "bash":
        words = [*words[:-1], f"exec {words[-1]}"]
    with tempfile.NamedTemporaryFile("r", encoding="utf-8") as out:
        with open(out.name, "w", encoding="utf-8") as written, _started(words, folder, written) as process:
            began = time.perf_counter()
            while process.poll() is None and not _seen(time.perf_counter() - began, out, shown):
                time.sleep(0.2)
            if process.poll() is None:
                err = _interrupted(process)
            else:
                err = process.communicate()[1].strip()
                if process.returncode == 0:
                    return "ended by itself: it is not long, take the mark away"
                return f"exit code {process.returncode} at once: {err[-500:]}"
        missing = difference(shown, _all_of(out), ended=False) if shown is not None else ""
    if err is None:
        return "does not end after Ctrl-C"
    expected = (INTERRUPTED, 1, -signal.SIGINT) if words[0] == sys.executable else (INTERRUPTED,)
    if process.returncode in expected:
        return missing
    return f"exit code {process.returncode} instead of 130 after Ctrl-C: {err.strip()[-500:]}"


def _seen(seconds: float, out: IO[str], shown: str | None) -> bool:
    """Whether a long command has been watched long enough."""
    if shown is None:
        return seconds > WATCHED
    return not difference(shown, _all_of(out), ended=False) or seconds > PRINTED


def _all_of(out: IO[str]) -> str:
    out.seek(0)
    return out.read()


def _interrupted(process: Process) -> str | None:
    """What it said after Ctrl-C, pressed again as a person would; None if it goes on all the same."""
    for _ in range(4):
        os.killpg(process.pid, signal.SIGINT)
        try:
            return process.communicate(timeout=15)[1]
        except subprocess.TimeoutExpired:
            continue
    return None
