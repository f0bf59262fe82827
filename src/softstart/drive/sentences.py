"""Word what is wrong with a drive: one sentence a mistake, with the key as its writer wrote it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from pydantic import ValidationError

from softstart.drive.parameters import PARAMETERS
from softstart.quantities import RefusedError, nearest, show

__all__ = ["Mistake", "Wording", "flat_name_meant", "mistakes_of", "refused", "told"]


@dataclass(frozen=True)
class Wording:
    """How the writer of the input names parameters and writes values.

    `where` is the file, put before each sentence; `style` is "python" (`load_inertia`), "toml"
    (`[load] inertia`) or "path" (`load.inertia`); `written` holds names that were written otherwise.
    """

    where: str = ""
    style: str = "python"
    written: Mapping[str, str] = field(default_factory=dict)

    def label(self, name: str) -> str:
        """The parameter as the writer calls it.

        >>> Wording(style="toml").label("load_inertia"), Wording().label("load_inertia")
        ('[load] inertia', 'load_inertia')
        """
        if name in self.written or name not in PARAMETERS:
            return self.written.get(name, name)
        parameter = PARAMETERS[name]
        return {"toml": parameter.place, "path": parameter.path}.get(self.style, name)

    def show(self, value: object) -> str:
        """The value as the writer wrote it."""
        return show(value, toml=self.style == "toml")

    def sentence(self, subject: str, reason: str) -> str:
        """Subject and reason with the file before and a full stop behind."""
        stop = "" if reason.endswith(("?", ".")) else "."
        return f"{self.where + ': ' if self.where else ''}{subject}: {reason}{stop}"

    def whole(self, reason: str) -> str:
        """A sentence about the input as a whole."""
        return replace(self, where="").sentence(self.where or "the text", reason)

    def missing(self, name: str) -> str:
        """That a required parameter is not there, and what to write."""
        p = PARAMETERS[name]
        symbol = f" {p.symbol}" if p.symbol and p.symbol != p.key else ""
        if name == "target_speed":
            what = f"the {p.meaning} is needed, or {self.label('rated_speed')} in its place"
        else:
            what = f"the {p.meaning}{symbol} is needed"
        text = f"{name}={p.example}" if self.style == "python" else f"{p.key} = {p.example}"
        head = f"{self.label(name)} is missing"
        return self.sentence(head, f"{what}; write for example {text}")


@dataclass(frozen=True)
class Mistake:
    """One sentence; `missing` names the parameter that it misses, `meant` the one that was misspelt."""

    sentence: str
    missing: str | None = None
    meant: str | None = None


def told(mistakes: Iterable[Mistake]) -> list[str]:
    """The sentences, each once; a parameter that was only misspelt is not also called missing.

    >>> told([Mistake("gapp: did you mean gap?", meant="gap"), Mistake("gap is missing", missing="gap")])
    ['gapp: did you mean gap?']
    """
    mistakes = list(mistakes)
    misspelt = {mistake.meant for mistake in mistakes if mistake.meant}
    kept = (m.sentence for m in mistakes if m.missing is None or m.missing not in misspelt)
    return list(dict.fromkeys(kept))


def flat_name_meant(name: str, given: Iterable[str]) -> tuple[str, ...]:
    """The parameters that an unknown Python name may mean: by key, by symbol, or by likeness.

    >>> flat_name_meant("inertia", []), flat_name_meant("J2", []), flat_name_meant("gapp", [])
    (('motor_inertia', 'load_inertia'), ('load_inertia',), ('gap',))
    """
    present = set(given)
    free = [p for p in PARAMETERS.values() if p.name not in present] or list(PARAMETERS.values())
    for among in (free, PARAMETERS.values()):
        same = tuple(p.name for p in among if name in (p.key, p.symbol, p.path))
        if same:
            return same
    close = nearest(name, [p.name for p in free]) or nearest(name, [p.name for p in PARAMETERS.values()])
    return (close,) if close else ()


def mistakes_of(error: ValidationError, wording: Wording, given: Mapping[str, object]) -> Iterable[Mistake]:
    """What pydantic found, in sentences."""
    for found in error.errors(include_url=False):
        name = str(found["loc"][0])
        if found["type"] == "extra_forbidden":
            yield _unknown(name, wording, given)
        elif found["type"] == "missing":
            yield Mistake(wording.missing(name), missing=name)
        elif found["type"] != "default_factory_not_called":
            yield Mistake(
                refused(wording, name, found["input"], found.get("ctx", {}).get("error", found["msg"]))
            )


def refused(wording: Wording, name: str, value: object, reason: object) -> str:
    """The sentence for a value that was refused; of an array, only the bad element is shown."""
    place = ""
    if isinstance(reason, RefusedError) and reason.index is not None:
        value, place = reason.value, f"[{', '.join(map(str, reason.index))}]"
    return wording.sentence(f"{wording.label(name)}{place} = {wording.show(value)}", str(reason))


def _unknown(name: str, wording: Wording, given: Mapping[str, object]) -> Mistake:
    meant = flat_name_meant(name, given)
    remedy = f"; did you mean {' or '.join(meant)}?" if meant else f"; the names are {', '.join(PARAMETERS)}"
    sentence = wording.sentence(
        f"{name} = {wording.show(given[name])}", f"a drive has no parameter {show(name)}{remedy}"
    )
    return Mistake(sentence, meant=meant[0] if len(meant) == 1 else None)
