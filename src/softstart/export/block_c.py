"""A control block as C99: one header, one source."""

from __future__ import annotations

from softstart.export.block import KEPT, SCRATCH, BlockProgram
from softstart.export.c import STDC, CWriter
from softstart.export.statements import Array, Struct
from softstart.kernel.guard import FAULTS

NAMES = {"given": "Input", "output": "Output"}
KEPT_AS = {"block": "block", "state": "strategy"}


def block_c(block: BlockProgram, prefix: str, single: bool = False) -> dict[str, str]:
    """The header and the source, by file name.

    Parameters
    ----------
    block : what is written.
    prefix : of all names that are seen from outside.
    single : whether numbers are float; clocks and angles stay double.
    """
    writer = CWriter(block.program, prefix, single)
    writer.renamed = {
        struct.name: outside for name, outside in NAMES.items() if (struct := block.struct(name)) is not None
    }
    functions = [writer.function(one) for one in block.program.functions]
    outside = [one for one in block.program.structs if not _is_constant(block, one)]
    inside = [one for one in block.program.structs if _is_constant(block, one)]
    return {
        f"{prefix}.h": _header(writer, block, outside),
        f"{prefix}.c": _source(writer, block, inside, functions),
    }


def _is_constant(block: BlockProgram, struct: Struct) -> bool:
    """Whether a structure belongs to constants or one cycle alone, so that the header need not have it."""
    seen: set[str] = set()

    def note(one: Struct) -> None:
        seen.add(one.name)
        for member in one.members:
            kind = member.type.element if isinstance(member.type, Array) else member.type
            if isinstance(kind, Struct):
                note(kind)

    for name in (*KEPT, *NAMES):
        kept = block.struct(name)
        if kept is not None:
            note(kept)
    return struct.name not in seen


def _header(writer: CWriter, block: BlockProgram, structs: list[Struct]) -> str:
    prefix = writer.prefix
    guard = f"{prefix.upper()}_H"
    codes = "".join(f"     {code}  {text}\n" for code, text in enumerate(FAULTS) if text)
    kept = "".join(
        f"    {writer.type_of(struct)} {KEPT_AS[name]};\n"
        for name in KEPT
        if (struct := block.struct(name)) is not None
    )
    return (
        f"/* Call {prefix}_init once, then {prefix}_step in each cycle of {block.period:g} s.\n\n"
        "   The torque is always a number within the limits of the drive. After a fault it is 0, or the\n"
        "   limit nearest to it, until `run` goes from 0 to 1. The codes of faults:\n\n"
        f"     0  none\n{codes}*/\n"
        f"#ifndef {guard}\n#define {guard}\n\n#include <stdint.h>\n\n"
        f"#define {prefix.upper()}_PERIOD {block.period!r} /* s */\n\n"
        f"typedef {'float' if writer.single else 'double'} {prefix}_real;\n\n"
        + "\n".join(writer.struct(one) for one in structs)
        + "\n/* All that is kept from cycle to cycle. */\n"
        f"typedef struct {{\n{kept}}} {prefix}_State;\n\n"
        f"void {prefix}_init({prefix}_State *state);\n"
        f"{_step(prefix)};\n\n#endif\n"
    )


def _step(prefix: str) -> str:
    return f"void {prefix}_step({prefix}_State *state, const {prefix}_Input *input, {prefix}_Output *output)"


def _source(writer: CWriter, block: BlockProgram, structs: list[Struct], functions: list[str]) -> str:
    prefix = writer.prefix
    types = "\n".join(writer.struct(one) for one in structs)
    constants, scratch, handed = [], [], []
    for variable in block.program.entry.parameters:
        name, kind = variable.name, variable.type
        if name in block.constants and isinstance(kind, Struct):
            struct = block.struct(name)
            assert struct is not None
            value = writer.value(struct, block.constants[name])
            constants.append(f"static const {writer.type_of(kind)} {name} = {value};\n")
            handed.append(f"&{name}")
        elif name in block.constants and isinstance(kind, Array):
            value = writer.nested(block.constants[name], kind)
            constants.append(f"static const {writer.declared(name, kind)} = {value};\n")
            handed.append(name)
        elif name in KEPT:
            handed.append(f"&state->{KEPT_AS[name]}")
        elif name in SCRATCH:
            scratch.append(f"    {writer.type_of(kind)} {name} = {{0}};\n")
            handed.append(f"&{name}")
        else:
            handed.append("input" if name == "given" else "output")
    entry = writer.function_name(block.program.entry)
    return (
        f'#include "{prefix}.h"\n\n#include <math.h>\n#include <string.h>\n\n{STDC}\n{types}\n'
        + "\n".join(constants)
        + writer.tables(block.program.tables)
        + "\n".join(["", *writer.helpers.values(), "", *functions])
        + f"\nvoid {prefix}_init({prefix}_State *state)\n{{\n    memset(state, 0, sizeof(*state));\n}}\n"
        f"\n{_step(prefix)}\n{{\n" + "".join(scratch) + f"    {entry}({', '.join(handed)});\n}}\n"
    )
