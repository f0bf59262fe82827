"""The folder of --out, its tables and texts.

Everything is made ready beside the folder and then put in place, or nothing is.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.stopping import at_stop
from softstart.store import fresh_folder


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
    free = (stem, *(f"{stem}-{number}" for number in range(2, len(taken) + 2)))
    return next(one for one in free if one not in taken)


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
                s.replace("save_to = ", "--out: ", 1).replace("choose another file", "choose another folder")
                if s.startswith("save_to = ")
                else s
                for s in error.sentences
            ]
        ) from error


def markdown(text: str) -> str:
    """Text that Markdown leaves as it is, within a table too."""
    flat = " ".join(text.split())
    return flat.replace("\\", "\\\\").replace("|", "\\|").replace("*", "\\*").replace("_", "\\_")
