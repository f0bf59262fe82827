"""The file of a project: names and revisions, machines, strategies, optima, duties, and the choice.

Machines, strategies and duties are whole files in it, byte for byte, read by the readers of such files.
"""

from __future__ import annotations

import base64
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, Self, cast

from softstart.chain.machines import MachineLike, as_machine, known_from, refuse_other_kind
from softstart.controller.base import Controller
from softstart.controller.finding import make_controller
from softstart.drive import PARAMETERS, Duty, Machine
from softstart.errors import InputError, Mistakes
from softstart.hints import did_you_mean, nearest
from softstart.input.documents import PROJECT, DocumentTable, parsed
from softstart.input.files import file_text, write_whole
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import Number, ParameterSet, Rows, component, parameter
from softstart.input.parameters import REQUIRED, Wording
from softstart.plugins import controller_names
from softstart.profile import TorqueProfile
from softstart.project import parts
from softstart.project.parts import StoredDuty, StoredMachine, StoredOptimum, StoredStrategy
from softstart.quantities import show

LOGOS = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".svg": "image/svg+xml"}
VERSION = 1
FIRST = f"{PROJECT} (softstart project open FILE), whole if its last line is the end of it.\n"
LAST = "# end of the project\n"
KINDS = {"machine": "machines", "strategy": "strategies", "optimum": "optima", "duty": "duties"}
MOST_LOGO = 500_000  # bytes: a report is sent by mail


def _line(path: str, meaning: str, example: str, default: object = "", choices: str = "") -> Any:
    words = tuple(choices.split(", ")) if choices else ()
    return parameter(path, "", meaning, f'"{example}"', "one line", default=default, choices=words)


class Revision(ParameterSet):
    """A revision of the document."""

    # fmt: off
    number: str = _line("revision.number", "number of the revision", "A")
    date: str = _line("revision.date", "its date, in quotes", "2026-11-20")
    author: str = _line("revision.author", "who made it", "A. Engineer")
    change: str = _line("revision.change", "what has changed", "first issue")
    # fmt: on


class Source(ParameterSet):
    """What the value of a parameter of the drive file is from."""

    # fmt: off
    parameter: str = _line("source.parameter", "the parameter of the drive file", "shaft.gap", REQUIRED)
    origin: str = _line("source.origin", "what its value is from", "identified",
        choices="data sheet, drawing, measured, identified, guessed")
    note: str = _line("source.note", "interval, sheet or drawing", "0.48 to 0.52 rad (95 %)")
    # fmt: on

    def contradictions(self) -> Iterator[str]:
        """A sentence on a parameter that no drive has."""
        paths = [one.path for one in PARAMETERS.values()]
        if self.parameter not in paths:
            near = nearest(self.parameter, paths)
            hint = f"did you mean {near}?" if near else "write it as --set does, as shaft.gap."
            yield f'parameter = "{self.parameter}": a drive has no such parameter; {hint}'


class Project(ParameterFile, what="a project"):
    """A project: machines, strategies, optima and duties by name, the choice, and the heading of its report.

    It does not change; `added` and `replace` give another one. A logo is kept as a data URI, so that the file
    can be moved. All may be left out.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    InputError
        With a sentence for each mistake, also in the files that it holds.

    Examples
    --------
    >>> slow = 'kind = "settings"\\ncontroller = "ramp"\\n[parameters]\\ntime = 0.3'
    >>> project = Project.new("crane-4amtkf").added("slow", slow)
    >>> project.machine, project.single().gap, project.controller("slow").name
    ('crane-4amtkf', 0.5, 'ramp (slow)')
    >>> Project.read(project.to_toml()) == project
    True
    >>> Project.read("version = 2")
    Traceback (most recent call last):
    softstart.errors.InputError: version = 2: this project was written by a later softstart, and ...
    >>> Project.read('[project]\\ncustomer = "Harbour Cranes Ltd"').customer
    'Harbour Cranes Ltd'
    >>> Project.read('[[source]]\\nparameter = "shaft.gapp"')
    Traceback (most recent call last):
    softstart.errors.InputError: [source] 1, parameter = "shaft.gapp": a drive has no such parameter; did ...

    References
    ----------
    docs/howto/keep-a-project.md.
    """

    # fmt: off
    customer: str = _line("project.customer", "who the report is for", "Harbour Cranes Ltd")
    project: str = _line("project.project", "name of the project", "Gantry crane 3")
    number: str = _line("project.number", "number of the document", "SC-0147")
    author: str = _line("project.author", "who made it", "A. Engineer")
    company: str = _line("project.company", "the author's company", "Drives & Co")
    checked: str = _line("project.checked", "who checked it, and when", "B. Checker, 2026-11-20")
    approved: str = _line("project.approved", "who approved it, and when", "C. Chief, 2026-11-21")
    logo: str = _line("project.logo", "picture for the head of page 1", "logo.png")
    paper: str = _line("project.paper", "paper size", "A4", "A4", "A4, letter")
    decimal: str = _line("project.decimal", "decimal sign", "point", "point", "point, comma")
    revisions: Rows[Revision] = component(Revision, least=0, default=())
    sources: Rows[Source] = component(Source, least=0, default=())
    version: Number = parameter("version", "1", "version of the form of this file", "1",
        "a whole number, 1 or more", default=1.0)
    notes: str = parameter("notes", "", "notes", '"gap measured on site"', default="")
    machine: str = _line("choice.machine", "name of the machine chosen", "crane")
    beside: str = _line("choice.beside", "name of the machine that stands beside it", "crane worn")
    strategy: str = _line("choice.strategy", "name of the strategy chosen, of this project or of softstart",
        "ramp")
    duty: str = _line("choice.duty", "name of the duty of the machines that are chosen", "shift")
    machines: Rows[StoredMachine] = component(StoredMachine, least=0, default=())
    strategies: Rows[StoredStrategy] = component(StoredStrategy, least=0, default=())
    optima: Rows[StoredOptimum] = component(StoredOptimum, least=0, default=())
    duties: Rows[StoredDuty] = component(StoredDuty, least=0, default=())
    # fmt: on

    @classmethod
    def new(cls, *files: MachineLike) -> Self:
        """A project of machines, by name or file, and of files of strategies and duties; the first is chosen.

        >>> Project.new("crane-4amtkf", "hoist-15kw").machine
        'crane-4amtkf'
        """
        project = cls()
        for given in files:
            if isinstance(given, Machine):
                project = project.added(given.name, given)
                continue
            path = Path(given)
            shipped = path.suffix == "" and not path.exists()
            text = as_machine(given).to_toml() if shipped else file_text(path, "a machine, strategy or duty")
            project = project.added(path.stem, text)
        return project.replace(machine=project.machines[0].name) if project.machines else project

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Self:
        """From a TOML file; a logo that is named there is looked for beside it."""
        return cls.read(file_text(path, cls.WHAT), os.fspath(path), Path(path).parent)

    @classmethod
    def read(cls, text: str, where: str = "", folder: Path = Path()) -> Self:
        """From a TOML text; all mistakes at once."""
        before = f"{where}: " if where else ""
        cut_off = text.startswith(FIRST.rstrip()) and not text.rstrip().endswith(LAST.rstrip())
        document: Mapping[str, Any] = {}
        with suppress(InputError) if cut_off else nullcontext():  # half a line is no TOML
            document = parsed(text, Wording(where, style="toml"), cls.WHAT)
        if {"motor", "mass"} & document.keys():
            makes = '"softstart project new job.toml FILE" makes a project of it'
            raise InputError(f"{before}this is a machine, not a project; {makes}.")
        version = document.get("version", VERSION)
        if isinstance(version, int | float) and version > VERSION:
            raise InputError(
                f"{before}version = {show(version)}: this project was written by a later softstart, and this "
                f"one reads version {VERSION}; install that softstart. The file is unchanged."
            )
        if cut_off:
            last = show(text.rstrip().rpartition("\n")[2][:40])
            reason = "the file is cut off, as its last line is not that of a project"
            raise InputError(f"{before}last line {last}: {reason}; take a copy of it that is whole.")
        project, wrong = cls.from_toml(text, where=where), Mistakes()
        if not project.logo:
            return project
        with wrong.collect():
            project._derive(logo=_picture(project.logo, folder))
        wrong.raise_if_any(before)
        return project

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file, whole or not at all; what could not be read again is refused."""
        text = self.to_toml()
        type(self).read(text)
        write_whole(Path(path), lambda stream: stream.write(text))

    def to_toml(self) -> str:
        """The text of the file; the files in it as they are, between lines of three quotes."""
        text = super(Project, self.replace(version=VERSION)).to_toml()
        return FIRST + re.sub(r'^(file|notes) = (".*")$', _unfolded, text, flags=re.MULTILINE) + "\n" + LAST

    def __repr__(self) -> str:
        """One line with what is in it.

        >>> Project.new("crane-4amtkf")
        <Project: crane-4amtkf: 1 machine>
        """
        counts = {kind: len(getattr(self, rows)) for kind, rows in KINDS.items()}
        parts = [f"{n} {kind if n == 1 else KINDS[kind]}" for kind, n in counts.items() if n]
        return f"<Project: {self.name}: {', '.join(parts) or 'empty'}>"

    def blocks(self) -> Iterator[tuple[str, DocumentTable, ParameterSet]]:
        """Single tables first."""
        return iter(sorted(super().blocks(), key=lambda block: block[1].many))

    def added(self, name: str, thing: Machine | Duty | TorqueProfile | Controller | str) -> Self:
        """With a machine, strategy, profile or duty, or the text of its file; it replaces one of this name.

        >>> Project().added("steady", TorqueProfile([0.0], [62.0])).controller("steady").name
        'steady'
        """
        text = thing if isinstance(thing, str) else parts.file_of(thing)
        text = text.replace("\r\n", "\n")
        kind = parts.kind_of(text, name)
        if kind == "project":
            raise InputError(
                f"{name}: this is a project itself; add the files of its machines and strategies."
            )
        made = {"machine": StoredMachine, "strategy": StoredStrategy, "duty": StoredDuty}[kind]
        return self.with_part(made(name=name, file=text), KINDS[kind])

    def with_part(self, part: Any, rows: str = "optima") -> Self:
        """With a stored part, by default an optimum; it replaces one of its name."""
        others = [one for one in getattr(self, rows) if one.name != part.name]
        return self.replace(**{rows: (*others, part)})

    def without(self, name: str) -> Self:
        """Without the strategy or the optimum of this name, and the choice of it."""
        given = self.given()
        for rows in ("strategies", "optima"):
            given[rows] = [one for one in getattr(self, rows) if one.name != name]
        if self.strategy == name:
            given.pop("strategy", None)
        return type(self)(**given)

    def renamed(self, name: str, new: str) -> Self:
        """With another name of a strategy or an optimum.

        >>> steady = Project().added("steady", TorqueProfile([0.0], [62.0]))
        >>> steady.renamed("steady", "slow").strategies[0].name
        'slow'
        """
        return self.replace(
            **{
                rows: [one.replace(name=new) if one.name == name else one for one in getattr(self, rows)]
                for rows in ("strategies", "optima")
            },
            **({"strategy": new} if self.strategy == name else {}),
        )

    def contradictions(self) -> Iterator[str]:
        """What is wrong in the files that the project holds, and names that are given twice or to nothing."""
        wrong = Mistakes()
        for table, rows in KINDS.items():
            names = [one.name for one in getattr(self, rows)]
            for name in dict.fromkeys(one for one in names if names.count(one) > 1):
                yield f'[[{table}]] name = "{name}": the name is given twice; give one of them another.'
        for one in self.machines:
            with wrong.collect():
                known_from(one.file, f'machine "{one.name}"')
        for player in self.players:
            with wrong.collect():
                _ = player.controller
        for duty in self.duties:
            with wrong.collect():
                Duty.read_for(None, duty.file, f'duty "{duty.name}"')
        yield from wrong.sentences
        if not wrong.sentences:
            yield from self._names()

    def _names(self) -> Iterator[str]:
        """Sentences on names in the choice and in optima that nothing has."""
        wrong = Mistakes()
        machines, duties = [one.name for one in self.machines], [one.name for one in self.duties]
        if self.duty and self.duty not in duties:
            yield f'[choice] duty = "{self.duty}": the project has no such duty; {_meant(self.duty, duties)}'
        named = {"[choice] machine": self.machine, "[choice] beside": self.beside}
        of_optima = [(f'optimum "{one.name}", machine', name) for one in self.optima for name in one.machines]
        for key, name in (*named.items(), *of_optima):
            if name and name not in machines:
                yield f'{key} = "{name}": the project has no such machine; {_meant(name, machines)}'
        if self.strategy and self.strategy not in (known := self.strategy_names):
            reason = "neither the project nor softstart has this strategy"
            yield f'[choice] strategy = "{self.strategy}": {reason}; {_meant(self.strategy, known)}'
        if self.machine in machines and self.beside in machines:
            one, other = self.single(self.machine), self.single(self.beside)
            with wrong.collect():
                refuse_other_kind(one, other, "[choice] beside")
        yield from wrong.sentences

    @property
    def strategy_names(self) -> list[str]:
        """The names of all strategies that can be chosen: of the project, then of softstart."""
        own = [one.name for one in self.players]
        return list(dict.fromkeys([*own, *controller_names()]))

    @property
    def players(self) -> tuple[StoredStrategy | StoredOptimum, ...]:
        """What has a controller: own strategies, then optima."""
        return (*self.strategies, *self.optima)

    def stored(self, name: str = "") -> StoredMachine:
        """The file of a machine by its name, by default of the chosen one or the only one.

        >>> project = Project.new("crane-4amtkf", "hoist-15kw")
        >>> project.stored().name, project.stored("hoist-15kw").name
        ('crane-4amtkf', 'hoist-15kw')
        >>> Project(machines=project.machines).stored()
        Traceback (most recent call last):
        softstart.errors.InputError: the project has 2 machines ("crane-4amtkf", "hoist-15kw"), and none ...
        """
        files = {one.name: one for one in self.machines}
        name = name or self.machine
        if not (name or files):
            raise InputError("the project has no machine; load one on the page, or add a table [[machine]].")
        if not name and len(files) > 1:
            raise InputError(
                f"the project has {len(files)} machines ({', '.join(map(show, files))}), and none is chosen; "
                f"write [choice] machine = {show(next(iter(files)))} in its file, or choose one on the page."
            )
        if name and name not in files:
            raise InputError(
                f'[choice] machine = "{name}": the project has no such machine; {_meant(name, files)}'
            )
        return files[name or next(iter(files))]

    def single(self, name: str = "") -> Machine:
        """A machine by its name, by default the chosen one or the only one, with the duty chosen."""
        stored = self.stored(name)
        return self.with_duty(known_from(stored.file, f'machine "{stored.name}"'))

    def with_duty(self, machine: Machine, also: Mapping[str, object] | None = None) -> Any:
        """The machine with the duty that is chosen, if one is, after changes of the duty by path."""
        text = next((one.file for one in self.duties if one.name == self.duty), "")
        where, changed = f'duty "{self.duty}"', cast("Any", machine)
        return changed.replace(duty=Duty.read_for(machine, text, where, also)) if text else machine

    @property
    def name(self) -> str:
        """What it is called."""
        return self.project or self.machine or "a project"

    def summary(self) -> dict[str, Any]:
        """What is in it, as plain data."""
        choice = {key: getattr(self, key) for key in ("machine", "beside", "strategy", "duty")}
        names = {rows: [one.name for one in getattr(self, rows)] for rows in KINDS.values()}
        return {"project": self.project, "customer": self.customer, **names, "choice": choice}

    def controller(self, name: str = "") -> Controller:
        """A strategy by its name, by default the chosen one: of the project, or one of softstart."""
        own = {one.name: one for one in self.players}
        name = name or self.strategy
        return own[name].controller if name in own else make_controller(name)

    def source_of(self, path: str) -> str:
        """What the value of a parameter is from, "" if nothing is said."""
        source = next((one for one in self.sources if one.parameter == path), None)
        return ", ".join(filter(None, (source.origin, source.note))) if source else ""

    @property
    def lines(self) -> list[tuple[str, str]]:
        """Names for the head of page 1: what, and who or which."""
        last = self.revisions[-1] if self.revisions else Revision()
        named = {
            "Customer": self.customer,
            "Project": self.project,
            "Document": self.number,
            "Author": ", ".join(filter(None, (self.author, self.company))),
            "Revision": " of ".join(filter(None, (last.number, last.date))),
        }
        return [(what, value) for what, value in named.items() if value]


def _meant(name: str, known: Iterable[str]) -> str:
    """The name that was probably meant, or all that there are."""
    names = list(known)
    return did_you_mean(name, names, otherwise=f"it has {', '.join(names) or 'none'}.", quote='"')


def _unfolded(found: re.Match[str]) -> str:
    """A text of several lines as such; one that TOML has to escape stays as it is."""
    text = json.loads(found[2])
    plain = "\n" in text and "'''" not in text and not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", text)
    return f"{found[1]} = '''\n{text}'''" if plain and not text.endswith("'") else found[0]


def _picture(name: str, folder: Path) -> str:
    """A picture as a data URI, so that the report stays one file."""
    if not name or name.startswith("data:image/"):
        return name
    path, subject = folder / name, f'[project] logo = "{name}"'
    if path.suffix.lower() not in LOGOS:
        raise InputError(f"{subject}: this is no picture that a page can hold; give a PNG, JPEG or SVG file.")
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = f"the file cannot be read ({error.strerror or error})"
        raise InputError(f"{subject}: {reason}; it is looked for beside the project's file.") from None
    if len(data) > MOST_LOGO:
        raise InputError(f"{subject}: {len(data):,} bytes are too many; give {MOST_LOGO:,} bytes or less.")
    return f"data:{LOGOS[path.suffix.lower()]};base64,{base64.b64encode(data).decode('ascii')}"
