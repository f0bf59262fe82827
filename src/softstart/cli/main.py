"""The entry point: runs a command; every failure becomes sentences on standard error and an exit code."""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import warnings
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from types import TracebackType
from typing import Any

from softstart.errors import DamagedWarning, InputError, SimulationError
from softstart.stopping import STOPPING, at_stop, stop_now

DONE, FAILED, BAD_INPUT, NO_SOLUTION, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 3, 130, 141
DEBUG = "SOFTSTART_TRACEBACK"
STOP = "interrupted; no incomplete file was left behind."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `softstart ARGUMENTS` (those of the process by default); returns the exit code.

    0 done, 2 bad input or usage, 3 no solution, 130 interrupted, 141 the reader of a pipe closed it. After a
    failure standard output is empty.

    >>> main(["drives", "crane-4amtk"])
    2
    """
    if arguments is not None:
        return _main(list(arguments))
    sys.excepthook = _internal_error
    _open_closed_streams()
    for stream in (sys.stdout, sys.stderr):  # a question mark for what the terminal's encoding lacks
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    with at_stop(partial(_fail, [STOP], INTERRUPTED)):
        watcher = _stop_on_signals()
        code = _main(sys.argv[1:])
        if STOPPING.is_set():
            watcher.join()  # until the process is ended
    return code


def _open_closed_streams() -> None:
    """Open standard streams that are closed as null devices; else another file would get their number.

    Input ends at once, output fails as on a full disk, and messages are lost: the exit code remains.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_WRONLY if name == "stderr" else os.O_RDONLY), number)
            mode = "w" if number else "r"
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115


def _main(arguments: list[str]) -> int:
    try:
        with warnings.catch_warnings():
            usual = warnings.showwarning

            def show(message: Warning | str, category: type[Warning], *where: Any, **also: Any) -> None:
                if issubclass(category, DamagedWarning):
                    print(f"softstart: {message}", file=sys.stderr, flush=True)
                else:
                    usual(message, category, *where, **also)

            warnings.simplefilter("always", DamagedWarning)  # else once for each line of code
            warnings.showwarning = show
            code = _run(arguments)
            sys.stdout.flush()
        return code
    except BaseException as error:
        return INTERRUPTED if STOPPING.is_set() else _failed(error, arguments)


def _run(arguments: list[str]) -> int:
    import click

    from softstart.cli.commands import cli

    if "_SOFTSTART_COMPLETE" in os.environ:
        with suppress(InputError, click.UsageError):  # the line is wrong before its last word
            cli.main(arguments, prog_name="softstart")
        return DONE
    if STOPPING.is_set():
        return INTERRUPTED
    try:
        with cli.make_context("softstart", list(arguments), obj=tuple(arguments)) as context:
            cli.invoke(context)
    except click.exceptions.Exit as done:
        return done.exit_code
    return DONE


def _failed(error: BaseException, arguments: list[str]) -> int:
    """Say what failed; an error that is a bug of softstart is raised again."""
    import click

    from softstart.cli.commands import usage_sentence

    match error:
        case click.UsageError():
            return _fail([usage_sentence(error, *arguments[:1])], BAD_INPUT)
        case InputError():
            return _fail(error.sentences, BAD_INPUT)
        case SimulationError():
            return _fail([str(error)], NO_SOLUTION)
        case OSError():
            with suppress(
                OSError, ValueError
            ):  # what is still buffered is reported at exit, if not discarded
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            if isinstance(error, BrokenPipeError):
                return PIPE_CLOSED
            return _fail([f"the output could not be written: {error.strerror or error}."], BAD_INPUT)
        case MemoryError():
            return _fail(["there is not enough memory for this."], NO_SOLUTION)
        case KeyboardInterrupt():
            return _fail([STOP], INTERRUPTED)
    raise error


def _fail(sentences: Sequence[str], code: int) -> int:
    """Sentences on standard error, numbered if there are several."""
    from softstart.views.numbers import printable

    lines = [printable(sentence.strip()) for sentence in sentences]
    if len(lines) > 1:
        lines = [f"{len(lines)} errors:", *(f"  {n}. {line}" for n, line in enumerate(lines, 1))]
    with suppress(OSError):  # standard error is closed: the exit code remains
        print("softstart: " + "\n".join(lines), file=sys.stderr, flush=True)
    return code


def _stop_on_signals() -> threading.Thread:
    """Let Ctrl-C, TERM and HUP end the process, whatever its main thread is doing.

    Python runs its own handlers between two instructions of Python: not as long as compiled code runs, and in
    callbacks of libraries their exceptions are lost. The number of a signal is put into a socket at once,
    where another thread waits for it. Whoever sets a handler of his own, as a server, is left alone.
    """
    reader, writer = socket.socketpair()
    writer.setblocking(False)  # required of a wakeup descriptor
    signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)

    def handler(number: int, frame: object) -> None:
        STOPPING.set()

    def watch() -> None:
        with writer:
            while signal.getsignal(reader.recv(1)[0]) is not handler:
                pass
            stop_now(INTERRUPTED)

    for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # the last one when a terminal closes; Windows has none
        number = getattr(signal, name, signal.SIGINT)
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    return watcher


def _internal_error(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    """Report a bug of softstart itself. The interpreter then exits with 1."""
    if os.environ.get(DEBUG):
        sys.__excepthook__(kind, error, traceback)
        return
    print(
        f"softstart: this is a bug in softstart, not in your input ({kind.__name__}: "
        f"{' '.join(str(error).split())}); please report it with the command you ran and what it prints with "
        f"{DEBUG}=1 set.",
        file=sys.stderr,
    )
