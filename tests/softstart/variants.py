"""Machines with each optional value absent, and each present, lists included."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from softstart import Chain, Drive, InputError
from softstart.chain.elements import LIBRARY
from softstart.drive import library
from softstart.input.parameters import REQUIRED
from softstart.page.machines import startable, with_typed_changes

# values that are there together or not at all: the lists of a load curve, those of an S-N curve, a gear
TOGETHER: dict[str, list[dict[str, str]]] = {
    "drive": [
        {"limits.fatigue.slope": "6.6"},
        {"limits.fatigue.slope": "6.6", "limits.fatigue.torque": "90", "limits.fatigue.cycles": "2e6"},
        {"limits.fatigue.torque": "200; 90",
         "limits.fatigue.cycles": "1e5; 2e6", "limits.life": "20000 h", "limits.starts_per_hour": "60"},
        {"gear.ratio": "38.1", "gear.efficiency": "0.94"},
        {"gear.ratio": "38.1", "limits.output_torque": "3 kN*m", "units": "arcmin, rpm"},
        {"units": "mm on 80 mm, rpm"},
        {"load.kind": "reactive", "start.position": "unknown"},
        {"load.kind": "active", "load.friction": "1"},
    ],
    "chain": [
        {"mass[2].curve_speed": "0; 50; 100", "mass[2].curve_torque": "0; 1; 4"},
        {"mass[2].curve_angle": "0; 1.5; 3", "mass[2].curve_torque": "0; 1; 4", "units": "deg, rpm"},
        {"shaft[1].permissible_torque": "800 N*m", "start.position": "unknown"},
    ],
}  # fmt: skip


def machines() -> list[Any]:
    """All shipped drives and chains, and a chain of two masses."""
    two = Chain.from_toml(
        '[[mass]]\nname = "motor"\ninertia = 0.05\n[[shaft]]\nstiffness = 800\ngap = "2 deg"\n'
        '[[mass]]\nname = "fan"\ninertia = 0.3\ntorque = 1\n[motor]\nstarting_torque = 40\n'
        '[start]\nload = "fan"\ntarget_speed = 80\n'
    )
    return [*map(Drive.load, library.names()), *map(Chain.load, LIBRARY.names()), two]


def variants(machine: Any) -> Iterator[tuple[str, Any]]:
    """What is different, and the machine: those that are machines, and can be started on the page."""
    for settings in TOGETHER["chain" if isinstance(machine, Chain) else "drive"]:
        if (found := _with(machine, settings)) is not None:
            yield str(settings), found
    for path, (parameter, value) in machine.parameters_by_path().items():
        words = [parameter.example.strip('"'), *parameter.choices]
        for settings in ({path: word} for word in words):
            if (found := _with(machine, settings)) is not None:
                yield str(settings), found
        if value is not None and parameter.default is not REQUIRED:
            text = _without(machine, path)
            try:
                yield f"no {path}", startable(type(machine).from_toml(text))
            except InputError:  # it cannot be left out alone
                continue


def _with(machine: Any, settings: dict[str, str]) -> Any:
    try:
        return startable(with_typed_changes(machine, settings))
    except InputError:  # contradictions: a rigid shaft with damping, a curve of one list
        return None


def _without(machine: Any, path: str) -> str:
    """The file of a machine without a value: the n-th line of this key, in the table of the path."""
    table, _, key = path.rpartition(".")
    number = int(table.partition("[")[2].rstrip("]") or 0)
    kept, here, seen = [], table == "", 0
    for line in machine.to_toml().splitlines():
        if line.startswith("["):
            seen += line.startswith(f"[[{table.partition('[')[0]}]]")
            here = line.startswith(f"[{table}]") or bool(number and seen == number and line.startswith("[["))
        if not (here and line.startswith(f"{key} =")):
            kept.append(line)
    return "\n".join(kept)
