"""Panels without a browser: a job is followed to its one end, a closed tab leaves nothing behind."""

from __future__ import annotations

import gc
import inspect
import itertools
import math
import weakref
from collections.abc import Iterator
from typing import Any

import pytest

from softstart import DataSheet, Drive, InputError
from softstart.controller import make_controller
from softstart.page.jobs import Jobs, JobState
from softstart.page.project import machine_of
from softstart.page.session import Session
from softstart.page.tasks import TaskResult

pytest.importorskip("nicegui", reason="NiceGUI is missing: pip install 'softstart[ui]'")


@pytest.fixture
def client() -> Iterator[Any]:
    """A tab that is never opened."""
    from nicegui import Client
    from nicegui.page import page

    with Client(page("/never-opened")) as client:
        yield client
    if not client.is_deleted:
        client.delete()


class Hasty:
    """A job that ends in its thread when somebody has read its state so often."""

    def __init__(self) -> None:
        self._state, self.result, self.sentences = JobState.RUNNING, None, ()
        self.share, self.message, self.ahead, self.stopping = None, "", 0, False
        self.looks, self.clock = -1, itertools.count()
        self.machine, self.estimate = None, 1.0

    @property
    def seconds(self) -> float:
        return next(self.clock)  # another second at each look

    @property
    def state(self) -> JobState:
        state = self._state
        self.looks -= 1
        if self.looks == 0:
            self.end()
        return state

    def end(self) -> None:
        self.result, self._state = TaskResult("the result"), JobState.DONE


class Queue(Jobs):
    def begin(self, *args: Any, **keywords: Any) -> Any:
        return Hasty()


def panel_of(jobs: Jobs, user: str = "A") -> Any:
    """A panel that lists the results that it has shown."""
    from softstart.page.job_panel import JobPanel

    class Panel(JobPanel):
        name, about = "it", ""

        def task(self) -> tuple[Any, ...]:
            return (print,)

        def estimate(self) -> float:
            return 20.0

        def show(self, result: TaskResult) -> None:
            super().show(result)
            given.append(result.html)

    given: list[str] = []
    panel = Panel(Session(controllers=["direct"]), user, jobs)
    panel.given = given
    return panel


def test_a_panel_tells_beforehand_how_long_it_takes(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """As estimated; then as the last job took, whose estimate was 20 s and which took half a minute."""
    from softstart.page.job_panel import JobPanel

    monkeypatch.setattr(JobPanel, "took", {})
    panel = panel_of(Queue())
    assert panel.takes() == "Takes 20 s to 40 s; can be cancelled."
    panel.start()
    assert panel._takes.text == ""  # its state says how long it has taken
    monkeypatch.setattr(Hasty, "seconds", 30.0)
    panel.job.end()
    panel.refresh()
    assert panel.takes() == "Takes about 30 s; can be cancelled."


# seconds of a processor (Xeon of 2020) that the tasks took; the tractor has 15 masses
MEASURED = {
    "OptimumPanel": {"crane-4amtkf": 0.42, "hoist-15kw": 0.92, "conveyor-11kw": 1.42,
                     "nordin-servo-60kw": 2.24, "servo-axis-small": 2.24,
                     "crane-4amtkf-light": 3.85, "crane-4amtkf-worn": 7.43,
                     "crane-4amtkf-light-worn": 9.54, "long-travel-3kw": 9.37, "crane-4-mass": 46.8},
    "ParetoPanel": {"crane-4amtkf": 7.4, "hoist-15kw": 11.5, "conveyor-11kw": 18.2},
    "ChecksPanel": {"nordin-servo-60kw": 0.7, "long-travel-3kw": 0.7, "tractor-like": 7.5},
    "TuningPanel": {"conveyor-11kw": 3.0 * 1.09 * 12.0, "crane-4amtkf": 3.0 * 1.12 * 12.0},
    "BesidePanel": {"long-travel-3kw": 0.7, "tractor-like": 5.4},
    "ParameterSheetPanel": {"long-travel-3kw": 0.95, "tractor-like": 1.3},
    "ProgramPanel": {"crane-4amtkf": 0.65, "long-travel-3kw": 1.08},
    "LogPanel": {"conveyor-11kw": 2.1, "long-travel-3kw": 2.2},
    "ReportPanel": {"crane-4amtkf": 22.0, "hoist-15kw": 24.0, "conveyor-11kw": 29.0},  # of a clock
}  # fmt: skip


@pytest.mark.parametrize("name", MEASURED)
def test_the_time_that_is_told_is_that_of_shipped_machines(client: Any, name: str) -> None:
    from softstart.page import files_panel, panels

    kind = getattr(panels, name, None) or getattr(files_panel, name)
    for machine, seconds in MEASURED[name].items():
        with client:
            least, most = (
                kind(Session(machine, ["direct"]), "A", Queue()).estimate() * one for one in kind.spread
            )
        assert max(least, 1.0) <= max(seconds, 1.0) <= max(most, 1.0), machine


@pytest.mark.parametrize("looks", [1, 2, 3, 4, 5])
def test_a_job_that_ends_under_the_eyes_gives_its_result_once(client: Any, looks: int) -> None:
    panel = panel_of(Queue())
    panel.start()
    panel.job.looks = looks
    for _ in range(looks + 2):
        panel.refresh()
    assert panel.given == ["the result"]
    assert panel.go.enabled


def test_a_job_is_followed_in_every_tab_of_its_user(client: Any) -> None:
    """Its one result; `mine` is the tab in which it was started."""
    jobs = Queue()
    first, second, other = panel_of(jobs), panel_of(jobs), panel_of(jobs, "B")
    first.start()
    job = first.job
    second.refresh()
    other.refresh()
    assert (first.mine, second.mine, second.busy) == (True, False, True)
    assert job.machine is first.session.inputs.machine
    assert other.job is None
    second.start()  # one at a time at one place
    assert second.job is job
    job.end()
    late = panel_of(jobs)  # the page was loaded anew
    for panel in (first, second, late, other) * 2:
        panel.refresh()
    assert [panel.given for panel in (first, second, late)] == [["the result"]] * 3
    assert other.given == []
    assert not late.mine


def test_a_closed_tab_keeps_no_session(client: Any) -> None:
    """The web framework remembers the function of each upload's route."""
    from softstart.page.files_panel import DriveFiles

    session = Session(controllers=["direct"])
    DriveFiles(session, "A")
    kept = weakref.ref(session)
    del session
    gc.collect()
    assert kept() is not None
    client.delete()
    gc.collect()
    assert kept() is None


def test_a_file_of_mistakes_is_told_in_some_sentences_and_read_at_once() -> None:
    from softstart.page.files_panel import LARGEST
    from softstart.page.panel_parts import MOST_SENTENCES, few

    with pytest.raises(InputError) as told:
        machine_of("\n".join(f"k{k} = 1" for k in range(5000)), "mine.toml")
    missing = 7  # keys that a drive needs
    said = few(told.value.sentences)
    assert len(said) == MOST_SENTENCES + 1
    assert said[-1].startswith(f"There are {5000 + missing - MOST_SENTENCES:,} more")
    with pytest.raises(InputError, match="line 1 has more than 2000 characters"):  # it would be read for 14 s
        machine_of("a." * (LARGEST // 2 - 2) + "b=1", "mine.toml")
    named = Drive.load("crane-4amtkf").replace(name="Crane" * 24)
    assert machine_of(named.to_toml(), "mine.toml") == named


def test_a_data_sheet_without_stiffness_is_loaded_with_both_its_ends(client, monkeypatch) -> None:
    """From a file and from the form: what tuning, checks and report are asked for is both."""
    from softstart.page import panels
    from softstart.page.data_sheet_panel import DataSheetPanel

    text = """load = { machine = "rotor", inertia = "160 kg*m^2", friction = "80 N*m" }
    motor = { rated_power = "3 kW", rated_speed = "1410 rpm", inertia = "0.0062 kg*m^2" }
    gear = { ratio = 38.1, backlash = "9 arcmin" }"""
    drive = machine_of(text, "sheet.toml")
    assert [one.Omega / math.tau for one in (drive, drive.soft)] == pytest.approx([30.0, 3.0], rel=1e-12)
    session = Session(controllers=["direct"])
    with client:
        panel = DataSheetPanel(session, "A")
        monkeypatch.setattr(panel, "sheet", lambda: DataSheet.from_toml(text))
        panel._use()
        assert session.inputs.machine_in_units == drive
        tuning, checks = panels.TuningPanel(session, "A", Queue()), panels.ChecksPanel(session, "A", Queue())
        assert drive in tuning.task()
        assert drive in checks.task()


def test_a_decimal_comma_in_a_list_is_read_or_refused_and_never_two_values() -> None:
    from softstart.page.panels import grid_of

    crane = Drive.load("crane-4amtkf")
    assert grid_of(crane, "0,5x; 1", "0,35; 4x") == ([0.25, 1.0], [0.35, 0.7])
    with pytest.raises(InputError) as told:
        grid_of(crane, "0,5x, 1x", "0,35")
    assert [sentence.split(":")[0] for sentence in told.value.sentences] == [
        'Gaps = "0,5x, 1x"',
        'Load inertias = "0,35"',
    ]


def test_each_panel_asks_for_a_task_with_its_fields(client: Any) -> None:
    """As pressed at once, with the defaults of all fields: a function that takes these arguments."""
    from softstart.page import files_panel, panels

    session = Session("crane-4amtkf", controllers=["direct"])
    classes = (panels.OptimumPanel, panels.ParetoPanel, panels.ChecksPanel, panels.TuningPanel)
    for panel in (*classes, files_panel.ReportPanel):
        function, *arguments = panel(session, "A", Queue()).task()
        inspect.signature(function).bind(*arguments, progress=None)
    log = panels.LogPanel(session, "A", Queue())
    log.take(b"time,torque\n", "rig.csv")
    function, *arguments = log.task()
    inspect.signature(function).bind(*arguments, progress=None)


def test_an_optimum_of_another_machine_is_not_added(client: Any) -> None:
    from softstart.page.panels import OptimumPanel

    session = Session("crane-4amtkf", controllers=["direct"])
    panel = OptimumPanel(session, "A", Queue())
    panel.start()
    panel.job.end()
    panel.job.result = TaskResult("", controllers={"optimum": make_controller("ramp")})
    session.load(Drive.load("hoist-15kw"))
    with pytest.raises(InputError, match="another drive is loaded now: it is not added"):
        panel.refresh()  # it would be added at once
    with pytest.raises(InputError, match="another drive is loaded now: it is not added"):
        panel.add("optimum")
    assert list(session.inputs.controllers) == ["direct"]
    session.undo()
    panel.add("optimum")
    assert list(session.inputs.controllers) == ["direct", "optimum"]


def test_a_pasted_profile_joins_the_strategies_and_a_wrong_one_is_said(client: Any) -> None:
    from softstart.page.files_panel import StrategyText

    session = Session(controllers=["direct"])
    with client:
        panel = StrategyText(session, "A")
        for text, version in (("0 20\n0.1 62", 1), ("0 20\n9 62", 1), ("[motor]", 1), ("", 1)):
            panel._text.set_value(text)
            panel._add()
            assert session.version == version
    assert session.added == ("mine",)


def test_a_machine_beside_this_one_is_that_as_loaded_of_the_project_or_shipped(client: Any) -> None:
    from softstart.page.files_panel import AS_LOADED, BesidePanel
    from softstart.project import Project

    worn = Drive.load("crane-4amtkf").replace(gap=2.0)
    session = Session(Project.new("crane-4amtkf").added("worn", worn).replace(beside="worn"), ["direct"])
    session.set("gap", 1.0)
    with client:
        panel = BesidePanel(session, "A", Queue())
        assert panel._other.choice.options[:2] == [AS_LOADED, "worn"]
        for name, other in (
            ("worn", worn),
            (AS_LOADED, session.inputs.origin),
            ("hoist-15kw", Drive.load("hoist-15kw")),
        ):
            panel._other.choice.set_value(name)
            function, first, second, controllers = panel.task()
            assert (first.gap, second) == (1.0, other)
    result = function(first, second, controllers, progress=lambda share, what: None)
    assert "K_dyn" in result.html.replace("<sub>dyn</sub>", "_dyn")


def test_a_drive_of_the_project_or_a_shipped_one_is_chosen(client: Any) -> None:
    from softstart.page.files_panel import DriveChoice
    from softstart.project import Project

    worn = Drive.load("crane-4amtkf").replace(gap=2.0)
    session = Session(Project.new("crane-4amtkf").added("worn", worn).replace(customer="Harbour"), ["direct"])
    with client:
        files = DriveChoice(session, "A")
        for name, drive in (("project: worn", worn), ("hoist-15kw", Drive.load("hoist-15kw"))):
            files.choice.set_value(name)
            assert session.inputs.machine == drive
            assert (files.choice.value, session.inputs.project.customer) == ("", "Harbour")
            files._offer()
    assert list(files.choice.options)[:3] == ["", "project: worn", "project: crane-4amtkf"]


def test_tuning_begins_with_the_selected_strategy(client: Any) -> None:
    from softstart.page.panels import TuningPanel

    session = Session("crane-4amtkf")
    session.select("ramp")
    with client:
        panel = TuningPanel(session, "A", Queue())
        assert panel.controller.value == "ramp"
        panel.controller.set_value("shaped")
        session.set("gap", 1.0)
        panel._offer()
        assert panel.controller.value == "shaped"  # chosen here
        session.select("s-curve")
        panel._offer()
        assert panel.controller.value == "s-curve"
        session.select("direct")  # has nothing to tune
        panel._offer()
        assert panel.controller.value == "s-curve"
