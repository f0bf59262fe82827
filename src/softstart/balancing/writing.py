"""An engine as TOML text, in SI."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.balancing.indicator import MeasuredCycle

if TYPE_CHECKING:
    from softstart.balancing.engine import Engine

__all__ = ["indicator_csv", "toml_of"]

INDICATOR = "indicator.csv"


def toml_of(engine: Engine) -> str:
    """The text; a measured pressure is named by the file `indicator.csv`."""
    parts = [_lines({"name": engine.name, "source": engine.source, "assumed": ", ".join(engine.assumed)})]
    tables: list[tuple[str, Any]] = [
        ("[cylinders]", engine.cylinders),
        ("[masses]", engine.masses),
        ("[counterweights]", engine.counterweights),
    ]
    if isinstance(engine.gas, MeasuredCycle):
        about = {"file": INDICATOR, "crankcase_pressure": engine.gas.crankcase_pressure}
        parts.append("[indicator]\n" + _lines(about))
    else:
        tables.append(("[cycle]", engine.gas))
    tables.append(("[operation]", engine.operation))
    if engine.layout is not None:
        tables.append(("[balancer]", engine.layout))
    tables += [("[[shaft]]", shaft) for shaft in engine.shafts]
    for heading, part in tables:
        parts.append(f"{heading}\n" + _lines({one.name: getattr(part, one.name) for one in fields(part)}))
    return "\n".join(parts)


def indicator_csv(gas: MeasuredCycle) -> str:
    """A measured pressure as the CSV text that it is read from."""
    rows = zip(gas.angles, gas.pressures, strict=True)
    return "angle [rad],pressure [Pa]\n" + "".join(f"{angle!r},{pressure!r}\n" for angle, pressure in rows)


def _lines(values: dict[str, Any]) -> str:
    return "".join(f"{key} = {_value(value)}\n" for key, value in values.items() if value not in (None, ""))


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    return repr(float(np.float64(value)))
