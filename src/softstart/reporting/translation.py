"""Reports in another language: one TOML file with each template of a sentence, and how it is said there."""

from __future__ import annotations

import json
import string
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, Self

from softstart.controller import controller_class, controller_names
from softstart.controller.base import Effort
from softstart.drive import PARAMETERS
from softstart.errors import InputError
from softstart.input.files import text_of, write_whole
from softstart.language import templates
from softstart.quantities import nearest
from softstart.start.status import Status

HEAD = """# The sentences of a softstart report: left as they are, right in your language; "" stays English.
# Names in braces are values: keep each, in any order. " | " parts the columns of a table.
"""


@dataclass(frozen=True)
class Translation:
    """What a report says in another language: `code` as of HTML, and a table template -> sentence.

    >>> Translation.read('code = "de"\\n[sentences]\\n"The drive" = "Der Antrieb"').table
    {'The drive': 'Der Antrieb'}
    >>> Translation.read('[sentences]\\n"{name}: peak {peak} N m" = "{name}: Spitze {p} N m"')
    Traceback (most recent call last):
    softstart.errors.InputError: [sentences] "{name}: peak {peak} N m": a report has no value {p} here; ...
    """

    code: str = "en"
    table: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """From a TOML file."""
        return cls.read(text_of(path, "a translation"), str(path))

    @classmethod
    def read(cls, text: str, where: str = "") -> Self:
        """From a TOML text; all mistakes at once."""
        wrong: list[str] = []
        found = _parsed(text, where)
        code, sentences = found.pop("code", "en"), found.pop("sentences", {})
        found.pop("unused", None)
        wrong += [f"{key}: a translation has code and the tables [sentences] and [unused]." for key in found]
        if not isinstance(code, str) or not code.replace("-", "").isalnum():
            wrong.append(f'code = {code!r}: give the code of a language, as "de" or "pt-BR".')
        known = every_template()
        if not isinstance(sentences, dict):
            sentences = {}
            wrong.append("[sentences] is a table of sentences.")
        for template, sentence in sentences.items():
            subject = f"[sentences] {json.dumps(template, ensure_ascii=False)}"
            if not isinstance(sentence, str):
                wrong.append(f'{subject} = {sentence!r}: give the sentence in quotes, or "" for English.')
            elif template not in known:
                hint = nearest(template, known)
                wrong.append(
                    f"{subject}: a report has no such sentence; "
                    + (f'did you mean "{hint}"?' if hint else "softstart report --sentences writes them all.")
                )
            else:
                wrong += [f"{subject}: {one}" for one in _mismatch(template, sentence)]
        if wrong:
            raise InputError([f"{where}: {one}" if where else one for one in wrong])
        return cls(code, {one: sentence for one, sentence in sentences.items() if sentence})


def _parsed(text: str, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where or 'translation'}: this is no TOML ({error}).") from None


def _mismatch(template: str, sentence: str) -> list[str]:
    """What keeps a sentence from standing for its template."""
    if not sentence:
        return []
    names = _names(template)
    try:
        given = _names(sentence)
        sentence.format(**dict.fromkeys(names, 1.0)) if names else None
    except KeyError:
        pass  # told below, by name
    except ValueError as error:
        return [f"{error} in the sentence; a brace that is no value is doubled."]
    wrong = [
        f"a report has no value {{{name}}} here; use {', '.join(f'{{{one}}}' for one in names) or 'none'}."
        for name in given
        if name not in names
    ]
    wrong += [f"the value {{{name}}} is missing in the sentence." for name in names if name not in given]
    if template.count(" | ") != sentence.count(" | "):
        wrong.append(f'give {template.count(" | ") + 1} headings, with " | " between them.')
    return wrong


def _names(template: str) -> list[str]:
    """The values of a template, each once."""
    return list(dict.fromkeys(name for _, name, _, _ in string.Formatter().parse(template) if name))


@cache
def every_template() -> tuple[str, ...]:
    """All sentences that reports can have: those in the source, and those that drives and controllers bring.

    >>> "start time, s" in every_template(), "gap between the masses" in every_template()
    (True, False)
    """
    found: list[str] = []
    for source in sorted(Path(__file__).parents[1].rglob("*.py")):
        if "softstart.language import" in source.read_text("utf-8"):
            found += templates(source)
    found += [one.meaning for one in PARAMETERS.values()]
    for name in controller_names():
        cls: Any = controller_class(name)
        found += [cls.summary, *(str(one.metadata.get("meaning", "")) for one in fields(cls))]
    found += [one.value for one in Status if one.finished]
    found += [one.meaning for one in Effort]
    return tuple(dict.fromkeys(filter(None, found)))


def write_sentences(path: Path) -> tuple[int, int]:
    """Write the file of a translation: every template, with what the file says already. How many, and open.

    What is no sentence any more goes to [unused]; the file is written whole or not at all.
    """
    before = _parsed(text_of(path, "a translation"), str(path)) if path.exists() else {}
    said = {**before.get("unused", {}), **before.get("sentences", {})}
    known = every_template()
    lines = [HEAD, f"code = {json.dumps(before.get('code', 'en'))}", "", "[sentences]"]
    lines += [f"{_quoted(one)} = {_quoted(said.get(one, ''))}" for one in known]
    unused = {one: sentence for one, sentence in said.items() if one not in known and sentence}
    if unused:
        lines += ["", "[unused]", *(f"{_quoted(one)} = {_quoted(text)}" for one, text in unused.items())]
    write_whole(path, lambda stream: stream.write("\n".join(lines) + "\n"))
    return len(known), sum(not said.get(one) for one in known)


def _quoted(text: str) -> str:
    """A text as a string of TOML."""
    return json.dumps(text, ensure_ascii=False)
