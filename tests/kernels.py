"""The kernels that the tests need, compiled once and before the first test, by all workers together.

From an empty cache every worker would compile all of them. They are parts here: a worker takes the first one
that nobody has taken and whose needs are compiled, until none is left. Files in a folder that the workers of
a run share say what is taken and what is compiled. Commands say on standard error that they compile, which
tests of their output would trip over.
"""

from __future__ import annotations

import time
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from softstart.kernel.jit import compile_now

PATIENCE = 900.0  # s that a worker waits for another one which compiles


def steps() -> None:
    """The steps of all controllers."""
    for one in iter_modules(import_module("softstart_controllers").__path__, "softstart_controllers."):
        compile_now(import_module(one.name))


def controllers() -> None:
    """Every controller in a single start and in a batch."""
    from softstart import Drive, TorqueProfile, machine_table, simulate
    from softstart.controller import make_controller, ready_controller_names

    crane = Drive.load("crane-4amtkf")
    profile = make_controller("profile", {"profile": TorqueProfile([0.0, 0.1, 0.1], [20.0, 62.0, 40.0])})
    for controller in (profile, *map(make_controller, ready_controller_names())):
        simulate(crane, controller)
        simulate(machine_table(crane, gap=[0.5, 2.0]), controller)


def plain() -> None:
    """A controller that is called from Python."""
    from tests.twin import plain as twin_of

    from softstart import Drive, machine_table, simulate
    from softstart.controller import make_controller

    crane = Drive.load("crane-4amtkf")
    twin = twin_of(make_controller("direct"), crane)
    simulate(crane, twin)
    simulate(machine_table(crane, gap=[0.5, 2.0]), twin)


# what must be compiled before, and what compiles it; the longest are taken first
PARTS = {
    "start": ((), lambda: compile_now(import_module("softstart.kernel.start"))),
    "steps": ((), steps),
    "guard": ((), lambda: compile_now(import_module("softstart.kernel.guard"))),
    "replay": (("start",), lambda: compile_now(import_module("softstart.kernel.replay"))),
    "sensitivity": (("replay",), lambda: compile_now(import_module("softstart.kernel.sensitivity"))),
    "controllers": (("replay", "steps"), controllers),
    "plain": (("controllers",), plain),
}


def compile_all() -> None:
    """All parts, in this process alone."""
    for _, compile_part in PARTS.values():
        compile_part()


def compile_together(folder: Path) -> None:
    """All parts, with the other workers that are given the same folder; returns when none is left."""
    latest = time.monotonic() + PATIENCE
    while time.monotonic() < latest:
        done = {name for name in PARTS if (folder / f"{name}.done").exists()}
        if done == set(PARTS):
            return
        name = next(
            (name for name, (needs, _) in PARTS.items() if done.issuperset(needs) and take(folder, name)), ""
        )
        if not name:
            time.sleep(0.1)
            continue
        try:
            PARTS[name][1]()
        finally:
            (folder / f"{name}.done").touch()


def take(folder: Path, name: str) -> bool:
    """Whether this worker is the first to ask for this part."""
    try:
        (folder / f"{name}.taken").touch(exist_ok=False)
    except FileExistsError:
        return False
    return True
