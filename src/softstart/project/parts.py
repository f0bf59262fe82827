"""What a project holds: whole files of machines, strategies and duties by name, and answers of optima."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from softstart.controller.base import Controller
from softstart.controller.finding import controller_of, make_controller, named
from softstart.controller.tuned import ScheduleFile, Tuned, read_gains, strategy_text
from softstart.drive import Duty, Machine
from softstart.errors import InputError
from softstart.input.documents import kind_of_document, parsed
from softstart.input.parameter_set import MaybeNumber, MaybeSeries, Number, ParameterSet, parameter
from softstart.input.parameters import REQUIRED, Wording
from softstart.profile import TorqueProfile

if TYPE_CHECKING:
    from softstart.optimal.result import Optimum
    from softstart.start.run import Run

LONGER = 1.01  # times the end of the start: an optimum ends with it, but for the accuracy of its end


def _text(path: str, meaning: str, example: str, default: object = REQUIRED, **more: Any) -> Any:
    return parameter(path, "", meaning, example, default=default, **more)


def _name(table: str) -> Any:
    return parameter(f"{table}.name", "", "name in the project", '"crane"', "one line")


def _file(table: str) -> Any:
    return _text(f"{table}.file", "text of its file", "'''...'''")


class StoredMachine(ParameterSet, what="a machine of a project"):
    """The file of a machine."""

    name: str = _name("machine")
    file: str = _file("machine")


class StoredStrategy(ParameterSet, what="a strategy of a project"):
    """The file of tuned gains, settings, or a torque profile."""

    name: str = _name("strategy")
    file: str = _file("strategy")

    @property
    def controller(self) -> Controller:
        """The controller under its name in the project."""
        return strategy_of(self.file, self.name)


class StoredDuty(ParameterSet, what="a duty of a project"):
    """The file of a duty."""

    name: str = _name("duty")
    file: str = _file("duty")


class StoredOptimum(ParameterSet, what="an optimum of a project"):
    """The answer of an optimum with its claims, so that it can be checked on the exact machine.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    InputError
        With a sentence for each mistake.

    Examples
    --------
    >>> from softstart import Drive, optimize
    >>> crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> stored = StoredOptimum.of(optimize(crane, 0.2883042), "lowest", "crane")
    >>> [round(run.k_dyn, 4) for run in stored.checked(crane)]
    [0.9092]

    References
    ----------
    docs/howto/keep-a-project.md.
    """

    # fmt: off
    name: str = _name("optimum")
    machine: str = _text("optimum.machine", "name of its machine in the project", '"crane"')
    end_time: Number = parameter("optimum.end_time", "s", "time at which the start has ended", "0.288",
        "above 0")
    claimed: Number = parameter("optimum.claimed", "1", "figure that was minimised", "0.909", "0 or more")
    minimise: str = _text("optimum.minimise", "what was minimised", '"k_dyn"', "k_dyn",
        choices=("k_dyn", "heat", "start_time"))
    terminal: str = _text("optimum.terminal", "what holds at its end", '"reached"',
        choices=("synchronous", "steady", "reached"))
    start_time: MaybeNumber = parameter("optimum.start_time", "s", "bound on the start time", "0.288",
        "above 0", default=None)
    k_dyn: MaybeNumber = parameter("optimum.k_dyn", "1", "bound on K_dyn", "1.2", "above 0", default=None)
    heat: MaybeNumber = parameter("optimum.heat", "s", "bound on the heat", "0.2", "above 0", default=None)
    bound: Number = parameter("optimum.bound", "1", "K_dyn that no start of its class goes below", "0.909",
        "0 or more", default=0.0)
    bound_kind: str = _text("optimum.bound_kind", "how the bound is proved", '"momentum"', "none",
        choices=("duality", "momentum", "none"))
    bound_covers: str = _text("optimum.bound_covers", "starts for which it is proved", '"every torque"', "")
    others: str = _text("optimum.others", "names of other machines that its torque serves, one a line",
        '"crane worn"', "")
    base: str = _text("optimum.base", "machine to whose mean torque K_dyn refers, if another",
        '"crane"', "")
    curve_speed: MaybeSeries = parameter("optimum.curve_speed", "rad/s", "speeds of a torque-speed curve",
        "[0.0, 60.0, 100.0]", default=None, many=True)
    curve_torque: MaybeSeries = parameter("optimum.curve_torque", "N*m", "torques that it allows there",
        "[62.0, 62.0, 22.0]", default=None, many=True)
    file: str = _file("optimum")
    # fmt: on

    @classmethod
    def of(
        cls, best: Optimum, name: str, machine: str, others: Sequence[str] = (), base: str = ""
    ) -> StoredOptimum:
        """An optimum of this machine of the project; `others` are the names of its further machines there."""
        problem = best.problem
        if (len(others), bool(base)) != (len(problem.scenarios), problem.base is not None):
            further = f"{len(problem.scenarios)} further machines{' and a base' if problem.base else ''}"
            raise InputError(
                f'optimum "{name}": it was computed with {further}; name these of the project (others, base).'
            )
        speeds, torques = zip(*problem.torque_speed, strict=True) if problem.torque_speed else (None, None)
        return cls(
            name=name, machine=machine, end_time=best.end_time, claimed=best.minimised,
            minimise=problem.minimise, terminal=problem.terminal, start_time=problem.start_time,
            k_dyn=problem.k_dyn, heat=problem.heat, bound=best.bound.k_dyn, bound_kind=best.bound.kind,
            bound_covers=best.bound.covers, others="\n".join(others), base=base, curve_speed=speeds,
            curve_torque=torques, file=best.profile.toml_text(),
        )  # fmt: skip

    def contradictions(self) -> Iterator[str]:
        """A sentence on a curve of which speeds and torques do not belong together."""
        speeds, torques = self.curve_speed or (), self.curve_torque or ()
        if len(speeds) != len(torques):
            yield f"curve_speed has {len(speeds)} values, curve_torque {len(torques)}; give as many of each."

    @property
    def machines(self) -> tuple[str, ...]:
        """The names of all its machines: its own, the others, and the base if there is one."""
        return (self.machine, *self.others.splitlines(), *([self.base] if self.base else []))

    def on(self, machines: Sequence[str]) -> Self:
        """The same optimum, its machines called by these names."""
        own, *others = machines
        base = others.pop() if self.base else ""
        return self.replace(machine=own, others="\n".join(others), base=base)

    @property
    def profile(self) -> TorqueProfile:
        """Its torque."""
        return TorqueProfile.read(self.file, ".toml", f'optimum "{self.name}"')

    @property
    def controller(self) -> Controller:
        """What plays it."""
        return player_of(self.profile, self.name)

    def checked(self, machine: Machine, *others: Machine) -> tuple[Run, ...]:
        """Its starts on the exact `machines`; OptimumError where a claim or a bound does not hold there."""
        from softstart.optimal.check import check, replayed
        from softstart.optimal.problem import Problem
        from softstart.optimal.result import LowerBound

        choices: Any = {"minimise": self.minimise}
        problem = Problem(
            machine, self.start_time, self.terminal, k_dyn=self.k_dyn, heat=self.heat,
            torque_speed=tuple(zip(self.curve_speed or (), self.curve_torque or (), strict=True)),
            scenarios=others[:-1] if self.base else others, base=others[-1] if self.base else None, **choices,
        )  # fmt: skip
        kind: Any = self.bound_kind
        runs = replayed(problem, self.profile, self.end_time)
        bound = LowerBound(self.bound, kind, self.bound_covers)
        check(problem, self.profile, runs, self.end_time, self.claimed, bound)
        return runs


def player_of(profile: TorqueProfile, label: str) -> Controller:
    """The controller that plays a profile, under this name in tables.

    >>> player_of(TorqueProfile([0.0], [62.0]), "mine").name
    'mine'
    """
    return named(make_controller("profile", {"profile": profile}), label)


def strategy_of(text: str, name: str) -> Controller:
    """The tuned gains, the settings or the player of the torque profile of a file, called `name`.

    >>> strategy_of("time,torque\\n0,20\\n0.1,62\\n", "mine").profile.torque.tolist()
    [20.0, 62.0]
    """
    where, toml = f'strategy "{name}"', is_toml(text)
    if toml and "kind" in parsed(text, Wording(where, style="toml"), "a strategy"):
        path = Path(name)
        saved = read_gains(text, path)
        if not isinstance(saved, ScheduleFile) and "file" in saved.parameters:
            raise InputError(
                f"{where}: [parameters] file names another file; give the torque profile itself."
            )
        try:
            return controller_of(saved, path, _label_in(name, saved.controller))
        except InputError as error:
            raise InputError([one.replace("controller =", "strategy =") for one in error.sentences]) from None
    return player_of(TorqueProfile.read(text, ".toml" if toml else ".csv", where), name)


def renamed(controller: Controller, label: str) -> Controller:
    """The same own strategy under another name: gains, settings or the player of a profile.

    >>> renamed(player_of(TorqueProfile([0.0], [62.0]), "mine"), "slow").name
    'slow'
    """
    if isinstance(controller, Tuned):
        return replace(controller, label=_label_in(label, controller.controller.name))
    return controller if profile_of(controller) is None else named(copy(controller), label)


def _label_in(name: str, controller: str) -> str:
    """The label of gains that are called so in tables: "robust" of "ramp (robust)"."""
    inner = re.fullmatch(rf"{re.escape(controller)} \((.+)\)", name)
    return inner[1] if inner else name


def profile_of(controller: Controller) -> TorqueProfile | None:
    """The torque profile that a controller plays; None for one that plays none.

    >>> profile_of(make_controller("direct")) is None
    True
    """
    profile = getattr(controller, "played", None)
    return profile if isinstance(profile, TorqueProfile) else None


def refuse_longer(run: Run, subject: str) -> None:
    """InputError where the profile that is played in this start goes on after it; `subject` begins it."""
    profile = None if run.controller is None else profile_of(run.controller)
    if profile is not None and (end := profile.simplified().end) > LONGER * run.end_time:
        raise InputError(
            f'{subject}: its torque changes until {end:.4g} s, and the start of "{run.drive.name}" '
            f"has ended at {run.end_time:.4g} s; shorten the profile, or correct the unit of its time."
        )


def file_of(thing: Machine | Duty | TorqueProfile | Controller) -> str:
    """The text of the file of a machine, duty, profile or strategy, as `softstart` writes it.

    Of a profile that is played with a sample period it has the samples, whose start is the same.
    """
    if isinstance(thing, TorqueProfile):
        return thing.toml_text()
    if not isinstance(thing, Controller):
        return thing.to_toml()
    if (profile := profile_of(thing)) is None:
        return strategy_text(thing)
    if (period := float(getattr(thing, "period", None) or 0.0)) > 0.0:
        if profile.after_contact is not None:
            raise InputError(
                f'strategy "{thing.name}": a profile that waits for the contact cannot be kept with a sample '
                "period; set the period to 0."
            )
        profile = profile.sampled(period)
    return profile.toml_text()


def is_toml(text: str) -> bool:
    """Whether a text is meant as TOML: a line of it is a table or gives a key its value."""
    return re.search(r"^\s*(\[+[\w. \"-]+\]+|[\w\"-]+\s*=.*)\s*(#.*)?$", text, re.MULTILINE) is not None


def kind_of(text: str, where: str) -> str:
    """What the text of a file is: "project", "strategy", "duty", or else "machine".

    >>> [kind_of(text, "") for text in ("[[duty]]", "time,torque", "[motor]", "version = 1")]
    ['duty', 'strategy', 'machine', 'project']
    """
    if not is_toml(text):
        return "strategy"
    return kind_of_document(parsed(text, Wording(where, style="toml"), "a machine"))
