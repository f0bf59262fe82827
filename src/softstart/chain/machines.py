"""MachineTable of drives and chains alike, and one machine from a name or a file."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import wraps
from numbers import Real
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

import numpy as np

from softstart.chain.elements import LIBRARY
from softstart.chain.model import Chain
from softstart.drive import Drive, Machine, library
from softstart.drive.checks import BROADCAST
from softstart.drive.machine_table import DriveColumns, MachineTable
from softstart.errors import InputError
from softstart.hints import nearest
from softstart.input.files import ABSENT, object_of, read_text, refusal_of
from softstart.input.gear import alike
from softstart.input.parameters import Parameter, Wording, at_motor, read_value
from softstart.quantities import RefusedError, parse, show

MachineLike = Machine | str | os.PathLike[str]  # one, or its name or file
SINGLE = "machine_table: all values are single; give a list for one, as gap=[0.5, 2.0]."
Values = dict[str, tuple[Parameter, Any]]  # by path


def as_machine(given: object, name: str = "drive") -> Machine:
    """The drive or chain, or that of a name or file; InputError for anything else. `name` is the argument's.

    >>> as_machine("crane-4-mass").name == Chain.load("crane-4-mass").name
    True
    """
    return object_of(given, (Drive, Chain), load_machine, f"{name}: give one Drive or Chain")


def as_chain(given: Chain | str | os.PathLike[str]) -> Chain:
    """The chain itself, or that of a name or file; InputError for anything else."""
    return object_of(given, Chain, Chain.load, "chain: give one Chain")


Rest = ParamSpec("Rest")
Result = TypeVar("Result")


def by_name(
    function: Callable[Concatenate[Chain, Rest], Result],
) -> Callable[Concatenate[Chain | str | os.PathLike[str], Rest], Result]:
    """The same function of a chain or of its name or file."""

    @wraps(function)
    def named(chain: Chain | str | os.PathLike[str], *rest: Rest.args, **options: Rest.kwargs) -> Result:
        return function(as_chain(chain), *rest, **options)

    return named  # type: ignore[return-value]  # `chain` may be given by its name as well


def load_machine(given: str | os.PathLike[str], also: Mapping[str, object] | None = None) -> Drive | Chain:
    """The drive or the chain of a file, or a shipped one by its name; `also` changes a chain.

    A file is that of a chain if it has a table [[mass]].

    >>> type(load_machine("crane-4amtkf")).__name__, type(load_machine("crane-4-mass")).__name__
    ('Drive', 'Chain')
    """
    if is_chain(given):
        return Chain.load(given, also=also)
    try:
        return Drive.load(given)
    except InputError:
        names = LIBRARY.names()
        if refusal_of(given) == ABSENT and nearest(str(given), (*names, *library.names())) in names:
            Chain.load(given)  # names the chain that was meant
        raise


def is_chain(given: str | os.PathLike[str]) -> bool:
    """Whether a name or a path is that of a chain."""
    if isinstance(given, str) and given in LIBRARY.names():
        return given not in library.names()
    with suppress(RefusedError):
        return isinstance(given, str | os.PathLike) and is_chain_text(read_text(given))
    return False


def is_chain_text(text: str) -> bool:
    """Whether a text is that of a chain: it has a table [[mass]].

    >>> is_chain_text("[[mass]]"), is_chain_text("[motor]")
    (True, False)
    """
    return bool(re.search(r"^[ \t]*\[\[[ \t]*mass[ \t]*\]\]", text, re.MULTILINE))


def known_from(text: str, where: str = "") -> Drive | Chain:
    """The drive or chain of a TOML text, or the drive of a data sheet.

    >>> known_from(library.text("crane-4amtkf")).gap
    0.5
    """
    if is_chain_text(text):
        return Chain.from_toml(text, where=where)
    return Drive.from_toml(text, where=where)


def refuse_other_kind(one: Machine, other: Machine, subject: str) -> None:
    """InputError where a drive and a chain are to stand side by side; `subject` names the other one."""
    if type(one) is not type(other):
        raise InputError(
            f'{subject} = "{other.name}": it is {other.WHAT} and "{one.name}" {one.WHAT}; machines of one '
            "kind stand side by side, name another one."
        )


def machine_table(machine: MachineLike | MachineTable, **fields: object) -> MachineTable:
    """Many machines that differ in some values, for one call of `simulate`.

    Parameters
    ----------
    machine : Drive, Chain, MachineTable or str
        The machine that they are variants of, or its name or file; or records that are to differ in further
        values.
    **fields : numbers, texts with a unit, or lists and arrays of such
        Parameters of a drive by their names in Python, as `gap` and `load_inertia`; of a chain the same words
        (its gap is the sum of all its gaps at the motor shaft) and those of one mass or shaft, as
        `shaft_2_gap`. Arrays broadcast together; at least one is needed. Angles and torques in SI as in
        `Drive`. An angle `start_position` stays where it is when the gap changes.

    Returns
    -------
    MachineTable
        Of the shape to which the fields broadcast.

    Raises
    ------
    InputError
        For every field that is unknown and every value that no machine can have, with its place.

    Examples
    --------
    >>> from softstart import Drive, machine_table, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> simulate(machine_table(crane, gap=[0.5, 2.0]), "direct").k_dyn.round(3).values.tolist()
    [3.118, 4.865]
    >>> machine_table(crane, gap=[[0.5], [2.0]], load_inertia=["0.1 kg*m^2", 0.175]).shape
    (2, 2)
    """
    return _records(machine, fields, DriveColumns.replace)


def varied(machine: Machine | MachineTable, values: Mapping[str, Any]) -> MachineTable:
    """As `machine_table`, but the start of a drive stays where it was in its gap, see `Drive.with_gap`.

    >>> flank = Drive.load("crane-4amtkf").replace(start_position=0.25)
    >>> varied(flank, {"gap": [1.0]}).fields["start_position"]
    array([0.5])
    """
    return _records(machine, values, DriveColumns.with_gap if "gap" in values else DriveColumns.replace)


def quantity_of(machine: Machine, key: str, given: object, name: str) -> float:
    """A value of a parameter of a machine, by its word there, in SI at the motor shaft; also "... at output".

    Raises `InputError`, a sentence that begins with `name`.

    >>> crane = Drive.load("crane-4amtkf").replace(gear_ratio=40)
    >>> quantity_of(crane, "gap", "0.01 rad at output", "gaps"), quantity_of(crane, "gap", "2 rad", "gaps")
    (0.4, 2.0)
    """
    knob = machine.parameter_value(key)
    assert knob is not None
    p = knob.parameter
    try:
        number = parse(at_motor(p, given, machine.gear_with(**{p.name: given})), p.unit)
        if not isinstance(number, float):
            raise RefusedError(f"the {p.meaning} is one number, not a list")
        return number
    except RefusedError as refusal:
        raise InputError(f"{name} = {show(given)}: {refusal.reason}.") from None


def listed_of(given: object, name: str) -> list[Any]:
    """The values of a list, or the one that is none; "at output" stands behind each of them, or behind none.

    >>> listed_of("1x", "gaps"), listed_of([0.5, "2x"], "gaps")
    (['1x'], [0.5, '2x'])
    """
    listed = [given] if isinstance(given, str | Real) or not hasattr(given, "__iter__") else list(given)
    try:
        alike(listed)
    except RefusedError as refusal:
        raise InputError(f"{name} = {show(listed)}: {refusal.reason}.") from None
    return listed


def _records(
    machine: MachineLike | MachineTable, values: Mapping[str, object], change: Callable[..., DriveColumns]
) -> MachineTable:
    if not isinstance(machine, MachineTable):
        machine = as_machine(machine)
        machine = MachineTable(machine, {}, (machine,))
    whole = machine.machine
    if isinstance(whole, Chain):
        return _chains(machine, values)
    columns = machine.parts[0]
    assert isinstance(columns, Drive)
    table = MachineTable.of(whole, change(DriveColumns.of(columns), **values))
    if not table.fields:
        raise InputError(SINGLE)
    return table


def _chains(chains: MachineTable, values: Mapping[str, Any]) -> MachineTable:
    """Chains that differ in these values, by the words of their parameters."""
    chain = cast("Chain", chains.machine)
    wrong, read = list[str](), dict[str, Any]()
    for key, value in values.items():
        parameter = chain.parameter_value(key)
        if parameter is None:
            wrong.append(chain.no_such(key, value))
            continue
        try:
            read[parameter.name] = read_value(parameter.parameter, value, batch=True, gear=chain.gear_with())
        except RefusedError as refusal:
            wording = Wording(written={parameter.parameter.name: key})
            wrong.append(wording.refused(parameter.parameter, value, refusal))
    arrays = {name: value for name, value in read.items() if isinstance(value, np.ndarray)}
    arrays = {**chains.fields, **arrays}
    shapes = ", ".join(f"{name} has shape {value.shape}" for name, value in arrays.items())
    try:
        shape = np.broadcast_shapes(*(value.shape for value in arrays.values()))
    except ValueError:
        wrong.append(f"{shapes}: {BROADCAST}.")
    if not (arrays or wrong):
        wrong.append(SINGLE)
    if wrong:
        raise InputError(wrong)
    fields = {name: np.broadcast_to(value, shape) for name, value in arrays.items()}
    each = np.broadcast_to(np.arange(len(chains.parts)).reshape(chains.shape), shape).ravel()
    changed = {name: np.broadcast_to(value, shape).ravel().tolist() for name, value in read.items()}
    rows = [dict(zip(changed, row, strict=True)) for row in zip(*changed.values(), strict=True)]
    parts = (chains.parts[i].with_values(row) for i, row in zip(each, rows, strict=True))
    return MachineTable(chain, fields, tuple(parts))
