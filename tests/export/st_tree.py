"""Structured Text as a checked tree: parsed by the tree-sitter grammar of IEC 61131-3, declarations read.

Independent of `softstart.export.st`: what an engineering tool would reject is rejected here, and so is
everything that this reader does not know. The grammar is the package tree-sitter-iec61131-3-st (MIT), which
pip compiles where it is installed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import tree_sitter
import tree_sitter_iec61131_3_st as grammar

ELEMENTARY = ("LREAL", "REAL", "LINT", "BOOL")
LONGEST_NAME = 32

# Table 4 of IEC 61131-3 (third edition), the types and standard functions, the operators of the Instruction
# List and the qualifiers of actions: what one tool or another reserves
WORDS = """
    abs abstract acos action add add_dt_time add_time and andn any any_bit any_char any_date any_duration
    any_elementary any_int any_magnitude any_num any_real any_signed any_string any_unsigned array asin at
    atan atan2 begin bool bool_to_lint by byte cal calc calcn case ceil char class concat configuration
    constant continue cos ctd ctu ctud d date date_and_time delete dint div divtime do ds dt dword else
    elsif en end_action end_case end_class end_configuration end_for end_function end_function_block end_if
    end_interface end_method end_namespace end_program end_repeat end_resource end_step end_struct
    end_transition end_type end_var end_while eno eq exit exp expt extends f_edge f_trig false final find
    floor for from function function_block ge goto gt if implements in initial_step insert int interface
    internal interval jmp jmpc jmpcn l ld ldate ldn ldt le left len limit lint ln log lower_bound lreal lt
    ltime ltod lword max method mid min mod move mul mux n namespace ne non_retain not null of on or orn
    override p pointer priority private program program_type property protected public r r1 r_edge r_trig
    read_only read_write real ref ref_to reference repeat replace resource ret retain retc retcn return
    right rol ror round rs s s1 sd sel shl shr sin single sint sl sqrt sr st step stn string struct sub
    super t tan task then this time time_of_day to tod ton tof tp transition true trunc type udint uint ulint
    until upper_bound using usint var var_access var_config var_external var_global var_in_out var_input
    var_output var_stat var_temp wchar while with word wstring xor
"""
RESERVED = frozenset(WORDS.split())


class StError(ValueError):
    """What is no Structured Text of the emitted subset."""

    def __init__(self, node: tree_sitter.Node, reason: str) -> None:
        super().__init__(f"line {node.start_point[0] + 1}: {reason}: {text_of(node)[:80]}")


@dataclass(frozen=True)
class Array:
    shape: tuple[int, ...]
    element: Type
    name: str = ""  # two types are the same if their names are; without names they are not


@dataclass
class Struct:
    name: str
    fields: dict[str, Type] = field(default_factory=dict)  # keys in small letters


Type = str | Array | Struct


@dataclass
class Unit:
    """A function, function block or program."""

    kind: str
    name: str
    returns: str | None
    inputs: dict[str, Type]
    in_outs: dict[str, Type]
    outputs: dict[str, Type]
    locals: dict[str, Type]
    constants: dict[str, tuple[str, tree_sitter.Node]]
    initial: dict[str, tree_sitter.Node]
    instances: dict[str, Unit]
    body: list[tree_sitter.Node]

    def type_of(self, name: str) -> Type | None:
        for group in (self.inputs, self.in_outs, self.outputs, self.locals):
            if name in group:
                return group[name]
        return self.constants[name][0] if name in self.constants else None


def text_of(node: tree_sitter.Node) -> str:
    return (node.text or b"").decode()


def tree_of(text: str) -> tree_sitter.Node:
    """The tree, without errors."""
    root = tree_sitter.Parser(tree_sitter.Language(grammar.language())).parse(text.encode()).root_node
    if root.has_error:
        bad = next(node for node in _all(root) if node.is_error or node.is_missing)
        raise StError(bad, "does not parse")
    return root


def _all(node: tree_sitter.Node) -> Iterator[tree_sitter.Node]:
    yield node
    for child in node.children:
        yield from _all(child)


def children(node: tree_sitter.Node, name: str) -> list[tree_sitter.Node]:
    """The named children of a field, without commas and comments."""
    return [
        child for child in node.children_by_field_name(name) if child.is_named and child.type != "comment"
    ]


def child(node: tree_sitter.Node, name: str) -> tree_sitter.Node:
    found = children(node, name)
    if len(found) != 1:
        raise StError(node, f"{name}: {len(found)} instead of one")
    return found[0]


def parts(node: tree_sitter.Node) -> list[tree_sitter.Node]:
    return [part for part in node.children if part.is_named and part.type != "comment"]


@dataclass
class Source:
    """All declarations of a text; names are kept in small letters."""

    structs: dict[str, Struct] = field(default_factory=dict)
    arrays: dict[str, Array] = field(default_factory=dict)
    units: dict[str, Unit] = field(default_factory=dict)

    def read(self, text: str) -> Source:
        text.encode("ascii")  # what all tools read
        for node in parts(tree_of(text)):
            match node.type:
                case "type_declaration":
                    self._structure(node)
                case "function_declaration" | "function_block_declaration" | "program_declaration":
                    unit = self._unit(node)
                    self.units[unit.name.lower()] = unit
                case "empty_statement":
                    pass
                case _:
                    raise StError(node, f"{node.type} is not known")
        return self

    def _name(self, node: tree_sitter.Node, taken: set[str]) -> str:
        """A new name, which every tool takes."""
        name = text_of(node)
        if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name):
            raise StError(node, "no identifier, or an underscore at an end or twice")
        if len(name) > LONGEST_NAME:
            raise StError(node, f"more than {LONGEST_NAME} characters")
        if name.lower() in RESERVED:
            raise StError(node, "reserved")
        if name.lower() in taken:
            raise StError(node, "twice, or differs in case alone")
        taken.add(name.lower())
        return name

    def _globals(self) -> set[str]:
        return {*self.structs, *self.arrays, *self.units}

    def _type(self, node: tree_sitter.Node) -> Type:
        if node.type == "elementary_type" and text_of(node) in ELEMENTARY:
            return text_of(node)
        if node.type == "identifier" and text_of(node).lower() in self.structs:
            return self.structs[text_of(node).lower()]
        if node.type == "identifier" and text_of(node).lower() in self.arrays:
            return self.arrays[text_of(node).lower()]
        if node.type == "array_type":
            element = self._type(child(node, "element_type"))
            if isinstance(element, Array):
                raise StError(node, "array of arrays")
            shape = []
            for one in children(node, "range"):
                if text_of(child(one, "lower")) != "0":
                    raise StError(node, "an array begins at 0")
                shape.append(int(text_of(child(one, "upper"))) + 1)
            if len(shape) > 2 or min(shape) < 1:
                raise StError(node, "one or two dimensions with an element")
            return Array(tuple(shape), element)
        raise StError(node, "type is not known")

    def _structure(self, node: tree_sitter.Node) -> None:
        definitions = parts(node)
        if len(definitions) != 1:
            raise StError(node, "one structure in a TYPE block")
        name = self._name(child(definitions[0], "name"), self._globals())
        inline = child(definitions[0], "definition")
        if inline.type == "array_type":
            array = self._type(inline)
            assert isinstance(array, Array)
            self.arrays[name.lower()] = Array(array.shape, array.element, name)
            return
        if inline.type != "structure_type_inline":
            raise StError(node, "structures only")
        struct, taken = Struct(name), set[str]()
        for one in parts(inline):
            if one.type != "structure_field" or children(one, "default"):
                raise StError(one, "a field and its type only")
            field_name = self._name(child(one, "name"), taken)
            struct.fields[field_name.lower()] = self._type(child(one, "type"))
        if not struct.fields:
            raise StError(node, "no field")
        self.structs[name.lower()] = struct

    def _unit(self, node: tree_sitter.Node) -> Unit:
        name = self._name(child(node, "name"), self._globals())
        kind = node.type.removesuffix("_declaration")
        returned = children(node, "return_type")
        if len(returned) != (kind == "function"):
            raise StError(node, "a function has a type, nothing else has")
        returns = self._type(returned[0]) if returned else None
        if returns is not None and not isinstance(returns, str):
            raise StError(node, "a function has a number")
        unit = Unit(kind, name, returns, {}, {}, {}, {}, {}, {}, {}, children(node, "body"))
        taken = {name.lower(), *self._globals()}
        for block in parts(node):
            if block.type in ("var_input", "var_in_out", "var_output", "var_block"):
                for one in parts(block):
                    self._variable(unit, block, one, taken)
            elif block not in unit.body and block.type not in ("identifier", "elementary_type"):
                raise StError(block, f"{block.type} is not known")
        if kind == "program" and (unit.inputs or unit.in_outs):
            raise StError(node, "a program has no inputs")
        return unit

    def _variable(self, unit: Unit, block: tree_sitter.Node, one: tree_sitter.Node, taken: set[str]) -> None:
        constant = False
        if one.type == "var_qualifier_list":
            if text_of(one) != "CONSTANT":
                raise StError(one, "CONSTANT only")
            return
        if one.type != "variable_declaration":
            raise StError(one, "declaration is not known")
        constant = any(part.type == "var_qualifier_list" for part in parts(block))
        names = children(one, "names")
        if len(names) != 1:
            raise StError(one, "one name a declaration")
        name = self._name(names[0], taken).lower()
        node = child(one, "type")
        initial = children(one, "initial_value")
        instance = self.units.get(text_of(node).lower()) if node.type == "identifier" else None
        if instance is not None:
            if instance.kind != "function_block" or block.type != "var_block" or unit.kind == "function":
                raise StError(one, "an instance of a function block stands in VAR of a block or program")
            unit.instances[name] = instance
            return
        declared = self._type(node)
        if initial and not isinstance(declared, str):
            raise StError(one, "initial values of numbers only")
        if constant:
            if not isinstance(declared, str) or not initial:
                raise StError(one, "a constant is a number")
            unit.constants[name] = (declared, initial[0])
            return
        if initial:
            if block.type == "var_in_out":
                raise StError(one, "VAR_IN_OUT has no initial value")
            unit.initial[name] = initial[0]
        if block.type == "var_in_out" and isinstance(declared, str):
            raise StError(one, "VAR_IN_OUT for structures and arrays only")
        if block.type in ("var_input", "var_output") and not isinstance(declared, str):
            raise StError(one, "numbers only")
        kinds = {"var_input": unit.inputs, "var_in_out": unit.in_outs, "var_output": unit.outputs}
        kinds.get(block.type, unit.locals)[name] = declared
