"""What a report says about itself, from a TOML file: customer, project, revisions, sources of the data."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from softstart.drive import PARAMETERS
from softstart.errors import InputError, Mistakes
from softstart.hints import nearest
from softstart.input.documents import DocumentTable, read_document
from softstart.input.files import file_text
from softstart.input.parameters import REQUIRED, Parameter

LOGOS = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".svg": "image/svg+xml"}
MOST_LOGO = 500_000  # bytes: a report is sent by mail


def _line(key: str, meaning: str, example: str, default: object = "", choices: str = "") -> Parameter:
    found = tuple(choices.split(", ")) if choices else ()
    return Parameter(key, "", meaning, f'"{example}"', "one line", default, found)


TABLES = (
    DocumentTable("project", required=False, parameters=(
        _line("customer", "who the report is for", "Harbour Cranes Ltd"),
        _line("project", "name of the project", "Gantry crane 3"),
        _line("number", "number of the document", "SC-0147"),
        _line("author", "who made it", "A. Engineer"),
        _line("company", "the author's company", "Drives & Co"),
        _line("checked", "who checked it, and when", "B. Checker, 2026-11-20"),
        _line("approved", "who approved it, and when", "C. Chief, 2026-11-21"),
        _line("logo", "picture for the head of page 1", "logo.png"),
        _line("paper", "paper size", "A4", "A4", "A4, letter"),
        _line("decimal", "decimal sign", "point", "point", "point, comma"),
    )),
    DocumentTable("revision", many=True, parameters=(
        _line("number", "number of the revision", "A"),
        _line("date", "its date, in quotes", "2026-11-20"),
        _line("author", "who made it", "A. Engineer"),
        _line("change", "what has changed", "first issue"),
    )),
    DocumentTable("source", many=True, parameters=(
        _line("parameter", "the parameter of the drive file", "shaft.gap", REQUIRED),
        _line("origin", "what its value is from", "identified",
              choices="data sheet, drawing, measured, identified, guessed"),
        _line("note", "interval, sheet or drawing", "0.48 to 0.52 rad (95 %)"),
    )),
)  # fmt: skip


@dataclass(frozen=True)
class Project:
    """Names, revisions and sources of a report, rows as in the file; `logo` is a data URI. All may be empty.

    >>> Project.read('[project]\\ncustomer = "Harbour Cranes Ltd"').customer
    'Harbour Cranes Ltd'
    >>> Project.read('[[source]]\\nparameter = "shaft.gapp"')
    Traceback (most recent call last):
    softstart.errors.InputError: [source] 1, parameter = "shaft.gapp": a drive has no such parameter; did ...
    """

    customer: str = ""
    project: str = ""
    number: str = ""
    author: str = ""
    company: str = ""
    checked: str = ""
    approved: str = ""
    logo: str = ""
    paper: str = "A4"
    decimal: str = "point"
    revisions: Sequence[Mapping[str, str]] = ()
    sources: Sequence[Mapping[str, str]] = ()

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """From a TOML file; the logo is looked for beside it."""
        return cls.read(file_text(path, "a project"), str(path), Path(path).parent)

    @classmethod
    def read(cls, text: str, where: str = "", folder: Path = Path()) -> Self:
        """From a TOML text; all mistakes at once."""
        found = read_document(text, TABLES, "a project", where=where)
        made = cls(**(found["project"] or {}), revisions=found["revision"], sources=found["source"])
        paths, wrong = [one.path for one in PARAMETERS.values()], Mistakes()
        for number, source in enumerate(made.sources, start=1):
            if (path := source["parameter"]) not in paths:
                near = nearest(path, paths)
                hint = f"did you mean {near}?" if near else "write it as --set does, as shaft.gap."
                place = f'[source] {number}, parameter = "{path}"'
                wrong.sentences.append(f"{place}: a drive has no such parameter; {hint}")
        with wrong.collect():
            made = replace(made, logo=_picture(made.logo, folder))
        wrong.raise_if_any(f"{where}: " if where else "")
        return made

    def source_of(self, path: str) -> str:
        """What the value of a parameter is from, "" if nothing is said."""
        found = next((one for one in self.sources if one["parameter"] == path), {})
        return ", ".join(filter(None, (found.get("origin"), found.get("note"))))

    @property
    def lines(self) -> list[tuple[str, str]]:
        """Names for the head of page 1: what, and who or which."""
        last = self.revisions[-1] if self.revisions else {}
        named = {
            "Customer": self.customer,
            "Project": self.project,
            "Document": self.number,
            "Author": ", ".join(filter(None, (self.author, self.company))),
            "Revision": " of ".join(filter(None, (last.get("number"), last.get("date")))),
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
