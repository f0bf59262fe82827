"""Fields of the page with every optional value absent, and every list present."""

from typing import Any

import pytest
from tests.softstart.variants import TOGETHER, machines, variants

from softstart import Chain, InputError
from softstart.page import links
from softstart.page.downloads import command_text
from softstart.page.frames import FrameBuilder, machine_fields
from softstart.page.machines import axes_about, map_words, placeless
from softstart.page.sentences import differences
from softstart.page.session import Session

QUICK = ("Crane travel drive 4AMTKF(H)112L6", "unnamed chain")
EVERY = {one.name: one for one in machines()}
CASES = [
    *((name, True) for name in QUICK),
    *(
        pytest.param(name, False, marks=pytest.mark.slow)
        for name in (*QUICK, "Hoist 15 kW, gearbox and brake")
    ),
]


def alike(a: Any, b: Any) -> bool:
    """The same to the six digits that a field shows."""
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(alike, a, b))
    return a == b or (isinstance(a, float) and isinstance(b, float) and abs(a - b) <= 1e-5 * abs(a))


@pytest.mark.parametrize(("name", "lists"), CASES)
def test_what_a_field_shows_can_be_typed_into_it(name: str, lists: bool) -> None:
    """The text of every field, typed again, is the same value; map, link and command hold the machine."""
    base = EVERY[name]
    count = len(TOGETHER["chain" if isinstance(base, Chain) else "drive"]) if lists else None
    for what, machine in list(variants(base))[:count]:
        session = Session(machine, controllers=["direct"])
        frames = FrameBuilder(session)
        shown = machine_fields(session, frames.entries)
        for path, one in shown.items():
            value = machine.parameters_by_path()[path][1]
            if path == "units" or not one["text"] or value is None:
                continue
            try:
                session.set(path, session.inputs.units.typed(one["text"], frames.entries[path].unit))
            except InputError as error:
                raise AssertionError((what, path, one["text"])) from error
            assert alike(session.inputs.machine.parameters_by_path()[path][1], value), (
                what,
                path,
                one["text"],
            )
        assert (
            links.inputs_of(links.link_of(session.inputs), session.inputs).machine == session.inputs.machine
        ), what
        assert command_text(machine, {"direct": session.inputs.controllers["direct"]}), what
        assert map_words(machine), what
        if (axes := axes_about(machine)) is not None:
            assert placeless(machine, axes, machine), what
        if what != "as it is" and "None" in differences(machine, base):
            raise AssertionError(what)
