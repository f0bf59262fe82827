"""One writer at a time: a lock beside the folder, which the system drops when its owner dies."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from softstart.errors import InputError


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, the file `.NAME.lock` beside it; InputError if another process has it.

    The lock is on the open file, not its name: a file that a dead process left behind locks nobody out.
    """
    path = folder.parent / f".{folder.name}.lock"
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        handle = _open(path)
    except OSError as error:
        raise InputError(
            f"to = {folder}: nothing can be written there ({error.strerror or error}); give a folder that "
            "you may write to."
        ) from None
    if handle is None:
        owner = path.read_text("utf-8").strip() if sys.platform != "win32" else ""
        raise InputError(
            f"to = {folder}: {f'process {owner}' if owner else 'another process'} is writing this sweep now; "
            "wait for it or end it, or give another folder."
        )
    try:
        os.truncate(handle, 0)
        os.pwrite(handle, f"{os.getpid()} on {socket.gethostname()}\n".encode(), 0)
        yield
    finally:
        if sys.platform != "win32":  # there, a file that is open cannot be removed
            path.unlink(missing_ok=True)
        os.close(handle)


def _open(path: Path) -> int | None:
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
