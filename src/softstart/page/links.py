"""A bench in the address of the page, so that a link brings back the same picture; and those in memory.

A link holds the drive, the parameters of installed strategies, what is selected and drawn, and the reference.
Tuned gains and profiles come from files and are not part of it; the server keeps them for a tab that is
reloaded.
"""

from __future__ import annotations

import binascii
import json
import zlib
from base64 import urlsafe_b64decode, urlsafe_b64encode
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from softstart.controller.base import Controller
from softstart.controller.finding import controller_names, make_controller
from softstart.errors import InputError
from softstart.page.machines import machine_from, startable
from softstart.page.session import SOFT, Inputs, Reference, Session

MOST_KEPT = 64  # benches of tabs that may be reloaded
LONGEST = 16_384  # characters of a link
LARGEST = 65_536  # bytes that it may hold

_kept: OrderedDict[str, tuple[str, Inputs]] = OrderedDict()  # link and bench


def keep(session: Session) -> tuple[str, str]:
    """Keep the bench of a session: the name under which `kept` finds it, and its link."""
    name, link = session.name, link_of(session)
    _kept[name] = link, session.bench
    _kept.move_to_end(name)
    while len(_kept) > MOST_KEPT:
        _kept.popitem(last=False)
    return name, link


def kept(name: str, link: str) -> Inputs | None:
    """The bench that is kept under this name, if this is its link: a tab may not know of the latest one."""
    known, bench = _kept.get(name, ("", None))
    return bench if known == link else None


def link_of(session: Session) -> str:
    """What follows # in the address.

    >>> session = Session()
    >>> session.select("ramp")
    >>> session.set_parameter("time", "200 ms")
    >>> session.set("gap", 1.0)
    >>> other = bench_of(link_of(session), Session().bench)
    >>> other.drive.gap, other.selected, other.controllers["ramp"].time
    (1.0, 'ramp', 0.2)
    """
    bench, installed = session.bench, controller_names()
    kept = bench.reference
    content = {
        "drive": bench.drive.to_toml(),
        "origin": bench.origin.to_toml() if bench.origin is not bench.drive else "",
        "parameters": {name: given for name, controller in bench.controllers.items()
                       if name in installed and (given := _given(controller))},
        "selected": bench.selected,
        "drawn": sorted(bench.drawn),
        "soft": dict(bench.soft),
        "reference": None if kept is None or kept.label not in installed else {
            "drive": kept.drive.to_toml(), "label": kept.label, "parameters": _given(kept.controller),
        },
    }  # fmt: skip
    packed = zlib.compress(json.dumps(content, separators=(",", ":")).encode(), 9)
    return urlsafe_b64encode(packed).decode("ascii").rstrip("=")


def _given(controller: Controller) -> dict[str, Any]:
    values = {one.name: getattr(controller, one.name) for one in fields(controller)}
    return {name: value for name, value in values.items() if isinstance(value, str | int | float)}


def bench_of(link: str, now: Inputs) -> Inputs:
    """The bench of a link; the strategies that it does not name are those of `now`, or for another machine
    those of them that are installed.

    >>> bench_of("nonsense", Session().bench)
    Traceback (most recent call last):
    softstart.errors.InputError: the address after #: this is no bench that softstart has written; ...
    """
    try:
        content = _content(link)
        drive = machine_from(content["drive"])
        origin = machine_from(content["origin"]) if content["origin"] else drive
        parameters = content["parameters"]
        soft = {name: float(content["soft"][name]) for name in SOFT} if content.get("soft") else {}
        origin.with_values(soft)  # refused here, not in the midst of a page
        same = origin == now.origin
        own = {name: one for name, one in now.controllers.items() if same or name in controller_names()}
        given = {name: dict(parameters[name]) for name in own if name in parameters}
        selected, drawn = str(content["selected"]), frozenset(map(str, content["drawn"]))
        reference = _reference(content.get("reference"), now)
    except (KeyError, TypeError, ValueError, RecursionError, binascii.Error, zlib.error):
        raise InputError(
            "the address after #: this is no bench that softstart has written; copy the whole link again, "
            "or delete what follows the #."
        ) from None
    for one in (drive, origin, *([reference.drive] if reference else [])):
        try:
            startable(one)
        except InputError as error:
            raise InputError([f"the address after #: {sentence}" for sentence in error.sentences]) from None
    made = {name: make_controller(name, values) for name, values in given.items()}
    return Inputs(
        drive,
        origin,
        {**own, **made},
        next(one for one in (selected, now.selected, *own) if one in own),
        drawn & own.keys(),
        reference,
        soft,
    )


def _reference(content: Any, now: Inputs) -> Reference | None:
    """The reference of a link; like all strategies, only one that the page has can be given parameters."""
    if content is None or (label := str(content["label"])) not in now.controllers:
        return None
    drive, parameters = machine_from(content["drive"]), dict(content["parameters"])
    return Reference(drive, label, make_controller(label, parameters))


def _content(link: str) -> Mapping[str, Any]:
    if len(link) > LONGEST:
        raise ValueError
    unpacking = zlib.decompressobj()
    text = unpacking.decompress(urlsafe_b64decode(link + "=" * (-len(link) % 4)), LARGEST)
    if unpacking.unconsumed_tail:
        raise ValueError
    content = json.loads(text)
    if not isinstance(content, dict):
        raise TypeError
    return content
