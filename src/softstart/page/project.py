"""The project of a page: made of what a session holds, and taken over by one. No NiceGUI here."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from softstart.chain.machines import known_from
from softstart.drive import Duty
from softstart.drive.machine import Machine
from softstart.errors import InputError
from softstart.page.duty import DutyPlan
from softstart.page.sentences import WORDS, changes
from softstart.project import Project
from softstart.project.parts import (
    StoredMachine,
    StoredStrategy,
    file_of,
    kind_of,
    refuse_longer,
    strategy_of,
)
from softstart.start.simulation import simulate
from softstart.views.numbers import cut

if TYPE_CHECKING:
    from softstart.page.session import Session

MAX_EVENTS = 200_000  # of the start of a profile that is loaded
LONGEST_LINE = 2000  # characters; a key of thousands of parts is read for many seconds
LONGEST_NAME = 60


def project_of(session: Session) -> Project:
    """The project as the page has it now, with its own strategies.

    The machine that is chosen is saved as it has been changed on the page.

    >>> from softstart.page.session import Session
    >>> session = Session("hoist-15kw")
    >>> session.set("shaft.gap", "7 deg")
    >>> again = Session(project_of(session))
    >>> again.inputs.machine == session.inputs.machine, again.inputs.selected == session.inputs.selected
    (True, True)
    """
    inputs = session.inputs
    project, machine = inputs.project, inputs.machine_with_duty
    name = project.machine or machine.name
    own = [label for label in inputs.controllers if label in (*session.added, *session.changed)]
    given = {key: value for key, value in project.given().items() if key != "duty"}  # the machine has it now
    bare, others = Project(**given), [one for one in project.machines if one.name != name]
    files = {name: machine.to_toml()} | {one.name: one.file for one in others}
    machines = {name: machine} | {one.name: bare.single(one.name) for one in others}

    def place_of(computed: Machine, label: str) -> str:
        """The name of the machine of an optimum, which is stored too where it has changed since."""
        same = (other for other, one in machines.items() if starts_alike(one, computed))
        if (place := next(same, "")) == "":
            place = f"{computed.name} for {label}"
            files[place], machines[place] = computed.to_toml(), computed
        return place

    optima = {}
    for one in project.optima:
        places = [place_of(bare.single(place), one.name) for place in one.machines]
        optima[one.name] = one.on(places)
    for label, (computed, claims) in inputs.optima.items():
        optima[label] = claims.on([place_of(computed, label)]).replace(name=label)
    return Project(
        **given | {
            "machine": name, "strategy": inputs.selected,
            "machines": [StoredMachine(name=place, file=file) for place, file in files.items()],
            "strategies": [
                *(one for one in project.strategies if one.name not in own),
                *(StoredStrategy(name=label, file=file_of(inputs.controllers[label]))
                  for label in own if label not in optima),
            ],
            "optima": optima.values(),
        }
    )  # fmt: skip


def other_machines(session: Session) -> list[str]:
    """The names of the machines of the project besides the present one."""
    project = session.inputs.project
    now = project.machine or session.inputs.machine.name
    return [one.name for one in project.machines if one.name != now]


def turn_to(session: Session, name: str) -> None:
    """Show another machine of the project; the present one stays in the project as it is now."""
    session.open(project_of(session).replace(machine=name))


def starts_alike(machine: Machine, other: Machine) -> bool:
    """Whether an optimum of one is an optimum of the other: names, units and limits change no start.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> [starts_alike(crane, crane.replace(**one)) for one in ({"permissible_torque": 80.0}, {"gap": 1.0})]
    [True, False]
    """
    changed = [one for one in changes(machine, other) if one.parameter.name not in WORDS]
    return type(machine) is type(other) and all(one.path.startswith("limits.") for one in changed)


def take_file(session: Session, content: bytes, name: str) -> str:
    """Take over a file that softstart has written, by what is in it; what has changed, as a sentence.

    A project, a machine or a data sheet takes the place of the present one; gains, settings and profiles
    join the strategies; a duty becomes that of the page.

    >>> from softstart.page.session import Session
    >>> session = Session()
    >>> take_file(session, b"time,torque\\n0,20\\n0.1,62\\n", "mine.csv")
    'mine joins the strategies.'
    >>> session.inputs.selected
    'mine'
    """
    return take_text(session, text_of(content, name), Path(name).stem, name)


def take_text(session: Session, text: str, label: str, where: str = "") -> str:
    """The same, of a text that was read or pasted."""
    where = where or label
    match kind_of(text, where):
        case "project":
            session.open(Project.read(text, where))
            return f"The project {cut(where)} is open."
        case "duty":
            duty = Duty.read_for(session.inputs.machine, text, where)
            session.set_duty(DutyPlan(duty.steps, duty.shift))
            return f"{cut(where)} is the duty."
        case "strategy":
            controller = strategy_of(text, " ".join(label.split())[:LONGEST_NAME])
            run = simulate(session.inputs.machine, controller, max_events=MAX_EVENTS)
            refuse_longer(run, f'strategy "{label}"')
            return f"{cut(session.add(label, controller))} joins the strategies."
        case _:
            session.load(machine_of(text, where))
            return f"{cut(session.inputs.machine.name)} is loaded."


def machine_of(text: str, where: str) -> Machine:
    """The drive, chain or data sheet of a text; InputError with a sentence for each mistake."""
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > LONGEST_LINE:
            reason = f"line {number} has more than {LONGEST_LINE} characters, as no drive file has"
            raise InputError(f"{where}: {reason}.")
    return known_from(text)


def text_of(content: bytes, name: str) -> str:
    """The text in the bytes of a file.

    >>> text_of(b"\\xff\\xfe", "mine.toml")
    Traceback (most recent call last):
    softstart.errors.InputError: mine.toml: the file is not UTF-8 text (line 1); save it as UTF-8.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        place = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{name}: the file is not UTF-8 text (line {place}); save it as UTF-8.") from None
