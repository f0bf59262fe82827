"""What long computations keep on disk, so that an interrupted one continues where it was.

A `Target` is the file or folder that a caller named, with the sentences about it. `PartStore` keeps in an
SQLite file the inputs that the results follow from and each finished part, with checksums. The same call on
it continues; a target of other inputs, or of anything else, is refused and never touched; a part that is not
as it was written is computed again, and a DamagedWarning says so. The file is locked as long as a process
writes it. Sweeps keep their figures as chunks of a Zarr folder (sweeping/store.py), and such a list in it.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
import socket
import sqlite3
import stat
import sys
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, Self

from softstart.errors import DamagedWarning, InputError, listed
from softstart.stopping import STOPPING, at_stop

PartRecord = dict[str, Any]
SMALLEST = 512  # bytes of an SQLite file
# the first two remove what a killed process left; a power failure may cost the file, but no number is wrong
MODES = "journal_mode = PERSIST", "journal_mode = DELETE", "locking_mode = EXCLUSIVE", "synchronous = OFF"
NAMED = 3  # damaged parts that are named
REMOVING = threading.RLock()


class Target(NamedTuple):
    """Where results are kept: the option that named it, its path, and what it holds ("sweep").

    Of a folder `inside` is the path of the SQLite file in it.
    """

    option: str
    path: Path
    content: str
    inside: str = ""

    @property
    def kind(self) -> str:
        """Folder or file."""
        return "folder" if self.inside else "file"

    @property
    def other(self) -> str:
        """What the user may do instead."""
        return f"choose another {self.kind}"

    def error(self, sentence: str) -> InputError:
        """The error for this target."""
        return InputError(f"{self.option} = {self.path}: {sentence}")

    def foreign(self) -> InputError:
        """The error for a target that holds something else."""
        return self.error(f"not a {self.content} {self.kind}; {self.other}.")

    def damaged(self) -> InputError:
        """The error for a target that is damaged beyond use."""
        what = "its list of finished parts" if self.inside else "the file"
        return self.error(f"{what} is damaged; {self.other}, or delete this one to start again.")

    def unwritable(self, error: Exception) -> InputError:
        """The error for a target that cannot be written."""
        reason = getattr(error, "strerror", None) or error
        return self.error(f"cannot be written ({reason}); {self.other}.")

    def check_same(self, before: Mapping[str, object], now: Mapping[str, object]) -> None:
        """Raise InputError that names the inputs which differ from those that the target was begun with."""
        other = [name for name in {**before, **now} if before.get(name) != now.get(name)]
        if other:
            raise self.error(
                f"contains a {self.content} with another {listed(other)}; {self.other}, or delete this "
                "one to start again."
            )

    def warn_of_damage(self, parts: Sequence[str]) -> None:
        """Report the parts that are not as they were written; the caller computes them again."""
        if parts:
            shown = [*parts[:NAMED], f"{len(parts) - NAMED} more"] if len(parts) > NAMED + 1 else parts
            verb = "are" if len(parts) > 1 else "is"
            warnings.warn(
                f"{self.path}: {listed(shown)} {verb} damaged (checksum mismatch) and will be recomputed; "
                "the rest is kept.",
                DamagedWarning,
                stacklevel=2,
            )

    @contextmanager
    def errors(self) -> Iterator[None]:
        """What SQLite and the system say in the block, as an InputError."""
        try:
            yield
        except OSError as error:
            raise self.unwritable(error) from None
        except UnicodeDecodeError:  # a message with damaged names
            raise self.damaged() from None
        except sqlite3.Error as error:
            match error.sqlite_errorname.split("_")[1]:
                case "NOTADB":
                    raise self.foreign() from None
                case "BUSY":
                    raise self.error(
                        f"another process is writing this {self.content}; wait for it, or {self.other}."
                    ) from None
                case "FULL" | "IOERR" | "READONLY" | "CANTOPEN" | "PERM":
                    raise self.unwritable(error) from None
            raise self.damaged() from None


class PartStore:
    """Finished parts in an SQLite file. Use it in a `with`; without a target nothing is kept on disk.

    The fields `keys` identify a part. A file in which nothing was kept is removed at the end, unless other
    files belong to it (`stay`).

    >>> with PartStore(None, {"drive": "crane"}, ["cell", "restart"]) as kept:
    ...     kept.add({"cell": 3, "restart": 0, "cost": 1.1})
    ...     kept.find(3, 0), kept.find(3, 1)
    ({'cell': 3, 'restart': 0, 'cost': 1.1}, None)
    """

    def __init__(self, target: Target | None, inputs: Mapping[str, object], keys: list[str]) -> None:
        self.target, self.keys = target, keys
        self._inputs = json.dumps(inputs, sort_keys=True)
        self._parts: dict[str, PartRecord] = {}
        self.damaged: list[str] = []  # parts that were not as they had been written
        self._base: sqlite3.Connection | None = None
        self._using = threading.Lock()  # SQLite is not closed by a signal's thread while another writes
        self._open, self._stays = ExitStack(), False

    def __enter__(self) -> Self:
        if self.target is not None:
            with ExitStack() as stack, self.target.errors():
                file = self.target.path / self.target.inside
                if file.is_symlink() or file.exists():
                    found = file.stat()
                    if not stat.S_ISREG(found.st_mode) or 0 < found.st_size < SMALLEST:
                        raise self.target.foreign()
                    made = []
                else:
                    made = [file, *(folder for folder in file.parents if not folder.exists())]
                stack.callback(self._close, made)
                stack.enter_context(at_stop(lambda: self._close(made), lambda: self._begin(file)))
                if not self.target.inside:  # a folder reports its own files with them
                    self.target.warn_of_damage(self.damaged)
                self._open = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def _begin(self, file: Path) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        self._base = sqlite3.connect(file, 0.0, isolation_level=None, check_same_thread=False)
        self.damaged = self._read(self._base)

    def find(self, *part: object) -> PartRecord | None:
        """The record of a part, or None if it is not finished."""
        return self._parts.get(json.dumps(part))

    def stay(self, stays: bool) -> None:
        """Whether the file remains even if nothing is kept: it says to whom the files beside it belong."""
        self._stays = stays
        if STOPPING.is_set():  # `_close` may have read it already
            raise KeyboardInterrupt

    def parts(self) -> list[PartRecord]:
        """All records."""
        return list(self._parts.values())

    def add(self, record: PartRecord) -> None:
        """Keep a part, on disk too."""
        key = json.dumps([record[name] for name in self.keys])
        self._parts[key] = dict(record)
        if self.target is not None:
            with self.target.errors(), self._using:
                if STOPPING.is_set():  # it may be closed already
                    raise KeyboardInterrupt
                self._insert(key, json.dumps(record, allow_nan=False))

    def _insert(self, key: str, text: str) -> None:
        assert self._base is not None
        self._base.execute(
            "INSERT OR REPLACE INTO parts VALUES (?, ?, ?)", (key, text, self._seal(key, text))
        )

    def _seal(self, key: str, text: str) -> str:
        """A checksum of a row, which fits these inputs alone; that of the inputs themselves fits any."""
        return hashlib.sha256(f"{self._inputs if key else ''} {key} {text}".encode()).hexdigest()

    def _read(self, base: sqlite3.Connection) -> list[str]:
        """Take in the parts of a file that was begun with the same inputs; which of them are damaged."""
        assert self.target is not None
        base.text_factory = lambda text: text.decode(errors="replace")
        for mode in MODES:
            base.execute(f"PRAGMA {mode}")
        base.execute("BEGIN EXCLUSIVE")
        tables = base.execute("SELECT name FROM sqlite_master").fetchall()
        if not tables:
            base.execute("CREATE TABLE parts (key TEXT PRIMARY KEY, record TEXT, seal TEXT) WITHOUT ROWID")
            self._insert("", self._inputs)
        elif tables != [("parts",)]:
            raise self.target.foreign()
        elif base.execute("PRAGMA integrity_check").fetchone() != ("ok",):
            raise self.target.damaged()
        rows = base.execute("SELECT key, record, seal FROM parts").fetchall()
        good = {key: json.loads(text) for key, text, seal in rows if seal == self._seal(key, text)}
        if (before := good.pop("", None)) is None:
            raise self.target.damaged()
        self.target.check_same(before, json.loads(self._inputs))
        bad = [key for key, *_ in rows if key and key not in good]
        base.executemany("DELETE FROM parts WHERE key IS ?", [(key,) for key in bad])
        base.execute("COMMIT")
        self._parts = good
        return [f"part {key}" for key in bad]

    def _close(self, made: Sequence[Path]) -> None:
        with self._using:
            if self._base is not None:
                self._base.close()
        if made and not self._parts and not self._stays:
            if self._base is not None:
                made[0].unlink(missing_ok=True)
            for folder in made[1:]:
                with suppress(OSError):
                    folder.rmdir()


@contextmanager
def fresh_folder(home: Path, *also: Path) -> Iterator[Path]:
    """A hidden folder in `home`, gone at the end of the block; what is to stay is renamed.

    Its name has the number of its process: folders in `home` and in `also` whose process was killed are
    removed. Raises OSError.
    """
    prefix = f".softstart-{socket.gethostname()}-"
    for left in (path for place in (home, *also) for path in place.glob(f"{prefix}*.part")):
        if sys.platform != "win32" and not _runs(left.name.removeprefix(prefix).partition("-")[0]):
            shutil.rmtree(left, ignore_errors=True)
    path = home / f"{prefix}{os.getpid()}-{secrets.token_hex(4)}.part"
    with at_stop(lambda: _remove(path), path.mkdir):
        try:
            yield path
        finally:
            _remove(path)


def _runs(number: str) -> bool:
    try:
        os.kill(int(number), 0)
    except (ProcessLookupError, ValueError):
        return False
    except OSError:  # of another user
        pass
    return True


def _remove(path: Path) -> None:
    """Remove a folder into which another thread may still write; who comes second waits for the first."""
    with REMOVING:
        with suppress(OSError):  # it has been put in place
            path = path.rename(path.with_suffix(".gone.part"))
        shutil.rmtree(path, ignore_errors=True)
