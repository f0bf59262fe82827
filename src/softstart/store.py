"""What long computations keep on disk, so that an interrupted one goes on where it was.

A `Target` is the file or folder that a caller named. It holds a manifest, the inputs that the results follow
from, and each finished part. The same call on it goes on; a target of other inputs, or of anything else, is
refused and never touched. One process writes at a time. `Records` keeps parts as JSON lines (tuning, limit
curves); sweeps keep theirs as chunks of a Zarr folder (sweeping/folder.py) with the same manifest, lock and
sentences.
"""

from __future__ import annotations

import hashlib
import json
import os
import socket
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from softstart.errors import InputError
from softstart.input.files import write_whole

Record = dict[str, Any]


def fingerprint(inputs: Mapping[str, Any]) -> str:
    """A fingerprint of all inputs.

    >>> fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
    True
    >>> fingerprint({"a": 1}) == fingerprint({"a": 2})
    False
    """
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


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
        made = [folder for folder in (home, *home.parents) if not folder.exists()]
        try:
            home.mkdir(parents=True, exist_ok=True)
            handle = _open_locked(path)
        except OSError as error:
            raise self.unwritable(error) from None
        if handle is None:
            owner = path.read_text("utf-8").strip() if sys.platform != "win32" else ""
            raise self._error(
                f"{f'process {owner}' if owner else 'another process'} is writing this {self.content} now; "
                f"wait for it or end it, or {self.other}."
            )
        try:
            os.truncate(handle, 0)
            os.pwrite(handle, f"{os.getpid()} on {socket.gethostname()}\n".encode(), 0)
            yield
        finally:
            if sys.platform != "win32":  # there, a file that is open cannot be removed
                path.unlink(missing_ok=True)
            os.close(handle)
            with suppress(OSError):  # folders in which nothing was kept
                for folder in made:
                    folder.rmdir()

    def _error(self, sentence: str) -> InputError:
        return InputError(f"{self.option} = {self.path}: {sentence}")


def listed(names: list[str]) -> str:
    """Names in a sentence.

    >>> listed(["drive", "seed", "gaps"])
    'drive, seed and gaps'
    """
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)


class Records:
    """Finished parts in a file of JSON lines: first the manifest, then one part a line. Use it in a `with`.

    The fields `keys` identify a part. Parts are appended; a last line that was cut off costs that part only.
    Without a target nothing is kept on disk.

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
            if path.exists():
                self._read()  # before the lock, which would be left beside a file of something else
            with self._lock as stack:
                stack.enter_context(self.target.locked())
                if path.exists():
                    self._read()
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
                stream.write(_line(record))
        except OSError as error:
            raise self.target.unwritable(error) from None

    def _part_of(self, record: Record) -> str:
        return json.dumps([record[name] for name in self.keys])

    def _write(self) -> None:
        assert self.target is not None
        text = "".join(map(_line, [self._manifest, *self._records.values()]))
        write_whole(self.target.path, lambda stream: stream.write(text))
        self._written = True

    def _read(self) -> None:
        """Take in the parts of a file that was begun with the same inputs."""
        assert self.target is not None
        try:
            texts = self.target.path.read_text("utf-8").splitlines()
        except UnicodeDecodeError:
            raise self.target.foreign() from None
        except OSError as error:
            raise self.target.unwritable(error) from None
        lines: list[Record] = []
        for number, text in enumerate(texts):
            line = _record(text)
            if line is None and number == len(texts) - 1 > 0:
                break  # it was cut off: that part is computed again
            needed = self.keys if number else ["inputs", "key"]
            if line is None or any(name not in line for name in needed):
                raise self.target.foreign()
            lines.append(line)
        if lines and lines[0]["key"] != self._manifest["key"]:
            self.target.check_same(lines[0]["inputs"], self._manifest["inputs"])
            raise self.target.foreign()
        self._records = {self._part_of(record): record for record in lines[1:]}


def _line(record: Mapping[str, Any]) -> str:
    """A record as it stands in a file; with `_record` the one place for what protects it there."""
    return json.dumps(record, allow_nan=False) + "\n"


def _record(line: str) -> Record | None:
    """The record of a line, None if it is none."""
    try:
        found = json.loads(line)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _open_locked(path: Path) -> int | None:
    """The locked file, or None if it is locked by another process."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
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
