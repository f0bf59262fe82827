"""The exported C code itself in closed loop with the exact machine: compiled here, called in cycles."""

from __future__ import annotations

import ctypes
import math
import os
import shlex
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import gettempdir
from types import TracebackType
from typing import Any, Self

from softstart.export.design import Design
from softstart.export.vectors import WHOLE, VectorRow, Vectors, input_names, run_in_cycles
from softstart.kernel.guard import FAULTS
from softstart.kernel.records import Measured
from softstart.start.block import BlockOutput
from softstart.store import fresh_folder

COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")
TOLERABLE = 1e-3  # change of K_dyn of which nothing need be said
ADAPTER = """\
#include <stddef.h>
#include "{P}.h"

size_t softstart_size(void) {{ return sizeof({P}_State); }}
void softstart_init(void *state) {{ {P}_init(({P}_State *)state); }}
void softstart_step(void *state, const double *in, double *out)
{{
    {P}_Input input;
    {P}_Output output;
{fields}    {P}_step(({P}_State *)state, &input, &output);
    out[0] = output.torque;
    out[1] = (double)output.fault;
}}
"""


def compiler() -> list[str]:
    """The command of the C compiler, from CC or the path; empty if there is none."""
    named = shlex.split(os.environ.get("CC", ""))
    if named:
        return named if shutil.which(named[0]) else []
    return next(([name] for name in COMPILERS if shutil.which(name)), [])


class CompiledBlock:
    """A block of C code, called as a `ControlBlock`; a context in which the library stays loaded.

    Parameters
    ----------
    design : what was exported.
    sources : C code by file name.
    prefix : of its names.
    """

    def __init__(self, design: Design, sources: Mapping[str, str], prefix: str) -> None:
        self.controller, self.period, self.prefix = design.controller, design.period, prefix
        self.names = input_names(design.sensors)
        self._sources = sources

    def __enter__(self) -> Self:
        self._folder = fresh_folder(Path(gettempdir()))
        folder = self._folder.__enter__()
        fields = "".join(
            f"    input.{name} = {self._cast(name)}in[{k}];\n" for k, name in enumerate(self.names)
        )
        texts = {**self._sources, "adapter.c": ADAPTER.format(P=self.prefix, fields=fields)}
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        sources = [name for name in texts if name.endswith(".c")]
        done = subprocess.run(
            [*compiler(), *FLAGS, "-o", "block.so", *sources, "-lm"],
            cwd=folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            raise OSError(done.stderr.strip() or "the C compiler failed")
        self._library: Any = ctypes.CDLL(str(folder / "block.so"))
        self._library.softstart_size.restype = ctypes.c_size_t
        self.size = int(self._library.softstart_size())
        self._memory = ctypes.create_string_buffer(self.size)
        self._in, self._out = (ctypes.c_double * len(self.names))(), (ctypes.c_double * 2)()
        self.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._folder.__exit__(kind, error, trace)

    def _cast(self, name: str) -> str:
        kind = "int64_t" if name in WHOLE else "" if name == "motor_angle" else f"{self.prefix}_real"
        return "0.0 != " if name == "run" else f"({kind})" if kind else ""

    def begin(self) -> None:
        """The first state."""
        self._first, self._counted = math.nan, 0  # time of the first cycle, and cycles since then
        self._library.softstart_init(self._memory)

    def step(self, measured: Measured) -> BlockOutput:
        """One cycle."""
        if math.isnan(self._first):
            self._first = measured.time
        since = round((measured.time - self._first) / self.period)
        cycles, self._counted = since - self._counted, since
        torque, fault = self.answer({**measured._asdict(), "cycles": cycles})
        return BlockOutput(torque, FAULTS[fault])

    def answer(self, inputs: Mapping[str, float]) -> tuple[float, int]:
        """Torque and code of the fault for these inputs."""
        self._in[:] = [inputs[name] for name in self.names]
        self._library.softstart_step(self._memory, self._in, self._out)
        return float(self._out[0]), int(self._out[1])


def k_dyn_in_c(
    design: Design, sources: Mapping[str, str], prefix: str, gap_factors: tuple[float, ...] = (1.0,)
) -> tuple[float, ...]:
    """K_dyn of starts under the C code, one for each multiple of the gap; that of the worst position."""
    found = []
    with CompiledBlock(design, sources, prefix) as block:
        for factor in gap_factors:
            each = []
            for machine in machine_of(design, factor).positions.values():
                block.begin()
                each.append(float(run_in_cycles(machine, block).k_dyn))
            found.append(max(each))
    return tuple(found)


def replayed(design: Design, sources: Mapping[str, str], prefix: str, vectors: Vectors) -> Vectors:
    """The vectors with what the C code answers to the same inputs."""
    rows, scenario = list[VectorRow](), ""
    with CompiledBlock(design, sources, prefix) as block:
        for row in vectors.rows:
            if row.scenario != scenario:
                block.begin()
            scenario = row.scenario
            torque, fault = block.answer(row.inputs)
            rows.append(row._replace(torque=torque, fault=fault))
    return replace(vectors, rows=tuple(rows))


def k_dyn_in_python(design: Design, gap_factors: tuple[float, ...] = (1.0,)) -> tuple[float, ...]:
    """The same under the block in Python."""
    return tuple(
        max(
            float(run_in_cycles(machine, design.block()).k_dyn)
            for machine in machine_of(design, factor).positions.values()
        )
        for factor in gap_factors
    )


def machine_of(design: Design, gap_factor: float) -> Any:
    """The machine with its gap times a factor; a chain as it is."""
    machine: Any = design.machine
    return machine if gap_factor == 1.0 else machine.replace(gap=gap_factor * machine.gap)
