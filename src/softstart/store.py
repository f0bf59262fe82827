"""What long computations keep on disk, so that an interrupted one goes on where it was.

A `Target` is the file or folder that a caller named. It holds a manifest, the inputs that the results follow
from, and each finished part. The same call on it goes on; a target of other inputs, or of anything else, is
refused and never touched. One process writes at a time. `Records` keeps parts as JSON lines (tuning, limit
curves); sweeps keep theirs as chunks of a Zarr folder (sweeping/store.py) with the same lock, seals and
sentences. What is kept is `sealed`: a part that is not as it was written is computed again, and a
DamagedWarning says so.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import socket
import stat
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from softstart.errors import DamagedWarning, InputError, listed
from softstart.input.files import write_whole
from softstart.processes import undone

Record = dict[str, Any]


def fingerprint(inputs: Mapping[str, Any]) -> str:
    """A fingerprint of all inputs.

    >>> fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
    True
    >>> fingerprint({"a": 1}) == fingerprint({"a": 2})
    False
    """
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def sealed(record: Mapping[str, Any], key: str = "") -> str:
    """A line of JSON that begins with a checksum of what follows and of `key`: what it belongs to.

    >>> line = sealed({"cost": 1.5}, "cell 3")
    >>> unsealed(line, "cell 3"), unsealed(line, "cell 4"), unsealed(line.replace("5", "4"), "cell 3")
    ({'cost': 1.5}, None, None)
    """
    rest = json.dumps(record, allow_nan=False)[1:]
    return f"{_seal(rest, key)}{'' if rest == '}' else ', '}{rest}\n"


def unsealed(line: str, key: str = "") -> Record | None:
    """The record of such a line; None if anything in it was changed, or if it belongs to something else."""
    line, size = line.rstrip("\r\n"), len(_seal("", ""))
    for comma in (", ", ""):
        rest = line[size + len(comma) :]
        if line == f"{_seal(rest, key)}{comma}{rest}":
            found: Record = json.loads("{" + rest)
            return found
    return None


def _seal(rest: str, key: str) -> str:
    return f'{{"sha256": "{hashlib.sha256(f"{key} {rest}".encode()).hexdigest()}"'


NAMED = 3  # damaged parts that are named


def warn_of_damage(path: Path, parts: Sequence[str]) -> None:
    """Say which parts of a target are not as they were written; the caller makes them again."""
    if parts:
        shown = [*parts[:NAMED], f"{len(parts) - NAMED} more"] if len(parts) > NAMED + 1 else list(parts)
        verb = "are" if len(parts) > 1 else "is"
        warnings.warn(
            f"{path}: {listed(shown)} {verb} damaged (wrong checksum) and made again; all else is kept.",
            DamagedWarning,
            stacklevel=2,
        )


class Target(NamedTuple):
    """Where results are kept: the option that named it, its path, and what it holds ("sweep")."""

    option: str
    path: Path
    content: str
    kind: str = "file"  # or "folder"

    @property
    def other(self) -> str:
        """What the user may do instead."""
        return "give another folder" if self.kind == "folder" else "name another file"

    def foreign(self) -> InputError:
        """The error for a target that holds something else."""
        return self._error(f"this {self.kind} holds something else than a {self.content}; {self.other}.")

    def older(self) -> InputError:
        """The error for a target whose manifest is not there, or is damaged beyond use."""
        return self._error(
            f"its list of inputs has no checksum or a wrong one: this {self.kind} was damaged, or written by "
            f"an older softstart; {self.other}, or delete this one to begin anew."
        )

    def unwritable(self, error: OSError) -> InputError:
        """The error for a target that cannot be written."""
        place = "a folder" if self.kind == "folder" else "a file in a folder"
        return self._error(
            f"nothing can be written there ({error.strerror or error}); give {place} that you may write to."
        )

    def check_same(self, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
        """Raise InputError that names the inputs which differ from those that the target was begun with."""
        other = [name for name in {**before, **now} if before.get(name) != now.get(name)]
        if other:
            raise self._error(
                f"it holds a {self.content} with another {listed(other)}; {self.other}, or delete this one "
                "to begin anew."
            )

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the lock of the target, the file `.NAME.lock` beside it; InputError if another process has it.

        The lock is on the open file, not its name: the system drops it when its owner dies, and a file that a
        dead process left behind locks nobody out.
        """
        home = self.path.parent
        path = home / f".{self.path.name}.lock"
        try:
            made = [folder for folder in (home, *home.parents) if not folder.exists()]
            home.mkdir(parents=True, exist_ok=True)
            handle = _open_locked(path)
        except OSError as error:
            raise self.unwritable(error) from None
        if handle is None:
            owner = path.read_text("ascii", errors="replace").strip() if sys.platform != "win32" else ""
            raise self._error(
                f"{f'process {owner}' if owner else 'another process'} is writing this {self.content} now; "
                f"wait for it or end it, or {self.other}."
            )
        with undone(partial(_unlock, handle, path, made)):
            os.truncate(handle, 0)
            os.pwrite(handle, f"{os.getpid()} on {socket.gethostname()}\n".encode(), 0)
            for left in home.glob(f".{self.path.name}.*.part"):  # by an owner that was killed
                with suppress(OSError):
                    left.unlink()
            yield

    @contextmanager
    def fresh_folder(self) -> Iterator[Path]:
        """A hidden folder beside the target to fill and to rename, see the function of this name."""
        try:
            with fresh_folder(self.path.parent) as fresh:
                yield fresh
        except OSError as error:
            raise self.unwritable(error) from None

    def _error(self, sentence: str) -> InputError:
        return InputError(f"{self.option} = {self.path}: {sentence}")


class Records:
    """Finished parts in a file of JSON lines: first the manifest, then one part a line. Use it in a `with`.

    The fields `keys` identify a part. Parts are appended; a line that was cut off or damaged costs that part
    only. Without a target nothing is kept on disk.

    >>> with Records(None, {"drive": "crane"}, ["cell", "restart"]) as kept:
    ...     kept.add({"cell": 3, "restart": 0, "cost": 1.1})
    ...     kept.find(3, 0), kept.find(3, 1)
    ({'cell': 3, 'restart': 0, 'cost': 1.1}, None)
    """

    def __init__(self, target: Target | None, inputs: Mapping[str, Any], keys: list[str]) -> None:
        self.target, self.keys = target, keys
        self._manifest: Record = {"inputs": dict(inputs), "key": fingerprint(inputs)}
        self._records: dict[str, Record] = {}
        self._lock = ExitStack()
        self._written = False

    def __enter__(self) -> Self:
        if self.target is not None:
            path = self.target.path
            if _exists(path):
                self._read()  # before the lock, which would be left beside a file of something else
            with self._lock as stack:
                stack.enter_context(self.target.locked())
                if _exists(path):
                    warn_of_damage(path, self._read())
                    self._write()  # without a line that was cut off
                self._lock = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.close()

    def find(self, *part: Any) -> Record | None:
        """The record of a part, or None if it is not finished."""
        return self._records.get(json.dumps(part))

    def add(self, record: Record) -> None:
        """Keep a part, on disk too."""
        self._records[self._part_of(record)] = dict(record)
        if self.target is None:
            return
        if not self._written:
            self._write()
            return
        try:
            with self.target.path.open("a", encoding="utf-8") as stream:
                stream.write(sealed(record, self._manifest["key"]))
        except OSError as error:
            raise self.target.unwritable(error) from None

    def _part_of(self, record: Record) -> str:
        return json.dumps([record[name] for name in self.keys])

    def _write(self) -> None:
        assert self.target is not None
        key = self._manifest["key"]
        lines = (sealed(record, key) for record in self._records.values())
        text = "".join([sealed(self._manifest, "manifest"), *lines])
        write_whole(self.target.path, lambda stream: stream.write(text))
        self._written = True

    def _read(self) -> list[str]:
        """Take in the parts of a file that was begun with the same inputs; what in it is damaged."""
        assert self.target is not None
        try:
            if not stat.S_ISREG(self.target.path.stat().st_mode):
                raise self.target.foreign()
            content = self.target.path.read_bytes()
        except OSError as error:
            raise self.target.unwritable(error) from None
        *lines, torn = content.decode("ascii", errors="replace").split("\n")
        if not content:
            return []
        key = self._manifest["key"]
        manifest = unsealed(lines[0], "manifest") if lines else None
        found = [unsealed(line, key) for line in lines[1:]]
        if manifest is not None:
            if manifest["key"] != key:
                self.target.check_same(manifest["inputs"], self._manifest["inputs"])
                raise self.target.foreign()
        elif not any(found):  # nothing says that it belongs to these inputs
            raise self.target.older() if '"inputs": ' in (lines or [torn])[0] else self.target.foreign()
        self._records = {self._part_of(record): record for record in found if record is not None}
        damaged = [] if manifest is not None else ["line 1, the list of inputs,"]
        return damaged + [f"line {n}" for n, record in enumerate(found, start=2) if record is None]


@contextmanager
def fresh_folder(home: Path, *also: Path) -> Iterator[Path]:
    """A hidden folder in `home`, gone at the end of the block; what is to stay is renamed.

    Its owner holds a lock on it. Folders in `home`, and in the folders `also`, that nobody holds were left by
    processes that were killed, and are removed. Raises OSError.
    """
    for place in (home, *also):
        _sweep(place)
    path, handle = _locked_folder(home)
    with undone(partial(_remove, path, handle)):
        yield path


PREFIX, SUFFIX = ".softstart-", ".part"


def _locked_folder(home: Path) -> tuple[Path, int | None]:
    while True:
        path = Path(tempfile.mkdtemp(prefix=PREFIX, suffix=SUFFIX, dir=home))
        if sys.platform == "win32":
            return path, None
        try:
            handle = os.open(path, os.O_RDONLY)
        except FileNotFoundError:  # swept away by another process before it was locked
            continue
        with suppress(OSError):  # a file system without locks on folders: nobody can remove it either
            if not _lock(handle) or not path.exists():
                os.close(handle)
                shutil.rmtree(path, ignore_errors=True)
                continue
        return path, handle


def _remove(path: Path, handle: int | None) -> None:
    shutil.rmtree(path, ignore_errors=True)
    if handle is not None:
        os.close(handle)


def _sweep(home: Path) -> None:
    """Remove the folders that processes left which were killed."""
    if sys.platform == "win32":
        return
    with suppress(OSError):
        for path in home.glob(f"{PREFIX}*{SUFFIX}"):
            with suppress(OSError):
                handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
                try:
                    if _lock(handle):  # an owner that has not yet locked its own makes another one
                        shutil.rmtree(path, ignore_errors=True)
                finally:
                    os.close(handle)


def _exists(path: Path) -> bool:
    with suppress(OSError):
        return path.exists() or path.is_symlink()
    return True  # but not to be read, which the reader says


def _unlock(handle: int, path: Path, made: Sequence[Path]) -> None:
    if sys.platform != "win32":  # there, a file that is open cannot be removed
        path.unlink(missing_ok=True)
    os.close(handle)
    with suppress(OSError):  # folders in which nothing was kept
        for folder in made:
            folder.rmdir()


NO_LINK = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # and no pipe that is waited for


def _open_locked(path: Path) -> int | None:
    """The locked file, or None if it is locked by another process."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | NO_LINK, 0o666)
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise OSError(errno.EEXIST, f"{path.name} is no file")
            if not _lock(handle):
                os.close(handle)
                return None
            if path.exists() and os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        except FileNotFoundError:
            pass
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # its last owner removed it in between: this one is nobody's lock any more


if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> bool:
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _lock(handle: int) -> bool:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
