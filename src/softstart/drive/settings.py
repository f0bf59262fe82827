"""Changes to a drive as they are typed: `load.inertia=0.07`, `gap=2 rad`."""

from __future__ import annotations

from collections.abc import Iterable

from softstart.drive.parameters import PARAMETERS, TABLES
from softstart.drive.sentences import Mistake, Wording
from softstart.quantities import nearest, show

__all__ = ["read_settings"]

_BY_PATH = {p.path: p for p in PARAMETERS.values()}


def read_settings(settings: Iterable[str]) -> tuple[dict[str, object], Wording, list[Mistake]]:
    """The values by flat name, the wording with the keys as typed, and what cannot be read.

    >>> given, wording, mistakes = read_settings(["load.inertia=0.07", "gap = 2 rad", "gapp=1"])
    >>> given, wording.label("load_inertia")
    ({'load_inertia': '0.07', 'gap': '2 rad'}, 'load.inertia')
    >>> mistakes[0].sentence
    'gapp=1: there is no parameter "gapp"; did you mean gap?'
    """
    wording = Wording(style="path")
    given: dict[str, object] = {}
    written: dict[str, str] = {}
    first: dict[str, str] = {}
    mistakes = []
    for setting in [settings] if isinstance(settings, str) else settings:
        if not isinstance(setting, str):
            mistakes.append(
                Mistake(wording.sentence(show(setting), 'a setting is text like "load.inertia=0.07"'))
            )
            continue
        key, equals, value = (part.strip() for part in setting.partition("="))
        name = _name_of(key)
        if not equals or not key:
            reason = "a setting is a key, an equals sign and a value, such as load.inertia=0.07"
            mistakes.append(Mistake(wording.sentence(show(setting), reason)))
        elif name is None:
            mistakes.append(
                Mistake(wording.sentence(setting, f"there is no parameter {show(key)}{_hint(key)}"))
            )
        elif name in first:
            reason = f"it was set before ({first[name]}); keep one of the two"
            mistakes.append(Mistake(wording.sentence(setting, reason)))
        else:
            given[name] = _unquoted(value)
            written[name] = key
            first[name] = setting
    return given, Wording(style="path", written=written), mistakes


def _name_of(key: str) -> str | None:
    if key in _BY_PATH:
        return _BY_PATH[key].name
    return key if key in PARAMETERS else None


def _hint(key: str) -> str:
    if key in TABLES:
        first = next(path for path in _BY_PATH if path.startswith(key))
        return f"; {key} is a table, name one of its keys, such as {first}"
    symbols = [p.path for p in PARAMETERS.values() if key in (p.key, p.symbol)]
    if symbols:
        return f"; did you mean {' or '.join(symbols)}?"
    meant = nearest(key, [*_BY_PATH, *PARAMETERS])
    if meant:
        return f"; did you mean {meant}?"
    return f"; there are {', '.join(_BY_PATH)}"


def _unquoted(value: str) -> str:
    return value[1:-1] if len(value) >= 2 and value[0] == value[-1] and value[0] in "\"'" else value
