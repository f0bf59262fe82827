"""`softstart serve`: the interactive page in a browser."""

from __future__ import annotations

import threading
import webbrowser
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from softstart.cli import options
from softstart.cli.options import command, option
from softstart.cli.running import working
from softstart.errors import InputError
from softstart.page.address import Address
from softstart.page.serve import check_installed, listening, run_server

if TYPE_CHECKING:
    from softstart.drive.machine import Machine
    from softstart.project import Project


def _read(name: str, settings: Sequence[str]) -> Machine | Project:
    """A machine as other commands read it, or a project."""
    if (project := options.read_project(name)) is None:
        return options.read_as_known(name, settings)
    if settings:
        raise InputError(f'--set "{settings[0]}": the page opens the whole project; change it there.')
    return project


@command("serve")
@options.of_drive(_read)
@option("--port", type=int, default=8765, show_default=True)
@option("--host", default="127.0.0.1", show_default=True)
@option("--token")
@option("--expose", is_flag=True)
@option("--no-browser", is_flag=True)
def serve_command(*, drive: Machine | Project, no_browser: bool, **arguments: Any) -> None:
    """Open the interactive page in the browser.

    DRIVE is a TOML file, of a machine or a project, or the name of a shipped drive or chain; by default the
    crane drive of the literature. The server accepts connections from this machine only, unless --expose is
    given; Ctrl-C stops it. Needs NiceGUI: pip install 'softstart[ui]'.

    Options
    -------
    --port
        Port; 0 selects a free one.
    --host ADDRESS
        Address to listen on.
    --token TOKEN
        Token that every client must present; required with --expose.
    --expose
        Accept connections from other machines; requires --host and --token.
    --no-browser
        Do not open a browser.
    """
    serve_page(drive, Address(**arguments), not no_browser)


def serve_page(drive: Machine | Project, address: Address, browser: bool = True) -> None:
    """Serve the page of this machine or project until it is interrupted."""
    address.check()
    if address.expose and (address.is_loopback or address.token is None):
        raise InputError(
            "--expose: other machines reach the page only at an address of this one, and with a token; add "
            "--host ADDRESS and --token TOKEN, or leave --expose out."
        )
    check_installed()
    from softstart.page.session import Session

    Session(drive, [])  # a machine that cannot be shown is refused before anything listens
    with listening(address) as listener:
        with working("getting the engine ready ..."):
            _warm_up(drive)

        def ready(url: str) -> None:
            print(f"softstart is at {url}  (Ctrl-C ends it)", flush=True)
            if browser and address.is_loopback:
                # some browsers take the terminal until they are closed; the page must not wait for that
                threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()

        run_server(drive, address, listener, ready)


def _warm_up(machine: Machine | Project) -> None:
    """Start all strategies once: whatever must be compiled is compiled before the page opens."""
    from softstart.page import machines
    from softstart.page.session import Session

    for session in (Session(), Session(machine)):  # the shipped drive too: a click away
        _ = session.strategies
        if (axes := machines.axes_about(session.inputs.machine, 3, 3)) is not None:
            controller = session.inputs.controllers[session.inputs.selected]
            machines.k_dyn_row(session.inputs.machine, controller, axes.gaps, axes.inertias[1])
