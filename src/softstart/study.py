"""What a study is, and how studies are found.

A study answers questions of the literature with numbers: it returns tables, claims with a verdict each, and
figures. It is registered in the entry-point group `softstart.studies` and run by `softstart study NAME`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from softstart.errors import InputError
from softstart.plugins import STUDIES, load

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Progress = Callable[[str], None]  # called with a few words on what is being done now


class Verdict(StrEnum):
    """What became of a claim; the value is the word shown."""

    CONFIRMED = "confirmed"
    REFUTED = "refuted"
    PARTLY = "partly"

    @classmethod
    def of(cls, *held: bool) -> Verdict:
        """Confirmed if all held, refuted if none did.

        >>> Verdict.of(True, False), Verdict.of(False)
        (<Verdict.PARTLY: 'partly'>, <Verdict.REFUTED: 'refuted'>)
        """
        return cls.CONFIRMED if all(held) else cls.PARTLY if any(held) else cls.REFUTED


@dataclass(frozen=True)
class Claim:
    """A statement of a source, the verdict on it, and the sentence with the number that says so.

    `verdict` may be given as its word; another word is a ValueError.

    >>> Claim("Method 1 never brings K_dyn below 2.", "confirmed", "Smallest found: 2.0003.").verdict
    <Verdict.CONFIRMED: 'confirmed'>
    """

    statement: str
    verdict: Verdict | str
    evidence: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "verdict", Verdict(self.verdict))


@dataclass(frozen=True)
class Table:
    """A titled table; each row has one cell (text, number or None) a column. Units go into the column names.

    A number that is not finite becomes None.

    >>> Table("Peak", ("gap, rad", "K_dyn"), [(0.5, 3.1179)]).rows
    ((0.5, 3.1179),)
    >>> Table("Peak", ("gap, rad", "K_dyn"), [(0.5,)])
    Traceback (most recent call last):
    ValueError: table Peak, row 1: 1 cells for 2 columns.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", tuple(self.columns))
        object.__setattr__(self, "rows", tuple(tuple(map(_plain, row)) for row in self.rows))
        for index, row in enumerate(self.rows, start=1):
            if (cells := len(row)) != (columns := len(self.columns)):
                raise ValueError(f"table {self.title}, row {index}: {cells} cells for {columns} columns.")

    @classmethod
    def of(cls, title: str, cells: Mapping[str, Iterable[Any]]) -> Table:
        """From the cells below each heading.

        >>> Table.of("Peak", {"gap, rad": [0.5, 2.0], "K_dyn": [3.1179, math.nan]}).rows
        ((0.5, 3.1179), (2.0, None))
        """
        return cls(title, tuple(cells), tuple(zip(*cells.values(), strict=True)))


def _plain(cell: Any) -> Any:
    """A cell as JSON has it: numbers of Python, None where there is none."""
    cell = cell.item() if hasattr(cell, "item") else cell
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell


@dataclass(frozen=True)
class StudyResult:
    """What a study found: tables, claims, and figures by file stem."""

    tables: Sequence[Table] = ()
    claims: Sequence[Claim] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Tables and claims as plain data, for JSON."""
        return {"claims": [*map(asdict, self.claims)], "tables": [*map(asdict, self.tables)]}


class Study(ABC):
    """One study. Made without arguments; `run` does the work.

    `pictures` are the file stems of the figures it draws, known without running it.

    >>> class Nothing(Study):
    ...     name, title = "nothing", "Nothing at all"
    ...     def run(self, out=None, progress=print):
    ...         progress("doing nothing")
    ...         return StudyResult()
    >>> Nothing().run().claims
    doing nothing
    ()
    """

    name: ClassVar[str] = ""
    title: ClassVar[str] = ""
    pictures: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def result(
        cls, tables: Sequence[Table], claims: Sequence[Claim], figures: Sequence[Figure]
    ) -> StudyResult:
        """The result, with the figures in the order of `pictures`."""
        return StudyResult(tables, claims, dict(zip(cls.pictures, figures, strict=True)))

    @abstractmethod
    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """Do the study; call `progress` with what is being done.

        `out` is a folder for files beyond the tables and pictures, which the caller writes; None if nothing
        is to be written. Raises InputError or SimulationError like everything else.
        """


def find_study(name: str) -> Study:
    """The study of this name.

    Raises InputError in one sentence if there is none, or if it cannot be loaded.

    >>> find_study("papper-g")
    Traceback (most recent call last):
    softstart.errors.InputError: study = "papper-g": there is no study of this name; did you mean "paper-g"?
    """
    found = load(STUDIES, "study", name, "softstart study")
    if not (isinstance(found, type) and issubclass(found, Study)):
        raise InputError(f'study = "{name}": {found!r} is no study; derive it from softstart.study.Study.')
    return found()
