"""A control block as Structured Text, and as PLCopen XML: the files of an export."""

from __future__ import annotations

import math

from softstart import __version__
from softstart.export.block import BlockProgram
from softstart.export.plcopen import plcopen_xml
from softstart.export.st_block import add_test, write_block
from softstart.export.vectors import Vectors
from softstart.kernel.guard import FAULTS

TESTED = 200  # rows of the test program, from the start as it is
SAME = 1e-9  # of the largest torque: exp, sin and the like may round otherwise on another processor


def block_st(block: BlockProgram, prefix: str, vectors: Vectors, single: bool = False) -> dict[str, str]:
    """The source and the same as PLCopen XML, by file name; both hold a program that tests the block.

    Parameters
    ----------
    block : what is written; comments of its structures are those of inputs, outputs and parameters.
    prefix : the name of the function block, and the beginning of all other names.
    vectors : of which the first rows of the nominal start are played by the program TEST_prefix.
    single : numbers are REAL; clocks and angles stay LREAL.
    """
    faults = "; ".join(f"{code} {text}" for code, text in enumerate(FAULTS) if text)
    comment = (
        f"Call it once in each cycle of {block.period:g} s. The torque is always a number within the limits "
        "of the drive; after a fault it is 0, or the limit nearest to it, until run goes from FALSE to TRUE. "
        f"Faults: {faults}"
    )
    text = write_block(block.program, block.constants, prefix, single, comment=comment)
    rows = [
        (row.inputs, row.torque, row.fault)
        for row in vectors.rows
        if row.scenario == vectors.rows[0].scenario and all(map(math.isfinite, row.inputs.values()))
    ]
    most = max((abs(torque) for _, torque, _ in rows), default=0.0)
    add_test(text, rows[:TESTED], vectors.room or SAME * most)
    return {f"{prefix}.st": str(text), f"{prefix}.xml": plcopen_xml(text, __version__)}
