"""Running controllers for a command: progress, a notice of compilation, failures of user code."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from types import TracebackType
from typing import TYPE_CHECKING, Any

from softstart.cli.options import code_allowed, command_line
from softstart.errors import InputError, Mistakes, SimulationError
from softstart.late import late
from softstart.plugins import CONTROLLERS, registered
from softstart.stopping import at_stop
from softstart.views.markdown import output_folder
from softstart.views.terminal import print_json

if TYPE_CHECKING:
    import rich.console as rich_console
    from numba.core import event
    from rich.status import Status

    from softstart import controller
    from softstart.views import sheet
    from softstart.views.sheet import Sheet
else:
    rich_console, event = late("rich.console"), late("numba.core.event")
    controller, sheet = late("softstart.controller"), late("softstart.views.sheet")

LOOSE_MODULE = "softstart_loose_"  # how softstart.controller.finding names modules of loose files
EVERY = 30.0  # s between two lines of progress in a pipe
COMPILING = "compiling, once: half a minute at the first command after installation, less at others ..."
_SAID: list[str] = []  # what this process has said of it


Progress = Callable[[str], None]


@contextmanager
def working(doing: str) -> Iterator[Progress]:
    """A status line on a terminal while something is done; what anyone prints goes to standard error.

    Gives what changes the line. In a pipe, where there is none, what is being done is a line of its own, at
    first after `EVERY` seconds and then as seldom. Whatever is compiled meanwhile is announced in both.
    """
    console = rich_console.Console(stderr=True, highlight=False, markup=False)
    with redirect_stdout(sys.stderr):
        if not console.is_terminal:
            with _announced(None):
                yield _seldom()
            return
        with console.status(doing) as status, at_stop(status.stop), _announced(status):
            yield lambda now: status.update(f"{now} ...")


def _seldom() -> Progress:
    """Prints what is being done, and since when."""
    began = said = time.monotonic()

    def progress(now: str) -> None:
        nonlocal said
        if (at := time.monotonic()) - said >= EVERY:
            said = at
            print(f"softstart: {now} ... ({at - began:.0f} s)", file=sys.stderr, flush=True)

    return progress


@contextmanager
def _announced(status: Status | None) -> Iterator[None]:
    class Notice(event.Listener):
        """Speaks when this process compiles for the first time; what comes from numba's cache is not."""

        def on_start(self, event: event.Event) -> None:
            if not _SAID:
                _SAID.append(COMPILING)
                if status is not None:
                    status.console.print(f"softstart: {COMPILING}")
                else:
                    print(f"softstart: {COMPILING}", file=sys.stderr, flush=True)

        def on_end(self, event: event.Event) -> None:
            pass

    notice = Notice()
    event.register("numba:compile", notice)  # type: ignore[no-untyped-call]
    try:
        yield
    finally:
        event.unregister("numba:compile", notice)  # type: ignore[no-untyped-call]


class Attributed:
    """Turns an exception from the lines of a controller into a sentence that names the place.

    A controller is anyone's code and may fail in any way; an exception in which none has a part passes.
    With the name of a controller that is being loaded or made, what fails is bad input; without one, a start
    that could not be finished.
    """

    def __init__(self, loading: str = "") -> None:
        self.loading = loading
        self.modules = {point.module for point in registered(CONTROLLERS).values()}

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if isinstance(error, KeyboardInterrupt | MemoryError | InputError | SimulationError | None):
            return
        place = self._place(traceback)
        what = ": ".join(filter(None, [type(error).__name__, " ".join(str(error).split())]))
        if self.loading and (place or isinstance(error, ImportError | AttributeError | TypeError)):
            at = f" in {place}" if place else ""
            raise InputError(f'controller = "{self.loading}": it cannot be loaded{at} ({what}).') from error
        if place:
            raise SimulationError(
                f"The start was given up: the controller failed in {place} ({what})."
            ) from error

    def _place(self, traceback: TracebackType | None) -> str:
        """File and line of the innermost frame in a controller, empty if there is none."""
        place = ""
        while traceback is not None:
            module = str(traceback.tb_frame.f_globals.get("__name__", ""))
            if module in self.modules or module.startswith(LOOSE_MODULE):
                place = f"{traceback.tb_frame.f_code.co_filename}, line {traceback.tb_lineno}"
            traceback = traceback.tb_next
        return place


@contextmanager
def answering(as_json: bool, out: str | None) -> Iterator[Callable[[Callable[[], Any], Sheet], None]]:
    """The answer of a command: the block gives the data for JSON and the sheet to what is yielded.

    That the folder of --out can be written is found before the block begins; it is filled at its end. Then
    the answer is printed.
    """
    given: list[tuple[Callable[[], Any], Sheet]] = []
    with output_folder(out) as folder:
        yield lambda data, shown: given.append((data, shown))
        if folder is not None:
            with working("drawing the figures ..."):
                for _, shown in given:
                    sheet.export(shown, folder, command_line())
    for data, shown in given:
        if as_json:
            print_json(data())
        else:
            sheet.show(shown)
            if out is not None:
                print(f"\nWritten to {out}: report.md, figures and tables.")


def make_controllers(
    names: Sequence[str] | None, parameters: Mapping[str, Mapping[str, str]], prefix: bool
) -> list[controller.Controller]:
    """The controllers of these names with their parameters; all errors at once.

    `names`: None stands for all installed ones that need no further parameter. `prefix` puts the controller's
    name before each key in the sentences.
    """
    mistakes = Mistakes()
    made: list[controller.Controller] = []
    for name in controller.ready_controller_names(parameters) if names is None else names:
        given = parameters.get(name, {})
        try:
            with Attributed(name):
                made.append(controller.make_controller(name, given, allow_code=code_allowed()))
        except InputError as error:
            mistakes.sentences += [
                f"--param {name + '.' if prefix else ''}{s}" if s.startswith(tuple(given)) else s
                for s in map(_one_line, error.sentences)
            ]
    mistakes.settle()
    return made


def _one_line(sentence: str) -> str:
    """The first lines of an error message of numba, which may fill pages."""
    lines = [line.strip() for line in sentence.splitlines() if line.strip()]
    return " ".join(lines[:3]) + (" ..." if len(lines) > 3 else "") if len(lines) > 1 else sentence
