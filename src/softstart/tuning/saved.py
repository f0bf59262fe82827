"""The saved state of a tuning: finished parts on disk, so that an interrupted one goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.optimal.front_saved import key_of

Part = tuple[Any, ...]  # what was done: a word, then numbers or texts


class SavedParts:
    """Finished parts in a file of JSON lines: first what was asked, then one part a line.

    Parts are appended; a last line that was cut off costs that part only. A file of other inputs is never
    touched: it raises InputError, and so does one that is no such file. Without a path nothing is kept.

    >>> saved = SavedParts(None, {"drive": "crane"})
    >>> saved.add(("cell", 3, 0), {"cost": 1.1})
    >>> saved.find(("cell", 3, 0)), saved.find(("cell", 3, 1))
    ({'cost': 1.1}, None)
    """

    def __init__(self, path: Path | None, inputs: Mapping[str, Any]) -> None:
        self.path = path
        self.header = {"inputs": dict(inputs), "key": key_of(inputs)}
        self.parts: dict[str, dict[str, Any]] = {}
        if path is not None and path.exists():
            self.parts = _read(path, self.header)
            self._write()  # without a line that was cut off

    def find(self, part: Part) -> dict[str, Any] | None:
        """What is known of a part."""
        return self.parts.get(json.dumps(part))

    def add(self, part: Part, known: Mapping[str, Any]) -> None:
        """Keep a part, on disk too."""
        first = not self.parts
        self.parts[json.dumps(part)] = dict(known)
        if self.path is None:
            return
        if first or not self.path.exists():
            self._write()
            return
        try:
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write(_line({"part": part, **known}))
        except OSError as error:
            raise InputError(
                f"save_to = {self.path}: it cannot be written ({error.strerror or error}); "
                "give a file in a folder that you may write to."
            ) from None

    def _write(self) -> None:
        if self.path is None:
            return
        lines = [self.header, *({"part": json.loads(k), **v} for k, v in self.parts.items())]
        text = "".join(map(_line, lines))
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"save_to = {self.path}: its folder cannot be made ({error.strerror or error}); "
                "give a file in a folder that you may write to."
            ) from None
        write_whole(self.path, lambda stream: stream.write(text))


def _line(data: Mapping[str, Any]) -> str:
    return json.dumps(data, allow_nan=False) + "\n"


def _read(path: Path, header: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The parts of a file that was begun with the same inputs."""
    try:
        texts = path.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        raise InputError(
            f"save_to = {path}: the file cannot be read ({reason}); name another file."
        ) from None
    lines: list[dict[str, Any]] = []
    for number, text in enumerate(texts, start=1):
        try:
            line = json.loads(text)
        except ValueError:
            if number == len(texts) > 1:
                break
            raise _foreign(path) from None
        needed = ("inputs", "key") if number == 1 else ("part",)
        if not isinstance(line, dict) or any(name not in line for name in needed):
            raise _foreign(path)
        lines.append(line)
    if lines and lines[0]["key"] != header["key"]:
        before, now = lines[0]["inputs"], header["inputs"]
        other = [name for name in now if before.get(name) != now[name]]
        raise InputError(
            f"save_to = {path}: it belongs to a tuning with another {' and '.join(other) or 'input'}; "
            "name another file, or delete this one to begin anew."
        )
    return {json.dumps(one.pop("part")): one for one in lines[1:]}


def _foreign(path: Path) -> InputError:
    return InputError(f"save_to = {path}: this is no file of a saved tuning; name another file.")
