"""Files: shipped ones found by name, text read with a clear refusal, results written whole or not at all."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Callable
from functools import cached_property, partial
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import IO, Any, TypeVar, cast

from softstart.errors import InputError
from softstart.hints import nearest
from softstart.quantities import RefusedError, show
from softstart.stopping import at_stop


class Library:
    """The TOML files in a folder of a package; `what` and `plural` as "a clutch", "clutches".

    >>> drives = Library("softstart.drive", "a drive", "drives")
    >>> drives.names()[1], drives.find("crane-4amtkf")[1]
    ('crane-4amtkf', 'crane-4amtkf')
    >>> print(drives.text("crane-4amtkf").splitlines()[0])
    # The crane drive of [G] with J2 = 5 J1 and a gap of 0.5 rad.
    """

    def __init__(self, package: str, what: str, plural: str, folder: str = "library") -> None:
        self.package, self.what, self.plural, self.folder = package, what, plural, folder

    def names(self) -> tuple[str, ...]:
        """The names of the shipped files, in order."""
        return self._names

    @cached_property
    def _folder(self) -> Traversable:
        return resources.files(self.package).joinpath(self.folder)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        names = (entry.name for entry in self._folder.iterdir())
        return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))

    def text(self, name: str) -> str:
        """The text of a shipped file, whose name must be one of `names()`."""
        return self._folder.joinpath(f"{name}.toml").read_text(encoding="utf-8")

    def find(self, given: str | os.PathLike[str]) -> tuple[str, str]:
        """The TOML text, and what to call it in sentences: a shipped file by its name, else one by its path.

        A string that is a shipped name means that file; `./name` means a file of the user's own. Raises
        InputError in one sentence, with the name that was probably meant.
        """
        if not isinstance(given, str | os.PathLike):
            reason = f"{self.what} is named by text, a shipped name or the path of a TOML file"
            raise InputError(f"{show(given)}: {reason}.")
        if isinstance(given, str) and given in self._names:
            return self.text(given), given
        path, noun, listed = os.fspath(given), self.what.split()[-1], ", ".join(self._names)
        if not path:
            raise InputError(f'"": the name of the {noun} is empty; give a path, or one of {listed}.')
        try:
            return read_text(path), path
        except RefusedError as refusal:
            reason, shipped = f"{refusal.reason}.", f"shipped {self.plural} are {listed}."
            if refusal.reason == FOLDER:
                reason = f"{FOLDER}; give the TOML file of {self.what} in it."
            elif refusal.reason == ABSENT and not Path(path).parent.is_dir():
                reason = f"there is no directory {show(str(Path(path).parent))}; {shipped}"
            elif refusal.reason == ABSENT:
                beside = [str(one) for one in Path(path).parent.glob("*.toml")]
                meant = nearest(Path(path).stem, self._names) or nearest(path, beside)
                remedy = f"did you mean {meant}?" if meant else shipped
                reason = f"{ABSENT}, and no shipped {noun} of this name; {remedy}"
            raise InputError(f"{show(path)}: {reason}") from None


Thing = TypeVar("Thing")


def object_of(
    given: object,
    kinds: type[Any] | tuple[type[Any], ...],
    load: Callable[[str | os.PathLike[str]], Thing],
    wanted: str,
) -> Thing:
    """An object itself, or the one that `load` reads from a file or by its name; anything else is refused.

    >>> object_of(2, str, str, "clutch: give one Clutch")
    Traceback (most recent call last):
    softstart.errors.InputError: clutch: give one Clutch, the path of its file, or the name of a shipped one.
    """
    if isinstance(given, kinds):
        return cast("Thing", given)
    if isinstance(given, str | os.PathLike):
        return load(given)
    raise InputError(f"{wanted}, the path of its file, or the name of a shipped one.")


ABSENT, FOLDER = "there is no such file", "this is a directory"
MOST_BYTES = 4_000_000  # 100,000 knots of a profile


def refusal_of(path: str | os.PathLike[str]) -> str | None:
    """Why a path is not that of an ordinary file of a reasonable size; None if it is.

    >>> refusal_of("nowhere.toml")
    'there is no such file'
    """
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return ABSENT
    except OSError as error:
        return f"the file cannot be read ({error.strerror or error})"
    except ValueError as error:  # a NUL in the path
        return f"this cannot be the path of a file ({error})"
    if stat.S_ISDIR(status.st_mode):
        return FOLDER
    if not stat.S_ISREG(status.st_mode):
        return "this is no ordinary file but a pipe, a socket or a device; give a file"
    if status.st_size > MOST_BYTES:
        size = f"the file has {status.st_size / 1e6:.3g} MB, and at most {MOST_BYTES / 1e6:g} MB are read"
        return f"{size}; give one with fewer lines"
    return None


def read_text(path: str | os.PathLike[str], also: str | None = None) -> str:
    """The text of a UTF-8 file; raises RefusedError with the reason, for callers that word the sentence.

    A file that begins with the mark of UTF-16 is that, as spreadsheets write it; `also`: a second encoding.
    """
    reason = refusal_of(path)
    if reason is not None:
        raise RefusedError(reason)
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise RefusedError(f"the file cannot be read ({error.strerror or error})") from None
    try:
        return content.decode("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError as error:
        if also is not None and b"\0" not in content:
            return content.decode(also, errors="replace")
        line = content.count(b"\n", 0, error.start) + 1
        raise RefusedError(f"the file is not UTF-8 text (line {line}); save it as UTF-8") from None


def file_text(path: str | os.PathLike[str], what: str, form: str = "TOML") -> str:
    """The text of a file, or an InputError in one sentence that names it; `form` is that of the file.

    >>> file_text("nowhere.csv", "a table of the law", "CSV")
    Traceback (most recent call last):
    softstart.errors.InputError: "nowhere.csv": there is no such file; give the path of a table ...
    """
    try:
        return read_text(path)
    except RefusedError as refusal:
        remedy = f"; give the path of {what} ({form})" if refusal.reason in (ABSENT, FOLDER) else ""
        raise InputError(f"{show(os.fspath(path))}: {refusal.reason}{remedy}.") from None


def write_whole(path: Path, write: Callable[[IO[Any]], object], binary: bool = False) -> None:
    """Write a file through a temporary neighbour and a rename, so that it is never half-written.

    Raises InputError if the file cannot be written there.
    """
    refused = f"output = {path}: the file cannot be written there"
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    # a new file with the rights that the system gives to one: asking for the umask would set it for a moment,
    # in all threads
    create = partial(temporary.open, "xb" if binary else "x", encoding=None if binary else "utf-8")
    remedy = "give a folder that exists and that you may write to"
    try:
        with at_stop(partial(temporary.unlink, missing_ok=True), create) as opened:
            remedy = "nothing was left behind"
            try:
                with opened as stream:
                    write(stream)
                temporary.replace(path)
            finally:
                temporary.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{refused}: {error.strerror or error}; {remedy}.") from None
