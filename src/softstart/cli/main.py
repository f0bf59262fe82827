"""The entry point: runs a command; every failure becomes sentences on standard error and an exit code."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Sequence
from contextlib import suppress
from types import FrameType, TracebackType
from typing import TextIO

import click

from softstart.cli.commands import cli, usage_sentence
from softstart.errors import DamagedWarning, InputError, SimulationError
from softstart.processes import end_now
from softstart.views.numbers import printable

DONE, FAILED, BAD_INPUT, NO_SOLUTION, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 3, 130, 141
DEBUG = "SOFTSTART_TRACEBACK"
REPEAT_AFTER = 0.5  # s until a stop signal that was lost is raised again
PATIENCE = 1.3  # s from a stop signal until the process ends, whatever it is doing
BUSY = 5.0  # times that at most, where processes queue for the processors
STOP = "interrupted; no incomplete file was left behind."
_STOPS: list[int] = []  # signals that this process was sent: however the command ends then, it was stopped


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `softstart ARGUMENTS` (those of the process by default); returns the exit code.

    0 done, 2 bad input or usage, 3 no solution, 130 interrupted, 141 the reader of a pipe closed it. After a
    failure standard output is empty.

    >>> main(["drives", "crane-4amtk"])
    2
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    if arguments is not None:
        return _main(given)
    sys.excepthook = _internal_error
    _watch_for_stops()
    _replace_unprintable()
    code = _main(given)
    if code == INTERRUPTED:
        end_now(code)  # threads in compiled code would be waited for
    for number in (signal.SIGINT, signal.SIGTERM):  # what is left is the interpreter's own end
        if signal.getsignal(number) is _stop:
            signal.signal(number, signal.SIG_DFL)
    return code


def _main(given: list[str]) -> int:
    try:
        with warnings.catch_warnings():
            _show_damage()
            code = _run(given)
            sys.stdout.flush()
        if code != DONE and _STOPS:
            raise KeyboardInterrupt  # it was lost, and what should have ended has failed instead
        return code
    except BaseException as error:
        if not _STOPS and not _is_stop(error):
            return _failed(error)
        _end_repetition()
        if os.environ.get(DEBUG) and not isinstance(error, KeyboardInterrupt):
            sys.__excepthook__(type(error), error, error.__traceback__)
        return _fail([STOP], INTERRUPTED)  # whatever a library has made of it
    finally:
        _end_repetition()


def _failed(error: BaseException) -> int:
    """Say what failed; an error that is a bug of softstart is raised again."""
    match error:
        case click.UsageError():
            return _fail([usage_sentence(error)], BAD_INPUT)
        case InputError():
            return _fail(error.sentences, BAD_INPUT)
        case SimulationError():
            return _fail([str(error)], NO_SOLUTION)
        case BrokenPipeError():
            _silence_stdout()
            return PIPE_CLOSED
        case OSError():
            _silence_stdout()
            return _fail([f"the output could not be written: {error.strerror or error}."], BAD_INPUT)
        case MemoryError():
            return _fail(["there is not enough memory for this."], NO_SOLUTION)
    raise error


def _run(arguments: list[str]) -> int:
    if "_SOFTSTART_COMPLETE" in os.environ:
        with suppress(InputError, click.UsageError):  # the line is wrong before its last word
            cli.main(arguments, prog_name="softstart")
        return DONE
    try:
        with cli.make_context("softstart", list(arguments), obj=tuple(arguments)) as context:
            cli.invoke(context)
    except click.exceptions.Exit as done:
        return done.exit_code
    return DONE


def _fail(sentences: Sequence[str], code: int) -> int:
    """Sentences on standard error, numbered if there are several."""
    lines = [printable(sentence.strip()) for sentence in sentences]
    if len(lines) == 1:
        text = f"softstart: {lines[0]}"
    else:
        numbered = (f"  {number}. {line}" for number, line in enumerate(lines, start=1))
        text = "\n".join([f"softstart: {len(lines)} things are wrong:", *numbered])
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        return code  # standard error is closed; the exit code remains
    return code


def _silence_stdout() -> None:
    """Discard what is still buffered: the interpreter would report at exit that it cannot be written."""
    try:
        descriptor = sys.stdout.fileno()
    except (OSError, ValueError):
        return
    os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)


def _replace_unprintable() -> None:
    """Print a question mark for a character that the terminal's encoding lacks, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="replace")


def _show_damage() -> None:
    """Print what is said of damaged results as sentences of the command."""
    usual = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, DamagedWarning):
            print(f"softstart: {message}", file=sys.stderr, flush=True)
        else:
            usual(message, category, filename, lineno, file, line)

    warnings.simplefilter("always", DamagedWarning)
    warnings.showwarning = show


def _watch_for_stops() -> None:
    """Let Ctrl-C and TERM raise KeyboardInterrupt, and end the process if nothing comes of that.

    Python runs its handlers between two of its own instructions: not as long as the main thread is in
    compiled code, or waits for a thread that is. The system writes the signal's number into a pipe at once,
    where another thread reads it.
    """
    sys.unraisablehook = _unraisable
    signal.signal(signal.SIGTERM, _stop)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _stop)
    if sys.platform == "win32":  # only sockets will do there
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    threading.Thread(target=_end_in_time, args=(reader,), daemon=True).start()


def _end_in_time(reader: int) -> None:
    while os.read(reader, 1)[0] not in (signal.SIGTERM, signal.SIGINT):
        pass  # the timer's
    queue = os.getloadavg()[0] / (os.cpu_count() or 1)
    time.sleep(PATIENCE * min(max(queue, 1.0), BUSY))
    _fail([STOP], INTERRUPTED)
    end_now(INTERRUPTED)


def _stop(number: int, frame: FrameType | None) -> None:
    """Ctrl-C or TERM. Callbacks of compiled libraries lose the exception, so a timer raises it again."""
    _STOPS.append(number)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _stop_again)
        signal.setitimer(signal.ITIMER_REAL, REPEAT_AFTER, REPEAT_AFTER)
    raise KeyboardInterrupt


def _unraisable(lost: sys.UnraisableHookArgs) -> None:
    """What was raised where nothing can catch it, as in callbacks of weak references: a stop comes again."""
    if not issubclass(lost.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(lost)


def _stop_again(number: int, frame: FrameType | None) -> None:
    if not _is_stop(sys.exc_info()[1]):  # else it is being handled
        raise KeyboardInterrupt


def _is_stop(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


def _end_repetition() -> None:
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _internal_error(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    """Report a bug of softstart itself. The interpreter then exits with 1, after Ctrl-C by its signal."""
    if issubclass(kind, KeyboardInterrupt):
        return
    if os.environ.get(DEBUG):
        sys.__excepthook__(kind, error, traceback)
        return
    text = " ".join(str(error).split())
    print(
        f"softstart: this is a bug in softstart, not in your input ({kind.__name__}: {text}); please "
        f"report it with the command you ran and what it prints with {DEBUG}=1 set.",
        file=sys.stderr,
    )
