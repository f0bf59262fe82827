"""What a report says about itself, from a TOML file: customer, project, revisions, sources of the data."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from softstart.drive import PARAMETERS
from softstart.errors import InputError, Mistakes
from softstart.hints import nearest
from softstart.input.files import file_text
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import ParameterSet, Rows, component, parameter
from softstart.input.parameters import REQUIRED

LOGOS = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".svg": "image/svg+xml"}
MOST_LOGO = 500_000  # bytes: a report is sent by mail


def _line(path: str, meaning: str, example: str, default: object = "", choices: str = "") -> Any:
    words = tuple(choices.split(", ")) if choices else ()
    return parameter(path, "", meaning, f'"{example}"', "one line", default=default, choices=words)


class Revision(ParameterSet):
    """A revision of the document."""

    # fmt: off
    number: str = _line("revision.number", "number of the revision", "A")
    date: str = _line("revision.date", "its date, in quotes", "2026-11-20")
    author: str = _line("revision.author", "who made it", "A. Engineer")
    change: str = _line("revision.change", "what has changed", "first issue")
    # fmt: on


class Source(ParameterSet):
    """What the value of a parameter of the drive file is from."""

    # fmt: off
    parameter: str = _line("source.parameter", "the parameter of the drive file", "shaft.gap", REQUIRED)
    origin: str = _line("source.origin", "what its value is from", "identified",
        choices="data sheet, drawing, measured, identified, guessed")
    note: str = _line("source.note", "interval, sheet or drawing", "0.48 to 0.52 rad (95 %)")
    # fmt: on

    def contradictions(self) -> Iterator[str]:
        """A sentence on a parameter that no drive has."""
        paths = [one.path for one in PARAMETERS.values()]
        if self.parameter not in paths:
            near = nearest(self.parameter, paths)
            hint = f"did you mean {near}?" if near else "write it as --set does, as shaft.gap."
            yield f'parameter = "{self.parameter}": a drive has no such parameter; {hint}'


class Project(ParameterFile):
    """Names, revisions and sources of a report; `logo` is a data URI. All may be empty.

    >>> Project.read('[project]\\ncustomer = "Harbour Cranes Ltd"').customer
    'Harbour Cranes Ltd'
    >>> Project.read('[[source]]\\nparameter = "shaft.gapp"')
    Traceback (most recent call last):
    softstart.errors.InputError: [source] 1, parameter = "shaft.gapp": a drive has no such parameter; did ...
    """

    WHAT: ClassVar[str] = "a project"

    # fmt: off
    customer: str = _line("project.customer", "who the report is for", "Harbour Cranes Ltd")
    project: str = _line("project.project", "name of the project", "Gantry crane 3")
    number: str = _line("project.number", "number of the document", "SC-0147")
    author: str = _line("project.author", "who made it", "A. Engineer")
    company: str = _line("project.company", "the author's company", "Drives & Co")
    checked: str = _line("project.checked", "who checked it, and when", "B. Checker, 2026-11-20")
    approved: str = _line("project.approved", "who approved it, and when", "C. Chief, 2026-11-21")
    logo: str = _line("project.logo", "picture for the head of page 1", "logo.png")
    paper: str = _line("project.paper", "paper size", "A4", "A4", "A4, letter")
    decimal: str = _line("project.decimal", "decimal sign", "point", "point", "point, comma")
    revisions: Rows[Revision] = component(Revision, least=0, default=())
    sources: Rows[Source] = component(Source, least=0, default=())
    # fmt: on

    @classmethod
    def load(cls, given: str | os.PathLike[str], also: Mapping[str, object] | None = None) -> Self:
        """From a TOML file; the logo is looked for beside it."""
        return cls.read(file_text(given, cls.WHAT), os.fspath(given), Path(given).parent)

    @classmethod
    def read(cls, text: str, where: str = "", folder: Path = Path()) -> Self:
        """From a TOML text; all mistakes at once."""
        project = cls.from_toml(text, where=where)
        wrong = Mistakes()
        with wrong.collect():
            project._derive(logo=_picture(project.logo, folder))
        wrong.raise_if_any(f"{where}: " if where else "")
        return project

    def source_of(self, path: str) -> str:
        """What the value of a parameter is from, "" if nothing is said."""
        source = next((one for one in self.sources if one.parameter == path), None)
        return ", ".join(filter(None, (source.origin, source.note))) if source else ""

    @property
    def lines(self) -> list[tuple[str, str]]:
        """Names for the head of page 1: what, and who or which."""
        last = self.revisions[-1] if self.revisions else Revision()
        named = {
            "Customer": self.customer,
            "Project": self.project,
            "Document": self.number,
            "Author": ", ".join(filter(None, (self.author, self.company))),
            "Revision": " of ".join(filter(None, (last.number, last.date))),
        }
        return [(what, value) for what, value in named.items() if value]


def _picture(name: str, folder: Path) -> str:
    """A picture as a data URI, so that the report stays one file."""
    if not name:
        return ""
    path, subject = folder / name, f'[project] logo = "{name}"'
    if path.suffix.lower() not in LOGOS:
        raise InputError(f"{subject}: this is no picture that a page can hold; give a PNG, JPEG or SVG file.")
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = f"the file cannot be read ({error.strerror or error})"
        raise InputError(f"{subject}: {reason}; it is looked for beside the project's file.") from None
    if len(data) > MOST_LOGO:
        raise InputError(f"{subject}: {len(data):,} bytes are too many; give {MOST_LOGO:,} bytes or less.")
    return f"data:{LOGOS[path.suffix.lower()]};base64,{base64.b64encode(data).decode('ascii')}"
