"""The saved state of a front: finished points on disk, so that an interrupted sweep goes on where it was."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softstart.errors import InputError
from softstart.input.files import write_whole

Record = dict[str, Any]


class SavedPoints:
    """Finished points in a file of JSON lines: first what was asked, then one point a line.

    The file is written anew, whole, with every point that is added. A file of other inputs is never touched:
    it raises InputError, and so does one that is no such file. Without a path nothing is kept.

    >>> saved = SavedPoints(None, {"drive": "crane"})
    >>> saved.add({"terminal": "reached", "start_time_bound": 0.3, "k_dyn": 1.1})
    >>> saved.find("reached", 0.3)["k_dyn"], saved.find("reached", 0.31)
    (1.1, None)
    """

    def __init__(self, path: Path | None, inputs: Mapping[str, Any]) -> None:
        self.path = path
        self.header = {"inputs": dict(inputs), "key": key_of(inputs)}
        self.records: dict[tuple[str, float], Record] = {}
        if path is not None and path.exists():
            for record in _read(path, self.header):
                self._keep(record)

    def find(self, terminal: str, start_time: float) -> Record | None:
        """The finished point with this terminal condition and bound on the start time, if there is one."""
        return self.records.get((terminal, start_time))

    def add(self, record: Record) -> None:
        """Keep a point, on disk too."""
        self._keep(record)
        if self.path is None:
            return
        lines = [self.header, *self.records.values()]
        text = "".join(json.dumps(line, allow_nan=False) + "\n" for line in lines)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"save_to = {self.path}: its folder cannot be made ({error.strerror or error}); "
                "give a file in a folder that you may write to."
            ) from None
        write_whole(self.path, lambda stream: stream.write(text))

    def _keep(self, record: Record) -> None:
        self.records[record["terminal"], float(record["start_time_bound"])] = record


def key_of(inputs: Mapping[str, Any]) -> str:
    """A fingerprint of all inputs.

    >>> key_of({"a": 1, "b": 2}) == key_of({"b": 2, "a": 1}), key_of({"a": 1}) == key_of({"a": 2})
    (True, False)
    """
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def _read(path: Path, header: Mapping[str, Any]) -> list[Record]:
    """The points of a file that was begun with the same inputs."""
    try:
        texts = path.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        raise InputError(
            f"save_to = {path}: the file cannot be read ({reason}); name another file."
        ) from None
    lines = []
    for number, text in enumerate(texts, start=1):
        try:
            line = json.loads(text)
        except ValueError:
            if number == len(texts) > 1:
                break  # the last line was cut off: that point is computed again
            raise _foreign(path) from None
        needed = ("inputs", "key") if number == 1 else ("terminal", "start_time_bound")
        if not isinstance(line, dict) or any(name not in line for name in needed):
            raise _foreign(path)
        lines.append(line)
    if not lines:
        return []
    if lines[0]["key"] != header["key"]:
        before, now = lines[0]["inputs"], header["inputs"]
        other = [name for name in now if before.get(name) != now[name]]
        raise InputError(
            f"save_to = {path}: it holds points that were computed with another {_listed(other)}; "
            "name another file, or delete this one to begin anew."
        )
    return lines[1:]


def _foreign(path: Path) -> InputError:
    return InputError(f"save_to = {path}: this is no file of saved points; name another file.")


def _listed(names: list[str]) -> str:
    if len(names) < 2:
        return "".join(names) or "input"
    return f"{', '.join(names[:-1])} and {names[-1]}"
