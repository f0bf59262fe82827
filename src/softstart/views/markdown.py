"""The files of --out: the folder, tables, texts and what every report.md holds.

Everything is made ready beside the folder and then put in place, or nothing is.
"""

from __future__ import annotations

import csv
import math
import os
import platform
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

from softstart import __version__
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.stopping import at_stop
from softstart.store import fresh_folder
from softstart.views.drives import controllers_set_up
from softstart.views.numbers import Column, Table

FITTED_TO = "fitted-to.toml"


@contextmanager
def output_folder(asked: str | None) -> Iterator[Path | None]:
    """A folder to write into, whose files are in DIR when the block ends well, and nowhere otherwise.

    None if nothing was asked for. A DIR that does not exist yet appears whole by one rename; into one that is
    there each file is renamed, so that none is ever half-written and other files stay. That DIR cannot be
    written is found before the block begins. Raises InputError.
    """
    if asked is None:
        yield None
        return
    target = Path(asked)
    with ExitStack() as stack:
        try:
            stage = stack.enter_context(fresh_folder(_home(asked, target), target, *target.parents))
        except OSError as error:
            raise _refused(asked, f"nothing can be written there ({error.strerror or error})") from None
        yield stage
        _put_in_place(asked, stage, target)


def write_table(path: Path, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table as CSV; numbers with all their digits, None as an empty cell."""

    def write(stream: IO[Any]) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)

    write_whole(path, write)


def write_rows(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Rows with the same keys as CSV; no file where there are none."""
    if rows:
        write_table(path, list(rows[0]), [list(row.values()) for row in rows])


def write_columns(path: Path, columns: Mapping[str, Sequence[object]]) -> None:
    """Columns by their headings as CSV; NaN as an empty cell."""
    rows = zip(*columns.values(), strict=True)
    write_table(path, list(columns), [[None if _is_nan(cell) else cell for cell in row] for row in rows])


def _is_nan(cell: object) -> bool:
    return isinstance(cell, float) and math.isnan(cell)


def write_text(path: Path, text: str) -> None:
    """A text file."""
    write_whole(path, lambda stream: stream.write(text))


def file_stem(name: str, taken: Sequence[str] = ()) -> str:
    """A name that can be part of a file name, and is not taken.

    >>> file_stem("my/own: start"), file_stem("ramp", ["ramp"])
    ('my-own-start', 'ramp-2')
    """
    stem = (
        "-".join("".join(c if c.isalnum() or c in "._-" else " " for c in name).split()).strip(".") or "start"
    )
    number, free = 1, stem
    while free in taken:
        number += 1
        free = f"{stem}-{number}"
    return free


def _refused(asked: str, reason: str) -> InputError:
    return InputError(f'--out = "{asked}": {reason}; give a folder that you may write to.')


def _home(asked: str, target: Path) -> Path:
    """DIR if it is there, else the nearest folder above it."""
    if not asked.strip():
        raise _refused(asked, "the name of the folder is empty")
    if "\0" in asked:
        raise _refused(asked.replace("\0", "\\0"), "this cannot be the path of a folder")
    home = target
    while not home.exists() and home != home.parent:
        if home.is_symlink():
            raise _refused(asked, f"{home} is a link that leads nowhere")
        home = home.parent
    if not home.is_dir():
        raise _refused(asked, f"{home} is a file, not a folder")
    return home


def _put_in_place(asked: str, stage: Path, target: Path) -> None:
    try:
        if not target.exists():
            _make_parents_and_rename(stage, target)
            return
        files = sorted(path for path in stage.rglob("*") if path.is_file())
        for path in files:
            place = target / path.relative_to(stage)
            if place.is_dir():
                raise _refused(asked, f"{place.name} in it is a folder, where a file is to go")
        for path in files:
            place = target / path.relative_to(stage)
            place.parent.mkdir(parents=True, exist_ok=True)
            path.replace(place)
    except OSError as error:
        raise _refused(asked, f"the files could not be put there ({error.strerror or error})") from None


def _make_parents_and_rename(stage: Path, target: Path) -> None:
    umask = os.umask(0)
    os.umask(umask)
    stage.chmod(0o777 & ~umask)
    made: list[Path] = []
    try:
        for parent in reversed(target.parents):
            if not parent.exists():
                parent.mkdir()
                made.append(parent)
        stage.rename(target)
    except BaseException:
        for parent in reversed(made):
            parent.rmdir()
        raise


@contextmanager
def kept_state(out: str | None, name: str, what: str) -> Iterator[Path | None]:
    """The file `name` in DIR itself that keeps `what`; after an interruption it stays, and a message says so.

    Errors about it name --out.
    """
    state = None if out is None else Path(out) / name
    sentence = f"softstart: {what} are kept in {state}; run the same command to continue."
    try:
        with at_stop(lambda: state and state.exists() and print(sentence, file=sys.stderr)):
            yield state
    except InputError as error:
        raise InputError(
            [
                s.replace("save_to = ", "--out: ", 1).replace("name another file", "give another folder")
                if s.startswith("save_to = ")
                else s
                for s in error.sentences
            ]
        ) from error


def markdown(text: str) -> str:
    """Text that Markdown leaves as it is, within a table too."""
    flat = " ".join(text.split())
    return flat.replace("\\", "\\\\").replace("|", "\\|").replace("*", "\\*").replace("_", "\\_")


def markdown_table(table: Table) -> str:
    """A table without its title; numbers are set to the right."""
    headings = [column.heading for column in table.columns]
    rule = ["---:" if column.number else "---" for column in table.columns]
    return "\n".join(f"| {' | '.join(map(markdown, cells))} |" for cells in (headings, rule, *table.rows))


def table_sections(tables: Sequence[Table]) -> list[str]:
    """Titles and tables in Markdown, without empty tables."""
    return [part for one in tables if one.rows for part in (f"## {markdown(one.title)}", markdown_table(one))]


def figure_table(rows: Sequence[Sequence[str]]) -> str:
    """Figures in Markdown, each a name and its value."""
    return markdown_table(Table("", [Column("figure", False), Column("value")], rows))


def drive_table(machine: Any) -> str:
    """All parameters of a machine that are set."""
    rows = []
    for path, (parameter, value) in machine.by_path().items():
        if value is not None and value != "" and path != "name":
            values = value if isinstance(value, tuple) else (value,)
            shown = ", ".join(f"{one:.10g}" if isinstance(one, float) else str(one) for one in values)
            unit = "" if parameter.unit == "1" or isinstance(value, str) else parameter.unit
            rows.append([path, parameter.symbol, shown, unit, parameter.meaning])
    return markdown_table(Table.of_texts(("key", "symbol", "value", "unit", "meaning"), rows))


def write_report(folder: Path, parts: Sequence[str], command: str, about: str) -> None:
    """report.md; its last section says what was run, by which version, and what `about` adds on the input."""
    ending = (
        "## Where this comes from\n\n"
        f"softstart {__version__}, Python {platform.python_version()}, with the command\n\n"
        f"```sh\n{command}\n```\n\n{about}"
    )
    write_text(folder / "report.md", "\n\n".join([*parts, ending]) + "\n")


def write_drive_report(
    folder: Path,
    parts: Sequence[str],
    drive: Any,
    command: str,
    fitted_to: Any = None,
    *,
    behind: Sequence[str] = (),
    one: bool = True,
) -> None:
    """report.md about a machine, whose data stand between `parts` and `behind`, and the machine's files.

    `fitted_to` is the drive for which the controllers are set up, if another; `one`: no parameter is varied.
    """
    what = drive.WHAT.removeprefix("a ")
    write_text(folder / f"{what}.toml", drive.to_toml())
    about = (
        f"on the {what} of [{what}.toml]({what}.toml), which holds all changes:\n\n"
        f"```toml\n{drive.to_toml()}```"
    )
    if fitted_to is not None:
        write_text(folder / FITTED_TO, fitted_to.to_toml())
        set_up = controllers_set_up(drive if one else None, fitted_to)
        about += (
            f"\n\nThe {markdown(set_up)}. That drive is in "
            f"[{FITTED_TO}]({FITTED_TO}):\n\n```toml\n{fitted_to.to_toml()}```"
        )
    write_report(folder, [*parts, f"## The {what}", drive_table(drive), *behind], command, about)
