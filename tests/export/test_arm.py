"""Exported C on Arm processors, in emulation: the same commands as here, to the bit in double precision."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.export import tools
from tests.export.test_fmu_loops import controller_of

from softstart import export_controller
from softstart.export.package import Real
from softstart.plugins import CONTROLLERS, registered

ARM = tools.HERE / "arm"
# processor, the unit for floating point that it has, the board that has it
PROCESSORS = {
    "cortex-m7": ("fpv5-d16", "mps2-an500"),  # double precision
    "cortex-m4": ("fpv4-sp-d16", "mps2-an386"),  # single precision
}
# N m, where the mathematical library of the target, newlib, rounds otherwise than the one here
OTHER_LIBRARY = {("shaped", "float64"): 1e-13}


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
        "-kernel", "program.elf", cwd=folder, may_fail=True,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(registered(CONTROLLERS)))
@pytest.mark.parametrize(("processor", "real"), [("cortex-m7", "float64"), ("cortex-m4", "float32")])
def test_every_strategy_answers_as_here(processor: str, real: Real, name: str, tmp_path: Path) -> None:
    """The test program of the export, which reads its vectors from this computer; float64 to the bit."""
    export = export_controller(controller_of(name), "crane-4amtkf", "c", tmp_path / "export", real=real)
    said = run_on(processor, tmp_path / "export", f"{export.prefix}.c", f"test_{export.prefix}.c")
    found = re.search(r": ([1-9]\d*) rows, (\d+) differ; largest difference (\S+) N m", said)
    assert found, said
    assert float(found[3]) <= OTHER_LIBRARY.get((name, real), 0.0), said
