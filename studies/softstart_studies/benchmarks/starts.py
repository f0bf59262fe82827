"""`softstart study benchmark-starts`: starts a second of softstart and of its peers, as ratios of one run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, cast

from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import COLOURS, drawing, new_figure
from softstart_studies.benchmarks import contenders
from softstart_studies.benchmarks.contenders import ENTRIES
from softstart_studies.benchmarks.contest import Duel, Outcome, fight, rounded, shown
from softstart_studies.benchmarks.host import Child, Host
from softstart_studies.benchmarks.problem import crane_problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MANY = 150.0  # times LSODA, in every row
AGREEMENT = 1e-6  # in K_dyn, where nothing is sampled


def claims(outcomes: Sequence[Outcome]) -> list[Claim]:
    """One claim for each kind of duel that has been fought."""
    kernel = [
        one for one in outcomes if one.duel.ours == "kernel" and one.duel.peer in {"lsoda", "lsoda-restarted"}
    ]
    sampled = [one for one in outcomes if one.duel.peer == "lsoda-sampled"]
    single = [one for one in outcomes if one.duel.ours.startswith("run") and one.duel.peer == "lsoda"]
    staged = [one for one in outcomes if one.duel.peer in {"lsoda", "lsoda-restarted"}]
    found = []
    if kernel:
        found.append(_ratio_claim("In a batch, constant and staged torque, undamped and damped", kernel))
    if sampled:
        found.append(_ratio_claim("In a batch, a ramp sampled at 1 kHz", sampled))
    if single:
        found.append(_ratio_claim("One simulate call with its full Run", single))
    if staged:
        apart = [one.k_dyn_difference for one in staged]
        found.append(
            Claim(
                "LSODA at rtol 1e-8 has the same K_dyn within 1e-6.",
                Verdict.of(*(value <= AGREEMENT for value in apart)),
                f"Largest difference: {max(apart):.1e}.",
            )
        )
    return found


def _ratio_claim(what: str, outcomes: Sequence[Outcome]) -> Claim:
    wanted = max(one.duel.wanted or 0.0 for one in outcomes)
    ratios = ", ".join(f"{one.duel.strategy} ({one.duel.ours}) {shown(one.ratio)}" for one in outcomes)
    return Claim(
        f"{what}: at least {wanted:,.0f} times as many starts a second as LSODA with located events.",
        Verdict.of(*(one.ratio >= (one.duel.wanted or 0.0) for one in outcomes)),
        f"Ratio: {ratios}.",
    )


__all__ = ["BenchmarkStarts"]

PASSES = 7
# as many starts as make a pass last about a tenth of a second or two
DUELS = (
    Duel("direct", "lsoda", 20, "kernel", 4_000, MANY),
    Duel("reduced-first-stage", "lsoda", 20, "kernel", 4_000, MANY),
    Duel("reduced-two-stage", "lsoda", 20, "kernel", 4_000, MANY),
    Duel("damped direct", "lsoda-restarted", 20, "kernel", 4_000, MANY),
    Duel("damped reduced-two-stage", "lsoda-restarted", 20, "kernel", 4_000, MANY),
    Duel("ramp", "lsoda-sampled", 2, "kernel", 2_000, MANY),
    Duel("damped ramp", "lsoda-sampled", 2, "kernel", 2_000, MANY),
    Duel("direct", "lsoda", 20, "formula", 50_000),
    Duel("direct", "lsoda", 20, "batch", 4_000),
    Duel("direct", "lsoda", 20, "run", 200, 20.0),
    Duel("direct", "lsoda", 20, "run-traces", 200, 20.0),
    Duel("direct", "control", 4, "run-traces", 200),
    Duel("direct", "control-tight", 4, "run-traces", 200),
    Duel("direct", "diffrax", 1_000, "kernel", 4_000),
)
MISSING = "not installed: pip install 'softstart[benchmark]'"
TITLE = "Starts a second, by processor time of one core"
# short, so that a terminal holds them; the table of contenders says what the names mean
COLUMNS = ("strategy", "peer", "softstart", "peer 1/s", "ours 1/s", "ratio", "wanted", "K_dyn diff.")


class BenchmarkStarts(Study):
    """Constant, staged and sampled torque on the crane drive of [G]: scipy, python-control, diffrax and we.

    Every contender works in a process of its own, bound to one processor and one thread. Rates are by the
    process's own processor time, since the machine may have other work; the two of a row take turns.

    >>> BenchmarkStarts.name, BenchmarkStarts.pictures
    ('benchmark-starts', ('benchmark-starts-ratios',))
    """

    name: ClassVar[str] = "benchmark-starts"
    title: ClassVar[str] = "Speed and memory beside scipy, python-control and diffrax, as ratios of one run"
    pictures: ClassVar[tuple[str, ...]] = ("benchmark-starts-ratios",)

    def __init__(
        self, duels: Sequence[Duel] = DUELS, passes: int = PASSES, host: Callable[[], Host] = Child
    ) -> None:
        self.duels, self.passes, self.host = tuple(duels), passes, host

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All duels, about half a minute; nothing is written to `out`."""
        results: list[Outcome | None] = []
        memories: dict[str, float | None] = {}
        with ExitStack() as stack:
            hosts: dict[str, Host] = {}

            def host_of(name: str) -> Host:
                package = ENTRIES[name].package
                if package not in hosts:
                    hosts[package] = self.host()
                    stack.callback(hosts[package].close)
                return hosts[package]

            for number, duel in enumerate(self.duels, start=1):
                peer = ENTRIES[duel.peer]
                if contenders.installed(duel.peer) is None:
                    progress(f"{number}/{len(self.duels)} {duel.strategy}: {peer.package} {MISSING}")
                    results.append(None)
                    continue
                progress(f"{number}/{len(self.duels)} {duel.strategy}: {peer.package}, {peer.how}")
                problem = crane_problem(duel.strategy)
                results.append(fight(duel, problem, host_of(duel.peer), host_of(duel.ours), self.passes))
            for package, host in hosts.items():
                memories[package] = host.memory()
        rows = list(zip(self.duels, results, strict=True))
        measured = [result for result in results if result is not None]
        return StudyResult(
            tables=(
                Table(TITLE, COLUMNS, [_row(*row) for row in rows]),
                _contender_table(self.duels),
                _process_table(self.duels, measured, memories),
                _condition_table(self.passes, measured),
            ),
            claims=claims(measured),
            figures={self.pictures[0]: ratio_figure(measured)},
        )


def _row(duel: Duel, outcome: Outcome | None) -> tuple[object, ...]:
    names = (duel.strategy, duel.peer, duel.ours)
    if outcome is None:
        return (*names, None, None, None, duel.wanted, None)
    rates = (rounded(outcome.peer_rate), rounded(outcome.our_rate), rounded(outcome.ratio))
    return (*names, *rates, duel.wanted, float(f"{outcome.k_dyn_difference:.1e}"))


def _contender_table(duels: Sequence[Duel]) -> Table:
    """What the names in the first table stand for; a missing peer's row says how to get it."""
    rows = []
    for name in dict.fromkeys(name for duel in duels for name in (duel.ours, duel.peer)):
        entry, version = ENTRIES[name], contenders.installed(name)
        rows.append((name, f"{entry.package} {version or ''}".strip(), entry.how if version else MISSING))
    return Table("Contenders", ("name", "package", "how it is used"), rows)


def _process_table(
    duels: Sequence[Duel], outcomes: Sequence[Outcome], memories: dict[str, float | None]
) -> Table:
    """One row a process: its largest memory and batch, and the longest first pass."""
    rows = []
    for package, memory in memories.items():
        first = [one.peer_prepared for one in outcomes if ENTRIES[one.duel.peer].package == package]
        sizes = [(d.peer_starts, d.peer) for d in duels] + [(d.our_starts, d.ours) for d in duels]
        largest = max(count for count, name in sizes if ENTRIES[name].package == package)
        rows.append(
            (
                f"{package} {contenders.version_of(package)}",
                None if memory is None else round(memory),
                largest,
                rounded(max(first)) if first else None,
            )
        )
    return Table("Processes", ("process", "memory, MiB", "largest batch", "first pass, s"), rows)


def _condition_table(passes: int, outcomes: Sequence[Outcome]) -> Table:
    clock = max((abs(one.wall_ratio / one.ratio - 1.0) for one in outcomes), default=0.0)
    rows = [
        ("rates", "starts a second of processor time, medians of the passes"),
        ("ratios by the clock instead", f"differ by {clock:.1%} at most"),
        ("memory", "largest of the whole process, interpreter and libraries included"),
        ("first pass", "imports and compiling included; not in the rates"),
        ("processors and threads used", "one, one"),
        ("passes, in turns", passes),
    ]
    return contenders.condition_table(rows, ("numpy", "scipy", "numba", "control", "jax", "diffrax"))


SHORT = {
    "kernel": "kernel, batch",
    "formula": "closed form, arrays",
    "batch": "simulate, batch",
    "run": "simulate, Run",
    "run-traces": "simulate, Run with traces",
    "lsoda": "LSODA",
    "lsoda-restarted": "LSODA, each stage",
    "lsoda-sampled": "LSODA, each sample",
    "control": "control, defaults",
    "control-tight": "control, 1e-8",
    "diffrax": "diffrax, vmapped batch",
}


def ratio_figure(outcomes: Sequence[Outcome]) -> Figure:
    """One bar a row of the table, coloured by peer; a black tick where a ratio was wanted."""
    packages = list(dict.fromkeys(ENTRIES[one.duel.peer].package for one in outcomes))
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 1.4 + 0.42 * len(outcomes)))
        for place, one in enumerate(outcomes):
            package = ENTRIES[one.duel.peer].package
            axes.barh(place, one.ratio, height=0.66, left=0.0, color=COLOURS[packages.index(package)])
            # at the right edge, where no bar and no tick can cross it
            axes.annotate(
                shown(one.ratio), (1.0, place), xycoords=("axes fraction", "data"), ha="right", va="center"
            )
            if one.duel.wanted is not None:
                axes.plot([one.duel.wanted] * 2, [place - 0.42, place + 0.42], color="black", lw=1.8)
        axes.set_xscale("log")
        wanted = [one.duel.wanted or 1.0 for one in outcomes]
        axes.set_xlim(1.0, 10.0 * max([1.0, *wanted, *(one.ratio for one in outcomes)]))
        axes.set_yticks(range(len(outcomes)))
        axes.set_yticklabels(
            [f"{one.duel.strategy}:  {SHORT[one.duel.ours]} : {SHORT[one.duel.peer]}" for one in outcomes]
        )
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("starts/s of softstart : starts/s of the peer     (black tick: wanted)")
        axes.set_title("Same starts, same end, one core, in one run", loc="left")
    return cast("Figure", figure)
