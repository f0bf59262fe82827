"""A reader of a page, who does what it says, in an empty folder.

The first command of a page, and all that need a shell, are typed into one and run the installed `softstart`.
The others run in forks of a process that has imported everything (`warm.py`): a second less for each.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from tests.docs.shown import among, difference, named
from tests.docs.steps import Step

from softstart.cli import main

ROOT = Path(__file__).parents[2]
WATCHED = 5.0  # s for which a long command of which the page shows nothing must go on
PRINTED = 60.0  # s after which it must have printed what the page shows of it
PATIENCE = 300.0  # s for a command that is not called long, on a machine that may be busy
INTERRUPTED = 130
SHELL = re.compile(r"[|&;<>$`*?~{}()\\]")  # what only a shell understands
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(["tests.docs.warm"])


def _typed(words: list[str], folder: Path, out: str, err: str) -> None:
    """In a process of its own: run the command there, as from a terminal."""
    os.setsid()
    os.chdir(folder)
    for number, name in enumerate([os.devnull, out, err]):
        os.dup2(os.open(name, os.O_RDWR | os.O_APPEND), number)
    # what is started in the background by a shell is deaf to Ctrl-C
    if words[0] != "softstart":
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.execvpe(words[0], words, _environment())
    signal.signal(signal.SIGINT, signal.default_int_handler)
    wanted = _environment()
    os.environ.clear()
    os.environ.update(wanted)
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    sys.argv = words
    sys.exit(main())


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
        elif problem := self._command(step) if step.kind == "command" else self._python(step):
            first = step.text.strip().splitlines()[0]
            self.wrong.append(f"{self.page}:{step.line}: {first}\n    {problem}")

    def _command(self, step: Step) -> str:
        if step.text.startswith("make"):
            # CI makes them; here it is enough that make knows how
            words = step.text.split("#")[0].split()
            return _ended(_run([words[0], "-n", *words[1:]], ROOT), 0)
        shell = not self.typed or bool(SHELL.search(step.text.partition("#")[0]))
        self.typed = True
        words = shlex.split(step.text, comments=True)
        if shell:
            words = ["bash", "-c", f"exec {step.text}" if step.long else step.text]
        done = _run(words, self.folder, step)
        missing = [one for one in named(step.text.rpartition("#")[2].strip()) if not among(one, done.stdout)]
        said = f"not printed: {', '.join(missing)}" if missing and not step.long else ""
        return _as_shown(done, step) or said

    def _python(self, step: Step) -> str:
        if ">>>" in step.text:
            name = self.folder / "session.txt"
            name.write_text(step.text, encoding="utf-8")
            words = ["-m", "doctest", "-o", "ELLIPSIS", "-o", "NORMALIZE_WHITESPACE", str(name)]
            return _ended(_run([sys.executable, *words], self.folder), 0)
        self.python = self.python + "\n" + step.text if step.continued else step.text
        name = self.folder / "_page_script.py"
        name.write_text(self.python, encoding="utf-8")
        return _as_shown(_run([sys.executable, str(name)], self.folder, step), step)


def _as_shown(done: subprocess.CompletedProcess[str], step: Step) -> str:
    """What is wrong with a command that has ended, or that was interrupted if it is long."""
    python = step.kind == "python"
    problem = _ended(done, *((INTERRUPTED, 1, -signal.SIGINT) if python else (INTERRUPTED,))
                     if step.long else (step.exit_code,))  # fmt: skip
    printed = done.stdout + ("\n" + done.stderr if step.exit_code else "")
    return problem or (difference(step.output, printed, ended=not step.long) if step.output else "")


def _ended(done: subprocess.CompletedProcess[str], *codes: int) -> str:
    if done.returncode in codes:
        return ""
    last = "\n    ".join(done.stderr.strip().splitlines()[-6:])
    return f"exit code {done.returncode} instead of {codes[0]}: {last}"


def _environment() -> dict[str, str]:
    """That of a new user: this installation first on the path, nothing that changes how output looks."""
    known = {
        k: v for k, v in os.environ.items() if not re.match(r"COLUMNS|LINES|PYTEST|SOFTSTART|FORCE_COLOR", k)
    }
    path = os.pathsep.join([str(Path(sys.executable).parent), known.get("PATH", "")])
    return known | {"PATH": path, "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}


def _run(words: list[str], folder: Path, step: Step | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; a long one until it has been seen at work, and then press Ctrl-C.

    Where the page shows what it prints, being at work is to have printed that.
    """
    long, shown = (step.long, step.output) if step else (False, None)
    with tempfile.NamedTemporaryFile("r") as out, tempfile.NamedTemporaryFile("r") as err:
        process = FORKS.Process(target=_typed, args=(words, folder, out.name, err.name))
        process.start()
        began, press = time.monotonic(), 0.0
        try:
            while process.is_alive():
                seconds = time.monotonic() - began
                if seconds > PATIENCE:
                    raise AssertionError(f"{words}: not done after {PATIENCE:g} s: mark it as long")
                if long and _seen(seconds, out.name, shown) and seconds > press:
                    press = seconds + 15.0  # then again, as a person would
                    os.killpg(process.pid, signal.SIGINT)
                time.sleep(0.02)
        finally:
            if process.is_alive():
                os.killpg(process.pid, signal.SIGKILL)
        return subprocess.CompletedProcess(words, process.exitcode or 0, out.read(), err.read())


def _seen(seconds: float, out: str, shown: str | None) -> bool:
    """Whether a long command has been watched long enough."""
    if shown is None:
        return seconds > WATCHED
    return not difference(shown, Path(out).read_text(), ended=False) or seconds > PRINTED
