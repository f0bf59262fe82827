"""The inputs of a page in its address, so that a link brings back the same picture; and those in memory.

A link holds the machine, the parameters of installed strategies, what is selected and drawn, and the
reference. Tuned gains and profiles come from files and are not part of it; the server keeps them for a tab
that is reloaded.
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
from softstart.controller.finding import make_controller
from softstart.drive.machine import Machine
from softstart.errors import InputError, Mistakes
from softstart.page.duty import packed_plan, plan_of, unpacked_plan
from softstart.page.machines import machine_from, startable
from softstart.page.session import LONGEST_TIME, NO_PROJECT, Inputs, Reference, Session
from softstart.plugins import controller_names
from softstart.project import Project

MAX_STORED = 64  # inputs of tabs that may be reloaded
LONGEST = 16_384  # characters of a link
LARGEST = 65_536  # bytes that it may hold
WRONG = "the address after #"

_stored: OrderedDict[str, tuple[str, Inputs]] = OrderedDict()  # link and inputs by name


def store(session: Session) -> tuple[str, str]:
    """Store the inputs of a session: the name under which `stored` finds them, and their link."""
    name, link = session.name, link_of(session.inputs)
    _stored[name] = link, session.inputs
    _stored.move_to_end(name)
    while len(_stored) > MAX_STORED:
        _stored.popitem(last=False)
    return name, link


def stored(name: str, link: str) -> Inputs | None:
    """The inputs that are stored under this name, if this is their link: a tab may have missed the latest."""
    known, inputs = _stored.get(name, ("", None))
    return inputs if known == link else None


def link_of(inputs: Inputs) -> str:
    """What follows # in the address.

    >>> session = Session()
    >>> session.select("ramp")
    >>> session.set_parameter("time", "200 ms")
    >>> session.set("gap", 1.0)
    >>> other = inputs_of(link_of(session.inputs), Session().inputs)
    >>> other.machine.gap, other.selected, other.controllers["ramp"].time
    (1.0, 'ramp', 0.2)
    """
    installed, reference = controller_names(), inputs.reference
    content = {
        "drive": inputs.machine.to_toml(),
        "origin": inputs.origin.to_toml() if inputs.origin is not inputs.machine else "",
        "parameters": {name: settings for name, controller in inputs.controllers.items()
                       if name in installed and (settings := _settings(controller))},
        "selected": inputs.selected,
        "drawn": sorted(inputs.visible),
        "at_time": inputs.at_time,
        "duty": packed_plan(inputs.duty),
        "reference": None if reference is None or reference.label not in installed else {
            "drive": reference.machine.to_toml(), "label": reference.label,
            "parameters": _settings(reference.controller),
        },
    }  # fmt: skip
    packed = zlib.compress(json.dumps(content, separators=(",", ":")).encode(), 9)
    return urlsafe_b64encode(packed).decode("ascii").rstrip("=")


def _settings(controller: Controller) -> dict[str, str | int | float]:
    values = {field.name: getattr(controller, field.name) for field in fields(controller)}
    return {name: value for name, value in values.items() if isinstance(value, str | int | float)}


def inputs_of(link: str, now: Inputs) -> Inputs:
    """The inputs of a link; the strategies that it does not name are those of `now`, or for another machine
    those of them that are installed.

    >>> inputs_of("nonsense", Session().inputs)
    Traceback (most recent call last):
    softstart.errors.InputError: the address after #: this is not a link that softstart has written; ...
    """
    try:
        content = _content(link)
        machine, _ = plan_of(machine_from(content["drive"]))
        origin = plan_of(machine_from(content["origin"]))[0] if content["origin"] else machine
        duty = unpacked_plan(content.get("duty"))
        project = _project_of(origin, now)
        same = project is not None
        controllers = {
            name: controller
            for name, controller in now.controllers.items()
            if same or name in controller_names()
        }
        parameters = content["parameters"]
        settings = {name: dict(parameters[name]) for name in controllers if name in parameters}
        selected, visible = str(content["selected"]), frozenset(map(str, content["drawn"]))
        reference = _reference(content.get("reference"), now)
    except (KeyError, TypeError, ValueError, RecursionError, binascii.Error, zlib.error):
        raise InputError(
            f"{WRONG}: this is not a link that softstart has written; copy the whole link again, or delete "
            "what follows the #."
        ) from None
    mistakes = Mistakes()
    for part in (machine, origin, *([reference.machine] if reference else [])):
        with mistakes.collect(f"{WRONG}: "):
            startable(part)
        mistakes.raise_if_any()
    controllers |= {name: make_controller(name, values) for name, values in settings.items()}
    return Inputs(
        machine,
        origin,
        controllers,
        next(label for label in (selected, now.selected, *controllers) if label in controllers),
        visible & controllers.keys(),
        reference,
        str(content.get("at_time", ""))[:LONGEST_TIME],
        duty,
        project or NO_PROJECT,
        now.optima if origin == now.origin else {},
    )


def _project_of(origin: Machine, now: Inputs) -> Project | None:
    """The present project if it has this machine, which is then the one chosen; None if it has not."""
    if origin == now.origin:
        return now.project
    for one in now.project.machines:
        if plan_of(now.project.single(one.name))[0] == origin:
            return now.project.replace(machine=one.name)
    return None


def _reference(content: Any, now: Inputs) -> Reference | None:
    """The reference of a link; like all strategies, only one that the page has can be given parameters."""
    if content is None or (label := str(content["label"])) not in now.controllers:
        return None
    machine, parameters = machine_from(content["drive"]), dict(content["parameters"])
    return Reference(machine, label, make_controller(label, parameters))


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
