"""The questions of `softstart init`: answers that are kept as they come, gone back to, and taken up again."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from softstart.drive import data_sheet_words as sheets
from softstart.drive.data_sheet import DataSheet
from softstart.drive.data_sheet_words import (
    ABOUT,
    INSTEAD,
    MACHINES,
    NEEDED,
    STIFFNESSES,
    TYPICAL,
    USUAL,
    converted,
)
from softstart.errors import InputError
from softstart.input.documents import literal, parsed
from softstart.input.files import file_text, write_whole
from softstart.input.parameters import Parameter, Wording, read_value
from softstart.quantities import RefusedError
from softstart.stopping import at_stop

__all__ = ["ask_data_sheet", "prompt_text"]

# asked only where one of the others was answered
AFTER = {
    "coupling_diameter": ("coupling_play",), "efficiency": ("ratio",), "play_diameter": ("output_play",),
    "shaft_length": ("shaft_diameter",), "rope_diameter": ("rope_length",), "rope_modulus": ("rope_length",),
    "length": ("rise",), "goods": ("slope", "rise"),
}  # fmt: skip
# asked only where none of the others was answered
UNLESS = {"elastic_frequency": STIFFNESSES, **{name: {other} for name, other in INSTEAD.items()}}
FIRST = ("name", "source", "machine")
BACK, NOTHING = ("<", "back"), "-"
PARAMETERS = DataSheet.PARAMETERS
QUESTIONS = tuple(sorted(PARAMETERS.values(), key=lambda p: p.name not in FIRST))
HEAD = "# Answers to softstart init, a data sheet. The same command goes on from here."
EMPTY = "# left empty: "


class _Answers:
    """What was answered, by path, kept in a file after each answer; `settings` is of the command line."""

    def __init__(self, file: Path, settings: Mapping[str, object]) -> None:
        self.file, self.settings = file, settings
        self.texts: dict[str, object] = {}
        self.seen: list[str] = []  # names of what was asked, in order
        if file.exists():
            text = file_text(file, "the answers to softstart init")
            if not text.startswith(HEAD):
                raise InputError(
                    f"{file}: the answers would be written there, and there is such a file already; give "
                    f"another --out, or make a drive of it: softstart init {file}."
                )
            document = parsed(text, Wording(str(file), style="toml"), "a data sheet", DataSheet.TABLES)
            tables = {"": document} | {t: keys for t, keys in document.items() if isinstance(keys, dict)}
            for p in QUESTIONS:
                if p.key in tables.get(p.table, ()):
                    self.texts[p.path] = tables[p.table][p.key]
            empty = re.findall(rf"^{EMPTY}(.*)", text, re.MULTILINE)
            left = {path for line in empty for path in line.split(", ")}
            self.seen = [p.name for p in QUESTIONS if p.path in self.texts or p.path in left]

    def values(self) -> dict[str, object]:
        """All values by path, but those that say something about another machine."""
        machine = converted("machine", self.settings.get("load.machine", self.texts.get("load.machine")))
        other = {PARAMETERS[name].path for name, machines in ABOUT.items() if machine not in machines}
        return {path: text for path, text in self.texts.items() if path not in other} | {**self.settings}

    def known(self, name: str) -> bool:
        """Whether this was answered or given, and is not 0."""
        p, values = PARAMETERS[name], self.values()
        try:
            return p.path in values and bool(read_value(p, converted(name, values[p.path])))
        except RefusedError:
            return False

    def due(self, p: Parameter) -> bool:
        """Whether this is asked, as far as the answers go."""
        machine = converted("machine", self.values().get("load.machine"))
        about = machine in ABOUT.get(p.name, (machine,))
        after = any(map(self.known, AFTER.get(p.name, ()))) or p.name not in AFTER
        instead = any(map(self.known, UNLESS.get(p.name, ())))
        asked = p.path not in self.settings and p.name != "units"  # a matter of taste, for a file
        return asked and about and after and not instead

    def needed(self, p: Parameter) -> bool:
        """Whether it cannot be left empty."""
        machine = str(converted("machine", self.values().get("load.machine")))
        last = {"diameter": ""}.get(p.name, p.name)  # the radius is asked where it is left empty
        return p.required or last in ("rated_torque", "radius", *NEEDED.get(machine, ()))

    def keep(self) -> None:
        """Write the file: whole, or as it was before."""
        values = sheets.answered(self.values()) if "friction" in self.seen else self.values()
        left = [PARAMETERS[name].path for name in self.seen if PARAMETERS[name].path not in values]
        lines = [HEAD, *([EMPTY + ", ".join(left)] if left else [])]
        for table in DataSheet.TABLES:
            rows = [f"{p.key} = {literal(values[p.path])}" for p in table.parameters if p.path in values]
            lines += ["", *[table.bracket] * bool(table.name), *rows] if rows else []
        write_whole(self.file, lambda stream: stream.write("\n".join(lines) + "\n"))


def ask_data_sheet(settings: Mapping[str, object], file: Path) -> DataSheet:
    """The data sheet of `settings`, values by path, and of answers from standard input, kept in this file.

    What contradicts is said, and what the sentence names is asked again.
    """
    answers = _Answers(file, settings)
    if answers.texts:
        _say(f"{len(answers.texts)} answers are taken up from {file}; remove it to begin again.")
    _say(f"Enter leaves a value out, {BACK[0]} goes back; the answers are kept in {file}.")
    kept = f"what was answered is kept in {file}; the same command goes on from there"
    with at_stop(lambda: _say(f"softstart: {kept}.")):
        while True:
            for p in iter(lambda: next((p for p in QUESTIONS if _open(p, answers)), None), None):
                _ask(p, answers, kept)
            try:
                sheet = DataSheet.from_settings(sheets.answered(answers.values()))
                _ = sheet.drive
                return sheet
            except InputError as error:
                again = {p.name for p in QUESTIONS if answers.due(p) and _about(p, error.sentences)}
                if not again:
                    raise
                for sentence in error.sentences:
                    _say(f"  {sentence}")
                answers.seen = [name for name in answers.seen if name not in again]


def _open(p: Parameter, answers: _Answers) -> bool:
    return p.name not in answers.seen and answers.due(p)


def _about(p: Parameter, sentences: Iterable[str]) -> bool:
    """Whether one of these sentences names the parameter."""
    return any(re.search(rf"{re.escape(p.place)}\b", sentence) for sentence in sentences)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _ask(p: Parameter, answers: _Answers, kept: str) -> None:
    """Take one answer, or go back by one question."""
    line = _answer(p, answers, kept)
    if line in BACK:
        # what was asked just before comes next: it is the first one that is open
        answers.seen = answers.seen[:-1]
        return
    answers.seen.append(p.name)
    answers.texts.pop(p.path, None)
    if line:
        answers.texts[p.path] = line
    answers.keep()


def _answer(p: Parameter, answers: _Answers, kept: str) -> str:
    """What is typed for one parameter, asked again until it can be read; "" for nothing."""
    before, needed = str(answers.texts.get(p.path, "")), answers.needed(p)
    while True:
        print(prompt_text(p, needed, before), end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if not line:
            raise InputError(
                f"the answers end before {p.place} ({p.meaning}); give it with --set {p.path}={p.example}, "
                f"or in a file (softstart init --template prints one). {kept[0].upper()}{kept[1:]}."
            )
        if line.strip() in BACK:
            return BACK[0]
        text = before if not line.strip() else "" if line.strip() == NOTHING else sheets.typed(p, line)
        try:
            if not text and needed:
                raise RefusedError(f"it is needed; write for example {p.example}")
            value = read_value(p, converted(p.name, text)) if text else None
        except RefusedError as refusal:
            _say(f"  {Wording(style='toml').refused(p, text, sheets.in_usual_unit(p, refusal))}")
            continue
        said = f"{value}: {MACHINES[value]}" if p.choices and value else sheets.echo(p, text) if text else ""
        if said and line.strip():
            _say(f"  {said}")
        return text


def prompt_text(p: Parameter, needed: bool = False, before: str = "") -> str:
    """The question for one parameter, with the unit of a bare number and what Enter stands for.

    >>> prompt_text(DataSheet.PARAMETERS["backlash"])
    'backlash of the gears at the output in arcmin, as 15 [none]: '
    >>> prompt_text(DataSheet.PARAMETERS["backlash"], before="9 arcmin")
    'backlash of the gears at the output in arcmin, as 15 [9 arcmin, - for none]: '
    """
    unit = USUAL.get(p.name, p.unit)
    example = p.example.strip('"').removesuffix(f" {unit}")
    hint = f" ({TYPICAL[p.name][1]})" if p.name in TYPICAL else ""
    asks = f"{p.meaning}{f' in {unit}' if unit not in ('', '1') else ''}, as {example}{hint}"
    if p.choices:
        asks = f"{p.meaning}: {'; '.join(f'{word} ({MACHINES[word]})' for word in p.choices)}"
    needed = needed or p.required
    empty = "" if needed else f"{NOTHING} for none" if before else sheets.if_empty(p)
    shown = ", ".join(filter(None, [before, empty]))
    return f"{asks}{f' [{shown}]' if shown else ''}: "
