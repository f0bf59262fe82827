"""`softstart clutch` and `balance`: engagements of a clutch, and what an engine shakes its mounts with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from softstart.balancing import Engine
from softstart.balancing import balance as compute
from softstart.cli import options
from softstart.cli.completion import one_of
from softstart.cli.options import command, count, option
from softstart.cli.running import Output, answers, working
from softstart.clutch import LAWS, Clutch, engage
from softstart.clutch.laws import read_law
from softstart.errors import InputError
from softstart.hints import did_you_mean
from softstart.input.parameters import bare
from softstart.quantities import to_si

DEFAULT_POINTS = 8


def _read_law(text: str, option: str) -> dict[str, Any]:
    """The parameters of a clutch with this law: a name, or a file."""
    if text in LAWS:
        return {"law": text, "law_times": None, "law_torques": None}
    if "." not in text and "/" not in text:
        raise InputError(f'{option} = "{text}": there is no such law; {did_you_mean(text, LAWS)}')
    times, torques = read_law(text)
    return {"law": "table", "law_times": times, "law_torques": torques}


@command("clutch")
@option("--law", _read_law, shell_complete=one_of(lambda: LAWS))
@options.until_option
@option("--optimal", is_flag=True)
@option("--points", count(1, 200))
@option("--nondecreasing", is_flag=True)
@options.of_file(Clutch, "paper-c")
@answers(out=True)
def clutch_command(
    *, clutch: Clutch, law: dict[str, Any] | None, until: float | None, optimal: bool, points: int | None,
    nondecreasing: bool,
) -> Output:  # fmt: skip
    """Simulate a clutch engagement: peak shaft torque, friction work, slip time.

    CLUTCH is a TOML file or the name of a shipped clutch; by default that of the literature. The driving side
    turns at constant speed. With --optimal, the optimal engagement laws for its engagement time are computed.

    Options
    -------
    --law NAME|FILE
        Engagement law: linear, quadratic-concave, quadratic-convex, exponential, or a CSV file of time
        and friction torque. Default: that of the clutch file.
    --optimal
        Compute the laws with the lowest friction work for a given peak shaft torque, with bounds.
    --points N
        With --optimal: number of peak torques. Default: 8.
    --nondecreasing
        With --optimal: only laws whose friction torque never decreases.
    --set KEY=VALUE
        Change a parameter of the clutch, for example clutch.engagement_time='0.5 s' or shaft.gap='1 deg'.
        May be repeated.
    --out DIR
        Write figures (SVG, PNG), tables and traces (CSV) and report.md into this folder.
    """
    if optimal and until is not None:
        raise InputError("--until: optimal laws are followed to the lock-up; leave it out with --optimal.")
    if not optimal and (points is not None or nondecreasing):
        what = "--nondecreasing" if points is None else f'--points = "{points}"'
        raise InputError(f"{what}: this is for the optimal laws; add --optimal.")
    clutch = clutch.replace(**law) if law else clutch
    from softstart.study import find_study

    if not optimal:
        return engage(clutch, until=until)
    study: Any = find_study("paper-c")
    with working("optimizing the law ...") as progress:
        law_class, most = "nondecreasing" if nondecreasing else "any", points or DEFAULT_POINTS
        front = study.optimize_engagement(clutch, most, law_class=law_class, progress=progress)
    return front.summary, front.sheet


def _read_speeds(texts: Sequence[str], option: str) -> list[float] | None:
    """The speeds in rad/s; None if none was given.

    >>> [round(speed, 3) for speed in _read_speeds(["4500rpm", "100 rad/s"], "--speed")]
    [471.239, 100.0]
    """
    speeds = [float(to_si(text, "rad/s", name=option)) for text in texts]
    for text, speed in zip(texts, speeds, strict=True):
        if not speed > 0.0:
            raise InputError(f'{option} = "{text}": a speed above 0, as 4500rpm.')
        if bare(text):
            both = f'write "{text} rpm" or, if rad/s is meant, "{text} rad/s"'
            raise InputError(f'{option} = "{text}": no unit; {both}.')
    return speeds or None


@command("balance")
@option("--speed speeds", _read_speeds, multiple=True)
@options.of_file(Engine, "vaz-11113")
@answers(out=True)
def balance_command(*, engine: Engine, speeds: list[float] | None) -> Output:
    """Compute forces and moments of a piston engine by order, and design a balancer.

    ENGINE is a TOML file or the name of a shipped engine; by default the two-cylinder engine VAZ-11113 of the
    literature, some of whose parameters are assumed. The two-shaft balancer is tuned at one speed,
    balancer.tuning_speed; a first-order couple is balanced by a shaft with two opposite imbalances. The
    pressure ([cycle]) is only needed for the gas torque.

    Options
    -------
    --speed SPEED
        Speed to show, for example 4500rpm. May be repeated. Default: round values over the speed range.
    --set KEY=VALUE
        Change a parameter of the engine, for example masses.reciprocating='0.6 kg' or operation.load=0.5.
        May be repeated.
    --out DIR
        Write figures (SVG, PNG), tables (CSV) and report.md into this folder.
    """
    return compute(engine, speeds)
