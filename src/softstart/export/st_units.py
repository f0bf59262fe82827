"""What a text of Structured Text consists of: TYPE blocks of structures, functions, blocks and programs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from softstart.export.st_names import comment

# in the order in which they stand; one tool takes all for constant that stands behind constants
BLOCKS = ("VAR_IN_OUT", "VAR_INPUT", "VAR_OUTPUT", "VAR", "VAR CONSTANT")
DECLARATION = re.compile(r" *(\w+) : ([^:;]+?)(?: := ([^;]+))?;")


@dataclass(frozen=True)
class Declared:
    """A variable or field, with its type and initial value as they are written."""

    name: str
    type: str
    initial: str = ""
    comment: str = ""

    def __str__(self) -> str:
        initial = f" := {self.initial}" if self.initial else ""
        return f"{self.name} : {self.type}{initial};{comment(self.comment)}"


@dataclass(frozen=True)
class TypeBlock:
    """A structure, or a name for an array.

    >>> print(TypeBlock("gains", (Declared("kp", "LREAL", comment="N m s/rad"),), "of the speed loop"))
    TYPE (* of the speed loop *)
        gains : STRUCT
            kp : LREAL; (* N m s/rad *)
        END_STRUCT;
    END_TYPE
    <BLANKLINE>
    """

    name: str
    fields: tuple[Declared, ...]
    comment: str = ""
    array: str = ""

    def __str__(self) -> str:
        if self.array:
            return f"TYPE\n    {self.name} : {self.array};\nEND_TYPE\n"
        fields = [f"        {one}" for one in self.fields]
        head = [f"TYPE{comment(self.comment)}", f"    {self.name} : STRUCT"]
        return "\n".join([*head, *fields, "    END_STRUCT;", "END_TYPE", ""])


@dataclass
class Unit:
    """A FUNCTION, FUNCTION_BLOCK or PROGRAM; `result` is the type of a function."""

    kind: str
    name: str
    result: str = ""
    blocks: dict[str, list[Declared]] = field(default_factory=dict)
    body: list[str] = field(default_factory=list)
    comment: str = ""

    def declare(self, block: str, declared: Iterable[Declared]) -> None:
        """Add variables to a block, as VAR_INPUT."""
        self.blocks.setdefault(block, []).extend(declared)

    def declare_all(self, block: str, types: Mapping[str, str]) -> None:
        """Add variables of these types."""
        self.declare(block, (Declared(name, kind) for name, kind in types.items()))

    def __str__(self) -> str:
        result = f" : {self.result}" if self.result else ""
        lines = [f"{self.kind} {self.name}{result}{comment(self.comment)}"]
        for block in BLOCKS:
            if self.blocks.get(block):
                lines += [block, *(f"    {one}" for one in self.blocks[block]), "END_VAR"]
        return "\n".join([*lines, *self.body, f"END_{self.kind}", ""])


def function_of(text: str) -> Unit:
    """The unit of a function that is written line by line.

    >>> text = "FUNCTION F : LREAL\\nVAR_INPUT\\n    x : LREAL;\\nEND_VAR\\nF := 2.0 * x;\\nEND_FUNCTION"
    >>> str(function_of(text)).strip() == text
    True
    """
    lines = text.strip().splitlines()
    _, name, _, result = lines[0].split()
    unit, block = Unit("FUNCTION", name, result), ""
    for line in lines[1:-1]:
        if line in BLOCKS:
            block = line
        elif line == "END_VAR":
            block = ""
        elif block:
            found = DECLARATION.fullmatch(line)
            assert found is not None, line
            unit.declare(block, [Declared(found[1], found[2], found[3] or "")])
        else:
            unit.body.append(line)
    return unit
