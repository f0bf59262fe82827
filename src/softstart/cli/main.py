"""The entry point: runs a command and turns whatever goes wrong into sentences and an exit code."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType, TracebackType

import click

from softstart.cli.commands import cli, usage_sentence
from softstart.errors import InputError, SimulationError
from softstart.late import late

completion = late("softstart.cli.completion")

DONE, FAILED, BAD_INPUT, NO_SOLUTION, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 3, 130, 141
DEBUG = "SOFTSTART_TRACEBACK"
UNHEARD = 0.5  # s after which a stop that nobody handles is repeated


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `softstart ARGUMENTS` (those of the process by default); returns the exit code.

    0 done, 2 bad input or usage, 3 no solution, 130 interrupted, 141 the reader of a pipe went away. What
    goes wrong is said on standard error; standard output is then empty.

    >>> main(["drives", "crane-4amtk"])
    2
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    if arguments is None:
        sys.excepthook = _own_mistake
        signal.signal(signal.SIGTERM, _stop)
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, _stop)
        _never_fail_on_letters()
    try:
        code = _run(given)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return _said_interrupted()
    except SystemError as error:
        if _is_stop(error):  # it came while compiled code looked at its arguments
            return _said_interrupted()
        raise
    except click.UsageError as error:
        return _say([usage_sentence(error)], BAD_INPUT)
    except InputError as error:
        return _say(error.sentences, BAD_INPUT)
    except SimulationError as error:
        return _say([str(error)], NO_SOLUTION)
    except BrokenPipeError:
        _silence_stdout()
        return PIPE_CLOSED
    except OSError as error:
        _silence_stdout()
        return _say([f"the output could not be written: {error.strerror or error}."], BAD_INPUT)
    except MemoryError:
        return _say(["there is not enough memory for this."], NO_SOLUTION)
    finally:
        _stop_is_heard()
    return code


def _said_interrupted() -> int:
    _stop_is_heard()
    return _say(["interrupted; nothing half-written was left behind."], INTERRUPTED)


def _run(arguments: list[str]) -> int:
    if "_SOFTSTART_COMPLETE" in os.environ:
        completion.register_shells()
        cli.main(arguments, prog_name="softstart")
    try:
        with cli.make_context("softstart", list(arguments), obj=tuple(arguments)) as context:
            cli.invoke(context)
    except click.exceptions.Exit as done:
        return done.exit_code
    return DONE


def _say(sentences: Sequence[str], code: int) -> int:
    """Sentences on standard error, numbered if there are several."""
    lines = [sentence.strip() for sentence in sentences]
    if len(lines) == 1:
        text = f"softstart: {lines[0]}"
    else:
        numbered = (f"  {number}. {line}" for number, line in enumerate(lines, start=1))
        text = "\n".join([f"softstart: {len(lines)} things are wrong:", *numbered])
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        return code  # nobody listens on standard error; the exit code still says it
    return code


def _silence_stdout() -> None:
    """Throw away what is still buffered, so that the interpreter does not complain at its end."""
    try:
        descriptor = sys.stdout.fileno()
    except (OSError, ValueError):
        return
    os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)


def _never_fail_on_letters() -> None:
    """A letter that the terminal's encoding does not have becomes a question mark, not a failure."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="replace")


def _stop(number: int, frame: FrameType | None) -> None:
    """Ctrl-C or TERM. Where no exception can pass (callbacks of compiled libraries) it is lost: so again."""
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _stop_again)
        signal.setitimer(signal.ITIMER_REAL, UNHEARD, UNHEARD)
    raise KeyboardInterrupt


def _stop_again(number: int, frame: FrameType | None) -> None:
    if not _is_stop(sys.exc_info()[1]):  # else it is heard, and cleans up
        raise KeyboardInterrupt


def _is_stop(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


def _stop_is_heard() -> None:
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _own_mistake(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    """The last resort: a mistake of softstart itself. The interpreter then exits with 1."""
    if os.environ.get(DEBUG):
        sys.__excepthook__(kind, error, traceback)
        return
    text = " ".join(str(error).split())
    print(
        f"softstart: this is a mistake in softstart, not in your input ({kind.__name__}: {text}); please "
        f"report it with the command you ran and what it prints with {DEBUG}=1 set.",
        file=sys.stderr,
    )
