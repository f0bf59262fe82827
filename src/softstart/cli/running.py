"""Running controllers for a command: progress, a notice of compilation, failures of user code."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.completion import folders
from softstart.cli.options import (
    Decorator,
    code_allowed,
    json_option,
    named_as_options,
    option,
    typed_command,
)
from softstart.errors import InputError, SimulationError
from softstart.hints import did_you_mean
from softstart.parallel import LOADED_FROM_FILE
from softstart.plugins import CONTROLLERS, registered
from softstart.results import Result
from softstart.stopping import at_stop
from softstart.views.markdown import output_folder
from softstart.views.terminal import print_json

if TYPE_CHECKING:
    from softstart.controller import Controller

EVERY = 30.0  # s between two lines of progress in a pipe
COMPILING = "compiling, once: half a minute at the first command after installation, less at others ..."
WRITTEN = "## Where this comes from\n\nsoftstart "  # in every report.md of softstart
_SAID: list[str] = []  # what this process has said of it

Output = Result | tuple[Any, ...]  # of `answers`


@contextmanager
def working(doing: str) -> Iterator[Callable[[str], None]]:
    """A status line on a terminal while something is done; what anyone prints goes to standard error.

    Gives what changes the line. In a pipe, where there is none, what is being done is a line of its own, at
    first after `EVERY` seconds and then as seldom. Whatever is compiled meanwhile is announced in both.
    """
    from rich.console import Console

    console = Console(stderr=True, highlight=False, markup=False)
    began = said = time.monotonic()  # said: when the last line was printed

    def seldom(now: str) -> None:
        nonlocal said
        if (at := time.monotonic()) - said >= EVERY:
            said = at
            print(f"softstart: {now} ... ({at - began:.0f} s)", file=sys.stderr, flush=True)

    with redirect_stdout(sys.stderr), _announced(lambda text: console.print(text, soft_wrap=True)):
        if not console.is_terminal:
            yield seldom
            return
        with console.status(doing) as status, at_stop(status.stop):
            yield lambda now: status.update(f"{now} ...")


@contextmanager
def _announced(say: Callable[[str], None]) -> Iterator[None]:
    """Say so when this process compiles for the first time; what comes from numba's cache is not compiled."""
    from numba.core import event

    class Notice(event.Listener):
        def on_start(self, event: event.Event) -> None:
            if not _SAID:
                _SAID.append(COMPILING)
                say(f"softstart: {COMPILING}")

        def on_end(self, event: event.Event) -> None:
            pass

    with event.install_listener("numba:compile", Notice()):
        yield


@contextmanager
def attributed(loading: str = "") -> Iterator[None]:
    """Turns an exception from the lines of a controller into a sentence that names the place.

    A controller is anyone's code and may fail in any way; an exception in which none has a part passes.
    With the name of a controller that is being loaded or made, what fails is bad input; without one, a start
    that could not be finished.
    """
    try:
        yield
    except (KeyboardInterrupt, MemoryError, InputError, SimulationError):
        raise
    except BaseException as error:
        modules, place = {point.module for point in registered(CONTROLLERS).values()}, ""
        for frame, line in traceback.walk_tb(error.__traceback__):  # the innermost frame is the last
            module = str(frame.f_globals.get("__name__", ""))
            if module in modules or module.startswith(LOADED_FROM_FILE):
                place = f" in {frame.f_code.co_filename}, line {line}"
        what = ": ".join(filter(None, [type(error).__name__, " ".join(str(error).split())]))
        if loading and (place or isinstance(error, ImportError | AttributeError | TypeError)):
            raise InputError(f'controller = "{loading}": it cannot be loaded{place} ({what}).') from error
        if place:
            raise SimulationError(f"The start was aborted: the controller failed{place} ({what}).") from error
        raise


def answers(out: bool = False) -> Decorator:
    """--json and, with `out`, --out; the command returns what is shown.

    That is a result; or its data for JSON, its sheet or a text and, if there is one, the error to raise at
    the end. That the folder of --out can be written is found before the command begins; it is filled at its
    end, and then the answer is printed. Errors name options, see `named_as_options`.
    """

    def decorate(command: Callable[..., Any]) -> Callable[..., None]:
        @wraps(command)
        def run(*, as_json: bool, out: str | None = None, **arguments: Any) -> None:
            from softstart.views import sheet

            with named_as_options(), output_folder(out) as folder:
                if out is not None:  # before anything is computed
                    _check_report(out)
                answer = command(**arguments)
                if isinstance(answer, Result):
                    answer = answer.summary, answer.sheet
                data, shown, *failures = answer
                if folder is not None:
                    with working("drawing the figures ..."):
                        sheet.export(shown, folder, typed_command())
            if as_json:
                print_json(data())
            elif isinstance(shown, str):
                print(shown, end="")
            else:
                sheet.print_sheet(shown)
                if out is not None:
                    print(f"\nWritten to {out}: report.md, figures and tables.")
            for failure in failures:  # after its data: tune shows what it has, and exits with 3
                raise failure

        return json_option(option("--out", shell_complete=folders)(run) if out else run)

    return decorate


def option_value(name: str) -> Any:
    """What the command that runs now has for --json ("as_json") or --out."""
    return click.get_current_context().params[name]


def _check_report(out: str) -> None:
    """Refuse a folder with a report.md that softstart has not written."""
    report = Path(out, "report.md")
    if report.is_file() and WRITTEN not in report.read_text(encoding="utf-8", errors="replace"):
        raise InputError(
            f'--out = "{out}": the report.md in it was not written by softstart; give another folder, or '
            "rename that file."
        )


def controllers_from_options(
    names: Sequence[str] | None, params: Mapping[str, str], several: bool = True
) -> list[Controller]:
    """The controllers of these names with the parameters of --param.

    `names`: None stands for all installed ones that need no further parameter. With `several` the keys of
    `params` begin with the name of a controller.
    """
    from softstart import controller

    known = names or list(registered(CONTROLLERS))
    parameters: dict[str, dict[str, str]] = {} if several else {known[0]: dict(params)}
    for whole, value in params.items() if several else ():
        name, _, key = whole.rpartition(".")
        if not (name and key):
            raise InputError(f'--param "{whole}={value}": write CONTROLLER.key=value, as ramp.time=0.2.')
        if name not in known:
            hint = did_you_mean(name, known)
            raise InputError(f'--param "{whole}={value}": {name} is not compared here; {hint}')
        parameters.setdefault(name, {})[key] = value
    controllers: list[Controller] = []
    for name in controller.ready_controller_names(parameters) if names is None else names:
        values = parameters.get(name, {})
        try:
            with attributed(name):
                controllers.append(controller.make_controller(name, values, allow_code=code_allowed()))
        except InputError as error:
            before = f"--param {name}." if several else "--param "
            # a controller of the user may say anything: one line each, of bounded length
            lines = [" ".join(sentence.split())[:1500] for sentence in error.sentences]
            raise InputError(before + s if s.startswith(tuple(values)) else s for s in lines) from None
    return controllers
