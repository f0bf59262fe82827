"""What FMUs are made of: a control block, or the exact machine, in C with its signals."""

from __future__ import annotations

from softstart.drive.machine import Machine
from softstart.export.block import BlockProgram, block_program
from softstart.export.block_c import block_c
from softstart.export.fmu import Model, signals
from softstart.export.machine import machine_c
from softstart.export.values import Structs
from softstart.kernel.plant import PLANT_INPUT, PLANT_OUTPUT
from softstart.start.block import ControlBlock


def block_model(
    block: ControlBlock,
    prefix: str,
    name: str,
    readme: str,
    single: bool = False,
    program: BlockProgram | None = None,
) -> Model:
    """A control block as it is, its drive running at the target speed.

    Parameters
    ----------
    prefix : of the C code, and name of the library.
    name : shown to users.
    readme : Markdown.
    single : whether its numbers are float, but for times and angles.
    program : the block translated, if that has been done.

    Raises
    ------
    InputError
        For a strategy in plain Python, and for code that cannot be translated, with its file and line.
    """
    program = program or block_program(block)
    given, output = program.struct("given"), program.struct("output")
    assert given is not None
    assert output is not None
    starts = {"run": 1.0, "set_speed": float(block.drive.target_speed)}
    sources = block_c(program, prefix, single)
    return Model(
        name, prefix, signals(given, starts), signals(output), sources, readme, period=program.period
    )


def machine_model(
    machine: Machine, prefix: str, readme: str, step: float = 0.001, stop_time: float = 1.0
) -> Model:
    """The exact machine, moved by a torque demand; step and stop time are suggestions to simulators, s."""
    structs = Structs()
    inputs, outputs = (signals(structs.of(dtype)) for dtype in (PLANT_INPUT, PLANT_OUTPUT))
    sources = machine_c(machine, prefix)
    return Model(machine.name, prefix, inputs, outputs, sources, readme, step=step, stop_time=stop_time)
