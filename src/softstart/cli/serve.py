"""`softstart serve`: the interactive page in a browser."""

from __future__ import annotations

import threading
import webbrowser
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command
from softstart.cli.options import drive_argument, read_machine, set_option
from softstart.cli.running import working
from softstart.errors import Mistakes
from softstart.late import late
from softstart.page.serve import Address, check_installed, listening, run

if TYPE_CHECKING:
    from softstart.chain.machines import Machine
    from softstart.page import machines
    from softstart.page import session as sessions
else:
    machines = late("softstart.page.machines")
    sessions = late("softstart.page.session")


def _check_address(given: Mapping[str, Any]) -> None:
    mistakes = Mistakes()
    for check in (_address(given).check, check_installed):
        with mistakes.noted():
            check()
    mistakes.settle()


def _address(given: Mapping[str, Any]) -> Address:
    return Address(given["host"], given["port"], given["token"], given["expose"])


@click.command(cls=Command, checks=[_check_address])
@drive_argument(lambda name, settings: machines.single(read_machine(name, settings)))
@set_option
@click.option("--port", type=int, default=8765, show_default=True, help="Port; 0 selects a free one.")
@click.option(
    "--host", default="127.0.0.1", show_default=True, metavar="ADDRESS", help="Address to listen on."
)
@click.option(
    "--token",
    default=None,
    metavar="TOKEN",
    help="Token that every client must present; required with --expose.",
)
@click.option(
    "--expose", is_flag=True, help="Accept connections from other machines; requires --host and --token."
)
@click.option("--no-browser", is_flag=True, help="Do not open a browser.")
def serve(*, drive: Machine, no_browser: bool, **given: Any) -> None:
    """Open the interactive page in the browser.

    DRIVE is a TOML file or the name of a shipped drive or chain; by default the crane drive of the
    literature. The server accepts connections from this machine only, unless --expose is given; Ctrl-C stops
    it. Needs NiceGUI: pip install 'softstart[ui]'.
    """
    address = _address(given)
    listener = listening(address)
    with listener:
        _warm_up(drive)

        def ready(url: str) -> None:
            print(f"softstart is at {url}  (Ctrl-C ends it)", flush=True)
            if not no_browser and address.is_loopback:
                # some browsers take the terminal until they are closed; the page must not wait for that
                threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()

        run(drive, address, listener, ready)


def _warm_up(machine: Machine) -> None:
    """Start all strategies once: whatever must be compiled is compiled before the page opens."""
    with working("getting the engine ready ..."):
        for session in (sessions.Session(), sessions.Session(machine)):
            _ = session.strategies
            if (axes := machines.axes_about(session.machine, 3, 3)) is not None:
                controller = session.controllers[session.selected]
                machines.k_dyn_row(session.machine, controller, axes.gaps, axes.inertias[1])
