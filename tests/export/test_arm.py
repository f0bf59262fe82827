"""Exported C on Arm processors, in emulation: the same commands as here, to the bit in double precision."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.export import tools
from tests.export.blocks import CONTROLLER

ARM = tools.HERE / "arm"
# processor, the unit for floating point that it has, the board that has it
PROCESSORS = {
    "cortex-m7": ("fpv5-d16", "mps2-an500"),  # double precision
    "cortex-m4": ("fpv4-sp-d16", "mps2-an386"),  # single precision
}
ECHO = r"""
#include <stdio.h>
#include "count.h"
int main(void)
{
    count_State state;
    count_Input input = {1, 3.0, 0.0, 1};
    count_Output output;
    count_init(&state);
    for (int i = 0; i < 3; i++) {
        input.angle = 0.1 * i;
        count_step(&state, &input, &output);
    }
    printf("%.17g %d\n", output.torque, (int)output.fault);
    return 0;
}
"""


def run_on(processor: str, folder: Path, *sources: str) -> str:
    """What a program prints, whose sources are in the folder, with the folder as its own."""
    unit, board = PROCESSORS[processor]
    tools.run(
        "arm-none-eabi-gcc", "-mthumb", f"-mcpu={processor}", f"-mfpu={unit}", "-mfloat-abi=hard",
        *tools.STRICT, "-O2", "--specs=rdimon.specs", "-T", ARM / "boards.ld", ARM / "startup.c", *sources,
        "-o", "program.elf", "-lm", cwd=folder,
    )  # fmt: skip
    return tools.run(
        "qemu-system-arm", "-M", board, "-nographic", "-monitor", "none", "-serial", "none", "-semihosting",
        "-kernel", "program.elf", cwd=folder,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("processor", PROCESSORS)
def test_double_precision_is_that_of_this_machine(processor: str, tmp_path: Path) -> None:
    for name, text in {**CONTROLLER, "echo.c": ECHO}.items():
        (tmp_path / name).write_text(text)
    tools.run("gcc", *tools.STRICT, "echo.c", "count.c", "-o", "echo", "-lm", cwd=tmp_path)
    assert run_on(processor, tmp_path, "echo.c", "count.c") == tools.run(tmp_path / "echo")
