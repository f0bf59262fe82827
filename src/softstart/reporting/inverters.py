"""What the settings of a speed ramp are at each family of inverters: names and values of its functions."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softstart.drive import Drive
from softstart.start.resolution import gain_base, rated_torque
from softstart.views.numbers import RPM, short


def inverters() -> dict[str, Any]:
    """Names of functions in manuals, and what a parameter means at an inverter."""
    return tomllib.loads((Path(__file__).parent / "inverters.toml").read_text("utf-8"))


def speed_values(values: Mapping[str, float], drive: Drive) -> dict[str, str]:
    """The values of a speed ramp in the units of inverters, as the texts of `speed` in the file name them.

    >>> crane = Drive.load("crane-4amtkf")
    >>> values = {"ramp_time": 0.5, "rounding": 0.2, "kp": 5.0, "tn": 0.08, "torque_limit": 47.75}
    >>> found = speed_values(values | {"filter_time": 0.002}, crane)
    >>> [found[name] for name in ("ramp_s", "rounding_s", "kp_percent", "tn_ms", "limit_percent")]
    ['0.5', '0.1', '19.3', '80', '200']
    """

    def text(value: float) -> str:
        return short(float(f"{value:.4g}"))

    ramp, tn = values["ramp_time"], values["tn"]
    return {
        "ramp_s": text(ramp),
        "rate": text(drive.target_speed * RPM / ramp),
        "target_rpm": text(drive.target_speed * RPM),
        "rounding_s": text(values["rounding"] * ramp),
        "rounding_percent": text(100.0 * values["rounding"]),
        "kp": text(values["kp"]),
        "kp_percent": text(values["kp"] / gain_base(drive)[0]),
        "tn_ms": text(1e3 * tn),
        "tn_s": text(tn),
        "filter_ms": text(1e3 * values["filter_time"]),
        "limit_percent": text(100.0 * values["torque_limit"] / rated_torque(drive)[0]),
    }


def at_inverters(values: Mapping[str, float], drive: Drive) -> list[tuple[str, str]]:
    """Families, as "NAME [n]" with the number of their source, and the speed ramp in their functions."""
    texts = speed_values(values, drive)
    return [
        (f"{family['name']} [{number}]", family["speed"].format(**texts))
        for number, family in enumerate(inverters()["family"], 1)
        if "speed" in family
    ]
