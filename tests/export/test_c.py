"""C99: each statement means what it means in Python; blocks in closed loop demand the same to the bit."""

from __future__ import annotations

import ctypes
import inspect
import types
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from tests.export import tools
from tests.softstart.export import translated
from tests.softstart.export.test_translate import KINDS, NAMES, POWERS, Attributes, filled, function_of
from tests.softstart.test_block_faults import KINDS as FAULT_KINDS
from tests.softstart.test_block_faults import Case, follow
from tests.softstart.test_guard import random_drive as fault_drive

from softstart import Drive, TorqueProfile, simulate
from softstart.controller import Controller, make_controller
from softstart.controller.base import Command, PlainController, Sensor
from softstart.errors import InputError, SimulationError
from softstart.export.c import STDC, CWriter
from softstart.export.closed_loop import CompiledBlock
from softstart.export.code import written
from softstart.export.controller import export_controller
from softstart.export.design import design_for
from softstart.export.statements import Array, Struct, Type
from softstart.export.vectors import Vectors
from softstart.kernel.jit import unfused
from softstart.kernel.records import Measured
from softstart.plugins import CONTROLLERS, registered
from softstart.start.block import BlockOutput

STRATEGIES = sorted(registered(CONTROLLERS))
CRANE = Drive.load("crane-4amtkf")
ROWS = 200  # of random arguments for each function
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")


# statements -------------------------------------------------------------------------------------------


def places(kind: Type, place: str) -> Iterator[tuple[str, str]]:
    """The numbers of a structure: their places in C, and their kinds."""
    if isinstance(kind, Struct):
        for member in kind.members:
            yield from places(member.type, f"{place}.{member.name}")
    elif isinstance(kind, Array):
        size, *rest = kind.shape
        inner = Array(kind.element, tuple(rest)) if rest else kind.element
        for at in range(size):
            yield from places(inner, f"{place}[{at}]")
    else:
        yield place, kind


def flat(values: Any) -> list[float]:
    """The numbers of nested dicts and lists in order."""
    if isinstance(values, dict):
        values = list(values.values())
    if isinstance(values, list):
        return [number for one in values for number in flat(one)]
    return [float(values)]


def in_c(name: str) -> str:
    """A function with a wrapper that takes and gives all numbers as doubles."""
    made, translator = function_of(getattr(translated, name))
    program = translator.program(made)
    writer = CWriter(program, "t")
    functions = [writer.function(one) for one in program.functions]
    lines, handed, back, at = [], [], [], 0
    for parameter in made.parameters:
        kind = parameter.type
        lines.append(f"    {writer.type_of(kind)} {parameter.name};")
        for place, _ in places(kind, parameter.name):
            lines.append(f"    {place} = in[{at}];")
            at += 1
        handed.append(f"&{parameter.name}" if isinstance(kind, Struct) else parameter.name)
        if isinstance(kind, Struct):
            back += [place for place, _ in places(kind, parameter.name)]
    results = [f"r{k}" for k in range(len(made.returns))]
    lines += [f"    {writer.types[kind]} {one};" for one, kind in zip(results, made.returns, strict=True)]
    call = writer.function_name(made)
    if len(results) == 1:
        lines.append(f"    r0 = {call}({', '.join(handed)});")
    else:
        lines.append(f"    {call}({', '.join(handed + [f'&{one}' for one in results])});")
    lines += [f"    out[{k}] = (double){one};" for k, one in enumerate([*results, *back])]
    return "\n".join(
        [
            f"#include <math.h>\n#include <stdint.h>\n#include <string.h>\n{STDC}typedef double t_real;",
            *map(writer.struct, program.structs), writer.tables(program.tables), *writer.helpers.values(),
            *functions, f"void go_{name}(const double *in, double *out);",
            f"void go_{name}(const double *in, double *out)\n{{", *lines, "}\n",
        ]
    )  # fmt: skip


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """All functions in one library; the compiler has nothing to say."""
    folder = tmp_path_factory.mktemp("statements")
    files = [folder / f"{name}.c" for name in NAMES]
    for name, file in zip(NAMES, files, strict=True):
        file.write_text(in_c(name), encoding="utf-8")
    target = folder / "statements.so"
    tools.run("gcc", *tools.STRICT, "-O2", "-fPIC", "-shared", "-o", target, *files, "-lm")
    return ctypes.CDLL(str(target))


@pytest.mark.parametrize("name", NAMES)
def test_statements_mean_what_they_mean_in_python(name: str, library: ctypes.CDLL) -> None:
    rng = np.random.default_rng(NAMES.index(name))
    function = getattr(translated, name)
    in_python = {key: getattr(one, "py_func", one) for key, one in vars(translated).items()}
    same = unfused(function) if name in POWERS else types.FunctionType(function.__code__, in_python)
    _, translator = function_of(function)
    outer = translator.structs.of(translated.OUTER)
    for _ in range(ROWS):
        numbers: list[Any] = []
        for annotation in inspect.signature(function).parameters.values():
            kind = KINDS.get(str(annotation.annotation))
            if kind == "real":
                numbers.append(float(rng.choice([rng.uniform(-4.0, 4.0), 0.0, 1.0, -2.0, 0.25])))
            elif kind == "whole":
                numbers.append(int(rng.integers(0 if name == "records" else -2, 10)))
            else:
                numbers.append(filled(outer, rng))
        given = (ctypes.c_double * 100)(*flat(numbers))
        answer = (ctypes.c_double * 100)()
        getattr(library, f"go_{name}")(given, answer)
        arguments = [Attributes(one) if isinstance(one, dict) else one for one in numbers]
        expected = same(*arguments)
        results = flat(list(expected) if isinstance(expected, tuple) else [expected])
        changed = [number for one in numbers if isinstance(one, dict) for number in flat(one)]
        for got, wanted in zip(answer, results + changed, strict=False):
            assert got == wanted


# closed loops -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Both(PlainController):
    """Two blocks run as the strategy; the outputs of the first one act. For one run."""

    name: ClassVar[str] = "both"
    saturates: ClassVar[bool] = True
    can_stop: ClassVar[bool] = True
    can_reverse: ClassVar[bool] = True
    blocks: Any = ()
    period: float = 0.001
    seen: Sensor = Sensor.NONE
    log: list[tuple[BlockOutput, BlockOutput]] = field(default_factory=list)

    @property
    def sensors(self) -> Sensor:  # type: ignore[override]
        """Those of the strategy."""
        return self.seen

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        share = measured.time / self.period
        if self.log and abs(share - round(share)) > 1e-6 * max(share, 1.0):
            return Command(self.log[-1][0].torque)  # an event of the gap, between two cycles
        first, second = (block.step(measured) for block in self.blocks)
        self.log.append((first, second))
        return Command(first.torque)


def random_drive(rng: np.random.Generator) -> Drive:
    """A drive with lag, encoder, noise, damping and a gap, of wide ranges."""
    base = Drive.load(str(rng.choice(["crane-4amtkf", "hoist-15kw", "conveyor-11kw", "servo-axis-small"])))
    base = base.replace(start_position=str(rng.choice(["mid-gap", "driving-flank", "opposite-flank"])))
    return base.replace(
        gap=base.gap * float(rng.uniform(0.1, 5.0)),
        load_inertia=base.J2 * float(rng.uniform(0.3, 3.0)),
        torque_lag=float(rng.choice([0.0, 0.002, 0.008])),
        encoder_lines=float(rng.choice([0.0, 1024.0, 4096.0])),
        torque_noise=float(rng.choice([0.0, 0.005])) * base.Ms,
        damping=float(rng.choice([0.0, 1.0])) * base.d,
    )


def controller_of(name: str) -> Controller:
    """A strategy by its name."""
    profile = TorqueProfile([0.0, 0.1, 0.1, 0.3], [20.0, 30.0, 10.0, 60.0])
    return make_controller(name, {"profile": profile} if name == "profile" else None)


def loop(name: str, drive: Drive, stops: bool) -> list[tuple[BlockOutput, BlockOutput]]:
    """All answers of the block in Python and of that in C, in closed loop."""
    design = design_for(controller_of(name), drive)
    code = written(design, Vectors(("cycles",), ()), "c", "block", "float64")
    until = 2.0 * float(drive.elastic_period) + 0.4 if stops else None
    speed = float(drive.target_speed)
    commands = [(0.6 * until, 0, speed), (0.8 * until, 1, speed)] if until else []
    with CompiledBlock(design, code.c_sources, "block") as block:
        both = Both((design.block(), block), design.period, design.sensors)
        simulate(drive, both, until=until, commands=commands)
    return both.log


def check_loops(name: str, seeds: range) -> int:
    """Random drives; returns how many commands were equal, which are all."""
    cycles = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        try:
            log = loop(name, random_drive(rng), stops=seed % 2 == 1)
        except (InputError, SimulationError):
            continue  # a drive that this strategy does not start
        differ = [at for at, (one, other) in enumerate(log) if one != other]
        assert not differ, (name, seed, differ[:3], log[differ[0]])
        cycles += len(log)
    return cycles


@pytest.mark.parametrize("name", STRATEGIES)
def test_commands_in_closed_loop_are_equal_to_the_bit(name: str) -> None:
    assert check_loops(name, range(2)) > 100


@pytest.mark.slow
@pytest.mark.parametrize("name", STRATEGIES)
def test_commands_of_a_thousand_drives(name: str) -> None:
    cycles = check_loops(name, range(100, 180))
    print(f"{name}: {cycles} cycles, 0 differ")
    assert cycles > 4000


def check_fault(number: int) -> int:
    """A fault on the exact plant: all cycles under the block in C are those under the block in Python."""
    kind = FAULT_KINDS[number % len(FAULT_KINDS)]
    name = STRATEGIES[(number // len(FAULT_KINDS)) % len(STRATEGIES)]
    drive = next(iter(fault_drive(number).positions.values()))
    design = design_for(controller_of(name), drive)
    code = written(design, Vectors(("cycles",), ()), "c", "block", "float64")
    outcomes = []
    with CompiledBlock(design, code.c_sources, "block") as block:
        for one in (design.block(), block):
            rng = np.random.default_rng(5000 + number)
            outcomes.append(follow(one, drive, Case(kind, float(rng.uniform(0.01, 0.3)), rng, drive)))
    first, second = (outcome.cycles for outcome in outcomes)
    assert first == second, (kind, name)
    assert outcomes[0].compared == outcomes[1].compared
    assert any(cycle.fault for cycle in first) or kind in ("restart", "stop", "stuck")
    return len(first)


@pytest.mark.parametrize("number", range(0, 9 * len(STRATEGIES), 5))
def test_faults_meet_the_same_answer_in_c(number: int) -> None:
    assert check_fault(number) > 10


@pytest.mark.slow
def test_500_faults_in_c() -> None:
    cycles = sum(map(check_fault, range(500)))
    print(f"500 faults, {cycles} cycles, 0 differ")


@pytest.mark.parametrize("name", STRATEGIES)
def test_the_exported_test_runs_under_sanitizers(name: str, tmp_path: Path) -> None:
    """`make test` of the export, with and without checks of addresses and undefined behaviour."""
    folder = tmp_path / "out"
    export = export_controller(controller_of(name), CRANE, "c", folder)
    prefix = export.prefix
    for flags in ((), SANITIZERS):
        tools.run(
            "gcc", *tools.STRICT, "-O1", *flags, "-o", "check", f"test_{prefix}.c", f"{prefix}.c", "-lm",
            cwd=folder,
        )  # fmt: skip
        said = tools.run(folder / "check", "vectors.csv", cwd=folder)
        assert " 0 differ" in said, said
