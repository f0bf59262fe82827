"""The project of a page: saved and opened to the bit, undone, and a refused file changes nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from softstart import Drive, Duty, InputError, TorqueProfile, optimize, simulate
from softstart.controller import make_controller
from softstart.controller.tuned import RobustGains
from softstart.page.controls import Controls
from softstart.page.downloads import profile_file
from softstart.page.frames import FrameBuilder
from softstart.page.links import inputs_of, link_of
from softstart.page.project import other_machines, project_of, take_file, take_text, turn_to
from softstart.page.session import ClaimedOptimum, Session
from softstart.project import Project, StoredOptimum
from softstart.project.parts import file_of, player_of

CRANE = Drive.load("crane-4amtkf")
PROFILE = TorqueProfile([0.0, 0.1, 0.1], [20.0, 50.0, 62.0])
GAINS = RobustGains("robust", make_controller("ramp", {"time": 0.15}), CRANE)


def worked_on() -> Session:
    """A session with own gains, a profile, changed parameters, a duty and another gap."""
    session = Session(controllers=["direct", "ramp", "s-curve"])
    session.add("profile 1", player_of(PROFILE, "profile 1"))
    session.add("ramp (robust)", GAINS)
    session.select("ramp")
    session.set_parameter("time", "200 ms")
    session.set("shaft.gap", "0.7 rad")
    session.set("limits.shaft_torque", "150 N*m")
    take_text(session, Duty.load("travel-crane").to_toml(), "shift")
    return session


def test_own_strategies_are_renamed_saved_and_undone() -> None:
    drive = CRANE.replace(target_speed=60.0)
    session = Session(drive, controllers=["direct", "ramp"])
    session.add("profile 1", player_of(PROFILE, "profile 1"))
    session.add("ramp (robust)", GAINS)
    best = optimize(drive, 0.2883042)
    claims = StoredOptimum.of(best, "best", drive.name)
    session.add("best", claims.controller, optimum=ClaimedOptimum(drive, claims), select=False)
    session.select("profile 1")
    session.set_reference()
    before, known = session.inputs, figures(session)
    names = {"profile 1": "by hand", "ramp (robust)": "ramp (night)", "best": "lowest"}
    for one, name in names.items():
        session.rename(one, name)
    assert figures(session) == {names.get(one, one): value for one, value in known.items()}
    assert session.inputs.selected == "by hand"
    assert session.inputs.visible == {names.get(one, one) for one in before.visible}
    shown = {one: session.inputs.controllers[one].name for one in ("by hand", "ramp (night)")}
    assert shown == {"by hand": "by hand", "ramp (night)": "ramp (night)"}
    project = project_of(session)
    assert ([one.name for one in project.strategies], [one.name for one in project.optima]) == (
        ["by hand", "ramp (night)"], ["lowest"],
    )  # fmt: skip
    assert project.optima[0].checked(project.single())
    other = Session(project, controllers=["direct", "ramp"])
    assert figures(other) == figures(session)
    other.rename("lowest", "quick")  # of a project that was opened
    other.rename("by hand", "mine")
    again = project_of(other)
    assert ([one.name for one in again.optima], again.strategy) == (["quick"], "mine")
    assert again.optima[0].checked(again.single())
    for _ in names:
        session.undo()
    assert session.inputs is before


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("direct", 'name = "direct": there is a strategy of this name already; write another name'),
        ("s-curve", 'name = "s-curve": there is a strategy of this name already'),  # not in this table
        (" ", 'name = "": the field is empty'),
    ],
)
def test_a_name_that_cannot_be_taken_changes_nothing(name: str, says: str) -> None:
    session = Session(controllers=["direct", "ramp"])
    session.add("profile 1", player_of(PROFILE, "profile 1"))
    before = session.inputs
    with pytest.raises(InputError, match=says):
        session.set("strategy.name", name)
    with pytest.raises(InputError, match='strategy "direct": it is one of softstart and keeps its name'):
        session.rename("direct", "mine")
    assert session.inputs is before


def test_the_name_is_a_field_of_own_strategies_alone() -> None:
    session = Session(controllers=["direct", "ramp"])
    frames = FrameBuilder(session)
    controls = Controls(session, frames, lambda: None)
    assert "strategy.name" not in frames.entries
    session.add("profile 1", player_of(PROFILE, "profile 1"))
    frame = frames.main_frame()
    assert frame["fields"]["strategy.name"] == {"text": "profile 1"}
    controls.take({"what": "edit", "path": "strategy.name", "text": "by hand"})
    frame = frames.main_frame()
    assert (frame["selected"], frame["fields"]["strategy.name"]) == ("by hand", {"text": "by hand"})
    controls.take({"what": "edit", "path": "strategy.name", "text": "direct"})
    assert "of this name already" in frames.main_frame()["mistakes"]["strategy.name"]


def figures(session: Session) -> dict[str, tuple[float, float]]:
    """K_dyn and start time by label."""
    return {
        label: (session.result(label).k_dyn, session.result(label).start_time)
        for label in session.inputs.controllers
    }


def test_a_saved_page_is_opened_with_the_same_numbers_and_undone(tmp_path: Path) -> None:
    session = worked_on()
    project_of(session).save(tmp_path / "job.toml")
    other = Session("hoist-15kw", controllers=["direct", "ramp", "s-curve"])
    before = other.inputs
    take_file(other, (tmp_path / "job.toml").read_bytes(), "job.toml")
    assert other.inputs.machine == session.inputs.machine
    assert other.inputs.selected == "ramp"
    assert figures(other) == figures(session)
    assert other.inputs.duty == session.inputs.duty
    assert other.inputs.controllers["ramp"].time == 0.2
    assert other.changed == ("ramp",)
    assert project_of(other) == project_of(session)
    other.undo()
    assert other.inputs is before
    other.redo()
    assert figures(other) == figures(session)
    started = Session(Project.open(tmp_path / "job.toml"), ["direct", "ramp", "s-curve"])
    assert figures(started) == figures(session)
    assert started.steps == (0, 0)


def test_what_the_page_writes_it_reads() -> None:
    for content, name in (
        (CRANE.replace(gap=1.0).to_toml(), "drive.toml"),
        (file_of(GAINS), "robust.toml"),
        (file_of(make_controller("ramp", {"time": 0.3})), "slow.toml"),
        (Duty.load("travel-crane").to_toml(), "duty.toml"),
        (project_of(worked_on()).to_toml(), "project.toml"),
        *(
            (profile_file(PROFILE, "mine", suffix, {"drive": "x"})[1], f"mine{suffix}")
            for suffix in (".csv", ".toml")
        ),
    ):
        session = Session(controllers=["direct", "ramp", "s-curve"])
        take_file(session, content.encode(), name)
        assert session.version == 1, name
        added = session.inputs.controllers.get(Path(name).stem)
        if added is not None:
            own: Any = {"mine": player_of(PROFILE, "mine"), "robust": GAINS}.get(
                Path(name).stem, make_controller("ramp", {"time": 0.3})
            )
            assert session.result(Path(name).stem).k_dyn == simulate(CRANE, own).k_dyn


def test_a_pasted_profile_is_simulated_at_once_and_a_longer_one_is_refused() -> None:
    session = Session(controllers=["direct"])
    take_text(session, "time [ms]\ttorque [N m]\n0\t20,5\n100\t62\n", "pasted")
    assert session.result("pasted").k_dyn == simulate(CRANE, ([0.0, 0.1], [20.5, 62.0])).k_dyn
    before = session.inputs
    with pytest.raises(
        InputError, match=r'strategy "long": its torque changes until 100 s, and the start of '
    ):
        take_text(session, "time,torque\n0,20\n100,62\n", "long")
    for text in (
        "time,torque\n0,20\n0.1\n",
        "version = 2",
        "version = 1\n[[machine]]\nname = 'x'",
        "kind = 'robust set'",
        'kind = "settings"\ncontroller = "profile"\n[parameters]\nfile = "/etc/passwd"\n',
    ):
        with pytest.raises(InputError):
            take_text(session, text, "wrong")
    assert session.inputs is before


def test_another_drive_loses_nothing_of_a_project() -> None:
    session = worked_on()
    session.open(project_of(session).replace(notes="on site", customer="Harbour"))
    session.set("shaft.gap", "0.9 rad")
    take_text(session, Drive.load("conveyor-11kw").to_toml(), "conveyor")
    project = project_of(session)
    assert [one.name for one in project.machines] == [Drive.load("conveyor-11kw").name, CRANE.name]
    assert project.single(CRANE.name).gap == 0.9
    assert {one.name for one in project.strategies} >= {"profile 1", "ramp (robust)"}
    assert (project.notes, project.customer) == ("on site", "Harbour")
    session.undo()
    assert session.inputs.machine.gap == 0.9
    session.remove("profile 1")
    assert "profile 1" not in [one.name for one in project_of(session).strategies]


def test_an_optimum_keeps_its_claims_on_the_page() -> None:
    fast = CRANE.replace(target_speed=60.0, name="fast")
    best = optimize(fast, 0.2883042)
    stored = StoredOptimum.of(best, "best", "fast")
    session = Session(Project.new(fast).with_part(stored), ["direct"])
    assert session.result("best").k_dyn == best.k_dyn
    assert project_of(session).optima == (stored,)
    assert project_of(session).strategies == ()


def test_an_optimum_of_the_page_is_saved_with_its_claims_on_the_machine_as_it_was() -> None:
    fast = CRANE.replace(target_speed=60.0, name="fast")
    best = optimize(fast, 0.2883042)
    session = Session(fast, ["direct"])
    claimed = ClaimedOptimum(fast, StoredOptimum.of(best, "best", "fast"))
    session.add("own label", player_of(best.profile, "best"), optimum=claimed)
    session.set("limits.shaft_torque", "150 N*m")  # bounds no start

    def names_and_k_dyn(project: Project) -> tuple[list[str], str, float]:
        (one,) = project.optima
        (run,) = one.checked(*map(project.single, one.machines))
        assert (one.name, one.start_time, one.bound) == ("own label", 0.2883042, best.bound.k_dyn)
        return [machine.name for machine in project.machines], one.machine, run.k_dyn

    assert names_and_k_dyn(project_of(session)) == (["fast"], "fast", best.k_dyn)
    session.set("shaft.gap", 0.7)
    other = "fast for own label"
    saved = Project.read(project_of(session).to_toml())
    assert names_and_k_dyn(saved) == (["fast", other], other, best.k_dyn)
    assert saved.single().gap == 0.7
    again = Session(saved, ["direct"])
    again.set("shaft.gap", 0.9)
    assert names_and_k_dyn(project_of(again)) == (["fast", other], other, best.k_dyn)
    again.set("shaft.gap", fast.gap)
    assert names_and_k_dyn(project_of(again))[1] == "fast"
    again.load(CRANE)  # the project keeps the optimum and its machine
    assert names_and_k_dyn(project_of(again))[2] == best.k_dyn
    again.undo()
    again.add("own label", player_of(PROFILE, "own label"))  # another start takes its name
    assert project_of(again).optima == ()
    session.remove("own label")
    assert project_of(session).optima == ()


def test_names_and_notes_are_edited_and_undone() -> None:
    session = Session(controllers=["direct"])
    session.describe("customer", " Harbour & Co ")
    session.describe("notes", "gap measured\non site")
    before = session.inputs
    session.describe("customer", "Harbour & Co")
    assert session.inputs is before
    project = Project.read(project_of(session).to_toml())
    assert (project.customer, project.notes) == ("Harbour & Co", "gap measured\non site")
    with pytest.raises(InputError, match="one line"):
        session.describe("author", "two\nlines")
    session.describe("customer", "")
    assert project_of(session).customer == ""
    session.undo()
    assert project_of(session).customer == "Harbour & Co"


def test_the_page_turns_to_another_machine_of_the_project_and_back() -> None:
    session = worked_on()
    session.open(project_of(session).added("worn", CRANE.replace(gap=2.0, name="the worn one")))
    session.set("shaft.gap", "0.9 rad")
    now, before = session.inputs.project.machine, figures(session)
    assert other_machines(session) == ["worn"]
    turn_to(session, "worn")
    assert session.inputs.machine.gap == 2.0
    assert (session.inputs.selected, session.inputs.controllers["ramp"].time) == ("ramp", 0.2)
    assert other_machines(session) == [now]
    turn_to(session, now)
    assert session.inputs.machine.gap == 0.9
    assert figures(session) == before
    session.undo()
    session.undo()
    assert figures(session) == before
    session.load(Drive.load("conveyor-11kw"))
    assert other_machines(session) == [now, "worn"]


def test_a_page_that_is_reloaded_by_its_link_keeps_the_project() -> None:
    """A server that was started again knows the file it was given, and the address of the tab."""
    session = worked_on()
    session.describe("customer", "Harbour")
    session.open(project_of(session).added("worn", CRANE.replace(gap=2.0, name="the worn one")))
    given = session.inputs.project
    for name in (given.machine, "worn"):
        if name != session.inputs.project.machine:
            turn_to(session, name)
        session.set("shaft.damping", 0.1)
        again = Session(given, ["direct", "ramp", "s-curve"])
        again.restore(inputs_of(link_of(session.inputs), again.inputs))
        assert figures(again) == figures(session)
        project = project_of(again)
        assert (project.customer, project.machine) == ("Harbour", name)
        assert project.single() == project_of(session).single()
        assert {one.name for one in project.strategies} >= {"profile 1", "ramp (robust)"}
    other = Session("hoist-15kw", ["direct"])
    other.restore(inputs_of(link_of(session.inputs), other.inputs))
    assert project_of(other).customer == ""
