"""What an export is: files in a folder, which appears whole or not at all."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from softstart.errors import InputError
from softstart.hints import did_you_mean
from softstart.results import OneLine
from softstart.store import fresh_folder

Language = Literal["c", "st", "fmu"]
Real = Literal["float64", "float32"]
LANGUAGES: dict[str, str] = {"c": "C99", "st": "Structured Text", "fmu": "FMU"}
PRECISIONS = ("float64", "float32")
MARK = "<!-- written by softstart export -->"
README = "README.md"
LONGEST_PREFIX = 32  # characters


@dataclass(frozen=True, eq=False, repr=False)
class Export(OneLine):
    """An export: text or bytes of each file by name, and what an engineer should know of it.

    Attributes
    ----------
    prefix : what the names in the code begin with.
    language, real : "c", "st" or "fmu"; the precision of its numbers.
    files : name in the folder to content.
    figures : numbers that were found when it was made, as K_dyn, by name.
    notes : a sentence each.
    folder : where the files are, "" if they were not written.
    """

    prefix: str
    language: str
    real: str
    files: Mapping[str, str | bytes]
    figures: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    folder: str = ""

    def summary(self) -> dict[str, Any]:
        """As plain data: the files with their sizes and SHA-256."""
        contents = {name: _bytes(content) for name, content in sorted(self.files.items())}
        return {
            "prefix": self.prefix,
            "language": self.language,
            "real": self.real,
            **self.figures,
            "notes": list(self.notes),
            "folder": self.folder,
            "files": {
                name: {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
                for name, content in contents.items()
            },
        }


def check_choice(value: str, known: tuple[str, ...], name: str) -> str:
    """One of the known words, else an InputError that names the nearest."""
    if value not in known:
        raise InputError(f'{name} = "{value}": there is no such choice; {did_you_mean(value, known)}')
    return value


def check_prefix(prefix: str, keywords: frozenset[str] = frozenset()) -> str:
    """A prefix that every language takes as the beginning of a name.

    >>> check_prefix("soft_start")
    'soft_start'
    """
    taken = prefix.lower() in {word.lower() for word in keywords}
    if taken:
        raise InputError(f'prefix = "{prefix}": this is a keyword; give another name, as start_{prefix}.')
    if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", prefix) or len(prefix) > LONGEST_PREFIX:
        raise InputError(
            f'prefix = "{prefix}": give a letter, then letters, digits and single underscores, '
            f"at most {LONGEST_PREFIX} characters, as soft_start."
        )
    return prefix


def prefix_of(name: str) -> str:
    """The prefix for a name of a strategy or drive.

    >>> prefix_of("take-up"), prefix_of("4 wheels")
    ('take_up', 'softstart_4_wheels')
    """
    words = re.findall(r"[A-Za-z0-9]+", name) or ["export"]
    prefix = "_".join(words)
    return (prefix if prefix[0].isalpha() else f"softstart_{prefix}")[:LONGEST_PREFIX].rstrip("_")


def check_folder(folder: str | Path) -> Path:
    """A folder that may be written: one that is not there, is empty, or was written by an export."""
    path = Path(folder)
    if not str(folder).strip() or "\0" in str(folder):
        raise InputError(f'folder = "{str(folder)!r}": this cannot be the path of a folder.')
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise InputError(f'folder = "{folder}": this is no folder; give the name of a new one.')
    if path.is_dir() and any(path.iterdir()):
        readme = path / README
        ours = readme.is_file() and MARK in readme.read_text(encoding="utf-8", errors="replace")
        if not ours:
            raise InputError(
                f'folder = "{folder}": it holds files that softstart export has not written; '
                "give a new or empty folder."
            )
    return path


def write_files(folder: str | Path, files: Mapping[str, str | bytes]) -> None:
    """All files into the folder, which is replaced whole by a rename; InputError if that cannot be done."""
    target = check_folder(folder)
    try:
        target.absolute().parent.mkdir(parents=True, exist_ok=True)
        with fresh_folder(target.absolute().parent) as fresh:
            made = fresh / "new"
            made.mkdir()
            for name, content in files.items():
                place = made / name
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(_bytes(content))
            if target.exists():
                target.rename(fresh / "old")
            made.rename(target)
    except OSError as error:
        raise InputError(
            f'folder = "{folder}": it cannot be written ({error.strerror or error}); '
            "give a folder that you may write to."
        ) from None


def _bytes(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else content
