"""A table of machines that differ in some values, and a drive whose numbers are columns of such a table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.drive.machine import Machine
from softstart.drive.model import PARAMETERS, Drive


class DriveColumns(Drive):
    """A drive whose numbers may be arrays, which broadcast together: a table of drives, vectorised.

    What follows from the numbers of a drive follows from arrays element by element, so that a table of a
    million drives is checked and handed to the kernel without a `Drive` for each. Users see `MachineTable`.
    """

    BATCH: ClassVar[bool] = True

    @classmethod
    def of(cls, drive: Drive) -> Self:
        """The columns of a single drive, which `replace` makes longer."""
        one = cls.__new__(cls)
        vars(one).update(vars(drive))
        return one

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape to which the arrays broadcast; () without any."""
        return np.broadcast_shapes(*(v.shape for v in vars(self).values() if isinstance(v, np.ndarray)))

    def elements(self) -> Iterator[Drive]:
        """The single drives, last index fastest."""
        varied = {
            name: np.broadcast_to(value, self.shape).ravel().tolist()
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        for row in zip(*varied.values(), strict=True):
            # each element was checked with the columns
            one = Drive.__new__(Drive)
            vars(one).update(vars(self) | dict(zip(varied, row, strict=True)))
            yield one

    @property
    def permissible_torques(self) -> Matrix:
        """A row for each drive."""
        most = self.limits.shaft_torque
        return each_of(self, math.nan if most is None else most)[:, None]


def each_of(machine: Machine, values: object) -> Vector:
    """A value that follows from a machine as an array: one number, or one for each drive of columns."""
    shape = machine.shape if isinstance(machine, DriveColumns) else ()
    return np.broadcast_to(np.asarray(values, dtype=np.float64), shape).ravel()


@dataclass(frozen=True, eq=False, repr=False)
class MachineTable:
    """Many machines that differ in some values: made by `machine_table`, started by one `simulate`.

    Attributes
    ----------
    machine : Drive or Chain
        The machine that they are variants of.
    fields : mapping of str to array
        The values in which they differ, in SI: for each parameter a read-only array of shape `shape`.
    parts : tuple
        What the rows of the kernel are written from: the columns of drives, or the single chains.

    Examples
    --------
    >>> from softstart import Drive, machine_table
    >>> worn = machine_table(Drive.load("crane-4amtkf"), gap=["30 deg", "60 deg"])
    >>> worn.shape, worn.fields["gap"].round(3).tolist(), [drive.load_inertia for drive in worn.elements()]
    ((2,), [0.524, 1.047], [0.175, 0.175])
    """

    machine: Machine
    fields: Mapping[str, NDArray[np.float64]]
    parts: tuple[Machine, ...]

    @classmethod
    def of(cls, machine: Machine, columns: DriveColumns) -> Self:
        """The table of these drives."""
        values, shape = vars(columns), columns.shape
        arrays = {name: values[name] for name in PARAMETERS if isinstance(values[name], np.ndarray)}
        return cls(machine, {name: np.broadcast_to(one, shape) for name, one in arrays.items()}, (columns,))

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape to which the values broadcast together."""
        return np.broadcast_shapes(*(values.shape for values in self.fields.values()))

    def __len__(self) -> int:
        return math.prod(self.shape)

    def __repr__(self) -> str:
        return f"<MachineTable of {self.machine.name}: {', '.join(self.fields)} of shape {self.shape}>"

    def elements(self) -> Iterator[Any]:
        """The single machines, last index fastest."""
        for part in self.parts:
            yield from part.elements() if isinstance(part, DriveColumns) else (part,)

    @property
    def mean_torque(self) -> Vector:
        """M12avg_base of each machine, N m at the motor shaft, [G](16); last index fastest."""
        return np.concatenate([each_of(part, part.mean_torque) for part in self.parts])
