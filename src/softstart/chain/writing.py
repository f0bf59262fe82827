"""A chain as TOML text."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from softstart.chain.tables import MASS, MOTOR, SHAFT, START, TOP
from softstart.input_tables import Table

if TYPE_CHECKING:
    from softstart.chain.model import Chain

__all__ = ["toml_of"]


def toml_of(chain: Chain) -> str:
    """The tables of the chain, in SI, each value with its unit and meaning; defaults are left out."""
    blocks = ["\n".join(_lines(TOP, chain))]
    for i, mass in enumerate(chain.masses):
        blocks.append("\n".join(["[[mass]]", *_lines(MASS, mass)]))
        if i < len(chain.shafts):
            blocks.append("\n".join(["[[shaft]]", *_lines(SHAFT, chain.shafts[i])]))
    if chain.motor is not None:
        blocks.append("\n".join(["[motor]", *_lines(MOTOR, chain.motor)]))
    start = {"load": chain.load_mass, "target_speed": chain.target_speed}
    blocks.append("\n".join(["[start]", *_lines(START, start)]))
    return "\n\n".join(blocks) + "\n"


def _lines(table: Table, one: object) -> Iterator[str]:
    for field in table.fields:
        value = one.get(field.key) if isinstance(one, dict) else getattr(one, field.key, None)
        if value is None or value == field.default:
            continue
        if isinstance(value, str):
            yield f"{field.key} = {json.dumps(value, ensure_ascii=False)}"
        else:
            literal = "inf" if math.isinf(value) else repr(value)
            unit = "" if field.unit == "1" else f"{field.unit}: "
            yield f"{field.key} = {literal}  # {unit}{field.meaning}"
