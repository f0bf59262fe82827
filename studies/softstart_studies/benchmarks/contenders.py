"""Who takes part: one table of names, and how each is made, versioned and found missing."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Protocol

from softstart.arrays import Vector
from softstart.study import Table
from softstart_studies.benchmarks.problem import Problem


class Contender(Protocol):
    """Solves starts that differ in the gap."""

    def __init__(self, problem: Problem) -> None:
        """For one problem."""

    def ready(self, gaps: Vector) -> Any:
        """What a user has in hand before the clock starts: drives, arrays, grids."""

    def solve(self, work: Any) -> Vector:
        """Peak shaft torque of each start, N m. This is timed."""


@dataclass(frozen=True)
class Entry:
    """A contender: the package it stands for, where its class is, and how it is used, in a few words."""

    package: str
    module: str
    cls: str
    how: str


HOME = "softstart_studies.benchmarks"
ENTRIES = {
    "kernel": Entry("softstart", "exact", "Kernel", "compiled kernel over a batch"),
    "formula": Entry("softstart", "exact", "Formula", "closed forms of [G] over arrays"),
    "batch": Entry("softstart", "exact", "Batch", "simulate of a batch, labelled results"),
    "run": Entry("softstart", "exact", "EachRun", "one simulate call a start; Run with events and stages"),
    "run-traces": Entry(
        "softstart",
        "exact",
        "EachRunWithTraces",
        "one simulate call a start; Run with stages and traces",
    ),
    "lsoda": Entry(
        "scipy", "lsoda_plain", "LsodaPlain", "solve_ivp LSODA, rtol 1e-8, one call with located events"
    ),
    "lsoda-restarted": Entry(
        "scipy", "lsoda", "Lsoda", "solve_ivp LSODA, rtol 1e-8, located events, restarted at each stage"
    ),
    "lsoda-sampled": Entry(
        "scipy", "lsoda", "Lsoda", "solve_ivp LSODA, rtol 1e-8, located events, restarted at each sample"
    ),
    "control": Entry(
        "control", "control_response", "ControlDefault", "input_output_response, defaults, 1 ms grid"
    ),
    "control-tight": Entry(
        "control", "control_response", "ControlTight", "input_output_response, LSODA 1e-8, 0.1 ms grid"
    ),
    "diffrax": Entry(
        "diffrax", "diffrax_events", "Diffrax", "Tsit5 1e-8, root-found Events, jit and vmap over a batch"
    ),
}


def installed(name: str) -> str | None:
    """Version of the package behind a contender, None if it is not installed.

    >>> installed("kernel") is None
    False
    """
    return version_of(ENTRIES[name].package)


def version_of(package: str) -> str | None:
    """Version of an installed package, None without it.

    >>> version_of("no-such-package-here")
    """
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def make(name: str, problem: Problem) -> Contender:
    """The contender for a problem; this imports its package."""
    entry = ENTRIES[name]
    made: Contender = getattr(import_module(f"{HOME}.{entry.module}"), entry.cls)(problem)
    return made


def condition_table(rows: Sequence[tuple[str, object]], libraries: Sequence[str]) -> Table:
    """What the figures mean, and under which conditions they were measured."""
    machine = [
        ("processors of the machine", os.cpu_count()),
        ("machine", f"{platform.machine()}, {platform.system()}"),
        ("python", platform.python_version()),
        *((name, version_of(name) or "not installed") for name in libraries),
    ]
    return Table("Conditions", ("what", "value"), [*rows, *machine])
