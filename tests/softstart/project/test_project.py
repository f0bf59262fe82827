"""A project that is saved, moved and opened again is the same to the bit; a damaged one is refused whole."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.variants import machines, variants

from softstart import Chain, Drive, Duty, InputError, OptimumError, TorqueProfile, optimize, simulate
from softstart.controller import make_controller
from softstart.controller.tuned import GainSchedule, RobustGains
from softstart.optimal.check import replayed
from softstart.optimal.problem import Problem
from softstart.optimal.result import LowerBound
from softstart.project import Project, StoredOptimum
from softstart.project.file import FIRST, LAST
from softstart.project.parts import StoredMachine, file_of, player_of, strategy_of

CRANE = Drive.load("crane-4amtkf")
FAST = CRANE.replace(target_speed=60.0)
SLOW = 'kind = "settings"\ncontroller = "ramp"\n\n[parameters]\ntime = "200 ms"\n'


def moved(project: Project) -> Project:
    """The project after it was saved, and its file moved to another folder, under another name."""
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        project.save(Path(one) / "job.toml")
        assert [path.name for path in Path(one).iterdir()] == ["job.toml"]  # no temporary file is left
        shutil.move(Path(one) / "job.toml", Path(other) / 'äther "x".toml')
        return Project.open(Path(other) / 'äther "x".toml')


def full() -> Project:
    """A project with each kind of part."""
    project = (
        Project.new("crane-4amtkf").added("slow", SLOW).added("mine", TorqueProfile([0.0, 0.1], [20, 62]))
    )
    project = project.added("hoist", Duty.load("hoist")).added("robust", RobustGains("", ramp(0.12), CRANE))
    return project.replace(notes="gap measured\non site\n", customer="A 'B' \"C\"", strategy="slow")


def ramp(time: float) -> Any:
    return make_controller("ramp", {"time": time})


positive = st.floats(1e-3, 1e3)


@settings(max_examples=40)
@given(
    st.builds(
        lambda gap, c, J2, Ms, name: CRANE.replace(
            gap=gap, stiffness=c, load_inertia=J2, starting_torque=Ms, maximum_torque=2.0 * Ms, name=name
        ),
        st.floats(0.0, 10.0), positive, positive, st.floats(8.0, 1e3),
        st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=9),
    ),
    st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-99.0, 99.0)), min_size=1, max_size=9),
    st.floats(1e-3, 1.0),
    st.text(max_size=30),
)  # fmt: skip
def test_what_is_saved_is_what_is_opened(drive: Any, knots: Any, time: float, notes: str) -> None:
    times, torques = np.cumsum([0.0, *(step for step, _ in knots)])[:-1], [torque for _, torque in knots]
    profile = TorqueProfile(times, torques, TorqueProfile([0.0], [torques[0]]))
    schedule = GainSchedule(
        "grid", ramp(0.2), (0.5, 1.0), (0.1,), (("time", "linear", np.array([[time], [1]])),)
    )
    project = (
        Project.new(drive)
        .added("profile", profile)
        .added("robust", RobustGains("robust", ramp(time), drive, (0.5, 1.0), (time,)))
    )
    project = project.added("grid", schedule).replace(machine=drive.name, notes=notes or "none")
    optimum = StoredOptimum(
        name="best",
        machine=drive.name,
        end_time=time,
        claimed=time,
        terminal="reached",
        file=profile.toml_text(),
    )
    project = project.with_part(optimum)
    again = moved(project)
    assert again == project
    assert again.single() == drive
    found: Any = again.controller("robust")
    assert (found.nominal, found.controller.time, found.name) == (drive, time, "ramp (robust)")
    assert (found.gaps, found.load_inertias) == ((0.5, 1.0), (time,))
    for own in (again.controller("profile"), again.controller("best")):
        played: Any = own
        assert played.profile.time.tobytes() == profile.time.tobytes()
        assert played.profile.torque.tobytes() == profile.torque.tobytes()
        assert played.profile.after_contact.torque.tolist() == [torques[0]]
    grid: Any = again.controller("grid")
    assert grid.gains_at(0.7, 0.1) == schedule.gains_at(0.7, 0.1)
    assert moved(again).to_toml() == project.to_toml()


@pytest.mark.parametrize("machine", machines(), ids=lambda one: one.name)
def test_every_machine_is_kept(machine: Any) -> None:
    for _, variant in [("", machine), *list(variants(machine))[:40]]:
        project = Project.new(variant)
        assert Project.read(project.to_toml()).single() == variant


def test_starts_have_the_same_numbers() -> None:
    project = full()
    again = moved(project)
    for name in ("slow", "mine", "robust", "shaped"):
        one, other = (simulate(each.single(), each.controller(name)) for each in (project, again))
        assert (one.k_dyn, one.start_time, one.controller_name) == (
            other.k_dyn,
            other.start_time,
            other.controller_name,
        )
    assert simulate(CRANE, ramp(0.2)).k_dyn == simulate(again.single(), again.controller()).k_dyn
    assert again.replace(duty="hoist").single().duty == Duty.load("hoist")


def test_a_profile_with_a_sample_period_is_kept_as_it_is_played(tmp_path: Path) -> None:
    """From Python and from a file, of which the project does not keep the name."""
    ramp = TorqueProfile([0.0, 0.1, 0.3], [10.0, 62.0, 55.0])
    ramp.to_toml(tmp_path / "ramp.toml")
    for given_as in ({"profile": ramp}, {"file": str(tmp_path / "ramp.toml")}):
        player = make_controller("profile", {**given_as, "period": 0.05})
        again = strategy_of(file_of(player), "again")
        assert simulate(CRANE, again).k_dyn == pytest.approx(simulate(CRANE, player).k_dyn, rel=1e-12)
    waiting = TorqueProfile([0.0], [30.0], after_contact=ramp)
    again = strategy_of(file_of(player_of(waiting, "w")), "w")
    assert simulate(CRANE, again).k_dyn == simulate(CRANE, player_of(waiting, "w")).k_dyn
    with pytest.raises(InputError, match="set the period to 0"):
        file_of(make_controller("profile", {"profile": waiting, "period": 0.05}))


def test_an_optimum_is_checked_on_the_machine() -> None:
    best = optimize(FAST, 0.2883042)
    project = Project.new(FAST).with_part(StoredOptimum.of(best, "best", FAST.name))
    (stored,) = moved(project).optima
    assert [run.k_dyn for run in stored.checked(project.single())] == [run.k_dyn for run in best.runs]
    for wrong in ({"claimed": 0.8}, {"bound": 0.95}, {"end_time": 0.25}):
        with pytest.raises(OptimumError):
            stored.replace(**wrong).checked(project.single())
    with pytest.raises(OptimumError):  # on another machine it does not hold
        stored.checked(FAST.replace(gap=1.0))


def test_an_optimum_of_several_machines_and_of_a_curve_is_checked_on_all_of_them() -> None:
    worn, profile = FAST.replace(gap=0.75), TorqueProfile([0.0], [62.0])
    curve = ((0.0, 62.0), (200.0, 62.0), (300.0, 10.0))
    problem = Problem(FAST, 0.5, "reached", scenarios=(worn,), base=CRANE, torque_speed=curve)
    runs = replayed(problem, profile, 0.4)
    k_dyn = max(run.peak_torque for run in runs) / problem.base_torque
    best: Any = SimpleNamespace(
        problem=problem,
        profile=profile,
        end_time=0.4,
        minimised=k_dyn,
        bound=LowerBound(0.9, "momentum", "all"),
    )
    with pytest.raises(InputError, match="1 further machines and a base"):
        StoredOptimum.of(best, "both", "new")
    stored = StoredOptimum.of(best, "both", "new", ["worn"], "own")
    project = Project(
        machines=[StoredMachine(name=name, file=machine.to_toml())
                  for name, machine in (("new", FAST), ("worn", worn), ("own", CRANE))],
        machine="new", optima=[stored],
    )  # fmt: skip
    (again,) = moved(project).optima
    assert again.machines == ("new", "worn", "own")
    assert again.curve_torque == (62.0, 62.0, 10.0)
    assert [run.k_dyn for run in again.checked(FAST, worn, CRANE)] == [run.k_dyn for run in runs]
    with pytest.raises(OptimumError, match="re-simulation"):
        again.checked(FAST, FAST.replace(gap=2.0), CRANE)
    with pytest.raises(OptimumError, match="torque-speed"):
        again.replace(curve_torque=(40.0, 30.0, 10.0)).checked(FAST, worn, CRANE)
    with pytest.raises(InputError, match="the project has no such machine"):
        project.replace(optima=[stored.on(["new", "gone", "own"])])
    with pytest.raises(InputError, match="as many of each"):
        stored.replace(curve_torque=(62.0,))


def test_a_truncated_file_is_refused_and_a_file_is_never_half_written(tmp_path: Path) -> None:
    path, text = tmp_path / "job.toml", full().to_toml()
    for end in range(len(FIRST), len(text) - len(LAST), 97):
        path.write_text(text[:end], encoding="utf-8")
        with pytest.raises(InputError) as refused:
            Project.open(path)
        assert len(refused.value.sentences) == 1
        assert str(path) in str(refused.value)
        assert "the file is cut off" in str(refused.value)  # not that half a line is no TOML
        assert path.read_text(encoding="utf-8") == text[:end]
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        full().replace(notes="x" * 2_000_000).save(path)  # more than can be read
    assert path.read_text(encoding="utf-8") == text
    with pytest.raises(InputError, match="cannot be written"):
        full().save(tmp_path / "nowhere" / "job.toml")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("version = 1", "version = 2", "version = 2: this project was written by a later softstart"),
        ("version = 1", "version = 0", "whole number"),
        ('strategy = "slow"', 'strategy = "slwo"', 'did you mean "slow"?'),
        ('machine = "crane-4amtkf"', 'machine = "crane"', "the project has no such machine"),
        ('machine = "crane-4amtkf"', 'machine = "crane-4amtkf"\nduty = "hoits"', 'did you mean "hoist"?'),
        ("gap = 0.5 ", "gap = -0.5 ", 'machine "crane-4amtkf": [shaft] gap = -0.5'),
        ('controller = "ramp"\n\n[parameters]\ntime = "200 ms"', 'controller = "rmap"\n[parameters]', "slow"),
        ("time = [", "times = [", 'strategy "mine": [profile] has no key'),
        ('do = "start"', 'do = "strat"', 'duty "hoist"'),
        ("[[strategy]]", "[[stratgy]]", "a project file has no key stratgy"),
        ('name = "mine"', 'name = "slow"', "the name is given twice"),
    ],
)  # fmt: skip
def test_an_edited_file_is_refused_in_a_sentence(old: str, new: str, sentence: str) -> None:
    text = full().to_toml()
    assert old in text
    with pytest.raises(InputError) as refused:
        Project.read(text.replace(old, new, 1), "job.toml")
    assert sentence in str(refused.value)
    assert str(refused.value).startswith("job.toml: ")


def test_machines_of_two_kinds_do_not_stand_side_by_side() -> None:
    project = Project.new("crane-4amtkf").added("chain", Chain.load("crane-4-mass"))
    with pytest.raises(InputError, match=r"beside = .*: it is a chain and .* a drive; "):
        project.replace(beside="chain")
    assert project.added("worn", CRANE.replace(gap=2.0)).replace(beside="worn").beside == "worn"


def test_texts_that_toml_must_escape_are_kept() -> None:
    for text in (
        "a'''b\n",
        "tab\there\n",
        "\x7f\n",
        "ends with '\n'",
        "\n\nfirst\n",
        "[[machine]]\nname = 'x'\n",
    ):
        project = Project().replace(notes=text)
        assert Project.read(project.to_toml()).notes == text


def test_what_is_none_of_them_is_refused(tmp_path: Path) -> None:
    (tmp_path / "about.toml").write_text("[about]\nx = 1\n")
    with pytest.raises(InputError, match="a drive has no such table"):
        Project.new(tmp_path / "about.toml")
    with pytest.raises(InputError, match="there is no such file"):
        Project.new(tmp_path / "nowhere.toml")
    assert player_of(TorqueProfile([0.0], [1.0]), "mine").name == "mine"


def test_a_logo_moves_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "logo.svg").write_text("<svg/>")
    (tmp_path / "job.toml").write_text('[project]\nlogo = "logo.svg"\n')
    project = Project.open(tmp_path / "job.toml")
    assert project.logo.startswith("data:image/svg+xml;base64,")
    assert moved(project) == project


@pytest.mark.parametrize("duty_first", [False, True])
def test_a_duty_at_the_output_goes_through_the_gear_of_the_machine(tmp_path: Path, duty_first: bool) -> None:
    geared = Drive.load("crane-4amtkf").replace(gear_ratio=40, gear_efficiency=0.8)
    (tmp_path / "geared.toml").write_text(geared.to_toml())
    step = '[[duty]]\ndo = "load"\ntorque = "96 N*m at output"\n'
    (tmp_path / "carry.toml").write_text(step)
    files = [str(tmp_path / name) for name in ("geared.toml", "carry.toml")]
    project = Project.new(*files[:: -1 if duty_first else 1]).replace(duty="carry")
    assert Project.from_toml(project.to_toml()).single().duty == Duty.read_for(geared, step)
    assert project.single().duty.steps[0].torque == pytest.approx(3.0)
    bare = Project.new("crane-4amtkf", files[1]).replace(duty="carry")
    with pytest.raises(InputError, match=r'duty "carry": .duty. 1, torque = .* without gear.ratio nothing'):
        bare.single()
